"""Tables of the paper's evaluation: a row per setting and method, by the paper's rule and by the gate, as data.

Clips are the trials of rates, and what is drawn for intervals of mean errors: leaks of one clip are not independent.
"""

import csv
import io
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from scenarios.campaign_summary import Found, codes_of
from scenarios.evaluation import EXPERIMENTS, Evaluation, Experiment
from scenarios.published import Published, published
from scenarios.scene_work import LeakOutcome
from scenarios.score import nulled
from scenarios.statistics import mean_interval
from scenarios.stored_run import COUNTED, Run

Error = Callable[[Run, LeakOutcome], float | None]
"""Error of a leak by some rule, m; None for a leak that is not found."""

RULES: dict[str, Error] = {
    "paper_rule": lambda run, leak: run.paper_error_m(leak),
    "gated": lambda _, leak: leak.error_m,
}


@dataclass(frozen=True)
class Errors:
    """Errors of found leaks, m: how many, mean, standard deviation (ddof 0), median, and interval of the mean.

    NaN without any; the interval is NaN with fewer than five clips.
    """

    n: int
    mean_m: float
    sd_m: float
    median_m: float
    low_m: float
    high_m: float


@dataclass(frozen=True)
class Tally:
    """What was found by one rule. `missed_in_view` and `missed_out_of_view` are leaks; near the wall is below 0.5 m."""

    found: dict[str, Found]
    missed_in_view: int
    missed_out_of_view: int
    false_per_clip: float
    error: Errors
    near_wall: Errors
    elsewhere: Errors

    @property
    def near_wall_share(self) -> float:
        """Share of the sum of errors that leaks near the wall have; NaN without errors."""
        whole = self.error.n * self.error.mean_m
        near = self.near_wall.n * self.near_wall.mean_m if self.near_wall.n else 0.0
        return near / whole if self.error.n and whole > 0.0 else float("nan")


@dataclass(frozen=True)
class Row:
    """One setting of an experiment and one method; the paper's own row where it has one."""

    experiment: str
    setting: str
    method: str
    n_clips: int
    paper_rule: Tally
    gated: Tally
    codes: dict[str, int]
    published: Published | None


def rows_of(evaluation: Evaluation) -> list[Row]:
    """Return all rows, experiment by experiment."""
    return [
        row
        for experiment in EXPERIMENTS
        for row in experiment_rows(experiment, evaluation.results[experiment.name].runs)
    ]


def experiment_rows(experiment: Experiment, runs: Sequence[Run]) -> list[Row]:
    """Return the rows of an experiment: settings in the order of the campaign, methods within."""
    groups: dict[tuple[str, str], list[Run]] = {}
    for run in sorted(runs, key=lambda run: (run.arm, run.run)):
        groups.setdefault((experiment.setting(run.values[experiment.axis]), run.method), []).append(run)
    return [_row(experiment.name, setting, method, group) for (setting, method), group in groups.items()]


def tally(runs: Sequence[Run], error_of: Error) -> Tally:
    """Count what was found by a rule."""
    clips = [[(leak, error_of(run, leak)) for leak in run.leaks] for run in runs]
    lost = [leak for clip in clips for leak, error_m in clip if error_m is None]
    n_found = sum(error_m is not None for clip in clips for _, error_m in clip)
    return Tally(
        found={which: _found(clips, counts) for which, counts in COUNTED.items()},
        missed_in_view=sum(leak.in_view for leak in lost),
        missed_out_of_view=sum(not leak.in_view for leak in lost),
        false_per_clip=(sum(len(run.estimates_m) for run in runs) - n_found) / len(runs),
        error=_errors(clips, lambda _: True),
        near_wall=_errors(clips, lambda leak: leak.near_wall),
        elsewhere=_errors(clips, lambda leak: not leak.near_wall),
    )


def as_data(row: Row) -> dict[str, Any]:
    """Return a row as plain data; undefined is null."""
    data = {
        **{name: getattr(row, name) for name in ("experiment", "setting", "method", "n_clips")},
        **{rule: _tally_data(getattr(row, rule)) for rule in RULES},
        "codes": dict(sorted(row.codes.items())),
        "published": None if row.published is None else asdict(row.published),
    }
    return nulled(data)


def tables_csv(rows: Sequence[dict[str, Any]]) -> str:
    """Return rows of plain data as CSV: a column per number, its name the path to it; undefined is empty."""
    flat = [flattened(row) for row in rows]
    columns = list(dict.fromkeys(key for row in flat for key in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(flat)
    return text.getvalue()


def flattened(value: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return nested tables as one, keys joined by dots."""
    flat: dict[str, Any] = {}
    for key, item in value.items():
        if isinstance(item, dict):
            flat.update(flattened(item, f"{prefix}{key}."))
        elif item is not None:
            flat[prefix + key] = item
    return flat


def _row(experiment: str, setting: str, method: str, runs: Sequence[Run]) -> Row:
    return Row(
        experiment,
        setting,
        method,
        n_clips=len(runs),
        paper_rule=tally(runs, RULES["paper_rule"]),
        gated=tally(runs, RULES["gated"]),
        codes=dict(Counter(code for run in runs for code in codes_of(run))),
        published=published(experiment, setting),
    )


Clips = Sequence[Sequence[tuple[LeakOutcome, float | None]]]


def _found(clips: Clips, counts: Callable[[LeakOutcome], bool]) -> Found:
    verdicts = [[error_m is not None for leak, error_m in clip if counts(leak)] for clip in clips]
    trials = [clip for clip in verdicts if clip]
    return Found(sum(map(sum, trials)), sum(map(len, trials)), sum(map(all, trials)), len(trials))


def _errors(clips: Clips, counts: Callable[[LeakOutcome], bool]) -> Errors:
    of_clips = [[error_m for leak, error_m in clip if error_m is not None and counts(leak)] for clip in clips]
    errors_m = np.array([error_m for clip in of_clips for error_m in clip])
    if not len(errors_m):
        return Errors(0, *(float("nan"),) * 5)
    mean_m, sd_m, median_m = map(float, (errors_m.mean(), errors_m.std(), np.median(errors_m)))
    return Errors(len(errors_m), mean_m, sd_m, median_m, *mean_interval(of_clips))


def _tally_data(part: Tally) -> dict[str, Any]:
    found = {
        which: {
            **asdict(one),
            "rate": one.leaks / one.of_leaks if one.of_leaks else None,
            "clips_low": one.interval[0],
            "clips_high": one.interval[1],
        }
        for which, one in part.found.items()
    }
    return {**asdict(part), "found": found, "near_wall_share": part.near_wall_share}
