"""The page of an atlas of failures: outcome codes by parameters, with the plainest example of every cell."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from scenarios.estimators import EstimatorSpec
from scenarios.figures import png_uri
from scenarios.hunted import Cell, Counterexample
from scenarios.report import page
from scenarios.scenario import Scenario
from scenarios.scene_file import conditions
from scenarios.shrunk_folder import explain_command, told
from scenarios.space import Space
from scenarios.space_point import n_values, parameters

THIRD_NAMES = ("low", "mid", "high")
STYLE = """<style>
.atlas td, .atlas th { vertical-align: top; text-align: left; padding: .25rem .3rem; }
.atlas td.cell { width: 66px; min-width: 66px; text-align: center; font-size: .75rem; }
.atlas td.first, .atlas th.first { border-left: 2px solid #c9ccd2; }
.atlas .thumb { width: 62px; height: 26px; border: 1px solid #c9ccd2; display: block; background-size: cover; }
.atlas .none { color: #b9bec6; }
.cards { display: grid; grid-template-columns: 1fr 1fr; gap: 1rem 1.2rem; }
.cards .thumb { width: 100%; max-width: 480px; aspect-ratio: 480 / 200; border: 1px solid #e2e4e8;
  background-size: cover; }
.cards pre { font-size: .78rem; margin: .3rem 0; }
.cards h3 { margin: .2rem 0 .3rem; }
.card { border-top: 2px solid #c9ccd2; padding-top: .3rem; min-width: 0; }
</style>"""


@dataclass(frozen=True)
class Entry:
    """A counterexample with the cells where it is the plainest, the scene made plain (if it was), and its picture."""

    found: Counterexample
    shrunk: Scenario | None
    cells: tuple[Cell, ...]
    png: bytes

    @property
    def name(self) -> str:
        """Name of its files, of scene and code."""
        return f"{self.found.number:05d}-{self.found.code.replace('.', '-')}"

    @property
    def file(self) -> str:
        """Scene file as it was met, in the hunt's folder."""
        return f"scenes/{self.name}.toml"

    @property
    def plain_file(self) -> str:
        """Scene file made plain."""
        return f"scenes/{self.name}-plain.toml"

    @property
    def picture(self) -> str:
        """Thumbnail."""
        return f"scenes/{self.name}.png"


def atlas_html(space: Space, estimator: EstimatorSpec, n_scenes: int, entries: Sequence[Entry]) -> str:
    """Return the page, which opens offline beside the folder `scenes`; the same atlas gives the same bytes."""
    title = f"Atlas of failures: {estimator.text} in {space.name}"
    codes = sorted({entry.found.code for entry in entries})
    lead = (
        f"{len(codes)} kinds of failure, shown by {len(entries)} scenes."
        if entries
        else "No failure was met: which proves nothing but that this search met none."
    )
    sections = [
        STYLE,
        _pictures(entries),
        f"<h1>{escape(title)}</h1>",
        f'<p class="lead">{escape(lead)}</p>',
        f'<p class="quiet">{n_scenes} scenes were looked at where failures were likely. They are counterexamples, no '
        "sample: nothing here says how often the estimator fails.</p>",
        _matrix(space, codes, entries) if entries else "",
        *(_cards(code, [entry for entry in entries if entry.found.code == code], estimator) for code in codes),
    ]
    return page(title, sections)


def _pictures(entries: Sequence[Entry]) -> str:
    """Style of every thumbnail: a picture that stands in many cells is in the page once."""
    rules = "".join(f".{_class(entry)} {{ background-image: url({png_uri(entry.png)}); }}\n" for entry in entries)
    return f"<style>\n{rules}</style>"


def _thumb(entry: Entry, words: str) -> str:
    return f'<div class="thumb {_class(entry)}" role="img" aria-label="{escape(words)}"></div>'


def _class(entry: Entry) -> str:
    return f"t{entry.name}"


def _matrix(space: Space, codes: Sequence[str], entries: Sequence[Entry]) -> str:
    """Codes by thirds of the parameters' ranges; the parameters are broken into rows of three to fit a screen."""
    labels = space.labels()
    moving = [name for name, values in zip(parameters(space), n_values(space), strict=True) if values > 1]
    blocks = [moving[i : i + 3] for i in range(0, len(moving), 3)]
    tables = "".join(_block(block, labels, codes, entries) for block in blocks)
    return (
        "<h2>Where each failure was met</h2>"
        '<p class="quiet">Of each parameter the low, middle and high third of its range; in every cell the plainest '
        f"scene that shows the failure. A dot is a cell in which it was not met.</p>{tables}"
    )


def _block(names: Sequence[str], labels: dict[str, str], codes: Sequence[str], entries: Sequence[Entry]) -> str:
    there = {(entry.found.code, cell): entry for entry in entries for cell in entry.cells}
    head = "".join(f'<th class="first" colspan="3">{escape(labels.get(name, name))}</th>' for name in names)
    thirds = "".join(
        f'<th class="{"first" if third == 0 else ""}">{word}</th>'
        for _ in names
        for third, word in enumerate(THIRD_NAMES)
    )
    rows = []
    for code in codes:
        cells = "".join(
            _cell(there.get((code, Cell(name, third))), first=third == 0) for name in names for third in range(3)
        )
        rows.append(f"<tr><th>{escape(code).replace('.', '.<wbr>')}</th>{cells}</tr>")
    heads = f"<tr><th></th>{head}</tr><tr><th></th>{thirds}</tr>"
    return f'<div class="wide"><table class="atlas">{heads}{"".join(rows)}</table></div>'


def _cell(entry: Entry | None, *, first: bool) -> str:
    kind = "cell first" if first else "cell"
    if entry is None:
        return f'<td class="{kind} none">·</td>'
    target = f"#{entry.name}"
    return f'<td class="{kind}"><a href="{target}">{_thumb(entry, f"scene {entry.found.number}")}</a></td>'


def _cards(code: str, entries: Sequence[Entry], estimator: EstimatorSpec) -> str:
    first = sorted(entries, key=lambda entry: (entry.shrunk is None, entry.found.plainness, entry.found.number))
    cards = "".join(_card(entry, estimator) for entry in first)
    return f'<h2>{escape(code)}</h2><div class="cards">{cards}</div>'


def _card(entry: Entry, estimator: EstimatorSpec) -> str:
    found = entry.found
    if entry.shrunk is None:
        text = "\n".join(conditions(found.scenario)) or "(the plain scene)"
        plain, file = "", entry.file
    else:
        text = told(entry.shrunk, found.code, estimator, Path(entry.plain_file).name)
        plain, file = f'<a href="{entry.plain_file}">made plain</a>, ', entry.plain_file
    detail = f"<br>{escape(found.detail)}" if found.detail else ""
    return (
        f'<div class="card" id="{entry.name}"><h3>Scene {found.number}</h3>'
        f"{_thumb(entry, 'left residual and top view')}"
        f'<p class="quiet">{plain}<a href="{entry.file}">as it was met</a>; margin {found.severity}{detail}</p>'
        f"<pre>{escape(text)}</pre><pre class='command'>{escape(explain_command(file, estimator))}</pre></div>"
    )
