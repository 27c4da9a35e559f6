"""Read space files: TOML in, a space or *all* of its mistakes out, each with file, key, value and rule.

A space says what varies: axes of a scenario's keys, each with its range and grid, and leaks at any place.
"""

import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, Field

from scenarios.campaign import Overrides
from scenarios.mistakes import FileRules, Violation, capped, checked, nearest, shown
from scenarios.scenario import Drip, Model, Scenario, list_of_at_most
from scenarios.scenario_file import ScenarioError, read_scenario
from scenarios.shelf import Shelf
from scenarios.space import LEAKS_TABLE, STRATA, Axis, Space
from scenarios.space_point import n_shares, scenario_of

MAX_AXES = 12
MAX_LEAKS = 10
MAX_NAME = 100
MAX_STEPS = 1e6
LEAST_STEP = 1e-9
"""Values of an axis are rounded to this: a finer grid would leave its own range."""

OFF_GRID = 1e-6
"""What rounding may put a value beyond its range."""

N_TRIED = 64
LEAST_VALID = 0.5
"""Of the points tried: a search in a space that hardly has any would look for scenes, not for failures."""


class SpaceError(ValueError):
    """A space that cannot be used; the message has one line a mistake."""


SPACES = Shelf("space", "spaces", SpaceError)


class SpaceAxisTable(Model):
    """One thing that varies: a number of the scenario, its range, and the grid that its values stand on."""

    key: str = Field(
        min_length=1, max_length=100, description="of the scenario, say gamma.dose_rate_gy_h; layout.* is of every leak"
    )
    low: float
    high: float
    step: float = Field(gt=0.0, description="values are plain + n * step")
    plain: float | None = Field(
        None, description="what failures are made plain towards; the base scenario's by default"
    )
    unit: str = Field("", max_length=20)
    label: str = Field("", max_length=100, description="for people; the key when left out")


class SpaceLeaksTable(Model):
    """Leaks at any place of the half disc x >= 0."""

    most: int = Field(3, ge=1, le=MAX_LEAKS, description="from 1 to this many")
    min_separation_m: float = Field(0.4, ge=0.0, le=5.0)
    wall_margin_m: float = Field(0.2, ge=0.0, le=10.0, description="least distance of a leak from the wall")


class SpaceFile(Model):
    """What varies, and from which scenario: its leaks and drips are the base's unless [leaks] says otherwise."""

    name: str = Field("", max_length=MAX_NAME)
    description: str = Field("", max_length=2000)
    scenario: str = Field("plain", min_length=1, max_length=1000, description="shipped name, or a path from here on")
    set: Overrides = Field((), description='overrides of the base, each "key.path=value" as after --set')
    axis: Annotated[tuple[SpaceAxisTable, ...], list_of_at_most(MAX_AXES)] = Field(max_length=MAX_AXES)
    leaks: SpaceLeaksTable | None = None


def read_space(path_or_name: str | Path) -> Space:
    """Read a space file, a shipped one or a stratum of the bench by its name; raises SpaceError with all mistakes."""
    strata, name = {space.name: space for space in STRATA}, str(path_or_name)
    if name in strata and not os.path.exists(name):
        return strata[name]
    if name not in SPACES.names() and not os.path.exists(name):
        known = [*strata, *SPACES.names()]
        raise SpaceError(
            f"{name}: no such file, stratum or shipped space{nearest(name, known) or ': ' + ', '.join(known)}"
        )
    source, text = SPACES.text_of(name)
    content, lines = checked(SPACES.parsed(text, source), source, SPACE_RULES)
    base, wrong = (None, []) if content is None else _base_of(content, source)
    lines += wrong
    if content is not None:
        lines += _mistakes_of_ends(content, base or Scenario(), source)
    if lines:
        raise SpaceError("\n".join(capped(lines, source)))
    assert content is not None
    assert base is not None
    space = _space(content, base, source)
    if lines := list(_mistakes_of_grids(space, source)):
        raise SpaceError("\n".join(lines))
    _check_points(space, source)
    return space


def violations(content: SpaceFile) -> list[Violation]:
    """Return all broken rules between the values of a space file."""
    return [*_empty(content), *_keys(content), *_ranges(content)]


SPACE_RULES = FileRules(
    SpaceFile, violations, faultless_rows={"axis": {"key": "rig.baseline_m", "low": 0.5, "high": 0.5, "step": 0.1}}
)


def numbers_of_scenario() -> dict[str, type]:
    """Keys of a scenario that an axis can set, each a number of a table, and whether it is whole."""
    found: dict[str, type] = {}
    tables = {name: field.annotation for name, field in Scenario.model_fields.items()} | {LEAKS_TABLE: Drip}
    for table, model in tables.items():
        if isinstance(model, type) and issubclass(model, BaseModel):
            for name, field in model.model_fields.items():
                kinds = {field.annotation, *getattr(field.annotation, "__args__", ())}
                if kinds & {int, float}:
                    found[f"{table}.{name}"] = int if int in kinds else float
    return found


def _empty(content: SpaceFile) -> Iterator[Violation]:
    if not content.axis:
        yield Violation("axis", [], "must have at least one entry", ("axis",))


def _keys(content: SpaceFile) -> Iterator[Violation]:
    known = numbers_of_scenario()
    for i, axis in enumerate(content.axis):
        if axis.key not in known:
            rule = f"must be a number of a scenario's table{nearest(axis.key, list(known))}"
            yield Violation(f"axis.{i}.key", axis.key, rule, (f"axis.{i}.key",))
        elif axis.key.startswith(f"{LEAKS_TABLE}.") and content.leaks is None:
            rule = "sets how leaks drip: must have [leaks] beside it"
            yield Violation(f"axis.{i}.key", axis.key, rule, (f"axis.{i}.key", "leaks"))
    for key, count in Counter(axis.key for axis in content.axis).items():
        if count > 1:
            yield Violation("axis", key, "an axis must not stand there twice", ("axis",))


