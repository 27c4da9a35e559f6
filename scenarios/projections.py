"""How evenly trials fill a space, seen from every side: in each parameter and in each pair of parameters.

A failure that depends on one or two parameters is a slab or a column through the space: a box in one projection. As
long as nothing is known of it, it may be any box that no trial has hit. What a further trial is worth is the share of
those boxes that it would be the first to hit, over all places and several shapes, of an area that goes with the number
of trials. Covering arrays do the same for discrete parameters (Cohen et al., IEEE Trans. Software Eng. 23, 1997), one
next-best trial at a time.
"""

import copy
import math
from collections.abc import Sequence
from functools import cached_property, lru_cache
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray

FINEST, FINEST_ALONE = 128, 4096
"""Cells of a parameter in a pair and of one alone, at most.

Many alone: a range narrower than an estimator's error must be hit several times, by a leak that is also seen in it.
"""

SIZE = 0.5
"""Area of the boxes, in shares of what each trial would have if they were spread evenly."""


class Projections:
    """The trials so far, (n, parameters) of shares in [0, 1), and what a further one would be the first to hit."""

    def __init__(self, n_values: Sequence[float]) -> None:
        """Begin without trials. `n_values`: how many values each parameter can take; its cells are never finer.

        Parameters of one value have no projections.
        """
        n = np.array(n_values, dtype=float)
        varying = np.flatnonzero(n > 1.0)
        pairs = np.array(list(combinations(varying, 2)), dtype=int).reshape(-1, 2).T
        self.parameters = np.hstack([np.stack([varying, varying]), pairs])
        """Of every projection, (2, projections); the same twice where it is of one."""
        alone = np.stack([np.minimum(n[varying], FINEST_ALONE), np.ones(len(varying))])
        self._cells = np.hstack([alone, np.minimum(n[pairs], FINEST)]).astype(int)  # (2, projections)
        self._starts = np.concatenate([[0], np.cumsum(self._cells.prod(axis=0))])
        self._filled = np.zeros(self._starts[-1], np.uint8)
        self._n_trials = 0

    def copy(self) -> "Projections":
        """Return a copy that can be added to."""
        other = copy.copy(self)
        other._filled = self._filled.copy()
        return other

    def add(self, trials: np.ndarray) -> None:
        """Add trials (n, parameters). Boxes get smaller as trials get more."""
        self._filled[self._places(trials)] = 1
        self._n_trials += len(trials)
        self.__dict__.pop("_gains", None)

    def gains(self, trials: np.ndarray) -> np.ndarray:
        """Return what share of boxes each of the trials (n, parameters) would be the first to hit, (n, projections)."""
        return self._gains[self._places(trials)]

    def _places(self, trials: np.ndarray) -> NDArray[np.intp]:
        """Return where the cell of every trial is in the tables, (n, projections)."""
        row, column = (
            np.minimum((trials[:, of] * cells).astype(int), cells - 1)
            for of, cells in zip(self.parameters, self._cells, strict=True)
        )
        return np.asarray(self._starts[:-1] + row * self._cells[1] + column)

    @cached_property
    def _gains(self) -> NDArray[np.float32]:
        """What a trial in each cell would be worth, in the order of the tables."""
        tables = [
            _shares_of_boxes(self._filled[start:stop].reshape(cells), _shapes(*cells, self._n_trials))
            for start, stop, cells in zip(self._starts[:-1], self._starts[1:], self._cells.T.tolist(), strict=True)
        ]
        return np.concatenate([np.zeros(0, np.float32), *(table.ravel() for table in tables)])


@lru_cache(maxsize=256)
def _shapes(n_rows: int, n_columns: int, n_trials: int) -> list[tuple[int, int]]:
    """Return the rows and columns of boxes in cells, from wide to high, each about twice as high as the last."""
    area = SIZE / max(n_trials, 1) * n_rows * n_columns
    lowest, highest = max(area / n_columns, 1.0), max(min(float(n_rows), area), 1.0)
    doublings = round(math.log2(highest / lowest))
    rows = [lowest * (highest / lowest) ** (i / max(doublings, 1)) for i in range(doublings + 1)]
    return sorted({(round(row), max(round(area / row), 1)) for row in rows})


def _shares_of_boxes(filled: NDArray[np.uint8], shapes: list[tuple[int, int]]) -> NDArray[np.float32]:
    """Return the share of boxes that hold a cell and no filled one, for each cell, mean over shapes."""
    shares = np.zeros(filled.shape, np.float32)
    for rows, columns in shapes:
        # boxes by their first cell; those that stick out are none
        empty = (_sums(filled, rows, columns, (0, 0)) == 0.0).astype(np.float32)
        empty[filled.shape[0] - rows + 1 :] = 0.0
        empty[:, filled.shape[1] - columns + 1 :] = 0.0
        n = (filled.shape[0] - rows + 1) * (filled.shape[1] - columns + 1) * len(shapes)
        shares += _sums(empty, rows, columns, (columns - 1, rows - 1)) / np.float32(n)
    return shares


def _sums(cells: np.ndarray, rows: int, columns: int, anchor: tuple[int, int]) -> NDArray[np.float32]:
    """Return the sum of each box of a shape, which stands in its place of the anchor (column, row); 0 outside."""
    return np.asarray(
        cv2.boxFilter(
            cells, cv2.CV_32F, (columns, rows), anchor=anchor, normalize=False, borderType=cv2.BORDER_CONSTANT
        )
    )
