"""Streaks are plumb lines: the roll and pitch of the rig against gravity, measured from how they lean."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from leakloc.levelled import LevelPair
from leakloc.rig import Array
from leakloc.signature import signature
from leakloc.streaks import Activity, Streaks
from leakloc.tilt import leaning_columns
from leakloc.tracks import Track

Slope = tuple[int, float, float, float]  # view, column px, px of column per px of row, variance

REACH_DEG = 5  # tilts that are looked for
COARSE_PX = 7  # what a degree moves a line over half the image's height
FINE_STEPS_RAD = np.radians([0.5, 0.25, 0.125])
MOST_STEPS = 5
AROUND = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)])
SEARCH_GAIN = 1.05  # sharpness over the believed pose's that a coarse tilt must bring
PRIOR_RAD = np.radians(2.0)  # of roll and of pitch, before anything is seen
WINDOW_PX = 8
SIGNIFICANT = 4.0
SLOPE_FLOOR = 2e-4  # px per px: what texture behind a line does to its slope


@dataclass(frozen=True, eq=False)
class Tilt:
    """Roll and pitch (2,) rad against the believed pose, with covariance (2, 2), the number of lines that told, and

    the tilt that was applied: zero where the measured one may as well be none.
    """

    tilt_rad: Array
    covariance_rad2: Array
    lines: int
    applied_rad: Array

    @property
    def significant(self) -> bool:
        """Whether the tilt is more than SIGNIFICANT standard deviations from none."""
        return bool(self.tilt_rad @ np.linalg.solve(self.covariance_rad2, self.tilt_rad) > SIGNIFICANT**2)

    def describe(self) -> dict[str, Any]:
        """Plain data in degrees."""
        degrees, sigma = np.degrees(self.tilt_rad), np.degrees(np.sqrt(np.diag(self.covariance_rad2)))
        return {
            "roll_deg": float(degrees[0]),
            "pitch_deg": float(degrees[1]),
            "roll_sigma_deg": float(sigma[0]),
            "pitch_sigma_deg": float(sigma[1]),
            "lines": self.lines,
            "applied": bool(self.applied_rad.any()),
        }


def no_tilt() -> Tilt:
    """What is believed of the tilt before a line is seen."""
    return Tilt(np.zeros(2), np.eye(2) * PRIOR_RAD**2, 0, np.zeros(2))


def track_slopes(tracks: Sequence[Track], views: Sequence[Streaks]) -> list[Slope]:
    """Slope of every track in both views, measured on its profile band by band."""
    slopes = []
    for track in tracks:
        columns = (track.left_px, track.right_px)
        signatures = [signature(view.activity, column, 1.0) for view, column in zip(views, columns, strict=True)]
        for view in (0, 1):
            activity, weights = views[view].activity, signatures[1 - view]
            near = slice(max(0, columns[view] - WINDOW_PX), columns[view] + WINDOW_PX + 1)
            norm = max(float(np.linalg.norm(weights)), 1e-9)
            profile = np.einsum("nb,nbj->bj", weights, activity[:, :, near], optimize=True) / norm
            slopes.append((view, float(columns[view]), *slope_of(profile, views[view].rows_px)))
    return slopes


def search_tilt(views: Sequence[Streaks], level: LevelPair) -> Array:
    """Coarse roll and pitch, (2,) rad: the tilt under which the activity of both views gathers in the fewest columns.

    Zero unless another tilt is clearly sharper. A grid of whole degrees on blurred columns, then ever finer crosses.
    """
    maps = [_energy(view.activity) for view in views]
    rows_px = views[0].rows_px
    degrees = np.arange(-REACH_DEG, REACH_DEG + 1)
    blurred = [cv2.blur(energy, (COARSE_PX, 1)).astype(np.float32, copy=False) for energy in maps]
    grid = np.radians(np.stack(np.meshgrid(degrees, degrees, indexing="ij"), axis=-1))  # rolls, pitches, 2
    coarse = np.concatenate([sharpness(blurred, rows_px, level, tilts, COARSE_PX) for tilts in grid])
    best = grid.reshape(-1, 2)[int(coarse.argmax())]
    believed, top = sharpness(maps, rows_px, level, np.stack([np.zeros(2), best]))
    for step in FINE_STEPS_RAD:
        for _ in range(MOST_STEPS):
            cross = best + step * AROUND
            values = sharpness(maps, rows_px, level, cross)
            if values.max() <= top:
                break
            top, best = values.max(), cross[int(values.argmax())]
    return best if top > SEARCH_GAIN * believed else np.zeros(2)


def _energy(activity: Activity) -> NDArray[np.float32]:
    """Activity beyond its noise per band and column, (bands, width)."""
    energy = np.einsum("nbj,nbj->bj", activity, activity)
    energy -= np.median(energy, axis=1, keepdims=True)
    return cv2.blur(energy, (3, 1)).astype(np.float32, copy=False)


def sharpness(
    maps: Sequence[NDArray[np.float32]], rows_px: Array, level: LevelPair, tilts_rad: Array, every_px: int = 1
) -> Array:
    """Of tilts (n, 2): sum (n,) over both views' columns (every so many) of the squared energy gathered in each."""
    total = np.zeros(len(tilts_rad))
    for view, energy in enumerate(maps):
        columns = np.arange(0, energy.shape[1], every_px, dtype=np.float64)
        x = leaning_columns(level, tilts_rad, view, rows_px, columns).astype(np.float32)
        y = np.broadcast_to(np.arange(len(rows_px), dtype=np.float32)[:, None], x.shape)
        read = cv2.remap(energy, x.reshape(-1, len(columns)), y.reshape(-1, len(columns)), cv2.INTER_LINEAR)
        gathered = read.reshape(x.shape).sum(axis=1, dtype=np.float64)
        total += (gathered**2).sum(axis=1)
    return total


