"""What stays: the temporal median, and what moves against it (paper eq. 1-2)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Frames = NDArray[Any]  # (frames, height, width), uint8 or uint16 grey

BLOCK_BYTES = 2 << 20  # rows of all frames sorted at once: in the cache, yet few calls; measured best from 1 to 4 MiB


@dataclass(frozen=True, eq=False)
class TemporalMedian:
    """The two middle values of every pixel over time, (height, width) each in the dtype of the frames.

    With an odd number of frames both are the median; with an even number the median is their mean and keeps its
    half-integers. Both are kept because grey is whole and its median need not be.
    """

    lower: NDArray[Any]
    upper: NDArray[Any]

    @property
    def grey(self) -> NDArray[np.float64]:
        """The median itself, (height, width), grey."""
        return (self.lower.astype(np.float64) + self.upper) / 2


def temporal_median(frames: Frames) -> TemporalMedian:
    """The background of a still camera: the median over time of every pixel (paper eq. 1).

    frames (n, height, width) uint8 or uint16 grey, n >= 1. Same values as `np.median(frames, axis=0)`, by a sorting
    network over the frames that runs on blocks of rows which fit the cache; a view of contiguous rows is fastest.
    """
    n, height, width = frames.shape
    middle = ((n - 1) // 2, n // 2)
    steps = selection_network(n, middle)
    lower = np.empty((height, width), frames.dtype)
    upper = lower if n % 2 else np.empty_like(lower)
    rows = max(1, BLOCK_BYTES // ((n + 1) * width * frames.itemsize))
    for top in range(0, height, rows):
        block = frames[:, top : top + rows]
        ordered = _run_network(steps, block)
        lower[top : top + rows] = ordered[middle[0]]
        upper[top : top + rows] = ordered[middle[1]]
    return TemporalMedian(lower, upper)


def column_vectors(frames: Frames, median: TemporalMedian, columns_px: NDArray[np.intp]) -> NDArray[np.float64]:
    """The foreground F_n = |I_n - median| (paper eq. 2) of the given columns only: (columns, n, height), grey.

    Matching looks at a handful of columns, so F is never built as a whole. Slow definition:
    `np.abs(frames - np.median(frames, axis=0))[:, :, columns_px]`, half-integers kept.
    """
    twice = median.lower[:, columns_px].astype(np.float64) + median.upper[:, columns_px]
    foreground = np.abs(frames[:, :, columns_px] - twice / 2)
    return np.ascontiguousarray(foreground.transpose(2, 0, 1))


def foreground_total(frames: Frames, median: TemporalMedian) -> NDArray[np.int64]:
    """Sum of F_n (paper eq. 2) over frames and rows for every column: (width,), whole grey, exact.

    Slow definition: `np.abs(frames - np.median(frames, axis=0)).sum(axis=(0, 1))`. The sum over time of |I_n - m| is
    the same for every m between the two middle values (as many frames lie above as below), so whole numbers against
    the lower one give the half-integer median's sum to the bit.
    """
    height, width = median.lower.shape
    total = np.zeros(width, np.int64)
    moved = np.empty((height, width), frames.dtype)
    wide = cv2.CV_32S if frames.dtype == np.uint8 else cv2.CV_64F  # OpenCV adds uint16 in floats; 2^53 is far away
    for frame in frames:
        cv2.absdiff(frame, median.lower, moved)
        total += cv2.reduce(moved, 0, cv2.REDUCE_SUM, dtype=wide)[0].astype(np.int64)
    return total


@lru_cache(maxsize=64)
def selection_network(count: int, wanted: tuple[int, ...]) -> tuple[tuple[int, int, bool, bool], ...]:
    """Compare-exchange steps that bring the `wanted` ranks of `count` values to their places.

    Batcher's odd-even merge sort (Knuth, The Art of Computer Programming 3, 5.2.2, algorithm M), cut back to the
    steps on which the wanted ranks depend. Each step is (low place, high place, minimum needed, maximum needed).
    """
    needed = set(wanted)
    kept = []
    for low, high in reversed(_batcher(count)):
        if low in needed or high in needed:
            kept.append((low, high, low in needed, high in needed))
            needed |= {low, high}
    return tuple(reversed(kept))


def _batcher(count: int) -> list[tuple[int, int]]:
    """All compare-exchange steps of Batcher's merge exchange for any count."""
    steps = []
    top = 1 << max(0, (count - 1).bit_length() - 1)
    p = top
    while p > 0:
        q, r, d = top, 0, p
        while True:
            steps += [(i, i + d) for i in range(count - d) if i & p == r]
            if q == p:
                break
            d, q, r = q - p, q // 2, p
        p //= 2
    return steps


def _run_network(steps: tuple[tuple[int, int, bool, bool], ...], block: Frames) -> list[NDArray[Any]]:
    """The block's frames with the wanted ranks in their places; the frames themselves are not written to."""
    places: list[NDArray[Any]] = list(block)
    spare = list(np.empty((len(block) + 1, *block.shape[1:]), block.dtype))
    own = [False] * len(places)
    for low, high, needs_minimum, needs_maximum in steps:
        a, b, own_a, own_b = places[low], places[high], own[low], own[high]
        if needs_minimum:
            places[low], own[low] = np.minimum(a, b, out=spare.pop()), True
        if needs_maximum:
            out = b if own_b else (a if own_a else spare.pop())
            places[high], own[high] = np.maximum(a, b, out=out), True
            own_a, own_b = own_a and out is not a, own_b and out is not b
        spare += [old for old, mine in ((a, own_a), (b, own_b)) if mine]
    return places
