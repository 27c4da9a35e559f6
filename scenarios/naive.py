"""The naive estimator: the brightest columns of each view, paired from left to right. Here to lose."""

import numpy as np

from leakloc import Estimate, LeakEstimate, Rig
from leakloc.paper import triangulate_columns

N_COLUMNS = 3


def locate(left: np.ndarray, right: np.ndarray, rig: Rig) -> Estimate:
    """Leaks from the three columns of each view that change most, matched in order; frames (frames, height, width)."""
    columns = [np.sort(np.argsort(_activity(frames))[-N_COLUMNS:]) for frames in (left, right)]
    pairs_px = np.stack(columns, axis=1)
    places_m = triangulate_columns(pairs_px, rig)
    undefined = np.full((2, 2), np.nan)
    leaks = tuple(
        LeakEstimate(float(x_m), float(y_m), undefined, 0.0, float(left_px), float(right_px), float("nan"))
        for (x_m, y_m), (left_px, right_px) in zip(places_m, pairs_px, strict=True)
        if np.isfinite(x_m + y_m)
    )
    return Estimate("naive", rig.frame, leaks)


def _activity(frames: np.ndarray) -> np.ndarray:
    """Mean over rows of the range of every pixel over time."""
    return (frames.max(axis=0).astype(float) - frames.min(axis=0)).mean(axis=0)
