"""Write the paper's evaluation into a folder: report.html, tables.json, tables.csv, the figures and the stores."""

import json
import shutil
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from scenarios.campaign_summary import number
from scenarios.evaluation import Evaluation, scenario_of, store_paths
from scenarios.evaluation_bars import bars_of, told_bars
from scenarios.evaluation_figures import figures_of
from scenarios.evaluation_report import Findings, report_html
from scenarios.evaluation_settings import assumptions
from scenarios.evaluation_tables import Row, as_data, rows_of, tables_csv
from scenarios.evaluation_why import differences, reasons
from scenarios.evaluation_worst import worst_scenes
from scenarios.output_folder import made_by, write_file, write_json
from scenarios.published import SOURCE

NewFolder = Callable[[Path], AbstractContextManager[Path]]


def findings_of(evaluation: Evaluation) -> Findings:
    """Return tables, bars, figures and worst scenes of an evaluation."""
    rows = rows_of(evaluation)
    return Findings(rows, bars_of(evaluation, rows), figures_of(evaluation), worst_scenes(evaluation))


def write_evaluation(evaluation: Evaluation, stores: Path, destination: Path, new_folder: NewFolder) -> str:
    """Write everything, whole or not at all; returns the tables and bars as text."""
    findings = findings_of(evaluation)
    with new_folder(destination) as folder:
        write_file(folder / "report.html", report_html(evaluation, findings))
        data = as_json(evaluation, findings)
        write_file(folder / "tables.csv", tables_csv(data["rows"]))
        (folder / "figures").mkdir()
        for name, picture in findings.figures.items():
            write_file(folder / "figures" / f"{name}.svg", picture)
        (folder / "stores").mkdir()
        for name, path in store_paths(evaluation.files, stores).items():
            shutil.copyfile(path, folder / "stores" / f"{name}.db")
        write_json(folder / "tables.json", data)
    return f"{table(findings.rows)}\n\n{told_bars(findings.bars)}"


def as_json(evaluation: Evaluation, findings: Findings) -> dict[str, Any]:
    """Return everything that the report says as plain data; undefined is null."""
    data = {
        "made_by": made_by(),
        "versions": next(iter(evaluation.results.values())).identity.versions,
        "published_source": SOURCE,
        "size": vars(evaluation.size),
        "rows": [as_data(row) for row in findings.rows],
        "bars": [vars(bar) for bar in findings.bars],
        "differences": differences(findings.rows),
        "reasons": reasons(evaluation, findings.rows),
        "worst": [{"method": one.method, "words": one.words, "replay": one.replay} for one in findings.worst],
        "assumptions": [vars(one) for one in assumptions(scenario_of(evaluation))],
    }
    return json.loads(json.dumps(data))  # tuples are lists, as they will be when it is read


def table(rows: Sequence[Row]) -> str:
    """Return the tables as text, by the paper's rule: found of all, in-view and observable leaks, and errors."""
    head = [
        "experiment",
        "setting",
        "method",
        "clips",
        "all",
        "in view",
        "observable",
        "error m",
        "median",
        "near wall",
    ]
    cells = [[*head, "elsewhere", "false/clip", "published"], *map(_cells, rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return "\n".join("  ".join(map(str.ljust, line, widths)).rstrip() for line in cells)


def _cells(row: Row) -> list[str]:
    part, there = row.paper_rule, row.published if row.method == "paper" else None
    found = [f"{one.leaks}/{one.of_leaks}" for one in part.found.values()]
    means = (part.error.mean_m, part.error.median_m, part.near_wall.mean_m, part.elsewhere.mean_m)
    errors = [number(mean_m, ".3f") for mean_m in means]
    published = "" if there is None else f"{there.found}/{there.of}, {there.mean_error_m:.2f} m"
    false = f"{part.false_per_clip:.2f}"
    return [row.experiment, row.setting, row.method, str(row.n_clips), *found, *errors, false, published]
