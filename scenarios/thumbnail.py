"""A picture of a failing scene small enough for a table: what the left camera saw change, and the map beside it."""

import io

import cv2
import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from leakloc import Estimate
from leakloc.background import temporal_median
from scenarios.figures import ESTIMATE_COLOUR, QUIET_COLOUR, STYLE, TRUTH_COLOUR
from scenarios.simulate import SimulatedClip

COARSE_PX = (150, 50)
"""Columns and rows of the residual that is shown."""

BELOW, ABOVE = (0.0, 0.16), (0.84, 1.0)
"""Shares of the height where what is true and what was found are marked: on one another either would hide the other."""


def thumbnail_png(clip: SimulatedClip, estimate: Estimate | None) -> bytes:
    """Return a PNG of 480 x 200 px: mean residual of the left view with true and estimated columns; top view.

    True leaks green and shadows grey at the lower edge, estimates red at the upper one; leaks that nobody could find
    are hollow.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(4.8, 2.0), dpi=100, facecolor="white")
        seen = figure.add_axes((0.0, 0.0, 0.63, 1.0))
        residual = np.abs(clip.left - temporal_median(clip.left).grey).mean(axis=0)
        height, width = residual.shape
        coarse = cv2.resize(residual, COARSE_PX, interpolation=cv2.INTER_AREA)  # streaks stand out, and PNGs stay small
        bright = max(float(np.percentile(coarse, 99.8)), 1e-6)
        extent = (-0.5, width - 0.5, height - 0.5, -0.5)
        seen.imshow(coarse, cmap="gray", vmin=0.0, vmax=bright, aspect="auto", extent=extent, interpolation="nearest")
        for leak in clip.truth.leaks:
            _column(seen, leak.left_column_px, TRUTH_COLOUR, BELOW)
            for shadow_px in leak.shadow_columns_px.left:
                _column(seen, shadow_px, QUIET_COLOUR, BELOW, ":")
        for told in estimate.leaks if estimate else ():
            _column(seen, told.left_column_px, ESTIMATE_COLOUR, ABOVE)
        seen.set_xlim(-0.5, width - 0.5)
        seen.axis("off")
        _draw_map(figure.add_axes((0.64, 0.0, 0.36, 1.0), aspect="equal"), clip, estimate)
        picture = io.BytesIO()
        figure.savefig(picture, format="png", metadata={"Software": None})
        return picture.getvalue()


def _column(
    axes: mpl.axes.Axes, column_px: float | None, colour: str, edge: tuple[float, float], line: str = "-"
) -> None:
    if column_px is not None and np.isfinite(column_px):
        axes.axvline(column_px, *edge, color=colour, linestyle=line, linewidth=2.0)


def _draw_map(axes: mpl.axes.Axes, clip: SimulatedClip, estimate: Estimate | None) -> None:
    radius_m = clip.truth.rig.pedestal_radius_m
    axes.add_patch(Circle((0.0, 0.0), radius_m, facecolor="#f4f1ea", edgecolor="#6b6356", linewidth=1.0))
    for camera in (clip.truth.rig.left, clip.truth.rig.right):
        axes.plot(camera.world_from_camera[1][3], camera.world_from_camera[0][3], "^", color="#333333", ms=5)
    for leak in clip.truth.leaks:
        fill = TRUTH_COLOUR if leak.observable else "none"
        axes.plot(leak.y_m, leak.x_m, "o", color=TRUTH_COLOUR, markerfacecolor=fill, ms=6)
    for told in estimate.leaks if estimate else ():
        if np.hypot(told.x_m, told.y_m) < 1.2 * radius_m:
            axes.plot(told.y_m, told.x_m, "x", color=ESTIMATE_COLOUR, ms=7, mew=1.8)
    axes.set_xlim(1.05 * radius_m, -1.05 * radius_m)  # left is left
    axes.set_ylim(-1.05 * radius_m, 1.05 * radius_m)
    axes.axis("off")