def _ranges(content: SpaceFile) -> Iterator[Violation]:
    known = numbers_of_scenario()
    for i, axis in enumerate(content.axis):
        reads = (f"axis.{i}",)
        if axis.low > axis.high:
            yield Violation(f"axis.{i}.low", axis.low, f"must be at most high = {axis.high:g}", reads)
        elif axis.step < LEAST_STEP:
            yield Violation(f"axis.{i}.step", axis.step, f"must be >= {LEAST_STEP:g}", reads)
        elif (axis.high - axis.low) / axis.step >= MAX_STEPS + 1:
            yield Violation(f"axis.{i}.step", axis.step, "makes more than a million values: must be larger", reads)
        if known.get(axis.key) is int:
            for name in ("low", "high", "step", "plain"):
                value = getattr(axis, name)
                if value is not None and value != int(value):
                    yield Violation(f"axis.{i}.{name}", value, f"must be whole, as {axis.key} is", reads)


def _base_of(content: SpaceFile, source: str) -> tuple[Scenario | None, list[str]]:
    beside = Path(source).parent / content.scenario
    try:
        # not Path.is_file: it raises where a name is too long
        return read_scenario(beside if os.path.isfile(beside) else content.scenario, content.set), []
    except ScenarioError as error:
        return None, [f"{source}: scenario: {line}" for line in str(error).splitlines()]


def _mistakes_of_ends(content: SpaceFile, base: Scenario, source: str) -> Iterator[str]:
    """Every end of every range must be a value that the scenario may have."""
    known = numbers_of_scenario()
    for i, axis in enumerate(content.axis):
        if axis.key not in known:
            continue
        table, _, name = axis.key.partition(".")
        for end in ("low", "high", "plain"):
            value = getattr(axis, end)
            if value is not None:
                yield from (f"{source}: axis.{i}.{end}: {rule}" for rule in _broken_by(axis.key, value, base))
        if axis.plain is None and (table != LEAKS_TABLE and getattr(getattr(base, table), name) is None):
            yield f"{source}: axis.{i}.plain: is required, for the base scenario has no {axis.key}"


def _mistakes_of_grids(space: Space, source: str) -> Iterator[str]:
    """Rounded to its grid, an end may come to stand where no value may be: 1e-10 m is 0 m; a step may pass it."""
    for i, axis in enumerate(space.axes):
        for end, value in (("low", axis.at(0.0)), ("high", axis.at(1.0))):
            rules = _broken_by(axis.key, value, space.base_scenario)
            yield from (f"{source}: axis.{i}.{end}: on the grid, {rule}" for rule in rules)
            if not axis.low - OFF_GRID <= value <= axis.high + OFF_GRID:
                rule = f"must reach a value from low = {axis.low:g} to high = {axis.high:g}"
                yield f"{source}: axis.{i}.step: from plain = {axis.plain:g} on, {rule}, got {shown(axis.step)}"
                break


def _broken_by(key: str, value: float, base: Scenario) -> list[str]:
    """Rules of one key of the scenario that a value breaks, each with the value."""
    table, _, name = key.partition(".")
    model = Drip if table == LEAKS_TABLE else type(getattr(base, table))
    whole = numbers_of_scenario()[key] is int
    _, lines = checked({name: int(value) if whole else value}, key, FileRules(model, _none))
    return [line.partition(": ")[2] for line in lines]


def _none(_: Any) -> list[Violation]:
    return []


def _space(content: SpaceFile, base: Scenario, source: str) -> Space:
    drip = _drip(base)
    leaks = content.leaks
    free = {} if leaks is None else {"leak": (), "layout": None}
    try:
        axes = tuple(_axis(axis, base, drip) for axis in content.axis)
    except ValueError as error:
        raise SpaceError(f"{source}: {error}") from None
    return Space(
        content.name or _named_after(source),
        axes,
        max_leaks=0 if leaks is None else leaks.most,
        min_separation_m=0.0 if leaks is None else leaks.min_separation_m,
        wall_margin_m=0.0 if leaks is None else leaks.wall_margin_m,
        width_px=base.rig.width_px,
        height_px=base.rig.height_px,
        base=base.model_copy(update=free),
        drip=drip,
    )


def _named_after(source: str) -> str:
    """Name of a space that says none: its file's, as text that a scenario of that name may hold and be written with."""
    return os.fsencode(Path(source).stem).decode("utf-8", "backslashreplace")[:MAX_NAME]


def _axis(axis: SpaceAxisTable, base: Scenario, drip: dict[str, Any]) -> Axis:
    table, _, name = axis.key.partition(".")
    plain = axis.plain
    if plain is None:
        plain = drip[name] if table == LEAKS_TABLE else getattr(getattr(base, table), name)
    return Axis(axis.key, axis.low, axis.high, axis.step, float(plain), axis.unit, axis.label or axis.key)


def _drip(base: Scenario) -> dict[str, Any]:
    """How the base's first leak or its layout drips; the defaults where it has neither."""
    of: Any = base.leak[0] if base.leak else base.layout or Drip()
    return {name: getattr(of, name) for name in Drip.model_fields}


def _check_points(space: Space, source: str) -> None:
    """Refuse a space most of whose points break the rules between a scenario's values."""
    points = np.random.default_rng(0).random((N_TRIED, n_shares(space)))
    valid = sum(scenario_of(space, point, 0) is not None for point in points)
    if valid < LEAST_VALID * N_TRIED:
        raise SpaceError(
            f"{source}: axis: most points must be scenarios that break no rule, got {valid} of {N_TRIED} tried"
        )
