"""How evenly trials fill a space, seen from every side: in each parameter and in each pair of parameters.

A failure that depends on one or two parameters is a slab or a column through the space. It is met as soon as no large
box of any one- or two-dimensional projection is empty, whatever the number of other parameters. So the emptiness of
elementary boxes is what is watched: of every pair all boxes of 2^-a by 2^-b, a + b = k, of which a (0, m, 2)-net holds
a point each (Niederreiter, Random Number Generation and Quasi-Monte Carlo Methods, 1992, 4.1). Covering arrays do the
same for discrete parameters (Cohen et al., IEEE Trans. Software Eng. 23, 1997), one next-best trial at a time.
"""

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

FINER = 2
"""Boxes of two sizes are watched: about as many as trials, and this many halvings smaller."""

WEIGHTS = (1.0, 0.5)
"""Of a gap of either size."""


class Projections:
    """The trials so far, (n, parameters) of shares in [0, 1), and what a further one would be the first to fill."""

    def __init__(self, n_values: Sequence[float]) -> None:
        """Begin without trials. `n_values`: how many values each parameter can take; its boxes are never finer."""
        self._n_values = np.array(n_values, dtype=float)
        self._pairs = np.array(list(combinations(range(len(n_values)), 2)) or [(0, 0)]).T
        self._trials = np.zeros((0, len(n_values)))
        self._size = 0
        self._filled = self._none_filled()

    def copy(self) -> "Projections":
        """Return a copy that can be added to."""
        other = Projections(self._n_values.tolist())
        other._trials, other._size = self._trials, self._size
        other._filled = [filled.copy() for filled in self._filled]
        return other

    def add(self, trials: np.ndarray) -> None:
        """Add trials (n, parameters). Boxes get smaller as trials get more."""
        self._trials = np.concatenate([self._trials, trials])
        size = max(int(math.log2(len(self._trials))), 1) if len(self._trials) else 0
        if size != self._size:
            self._size = size
            self._filled = self._none_filled()
            trials = self._trials
        self.fill(trials)

    def fill(self, trials: np.ndarray) -> None:
        """Take the boxes of trials (n, parameters) for filled, of the size that they have."""
        for filled, k in zip(self._filled, self._sizes(), strict=True):
            filled[self._boxes(trials, k)] = True

    def gain(self, trials: np.ndarray) -> np.ndarray:
        """How many boxes each of the trials (n, parameters) would be the first to fill, (n,)."""
        gain = np.zeros(len(trials))
        for weight, filled, k in zip(WEIGHTS, self._filled, self._sizes(), strict=True):
            gain += weight * (~filled[self._boxes(trials, k)]).sum(axis=1)
        return gain

    def _sizes(self) -> tuple[int, int]:
        return self._size, self._size + FINER

    def _none_filled(self) -> list[NDArray[np.bool_]]:
        return [np.zeros(self._pairs.shape[1] * (k + 1) * 2**k, dtype=bool) for k in self._sizes()]

    def _boxes(self, trials: np.ndarray, k: int) -> NDArray[np.intp]:
        """Of every trial (n, pairs * shapes), pair and shape 2^-a by 2^-(k - a), the place of its box in the table."""
        n_bins = np.minimum(2.0 ** np.arange(k + 1)[:, None], self._n_values).astype(int)  # (shapes, parameters)
        bins = np.minimum((trials[:, None] * n_bins).astype(int), n_bins - 1)  # (trials, shapes, parameters)
        one, other = self._pairs
        box = bins[:, :, one] * n_bins[::-1, other] + bins[:, ::-1, other]
        tables = np.arange((k + 1) * len(one)).reshape(k + 1, len(one)) * 2**k
        return np.asarray((box + tables).reshape(len(trials), tables.size))
