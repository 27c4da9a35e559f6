"""Chance of a leak to be observable, learnt from the leaks that a hunt has seen: where nothing can be seen, none look.

Logistic regression on the parameters and their products, with a ridge (Hastie, Tibshirani and Friedman, The Elements of
Statistical Learning, 2009, 4.4), by Newton's method: signal, noise and field of view are smooth in all parameters.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

FEWEST = 8
RIDGE = 0.3
N_STEPS = 12
LEAST_CHANCE = 0.05
"""No corner is written off for good."""


class Visibility:
    """What was observable so far: rows of shares (n, parameters), whether (n,), and the weights fitted to them."""

    def __init__(self) -> None:
        """Begin without leaks."""
        self._rows: list[np.ndarray] = []
        self._observable: list[np.ndarray] = []
        self._weights: np.ndarray | None = None

    def add(self, rows: np.ndarray, observable: np.ndarray) -> None:
        """Add leaks."""
        self._rows.append(rows)
        self._observable.append(observable)
        self._weights = None

    def chance(self, rows: np.ndarray) -> np.ndarray:
        """Return the chance of each row to be of an observable leak, (n,); 1 as long as next to nothing is known."""
        if sum(map(len, self._rows)) < FEWEST:
            return np.ones(len(rows))
        if self._weights is None:
            self._weights = _fitted(_features(np.concatenate(self._rows)), np.concatenate(self._observable))
        return np.asarray(LEAST_CHANCE + (1.0 - LEAST_CHANCE) * _logistic(_logits(rows, self._weights)))


def _features(rows: np.ndarray) -> np.ndarray:
    """One, every parameter in [-1, 1], and all their products, squares included."""
    centred = 2.0 * rows - 1.0
    first, second = _pairs(rows.shape[1])
    return np.hstack([np.ones((len(rows), 1)), centred, centred[:, first] * centred[:, second]])


def _logits(rows: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return `_features(rows) @ weights`, (n,), as a quadratic form: no products are stored."""
    centred, n = 2.0 * rows - 1.0, rows.shape[1]
    form = np.zeros((n, n))
    form[_pairs(n)] = weights[n + 1 :]
    return np.asarray(weights[0] + ((centred @ form + weights[1 : n + 1]) * centred).sum(axis=1))


@cache
def _pairs(n: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first and the second of every pair of n parameters, each with itself too."""
    first, second = np.triu_indices(n)
    return first, second


def _fitted(features: np.ndarray, observable: np.ndarray) -> np.ndarray:
    weights = np.zeros(features.shape[1])
    ridge = np.full(len(weights), RIDGE)
    ridge[0] = 1e-3
    for _ in range(N_STEPS):
        chance = _logistic(features @ weights)
        curvature = (features * (chance * (1.0 - chance) + 1e-6)[:, None]).T @ features + np.diag(ridge)
        weights -= np.linalg.solve(curvature, features.T @ (chance - observable) + ridge * weights)
    return weights


def _logistic(x: np.ndarray) -> np.ndarray:
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(x, -50.0, 50.0))))
