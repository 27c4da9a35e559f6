"""Where an estimator is weaker than elsewhere: dips of its margins in one parameter or two, before they are failures.

A failure at the end of a slope announces itself: leaks near it are found, but by less than leaks like them. How much is
to be expected of a leak is learnt from the leaks so far, by regression. What is left of it is explained by a dip: a
cone, DEPTH deep, in one parameter or in the plane of two, anywhere. The likelihoods of all dips follow from one
convolution of the shortfalls and one of the leaks; the next places are drawn from the posterior of their middles
(Thompson, Biometrika 25, 1933). So they lie where leaks fall short, then where few leaks were, and never where leaks
were found as they should be.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

FEWEST = 40
"""Leaks; fewer tell nothing."""

GRID = 40
"""Middles of dips along a parameter."""

RADII = (0.1, 0.15, 0.25)
"""Of dips, in shares."""

DEPTH = 1.0
"""Of dips in their middle. This and those below are of logarithms of score over threshold."""

RIDGE = 1.0
LEAST_STRENGTH, MOST_STRENGTH = -1.0, 4.0
LEAST_SPREAD = 0.2
MOST_SPREADS = 3.0
"""By which a leak falls short at most: scores have tails, and one unlucky leak is no dip."""

SHARPNESS = 1.5
"""Power of the posterior; above 1, more of the places lie in the likeliest dips."""

ENOUGH = 20
"""Failures that aims have met near one place; then it is accounted for, with what lies around it: the atlas has it."""

NEAR = 0.1


@dataclass(frozen=True)
class Aim:
    """A place to try: shares of one parameter or two."""

    parameters: tuple[int, ...]
    shares: tuple[float, ...]

    def is_near(self, other: "Aim") -> bool:
        """Whether both may be of the same dip."""
        return self.parameters == other.parameters and bool(self.distance(np.array(other.shares)) < NEAR)

    def distance(self, shares: np.ndarray) -> np.ndarray:
        """Return how far (..., parameters of the aim) shares are away, (...)."""
        return np.asarray(np.linalg.norm(shares - np.array(self.shares), axis=-1))


class Weakness:
    """How strongly the leaks so far were found, and where that led."""

    def __init__(self, n_values: Sequence[float]) -> None:
        """Begin without leaks. `n_values`: how many values each parameter can take; those with one have no dips."""
        varying = np.flatnonzero(np.array(n_values) > 1)
        first, second = np.triu_indices(len(varying))
        self._first, self._second = varying[first], varying[second]
        self._is_line = first == second  # of a parameter alone: a plane of which one row counts
        self._trials = np.zeros((0, len(n_values)))
        self._strengths = np.zeros(0)
        self._failed: list[Aim] = []
        self._exhausted: list[Aim] = []

    def add(self, trials: np.ndarray, margins: np.ndarray) -> None:
        """Add what observable leaks tried, (n, parameters) of shares, and by what margins they were found, (n,)."""
        log_ratios = 2.0 * np.arctanh(np.clip(margins, -0.99, 0.99))  # a margin is (r - 1) / (r + 1)
        self._trials = np.concatenate([self._trials, trials])
        self._strengths = np.concatenate([self._strengths, np.clip(log_ratios, LEAST_STRENGTH, MOST_STRENGTH)])

    def add_failure(self, aim: Aim) -> None:
        """Take in that the leak of an aim was missed."""
        self._failed.append(aim)
        if sum(map(aim.is_near, self._failed)) >= ENOUGH:
            self._exhausted.append(aim)

    def aims(self, n: int, *, rng: np.random.Generator) -> list[Aim]:
        """Return n places to try, drawn by how likely they are the middle of a dip; none as long as little is known."""
        if len(self._trials) < FEWEST or not len(self._first):
            return []
        posterior = self._posterior()
        drawn = rng.choice(posterior.size, size=n, p=posterior.ravel() / posterior.sum())
        planes, *cells = np.unravel_index(drawn, posterior.shape)
        shares = (np.stack(cells, axis=1) + rng.random((n, 2))) / GRID
        return [self._aim(plane, place) for plane, place in zip(planes, shares.tolist(), strict=True)]

    def _aim(self, plane: int, shares: list[float]) -> Aim:
        parameters = (int(self._first[plane]), int(self._second[plane]))
        n = 1 if self._is_line[plane] else 2
        return Aim(parameters[:n], tuple(shares[:n]))

    def _posterior(self) -> np.ndarray:
        """Return how likely each cell is the middle of a dip, up to a factor, (planes, GRID, GRID).

        Every plane is as likely beforehand as every other, and as every parameter alone.
        """
        excesses, spread = self._excesses()
        log_ratios = self._log_ratios(excesses, spread)
        posterior = np.exp(SHARPNESS * (log_ratios - log_ratios.max())).sum(axis=0)
        posterior[self._is_line] *= GRID
        return np.asarray(posterior)

    def _excesses(self) -> tuple[np.ndarray, float]:
        """Return by how much each leak was found more strongly (> 0) than leaks like it, (n,), and the spread."""
        centred = 2.0 * self._trials - 1.0
        features = np.hstack([np.ones((len(centred), 1)), centred, centred**2])
        ridge = np.diag([1e-6] + [RIDGE] * (features.shape[1] - 1))
        weights = np.linalg.solve(features.T @ features + ridge, features.T @ self._strengths)
        excess = self._strengths - features @ weights
        excess -= np.median(excess)
        spread = max(1.4826 * float(np.median(np.abs(excess))), LEAST_SPREAD)
        for aim in self._exhausted:
            excess[aim.distance(self._trials[:, list(aim.parameters)]) < 2.0 * NEAR] = 0.0
        return np.clip(excess, -MOST_SPREADS * spread, MOST_SPREADS * spread), spread

    def _log_ratios(self, excesses: np.ndarray, spread: float) -> np.ndarray:
        """Return the log likelihood ratio of a dip to none for every middle, (radii, planes, GRID, GRID).

        For normal shortfalls it is sum(e m - m^2 / 2) / spread^2 over leaks, m what the dip takes from each.
        """
        from scipy.signal import fftconvolve  # half a second of imports that most commands do not need

        cells = self._cells()
        shape = (len(self._first), GRID, GRID)
        n = np.bincount(cells.ravel(), minlength=np.prod(shape)).reshape(shape)
        e = np.bincount(cells.ravel(), np.tile(excesses, shape[0]), np.prod(shape)).reshape(shape)
        log_ratios = np.stack(
            [
                fftconvolve(e, taken, "same", axes=(1, 2)) - fftconvolve(n, taken**2 / 2.0, "same", axes=(1, 2))
                for taken in (_cone(radius)[None] for radius in RADII)
            ]
        )
        off_line = self._is_line[:, None] & (np.arange(GRID) != GRID // 2)
        return np.where(off_line[:, None], -np.inf, log_ratios / spread**2)

    def _cells(self) -> np.ndarray:
        """Return the cell of every leak in every plane, (planes, leaks), counted through all planes."""
        cells = np.minimum((self._trials.T * GRID).astype(int), GRID - 1)
        second = np.where(self._is_line[:, None], GRID // 2, cells[self._second])
        return np.asarray((np.arange(len(self._first))[:, None] * GRID + cells[self._first]) * GRID + second)


@cache
def _cone(radius: float) -> np.ndarray:
    """Return what a dip takes from leaks around its middle, on a grid that reaches as far as it does."""
    reach = round(radius * GRID)
    away = np.arange(-reach, reach + 1) / GRID
    return -DEPTH * np.maximum(1.0 - np.hypot(away[:, None], away) / radius, 0.0)
