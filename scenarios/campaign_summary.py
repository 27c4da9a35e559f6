"""A campaign's runs by arm and method: what was found, how far off, how often everything was, with intervals.

The leaks of one clip are not independent, so an interval is never of leaks: clips are its trials, and a clip succeeds
when all its leaks that count are found. A clip without such leaks is no trial.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from scenarios.campaign import Value
from scenarios.scene_work import OK
from scenarios.statistics import clopper_pearson, median_interval
from scenarios.stored_run import COUNTED, Run

NOTE = (
    "leaks: found, out of those that count. clips: those with every such leak found, with the 95 % interval "
    "(Clopper-Pearson) of their rate; clips are the trials, for leaks of one clip are not independent. A method that "
    "gave no answer found nothing. A scene that died before its truth was known has no leaks to count, only a code."
)


@dataclass(frozen=True)
class Found:
    """Leaks found out of those that count, and clips in which all of them were, out of the clips that have any."""

    leaks: int
    of_leaks: int
    clips: int
    of_clips: int

    @property
    def interval(self) -> tuple[float, float]:
        """Clopper-Pearson interval of 95 % of the rate of clips."""
        return clopper_pearson(self.clips, self.of_clips)


@dataclass(frozen=True)
class Cell:
    """One arm and one method. Errors are of found leaks: mean in m and in px of disparity; NaN without any.

    `median_error_m`: of the clips' mean errors, with its distribution-free interval of 95 %, NaN with too few clips.
    """

    arm: int
    values: dict[str, Value]
    method: str
    n_clips: int
    found: dict[str, Found]
    n_false: int
    mean_error_m: float
    mean_error_px: float
    median_error_m: tuple[float, float, float]
    codes: dict[str, int]

    @property
    def false_per_clip(self) -> float:
        """False leaks a clip."""
        return self.n_false / self.n_clips


def cells(runs: Sequence[Run]) -> list[Cell]:
    """Return a cell per arm and method, in the order of the campaign."""
    groups: dict[tuple[int, int], list[Run]] = {}
    methods = list(dict.fromkeys(run.method for run in runs))
    for run in runs:
        groups.setdefault((run.arm, methods.index(run.method)), []).append(run)
    return [_cell(groups[place]) for place in sorted(groups)]


def worst(runs: Sequence[Run], n: int) -> list[Run]:
    """Return the runs that most is wrong with: breakdowns, then observable leaks missed and false ones, then errors."""
    wrong = [run for run in runs if not run.is_right or run.errors_px]
    return sorted(wrong, key=_badness, reverse=True)[:n]


def table(runs: Sequence[Run]) -> str:
    """Return the cells as a text table, rates over all leaks, leaks in view and observable ones side by side."""
    rows = list(_rows(cells(runs)))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    text_columns = len(rows[0]) - N_NUMBER_COLUMNS
    return "\n".join(
        "  ".join(
            cell.ljust(width) if i < text_columns else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    )


N_NUMBER_COLUMNS = 2 * len(COUNTED) + 4


def _rows(table_cells: Sequence[Cell]) -> Iterator[list[str]]:
    pairs = [words for which in COUNTED for words in (f"{which.replace('_', ' ')}: leaks", "clips [95 %]")]
    axes = list(table_cells[0].values) if table_cells else []
    yield [*axes, "method", "clips", *pairs, "false/clip", "mean error m", "px"]
    for cell in table_cells:
        rates = [words for found in cell.found.values() for words in told(found)]
        errors = [number(cell.mean_error_m, ".3f"), number(cell.mean_error_px, ".2f")]
        values = [str(value) for value in cell.values.values()]
        yield [*values, cell.method, str(cell.n_clips), *rates, f"{cell.false_per_clip:.2f}", *errors]


def told(found: Found) -> tuple[str, str]:
    """Return leaks, and clips with their interval, as words."""
    low, high = found.interval
    return f"{found.leaks}/{found.of_leaks}", f"{found.clips}/{found.of_clips} [{low:.2f}, {high:.2f}]"


def number(value: float, form: str) -> str:
    """Return a number as text; a dash where it is undefined."""
    return "-" if np.isnan(value) else format(value, form)


def wrong_codes(cell: Cell) -> str:
    """Say what went wrong in a cell, most frequent first."""
    wrong = sorted((-count, code) for code, count in cell.codes.items() if code not in ("found", OK))
    return ", ".join(f"{-count} {code}" for count, code in wrong) or "nothing"


def _cell(runs: Sequence[Run]) -> Cell:
    errors_m = [error for run in runs for error in run.errors_m]
    errors_px = [error for run in runs for error in run.errors_px]
    codes = Counter(code for run in runs for code in codes_of(run))
    return Cell(
        arm=runs[0].arm,
        values=runs[0].values,
        method=runs[0].method,
        n_clips=len(runs),
        found={which: _found(runs, which) for which in COUNTED},
        n_false=sum(len(run.false_codes) for run in runs),
        mean_error_m=_mean(errors_m),
        mean_error_px=_mean(errors_px),
        median_error_m=median_interval([run.mean_error_m for run in runs if run.mean_error_m is not None]),
        codes=dict(codes),
    )


def codes_of(run: Run) -> list[str]:
    """Return the codes of a run: of its leaks and false estimates, or of its breakdown, once."""
    return [*(leak.code for leak in run.leaks), *run.false_codes] if run.outcome == OK else [run.outcome]


def _found(runs: Sequence[Run], which: str) -> Found:
    trials = [run for run in runs if run.of[which]]
    return Found(
        leaks=sum(run.found[which] for run in runs),
        of_leaks=sum(run.of[which] for run in runs),
        clips=sum(run.found[which] == run.of[which] for run in trials),
        of_clips=len(trials),
    )


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values) if values else float("nan")


def _badness(run: Run) -> tuple[float, ...]:
    missed = run.of["observable"] - run.found["observable"]
    return (run.outcome != OK, missed + len(run.false_codes), max(run.errors_px, default=0.0), -run.run)
