"""Pictures of one clip, in the manner of the paper's figures 6 and 7: frames, residual, column profiles, top view."""

import base64
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Ellipse

from leakloc import Estimate, LeakEstimate, PaperOptions, Rig
from leakloc.background import temporal_median
from leakloc.paper import view_columns
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
    return png_uri(png.tobytes())


def png_uri(png: bytes) -> str:
    """Return a PNG as a data URI, so that pages open offline."""
    return f"data:image/png;base64,{base64.b64encode(png).decode()}"


def residual_png(frames: np.ndarray) -> str:
    """PNG of the mean over frames of |I - temporal median| (frames, height, width), brightened to be seen."""
    residual = np.abs(frames - temporal_median(frames).grey).mean(axis=0)
    return frame_png(residual, 200.0 / max(float(np.percentile(residual, 99.9)), 1e-6))


def display_gain(frame_grey: np.ndarray) -> float:
    """Gain that brings the brightest part of an image, gamma hits left out, to 5/6 of white; at least 1."""
    bright = float(np.percentile(cv2.medianBlur(np.ascontiguousarray(frame_grey), 3), 99.5))
    return max(1.0, 212.0 / max(bright, 1.0))


def brightened(gain: float) -> str:
    """Say by how much a picture is brightened; nothing when it is not."""
    return "" if gain < 1.05 else f", brightened {gain:.2g} times"


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
        gated = {pair.leak_id for pair in scored.gated.pairs}
        for pair in scored.paper_rule.pairs:  # beyond the gate, yet the nearest: what the paper would call found
            if pair.leak_id not in gated:
                leak, (x_m, y_m) = leak_of[pair.leak_id], estimates_m[pair.estimate]
                axes.plot([leak.y_m, y_m], [leak.x_m, x_m], color=ESTIMATE_COLOUR, linewidth=0.8, linestyle="--")
        _draw_leaks(axes, truth.leaks)
        finite = [place for place in estimates_m if math.isfinite(place[0] + place[1])]
        inside = [(x_m, y_m) for x_m, y_m in finite if math.hypot(x_m, y_m) < 1.2 * radius_m]
        axes.plot(
            [y for _, y in inside], [x for x, _ in inside], "x", color=ESTIMATE_COLOUR, ms=8, mew=1.8, label="estimate"
        )
        name_axes(axes, radius_m, n_outside=len(finite) - len(inside))
        return svg(figure)


def estimate_view(estimate: Estimate, rig: Rig) -> str:
    """Top view of an estimate whose truth nobody knows: cameras, wall if known, leaks with 95 % ellipses, as SVG."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(4.6, 4.6), layout="constrained")
        axes = figure.add_subplot(aspect="equal")
        reach_m = rig.pedestal_radius or max([3.0, *(math.hypot(leak.x_m, leak.y_m) for leak in estimate.leaks)])
        if rig.pedestal_radius is not None:
            axes.add_patch(Circle((0.0, 0.0), reach_m, facecolor="#f4f1ea", edgecolor="#6b6356", linewidth=1.5))
        for K, camera_from_frame in ((rig.K1, rig.left_from_frame), (rig.K2, rig.right_from_frame)):
            draw_view(axes, np.linalg.inv(camera_from_frame), K, rig.image_size[0], reach_m)
        for leak in estimate.leaks:
            axes.plot(leak.y_m, leak.x_m, "x", color=ESTIMATE_COLOUR, ms=8, mew=1.8)
            _draw_ellipse(axes, leak)
        name_axes(axes, reach_m, n_outside=0)
        return svg(figure)


@dataclass(frozen=True)
class ProfilePicture:
    """What is drawn of one view's column profile: the paper's aggregate g and threshold, and columns, all in px."""

    profile_grey: np.ndarray
    threshold_grey: float
    found_px: Sequence[float]
    leaks_px: Sequence[float | None] = ()
    shadows_px: Sequence[float | None] = ()


def profile_pictures(frames: Sequence[np.ndarray], estimate: Estimate, truth: Truth | None) -> list[ProfilePicture]:
    """Profiles of both views by the paper's eq. 3, with the columns of the estimate and, where known, of the truth."""
    pictures = []
    for side, view in zip(("left", "right"), frames, strict=True):
        seen = view_columns(view, PaperOptions())
        found_px = [getattr(leak, f"{side}_column_px") for leak in estimate.leaks]
        leaks_px = [getattr(leak, f"{side}_column_px") for leak in truth.leaks] if truth else []
        shadows_px = [c for leak in truth.leaks for c in getattr(leak.shadow_columns_px, side)] if truth else []
        pictures.append(ProfilePicture(seen.profile_grey, seen.threshold_grey, found_px, leaks_px, shadows_px))
    return pictures


