"""Make a failing scene plain: fewer leaks, effects off, round numbers, fewer and smaller frames, the code the same.

Greedy: of all ways to make the scene plainer the first that keeps the outcome code is taken, the boldest being tried
first, until none does (delta debugging: Zeller and Hildebrandt, IEEE Trans. Software Eng. 28, 2002). Plain is the
shipped scenario `plain`, from which failing scenes are told as differences.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from pydantic import BaseModel, ValidationError

from scenarios.estimators import EstimatorSpec
from scenarios.failures import failure_codes
from scenarios.leaks import draw_layout
from scenarios.replay import PLAIN
from scenarios.rules import violations
from scenarios.scenario import LeakTable, Scenario
from scenarios.scenario_file import read_scenario
from scenarios.scene_file import FRAMES, PICTURES_PX, conditions, scene_toml
from scenarios.scene_work import MethodOutcome, SceneWork, outcome_of

PLACES_M = (1.0, 0.5, 0.25, 0.1, 0.05, 0.02)
"""Grids that a leak is put on, the coarsest first."""

ELSEWHERE_M = (0.05, -0.05, 0.1, -0.1)
"""How far leaks may move, along x or y, when all else is made plain: by then few fields are left."""

APART_M = 0.4
"""Leaks are not moved nearer to each other than this: they would merge, which is another failure."""

SEEDS = (0, 1, 2, 3)
MAX_TRIED = 300
TABLES = ("believed_rig", "rig", "recording", "gamma", "sensor", "effects", "pedestal", "lamp", "structure")
SIZES = {"width_px", "height_px", "n_frames"}
FEW_CONDITIONS = 3
"""With more the leaks are put on round places first: a failure at a place is lost when all else is changed before."""

Step = Callable[[Scenario], Iterator[Scenario]]
"""Scenes that may be plainer in one respect."""

Codes = Callable[[Scenario], set[str]]
"""Failure codes of a scene."""


class NothingFailsError(ValueError):
    """A scene to shrink in which nothing is wrong; the message says what came out."""


@dataclass(frozen=True)
class Shrunk:
    """A failing scene made plain, its code, and how many scenes were tried for it."""

    scenario: Scenario
    code: str
    n_tried: int


def shrink(scenario: Scenario, code: str | None, codes: Codes, leak: int | None = None) -> Iterator[Shrunk]:
    """Yield ever plainer scenes with the same failure code: the scene's own first, the plainest last.

    `leak` is the one that the failure befell, where that is known: it is the first to be left alone, lest the failure
    of another leak with the same code take its place.

    `code` None is the first, in alphabetical order, of the scene's own; missed and bad leaks before false ones. Raises
    NothingFailsError when the scene has no failure, or not that one.
    """
    there = sorted(codes(scenario), key=lambda one: (one.startswith("false"), one))
    if not there or code not in (None, *there):
        wanted = "a failure" if code is None else code
        raise NothingFailsError(f"{scenario.name or 'scenario'}: must have {wanted}, has {', '.join(there) or 'none'}")
    wanted_code = code or there[0]
    known: dict[str, bool] = {}
    apart_m = min(APART_M, least_distance_m(scenario))  # of leaks that are drawn as well

    def fails(candidate: Scenario) -> bool:
        key = candidate.model_dump_json()
        if key not in known and len(known) >= MAX_TRIED:
            return False
        if key not in known:
            possible = is_possible(candidate) and least_distance_m(candidate) >= apart_m
            known[key] = possible and wanted_code in codes(candidate)
        return known[key]

    best = start = scenario.model_copy(update={"name": "", "description": ""})
    yield Shrunk(best, wanted_code, 1)
    for steps in (TABLES_FIRST, PLACES_FIRST, MOVED_LAST):
        for now in _ever_plainer(best if steps is MOVED_LAST else start, fails, leak, steps):
            if complexity(now) < complexity(best):
                best = now
                yield Shrunk(best, wanted_code, len(known) + 1)
        if len(conditions(best)) <= FEW_CONDITIONS or len(known) >= MAX_TRIED:
            return


def _ever_plainer(
    start: Scenario, fails: Callable[[Scenario], bool], leak: int | None, steps: Sequence[Step]
) -> Iterator[Scenario]:
    """Go from a scene to a plainer one that fails until there is none."""
    now: Scenario | None = start
    while now is not None:
        size = complexity(now)
        everything = itertools.chain(_alone(now, leak), plainer_scenes(now, steps))
        now = next((one for one in everything if complexity(one) < size and fails(one)), None)
        if now is not None:
            yield now


def codes_of(estimator: EstimatorSpec) -> Codes:
    """Return the function that renders a scene, runs an estimator and tells the failure codes, in this process."""
    return lambda scenario: failure_codes(run_of(scenario, estimator))


def run_of(scenario: Scenario, estimator: EstimatorSpec) -> MethodOutcome:
    """Render a scene and run an estimator on it."""
    return outcome_of(SceneWork(0, scenario, (estimator,), math.inf)).runs[0]


def complexity(scenario: Scenario) -> tuple[float, ...]:
    """What shrinking makes smaller, the first first: leaks left to chance, leaks, conditions, pixels, digits."""
    rig, recording = scenario.rig, scenario.recording
    left_open = scenario.layout is not None
    n_times = sum(leak.drop_times_s is not None for leak in scenario.leak)
    n_pixels = rig.width_px * rig.height_px * recording.n_frames
    text = scene_toml(scenario, ())
    return left_open, n_times, len(scenario.leak), len(conditions(scenario)), n_pixels, len(text)


def is_possible(scenario: Scenario) -> bool:
    """Whether a changed scene obeys every rule of scenario files: rounding may have passed a bound."""
    try:
        return not violations(Scenario.model_validate(scenario.model_dump()))
    except ValidationError:
        return False


def _leaks_of(scenario: Scenario) -> Sequence[LeakTable]:
    """The leaks that are stated, or those that the layout draws."""
    if scenario.layout is None:
        return scenario.leak
    return draw_layout(scenario.layout, scenario.pedestal, scenario.seed)


def least_distance_m(scenario: Scenario) -> float:
    """Distance of the two leaks that are nearest to each other; infinite with fewer than two."""
    leaks = _leaks_of(scenario)
    gaps = [math.hypot(a.x_m - b.x_m, a.y_m - b.y_m) for i, a in enumerate(leaks) for b in leaks[:i]]
    return min(gaps, default=math.inf)


def plainer_scenes(scenario: Scenario, steps: Sequence[Step]) -> Iterator[Scenario]:
    """Yield scenes that may be a step plainer, by the steps in their order, the boldest first."""
    if scenario.layout is not None:  # places first: nothing else can be taken from leaks that are drawn
        yield scenario.model_copy(update={"layout": None, "leak": _leaks_of(scenario)})
        return
    for step in steps:
        yield from step(scenario)


def _alone(scenario: Scenario, leak: int | None) -> Iterator[Scenario]:
    """One leak alone, as long as no other is gone."""
    if leak is not None and scenario.layout is None and leak < len(scenario.leak):
        yield _with_leaks(scenario, [scenario.leak[leak]])


def _without_times(scenario: Scenario) -> Iterator[Scenario]:
    if any(leak.drop_times_s is not None for leak in scenario.leak):
        yield _with_leaks(scenario, [leak.model_copy(update={"drop_times_s": None}) for leak in scenario.leak])


def _fewer_leaks(scenario: Scenario) -> Iterator[Scenario]:
    """One alone, then all but one."""
    leaks = scenario.leak
    if len(leaks) > 1:
        yield from (_with_leaks(scenario, [leak]) for leak in leaks)
        yield from (_with_leaks(scenario, [*leaks[:i], *leaks[i + 1 :]]) for i in range(len(leaks)))


def _plain_tables(scenario: Scenario) -> Iterator[Scenario]:
    """Everything but the leaks plain at once, then a table at a time; and the first draws."""
    plain = read_scenario(PLAIN)
    tables = {name: _plain_but_for_size(getattr(scenario, name), getattr(plain, name)) for name in TABLES}
    yield scenario.model_copy(update={**tables, "seed": 0})
    yield scenario.model_copy(update=tables)
    if scenario.seed not in SEEDS:
        yield from (scenario.model_copy(update={"seed": seed}) for seed in SEEDS)
    yield scenario.model_copy(update={"seed": 0})
    yield from (scenario.model_copy(update={name: table}) for name, table in tables.items())


def _plain_but_for_size(table: object, plain: object) -> object:
    if not (isinstance(table, BaseModel) and isinstance(plain, BaseModel)):
        return plain
    sizes = {name: getattr(table, name) for name in SIZES if hasattr(table, name)}
    return plain.model_copy(update=sizes)


def _plain_leaks(scenario: Scenario) -> Iterator[Scenario]:
    """A single leak where the plain scene has it; and leaks that drip as it does, wherever they are."""
    plain = read_scenario(PLAIN).leak[0]
    if len(scenario.leak) == 1:
        yield _with_leaks(scenario, [plain])
    drips = [plain.model_copy(update={"x_m": leak.x_m, "y_m": leak.y_m}) for leak in scenario.leak]
    yield _with_leaks(scenario, drips)
    for name in ("z_m", "drop_radius_m", "drip_period_s", "drip_jitter"):
        yield _with_leaks(scenario, [leak.model_copy(update={name: getattr(plain, name)}) for leak in scenario.leak])


def _plain_fields(scenario: Scenario) -> Iterator[Scenario]:
    plain = read_scenario(PLAIN)
    for name in TABLES:
        table, plain_table = getattr(scenario, name), getattr(plain, name)
        if isinstance(table, BaseModel):
            for field in type(table).model_fields:
                if field not in SIZES:
                    value = getattr(plain_table, field)
                    yield scenario.model_copy(update={name: table.model_copy(update={field: value})})


def _plain_fields_elsewhere(scenario: Scenario) -> Iterator[Scenario]:
    """A field plain and the leaks a little elsewhere: a place that fails may move when what it is seen by does."""
    for plainer in _plain_fields(scenario):
        for step_m, name in itertools.product(ELSEWHERE_M, ("x_m", "y_m")):
            steps = ((leak, {name: round(getattr(leak, name) + step_m, 9)}) for leak in scenario.leak)
            yield _with_leaks(plainer, [leak.model_copy(update=moved) for leak, moved in steps])


def _round_places(scenario: Scenario) -> Iterator[Scenario]:
    """Leaks on ever finer grids, all of them, then one alone; the middle line first."""
    for grid_m in PLACES_M:
        yield _with_leaks(scenario, [_on_grid(leak, grid_m) for leak in scenario.leak])
    for i, leak in enumerate(scenario.leak):
        others = scenario.leak
        for changed in (leak.model_copy(update={"y_m": 0.0}), *(_on_grid(leak, grid_m) for grid_m in PLACES_M)):
            if _roundness(changed) > _roundness(leak):
                yield _with_leaks(scenario, [*others[:i], changed, *others[i + 1 :]])


def _on_grid(leak: LeakTable, grid_m: float) -> LeakTable:
    """The leak on a grid, unless it stands on a coarser one already."""
    moved = {name: round(round(getattr(leak, name) / grid_m) * grid_m, 9) for name in ("x_m", "y_m")}
    return leak.model_copy(update=moved) if _roundness(leak.model_copy(update=moved)) > _roundness(leak) else leak


def _roundness(leak: LeakTable) -> int:
    """How many of the grids a leak's coordinates stand on, zero being on one more."""
    return sum(
        (value == 0.0) + sum(abs(value / grid - round(value / grid)) < 1e-6 for grid in PLACES_M)
        for value in (leak.x_m, leak.y_m)
    )


