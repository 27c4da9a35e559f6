"""The paper's method to the letter: nothing added, nothing mended. It is the yardstick for the others.

Source: Komatsu et al., Leakage Position Estimation of Cooling Water Using a Stereo Camera, Applied Sciences, 2021.

Diagnostics: `left` and `right` hold `profile_grey` (g per column), `threshold_grey` and `candidate_columns_px`; `pairs`
holds every matched pair with `left_column_px`, `right_column_px`, `x_m`, `y_m` (NaN where undefined) and `verdict`:
"leak", "parallel planes" or "behind a camera".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from leakloc.background import Frames
from leakloc.detect import detect_columns, threshold_grey
from leakloc.estimate import Estimate, LeakEstimate
from leakloc.match import match_columns
from leakloc.rig import Rig, depths_m
from leakloc.subtractors import SUBTRACTORS, ColumnForeground
from leakloc.triangulate import column_planes, meet_at_camera_height, undistort_columns

LEAK, PARALLEL, BEHIND = "leak", "parallel planes", "behind a camera"


@dataclass(frozen=True)
class PaperOptions:
    """The two numbers of Algorithm 1: threshold factor on std(g), and half the width of the suppression window.

    `subtractor` is "median" (the paper's), or "mean" or "mog2" to show what the paper says of others. Raises ValueError
    if `k_sigma` is not finite and >= 0, `g_win_px` not a whole number >= 0 or the subtractor not known.
    """

    k_sigma: float = 2.0
    g_win_px: int = 10
    subtractor: str = "median"

    def __post_init__(self) -> None:
        """Refuse numbers that Algorithm 1 has no meaning for."""
        if not (np.isfinite(self.k_sigma) and self.k_sigma >= 0):
            raise ValueError(f"PaperOptions: k_sigma must be finite and >= 0, got {self.k_sigma}")
        if not isinstance(self.g_win_px, int | np.integer) or self.g_win_px < 0:
            raise ValueError(f"PaperOptions: g_win_px must be a whole number >= 0, got {self.g_win_px}")
        if self.subtractor not in SUBTRACTORS:
            known = ", ".join(SUBTRACTORS)
            raise ValueError(f"PaperOptions: subtractor must be one of {known}, got {self.subtractor!r}")


@dataclass(frozen=True, eq=False)
class ColumnView:
    """What the method knows of one view: eq. 1-3 and Algorithm 1. Candidate columns ascend."""

    foreground: ColumnForeground
    profile_grey: NDArray[np.float64]
    threshold_grey: float
    candidate_columns_px: NDArray[np.intp]


def view_columns(frames: Frames, options: PaperOptions) -> ColumnView:
    """Background, profile and candidate columns of one view, frames (n, height, width) uint8 or uint16."""
    subtract = SUBTRACTORS[options.subtractor]
    foreground = subtract(np.ascontiguousarray(frames))  # OpenCV and the cache want whole rows
    profile = foreground.profile_grey
    candidates = detect_columns(profile, k_sigma=options.k_sigma, g_win_px=options.g_win_px)
    return ColumnView(foreground, profile, threshold_grey(profile, options.k_sigma), candidates)


def match_views(left: ColumnView, right: ColumnView) -> NDArray[np.intp]:
    """Matched columns (pairs, 2) of the left and right image, px (Algorithm 2)."""
    vectors = [view.foreground.vectors(view.candidate_columns_px) for view in (left, right)]
    chosen = match_columns(*vectors)
    return np.stack([left.candidate_columns_px[chosen[:, 0]], right.candidate_columns_px[chosen[:, 1]]], axis=1)


def triangulate_columns(pairs_px: NDArray[np.intp], rig: Rig) -> NDArray[np.float64]:
    """(x, y) at z = 0 of matched raw columns (pairs, 2), in the rig's frame: (pairs, 2) m, NaN if planes are parallel.

    Eq. 5-8; columns of a lens with distortion are first put straight at mid-row (`undistort_columns`).
    """
    height_px = rig.image_size[1]
    left_px = undistort_columns(pairs_px[:, 0], rig.K1, rig.D1, height_px)
    right_px = undistort_columns(pairs_px[:, 1], rig.K2, rig.D2, height_px)
    return meet_at_camera_height(column_planes(left_px, rig.P1, height_px), column_planes(right_px, rig.P2, height_px))


def locate_by_paper(left: Frames, right: Frames, rig: Rig, options: PaperOptions) -> Estimate:
    """Leaks by background subtraction, column aggregation, detection, matching and triangulation (eq. 1-8).

    A matched pair whose planes are parallel has no place, and one that meets behind a camera was never seen by it: both
    stay in the diagnostics and are no leaks. `score` is the smaller of the two columns' (g - mean) / std, the number
    that k_sigma is held against. The paper gives neither covariance nor column deviation: NaN.
    """
    views = [view_columns(frames, options) for frames in (left, right)]  # two threads only queue for the interpreter
    pairs_px = match_views(*views)
    places_m = triangulate_columns(pairs_px, rig)
    verdicts = _verdicts(places_m, rig)
    leaks = [
        _leak(views, columns_px, place_m)
        for columns_px, place_m, verdict in zip(pairs_px, places_m, verdicts, strict=True)
        if verdict == LEAK
    ]
    diagnostics = {
        "left": _describe_view(views[0]),
        "right": _describe_view(views[1]),
        "pairs": _describe_pairs(pairs_px, places_m, verdicts),
    }
    return Estimate("paper", rig.frame, tuple(leaks), diagnostics)


def _verdicts(places_m: NDArray[np.float64], rig: Rig) -> list[str]:
    points_m = np.column_stack([places_m, np.zeros(len(places_m))])
    depth_m = np.minimum(depths_m(points_m, rig.left_from_frame), depths_m(points_m, rig.right_from_frame))
    return [PARALLEL if np.isnan(depth) else LEAK if depth > 0 else BEHIND for depth in depth_m]


def _leak(views: Sequence[ColumnView], columns_px: NDArray[np.intp], place_m: NDArray[np.float64]) -> LeakEstimate:
    deviations = [
        (view.profile_grey[column] - view.profile_grey.mean()) / view.profile_grey.std()
        for view, column in zip(views, columns_px, strict=True)
    ]
    return LeakEstimate(
        x_m=float(place_m[0]),
        y_m=float(place_m[1]),
        covariance_m2=np.full((2, 2), np.nan),
        score=float(min(deviations)),
        left_column_px=float(columns_px[0]),
        right_column_px=float(columns_px[1]),
        column_sigma_px=float("nan"),
    )


def _describe_view(view: ColumnView) -> dict[str, Any]:
    return {
        "profile_grey": view.profile_grey.tolist(),
        "threshold_grey": view.threshold_grey,
        "candidate_columns_px": view.candidate_columns_px.tolist(),
    }


def _describe_pairs(
    pairs_px: NDArray[np.intp], places_m: NDArray[np.float64], verdicts: list[str]
) -> list[dict[str, Any]]:
    return [
        {"left_column_px": left, "right_column_px": right, "x_m": x, "y_m": y, "verdict": verdict}
        for (left, right), (x, y), verdict in zip(pairs_px.tolist(), places_m.tolist(), verdicts, strict=True)
    ]
