"""A line's signature, when and on which rows something fell, and what every column shows of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from leakloc.linefit import Profile
from leakloc.streaks import Activity

Signature = NDArray[np.float64]  # (frames, bands), positive while something passes

BESIDE_PX = 1
LEAST_SIGMA = 0.3  # of a profile, in units of the activity's noise: where nearly all columns are at rest
POLARITY_BANDS = 4  # summed before the sign is asked


def signature(activity: Activity, column_px: int, polarity: float) -> Signature:
    """Activity of a column and its neighbours without its mean over time, turned so that passing is positive."""
    near = activity[:, :, max(0, column_px - BESIDE_PX) : column_px + BESIDE_PX + 1].sum(axis=2, dtype=np.float64)
    return np.sign(polarity) * (near - near.mean(axis=0))


def polarity(activity: Activity, column_px: int) -> float:
    """-1 (what passes is dark) to 1 (bright): passing is rare, so the longer tail of the activity is its side."""
    near = activity[:, :, max(0, column_px - BESIDE_PX) : column_px + BESIDE_PX + 1].sum(axis=2, dtype=np.float64)
    n, bands = near.shape
    fold = min(POLARITY_BANDS, bands)
    near = near[:, : bands // fold * fold].reshape(n, -1, fold).sum(axis=2)
    near = near - np.median(near, axis=0)
    energy = float((near**2).sum())
    return float((near * np.abs(near)).sum()) / energy if energy > 0 else 0.0


def signed_profile(activity: Activity, other_view: Signature) -> Profile:
    """How much every column brightens while the other view's signature is on, (width,).

    The other view's, because its noise is not this view's: a column's own noise would always agree with itself.
    """
    n, bands, width = activity.shape
    weights = (other_view / max(float(np.linalg.norm(other_view)), 1e-9)).astype(np.float32)
    values = (weights.ravel() @ activity.reshape(n * bands, width)).astype(np.float64)
    values -= np.median(values)
    return Profile(values, max(1.4826 * float(np.median(np.abs(values))), LEAST_SIGMA))


def signed_profiles(activities: Sequence[Activity], columns_px: NDArray[np.float64], polarity: float) -> list[Profile]:
    """Profiles of a line at columns (2,) in both views' activities, each by the other view's signature."""
    left, right = (signature(one, int(c), polarity) for one, c in zip(activities, columns_px, strict=True))
    return [signed_profile(activities[0], right), signed_profile(activities[1], left)]


def bright_sigmas(profiles: Sequence[Profile], columns_px: NDArray[np.float64]) -> float:
    """How far the weaker view's profile stands out on the line's columns (2,), in standard deviations."""
    return min(float(p.values[int(c)]) / p.sigma for p, c in zip(profiles, columns_px, strict=True))
