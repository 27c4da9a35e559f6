"""Column aggregation (paper eq. 3): a falling drop paints its column, so what moved is summed down it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from leakloc.background import Frames, TemporalMedian, foreground_total


def column_profile(frames: Frames, median: TemporalMedian) -> NDArray[np.float64]:
    """g_j = mean over frames and rows of F_n(i, j), (width,), grey (paper eq. 3).

    Slow definition, equal to the bit: `np.abs(frames - np.median(frames, axis=0)).mean(axis=(0, 1))`.
    """
    n, height, _ = frames.shape
    return foreground_total(frames, median) / (n * height)
