"""Look for failures where they are: a quasi-random start, then down signed margins, into dips, and finer gaps filled.

Adaptive, so its scenes are counterexamples and no sample: `hunted.py` keeps rates from being made of them.
Deterministic from the seed and the number of scenes, whatever the number of workers: what a round tries follows from
the outcomes of the rounds before the last one alone, so that the last one can be under way while it is planned.
"""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from scenarios.atlas import Move, Tried
from scenarios.draws import Stream, rng_for, seed_of_clip
from scenarios.estimators import EstimatorSpec
from scenarios.filling import Filling
from scenarios.hunt_moves import Known, chasing, downhill, filling, spreading
from scenarios.lanes import Evaluate
from scenarios.scene_work import MethodOutcome, SceneWork, limit_s
from scenarios.space import Space
from scenarios.space_point import n_shares, scenario_of

ROUND = 12
N_START = 2 * ROUND
N_POINTS = 256
"""That the start is taken from: those that are no scenes are left out."""

DOWNHILL, SPREADING = 3, 2
"""Of a round, at most: as many as of the last ones showed something new."""

CHASING = 6
"""Of a round, at most. The rest fills gaps."""

SCENE_LIMIT_S = 120.0


@dataclass(frozen=True)
class Quarry:
    """What is hunted: failures of an estimator in a space, by a seed."""

    space: Space
    estimator: EstimatorSpec
    seed: int


@dataclass(frozen=True)
class _Round:
    """Scenes under way."""

    moves: list[Move]
    works: list[SceneWork]
    outcomes: Iterable[MethodOutcome]

    def tried(self) -> list[Tried]:
        """Wait for what came of them."""
        rows = zip(self.moves, self.works, self.outcomes, strict=True)
        return [Tried(work.number, move, work.scenario, run) for move, work, run in rows]


def hunt(quarry: Quarry, evaluate: Evaluate, n_scenes: int | None = None) -> Iterator[list[Tried]]:
    """Yield round after round of scenes tried, without end or until there are `n_scenes`; an `Atlas` keeps failures.

    The first two rounds are quasi-random (scrambled Sobol); in the others some scenes go downhill from the smallest
    margins, some look where leaks are found less strongly than they should be, some carry known failures into cells
    where their code was not seen, and the rest fill the gaps that are left. What brings nothing new makes room for
    filling: margins lead nowhere when failures are not at the end of a slope.
    """
    known, number = Known(quarry.space), 0
    start = _start(quarry)
    under_way: deque[_Round] = deque()
    while True:
        goes_on = n_scenes is None or number < n_scenes
        if goes_on:
            planned = [move for one in under_way for move in one.moves]
            moves = start[number : number + ROUND] or _next(quarry, known, planned, number)
            moves = moves if n_scenes is None else moves[: n_scenes - number]
            under_way.append(_begun(quarry, moves, number, evaluate))
            number += len(moves)
        if len(under_way) > goes_on:  # one round stays under way as long as others follow
            tried = under_way.popleft().tried()
            for one in tried:
                known.add(one)
            yield tried
        elif not goes_on:
            return


def _start(quarry: Quarry) -> list[Move]:
    from scipy.stats import qmc  # half a second of imports that most commands do not need

    rng = rng_for(quarry.seed, Stream.HUNT, 0)
    points = qmc.Sobol(n_shares(quarry.space), rng=rng).random(N_POINTS)
    valid = [point for point in points if scenario_of(quarry.space, point, 0) is not None]
    return [
        Move(tuple(map(float, point)), seed_of_clip(quarry.seed, i), "start") for i, point in enumerate(valid[:N_START])
    ]


def _begun(quarry: Quarry, moves: list[Move], number: int, evaluate: Evaluate) -> _Round:
    scenarios = [scenario_of(quarry.space, move.shares, move.seed) for move in moves]
    works = [
        SceneWork(number + i, scenario, (quarry.estimator,), limit_s(SCENE_LIMIT_S, quarry.estimator))
        for i, scenario in enumerate(scenarios)
        if scenario is not None
    ]
    assert len(works) == len(moves)
    return _Round(moves, works, evaluate(works))


def _next(quarry: Quarry, known: Known, planned: list[Move], number: int) -> list[Move]:
    rng = rng_for(quarry.seed, Stream.HUNT, number)
    moves = downhill(known, known.paying("downhill", DOWNHILL, rng=rng), rng=rng)
    moves += spreading(known, known.paying("spreading", SPREADING, rng=rng), rng=rng)
    gaps = Filling(quarry.space, known.seen, known.visibility)
    for move in [*planned, *moves]:
        gaps.plan(move.shares)
    seeds = [seed_of_clip(quarry.seed, number + i) for i in range(len(moves), ROUND)]
    moves += chasing(known, gaps, seeds[:CHASING], rng=rng)
    seeds = [seed_of_clip(quarry.seed, number + i) for i in range(len(moves), ROUND)]
    return moves + filling(gaps, seeds, rng=rng)
