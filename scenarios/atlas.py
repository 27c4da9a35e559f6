"""The atlas of failures: of every outcome code, in every coarse cell of the space, the plainest scene that shows it."""

from collections.abc import Sequence
from dataclasses import dataclass

from scenarios.failures import failures
from scenarios.hunted import Cell, Counterexample, Severity
from scenarios.scenario import Scenario
from scenarios.scene_work import MethodOutcome
from scenarios.space import Space
from scenarios.space_point import PLACES, n_values, parameters, plainness, trials_of

THIRDS = 3


@dataclass(frozen=True)
class Move:
    """A scene to try: its point, its seed, and what it is for (start, downhill, chasing, spreading, filling)."""

    shares: tuple[float, ...]
    seed: int
    origin: str


@dataclass(frozen=True)
class Tried:
    """A scene that was tried, and what came out."""

    number: int
    move: Move
    scenario: Scenario
    run: MethodOutcome


class Atlas:
    """The counterexamples that are kept: of every outcome code and coarse cell the plainest."""

    def __init__(self, space: Space) -> None:
        """Begin empty."""
        self.space = space
        self.kept: dict[tuple[str, Cell], Counterexample] = {}

    def add(self, tried: Tried) -> list[Counterexample]:
        """Keep what a scene shows in cells where nothing as plain is kept yet; return what was new or plainer."""
        kept = []
        for failure in failures(tried.run):
            found = Counterexample(
                failure.code,
                tried.scenario,
                failure.leak,
                Severity(tried.run.margins.least),
                tried.number,
                plainness(self.space, tried.move.shares),
                tried.run.detail,
            )
            taken = [(failure.code, cell) for cell in cells_of(self.space, tried.move.shares, failure.leak)]
            better = [place for place in taken if place not in self.kept or _plainer(found, self.kept[place])]
            self.kept.update(dict.fromkeys(better, found))
            kept += [found] * bool(better)
        return kept

    def codes(self) -> list[str]:
        """Codes that were met, in alphabetical order."""
        return sorted({code for code, _ in self.kept})

    def counterexamples(self) -> list[Counterexample]:
        """Return every counterexample kept, once, by its scene's number and code: the first of several leaks."""
        distinct: dict[tuple[int, str], Counterexample] = {}
        for found in self.kept.values():
            distinct.setdefault((found.number, found.code), found)
        return [distinct[place] for place in sorted(distinct)]

    def cells_met(self, found: Counterexample) -> list[Cell]:
        """Return the cells that a counterexample is kept for, and those of its scene's other leaks with the code."""
        return [cell for (_, cell), one in self.kept.items() if (one.number, one.code) == (found.number, found.code)]


def _plainer(one: Counterexample, other: Counterexample) -> bool:
    return (one.plainness, one.number) < (other.plainness, other.number)


def cells_of(space: Space, shares: Sequence[float], leak: int | None) -> list[Cell]:
    """Cells that a failure lies in, one a parameter; only that of a leak has the leak's place."""
    names, trials = parameters(space), trials_of(space, shares)
    row = trials[leak if leak is not None and leak < len(trials) else 0]
    return [
        Cell(name, min(int(THIRDS * share), THIRDS - 1))
        for name, share, values in zip(names, row, n_values(space), strict=True)
        if values > 1 and (leak is not None or name not in PLACES)
    ]
