"""Planted failures: the robust method, blind in one range of one or two parameters, and weak beside it.

Each of ten is a callable that the bench takes, `planted_failures:planted_3`, and a stand-in for statistics over many
seeds: what came out is computed from the scene and its truth as if the method found everything else, without rendering.
"""

import math
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

import leakloc
from scenarios.build import true_rig
from scenarios.margins import REJECTED, Margins
from scenarios.observable import LEAST_SNR
from scenarios.scene_work import OK, LeakOutcome, MethodOutcome
from scenarios.space_file import read_space

SPACE = Path(__file__).with_name("planted.toml")
REACH_M = 2.3
"""Farthest leaks of the space."""

SPANS = {"baseline_m": (0.3, 0.7), "hfov_deg": (55.0, 90.0), "n_frames": (6.0, 24.0), "area": (0, 1), "azimuth": (0, 1)}
STEPS = {"baseline_m": 0.01, "hfov_deg": 1.0, "n_frames": 1.0}
SLOPE = 0.15
"""How far beside a range scores are lowered, in shares of a parameter's span: 6 cm, 5 deg, 3 frames, 0.35 m, 27 deg."""

AT_THE_EDGE = 1 / 3
"""Of a score, what is left at the edge of a range."""


@dataclass(frozen=True)
class Situation:
    """What an estimator can know of a leak that it found: the rig, the recording and the place."""

    baseline_m: float
    hfov_deg: float
    n_frames: int
    x_m: float
    y_m: float

    @property
    def area(self) -> float:
        """Share of the half disc's area that is nearer to its middle."""
        return (math.hypot(self.x_m, self.y_m) / REACH_M) ** 2

    @property
    def azimuth(self) -> float:
        """Share of the half circle from the right to the left."""
        return math.atan2(self.y_m, self.x_m) / math.pi + 0.5


@dataclass(frozen=True)
class Range:
    """Values of one parameter, both ends included."""

    parameter: str
    low: float
    high: float

    @property
    def share(self) -> float:
        """Share of all values of the parameter."""
        low, high = SPANS[self.parameter]
        step = STEPS.get(self.parameter, 0.0)
        return (self.high - self.low + step) / (high - low + step)

    def away(self, situation: Situation) -> float:
        """How far outside a situation is, in shares of the span; 0 inside."""
        value, (low, high) = getattr(situation, self.parameter), SPANS[self.parameter]
        return max(self.low - 1e-6 - value, value - self.high - 1e-6, 0.0) / (high - low)


@dataclass(frozen=True)
class Planted:
    """Where an estimator is blind, in words and numbers, and how far beside it scores are lowered (0: a cliff)."""

    words: str
    ranges: tuple[Range, ...]
    slope: float = SLOPE

    @property
    def share(self) -> float:
        """Share of the parameters' values that is blind."""
        return math.prod(one.share for one in self.ranges)

    def left_of_score(self, situation: Situation) -> float:
        """Return the share of a leak's score that is left: none in the range, all of it far outside."""
        away = max(one.away(situation) for one in self.ranges)
        if away <= 0.0:
            return 0.0
        return AT_THE_EDGE + (1.0 - AT_THE_EDGE) * away / self.slope if away < self.slope else 1.0

    def is_blind(self, situation: Situation) -> bool:
        return self.left_of_score(situation) == 0.0


PLANTED = (
    Planted("leak azimuth 44.6-45.0 deg right", (Range("azimuth", 0.25, 0.252),)),
    Planted("leak 1.618-1.626 m from the middle", (Range("area", 0.495, 0.50),)),
    Planted("baseline 0.55-0.56 m, field of view 60 deg", (Range("baseline_m", 0.55, 0.56), Range("hfov_deg", 60, 60))),
    Planted("baseline 0.30 m, 20 frames", (Range("baseline_m", 0.30, 0.30), Range("n_frames", 20, 20))),
    Planted("field of view 71 deg, 10 frames", (Range("hfov_deg", 71, 71), Range("n_frames", 10, 10))),
    Planted(
        "leak azimuth 22-27 deg left, 1.26-1.32 m from the middle",
        (Range("azimuth", 0.62, 0.65), Range("area", 0.30, 0.33)),
    ),
    Planted(
        "leak azimuth 45-49 deg right, baseline 0.62-0.63 m",
        (Range("azimuth", 0.23, 0.25), Range("baseline_m", 0.62, 0.63)),
    ),
    Planted("leak 0.73-0.80 m from the middle, 17 frames", (Range("area", 0.10, 0.12), Range("n_frames", 17, 17))),
    Planted(
        "leak 1.78-1.81 m from the middle, field of view 75-76 deg",
        (Range("area", 0.60, 0.62), Range("hfov_deg", 75, 76)),
    ),
    Planted("leak azimuth 14-18 deg right, 12 frames", (Range("azimuth", 0.40, 0.42), Range("n_frames", 12, 12))),
)
"""Each so rare that random scenes, as many as five minutes hold, meet some half of them."""

CLIFFS = tuple(replace(planted, slope=0.0) for planted in PLANTED)
"""The same ranges with nothing beside them: no margin tells of these."""

