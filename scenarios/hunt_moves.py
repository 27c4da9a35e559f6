"""What a hunt tries next: downhill on margins, into dips, known failures in new cells, and gaps nothing has filled."""

import numpy as np

from scenarios.atlas import Atlas, Move, Tried, cells_of
from scenarios.failures import FOUND
from scenarios.filling import Filling
from scenarios.hunted import Cell
from scenarios.margins import SHOULD_BE_RIGHT
from scenarios.projections import Projections
from scenarios.space import Space
from scenarios.space_point import n_shares, n_values, parameters, places, scenario_of, trials_of
from scenarios.visibility import Visibility
from scenarios.weakness import Aim, Weakness

CLOSE = 0.4
"""Margins above are no slope to go down: scores of more than twice the threshold, errors under half the bound."""

FIRST_STEP = 0.15
"""Of a range; halved after every three steps that led up."""

STEPS_OF_A_SIZE = 3

LAST_STEP = 0.02
MEMORY = 24
"""Moves of a kind by which the next are measured."""

NOW_AND_THEN = 0.25
"""Of rounds, those with a move of a kind that has not paid of late."""

TRIES = 20


class Known:
    """What the rounds so far have shown: scenes, failures by cell, and what observable leaks have tried."""

    def __init__(self, space: Space) -> None:
        """Begin with nothing."""
        self.space = space
        self.atlas = Atlas(space)
        self.tried: list[Tried] = []
        self.parents: dict[Move, Tried] = {}
        self.vain_steps: dict[Move, int] = {}
        self.carried: set[tuple[str, int, Cell]] = set()
        self.paid: dict[str, list[bool]] = {}
        self.narrowest = SHOULD_BE_RIGHT
        self.seen = Projections(n_values(space))
        self.visibility = Visibility()
        self.weakness = Weakness(n_values(space))
        self.aims: dict[Move, Aim] = {}

    def add(self, tried: Tried) -> None:
        """Take in a scene. Only what an observable leak has tried counts as tried: an estimator may miss the others."""
        trials = trials_of(self.atlas.space, tried.move.shares)
        observable = observable_of(tried, len(trials))
        self.tried.append(tried)
        self.seen.add(trials[observable])
        self.visibility.add(trials, observable)
        self._weigh(tried, trials)
        self.paid.setdefault(tried.move.origin, []).append(self._shows_something_new(tried))
        if tried.move in self.parents:
            parent = self.parents[tried.move]
            went_down = tried.run.margins.least < parent.run.margins.least
            vain = self.vain_steps.get(parent.move, 0)
            # downhill from the child from now on; a parent is come back to only when its children lead nowhere
            self.vain_steps[parent.move] = vain + (0 if went_down else 1)

    def paying(self, origin: str, most: int, *, rng: np.random.Generator) -> int:
        """Return how many moves of a kind are worth while: as many as of the last ones showed something new.

        When none did, one now and then, for what a hunt knows has changed since.
        """
        recent = self.paid.get(origin, [])[-MEMORY:]
        if len(recent) < MEMORY:
            return most
        return min(sum(recent), most) or int(rng.random() < NOW_AND_THEN)

    def _weigh(self, tried: Tried, trials: np.ndarray) -> None:
        """Take in how strongly leaks were found, and whether the leak that was aimed (the first) was not."""
        strengths = tried.run.margins.strengths
        rows = [min(leak, len(trials) - 1) for leak, _ in strengths]  # one for all where the leaks are the base's
        self.weakness.add(trials[rows], np.array([margin for _, margin in strengths]))
        if tried.move in self.aims:
            aimed = tried.run.leaks[:1] if self.space.max_leaks else tried.run.leaks
            if any(leak.observable and leak.code != FOUND for leak in aimed):
                self.weakness.add_failure(self.aims[tried.move])

    def _shows_something_new(self, tried: Tried) -> bool:
        """Whether a scene opens a cell of the atlas, or is right by less than any before: add it to both."""
        cells_before, narrowest_before = len(self.atlas.kept), self.narrowest
        self.atlas.add(tried)
        if tried.run.margins.least >= 0.0:
            self.narrowest = min(self.narrowest, tried.run.margins.least)
        return len(self.atlas.kept) > cells_before or self.narrowest < narrowest_before


def observable_of(tried: Tried, n_trials: int) -> np.ndarray:
    """Which of a scene's trials could show a failure: its observable leaks, or the whole scene when it broke down."""
    leaks = tried.run.leaks
    if not leaks:
        return np.ones(n_trials, dtype=bool)
    seen = np.array([leak.observable for leak in leaks])
    return seen if len(seen) == n_trials else np.full(n_trials, seen.any())


