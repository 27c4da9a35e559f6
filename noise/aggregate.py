"""How much the paper's column aggregate fluctuates under a clip's noise: the yardstick of what is observable."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from noise.arrays import Array
from noise.clip import add_noise
from noise.gamma import GammaField
from noise.sensor import Sensor

TILE_ROWS = 64
TILE_COLUMNS = 1536
"""Of the flat scene behind a prediction: 3 % of the standard deviation, for neighbouring columns share tracks."""

TILE_FRAMES = 24
FEW_FRAMES = 12
"""Clips of fewer frames have tiles of their own. For more the variance goes as one over their number to some 8 %, and
clips of all lengths share the tile of TILE_FRAMES.
"""

TILE_SEED = 20210

LEVELS = np.concatenate([[0.0], 4.0 ** np.arange(-5, -0.5), [15 / 16, 1.0]])
"""Backgrounds, as shares of the full well, between which the variance is interpolated: up to near white it is linear
in the light, and white cuts it.
"""

DOSE_RATES_GY_H = np.concatenate([[0.0], 10.0 * 2.0 ** np.arange(-6, 10.5)])
"""Constant dose rates between which the variance is interpolated: it grows almost in proportion."""


def expected_column_sd(  # noqa: PLR0913 - background, physics and the size of the clip
    background_e: float | Array,
    field: GammaField,
    sensor: Sensor,
    *,
    exposure_s: float,
    n_rows: int,
    n_frames: int,
) -> float | Array:
    """Standard deviation over the noise (grey) of g_j = mean over frames and rows of |I - median over frames of I|.

    `background_e`: expected photo-electrons of a column, a number or (n_rows,), or an image (n_rows, n_columns) for
    one value per column. The variance of a pixel's share is that of this package's own noise on a flat tile (each
    level of light and dose takes 0.1 s once), to some 5 % of the deviation; the variances of rows add, for a track is
    short beside a column. Noise that all columns share (of rows) is left out: it lifts them together. ValueError for a
    background that is negative or not finite, or counts below 1.
    """
    background = np.asarray(background_e, dtype=float)
    if not (np.all(background >= 0) and np.all(np.isfinite(background))):
        raise ValueError("expected_column_sd: background_e must be >= 0 and finite")
    if n_rows < 1 or n_frames < 1:
        raise ValueError(f"expected_column_sd: n_rows and n_frames must be >= 1, got {n_rows} and {n_frames}")
    share = np.minimum(background / sensor.full_well_e, 1.0)
    levels = enclosing(LEVELS, float(share.min()), float(share.max()))
    per_row = np.array([row_variance(level, field, sensor, exposure_s, n_frames) for level in levels])
    variance = np.interp(share, levels, per_row)
    mean_variance = variance.mean(axis=0) if variance.ndim else variance
    return np.sqrt(mean_variance / n_rows)


def enclosing(grid: Array, lowest: float, highest: float) -> Array:
    """The part of a fixed grid that encloses a span; the grid is fixed so that clips share their predictions."""
    first = max(int(np.searchsorted(grid, lowest, side="right")) - 1, 0)
    last = int(np.searchsorted(grid, highest, side="left"))
    return grid[first : last + 1]


def row_variance(level: float, field: GammaField, sensor: Sensor, exposure_s: float, n_frames: int) -> float:
    """Variance of the aggregate of a one-row column before a background of `level` full wells."""
    rate = field.dose_rate_gy_h
    if callable(rate):
        return tile_variance(level, field, sensor, exposure_s, n_frames)
    drawn = n_frames if n_frames < FEW_FRAMES else TILE_FRAMES
    rates = enclosing(DOSE_RATES_GY_H, rate, rate) if rate <= DOSE_RATES_GY_H[-1] else [rate]
    known = [tile_variance(level, replace(field, dose_rate_gy_h=float(r)), sensor, exposure_s, drawn) for r in rates]
    return float(np.interp(rate, rates, known)) * drawn / n_frames


@lru_cache(maxsize=512)
def tile_variance(level: float, field: GammaField, sensor: Sensor, exposure_s: float, n_frames: int) -> float:
    """Variance of the aggregate of a flat tile's columns, times its rows.

    The rows of the tile are spread over one grey, as a textured scene's pixels are: rounding acts on all of them.
    """
    spread = (np.arange(TILE_ROWS) + 0.5) / TILE_ROWS - 0.5
    rows_e = np.clip(level * sensor.full_well_e + spread * sensor.electrons_per_level, 0, None)
    tile = np.broadcast_to(rows_e.astype(np.float32)[None, :, None], (n_frames, TILE_ROWS, TILE_COLUMNS))
    frames = add_noise(tile, field, sensor, exposure_s=exposure_s, seed=TILE_SEED, camera=0).frames
    return float(np.var(column_aggregate(frames))) * TILE_ROWS


def column_aggregate(frames: Array) -> Array:
    """The paper's g_j (eq. 1-3) of frames (n, height, width): mean of |I - temporal median|, grey (width,)."""
    grey = np.sort(frames, axis=0)
    n = len(grey)
    median = (grey[(n - 1) // 2].astype(np.float32) + grey[n // 2]) / 2
    return np.mean([np.abs(frame - median).mean(axis=0, dtype=np.float64) for frame in frames], axis=0)
