"""Pictures of one clip, in the manner of the paper's figures 6 and 7: frames, residual, column profiles, top view."""

import base64
import io
import math
from collections.abc import Sequence
from typing import Any

import cv2
import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from leakloc.background import temporal_median
from scenarios.score import Score
from scenarios.truth import LeakTruth, TrueCamera, Truth

TRUTH_COLOUR = "#0b6e4f"
ESTIMATE_COLOUR = "#c8102e"
PROFILE_COLOUR = "#1f4e79"
QUIET_COLOUR = "#8a8f98"

STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "font.family": "DejaVu Sans",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#555555",
    "svg.hashsalt": "leakloc",  # the same report gives the same bytes
    "svg.fonttype": "path",
}


def frame_png(frame_grey: np.ndarray, gain: float = 1.0) -> str:
    """PNG of a grey image (height, width) times a gain, clipped, as a data URI."""
    shown = np.clip(np.rint(frame_grey.astype(np.float64) * gain), 0, 255).astype(np.uint8)
    made, png = cv2.imencode(".png", shown)
    assert made
    return f"data:image/png;base64,{base64.b64encode(png.tobytes()).decode()}"


def residual_png(frames: np.ndarray) -> str:
    """PNG of the mean over frames of |I - temporal median| (frames, height, width), brightened to be seen."""
    residual = np.abs(frames - temporal_median(frames).grey).mean(axis=0)
    return frame_png(residual, 200.0 / max(float(np.percentile(residual, 99.9)), 1e-6))


def display_gain(frame_grey: np.ndarray) -> float:
    """Gain that brings the brightest part of an image, gamma hits left out, to 5/6 of white; at least 1."""
    bright = float(np.percentile(cv2.medianBlur(np.ascontiguousarray(frame_grey), 3), 99.5))
    return max(1.0, 212.0 / max(bright, 1.0))


