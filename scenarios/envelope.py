"""The envelope of an estimator: the largest box of parameters in which it is shown to find what can be found.

Success of a clip: every observable leak is found, each within the bound of half the gate. A clip without such a leak is
no trial. *Shown* means: the rate of success over the box, its clips drawn uniformly, is at least 0.95 with 95 %
confidence.

Why the confidence holds: the boxes are chosen on one set of clips and tested on others, drawn afresh and independently
inside each box, so choosing does not bias the tests. Each test is exact (Clopper-Pearson, one-sided, at a number of
trials fixed beforehand, clips as trials). The boxes are nested and tested from the smallest to the largest until the
first that is not shown; in such a fixed sequence every test may use the whole 5 %, and the chance that any box is
called shown whose rate is below 0.95 is at most 5 % (Maurer, Hothorn and Lehmacher 1995; a closed test procedure,
Marcus, Peritz and Gabriel, Biometrika 63, 1976): for the first such box of the sequence has to be passed wrongly.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from scenarios.draws import Stream, rng_for, seed_of_clip
from scenarios.estimators import EstimatorSpec
from scenarios.failures import failures
from scenarios.lanes import Evaluate
from scenarios.rules import violations
from scenarios.scene_work import MethodOutcome, SceneWork, limit_s
from scenarios.space import Space, sample_at
from scenarios.statistics import clopper_pearson

LEAST_RATE, CONFIDENCE = 0.95, 0.95
MOST_BOXES = 3
HOPEFUL = 0.9
"""Boxes with a smaller share of successes among the clips that they are chosen on are not worth a test."""

BATCH = 8
SCENE_LIMIT_S = 120.0
MAX_DRAWS_PER_TRIAL = 20
MAX_POINTS_PER_TRIAL = 10 * MAX_DRAWS_PER_TRIAL


class NoTrialsError(ValueError):
    """A space in which hardly any clip has an observable leak: nothing can be shown of it."""


@dataclass(frozen=True)
class Box:
    """First and last grid value of every axis and, last, of the number of leaks, counted from the range's low end."""

    first: tuple[int, ...]
    last: tuple[int, ...]

    def holds(self, values: np.ndarray) -> np.ndarray:
        """Which of (n, axes) grid values are inside, (n,)."""
        return np.asarray(((values >= self.first) & (values <= self.last)).all(axis=1))

    @property
    def log_volume(self) -> float:
        """Logarithm of the number of grid points."""
        return float(np.log(np.subtract(self.last, self.first) + 1.0).sum())


@dataclass(frozen=True)
class Test:
    """A box, the clips drawn inside it for its test, and whether it is shown; false leaks are told, not tested."""

    box: Box
    n: int
    k: int
    planned: int
    n_false: int

    @property
    def lower(self) -> float:
        """Lower end of the one-sided interval of 95 %."""
        return clopper_pearson(self.k, self.n, 2.0 * CONFIDENCE - 1.0)[0]

    @property
    def is_shown(self) -> bool:
        """Whether the rate is shown; a test that was broken off, for it could not succeed any more, is not."""
        return self.n == self.planned and self.lower >= LEAST_RATE


@dataclass(frozen=True)
class Quest:
    """What an envelope is sought for, on how many clips the boxes are chosen, and on how many trials each is tested."""

    space: Space
    estimator: EstimatorSpec
    seed: int
    n_explored: int
    n_trials: int


@dataclass(frozen=True)
class Envelope:
    """The tests, from the smallest box to the largest that was tried."""

    quest: Quest
    n_explored: int
    tests: tuple[Test, ...]

    @property
    def shown(self) -> Test | None:
        """Test of the largest box that is shown, or None."""
        return next((test for test in reversed(self.tests) if test.is_shown), None)


def envelope(quest: Quest, evaluate: Evaluate, tell: Callable[[int], object]) -> Envelope:
    """Choose boxes on one set of clips, test them on others; `tell` is told how many clips are done."""
    values, right = _explored(quest, evaluate, tell)
    tests: list[Test] = []
    for number, box in enumerate(nested_boxes(grid_sizes(quest.space), values, right)):
        tests.append(tested(quest, box, number, evaluate, tell))
        if not tests[-1].is_shown:
            break
    return Envelope(quest, len(right), tuple(tests))


def grid_sizes(space: Space) -> list[int]:
    """How many values every axis, and last the number of leaks, can take."""
    return [axis.n_values for axis in space.axes] + [max(space.max_leaks, 1)]


def nested_boxes(sizes: Sequence[int], values: np.ndarray, right: np.ndarray) -> list[Box]:
    """Boxes to test, the smallest first, each inside the next, chosen on grid values (n, axes) and their success (n,).

    From the whole space slices are peeled off, each the one with most failures for the volume it costs, until none is
    left inside (Friedman and Fisher, Statistics and Computing 9, 1999: the patient rule induction method).
    """
    box = Box((0,) * len(sizes), tuple(size - 1 for size in sizes))
    peeled = [box]
    while (cut := _best_cut(box, values[box.holds(values)], right[box.holds(values)])) is not None:
        box = cut
        peeled.append(box)
    hopeful = [one for one in peeled if _share_right(one, values, right) >= HOPEFUL] or [peeled[-1]]
    wanted = np.unique(np.linspace(0, len(hopeful) - 1, MOST_BOXES).round().astype(int))
    return [hopeful[i] for i in reversed(wanted)]


