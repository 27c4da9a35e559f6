"""A campaign's report: one HTML file that opens offline, with tables, figures, codes, and how to replay the worst."""

from collections.abc import Iterable, Sequence
from html import escape

from scenarios.campaign_figures import caption, main_axis, short, sweep_figure
from scenarios.campaign_summary import NOTE, Cell, cells, number, told, worst
from scenarios.report import page
from scenarios.store import Stored
from scenarios.stored_run import COUNTED, Run, replay_command

N_WORST = 12
OPTIONS = {"method": "--method", "callable": "--estimator", "command": "--command"}


def report_html(stored: Stored) -> str:
    """Return the page; the same results give the same bytes."""
    campaign = stored.identity.campaign
    title = f"Campaign: {campaign.name or 'without a name'}"
    table_cells = cells(stored.runs)
    sections = [f"<h1>{escape(title)}</h1>", _lead(stored)]
    if table_cells:
        sections += [
            *_figure(stored, table_cells),
            f'<h2>What was found</h2><p class="quiet">{escape(NOTE)}</p>{_table(table_cells)}',
            f"<h2>What became of every leak, and what was false</h2>{_codes(table_cells)}",
            f"<h2>The worst scenes</h2>{_worst(stored)}",
        ]
    return page(title, sections)


def _lead(stored: Stored) -> str:
    identity, campaign = stored.identity, stored.identity.campaign
    there = len({run.scene for run in stored.runs})
    of = f"{campaign.n_arms} arms of {campaign.repeats} repeats" if campaign.space is None else "one space"
    base = campaign.scenario or (campaign.space.stratum if campaign.space else "")
    overrides = f", with {', '.join(campaign.set)}" if campaign.set else ""
    methods = ", ".join(spec.text for spec in identity.estimators)
    return (
        f'<p class="lead">{escape(campaign.description)}</p>'
        f'<p class="quiet">{there} of {campaign.n_scenes} scenes done: {of}, {escape(base + overrides)}; '
        f"methods {escape(methods)}. Repeat r has the same seed in every arm, and all methods see the same clips; "
        f"campaign seed {campaign.seed}.</p>"
        f'<p class="quiet">{escape(identity.versions)}</p>'
    )


def _figure(stored: Stored, table_cells: Sequence[Cell]) -> list[str]:
    axis = main_axis(table_cells)
    if axis is None:
        return []
    picture = sweep_figure(stored.identity.campaign, table_cells, axis)
    return [f'<h2>Detection and error</h2><p class="quiet">{escape(caption(table_cells, axis))}</p>{picture}']


def _table(table_cells: Sequence[Cell]) -> str:
    axes = list(table_cells[0].values)
    names = [which.replace("_", " ") for which in COUNTED]
    head = "".join(f'<th class="text">{escape(axis)}</th>' for axis in (*map(short, axes), "method"))
    head += "<th>clips</th>" + "".join(f"<th>{name}: leaks</th><th>clips [95 %]</th>" for name in names)
    head += "<th>false / clip</th><th>mean error (m)</th><th>(px)</th>"
    return _wide(head, map(_table_row, table_cells))


def _table_row(cell: Cell) -> str:
    rates = [words for found in cell.found.values() for words in told(found)]
    errors = [number(cell.mean_error_m, ".3f"), number(cell.mean_error_px, ".2f")]
    numbers = "".join(f"<td>{words}</td>" for words in (cell.n_clips, *rates, f"{cell.false_per_clip:.2f}", *errors))
    return f"<tr>{_names(cell)}{numbers}</tr>"


def _codes(table_cells: Sequence[Cell]) -> str:
    codes = sorted({code for cell in table_cells for code in cell.codes}, key=lambda code: (code != "found", code))
    head = "".join(f'<th class="text">{escape(axis)}</th>' for axis in (*map(short, table_cells[0].values), "method"))
    head += "".join(f"<th>{escape(code).replace('.', '.<wbr>')}</th>" for code in codes)
    rows = []
    for cell in table_cells:
        numbers = "".join(f"<td>{cell.codes.get(code) or ''}</td>" for code in codes)
        rows.append(f"<tr>{_names(cell)}{numbers}</tr>")
    return _wide(head, rows)


def _wide(head: str, rows: Iterable[str]) -> str:
    return f'<div class="wide"><table class="dense"><tr>{head}</tr>{"".join(rows)}</table></div>'


def _names(cell: Cell) -> str:
    return "".join(f'<td class="text">{escape(str(value))}</td>' for value in (*cell.values.values(), cell.method))


def _worst(stored: Stored) -> str:
    kinds = {spec.text: OPTIONS[spec.kind] for spec in stored.identity.estimators}
    items = "".join(_bad_run(run, kinds[run.method]) for run in worst(stored.runs, N_WORST))
    return f'<p class="quiet">Each with the command that explains it.</p>{items}'


def _bad_run(run: Run, option: str) -> str:
    arm = ", ".join(f"{axis} {value}" for axis, value in run.values.items())
    missed = f"{run.found['observable']} of {run.of['observable']} observable leaks found, {len(run.false_codes)} false"
    error = f", largest error {max(run.errors_m):.3f} m" if run.errors_m else ""
    what = f"{missed}{error}" if run.outcome == "ok" else f"{run.outcome}: {run.detail}"
    where = f"scene {run.scene}{f', {arm}' if arm else ''}, {run.method}"
    return f"<p>{escape(where)}: {escape(what)}</p><pre class='command'>{escape(replay_command(run, option))}</pre>"
