"""A report of one clip: one HTML file that opens offline and shows what was seen, found, missed, and how far off."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from string import Template

import numpy as np

from leakloc import Clip, Estimate, LeakEstimate
from leakloc.background import temporal_median
from leakloc.condition import full_scale
from scenarios import figures
from scenarios.condition import condition_table
from scenarios.score import Pair, Score, table
from scenarios.simulate import SimulatedClip
from scenarios.truth import Truth

RESIDUAL_GAIN = 6.0


@dataclass(frozen=True)
class Located:
    """A clip with what an estimator made of it."""

    clip: SimulatedClip
    estimate: Estimate
    scored: Score


def report_html(methods: Sequence[Located]) -> str:
    """Return the page of one clip and what one or more methods made of it; the same input gives the same bytes."""
    first, clip = methods[0], methods[0].clip
    title = f"Leak localisation: {clip.scenario.name or 'scenario'}"
    sections = [
        f"<h1>{escape(title)}</h1>",
        f'<p class="quiet">{escape(clip.scenario.description)}. Found means within max(0.3 m, 3 px of disparity) of '
        "the truth.</p>",
        *(_method(located) for located in methods),
        _frames(clip.left, clip.right),
        _profiles((clip.left, clip.right), first.estimate, clip.truth),
        *(_score(located) for located in methods),
        _condition(first.estimate),
        _settings(clip),
    ]
    return page(title, sections)


def _method(located: Located) -> str:
    return (
        f"<h2>Method: {escape(located.estimate.method)}</h2>{_lead(located)}"
        f'<div class="side">{_top_view(located)}{_leak_table(located)}</div>'
    )


def _score(located: Located) -> str:
    text = escape(table(located.scored, located.clip.truth))
    return f"<h2>Score of the method {escape(located.estimate.method)}</h2><pre>{text}</pre>"


def _condition(estimate: Estimate) -> str:
    """What the robust method says of the clip's condition; nothing for methods that say nothing of it."""
    if "condition" not in estimate.diagnostics:
        return ""
    return f"<h2>Condition of the clip</h2><pre>{escape(condition_table(estimate.diagnostics))}</pre>"


def estimate_html(name: str, footage: Clip, estimate: Estimate) -> str:
    """Return a page of an estimate whose truth nobody knows: the pictures of the paper's figures 6 and 7."""
    title = f"Leaks found in {name}"
    sections = [
        f"<h1>{escape(title)}</h1>",
        f'<p class="lead">{len(estimate.leaks)} leaks found by the method {escape(estimate.method)}, '
        f"{escape(estimate.frame)} frame.</p>",
        f'<h2>Top view</h2><div class="side">{figures.estimate_view(estimate, footage.rig)}'
        f"{_estimate_table(estimate)}</div>",
        _frames(footage.left, footage.right),
        _profiles((footage.left, footage.right), estimate, None),
        _condition(estimate),
    ]
    return page(title, sections)


def page(title: str, sections: Sequence[str]) -> str:
    """Return one offline HTML page."""
    template = Template((files("scenarios") / "report_page.html").read_text(encoding="utf-8"))
    return template.substitute(title=escape(title), body="\n".join(sections))


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


def _estimate_table(estimate: Estimate) -> str:
    rows = "".join(
        f"<tr><td>{i}</td><td>{leak.x_m:.3f}</td><td>{leak.y_m:.3f}</td><td>{_sigma(leak)}</td>"
        f"<td>{leak.left_column_px:.2f}</td><td>{leak.right_column_px:.2f}</td><td>{leak.score:.1f}</td></tr>"
        for i, leak in enumerate(estimate.leaks)
    )
    head = "".join(f"<th>{name}</th>" for name in ("", "x (m)", "y (m)", "sigma (m)", "left px", "right px", "score"))
    return f"<table><tr>{head}</tr>{rows}</table>"


def _sigma(leak: LeakEstimate) -> str:
    """Standard deviation along the worst direction."""
    if not np.isfinite(leak.covariance_m2).all():
        return "-"
    return f"{np.sqrt(np.linalg.eigvalsh(leak.covariance_m2)[-1]):.3f}"


def _found_cells(pair: Pair | None, places: list[tuple[float, float]]) -> str:
    if pair is None:
        return '<td></td><td></td><td class="missed">missed</td>'
    x_m, y_m = places[pair.estimate]
    return f'<td>{x_m:.3f}</td><td>{y_m:.3f}</td><td class="found">{pair.error_m:.3f}</td>'


def _frames(left: np.ndarray, right: np.ndarray) -> str:
    number = len(left) // 2
    pictures, residuals = [], []
    deeper_bits = max(full_scale(left), full_scale(right)).bit_length() - 8
    for side, view in (("Left", left), ("Right", right)):
        frames = (view >> deeper_bits).astype(np.uint8) if deeper_bits else view
        gain = figures.display_gain(frames[number])
        pictures.append(
            _picture(figures.frame_png(frames[number], gain), f"{side}, frame {number}{figures.brightened(gain)}")
        )
        residual = np.abs(frames[number] - temporal_median(frames).grey)
        residuals.append(
            _picture(
                figures.frame_png(residual, RESIDUAL_GAIN), f"{side}, |I - median|{figures.brightened(RESIDUAL_GAIN)}"
            )
        )
    return (
        f'<h2>Input pair</h2><div class="pair">{"".join(pictures)}</div>'
        f'<h2>Residual after background subtraction</h2><div class="pair">{"".join(residuals)}</div>'
    )


def _picture(uri: str, caption: str) -> str:
    return f'<figure><img src="{uri}" alt="{escape(caption)}"><figcaption>{escape(caption)}</figcaption></figure>'


def _profiles(frames: Sequence[np.ndarray], estimate: Estimate, truth: Truth | None) -> str:
    pictures = figures.profile_pictures(frames, estimate, truth)
    return f"<h2>Column profiles</h2>{figures.column_profiles(pictures)}"


def _settings(clip: SimulatedClip) -> str:
    rig, recording = clip.scenario.rig, clip.scenario.recording
    return (
        f'<p class="quiet">{rig.width_px} x {rig.height_px} px, {rig.hfov_deg:g} deg, baseline {rig.baseline_m:g} m; '
        f"{recording.n_frames} frames at {recording.fps:g} / s, exposure {recording.exposure_s:.4g} s; "
        f"{clip.scenario.gamma.dose_rate_gy_h:g} Gy/h; seed {clip.scenario.seed}.</p>"
    )


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)
