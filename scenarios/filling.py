"""Scenes that fill gaps: observable leaks where no trial has been, as many in as little time as can be.

A scene is climbed to: from a random one, one share after the other takes the best of some values.
"""

from collections.abc import Collection, Sequence

import numpy as np

from scenarios.projections import Projections
from scenarios.scene_time import SceneTimes
from scenarios.space import Space
from scenarios.space_point import n_leaks, n_shares, scenario_of, trials_of
from scenarios.visibility import Visibility

N_STARTS = 30
"""Random scenes, of which the one that promises most is climbed from."""

N_VALUES = 48
"""That are tried of a share."""

THRIFT = 0.5
"""Power of a scene's time that it is divided by: at 1 all scenes are small, and show too little."""

LIKELY = 0.4
"""Chance to be observable of a planned leak that counts as a trial until its scene is done."""


class Filling:
    """What scenes promise to fill of the gaps that are left by those before, and by those that are planned."""

    def __init__(self, space: Space, seen: Projections, visibility: Visibility) -> None:
        """Begin without plans. `seen` are the trials so far, which are left as they are."""
        self._space, self._visibility = space, visibility
        self._gaps, self._times = seen.copy(), SceneTimes(space)
        self._is_of_scene = (seen.parameters <= len(space.axes)).all(axis=0)  # the number of leaks comes after the axes

    def plan(self, shares: Sequence[float]) -> None:
        """Take a scene's leaks for tried, those that are likely to be observable."""
        trials = trials_of(self._space, shares)
        self._gaps.add(trials[self._visibility.chance(trials) > LIKELY])

    def scene(self, seed: int, *, rng: np.random.Generator) -> list[float]:
        """Return the shares of a scene that promises much."""
        while True:
            shares = self.scene_with({}, seed, rng=rng)
            if shares is not None:
                return shares

    def scene_with(self, held: dict[int, float], seed: int, *, rng: np.random.Generator) -> list[float] | None:
        """Return the shares of a scene that promises much, with some given; None when none is met.

        Where some are given its first leak is the one that matters: gaps count by its chance to be observable. Where
        the climb ends at a scene that breaks a rule, it is the best start that breaks none.
        """
        starts = rng.random((N_STARTS, n_shares(self._space)))
        starts[:, list(held)] = list(held.values())
        starts = starts[np.argsort(-self._promise(starts, held), kind="stable")]
        tried = (list(map(float, shares)) for shares in (self._climbed(starts[0], held, rng=rng), *starts))
        return next((shares for shares in tried if scenario_of(self._space, shares, seed) is not None), None)

    def _climbed(self, shares: np.ndarray, held: Collection[int], *, rng: np.random.Generator) -> np.ndarray:
        for place in rng.permutation([i for i in range(len(shares)) if i not in held]):
            if self._is_of_no_leak(place, shares):
                continue
            others = np.tile(shares, (N_VALUES + 1, 1))
            others[1:, place] = (np.arange(N_VALUES) + rng.random(N_VALUES)) / N_VALUES
            shares = others[self._promise(others, held).argmax()]
        return shares

    def _is_of_no_leak(self, place: int, shares: np.ndarray) -> bool:
        """Whether a share is of a leak that a point does not ask for."""
        n_axes = len(self._space.axes)
        return place > n_axes and bool(place > n_axes + 2 * n_leaks(self._space, shares))

    def _promise(self, points: np.ndarray, held: Collection[int]) -> np.ndarray:
        """Return what scenes are expected to be the first to hit, for the time they take, up to a factor, (scenes,)."""
        rows, is_there = self._leaks(points)
        flat = rows.reshape(-1, rows.shape[2])
        chance = self._visibility.chance(flat).reshape(is_there.shape) * is_there
        gains = self._gaps.gains(flat).reshape(*is_there.shape, -1)
        # what depends on the scene alone is hit once, by whichever of its leaks is observable
        of_scene = gains[:, 0, self._is_of_scene].sum(axis=1) * (1.0 - np.prod(1.0 - chance, axis=1))
        of_leaks = (chance * gains[:, :, ~self._is_of_scene].sum(axis=2)).sum(axis=1)
        first = chance[:, 0] if held else 1.0
        return np.asarray(first * (of_scene + of_leaks) / self._times.seconds(points) ** THRIFT)

    def _leaks(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what each leak of scenes tries, (scenes, leaks, parameters), and which of them there are.

        The places asked for, not yet to the centimetre, and near ones not yet left out.
        """
        n_axes, most = len(self._space.axes), self._space.max_leaks
        if most == 0:
            return points[:, None], np.ones((len(points), 1), dtype=bool)
        of_scene = np.repeat(points[:, None, : n_axes + 1], most, axis=1)
        places = points[:, n_axes + 1 :].reshape(len(points), most, 2)
        return np.concatenate([of_scene, places], axis=2), np.arange(most) < n_leaks(self._space, points)[:, None]
