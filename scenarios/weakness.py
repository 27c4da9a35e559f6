"""Where an estimator is weaker than elsewhere: dips of its margins in one parameter or two, before they are failures.

A failure at the end of a slope announces itself: leaks near it are found, but by less than leaks like them. How much is
to be expected of a leak is learnt from the leaks so far, by regression. Whether those in a disc fall short by more than
chance is asked of every parameter and pair at once, by a scan statistic (Kulldorff, Communications in Statistics:
Theory and Methods 26, 1997). Within a dip the next place is where the lower confidence bound of a Gaussian process is
lowest (Srinivas et al., Proceedings of ICML, 2010): where it is deep, or nobody has looked.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

FEWEST = 40
"""Leaks; fewer tell nothing."""

DISC = 0.06
"""Standard deviation of the kernel that is a dip's extent, in shares; a slope across 0.1 to 0.2 shows well."""

N_CENTRES = 60
"""The leaks that fall short by most are where dips are looked for."""

LEAST_Z = 3.0
PATIENCE = 5
"""Aims at a dip that meet no failure before it is left alone, for each standard deviation that it is deep. One that
meets a failure ends it: the atlas has it."""

N_PLACES = 40
RIDGE = 1.0
LEAST_STRENGTH, MOST_STRENGTH = -1.0, 4.0
MOST_EXCESS = 2.0
LEAST_SPREAD = 0.2
DEPTH = 1.0
"""Standard deviation of dips, before any is seen. This and those above are of logarithms of score over threshold."""


@dataclass(frozen=True)
class Aim:
    """A place to try: shares of one parameter or two."""

    parameters: tuple[int, ...]
    shares: tuple[float, ...]

    def is_near(self, other: "Aim") -> bool:
        """Whether both are of the same dip."""
        away = np.subtract(self.shares, other.shares) if self.parameters == other.parameters else np.inf
        return bool(np.linalg.norm(away) < 2.0 * DISC)


class Weakness:
    """How strongly the leaks so far were found, and where that led."""

    def __init__(self, n_values: Sequence[float]) -> None:
        """Begin without leaks. `n_values`: how many values each parameter can take; those with one have no dips."""
        self._varies = np.array(n_values) > 1
        self._trials = np.zeros((0, len(n_values)))
        self._strengths = np.zeros(0)
        self._tried: list[tuple[Aim, bool]] = []

    def add(self, trials: np.ndarray, margins: np.ndarray) -> None:
        """Add what observable leaks tried, (n, parameters) of shares, and by what margins they were found, (n,)."""
        log_ratios = 2.0 * np.arctanh(np.clip(margins, -0.99, 0.99))  # a margin is (r - 1) / (r + 1)
        self._trials = np.concatenate([self._trials, trials])
        self._strengths = np.concatenate([self._strengths, np.clip(log_ratios, LEAST_STRENGTH, MOST_STRENGTH)])

    def learn(self, aim: Aim, *, has_failed: bool) -> None:
        """Take in whether an aim has shown a failure."""
        self._tried.append((aim, has_failed))

    def aims(self, n: int, *, rng: np.random.Generator) -> list[Aim]:
        """Return up to n places to try, each in a dip of its own, the surest dips first."""
        if len(self._trials) < FEWEST:
            return []
        excesses = self._excesses()
        spread = max(1.4826 * float(np.median(np.abs(excesses))), LEAST_SPREAD)
        centres: list[Aim] = []
        for centre, depth in self._dips(excesses, spread):
            if len(centres) == n:
                break
            if not self._is_over(centre, depth) and not any(map(centre.is_near, centres)):
                centres.append(centre)
        return [self._lowest_bound(centre, excesses, spread, rng=rng) for centre in centres]

    def _excesses(self) -> np.ndarray:
        """Return by how much each leak was found more strongly (> 0) or less strongly than leaks like it, (n,)."""
        centred = 2.0 * self._trials - 1.0
        features = np.hstack([np.ones((len(centred), 1)), centred, centred**2])
        ridge = np.diag([1e-6] + [RIDGE] * (features.shape[1] - 1))
        weights = np.linalg.solve(features.T @ features + ridge, features.T @ self._strengths)
        excess = self._strengths - features @ weights
        return np.clip(excess - np.median(excess), -MOST_EXCESS, MOST_EXCESS)

    def _dips(self, excesses: np.ndarray, spread: float) -> list[tuple[Aim, float]]:
        """Return centres of discs whose leaks fall short by LEAST_Z standard deviations or more, and by how many.

        The surest come first.
        """
        lowest = np.argsort(excesses, kind="stable")[:N_CENTRES]
        at = self._trials[lowest]
        kernel = _kernel(at[:, :, None] - self._trials.T)  # (centres, parameters, leaks)
        sums = (kernel * excesses) @ kernel.transpose(0, 2, 1)  # of a parameter with itself: a narrower disc
        z = sums / (spread * np.sqrt(kernel**2 @ (kernel**2).transpose(0, 2, 1)))
        is_dip = (z < -LEAST_Z) & np.triu(np.outer(self._varies, self._varies))
        found = sorted(zip(z[is_dip], *np.nonzero(is_dip), strict=True))
        dips = []
        for fall, centre, one, other in found:
            parameters = [int(one)] if one == other else [int(one), int(other)]
            dips.append((Aim(tuple(parameters), tuple(at[centre, parameters].tolist())), -float(fall)))
        return dips

    def _is_over(self, centre: Aim, depth: float) -> bool:
        failed = [has_failed for aim, has_failed in self._tried if aim.is_near(centre)]
        return any(failed) or len(failed) >= PATIENCE * depth

    def _lowest_bound(self, centre: Aim, excesses: np.ndarray, spread: float, *, rng: np.random.Generator) -> Aim:
        """Return the most promising of some random places near the centre of a dip."""
        trials = self._trials[:, list(centre.parameters)]
        near = np.linalg.norm(trials - centre.shares, axis=1) < 3.0 * DISC
        known, excess = trials[near], excesses[near]
        places = np.array(centre.shares) + DISC * rng.standard_normal((N_PLACES, len(centre.shares)))
        places = np.clip(places, 0.0, 1.0 - 1e-9)
        across = DEPTH**2 * _kernel_between(places, known)
        solved = np.linalg.solve(DEPTH**2 * _kernel_between(known, known) + spread**2 * np.eye(len(known)), across.T)
        variance = DEPTH**2 - (across * solved.T).sum(axis=1)
        best = places[np.argmin(solved.T @ excess - np.sqrt(np.maximum(variance, 0.0)))]
        return Aim(centre.parameters, tuple(best.tolist()))


def _kernel(away: np.ndarray) -> np.ndarray:
    return np.asarray(np.exp(-0.5 * (away / DISC) ** 2))


def _kernel_between(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return _kernel(np.linalg.norm(one[:, None] - other, axis=2))
