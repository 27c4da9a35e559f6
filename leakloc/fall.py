"""Free fall from frame to frame: where a drop that is in a band of rows was before, and will be after.

A drop at depth Z before the cameras that left its leak h above them is seen on the row r = r0 + f (g t^2 / 2 - h) / Z
at t since its release. Neither h nor the frame rate is told by the images alone; the paper's are taken, and what is
summed over three frames forgives a good part of a metre.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from leakloc.rig import Array
from leakloc.streaks import Activity

GRAVITY_M_S2 = 9.81
LEAK_ABOVE_M = 2.0  # of the cameras: the paper's set-up
FRAMES_PER_S = 12.0  # the paper's
DEPTHS_M = (3.0, 4.2)  # near leaks are bright enough without
FOLD = 4  # bands of a sample
STEPS = (-1, 0, 1)  # frames that are summed

Bands = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class FallPath:
    """Per step of STEPS and band: the band in which the same drop is then, -1 where it is out of the image."""

    bands: Bands


def fall_path(rows_px: Array, horizon_px: float, focal_px: float, depth_m: float) -> FallPath:
    """Path of drops at one depth; rows_px (bands,) middles of evenly spaced bands, horizon_px the cameras' own row."""
    below_m = np.maximum(LEAK_ABOVE_M + (rows_px - horizon_px) * depth_m / focal_px, 0.0)
    fallen_s = np.sqrt(2 * below_m / GRAVITY_M_S2)
    spacing_px = rows_px[1] - rows_px[0] if len(rows_px) > 1 else 1.0
    bands = np.full((len(STEPS), len(rows_px)), -1)
    for i, step in enumerate(STEPS):
        then_s = fallen_s + step / FRAMES_PER_S
        row = horizon_px + (GRAVITY_M_S2 * then_s**2 / 2 - LEAK_ABOVE_M) * focal_px / depth_m
        band = np.rint((row - rows_px[0]) / spacing_px).astype(int)
        seen = (then_s > 0) & (band >= 0) & (band < len(rows_px))
        bands[i, seen] = band[seen]
    return FallPath(bands)


def fall_paths(rows_px: Array, horizon_px: float, focal_px: float) -> list[FallPath]:
    """Paths at DEPTHS_M."""
    return [fall_path(rows_px, horizon_px, focal_px, depth_m) for depth_m in DEPTHS_M]


def along_fall(activity: Activity, path: FallPath) -> Activity:
    """Activity (n, bands, width) summed over FOLD bands and along the fall: (n, bands // FOLD, width), unit noise.

    Slow definition: the sum over STEPS and bands of the activity there, over the root of the number of terms.
    """
    n, bands, width = activity.shape
    fold = min(FOLD, bands)
    smooth = np.stack([cv2.blur(frame, (1, fold), borderType=cv2.BORDER_REPLICATE) for frame in activity])
    smooth *= np.float32(np.sqrt(fold))
    middles = np.arange(bands // fold) * fold + fold // 2
    total = np.zeros((n, len(middles), width), np.float32)
    terms = np.zeros((n, len(middles), 1), np.float32)
    for step, there in zip(STEPS, path.bands[:, middles], strict=True):
        here = np.flatnonzero(there >= 0)
        into, out_of = slice(max(0, -step), n - max(0, step)), slice(max(0, step), n - max(0, -step))
        total[into, here] += smooth[out_of, there[here]]
        terms[into, here] += 1
    total /= np.sqrt(np.maximum(terms, 1))
    return total


def fallen(activities: Sequence[Activity], paths: Sequence[FallPath]) -> list[tuple[Activity, Activity]]:
    """Both views' activity along each path."""
    left, right = activities
    return [(along_fall(left, path), along_fall(right, path)) for path in paths]
