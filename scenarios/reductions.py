"""Ways to make a scene plainer in one respect, the boldest first: `shrink` takes those that keep a failure.

Plain is the shipped scenario `plain`, from which failing scenes are told as differences.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence

from pydantic import BaseModel

from scenarios.replay import PLAIN
from scenarios.scenario import LeakTable, Scenario
from scenarios.scenario_file import read_scenario
from scenarios.scene_file import FRAMES, PICTURES_PX

PLACES_M = (1.0, 0.5, 0.25, 0.1, 0.05, 0.02)
"""Grids that a leak is put on, the coarsest first."""

ELSEWHERE_M = (0.05, -0.05, 0.1, -0.1)
ELSEWHERE_DEG = (-15, 15, -30, 30, -45, 45, -60, 60)
"""How far leaks may move, along x or y or around the middle, when all else is made plain: then few fields are left."""

SEEDS = (0, 1, 2, 3)
TABLES = ("believed_rig", "rig", "recording", "gamma", "sensor", "effects", "pedestal", "lamp", "structure")
SIZES = {"width_px", "height_px", "n_frames"}

Reduction = Callable[[Scenario], Iterator[Scenario]]
"""Scenes that may be plainer in one respect."""


def with_leaks(scenario: Scenario, leaks: Sequence[LeakTable]) -> Scenario:
    """Return a scene with other leaks."""
    return scenario.model_copy(update={"leak": tuple(leaks)})


def _without_times(scenario: Scenario) -> Iterator[Scenario]:
    if any(leak.drop_times_s is not None for leak in scenario.leak):
        yield with_leaks(scenario, [leak.model_copy(update={"drop_times_s": None}) for leak in scenario.leak])


def _fewer_leaks(scenario: Scenario) -> Iterator[Scenario]:
    """One alone, then all but one."""
    leaks = scenario.leak
    if len(leaks) > 1:
        yield from (with_leaks(scenario, [leak]) for leak in leaks)
        yield from (with_leaks(scenario, [*leaks[:i], *leaks[i + 1 :]]) for i in range(len(leaks)))


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
        yield with_leaks(scenario, [plain])
    drips = [plain.model_copy(update={"x_m": leak.x_m, "y_m": leak.y_m}) for leak in scenario.leak]
    yield with_leaks(scenario, drips)
    for name in ("z_m", "drop_radius_m", "drip_period_s", "drip_jitter"):
        yield with_leaks(scenario, [leak.model_copy(update={name: getattr(plain, name)}) for leak in scenario.leak])


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
    """A field plain and the leaks elsewhere: a place that fails may move when what it is seen by does."""
    for plainer in _plain_fields(scenario):
        yield from _leaks_elsewhere(plainer)


def _smaller_elsewhere(scenario: Scenario) -> Iterator[Scenario]:
    for smaller in _smaller(scenario):
        yield from _leaks_elsewhere(smaller)


def _leaks_elsewhere(scenario: Scenario) -> Iterator[Scenario]:
    """All leaks moved alike: a little along an axis, or around the middle, as far from it as they were."""
    for step_m, name in itertools.product(ELSEWHERE_M, ("x_m", "y_m")):
        steps = ((leak, {name: round(getattr(leak, name) + step_m, 9)}) for leak in scenario.leak)
        yield with_leaks(scenario, [leak.model_copy(update=moved) for leak, moved in steps])
    for degrees in ELSEWHERE_DEG:
        yield with_leaks(scenario, [_turned(leak, math.radians(degrees)) for leak in scenario.leak])


def _turned(leak: LeakTable, angle_rad: float) -> LeakTable:
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    x_m, y_m = cos * leak.x_m - sin * leak.y_m, sin * leak.x_m + cos * leak.y_m
    return leak.model_copy(update={"x_m": round(x_m, 2), "y_m": round(y_m, 2)})


def _round_places(scenario: Scenario) -> Iterator[Scenario]:
    """Leaks on ever finer grids, all of them, then one alone; the middle line first."""
    for grid_m in PLACES_M:
        yield with_leaks(scenario, [_on_grid(leak, grid_m) for leak in scenario.leak])
    for i, leak in enumerate(scenario.leak):
        others = scenario.leak
        for changed in (leak.model_copy(update={"y_m": 0.0}), *(_on_grid(leak, grid_m) for grid_m in PLACES_M)):
            if _roundness(changed) > _roundness(leak):
                yield with_leaks(scenario, [*others[:i], changed, *others[i + 1 :]])


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
                yield with_leaks(scenario, leaks)


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


LEAKS_FIRST: tuple[Reduction, ...] = (_without_times, _fewer_leaks)
OTHERS: tuple[Reduction, ...] = (_plain_tables, _plain_leaks, _plain_fields)
SIZES_LAST: tuple[Reduction, ...] = (_round_numbers, _smaller)
TABLES_FIRST = (*LEAKS_FIRST, *OTHERS, _round_places, *SIZES_LAST)
PLACES_FIRST = (*LEAKS_FIRST, _round_places, *OTHERS, *SIZES_LAST)
MOVED_LAST = (*TABLES_FIRST, _plain_fields_elsewhere, _smaller_elsewhere)
