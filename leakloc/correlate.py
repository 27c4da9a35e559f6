"""Do two columns tell the same story? Activity of the left view's columns against the right view's, over time and row.

The same drop is on the same row at the same instant in both level views; gamma hits, photon and read noise are not
shared between the cameras, so whatever two columns have in common fell.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from leakloc.fall import FallPath, fallen
from leakloc.streaks import Activity, Streaks

Array = NDArray[np.float64]

FOLDS = (1, 4)  # bands summed before the product: short exposures leave short streaks, long ones gain by the longer sum
ACROSS = np.array([[0.25, 0.5, 0.25]], np.float32)  # a drop's image is some columns wide
NEARLY_ONE = 0.9999995
STRONG_SIGMAS = 2.5  # below, the likelihood ratio's root is the correlation itself
LEAST_ENERGY = 0.2  # of a sample's noise: a dead column must not turn rounding into certainty
LEAST_NOISY_COLUMNS = 30  # of those looked at: fewer cannot say how unrelated columns scatter
SCALE_STEP = 3  # every third pair of columns is enough to measure how unrelated ones scatter
BRIGHT_FROM, BRIGHT_TO = 1.0, 4.0  # noise units of a band: nothing is left where shadows pass, little of a hit
KINDS = 5  # looks at a pair that are nearly independent: two folds and two falls, which overlap, and bright ones
MOST_STEP = 2  # frames that a stereo pair is believed to be out of step at most
STEP_GAIN, STEP_SIGMAS = 1.3, 8.0  # over no step; of the best pair
STEP_COLUMNS = 3  # summed where a step is asked: a line's width
LEAST_SAMPLES = 12
CELL_PX = 1.0  # columns that count as one independent trial: measured on clips without leaks, 0 to 200 Gy/h


@dataclass(frozen=True, eq=False)
class Agreement:
    """Significance of every pair of columns, (width left, width right), in standard deviations of unrelated columns.

    `signed`: of everything that passes, drops and shadows; `bright`: of what brightens alone, which shadows do not.
    """

    signed: NDArray[np.float32]
    bright: NDArray[np.float32]


def agreement(left: Streaks, right: Streaks, paths: Sequence[FallPath] = ()) -> Agreement:
    """How surely left column i and right column j share activity: the best over the folds, and along paths of falls.

    For a correlation rho of N samples, -N log(1 - rho^2) is the likelihood ratio of "shared" against "unrelated",
    chi-squared of one degree of freedom (Anderson, Multivariate Statistical Analysis, 4.2); its signed root is held
    against its own scale over all pairs, nearly all of which are unrelated. Columns with few bands alive have the fewer
    samples.
    """
    activities = left.activity, right.activity
    samples = [(_samples(activities[0], fold), _samples(activities[1], fold)) for fold in FOLDS]
    samples += [(_samples(one, 1), _samples(other, 1)) for one, other in fallen(activities, paths)]
    shining = [
        [np.clip(one, BRIGHT_FROM, BRIGHT_TO) for one in both] for both in (activities, (left.glitter, right.glitter))
    ]
    lit = [(_samples(both[0], fold), _samples(both[1], fold)) for both in shining for fold in FOLDS]
    with ThreadPoolExecutor(min(2, cv2.getNumThreads())) as threads:
        signed, bright = threads.map(_best_root, (samples, lit))
    share = np.sqrt(np.minimum.outer(left.alive, right.alive)).astype(np.float32)
    return Agreement(signed * share, bright * share)


def _best_root(samples: Sequence[tuple[NDArray[np.float32], NDArray[np.float32]]]) -> NDArray[np.float32]:
    best = _signed_root(*samples[0])
    for pair in samples[1:]:
        np.maximum(best, _signed_root(*pair), out=best)
    return best


def stereo_step(views: Sequence[Streaks]) -> dict[str, float]:
    """Frames by which the right view lags the left one: the shift in time at which they agree best.

    `frames` is 0 unless another shift agrees clearly better; `sigmas` and `sigmas_unshifted` are the best pair's, NaN
    where a clip is too short and too low to tell.
    """
    left, right = (_samples(view.activity, FOLDS[-1]) for view in views)
    kept = left.shape[1] // STEP_COLUMNS * STEP_COLUMNS
    left, right = (
        samples[:, :kept].reshape(len(samples), -1, STEP_COLUMNS).sum(axis=2) / np.sqrt(STEP_COLUMNS)
        for samples in (left, right)
    )
    bands = len(left) // len(views[0].activity)
    tops = {}
    for shift in (0, *(s for step in range(1, MOST_STEP + 1) for s in (step, -step))):
        early, late = max(0, -shift) * bands, max(0, shift) * bands
        pair = left[early : len(left) - late], right[late : len(right) - early]
        tops[shift] = float(_signed_root(*pair).max()) if len(pair[0]) >= LEAST_SAMPLES else -np.inf
    if tops[0] == -np.inf:
        return {"frames": 0, "sigmas": float("nan"), "sigmas_unshifted": float("nan")}
    best = max(tops, key=lambda shift: tops[shift])
    shifted = tops[best] > STEP_GAIN * tops[0] and tops[best] > STEP_SIGMAS
    return {"frames": best if shifted else 0, "sigmas": tops[best], "sigmas_unshifted": tops[0]}


def threshold_sigmas(n_pairs: float | Array, expected_false: float) -> Array:
    """Significance that unrelated columns exceed `expected_false` times in n_pairs pairs, over all looks."""
    trials = np.maximum(1.0, KINDS * np.asarray(n_pairs) / CELL_PX**2)
    return np.asarray(-ndtri(np.minimum(0.5, expected_false / trials)))


def _samples(activity: Activity, fold: int) -> NDArray[np.float32]:
    """Activity as samples (n x bands, width) without its mean over time, summed over `fold` bands."""
    n, bands, width = activity.shape
    fold = min(fold, bands)
    kept = bands // fold
    summed = activity[:, : kept * fold].reshape(n, kept, fold, width).sum(axis=2) / np.sqrt(fold)
    summed -= summed.mean(axis=0)
    return cv2.filter2D(summed.reshape(n * kept, width), -1, ACROSS).astype(np.float32, copy=False)


def _signed_root(left: NDArray[np.float32], right: NDArray[np.float32]) -> NDArray[np.float32]:
    n = len(left)
    energies = [np.einsum("sj,sj->j", samples, samples) for samples in (left, right)]
    norms = [np.sqrt(np.maximum(energy, LEAST_ENERGY * n)) for energy in energies]
    root = (left / norms[0]).T @ (right / norms[1])
    root *= np.float32(np.sqrt(n))
    strong = np.flatnonzero(np.abs(root) > STRONG_SIGMAS)
    rho = np.clip(root.ravel()[strong] / np.sqrt(n), -NEARLY_ONE, NEARLY_ONE)
    root.ravel()[strong] = np.copysign(np.sqrt(-n * np.log1p(-rho * rho)), rho)
    noisy = [np.flatnonzero(energy > LEAST_ENERGY * n)[::SCALE_STEP] for energy in energies]
    if min(map(len, noisy)) >= LEAST_NOISY_COLUMNS:
        scale = np.float32(1.4826 * np.median(np.abs(root[np.ix_(*noisy)])))
        root /= scale if scale > 0.0 else 1.0  # views that share no rows: each is still where the other is
    return np.asarray(root)
