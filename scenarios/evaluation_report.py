"""The page of the paper's evaluation: bars, tables beside the published numbers, figures, and why they differ."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from scenarios.campaign_summary import Found, number, told
from scenarios.evaluation import EXPERIMENTS, Evaluation, Experiment, scenario_of
from scenarios.evaluation_bars import Bar
from scenarios.evaluation_figures import MAX_SCENES
from scenarios.evaluation_settings import assumptions
from scenarios.evaluation_tables import Errors, Row, Tally
from scenarios.evaluation_why import cures, differences, reasons
from scenarios.evaluation_worst import WorstScene
from scenarios.figures import png_uri
from scenarios.published import LEVELS_GY_H, SOURCE
from scenarios.report import page
from scenarios.scene_work import NEAR_WALL_M
from scenarios.statistics import FEWEST_CLIPS
from scenarios.stored_run import COUNTED

RULE_NAMES = {
    "paper_rule": "By the paper's rule: estimates and leaks are paired at least total distance, however far apart.",
    "gated": "By the gate: an estimate counts within max(0.3 m, 3 px of disparity) of a leak.",
}
NOTE = (
    "Leaks found, out of those that count; below, clips with all such leaks found and the 95 % interval "
    "(Clopper-Pearson) of their rate: clips are the trials, for leaks of one clip are not independent. Errors: mean ± "
    "standard deviation over found leaks, and the 95 % interval of the mean (bootstrap over clips; none with fewer "
    f"than {FEWEST_CLIPS}). One estimate from two columns wrongly matched can lie far outside and make a mean: the "
    f"median stands beside it. Near the wall is less than {NEAR_WALL_M:g} m from it; means, in brackets the number of "
    "leaks."
)
CAPTIONS = {
    "figure_6": "Figure 6: input pair, residual, column profiles with threshold (first separated scene, noise H).",
    "figure_7": "Figure 7, noise {}: leaks of the separated scenes (the first {} of them at most), estimates, error "
    "lines (dashed beyond the gate), fields of view.",
    "figure_8": "Figure 8: the scenes with {} leaks, estimates, error lines, missed leaks, fields of view; noise H.",
}


@dataclass(frozen=True)
class Findings:
    """Everything that the page says beside what the evaluation itself holds."""

    rows: Sequence[Row]
    bars: Sequence[Bar]
    figures: dict[str, str]
    worst: Sequence[WorstScene] = ()


def report_html(evaluation: Evaluation, findings: Findings) -> str:
    """Return the page; the same results give the same bytes."""
    sections = [
        "<h1>The paper's evaluation, reproduced</h1>",
        _lead(evaluation, findings),
        f"<h2>Bars</h2>{_bars(findings.bars)}",
        f'<h2>Tables</h2><p class="quiet">{escape(NOTE)}</p>',
        *(_experiment(experiment, findings.rows) for experiment in EXPERIMENTS),
        f"<h2>Figures</h2>{''.join(_figure(name, picture) for name, picture in findings.figures.items())}",
        f"<h2>The worst separated scenes</h2>{''.join(map(_worst, findings.worst)) or '<p>Nothing went wrong.</p>'}",
        *_why(evaluation, findings.rows),
        f"<h2>What stands for the values that are not published</h2>{_assumptions(evaluation)}",
        f'<h2>How this was made</h2><p class="quiet">{escape(_versions(evaluation))}</p>',
    ]
    return page("The paper's evaluation, reproduced", sections)


def caption(name: str) -> str:
    """Return what a figure shows."""
    figure, setting = name[:8], name[9:]
    return CAPTIONS[figure].format(setting, MAX_SCENES)


def _lead(evaluation: Evaluation, findings: Findings) -> str:
    n_met = sum(bar.is_met for bar in findings.bars)
    n_clips = sum(len({run.scene for run in stored.runs}) for stored in evaluation.results.values())
    levels = ", ".join(f"{level} {dose:g}" for level, dose in LEVELS_GY_H.items())
    return (
        f'<p class="lead">{n_met} of {len(findings.bars)} bars are met, over {n_clips} simulated stereo clips.</p>'
        f'<p class="quiet">The published numbers are from {escape(SOURCE)}. <b>paper</b> is its method, <b>robust</b> '
        f"ours; both see the same clips. Noise: {levels} Gy/h. {evaluation.size.separated} random scenes of three "
        f"leaks, {evaluation.size.multiple} of five and of seven.</p>"
    )


def _bars(bars: Sequence[Bar]) -> str:
    rows = "".join(
        f'<tr><td class="text">{escape(bar.experiment)} {escape(bar.setting)}</td><td class="text">{escape(bar.method)}'
        f'</td><td class="text">{escape(bar.wanted)}</td><td class="text">{escape(bar.got)}</td>'
        f'<td class="text {"found" if bar.is_met else "missed"}">{"met" if bar.is_met else "not met"}</td></tr>'
        for bar in bars
    )
    head = "".join(f'<th class="text">{name}</th>' for name in ("experiment", "method", "bar", "got", ""))
    return _wide(head, [rows])


def _experiment(experiment: Experiment, rows: Sequence[Row]) -> str:
    mine = [row for row in rows if row.experiment == experiment.name]
    parts = [f"<h3>{escape(experiment.title)}</h3>"]
    for rule, name in RULE_NAMES.items():
        parts.append(f'<p class="quiet">{escape(name)}</p>{_table(mine, rule)}')
    return "".join(parts)


Column = tuple[str, Callable[[Row, Tally], str]]

COLUMNS: tuple[Column, ...] = (
    *((which.replace("_", " "), lambda _, part, which=which: _rate(part.found[which])) for which in COUNTED),
    ("error (m)", lambda _, part: _error(part.error)),
    ("median", lambda _, part: number(part.error.median_m, ".3f")),
    ("near the wall", lambda _, part: _split(part.near_wall)),
    ("elsewhere", lambda _, part: _split(part.elsewhere)),
    ("false / clip", lambda _, part: f"{part.false_per_clip:.2f}"),
)


def _table(rows: Sequence[Row], rule: str) -> str:
    columns: list[Column] = [("clips", lambda row, _: str(row.n_clips))]
    if rule == "paper_rule" and any(row.published for row in rows):
        columns.append(("published", lambda row, _: _published(row)))
    columns += COLUMNS
    head = '<th class="text">setting</th><th class="text">method</th>'
    head += "".join(f"<th>{name}</th>" for name, _ in columns)
    return _wide(head, (_row(row, [cell(row, getattr(row, rule)) for _, cell in columns]) for row in rows))


def _row(row: Row, cells: Sequence[str]) -> str:
    names = "".join(f'<td class="text">{escape(name)}</td>' for name in (row.setting, row.method))
    return f"<tr>{names}{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"


def _published(row: Row) -> str:
    there = row.published
    if there is None or row.method != "paper":
        return ""
    return f"{there.found}/{there.of}<br>{there.mean_error_m:.2f} ± {there.sd_error_m:.2f} m"


def _rate(found: Found) -> str:
    return "<br>".join(told(found))


def _error(error: Errors) -> str:
    """Mean and standard deviation, with the interval of the mean where there is one; a dash without errors."""
    if not error.n:
        return "-"
    interval = "" if np.isnan(error.low_m) else f"<br>[{error.low_m:.3f}, {error.high_m:.3f}]"
    return f"{error.mean_m:.3f} ± {error.sd_m:.3f}{interval}"


def _split(error: Errors) -> str:
    return f"{number(error.mean_m, '.3f')} ({error.n})"


def _figure(name: str, picture: str) -> str:
    return f"<figure>{picture}<figcaption>{escape(caption(name))}</figcaption></figure>"


def _worst(scene: WorstScene) -> str:
    return (
        f'<figure><img src="{png_uri(scene.png)}" alt="what the left camera saw change, and the map" width="480">'
        f"<figcaption>{escape(scene.method)}: {escape(scene.words)}. Leaks green, their shadows grey, estimates red."
        f"</figcaption></figure><pre class='command'>{escape(scene.replay)}</pre>"
    )


def _why(evaluation: Evaluation, rows: Sequence[Row]) -> list[str]:
    commands = escape("\n".join(cures(evaluation).replays))
    return [
        f"<h2>Where the simulated paper's method differs from the published values</h2>{_list(differences(rows))}",
        f"<h2>Why</h2>{_list(reasons(evaluation, rows))}",
        '<p class="quiet">Clips with such leaks, each with the command that explains it:</p>'
        f"<pre class='command'>{commands}</pre>" * bool(commands),
    ]


def _assumptions(evaluation: Evaluation) -> str:
    rows = "".join(
        f'<tr><td class="text">{escape(one.what)}</td><td>{escape(one.value)}</td>'
        f'<td class="text">{escape(one.unit)}</td><td class="text"><code>{escape(one.key)}</code></td></tr>'
        for one in assumptions(scenario_of(evaluation))
    )
    head = '<th class="text">quantity</th><th>value</th><th class="text">unit</th><th class="text">key</th>'
    return _wide(head, [rows])


def _versions(evaluation: Evaluation) -> str:
    return next(iter(evaluation.results.values())).identity.versions


def _list(sentences: Sequence[str]) -> str:
    return f"<ul>{''.join(f'<li>{escape(sentence)}</li>' for sentence in sentences)}</ul>"


def _wide(head: str, rows: Iterable[str]) -> str:
    return f'<div class="wide"><table class="dense"><tr>{head}</tr>{"".join(rows)}</table></div>'
