"""A report of one clip: one HTML file that opens offline and shows what was seen, found, missed, and how far off."""

from dataclasses import dataclass
from html import escape
from importlib.resources import files
from string import Template

import numpy as np

from leakloc import Estimate
from leakloc.background import temporal_median
from scenarios import figures
from scenarios.score import Pair, Score, table
from scenarios.simulate import CAMERAS, SimulatedClip

RESIDUAL_GAIN = 6.0


@dataclass(frozen=True)
class Located:
    """A clip with what an estimator made of it."""

    clip: SimulatedClip
    estimate: Estimate
    scored: Score


def report_html(located: Located) -> str:
    """Return the whole page; the same clip and estimate give the same bytes."""
    clip, scored = located.clip, located.scored
    title = f"Leak localisation: {clip.scenario.name or 'scenario'}"
    sections = [
        f"<h1>{escape(title)}</h1>",
        _lead(located),
        f'<h2>Top view</h2><div class="side">{_top_view(located)}{_leak_table(located)}</div>',
        _frames(clip),
        _profiles(located),
        f"<h2>Score</h2><pre>{escape(table(scored, clip.truth))}</pre>",
        _settings(clip),
    ]
    page = Template((files("scenarios") / "report_page.html").read_text(encoding="utf-8"))
    return page.substitute(title=escape(title), body="\n".join(sections))


def positions(estimate: Estimate) -> list[tuple[float, float]]:
    """Return the (x, y) of every estimated leak, m."""
    return [(leak.x_m, leak.y_m) for leak in estimate.leaks]


def _lead(located: Located) -> str:
    gated = located.scored.gated
    error = f"mean error {100 * gated.mean_error_m:.1f} cm" if gated.pairs else "no error to state"
    false = f"{len(gated.false)} false" if gated.false else "none false"
    return (
        f'<p class="lead">{gated.observable.found} of {gated.observable.of} observable leaks found '
        f"({gated.all.found} of {gated.all.of} of all, {gated.in_view.found} of {gated.in_view.of} in view), "
        f"{error}, {false}.</p>"
        f'<p class="quiet">Method: {escape(located.estimate.method)}. {escape(located.clip.scenario.description)}. '
        "Found means within max(0.3 m, 3 px of disparity) of the truth.</p>"
    )


def _top_view(located: Located) -> str:
    return figures.top_view(located.clip.truth, positions(located.estimate), located.scored)


def _leak_table(located: Located) -> str:
    pair_of = {pair.leak_id: pair for pair in located.scored.gated.pairs}
    places = positions(located.estimate)
    rows = "".join(
        f"<tr><td>{leak.id}</td><td>{leak.x_m:.3f}</td><td>{leak.y_m:.3f}</td>"
        f"{_found_cells(pair_of.get(leak.id), places)}"
        f'<td>{_number(leak.column_snr, ".1f")}</td><td class="text">{escape(leak.reason or "observable")}</td></tr>'
        for leak in located.clip.truth.leaks
    )
    rows += "".join(
        f"<tr><td>-</td><td></td><td></td><td>{places[i][0]:.3f}</td><td>{places[i][1]:.3f}</td>"
        '<td class="missed">false</td><td></td><td class="text"></td></tr>'
        for i in located.scored.gated.false
    )
    return (
        "<table><tr><th>leak</th><th>x (m)</th><th>y (m)</th><th>found x</th><th>found y</th><th>error (m)</th>"
        f'<th>SNR</th><th class="text">verdict</th></tr>{rows}</table>'
    )


def _found_cells(pair: Pair | None, places: list[tuple[float, float]]) -> str:
    if pair is None:
        return '<td></td><td></td><td class="missed">missed</td>'
    x_m, y_m = places[pair.estimate]
    return f'<td>{x_m:.3f}</td><td>{y_m:.3f}</td><td class="found">{pair.error_m:.3f}</td>'


def _frames(clip: SimulatedClip) -> str:
    number = len(clip.left) // 2
    pictures, residuals = [], []
    for side, frames in (("Left", clip.left), ("Right", clip.right)):
        gain = figures.display_gain(frames[number])
        pictures.append(_picture(figures.frame_png(frames[number], gain), f"{side}, frame {number}{_brightened(gain)}"))
        residual = np.abs(frames[number] - temporal_median(frames).grey)
        residuals.append(
            _picture(figures.frame_png(residual, RESIDUAL_GAIN), f"{side}, |I - median|{_brightened(RESIDUAL_GAIN)}")
        )
    return (
        f'<h2>Input pair</h2><div class="pair">{"".join(pictures)}</div>'
        f'<h2>Residual after background subtraction</h2><div class="pair">{"".join(residuals)}</div>'
    )


def _brightened(gain: float) -> str:
    return "" if gain < 1.05 else f", brightened {gain:.2g} times"


def _picture(uri: str, caption: str) -> str:
    return f'<figure><img src="{uri}" alt="{escape(caption)}"><figcaption>{escape(caption)}</figcaption></figure>'


def _profiles(located: Located) -> str:
    diagnostics = located.estimate.diagnostics
    svg = figures.column_profiles(
        [np.asarray(diagnostics[side]["profile_grey"]) for side in CAMERAS],
        [float(diagnostics[side]["threshold_grey"]) for side in CAMERAS],
        [np.asarray(diagnostics[side]["candidate_columns_px"], dtype=int) for side in CAMERAS],
        located.clip.truth,
    )
    return f"<h2>Column profiles</h2>{svg}"


def _settings(clip: SimulatedClip) -> str:
    rig, recording = clip.scenario.rig, clip.scenario.recording
    return (
        f'<p class="quiet">{rig.width_px} x {rig.height_px} px, {rig.hfov_deg:g} deg, baseline {rig.baseline_m:g} m; '
        f"{recording.n_frames} frames at {recording.fps:g} / s, exposure {recording.exposure_s:.4g} s; "
        f"{clip.scenario.gamma.dose_rate_gy_h:g} Gy/h; seed {clip.scenario.seed}.</p>"
    )


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)
