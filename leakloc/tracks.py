"""Which column of one view belongs to which of the other: peaks of agreement, assigned at a price for none."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

Sigmas = NDArray[np.float32]  # (width left, width right), standard deviations of unrelated columns

APART_PX = 3  # two peaks nearer than this are one
BRIGHT_SHARE = 1.35  # of the threshold, for bright lines: hits leave sparse samples, whose chance has a longer tail
WINDOW_PX = 2 * APART_PX + 1
FIRST = np.arange(WINDOW_PX**2).reshape(WINDOW_PX, -1) < WINDOW_PX**2 // 2  # of equals the first is the peak
BEFORE, AFTER = FIRST.astype(np.uint8), FIRST[::-1, ::-1].astype(np.uint8)
LINE_PX = 16  # pairs nearer than this in both views may be one broad line
MOST_TOPS = 200  # that are looked at, highest first
NEAR_PX = 1  # a pair's agreement is the best within this of both columns


@dataclass(frozen=True)
class Track:
    """A pair of columns in which the same things fall: a drop's line, or a shadow's.

    `sigmas`: significance of the pair; `runner_up_sigmas`: that of the best other partner of either column, -inf
    if there is none.
    """

    left_px: int
    right_px: int
    sigmas: float
    runner_up_sigmas: float
    bright: bool = False


def shared_tracks(signed: Sigmas, bright: Sigmas, least_sigmas: Sigmas) -> list[Track]:
    """Lines of either agreement: bright lines for themselves, since shadows that cover them in a view outshout them."""
    shining = [replace(track, bright=True) for track in match_tracks(bright, np.float32(BRIGHT_SHARE) * least_sigmas)]
    others = match_tracks(signed, least_sigmas)
    return shining + [track for track in others if not any(_same(track, known) for known in shining)]


def _same(one: Track, other: Track) -> bool:
    return abs(one.left_px - other.left_px) <= NEAR_PX and abs(one.right_px - other.right_px) <= NEAR_PX


def peaks(values: NDArray[np.floating], least: float, apart_px: int = APART_PX) -> NDArray[np.intp]:
    """Indices of values above `least` that are the first maximum within `apart_px` on both sides, ascending."""
    padded = np.pad(values, apart_px, constant_values=-np.inf)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * apart_px + 1)
    return np.flatnonzero((values > least) & (windows.argmax(axis=1) == apart_px))


def candidates(held: Sigmas, lowest: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Left and right columns that may be lines', ascending: peaks of each column's best agreement, and more.

    A line on the flank of a stronger one is no peak of its view; what it shares with the other view still is one among
    all pairs, away from the stronger one's there.
    """
    tops = np.argwhere((held > lowest) & (held > cv2.dilate(held, BEFORE)) & (held >= cv2.dilate(held, AFTER)))
    tops = tops[np.argsort(-held[tops[:, 0], tops[:, 1]], kind="stable")][:MOST_TOPS]
    return _candidates(held, tops, lowest), _candidates(held.T, tops[:, ::-1], lowest)


def _candidates(held: Sigmas, tops: NDArray[np.intp], lowest: float) -> NDArray[np.intp]:
    """Columns of the first view that may be lines', from peaks, and from tops (n, 2) that are no part of those."""
    columns_px = peaks(held.max(axis=1), lowest)
    lines = np.column_stack([columns_px, held[columns_px].argmax(axis=1)])
    for top in tops:
        beside = np.abs(lines - top)
        if not ((beside < LINE_PX).all(axis=1) | (beside[:, 0] <= APART_PX)).any():
            lines = np.vstack([lines, top])
    return np.sort(lines[:, 0])


def match_tracks(sigmas: Sigmas, least_sigmas: Sigmas) -> list[Track]:
    """Pairs of columns at the greatest total likelihood, none used twice, strongest first.

    Candidates are peaks (N lines would pair in N^2 ways); a pair gains sigmas^2, and both columns staying single costs
    least_sigmas^2, so nothing below the threshold, which is each pair's own, is matched; where it is infinite, nothing
    is.
    """
    lowest = float(least_sigmas.min())
    price = least_sigmas**2 - lowest**2  # over that of the pairs that come cheapest
    held = np.where(sigmas > 0, sigmas, 0) ** 2 - price
    held = np.sqrt(np.maximum(held, 0), out=held)
    left, right = candidates(held, lowest)
    if not len(left) or not len(right):
        return []
    pairs = _best_near(held, left, right)
    gain = np.where(pairs > lowest, pairs.astype(np.float64) ** 2 - lowest**2, 0.0)
    seen = np.sqrt(pairs.astype(np.float64) ** 2 + np.where(np.isfinite(price), price, 0)[np.ix_(left, right)])
    rows, columns = linear_sum_assignment(gain, maximize=True)
    tracks = []
    for i, j in zip(rows, columns, strict=True):
        if gain[i, j] > 0:
            others = np.concatenate([np.delete(seen[i], j), np.delete(seen[:, j], i)])
            runner_up = float(others.max(initial=-np.inf))
            tracks.append(Track(int(left[i]), int(right[j]), float(seen[i, j]), runner_up))
    return sorted(tracks, key=lambda track: -track.sigmas)


def _best_near(held: Sigmas, left: NDArray[np.intp], right: NDArray[np.intp]) -> Sigmas:
    """Best agreement of every candidate pair within NEAR_PX, (left, right)."""
    steps = range(-NEAR_PX, NEAR_PX + 1)
    width_left, width_right = held.shape
    return np.max(
        [
            held[np.ix_(np.clip(left + i, 0, width_left - 1), np.clip(right + j, 0, width_right - 1))]
            for i in steps
            for j in steps
        ],
        axis=0,
    )
