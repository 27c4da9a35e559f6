"""Write a scenario as TOML that reads back to the same scenario."""

import json
from typing import Any

import tomli_w

from scenarios.scenario import Scenario


def scenario_toml(scenario: Scenario) -> str:
    """Return the scenario as TOML with every value, defaults included, so that it stands alone."""
    return tomli_w.dumps(scenario.model_dump(exclude_none=True))


def inline_toml(value: Any) -> str:
    """Inline TOML of plain data without nulls; JSON's scalars and lists are TOML's."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}={inline_toml(item)}" for key, item in value.items() if item is not None) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(inline_toml(item) for item in value) + "]"
    # what JSON escapes by pairs TOML does not know, and it wants one escape that JSON leaves out
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
