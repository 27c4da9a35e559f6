"""The runs of a campaign as CSV, one row each: the same bytes whatever the order in which they were done.

Times and the words of errors (which may name temporary files) are left out; lists stand in one cell, with semicolons.
"""

import csv
import io
import shlex
from collections.abc import Iterable

from scenarios.store import Stored
from scenarios.stored_run import COUNTED, Run


def campaign_csv(stored: Stored) -> str:
    """Return header and rows, by run number; undefined is empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    axes = list(stored.runs[0].values) if stored.runs else []
    counts = [f"{kind}_{which}" for which in COUNTED for kind in ("found", "of")]
    leaks = ["leak_codes", "leak_errors_m", "leak_errors_px", "leak_near_wall", "leak_paper_errors_m"]
    before = ["run", "scene", "arm", "repeat", *axes, "scenario", "overrides", "seed", "method", "outcome"]
    writer.writerow([*before, *counts, "false", "mean_error_m", *leaks, "false_codes", "estimates_m", "versions"])
    writer.writerows(map(_row, stored.runs))
    return text.getvalue()


def _row(run: Run) -> list[object]:
    counts = [number[which] for which in COUNTED for number in (run.found, run.of)]
    return [
        *(run.run, run.scene, run.arm, run.repeat, *run.values.values()),
        *(run.base, shlex.join(run.overrides), run.seed, run.method, run.outcome, *counts),
        *(len(run.false_codes), run.mean_error_m),
        _joined(leak.code for leak in run.leaks),
        _joined(leak.error_m for leak in run.leaks),
        _joined(leak.error_px for leak in run.leaks),
        _joined(int(leak.near_wall) for leak in run.leaks),
        _joined(run.paper_error_m(leak) for leak in run.leaks),
        _joined(run.false_codes),
        _joined(f"{x_m} {y_m}" for x_m, y_m in run.estimates_m),
        run.versions,
    ]


def _joined(items: Iterable[object]) -> str:
    return ";".join("" if item is None else str(item) for item in items)