def downhill(known: Known, n_moves: int, *, rng: np.random.Generator) -> list[Move]:
    """Return steps from the scenes that are right by the smallest margins, one a scene, with the same draws.

    The step from a scene is halved after every three children that were no worse than it; at the end it is left alone.
    A child that is worse, or wrong, has margins of its own to go on from.
    """
    right = [one for one in known.tried if 0.0 <= one.run.margins.least < CLOSE]
    moves: list[Move] = []
    for parent in sorted(right, key=lambda one: (one.run.margins.least, one.number)):
        if len(moves) == n_moves:
            break
        step = FIRST_STEP * 0.5 ** (known.vain_steps.get(parent.move, 0) // STEPS_OF_A_SIZE)
        if step < LAST_STEP:
            continue
        move = _stepped(known.space, parent.move, step, rng=rng)
        if move is not None:
            known.parents[move] = parent
            moves.append(move)
    return moves


def chasing(known: Known, gaps: Filling, seeds: list[int], *, rng: np.random.Generator) -> list[Move]:
    """Return new scenes, up to one a seed, whose first leak lies where a dip may be; all else of them fills gaps."""
    moves = []
    for aim, seed in zip(known.weakness.aims(len(seeds), rng=rng), seeds, strict=False):
        shares = gaps.scene_with(dict(zip(aim.parameters, aim.shares, strict=True)), seed, rng=rng)
        if shares is not None:
            moves.append(Move(tuple(shares), seed, "chasing"))
            known.aims[moves[-1]] = aim
            gaps.plan(shares)
    return moves


def spreading(known: Known, n_moves: int, *, rng: np.random.Generator) -> list[Move]:
    """Return known failures moved, in one parameter, into a third of its range where their code was not seen."""
    kept = known.atlas.kept
    by_number = {one.number: one for one in known.tried}
    open_cells = [
        (code, found, cell)
        for code in known.atlas.codes()
        for found in {found.number: found for (kind, _), found in kept.items() if kind == code}.values()
        for cell in _unseen(known, code, found.leak)
        if (code, found.number, cell) not in known.carried
    ]
    moves: list[Move] = []
    for i in rng.permutation(len(open_cells))[:n_moves]:
        code, found, cell = open_cells[i]
        known.carried.add((code, found.number, cell))
        move = _carried(known.space, by_number[found.number], found.leak, cell, rng=rng)
        if move is not None:
            moves.append(move)
    return moves


def filling(gaps: Filling, seeds: list[int], *, rng: np.random.Generator) -> list[Move]:
    """Return a new scene a seed, where most gaps promise to be filled."""
    moves = []
    for seed in seeds:
        moves.append(Move(tuple(gaps.scene(seed, rng=rng)), seed, "filling"))
        gaps.plan(moves[-1].shares)
    return moves


def _unseen(known: Known, code: str, leak: int | None) -> list[Cell]:
    everywhere = [Cell(name, third) for name in _moved(known.space, leak) for third in range(3)]
    return [cell for cell in everywhere if (code, cell) not in known.atlas.kept]


def _moved(space: Space, leak: int | None) -> list[str]:
    """Parameters whose cells a failure can be carried into."""
    shares = (0.5,) * n_shares(space)
    return [cell.parameter for cell in cells_of(space, shares, leak if leak is None else 0)]


def _carried(space: Space, tried: Tried, leak: int | None, cell: Cell, *, rng: np.random.Generator) -> Move | None:
    """Return a scene with one parameter moved into a cell; None where that makes no scene."""
    names, n_axes = parameters(space), len(space.axes)
    place = names.index(cell.parameter)
    shares = list(tried.move.shares)
    if place > n_axes:  # of a leak: its range or its azimuth
        of_leak = places(space, shares)[leak or 0].leak
        place = n_axes + 1 + 2 * of_leak + (place - n_axes - 1)
    shares[place] = (cell.third + float(rng.uniform(0.1, 0.9))) / 3.0
    move = Move(tuple(shares), tried.move.seed, "spreading")
    return None if scenario_of(space, move.shares, move.seed) is None else move


def _stepped(space: Space, parent: Move, step: float, *, rng: np.random.Generator) -> Move | None:
    """Return a scene a step away in one to three shares that matter; None where no valid one is met."""
    n_axes = len(space.axes)
    matter = [i for i, axis in enumerate(space.axes) if axis.n_values > 1]
    if space.max_leaks:
        matter.append(n_axes)
        matter += [n_axes + 1 + 2 * place.leak + i for place in places(space, parent.shares) for i in (0, 1)]
    if not matter:  # every axis has one value, and no leak may move
        return None
    before = scenario_of(space, parent.shares, parent.seed)
    for _ in range(TRIES):
        shares = np.array(parent.shares)
        chosen = rng.choice(matter, size=min(int(rng.integers(1, 4)), len(matter)), replace=False)
        shares[chosen] += step * rng.standard_normal(len(chosen))
        shares = np.clip(
            np.where(shares < 0.0, -shares, np.where(shares >= 1.0, 2.0 - shares, shares)), 0.0, 1.0 - 1e-9
        )
        move = Move(tuple(map(float, shares)), parent.seed, "downhill")
        if scenario_of(space, move.shares, move.seed) not in (None, before):
            return move
    return None
