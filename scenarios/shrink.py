"""Make a failing scene plain: fewer leaks, effects off, round numbers, fewer and smaller frames, the code the same.

Greedy: of all ways to make the scene plainer the first that keeps the outcome code is taken, the boldest being tried
first, until none does (delta debugging: Zeller and Hildebrandt, IEEE Trans. Software Eng. 28, 2002). Plain is the
shipped scenario `plain`, from which failing scenes are told as differences.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from pydantic import ValidationError

from scenarios.estimators import EstimatorSpec
from scenarios.failures import failure_codes
from scenarios.leaks import draw_layout
from scenarios.reductions import MOVED_LAST, PLACES_FIRST, TABLES_FIRST, Reduction, with_leaks
from scenarios.rules import violations
from scenarios.scenario import LeakTable, Scenario
from scenarios.scene_file import conditions, scene_toml
from scenarios.scene_work import MethodOutcome, SceneWork, outcome_of

APART_M = 0.4
"""Leaks are not moved nearer to each other than this: they would merge, which is another failure."""

MAX_TRIED = 300
FEW_CONDITIONS = 3
"""With more the leaks are put on round places first: a failure at a place is lost when all else is changed before."""

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
    start: Scenario, fails: Callable[[Scenario], bool], leak: int | None, steps: Sequence[Reduction]
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


def plainer_scenes(scenario: Scenario, steps: Sequence[Reduction]) -> Iterator[Scenario]:
    """Yield scenes that may be a step plainer, by the steps in their order, the boldest first."""
    if scenario.layout is not None:  # places first: nothing else can be taken from leaks that are drawn
        yield scenario.model_copy(update={"layout": None, "leak": _leaks_of(scenario)})
        return
    for step in steps:
        yield from step(scenario)


def _alone(scenario: Scenario, leak: int | None) -> Iterator[Scenario]:
    """One leak alone, as long as no other is gone."""
    if leak is not None and scenario.layout is None and leak < len(scenario.leak):
        yield with_leaks(scenario, [scenario.leak[leak]])
