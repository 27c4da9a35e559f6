"""Write a scenario as TOML that reads back to the same scenario."""

import tomli_w

from scenarios.scenario import Scenario


def scenario_toml(scenario: Scenario) -> str:
    """Return the scenario as TOML with every value, defaults included, so that it stands alone."""
    return tomli_w.dumps(scenario.model_dump(exclude_none=True))
