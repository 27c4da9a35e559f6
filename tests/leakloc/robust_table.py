"""The robust method's table at the paper's settings: rows, bars, and what a row's clips give.

Clips are the trials, for the leaks of one clip are correlated: a clip succeeds when every observable leak in it is
found. A row's claim about clips: a method that succeeds at `p0` or better fails with probability ALPHA at most, one at
`p1` or worse passes with BETA at most; p0 is the bar on leaks to the power of the usual number of leaks in a clip.
"""

from dataclasses import dataclass, replace

import numpy as np

from leakloc import fuse_views, locate
from scenarios.leaks import resolved
from scenarios.scenario_file import read_scenario
from scenarios.score import score
from scenarios.simulate import simulate
from scenarios.statistics import clopper_pearson, fixed_size_plan

ALPHA, BETA = 1e-3, 0.05
FIRST_SEED = 1000
PANS_DEG = (-40.0, 0.0, 40.0)
UNTOLD = ("believed_rig.lamps=unknown", "believed_rig.pedestal=unknown")
LAMP_OFF_M, WALL_OFF = 0.1, 0.02  # how wrong a rig file's lamps and its wall (share of the radius) may be
FALSE_PER_CLIP = 0.1  # twice what is expected


@dataclass(frozen=True)
class Row:
    """One row: preset and changes; bars on observable leaks (rate) and on errors of found ones, m; claim on clips."""

    name: str
    preset: str
    changes: tuple[str, ...]
    rate: float
    mean_m: float
    worst_of_95_m: float
    p0: float
    p1: float

    @property
    def plan(self):
        return fixed_size_plan(self.p0, self.p1, ALPHA, BETA)


def separated(name, changes, *bars):
    return Row(name, "separated", tuple(changes), *bars)


ROWS = (
    separated("separated, L", ["gamma.dose_rate_gy_h=1.7"], 0.99, 0.02, 0.06, 0.97, 0.80),
    separated("separated, M", ["gamma.dose_rate_gy_h=3.3"], 0.99, 0.02, 0.06, 0.97, 0.80),
    separated("separated, H", [], 0.99, 0.02, 0.06, 0.97, 0.80),
    separated("3 frames", ["recording.n_frames=3"], 0.95, 0.05, 0.1, 0.86, 0.60),
    separated("5 x H", ["gamma.dose_rate_gy_h=50.0"], 0.98, 0.03, 0.06, 0.94, 0.75),
    separated("20 x H", ["gamma.dose_rate_gy_h=200.0"], 0.90, 0.03, 0.06, 0.73, 0.45),
    separated("lamps, wall untold", UNTOLD, 0.95, 0.03, 0.06, 0.86, 0.60),
    Row("tilted", "tilted_rig", (), 0.97, 0.03, 0.06, 0.91, 0.65),
    Row("near wall", "near_wall", (), 0.99, 0.02, 0.06, 0.97, 0.70),
    Row("two lamps", "two_lamps", (), 0.95, 0.03, 0.06, 0.86, 0.55),
    Row("wide view", "wide_view", (), 0.95, 0.03, 0.06, 0.86, 0.55),
    Row("five", "five", (), 0.95, 0.03, 0.08, 0.81, 0.50),
    Row("seven", "seven", (), 0.95, 0.03, 0.08, 0.77, 0.45),
)  # fmt: skip
PRINTED_ONLY = (Row("faint", "faint", (), 0.0, np.inf, np.inf, 0.9, 0.5),)


@dataclass(frozen=True)
class Counts:
    """Of a row's clips: how many, how many succeeded; (found, of) leaks observable, in view and all; false; errors."""

    clips: int
    succeeded: int
    observable: tuple[int, int]
    in_view: tuple[int, int]
    all: tuple[int, int]
    false: int
    errors_m: np.ndarray

    @property
    def rate(self):
        return self.observable[0] / max(self.observable[1], 1)

    @property
    def false_per_clip(self):
        return self.false / self.clips


def counted(scores):
    """Sum of the scores of clips."""
    scores = list(scores)

    def total(which):
        rates = [getattr(one, which) for one in scores]
        return sum(rate.found for rate in rates), sum(rate.of for rate in rates)

    return Counts(
        len(scores),
        sum(one.observable.found == one.observable.of for one in scores),
        total("observable"),
        total("in_view"),
        total("all"),
        sum(len(one.false) for one in scores),
        np.array([pair.error_m for one in scores for pair in one.pairs]),
    )


