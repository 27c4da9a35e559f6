"""What moves against a still background, by the paper's temporal median and by what people try instead of it.

The paper settles on the median (eq. 1-2) and says that a mixture of Gaussians loses the drops: it learns them as
background. The others are here to show it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from leakloc.background import Frames, column_vectors, temporal_median
from leakloc.columns import column_profile

FULL_SCALE_16_BIT = 257.0  # 16-bit grey per 8-bit grey: MOG2's variances are in 8-bit grey


@dataclass(frozen=True, eq=False)
class ColumnForeground:
    """The foreground F_n of one view as the paper's method looks at it, and never whole.

    `profile_grey` (width,) is its mean over frames and rows (paper eq. 3); `vectors(columns_px)` gives its columns,
    (columns, frames, height) grey.
    """

    profile_grey: NDArray[np.float64]
    vectors: Callable[[NDArray[np.intp]], NDArray[np.float64]]


def median_foreground(frames: Frames) -> ColumnForeground:
    """|I_n - median over time| (paper eq. 1-2), half-integers kept. frames (n, height, width) uint8 or uint16."""
    median = temporal_median(frames)
    return ColumnForeground(column_profile(frames, median), partial(column_vectors, frames, median))


def mean_foreground(frames: Frames) -> ColumnForeground:
    """|I_n - mean over time|: a drop that brightens its pixel in one frame of n darkens the other n - 1 by 1 / n.

    frames (n, height, width) uint8 or uint16.
    """
    mean = frames.mean(axis=0, dtype=np.float64)
    total = np.zeros(mean.shape[1])
    for frame in frames:
        total += np.abs(frame - mean).sum(axis=0)
    return ColumnForeground(
        total / (len(frames) * len(mean)),
        lambda columns_px: _by_column(np.abs(frames[:, :, columns_px] - mean[:, columns_px])),
    )


def mog2_foreground(frames: Frames) -> ColumnForeground:
    """OpenCV's mixture of Gaussians with its own settings, F_n = 255 where it sees foreground and 0 elsewhere.

    frames (n, height, width) uint8, or uint16 scaled to 8-bit grey. The first frame is foreground everywhere and says
    nothing: it is taken as 0. Shadow detection is off: it looks for colours. Source: Zivkovic, Improved adaptive
    Gaussian mixture model for background subtraction, ICPR 2004.
    """
    subtractor = cv2.createBackgroundSubtractorMOG2(detectShadows=False)
    moving = np.empty(frames.shape, np.uint8)
    for n, frame in enumerate(frames):
        grey = frame if frame.dtype == np.uint8 else (frame / FULL_SCALE_16_BIT).astype(np.float32)
        moving[n] = subtractor.apply(np.ascontiguousarray(grey))
    moving[0] = 0
    return ColumnForeground(
        moving.mean(axis=(0, 1), dtype=np.float64), lambda columns_px: _by_column(moving[:, :, columns_px])
    )


def _by_column(foreground: NDArray[Any]) -> NDArray[np.float64]:
    return np.ascontiguousarray(foreground.transpose(2, 0, 1), dtype=np.float64)


SUBTRACTORS: dict[str, Callable[[Frames], ColumnForeground]] = {
    "median": median_foreground,
    "mean": mean_foreground,
    "mog2": mog2_foreground,
}
