"""Read scenario files: TOML in, a frozen scenario or *all* of its mistakes out, each with file, key, value and rule."""

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from leakloc.outside_file import MAX_DEPTH
from scenarios.mistakes import FileRules, checked
from scenarios.rules import violations
from scenarios.scenario import Scenario
from scenarios.shelf import Shelf
from scenarios.space import scene_of
from scenarios.toml_text import parse_toml

MAX_OVERRIDE_CHARS = 100_000
BENCH_SCENE = re.compile(r"(?P<stratum>easy|nominal|hard):(?P<number>\d{1,5})(:(?P<seed>\d{1,9}))?")

SCENARIO_RULES = FileRules(
    Scenario,
    violations,
    faultless_rows={
        "lamp": {},
        "leak": {"x_m": 0.0, "y_m": 0.0},
        "structure": {"kind": "box", "centre_m": [0.0, 0.0, 0.0], "size_m": [0.1, 0.1, 0.1]},
    },
)


class ScenarioError(ValueError):
    """A scenario that cannot be used; the message has one line a mistake."""


LIBRARY = Shelf("scenario", "library", ScenarioError)


def library_names() -> list[str]:
    """Names of the shipped scenarios."""
    return LIBRARY.names()


def read_scenario(path_or_name: str | Path, overrides: Sequence[str] = (), seed: int | None = None) -> Scenario:
    """Read a scenario file, a shipped scenario by its name or a scene of the bench, with `key.path=value` overrides.

    A scene of the bench is `stratum:number`, or `stratum:number:seed` of another run than seed 0. A path wins over a
    name only when such a file exists. Raises ScenarioError with all mistakes.
    """
    source, data = _data_of(path_or_name)
    return _changed(data, source, overrides, seed)


def with_overrides(scenario: Scenario, overrides: Sequence[str]) -> Scenario:
    """Return a scenario with `key.path=value` overrides; raises ScenarioError with all mistakes."""
    return _changed(scenario.model_dump(mode="json", exclude_none=True), scenario.name, overrides, None)


def _changed(data: dict[str, Any], source: str, overrides: Sequence[str], seed: int | None) -> Scenario:
    mistakes = [mistake for override in overrides if (mistake := _mistake_in(override, data))]
    if seed is not None:
        data["seed"] = seed
    try:
        scenario = validated(data, source)
    except ScenarioError as error:
        raise ScenarioError("\n".join([*mistakes, str(error)])) from None
    if mistakes:
        raise ScenarioError("\n".join(mistakes))
    return scenario.model_copy(update={"structure": tuple(_at_home(table, source) for table in scenario.structure)})


def validated(data: dict[str, Any], source: str) -> Scenario:
    """Turn parsed data into a scenario, or raise ScenarioError with every broken rule."""
    scenario, lines = checked(data, source, SCENARIO_RULES)
    if lines:
        raise ScenarioError("\n".join(lines))
    assert scenario is not None
    return scenario


def _data_of(path_or_name: str | Path) -> tuple[str, dict[str, Any]]:
    name = str(path_or_name)
    if not os.path.lexists(name) and (place := BENCH_SCENE.fullmatch(name)):
        return name, scene_of(place["stratum"], int(place["number"]), int(place["seed"] or 0)).model_dump(
            mode="json", exclude_none=True
        )
    source, text = LIBRARY.text_of(path_or_name)
    return source, LIBRARY.parsed(text, source)


def _at_home(table: Any, source: str) -> Any:
    """A relative mesh path starts at the scenario file; it is stated whole, for the file is written elsewhere, too."""
    if table.kind != "mesh":
        return table
    return table.model_copy(update={"path": os.path.abspath(Path(source).parent / table.path)})


def _mistake_in(override: str, data: dict[str, Any]) -> str | None:
    """Apply an override; returns what is wrong with it, or None."""
    try:
        _apply(override, data)
    except ScenarioError as error:
        return str(error)
    return None


def _apply(override: str, data: dict[str, Any]) -> None:
    """Set one `a.b.0.c=value` in parsed data; the value is TOML, or else a plain text."""
    key, equals, text = override.partition("=")
    parts = key.strip().split(".")
    if len(override) > MAX_OVERRIDE_CHARS:
        raise ScenarioError(f"--set {override[:60]}...: must have at most {MAX_OVERRIDE_CHARS} characters")
    if not equals or not all(parts):
        raise ScenarioError(f"--set {override}: must have the form key.path=value")
    if len(parts) > MAX_DEPTH:
        raise ScenarioError(f"--set {key}: must have at most {MAX_DEPTH} parts")
    if "\n" in text:
        raise ScenarioError(f"--set {key}: must be one line")
    try:
        value = parse_toml(f"value = {text}")["value"]
    except ValueError:
        value = text.strip()
    here: Any = data
    if len(parts) > 1 and parts[1].isdecimal() and parts[0] in Scenario.model_fields:
        data.setdefault(parts[0], Scenario().model_dump(mode="json", exclude_none=True)[parts[0]])
    for i, part in enumerate(parts[:-1]):
        here = here.setdefault(part, {}) if isinstance(here, dict) else _item(here, part, f"--set {override}")
        if not isinstance(here, dict | list):
            raise ScenarioError(f"--set {override}: {'.'.join(parts[: i + 1])} must be a table to have keys in it")
    if isinstance(here, dict):
        here[parts[-1]] = value
    else:
        here[_index(here, parts[-1], f"--set {override}")] = value


def _item(rows: list[Any], part: str, who: str) -> Any:
    return rows[_index(rows, part, who)]


def _index(rows: list[Any], part: str, who: str) -> int:
    if not (part.isdecimal() and int(part) < len(rows)):
        raise ScenarioError(f"{who}: {part!r} must be an index below {len(rows)}")
    return int(part)
