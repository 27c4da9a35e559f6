"""A scenario told as a command: its differences from the plainest one, so that a failure can be seen again."""

import shlex
from typing import Any

from scenarios.scenario import LeakTable, Scenario
from scenarios.scenario_file import read_scenario
from scenarios.scenario_toml import inline_toml

PLAIN = "plain"
NOT_TOLD = {"name", "description", "seed", "regression"}


def overrides(scenario: Scenario) -> list[str]:
    """Return the `key=value` overrides that turn the shipped scenario `plain` into this one, seed aside."""
    plain, here = read_scenario(PLAIN).model_dump(mode="json"), scenario.model_dump(mode="json")
    told = []
    for table, value in here.items():
        if table in NOT_TOLD or value == plain[table]:
            continue
        if isinstance(value, dict) and isinstance(plain[table], dict):
            told += [f"{table}.{key}={inline_toml(item)}" for key, item in value.items() if item != plain[table][key]]
        elif table == "leak":
            told.append(f"leak={inline_toml([_told_leak(leak) for leak in value])}")
        else:
            told.append(f"{table}={inline_toml(value)}")
    return told


def replay_command(scenario: Scenario, estimator: str) -> str:
    """Return the command that explains what an estimator (its option, say "--method robust") does with a scenario."""
    words = [word for override in overrides(scenario) for word in ("--set", override)]
    seed = ["--seed", str(scenario.seed)] if scenario.seed else []
    return f"{shlex.join(['leakloc', 'explain', PLAIN, *words, *seed])} {estimator}"


def _told_leak(leak: dict[str, Any]) -> dict[str, Any]:
    """Fields of a leak that are not the models' defaults."""
    default = {name: field.default for name, field in LeakTable.model_fields.items()}
    return {key: value for key, value in leak.items() if value is not None and value != default[key]}
