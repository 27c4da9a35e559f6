"""A view's single pixels over time, where bands of rows are too coarse: about one column, plumb lines made columns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from leakloc.background import Frames, TemporalMedian
from leakloc.rig import Array

Residual = NDArray[np.float32]  # (frames, rows, columns), standard deviations of a pixel's noise


@dataclass(frozen=True, eq=False)
class Pixels:
    """Levelled frames (n, height, width) and their median; a pixel's noise for every half grey level, (levels,) grey.

    `lean_px`: where plumb lines on columns (w,) cross rows (h,) of these frames, (h, w) px; None if they are columns.
    """

    frames: Frames
    median: TemporalMedian
    noise_grey: Array
    lean_px: Callable[[Array, Array], Array] | None = None

    def about(self, column_px: float, reach_px: int) -> tuple[Residual, Array]:
        """What changes about a plumb line's column, and the columns (w,) there that the view has."""
        width = self.frames.shape[2]
        first, last = max(0, round(column_px) - reach_px), min(width - 1, round(column_px) + reach_px)
        columns_px = np.arange(first, last + 1)
        if self.lean_px is None:
            return self._residual(slice(None), slice(first, last + 1)), columns_px.astype(np.float64)
        rows = np.arange(self.frames.shape[1])
        at_px = np.clip(self.lean_px(rows.astype(np.float64), columns_px.astype(np.float64)), 0, width - 1)
        left = np.minimum(at_px.astype(np.intp), width - 2)
        share = (at_px - left).astype(np.float32)
        here, beside = (self._residual(rows[:, None], column) for column in (left, left + 1))
        return (1 - share) * here + share * beside, columns_px.astype(np.float64)

    def _residual(self, rows: slice | NDArray[np.intp], columns: slice | NDArray[np.intp]) -> Residual:
        twice = self.median.lower[rows, columns].astype(np.intp) + self.median.upper[rows, columns]
        change_grey = self.frames[:, rows, columns] - (twice / 2).astype(np.float32)
        return np.asarray(change_grey / self.noise_grey[twice].astype(np.float32))