def column_profiles(pictures: Sequence[ProfilePicture]) -> str:
    """Column profiles of both views with threshold and columns (paper's figure 6), as SVG."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.4, 4.6), layout="constrained")
        for i, (side, picture) in enumerate(zip(("left", "right"), pictures, strict=True)):
            axes = figure.add_subplot(2, 1, i + 1)
            draw_columns(axes, "true leak", picture.leaks_px, TRUTH_COLOUR, "-")
            draw_columns(axes, "its shadow", picture.shadows_px, QUIET_COLOUR, ":")
            axes.plot(picture.profile_grey, color=PROFILE_COLOUR, linewidth=0.8, label="column aggregate g")
            axes.axhline(picture.threshold_grey, color=ESTIMATE_COLOUR, lw=0.8, ls="--", label="paper's threshold")
            last = len(picture.profile_grey) - 1
            found = [column for column in picture.found_px if 0 <= column <= last]
            heights = [picture.profile_grey[round(column)] for column in found]
            axes.plot(found, heights, "v", color=ESTIMATE_COLOUR, ms=6, label="leak found")
            axes.set_xlim(0, last)
            axes.set_ylabel(f"{side}: grey")
            axes.set_xlabel("column (px)" if i else "")
            if i == 0:
                axes.legend(ncols=5, loc="upper right", frameon=False, bbox_to_anchor=(1.0, 1.25))
        return svg(figure)


def _draw_ellipse(axes: Axes, leak: LeakEstimate) -> None:
    """Region of 95 % of a leak's covariance (2.448 sigma of two normal numbers)."""
    if not np.isfinite(leak.covariance_m2).all():
        return
    variances, directions = np.linalg.eigh(leak.covariance_m2)
    width_m, height_m = 2.0 * 2.448 * np.sqrt(np.maximum(variances, 0.0))
    angle_deg = math.degrees(math.atan2(directions[0, 0], directions[1, 0]))  # the picture's x axis is the world's y
    axes.add_patch(
        Ellipse((leak.y_m, leak.x_m), width_m, height_m, angle=angle_deg, fill=False, edgecolor=ESTIMATE_COLOUR, lw=1.0)
    )


def _draw_camera(axes: Axes, camera: TrueCamera, radius_m: float) -> None:
    pose, K = np.array(camera.world_from_camera), np.array(camera.camera_matrix)
    draw_view(axes, pose, K, camera.width_px, radius_m)


def draw_view(axes: Axes, pose: np.ndarray, K: np.ndarray, width_px: int, reach_m: float) -> None:
    """Place of a camera and the edges of its field of view; pose (4, 4) from the camera to the picture's frame."""
    x_m, y_m = pose[0, 3], pose[1, 3]
    for edge_px in (-0.5, width_px - 0.5):
        ray = pose[:3, :3] @ np.array([(edge_px - K[0, 2]) / K[0, 0], 0.0, 1.0])
        along = np.hypot(ray[0], ray[1])
        far_x, far_y = x_m + 2.2 * reach_m * ray[0] / along, y_m + 2.2 * reach_m * ray[1] / along
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


def name_axes(axes: Axes, radius_m: float, n_outside: int) -> None:
    """Limits, labels and legend of a top view; says how many estimates lie outside it."""
    axes.set_xlim(1.08 * radius_m, -1.08 * radius_m)  # y grows to the left, as the cameras see it
    axes.set_ylim(-1.08 * radius_m, 1.08 * radius_m)
    axes.set_xlabel("y (m), left is +")
    axes.set_ylabel("x (m), away from the cameras")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="lower right", frameon=False)
    if n_outside:
        axes.set_title(f"{n_outside} estimate(s) outside the picture", fontsize=8, color=ESTIMATE_COLOUR)


def draw_columns(axes: Axes, label: str, columns_px: Sequence[float | None], colour: str, style: str) -> None:
    """Upright lines at columns, px; those that are None are left out."""
    for i, column in enumerate(place for place in columns_px if place is not None):
        axes.axvline(column, color=colour, linewidth=1.2, linestyle=style, alpha=0.6, label=label if i == 0 else None)


def svg(figure: Figure) -> str:
    """Return a figure as inline SVG; the same figure gives the same bytes."""
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    return text.getvalue()[text.getvalue().index("<svg") :]
