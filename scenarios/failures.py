"""What of a run is a failure: an observable leak not found, a place too far off, a false leak, no answer."""

from dataclasses import dataclass
from typing import get_args

from scenarios.estimators import Breakdown
from scenarios.scene_work import OK, MethodOutcome

FOUND = "found"
IMPRECISE = "bad.imprecise"
"""A leak found within the gate, yet beyond the bound of half of it."""

CODES = (
    *("missed.unexplained", IMPRECISE, "bad.tilt", "bad.wrong_match", "bad.depth"),
    *("false.ghost", "false.shadow", "false.gamma"),
    *get_args(Breakdown),
)
"""All that a failure can be; the other codes of `outcome.py` are of leaks that nobody could have found."""


@dataclass(frozen=True)
class Failure:
    """An outcome code, and the leak that it befell; None for a false leak and for a breakdown."""

    code: str
    leak: int | None


def failures(run: MethodOutcome) -> list[Failure]:
    """Return the failures of a run: leaks that nobody could have found are none, a false leak always is one."""
    if run.outcome != OK:
        return [Failure(run.outcome, None)]
    beyond = {leak for leak, margin in run.margins.errors if margin < 0.0}
    of_leaks = [
        Failure(IMPRECISE if leak.code == FOUND else leak.code, leak.leak)
        for leak in run.leaks
        if leak.observable and (leak.code != FOUND or leak.leak in beyond)
    ]
    return of_leaks + [Failure(code, None) for code in run.false_codes]


def failure_codes(run: MethodOutcome) -> set[str]:
    """Codes of a run's failures; empty when everything is right."""
    return {failure.code for failure in failures(run)}