def scored(preset, changes, seed):
    clip = simulate(read_scenario(preset, list(changes), seed=seed))
    estimate = locate(clip.left, clip.right, clip.believed_rig)
    return score([(leak.x_m, leak.y_m) for leak in estimate.leaks], clip.truth).gated


def misled_rig(rig, seed):
    """The rig with its lamps LAMP_OFF_M off to a random side and its wall too near or too far in turn."""
    off = np.random.default_rng(seed).normal(size=3)
    lamps = rig.lamps + LAMP_OFF_M * np.append(off / np.linalg.norm(off), 0.0)
    return replace(rig, lamps=lamps, pedestal_radius=rig.pedestal_radius * (1 + WALL_OFF * (-1) ** seed))


def misled_counts(clips):
    """`separated` at H, with lamps and wall slightly wrong."""
    scores = []
    for seed in range(FIRST_SEED, FIRST_SEED + clips):
        clip = simulate(read_scenario("separated", [], seed=seed))
        estimate = locate(clip.left, clip.right, misled_rig(clip.believed_rig, seed))
        scores.append(score([(leak.x_m, leak.y_m) for leak in estimate.leaks], clip.truth).gated)
    return counted(scores)


def false_leaks(clips, changes, expected):
    """False leaks (len(expected), clips) of clips without leaks, at every setting of expected_false_leaks."""
    counts = np.empty((len(expected), clips), int)
    for column, seed in enumerate(range(FIRST_SEED, FIRST_SEED + clips)):
        clip = simulate(read_scenario("separated", ["layout.n_leaks=0", *changes], seed=seed))
        for row, rate in enumerate(expected):
            estimate = locate(clip.left, clip.right, clip.believed_rig, expected_false_leaks=rate)
            counts[row, column] = len(estimate.leaks)
    return counts


def row_counts(row, clips=None):
    return counted(
        scored(row.preset, row.changes, seed) for seed in range(FIRST_SEED, FIRST_SEED + (clips or row.plan.n))
    )


def crowded_counts():
    """The eight scenes of the paper's Table 1."""
    return counted(scored(f"crowded_{scene}", (), FIRST_SEED) for scene in range(1, 9))


def panned_counts(clips):
    """Found and in view of any of three pan angles, over clips; false leaks; errors in m."""
    found = seen = false = 0
    errors_m = []
    for seed in range(FIRST_SEED, FIRST_SEED + clips):
        base = resolved(read_scenario("separated", ["rig.position_m=[-2.2, 0, 0]", "layout.n_leaks=4"], seed=seed))
        estimates, in_view = [], set()
        for number, pan_deg in enumerate(PANS_DEG):
            rig, told = (
                table.model_copy(update={"yaw_deg": pan_deg}) for table in (base.rig, base.believed_rig)
            )  # fmt: skip
            clip = simulate(
                base.model_copy(update={"rig": rig, "believed_rig": told, "seed": 10 * seed + number})
            )  # fmt: skip
            estimates.append(locate(clip.left, clip.right, clip.believed_rig))
            in_view |= {leak.id for leak in clip.truth.leaks if leak.in_view}
        result = score([(leak.x_m, leak.y_m) for leak in fuse_views(estimates).leaks], clip.truth).gated
        seen += len(in_view)
        found += sum(pair.leak_id in in_view for pair in result.pairs)
        false += len(result.false)
        errors_m += [pair.error_m for pair in result.pairs]
    return found, seen, false, np.array(errors_m)


def line(name, counts, bars=""):
    """One printed line of the table."""
    low, high = clopper_pearson(counts.succeeded, counts.clips)
    errors = counts.errors_m
    pairs = "  ".join(f"{found:>3}/{of:<3}" for found, of in (counts.observable, counts.in_view, counts.all))
    middle = f"{errors.mean():.4f} {np.quantile(errors, 0.95):.4f}" if len(errors) else "     -      -"
    return (
        f"{name:<20}{pairs}  clips {counts.succeeded}/{counts.clips} ({low:.2f}-{high:.2f})  "
        f"false {counts.false_per_clip:.2f}  error {middle}  {bars}"
    )