def tested(quest: Quest, box: Box, number: int, evaluate: Evaluate, tell: Callable[[int], object]) -> Test:
    """Draw clips uniformly inside a box until there are as many trials as planned, or too many have failed.

    Raises NoTrialsError where hardly any clip is a trial.
    """
    allowed = allowed_failures(quest.n_trials)
    rng = rng_for(quest.seed, Stream.ENVELOPE, 1 + number)
    n = k = n_false = n_drawn = n_tried = 0
    while n < quest.n_trials and n - k <= allowed:
        if n_drawn >= MAX_DRAWS_PER_TRIAL * quest.n_trials:
            raise NoTrialsError(f"{quest.space.name}: only {n} of {n_drawn} clips have an observable leak")
        if n_tried >= MAX_POINTS_PER_TRIAL * quest.n_trials:  # points that are no scenes make no clips to count
            raise NoTrialsError(f"{quest.space.name}: only {n_drawn} of {n_tried} points of a box break no rule")
        n_tried += BATCH
        works = _works(quest, _uniform(quest, box, rng=rng), seed_of_clip(quest.seed, 10**6 * (1 + number) + n_drawn))
        n_drawn += len(works)
        for run in evaluate(works):
            if is_trial(run) and n < quest.n_trials and n - k <= allowed:
                n, k, n_false = n + 1, k + is_success(run), n_false + len(run.false_codes)
        tell(len(works))
    return Test(box, n, k, quest.n_trials, n_false)


def allowed_failures(n: int) -> int:
    """Most failures of n trials with which the rate is still shown; -1 where n is too small for any."""
    lowers = (clopper_pearson(n - c, n, 2.0 * CONFIDENCE - 1.0)[0] for c in range(n + 1))
    return next(c for c, lower in enumerate(lowers) if lower < LEAST_RATE) - 1


def is_trial(run: MethodOutcome) -> bool:
    """Whether a clip can succeed or fail: it has an observable leak, or nobody knows for all broke down."""
    return not run.leaks or any(leak.observable for leak in run.leaks)


def is_success(run: MethodOutcome) -> bool:
    """Whether every observable leak is found within the bound; false leaks are another matter."""
    return all(failure.code.startswith("false") for failure in failures(run))


def _explored(quest: Quest, evaluate: Evaluate, tell: Callable[[int], object]) -> tuple[np.ndarray, np.ndarray]:
    """Grid values (trials, axes) and success (trials,) of quasi-random clips all over the space."""
    from scipy.stats import qmc  # half a second of imports that most commands do not need

    rng = rng_for(quest.seed, Stream.ENVELOPE, 0)
    points = qmc.Halton(len(grid_sizes(quest.space)), rng=rng).random(quest.n_explored)
    values, right = [], []
    for begin in range(0, len(points), BATCH):
        batch = [point for point in points[begin : begin + BATCH] if _is_valid(quest.space, point)]
        runs = evaluate(_works(quest, batch, seed_of_clip(quest.seed, begin)))
        for point, run in zip(batch, runs, strict=True):
            if is_trial(run):
                values.append([int(share * size) for share, size in zip(point, grid_sizes(quest.space), strict=True)])
                right.append(is_success(run))
        tell(len(batch))
    if not right:
        raise NoTrialsError(f"{quest.space.name}: none of {quest.n_explored} clips has an observable leak")
    return np.array(values), np.array(right)


def _uniform(quest: Quest, box: Box, *, rng: np.random.Generator) -> list[np.ndarray]:
    """Points drawn uniformly from a box's grid; those that break a rule between values are no part of the space."""
    sizes = np.array(grid_sizes(quest.space))
    points = (rng.integers(box.first, np.array(box.last) + 1, (BATCH, len(sizes))) + 0.5) / sizes
    return [point for point in points if _is_valid(quest.space, point)]


def _works(quest: Quest, points: Sequence[np.ndarray], seed: int) -> list[SceneWork]:
    return [
        SceneWork(
            i,
            sample_at(quest.space, point.tolist(), seed_of_clip(seed, i)),
            (quest.estimator,),
            limit_s(SCENE_LIMIT_S, quest.estimator),
        )
        for i, point in enumerate(points)
    ]


def _is_valid(space: Space, point: np.ndarray) -> bool:
    return not violations(sample_at(space, point.tolist(), 0))


def _best_cut(box: Box, values: np.ndarray, right: np.ndarray) -> Box | None:
    """Return the box without the slice that holds most failures for its volume; None when none is left to cut off."""
    if right.all():
        return None
    cuts = []
    for cut in _cuts(box, values[~right]):
        removed = int((~right & ~cut.holds(values)).sum())
        if removed:
            cuts.append((removed / (box.log_volume - cut.log_volume), cut))
    return max(cuts, key=lambda pair: pair[0])[1] if cuts else None


def _cuts(box: Box, wrong: np.ndarray) -> Iterator[Box]:
    """Slices that end beside a failure, of grid values (n, axes): others cost more and remove no more of them.

    An axis may have a million values; the failures are at most as many as the clips.
    """
    for axis in range(len(box.first)):
        ends = np.unique([wrong[:, axis] - 1, wrong[:, axis]])
        for value in ends[(ends >= box.first[axis]) & (ends < box.last[axis])].tolist():
            yield Box(box.first, (*box.last[:axis], value, *box.last[axis + 1 :]))
            yield Box((*box.first[:axis], value + 1, *box.first[axis + 1 :]), box.last)


def _share_right(box: Box, values: np.ndarray, right: np.ndarray) -> float:
    inside = right[box.holds(values)]
    return (inside.sum() + 1.0) / (len(inside) + 1.0)
