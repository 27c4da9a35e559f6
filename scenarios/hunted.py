"""What an adaptive search came upon, as types of their own: counterexamples, never a sample.

A hunt looks where failures are, so its scenes say nothing of how often an estimator fails. Nothing here is a number or
a sequence: `scenarios.statistics` takes none of it, which mypy says before a run and HuntedDataError during one.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

from scenarios.scenario import Scenario


class HuntedDataError(TypeError):
    """A rate, an interval or a quantile was asked of hunted data."""


class Hunted:
    """Something that an adaptive search came upon: it does not count, and it is no number."""

    def _refused(self, *_: object) -> NoReturn:
        raise HuntedDataError(
            f"{type(self).__name__}: hunted scenes were looked for where failures are: they give counterexamples, "
            "never a rate or an interval; run `leakloc bench`, `campaign` or `envelope` for those"
        )

    def __bool__(self) -> bool:
        """Refuse to be a trial's success."""
        self._refused()

    def __float__(self) -> float:
        """Refuse to be a number."""
        self._refused()

    def __int__(self) -> int:
        """Refuse to be a count."""
        self._refused()

    def __len__(self) -> int:
        """Refuse to be a sample."""
        self._refused()

    def __iter__(self) -> NoReturn:
        """Refuse to be a sample."""
        self._refused()

    def __array__(self, dtype: object = None, copy: object = None) -> NoReturn:
        """Refuse to be numpy's."""
        self._refused(dtype, copy)


@dataclass(frozen=True, order=True)
class Severity(Hunted):
    """Signed margin of a hunted scene, -1 (as wrong as can be) to 1; it can be put in order and shown, no more."""

    margin: float

    def __str__(self) -> str:
        """Return it for people."""
        return f"{self.margin:+.2f}"


@dataclass(frozen=True)
class Cell:
    """A coarse cell of a space: a third of the range of one parameter, 0 for its low end."""

    parameter: str
    third: int


@dataclass(frozen=True)
class Counterexample(Hunted):
    """One failure: its outcome code, the scene, the leak that it befell (None for false leaks and breakdowns)."""

    code: str
    scenario: Scenario
    leak: int | None
    severity: Severity
    number: int
    """Of the scene in its hunt."""
    plainness: float
    """Distance from the plain scene, in ranges of parameters and leaks: the smaller, the plainer."""
    detail: str = ""


def refuse_hunted(*values: object) -> None:
    """Raise HuntedDataError where one of the values is hunted, or a list of such."""
    for value in values:
        rows = value if isinstance(value, list | tuple) else (value,)
        for row in rows:
            if isinstance(row, Hunted):
                row._refused()


if TYPE_CHECKING:
    from scenarios.statistics import clopper_pearson, median_interval

    def _is_refused_by_the_type_checker(found: Counterexample, severity: Severity) -> None:
        """`make lint` warns of an unused ignore on the day that one of these lines is let through."""
        clopper_pearson(found, 10)  # type: ignore[arg-type]
        clopper_pearson(severity, 10)  # type: ignore[arg-type]
        median_interval([severity])  # type: ignore[list-item]
        median_interval(found)  # type: ignore[arg-type]
