"""A scene told in as few lines as it takes: a scenario file of what is not the default, and a comment that says why."""

from typing import Any

from scenarios.replay import PLAIN, overrides
from scenarios.scenario import Scenario
from scenarios.scenario_file import read_scenario
from scenarios.scenario_toml import inline_toml

MAX_LINES = 20
PICTURES_PX = ((320, 180), (480, 270), (640, 360), (960, 540))
FRAMES = (6, 8, 12, 18, 24)
"""Sizes that scenes are made small to: they cost time, and are no condition of a failure. Other sizes may be one."""


def scene_toml(scenario: Scenario, comments: tuple[str, ...]) -> str:
    """Return a scenario file of all that differs from the models' defaults, the comments above it.

    A key a line; where that is more than 20 lines, a table or a leak a line.
    """
    told = _rounded(scenario.model_dump(exclude_defaults=True, exclude_none=True))
    if scenario.lamp == ():
        told["lamp"] = []  # darkness is not the default
    lines = [f"# {line}" for line in comments]
    loose = lines + _a_key_a_line(told)
    return "\n".join(loose if len(loose) <= MAX_LINES else lines + _a_table_a_line(told)) + "\n"


def _a_key_a_line(told: dict[str, Any]) -> list[str]:
    plain = [f"{key} = {inline_toml(value)}" for key, value in told.items() if not _is_table(value)]
    for key, value in told.items():
        if _is_table(value):
            for table in value if isinstance(value, list) else [value]:
                head = f"[[{key}]]" if isinstance(value, list) else f"[{key}]"
                plain += [head, *(f"{name} = {inline_toml(item)}" for name, item in table.items())]
    return plain


def _a_table_a_line(told: dict[str, Any]) -> list[str]:
    lines = []
    for key, value in told.items():
        if isinstance(value, list) and _is_table(value):
            rows = [f"  {inline_toml(row)}," for row in value]
            lines += [f"{key} = [", *rows, "]"]
        else:
            lines.append(f"{key} = {inline_toml(value)}")
    return lines


def _is_table(value: Any) -> bool:
    return isinstance(value, dict) or (isinstance(value, list) and bool(value) and isinstance(value[0], dict))


def conditions(scenario: Scenario) -> list[str]:
    """Return what a scene has that `plain` has not, each `key=value`; usual sizes of pictures and clips left out."""
    usual = {"recording.n_frames"} if scenario.recording.n_frames in FRAMES else set()
    if (scenario.rig.width_px, scenario.rig.height_px) in PICTURES_PX:
        usual |= {"rig.width_px", "rig.height_px"}
    return [told for told in _told(scenario) if told.partition("=")[0] not in usual]


def _told(scenario: Scenario) -> list[str]:
    """Differences from `plain`, those of a single leak field by field."""
    rows = []
    for told in overrides(scenario):
        if told.startswith("leak=") and len(scenario.leak) == 1:
            rows += [f"leak.0.{key}={value}" for key, value in _leak_fields(scenario).items()]
        else:
            rows.append(told)
    return rows


def _leak_fields(scenario: Scenario) -> dict[str, Any]:
    """Fields of the first leak that are not those of the plain scene's."""
    plain = read_scenario(PLAIN).leak[0].model_dump()
    return {key: value for key, value in scenario.leak[0].model_dump().items() if value != plain[key]}


def _rounded(value: Any) -> Any:
    """Numbers as a person writes them."""
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(item) for item in value]
    return round(value, 9) if isinstance(value, float) else value