def slope_of(band_profile: Array, rows_px: Array) -> tuple[float, float]:
    """How a line leans, px of column per px of row, and its variance; band_profile (bands, columns) in noise units.

    The line's shape is the sum over bands, its strength per band the projection on that shape; the slope is the
    least-squares shift of the shape in proportion to the row.
    """
    shape = band_profile.sum(axis=0)
    shape = shape / max(float(np.linalg.norm(shape)), 1e-12)
    strength = band_profile @ shape
    lever = rows_px - np.average(rows_px, weights=np.maximum(strength, 1e-9))
    change = -np.gradient(shape)  # of the shape for a shift to the right by one column
    moved = band_profile @ change
    weight = float((strength**2 * lever**2).sum() * (change @ change))
    if not weight > 0:
        return 0.0, np.inf
    return float((strength * lever * moved).sum()) / weight, 1.0 / weight + SLOPE_FLOOR**2


def fit_tilt(slopes: Sequence[Slope], level: LevelPair, tilt_rad: Array, rows_px: Array) -> Tilt:
    """Tilt from lines' slopes (view, column, slope, variance) that are left under `tilt_rad`.

    Linear least squares with the derivative of `leaning_columns`, and a prior of PRIOR_RAD on the whole tilt.
    """
    if not slopes:
        return no_tilt()
    step = np.radians(0.05)
    ends = rows_px[[0, -1]]
    span = ends[1] - ends[0]
    A, b, w = [], [], []
    for view, column, slope, variance in slopes:
        at = np.array([column])
        here = leaning_columns(level, tilt_rad, view, ends, at)[:, 0]
        row = []
        for axis in np.eye(2):
            there = leaning_columns(level, tilt_rad + step * axis, view, ends, at)[:, 0]
            row.append(((there - here)[1] - (there - here)[0]) / span / step)
        A.append(row)
        b.append(slope)
        w.append(1.0 / variance)
    matrix, target, weights = np.array(A).reshape(-1, 2), np.array(b), np.array(w)
    information = matrix.T @ (weights[:, None] * matrix) + np.eye(2) / PRIOR_RAD**2
    covariance = np.linalg.inv(information)
    change = covariance @ (matrix.T @ (weights * target) - tilt_rad / PRIOR_RAD**2)
    rest = target - matrix @ change
    chi2 = float((weights * rest**2).sum() / max(1, len(target) - 2)) if len(target) > 2 else 1.0
    return Tilt(tilt_rad + change, covariance * max(1.0, chi2), len(slopes) // 2, tilt_rad)
