"""Look for failures where they are: a quasi-random start, then down signed margins, into dips, and finer gaps filled.

Adaptive, so its scenes are counterexamples and no sample: `hunted.py` keeps rates from being made of them.
Deterministic from the seed and the number of scenes, whatever the number of workers: what a round tries follows from
the outcomes of the rounds before it alone.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from scenarios.atlas import Move, Tried
from scenarios.draws import Stream, rng_for, seed_of_clip
from scenarios.estimators import EstimatorSpec
from scenarios.filling import Filling
from scenarios.hunt_moves import Known, chasing, downhill, filling, spreading
from scenarios.lanes import Lanes
from scenarios.scene_time import scene_s
from scenarios.scene_work import MethodOutcome, SceneWork, limit_s
from scenarios.space import Space
from scenarios.space_point import n_shares, scenario_of

N_START = 32
ROUND = 12
DOWNHILL, SPREADING = 3, 2
"""Of a round, at most: as many as of the last ones showed something new."""

CHASING = 6
"""Of a round, at most. The rest fills gaps."""

SCENE_LIMIT_S = 120.0
Evaluate = Callable[[Sequence[SceneWork]], list[MethodOutcome]]
"""Renders scenes, runs the estimator and gives the outcomes in their order."""


@dataclass(frozen=True)
class Quarry:
    """What is hunted: failures of an estimator in a space, by a seed."""

    space: Space
    estimator: EstimatorSpec
    seed: int


def hunt(quarry: Quarry, evaluate: Evaluate, n_scenes: int | None = None) -> Iterator[list[Tried]]:
    """Yield round after round of scenes tried, without end or until there are `n_scenes`; an `Atlas` keeps failures.

    The first round is quasi-random (scrambled Sobol); in the others some scenes go downhill from the smallest margins,
    some look where leaks are found less strongly than they should be, some carry known failures into cells where their
    code was not seen, and the rest fill the gaps that are left. What brings nothing new makes room for filling: margins
    lead nowhere when failures are not at the end of a slope.
    """
    known, number = Known(quarry.space), 0
    while n_scenes is None or number < n_scenes:
        moves = _start(quarry) if not number else _next(quarry, known, number)
        moves = moves if n_scenes is None else moves[: n_scenes - number]
        scenarios = [scenario_of(quarry.space, move.shares, move.seed) for move in moves]
        works = [
            SceneWork(number + i, scenario, (quarry.estimator,), limit_s(SCENE_LIMIT_S, quarry.estimator))
            for i, scenario in enumerate(scenarios)
            if scenario is not None
        ]
        assert len(works) == len(moves)
        tried = [
            Tried(work.number, move, work.scenario, run)
            for move, work, run in zip(moves, works, evaluate(works), strict=True)
        ]
        for one in tried:
            known.add(one)
        number += len(tried)
        yield tried


def on_lanes(lanes: Lanes) -> Evaluate:
    """Return the evaluation of scenes on workers."""

    def evaluate(works: Sequence[SceneWork]) -> list[MethodOutcome]:
        longest_first = sorted(works, key=lambda work: -scene_s(work.scenario))  # no lane is idle for long at the end
        done = {outcome.number: outcome.runs[0] for outcome in lanes.done([[work] for work in longest_first])}
        return [done[work.number] for work in works]

    return evaluate


def _start(quarry: Quarry) -> list[Move]:
    from scipy.stats import qmc  # half a second of imports that most commands do not need

    rng = rng_for(quarry.seed, Stream.HUNT, 0)
    points = qmc.Sobol(n_shares(quarry.space), rng=rng).random(8 * N_START)
    valid = [point for point in points if scenario_of(quarry.space, point, 0) is not None]
    return [
        Move(tuple(map(float, point)), seed_of_clip(quarry.seed, i), "start") for i, point in enumerate(valid[:N_START])
    ]


def _next(quarry: Quarry, known: Known, number: int) -> list[Move]:
    rng = rng_for(quarry.seed, Stream.HUNT, number)
    moves = downhill(known, known.paying("downhill", DOWNHILL, rng=rng), rng=rng)
    moves += spreading(known, known.paying("spreading", SPREADING, rng=rng), rng=rng)
    gaps = Filling(quarry.space, known.seen, known.visibility)
    for move in moves:
        gaps.plan(move.shares)
    seeds = [seed_of_clip(quarry.seed, number + i) for i in range(len(moves), ROUND)]
    moves += chasing(known, gaps, seeds[:CHASING], rng=rng)
    seeds = [seed_of_clip(quarry.seed, number + i) for i in range(len(moves), ROUND)]
    return moves + filling(gaps, seeds, rng=rng)
