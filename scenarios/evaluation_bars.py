"""Bars of the evaluation: what a faithful simulation of the paper's method must show, and what the robust one must.

Those of the paper's method go by the paper's rule (no gate), those of the robust one by the gate.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from scenarios.campaign_summary import number
from scenarios.evaluation import Evaluation
from scenarios.evaluation_tables import Row, Tally
from scenarios.statistics import clopper_pearson
from scenarios.stored_run import Run

PAPER_ERROR_M = (0.1, 0.35)
CROWDED_FOUND = (21.0 / 24.0, 1.0)
CLOSEST_M = 0.05


@dataclass(frozen=True)
class RobustBar:
    """Least rate of observable leaks, and largest mean error, m, of the robust method in some rows."""

    experiment: str
    settings: tuple[str, ...]
    rate: float
    mean_error_m: float


ROBUST_BARS = (
    RobustBar("separated", ("L", "M", "H"), 0.99, 0.02),
    RobustBar("frames", ("3 frames",), 0.95, 0.05),
    RobustBar("crowded", ("L", "M", "H"), 1.0, 0.01),
    RobustBar("multiple", ("5 leaks", "7 leaks"), 0.95, 0.03),
)


@dataclass(frozen=True)
class Bar:
    """One bar in one row: what is asked, what was got, and whether that is enough."""

    experiment: str
    setting: str
    method: str
    wanted: str
    got: str
    is_met: bool


def bars_of(evaluation: Evaluation, rows: Sequence[Row]) -> list[Bar]:
    """Return all bars of the rows that there are."""
    bars: list[Bar] = []
    for row in rows:
        if row.method == "paper" and row.experiment == "separated":
            bars += _paper_separated(row)
        if row.method == "paper" and row.experiment == "crowded":
            bars += _paper_crowded(row, _missed_gaps_m(evaluation, row))
        if row.method == "robust":
            bars += _robust(row)
    return bars


def _paper_separated(row: Row) -> Iterator[Bar]:
    part, there = row.paper_rule, row.published
    if there is not None:
        low, high = clopper_pearson(there.found, there.of)
        found = part.found["all"]
        wanted = (
            f"found, of all leaks: within the binomial interval of {there.found}/{there.of}, {low:.2f} to {high:.2f}"
        )
        rate = found.leaks / found.of_leaks if found.of_leaks else math.nan
        yield _bar(row, wanted, f"{found.leaks}/{found.of_leaks} = {number(rate, '.2f')}", is_met=low <= rate <= high)
    yield _bar(row, "missed leaks are out of view", _told_missed(part), is_met=part.missed_in_view == 0)
    low, high = PAPER_ERROR_M
    mean_m = part.error.mean_m
    yield _bar(row, f"mean error {low:g} to {high:g} m", _told(mean_m, ".3f", " m"), is_met=low <= mean_m <= high)
    share = part.near_wall_share
    wanted = "most of the error is of leaks near the wall"
    yield _bar(row, wanted, _told(share, ".0%", " of it"), is_met=share > 0.5)


def _paper_crowded(row: Row, missed_gaps_m: Sequence[float]) -> Iterator[Bar]:
    found = row.paper_rule.found["all"]
    low, high = CROWDED_FOUND
    rate = found.leaks / found.of_leaks if found.of_leaks else math.nan
    counts = f"{math.ceil(low * found.of_leaks)} to {math.floor(high * found.of_leaks)} of {found.of_leaks}"
    yield _bar(row, f"found, of all leaks: {counts}", f"{found.leaks}/{found.of_leaks}", is_met=low <= rate <= high)
    gaps = ", ".join(f"{gap_m:g} m" for gap_m in sorted(missed_gaps_m)) or "none missed"
    only = all(gap_m <= CLOSEST_M + 1e-9 for gap_m in missed_gaps_m)
    yield _bar(row, f"missed only where leaks are {CLOSEST_M:g} m apart", gaps, is_met=only)


def _robust(row: Row) -> Iterator[Bar]:
    for bar in ROBUST_BARS:
        if bar.experiment == row.experiment and row.setting in bar.settings:
            found, mean_m = row.gated.found["observable"], row.gated.error.mean_m
            got = f"{found.leaks}/{found.of_leaks}"
            enough = found.of_leaks > 0 and found.leaks >= bar.rate * found.of_leaks
            yield _bar(row, f"found, of observable leaks: at least {bar.rate:.0%}", got, is_met=enough)
            wanted = f"mean error at most {bar.mean_error_m:g} m"
            yield _bar(row, wanted, _told(mean_m, ".4f", " m"), is_met=mean_m <= bar.mean_error_m)


def _told_missed(part: Tally) -> str:
    """Return where missed leaks are; of those in view some are not observable, say merged with another leak."""
    told, observable = f"{part.missed_out_of_view} out of view, {part.missed_in_view} in view", part.found["observable"]
    hidden = part.missed_in_view - (observable.of_leaks - observable.leaks)
    return told if part.missed_in_view == 0 else f"{told} ({hidden} not observable)"


def _told(value: float, form: str, unit: str) -> str:
    """Return what was got; errors of no leak at all have neither mean nor share."""
    return "no leak found" if math.isnan(value) else f"{value:{form}}{unit}"


def _bar(row: Row, wanted: str, got: str, *, is_met: bool) -> Bar:
    return Bar(row.experiment, row.setting, row.method, wanted, got, is_met)


def _missed_gaps_m(evaluation: Evaluation, row: Row) -> list[float]:
    """Distance to the nearest other leak of every leak of a row that the paper's rule says is missed, m."""
    runs = evaluation.runs(row.experiment, row.setting, row.method)
    return [gap_m for run in runs for gap_m in _gaps_of_missed_m(run)]


def _gaps_of_missed_m(run: Run) -> Iterator[float]:
    for leak in run.leaks:
        if leak.paper_estimate is None:
            others = (other for other in run.leaks if other is not leak)
            yield min((math.dist((leak.x_m, leak.y_m), (o.x_m, o.y_m)) for o in others), default=math.inf)


def told_bars(bars: Sequence[Bar]) -> str:
    """Return the bars as lines of text, and how many are met."""
    lines = []
    for (experiment, setting, method), group in itertools.groupby(bars, lambda b: (b.experiment, b.setting, b.method)):
        lines += [
            f"{'met' if bar.is_met else 'NOT MET':<8} {experiment} {setting}, {method}: {bar.wanted}: {bar.got}"
            for bar in group
        ]
    return "\n".join([*lines, f"{sum(bar.is_met for bar in bars)} of {len(bars)} bars are met"])