NOWHERE = Planted("nowhere", (Range("azimuth", -1.0, -1.0),), 0.0)


THRESHOLD = 4.5
"""Of the robust method, standard deviations; it depends a little on the size of the view."""


def space():
    return read_space(SPACE)


def situation_of(scenario, x_m, y_m):
    return Situation(scenario.rig.baseline_m, scenario.rig.hfov_deg, scenario.recording.n_frames, x_m, y_m)


def stands_in(planted, scenario, run):
    """Whether an observable leak of a run stands in a range."""
    return any(leak.observable and planted.is_blind(situation_of(scenario, leak.x_m, leak.y_m)) for leak in run.leaks)


def is_met(planted, scenario, run):
    """Whether a run shows the planted failure: an observable leak in its range was not found."""
    return any(
        leak.observable and leak.code != "found" and planted.is_blind(situation_of(scenario, leak.x_m, leak.y_m))
        for leak in run.leaks
    )


def stand_in(planted, scenario):
    """Outcome of a method that finds every observable leak, to the spot, but for the planted failure; not rendered.

    Observable is what lies in both views and, by a fit to 106 rendered leaks of this space, has an expected column
    signal of 5 standard deviations (the fit is good to a factor of 1.3; 41 % of the leaks were observable). Scores are
    a fit to 286 leaks that robust found there: its threshold of 4.5, and the logarithm scatters by 0.34.
    """
    rig = true_rig(scenario)
    leaks, strengths = [], []
    for number, leak in enumerate(scenario.leak):
        columns = [camera.project(np.array([leak.x_m, leak.y_m, 0.0]))[0] for camera in (rig.left, rig.right)]
        in_view = all(3.0 <= column <= scenario.rig.width_px - 4.0 for column in columns)
        snr = expected_snr(scenario, leak)
        observable = in_view and snr >= LEAST_SNR
        luck = np.random.default_rng([scenario.seed, number]).normal()
        score = math.exp(1.605 + 0.444 * math.log(snr) + 0.34 * luck)
        ratio = planted.left_of_score(situation_of(scenario, leak.x_m, leak.y_m)) * score / THRESHOLD
        code = "missed.low_signal" if not observable else "missed.unexplained" if ratio < 1.0 else "found"
        error_m = 0.0 if code == "found" else None
        if observable:
            strengths.append((number, (ratio - 1.0) / (ratio + 1.0) if code == "found" else REJECTED))
        leaks.append(LeakOutcome(number, leak.x_m, leak.y_m, in_view, observable, False, code, error_m, error_m))
    missing = min((margin for _, margin in strengths), default=math.nan)
    return MethodOutcome(
        "stand-in", OK, "", tuple(leaks), margins=Margins(missing, 1.0, 1.0, strengths=tuple(strengths))
    )


def expected_snr(scenario, leak):
    focal_px = scenario.rig.width_px / 2 / math.tan(math.radians(scenario.rig.hfov_deg / 2))
    return math.exp(
        3.897
        + 0.400 * math.log(focal_px / 228.0)
        - 1.310 * math.log((leak.x_m + 2.4) / 2.4)
        + 0.494 * math.log(scenario.recording.n_frames / 24.0)
        - 0.596 * math.log(1.0 + scenario.gamma.dose_rate_gy_h)
    )


def _blinded(planted, left, right, rig):
    found = leakloc.locate(left, right, rig)
    baseline_m = float(np.linalg.norm(rig.T))
    hfov_deg = math.degrees(2 * math.atan(rig.image_size[0] / 2 / rig.K1[0, 0]))

    def weakened(leak):
        situation = Situation(baseline_m, hfov_deg, len(left), leak.x_m, leak.y_m)
        return replace(leak, score=leak.score * planted.left_of_score(situation))

    threshold = found.diagnostics["threshold_sigmas"]
    seen = tuple(leak for leak in map(weakened, found.leaks) if leak.score >= threshold)
    return leakloc.Estimate(found.method, found.frame, seen, found.diagnostics)


# an estimator is named module:function, so each has a name of its own
planted_0 = partial(_blinded, PLANTED[0])
planted_1 = partial(_blinded, PLANTED[1])
planted_2 = partial(_blinded, PLANTED[2])
planted_3 = partial(_blinded, PLANTED[3])
planted_4 = partial(_blinded, PLANTED[4])
planted_5 = partial(_blinded, PLANTED[5])
planted_6 = partial(_blinded, PLANTED[6])
planted_7 = partial(_blinded, PLANTED[7])
planted_8 = partial(_blinded, PLANTED[8])
planted_9 = partial(_blinded, PLANTED[9])
cliff_0 = partial(_blinded, CLIFFS[0])
cliff_1 = partial(_blinded, CLIFFS[1])
cliff_2 = partial(_blinded, CLIFFS[2])
cliff_3 = partial(_blinded, CLIFFS[3])
cliff_4 = partial(_blinded, CLIFFS[4])
cliff_5 = partial(_blinded, CLIFFS[5])
cliff_6 = partial(_blinded, CLIFFS[6])
cliff_7 = partial(_blinded, CLIFFS[7])
cliff_8 = partial(_blinded, CLIFFS[8])
cliff_9 = partial(_blinded, CLIFFS[9])
