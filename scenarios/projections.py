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

FINER = 2
"""Boxes of two sizes are watched: about as many as trials, and this many halvings smaller."""


class Projections:
    """The trials so far, (n, parameters) of shares in [0, 1), and what a further one would be the first to fill."""

    def __init__(self, n_values: Sequence[float]) -> None:
        """Begin without trials. `n_values`: how many values each parameter can take; its boxes are never finer."""
        self._n_values = np.array(n_values, dtype=float)
        self._pairs = list(combinations(range(len(n_values)), 2)) or [(0, 0)]
        self._trials = np.zeros((0, len(n_values)))
        self._size = -1
        self._filled: list[np.ndarray] = []

    def copy(self) -> "Projections":
        """Return a copy that can be added to."""
        other = Projections(self._n_values.tolist())
        other._trials, other._size = self._trials, self._size
        other._filled = [filled.copy() for filled in self._filled]
        return other

    def add(self, trials: np.ndarray) -> None:
        """Add trials (n, parameters)."""
        self._trials = np.concatenate([self._trials, trials])
        size = max(int(math.log2(len(self._trials))), 1) if len(self._trials) else 0
        if size != self._size:
            self._size = size
            self._filled = [np.zeros((len(self._pairs), 2**k, k + 1), dtype=bool) for k in self._sizes()]
            trials = self._trials
        for filled, k in zip(self._filled, self._sizes(), strict=True):
            for pair, shape, boxes in self._boxes(trials, k):
                filled[pair, boxes, shape] = True

    def gain(self, trials: np.ndarray) -> np.ndarray:
        """How many boxes each of the trials (n, parameters) would be the first to fill, (n,)."""
        if not self._filled:
            return np.ones(len(trials))
        gain = np.zeros(len(trials))
        for weight, filled, k in zip((1.0, 0.5), self._filled, self._sizes(), strict=True):
            for pair, shape, boxes in self._boxes(trials, k):
                gain += weight * ~filled[pair, boxes, shape]
        return gain

    def _sizes(self) -> tuple[int, int]:
        return self._size, self._size + FINER

    def _boxes(self, trials: np.ndarray, k: int):  # type: ignore[no-untyped-def]
        halves = np.arange(k + 1)
        n_bins = np.minimum(2.0 ** halves[:, None], self._n_values)  # (k + 1, parameters)
        bins = np.minimum((trials[None] * n_bins[:, None]).astype(int), n_bins[:, None].astype(int) - 1)
        for pair, (one, other) in enumerate(self._pairs):
            for a in range(k + 1):
                yield pair, a, bins[a, :, one] * int(min(2.0 ** (k - a), self._n_values[other])) + bins[k - a, :, other]