def top_view(truth: Truth, estimates_m: Sequence[tuple[float, float]], scored: Score) -> str:
    """Top view with pedestal, fields of view, true leaks, estimates and error lines (paper's figure 7), as SVG."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(4.6, 4.6), layout="constrained")
        axes = figure.add_subplot(aspect="equal")
        radius_m = truth.rig.pedestal_radius_m
        axes.add_patch(Circle((0.0, 0.0), radius_m, facecolor="#f4f1ea", edgecolor="#6b6356", linewidth=1.5))
        for camera in (truth.rig.left, truth.rig.right):
            _draw_camera(axes, camera, radius_m)
        leak_of = {leak.id: leak for leak in truth.leaks}
        for pair in scored.gated.pairs:
            leak, (x_m, y_m) = leak_of[pair.leak_id], estimates_m[pair.estimate]
            axes.plot([leak.y_m, y_m], [leak.x_m, x_m], color=ESTIMATE_COLOUR, linewidth=1.0)
        _draw_leaks(axes, truth.leaks)
        finite = [place for place in estimates_m if math.isfinite(place[0] + place[1])]
        inside = [(x_m, y_m) for x_m, y_m in finite if math.hypot(x_m, y_m) < 1.2 * radius_m]
        axes.plot(
            [y for _, y in inside], [x for x, _ in inside], "x", color=ESTIMATE_COLOUR, ms=8, mew=1.8, label="estimate"
        )
        _name_axes(axes, radius_m, n_outside=len(finite) - len(inside))
        return _svg(figure)


def column_profiles(
    profiles_grey: Sequence[np.ndarray],
    thresholds_grey: Sequence[float],
    candidates_px: Sequence[np.ndarray],
    truth: Truth,
) -> str:
    """Column profiles of both views with threshold, candidates and true columns (paper's figure 6), as SVG."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.4, 4.6), layout="constrained")
        views = zip(("left", "right"), profiles_grey, thresholds_grey, candidates_px, strict=True)
        for i, (side, profile_grey, threshold_grey, columns_px) in enumerate(views):
            axes = figure.add_subplot(2, 1, i + 1)
            _draw_true_columns(axes, truth, side)
            axes.plot(profile_grey, color=PROFILE_COLOUR, linewidth=0.8, label="column aggregate g")
            axes.axhline(threshold_grey, color=ESTIMATE_COLOUR, linewidth=0.8, linestyle="--", label="threshold")
            found = np.asarray(columns_px, dtype=int)
            axes.plot(found, np.asarray(profile_grey)[found], "v", color=ESTIMATE_COLOUR, ms=6, label="candidate")
            axes.set_xlim(0, len(profile_grey) - 1)
            axes.set_ylim(bottom=min(0.95 * float(np.min(profile_grey)), float(np.min(profile_grey))))
            axes.set_ylabel(f"{side}: grey")
            axes.set_xlabel("column (px)" if i else "")
            if i == 0:
                axes.legend(ncols=5, loc="upper right", frameon=False, bbox_to_anchor=(1.0, 1.25))
        return _svg(figure)


def _draw_camera(axes: Axes, camera: TrueCamera, radius_m: float) -> None:
    pose = np.array(camera.world_from_camera)
    focal_px = camera.camera_matrix[0][0]
    x_m, y_m = pose[0, 3], pose[1, 3]
    for edge_px in (-0.5, camera.width_px - 0.5):
        ray = pose[:3, :3] @ np.array([(edge_px - camera.camera_matrix[0][2]) / focal_px, 0.0, 1.0])
        along = np.hypot(ray[0], ray[1])
        far_x, far_y = x_m + 2.2 * radius_m * ray[0] / along, y_m + 2.2 * radius_m * ray[1] / along
        axes.plot([y_m, far_y], [x_m, far_x], color=QUIET_COLOUR, linewidth=0.8, linestyle=":")
    axes.plot(y_m, x_m, "^", color="#333333", ms=6)


def _draw_leaks(axes: Axes, leaks: Sequence[LeakTruth]) -> None:
    for which, shown, colour in (("leak", True, TRUTH_COLOUR), ("leak, not observable", False, QUIET_COLOUR)):
        places = [(leak.y_m, leak.x_m) for leak in leaks if leak.observable is shown]
        if places:
            y_m, x_m = zip(*places, strict=True)
            axes.plot(y_m, x_m, "o", ms=10, mec=colour, mfc="none", mew=1.6, label=which)
    for leak in leaks:
        axes.annotate(
            f" {leak.id}", (leak.y_m, leak.x_m), xytext=(6, 4), textcoords="offset points", color=TRUTH_COLOUR
        )


def _name_axes(axes: Axes, radius_m: float, n_outside: int) -> None:
    axes.set_xlim(1.08 * radius_m, -1.08 * radius_m)  # y grows to the left, as the cameras see it
    axes.set_ylim(-1.08 * radius_m, 1.08 * radius_m)
    axes.set_xlabel("y (m), left is +")
    axes.set_ylabel("x (m), away from the cameras")
    axes.legend(loc="lower right", frameon=False)
    if n_outside:
        axes.set_title(f"{n_outside} estimate(s) outside the picture", fontsize=8, color=ESTIMATE_COLOUR)


def _draw_true_columns(axes: Axes, truth: Truth, side: str) -> None:
    columns = [leak.left_column_px if side == "left" else leak.right_column_px for leak in truth.leaks]
    shadows = [column for leak in truth.leaks for column in getattr(leak.shadow_columns_px, side)]
    for label, places, colour, style in (
        ("true leak", columns, TRUTH_COLOUR, "-"),
        ("its shadow", shadows, QUIET_COLOUR, ":"),
    ):
        for i, column in enumerate(place for place in places if place is not None):
            axes.axvline(
                column, color=colour, linewidth=1.2, linestyle=style, alpha=0.6, label=label if i == 0 else None
            )


def _svg(figure: Figure) -> str:
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()[text.getvalue().index("<svg") :]
