"""The page and the JSON of an envelope: the box, how it was shown, and what was not."""

from collections.abc import Iterator
from html import escape
from typing import Any

from scenarios.envelope import CONFIDENCE, LEAST_RATE, Box, Envelope, Test, grid_sizes
from scenarios.margins import bound_words
from scenarios.output_folder import made_by
from scenarios.report import page

STYLE = """<style>
.axis { display: grid; grid-template-columns: 11rem 4.5rem 1fr 4.5rem; gap: .6rem;
  align-items: center; margin: .35rem 0; }
.axis .low { text-align: right; } .axis .low, .axis .high { color: #646b75; font-variant-numeric: tabular-nums; }
.bar { position: relative; height: 1.5rem; background: #eceef1; border-radius: 3px; }
.bar div { position: absolute; top: 0; bottom: 0; background: #0b6e4f; border-radius: 3px; min-width: 4px; }
.bar span { position: absolute; inset: 0; text-align: center; font-size: .8rem; line-height: 1.5rem; color: #fff;
  text-shadow: 0 0 3px #000, 0 0 3px #000; }
</style>"""
LEAKS = "number of leaks"


def as_json(found: Envelope) -> dict[str, Any]:
    """Return the envelope as plain data: the box that is shown (null without one) and every test."""
    shown = found.shown
    return {
        "made_by": made_by(),
        "space": found.quest.space.name,
        "estimator": found.quest.estimator.text,
        "seed": found.quest.seed,
        "claim": claim(),
        "box": None if shown is None else ranges(found, shown.box),
        "share_of_space": None if shown is None else share_of_space(found, shown.box),
        "trials_chosen_on": found.n_explored,
        "tests": [
            {
                "box": ranges(found, test.box),
                "trials": test.n,
                "planned": test.planned,
                "successes": test.k,
                "lower_95": test.lower,
                "false_leaks": test.n_false,
                "shown": test.is_shown,
            }
            for test in found.tests
        ],
    }


def claim() -> str:
    """Say what is shown."""
    return (
        f"at least {LEAST_RATE:.0%} of the clips in the box, drawn uniformly, have every observable leak found within "
        f"{bound_words()}, with {CONFIDENCE:.0%} confidence"
    )


def ranges(found: Envelope, box: Box) -> dict[str, list[float]]:
    """Lowest and highest value of every parameter in a box."""
    space = found.quest.space
    ends = {
        axis.key: [axis.at((step + 0.5) / axis.n_values) for step in (first, last)]
        for axis, first, last in zip(space.axes, box.first, box.last, strict=False)
    }
    return ends | ({"leaks": [1 + box.first[-1], 1 + box.last[-1]]} if space.max_leaks else {})


def share_of_space(found: Envelope, box: Box) -> float:
    """Share of the space's grid points that are in a box."""
    share = 1.0
    for first, last, size in zip(box.first, box.last, _sizes(found), strict=True):
        share *= (last - first + 1) / size
    return share


def envelope_html(found: Envelope) -> str:
    """Return the page; the same envelope gives the same bytes."""
    quest, shown = found.quest, found.shown
    title = f"Envelope of {quest.estimator.text} in {quest.space.name}"
    lead = (
        "No box is shown: the smallest that was tested has too many failures."
        if shown is None
        else f"Shown in {share_of_space(found, shown.box):.1%} of the space: {shown.k} of {shown.n} fresh clips right."
    )
    bars = "" if shown is None else "".join(_bars(found, shown.box))
    return page(
        title,
        [
            STYLE,
            f"<h1>{escape(title)}</h1><p class='lead'>{escape(lead)}</p>",
            f"<p class='quiet'>The claim: {escape(claim())}.</p>",
            f"<h2>The box</h2>{bars or '<p>None.</p>'}",
            f"<h2>How it was shown</h2>{_tests(found)}",
            f"<p class='quiet'>Boxes were chosen on {found.n_explored} other clips and tested from the smallest to the "
            "largest on clips of their own until one was not shown; a clip is a trial when it has an observable leak. "
            "Clopper-Pearson, one-sided. A test is broken off once it cannot succeed any more.</p>",
        ],
    )


def _bars(found: Envelope, box: Box) -> Iterator[str]:
    space = found.quest.space
    whole = ranges(found, Box((0,) * len(box.first), tuple(size - 1 for size in _sizes(found))))
    labels = space.labels() | {"leaks": LEAKS}
    for (key, (low, high)), first, last, size in zip(
        ranges(found, box).items(), box.first, box.last, _sizes(found), strict=False
    ):
        left, width = 100.0 * first / size, 100.0 * (last - first + 1) / size
        words = f"{low:g} to {high:g}" if low != high else f"{low:g}"
        yield (
            f'<div class="axis"><b>{escape(labels[key])}</b><span class="low">{whole[key][0]:g}</span>'
            f'<div class="bar"><div style="left:{left:.2f}%;width:{width:.2f}%"></div><span>{words}</span></div>'
            f'<span class="high">{whole[key][1]:g}</span></div>'
        )


def _tests(found: Envelope) -> str:
    keys = list(ranges(found, found.tests[0].box))
    labels = found.quest.space.labels() | {"leaks": LEAKS}
    head = "".join(f"<th>{escape(labels[key])}</th>" for key in keys)
    rows = "".join(_row(found, test) for test in found.tests)
    return (
        f'<div class="wide"><table class="dense"><tr>{head}<th>clips right</th><th>lower end, 95 %</th>'
        f'<th>false leaks</th><th class="text">shown</th></tr>{rows}</table></div>'
    )


def _row(found: Envelope, test: Test) -> str:
    cells = "".join(f"<td>{low:g} – {high:g}</td>" for low, high in ranges(found, test.box).values())
    verdict = "<td class='text found'>yes</td>" if test.is_shown else "<td class='text missed'>no</td>"
    return f"<tr>{cells}<td>{test.k} / {test.n}</td><td>{test.lower:.3f}</td><td>{test.n_false}</td>{verdict}</tr>"


def _sizes(found: Envelope) -> list[int]:
    return grid_sizes(found.quest.space)
