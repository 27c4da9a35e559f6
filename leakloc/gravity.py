"""Free fall as a check: do drops speed up from row to row as gravity has it, for this rig, unit and frame rate?

A drop at depth Z that has fallen s metres since its leak falls another sqrt(2 G s) + G / 2 until the next frame, G
being gravity in metres per frame squared. So the rows that one drop passes in successive frames tell G and the height
h of the leaks above the cameras; G is 9.81 m/s^2 over the squared frame rate, if baseline, focal length and frame rate
are what they are believed to be.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from leakloc.levelled import LevelPair
from leakloc.rig import Array
from leakloc.signature import signature
from leakloc.streaks import Streaks

GRAVITY_M_S2 = 9.81
FRAME_RATES = np.geomspace(4.0, 60.0, 109)  # per second, one 2.5 % above the other
HEIGHTS_M = np.geomspace(0.4, 6.0, 28)  # of leaks above the cameras
BLOCKS = 6  # of successive frames: what each of them left out changes is the error
LEAST_FRAMES = 6
SYSTEMATIC = 0.08  # of the rate: on clips of even drips the best guess scatters so, whatever their noise

Lines = Sequence[tuple[Array, float]]  # columns (2,) of a leak and its depth, m


def free_fall(lines: Lines, views: Sequence[Streaks], level: LevelPair) -> dict[str, float]:
    """Frame rate at which what falls obeys gravity, its standard error (jackknife, and SYSTEMATIC), the leaks' height.

    `frames_per_s`, `sigma`, `leak_height_m`; NaN where nothing tells: no leak, few frames, or a best guess at the edge.
    """
    unknown = {"frames_per_s": float("nan"), "sigma": float("nan"), "leak_height_m": float("nan")}
    n = len(views[0].activity)
    if not lines or n < LEAST_FRAMES or len(views[0].rows_px) < LEAST_FRAMES:
        return unknown
    steps = [_steps(columns, views) for columns, _ in lines]
    blocks = np.array_split(np.arange(n - 1), min(BLOCKS, n - 1))
    tables = [_Landing(depth_m, views[0].rows_px, level) for _, depth_m in lines]
    parts = np.array(
        [sum(t.score(s[block].sum(axis=0)) for s, t in zip(steps, tables, strict=True)) for block in blocks]
    )
    whole = parts.sum(axis=0)
    rate, height = _top(whole)
    if not np.isfinite(rate):
        return unknown
    without = np.array([_top(whole - part)[0] for part in parts])
    without = without[np.isfinite(without)]
    sigma = float(np.sqrt((len(without) - 1) * without.var())) if len(without) > 1 else float("nan")
    return {"frames_per_s": rate, "sigma": float(np.hypot(sigma, SYSTEMATIC * rate)), "leak_height_m": height}


def _steps(columns_px: Array, views: Sequence[Streaks]) -> NDArray[np.float64]:
    """How far what passes in a band agrees with what passes in every other one a frame later, (n - 1, bands, bands).

    One view against the other, whose noise is its own.
    """
    left, right = (signature(view.activity, round(float(c)), 1.0) for view, c in zip(views, columns_px, strict=True))
    norm = float(np.linalg.norm(left) * np.linalg.norm(right)) or 1.0
    return np.asarray((left[:-1, :, None] * right[1:, None, :] + right[:-1, :, None] * left[1:, None, :]) / norm)


class _Landing:
    """Where drops at one depth are a frame later, for every frame rate and height: (rates, heights, bands)."""

    def __init__(self, depth_m: float, rows_px: Array, level: LevelPair) -> None:
        below_m = (rows_px - level.principal_px[0, 1]) * depth_m / level.focal_px
        fallen_m = HEIGHTS_M[:, None] + below_m
        G = (GRAVITY_M_S2 / FRAME_RATES**2)[:, None, None]
        onward_m = np.sqrt(2 * G * np.maximum(fallen_m, 0)) + G / 2
        spacing_px = rows_px[1] - rows_px[0]
        band = np.arange(len(rows_px)) + onward_m * level.focal_px / depth_m / spacing_px
        self.seen = (fallen_m > 0) & (band <= len(rows_px) - 1)
        self.below = np.clip(band.astype(int), 0, len(rows_px) - 2)
        self.weight = band - self.below

    def score(self, agreement: Array) -> Array:
        """Agreement (bands, bands) with the next frame along the fall, over its chance scatter: (rates, heights)."""
        free = agreement - agreement.mean()
        here = np.arange(len(agreement))
        landed = free[here, self.below] * (1 - self.weight) + free[here, self.below + 1] * self.weight
        return np.asarray((landed * self.seen).sum(axis=2) / np.sqrt(np.maximum(self.seen.sum(axis=2), 1)))


def _top(score: Array) -> tuple[float, float]:
    """Rate and height of the greatest score (rates, heights), refined along the rates; NaN at the grid's edge."""
    i, j = np.unravel_index(int(score.argmax()), score.shape)
    ridge = score.max(axis=1)
    if not 0 < i < len(ridge) - 1 or not score[i, j] > 0:
        return float("nan"), float("nan")
    before, top, after = ridge[i - 1 : i + 2]
    bend = before - 2 * top + after
    shift = 0.5 * (before - after) / bend if bend < 0 else 0.0
    ratio = FRAME_RATES[1] / FRAME_RATES[0]
    return float(FRAME_RATES[i] * ratio**shift), float(HEIGHTS_M[j])
