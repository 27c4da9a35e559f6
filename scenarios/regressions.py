"""Kept counterexamples: scenes that were hunted and made plain, each with what is expected of a method on it.

They are scenario files with a table [regression]: any command takes them by their path. The tests replay all of them.
"""

from scenarios.estimators import EstimatorSpec
from scenarios.failures import failure_codes
from scenarios.scenario import Scenario
from scenarios.scenario_file import ScenarioError, validated
from scenarios.scene_work import MethodOutcome
from scenarios.shelf import Shelf
from scenarios.shrink import run_of

REGRESSIONS = Shelf("regression", "regressions", ScenarioError)


def regression_names() -> list[str]:
    """Names of the kept counterexamples."""
    return REGRESSIONS.names()


def read_regression(name: str) -> Scenario:
    """Read a kept counterexample by its name or path; raises ScenarioError, also where it has no [regression]."""
    source, text = REGRESSIONS.text_of(name)
    scenario = validated(REGRESSIONS.parsed(text, source), source)
    if scenario.regression is None:
        raise ScenarioError(f"{source}: regression is required")
    return scenario


def replayed(scenario: Scenario) -> str | None:
    """Run a kept counterexample; return what is not as expected, None when all is."""
    assert scenario.regression is not None
    return verdict(scenario, run_of(scenario, EstimatorSpec("method", scenario.regression.method)))


def verdict(scenario: Scenario, run: MethodOutcome) -> str | None:
    """Say what is not as expected of a run: a failure that is gone or has changed is as bad as a fixed one back."""
    expected = scenario.regression
    assert expected is not None
    codes = sorted(failure_codes(run))
    if expected.status == "fixed":
        return f"was fixed, and fails again: {', '.join(codes)}" if codes else None
    if not codes:
        return f"is cured: {expected.code} is gone; set its status to fixed"
    if expected.code not in codes:
        return f"has changed: {', '.join(codes)} in place of {expected.code}"
    return None