def _round_numbers(scenario: Scenario) -> Iterator[Scenario]:
    """Fields with fewer digits."""
    for name in TABLES:
        table = getattr(scenario, name)
        if not isinstance(table, BaseModel):
            continue
        for field in type(table).model_fields:
            value = getattr(table, field)
            if isinstance(value, float) and field not in SIZES:
                for digits in (1, 2, 3):
                    fewer = float(f"{value:.{digits}g}")
                    if len(f"{fewer:g}") < len(f"{value:.12g}"):
                        yield scenario.model_copy(update={name: table.model_copy(update={field: fewer})})
    for digits in (1, 2):
        for field in ("z_m", "drop_radius_m", "drip_period_s", "drip_jitter"):
            leaks = [
                leak.model_copy(update={field: float(f"{getattr(leak, field):.{digits}g}")}) for leak in scenario.leak
            ]
            digits_of = [sum(len(str(getattr(leak, field))) for leak in some) for some in (leaks, scenario.leak)]
            if digits_of[0] < digits_of[1]:
                yield _with_leaks(scenario, leaks)


def _smaller(scenario: Scenario) -> Iterator[Scenario]:
    """Smaller pictures and fewer frames."""
    for width, height in PICTURES_PX:
        if width < scenario.rig.width_px:
            rig = scenario.rig.model_copy(update={"width_px": width, "height_px": height})
            yield scenario.model_copy(update={"rig": rig})
    for n_frames in FRAMES:
        if n_frames < scenario.recording.n_frames:
            recording = scenario.recording.model_copy(update={"n_frames": n_frames})
            yield scenario.model_copy(update={"recording": recording})


def _with_leaks(scenario: Scenario, leaks: list[LeakTable]) -> Scenario:
    return scenario.model_copy(update={"leak": tuple(leaks)})


LEAKS_FIRST: tuple[Step, ...] = (_without_times, _fewer_leaks)
OTHERS: tuple[Step, ...] = (_plain_tables, _plain_leaks, _plain_fields)
SIZES_LAST: tuple[Step, ...] = (_round_numbers, _smaller)
TABLES_FIRST = (*LEAKS_FIRST, *OTHERS, _round_places, *SIZES_LAST)
PLACES_FIRST = (*LEAKS_FIRST, _round_places, *OTHERS, *SIZES_LAST)
MOVED_LAST = (*TABLES_FIRST, _plain_fields_elsewhere)
