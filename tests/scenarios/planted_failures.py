"""Ten planted failures: the robust method, blind in one range of one or two parameters, and otherwise as it is.

Each is a callable that the bench takes, `planted_failures:planted_3`, and a stand-in for statistics over many seeds:
what came out is computed from the scene and its truth as if the method found everything else, without rendering.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

import leakloc
from scenarios.build import true_rig
from scenarios.margins import Margins
from scenarios.observable import LEAST_SNR
from scenarios.scene_work import OK, LeakOutcome, MethodOutcome
from scenarios.space_file import read_space

SPACE = Path(__file__).with_name("planted.toml")
REACH_M = 2.3
"""Farthest leaks of the space."""


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
class Planted:
    """Where an estimator is blind, in words, and the share of the parameters' ranges that this takes."""

    words: str
    share: float
    is_blind: Callable[[Situation], bool]


def between(value: float, low: float, high: float) -> bool:
    return low - 1e-6 <= value <= high + 1e-6


PLANTED = (
    Planted("leak azimuth 44.7-45.0 deg right", 0.0015, lambda s: between(s.azimuth, 0.25, 0.2515)),
    Planted("leak 1.626-1.630 m from the middle", 0.002, lambda s: between(s.area, 0.500, 0.502)),
    Planted(
        "baseline 0.55-0.56 m, field of view 60-61 deg",
        2 / 41 * 2 / 36,
        lambda s: between(s.baseline_m, 0.55, 0.56) and between(s.hfov_deg, 60, 61),
    ),
    Planted(
        "baseline 0.30-0.31 m, 20 frames",
        2 / 41 * 1 / 19,
        lambda s: between(s.baseline_m, 0.30, 0.31) and s.n_frames == 20,
    ),
    Planted(
        "field of view 71-72 deg, 10 frames",
        2 / 36 * 1 / 19,
        lambda s: between(s.hfov_deg, 71, 72) and s.n_frames == 10,
    ),
    Planted(
        "leak azimuth 22-29 deg left, 1.26-1.34 m from the middle",
        0.04 * 0.04,
        lambda s: between(s.azimuth, 0.62, 0.66) and between(s.area, 0.30, 0.34),
    ),
    Planted(
        "leak azimuth 43-50 deg right, baseline 0.62-0.63 m",
        0.04 * 2 / 41,
        lambda s: between(s.azimuth, 0.22, 0.26) and between(s.baseline_m, 0.62, 0.63),
    ),
    Planted(
        "leak 0.73-0.83 m from the middle, 17 frames",
        0.03 * 1 / 19,
        lambda s: between(s.area, 0.10, 0.13) and s.n_frames == 17,
    ),
    Planted(
        "leak 1.92-1.98 m from the middle, field of view 57-58 deg",
        0.04 * 2 / 36,
        lambda s: between(s.area, 0.70, 0.74) and between(s.hfov_deg, 57, 58),
    ),
    Planted(
        "leak azimuth 13-18 deg right, 12 frames",
        0.03 * 1 / 19,
        lambda s: between(s.azimuth, 0.40, 0.43) and s.n_frames == 12,
    ),
)
"""Each so rare that random scenes, as many as five minutes hold, meet some two of three."""

NOWHERE = Planted("nowhere", 0.0, lambda _: False)


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

    A leak is found by the margin that its signal has, so that many scenes are close to missing one, as rendered ones
    are. Observable is what lies in both views and, by a fit to 106 rendered leaks of this space, has an expected column
    signal of 5 standard deviations (the fit is good to a factor of 1.3; 41 % of the leaks were observable).
    """
    rig = true_rig(scenario)
    leaks, margins = [], [1.0]
    for number, leak in enumerate(scenario.leak):
        columns = [camera.project(np.array([leak.x_m, leak.y_m, 0.0]))[0] for camera in (rig.left, rig.right)]
        in_view = all(3.0 <= column <= scenario.rig.width_px - 4.0 for column in columns)
        snr = expected_snr(scenario, leak)
        observable = in_view and snr >= LEAST_SNR
        blind = planted.is_blind(situation_of(scenario, leak.x_m, leak.y_m))
        code = "missed.low_signal" if not observable else "missed.unexplained" if blind else "found"
        error_m = 0.0 if code == "found" else None
        if observable:
            margins.append(1.0 - 2.0 / (snr / LEAST_SNR + 1.0) if code == "found" else -1.0)
        leaks.append(LeakOutcome(number, leak.x_m, leak.y_m, in_view, observable, False, code, error_m, error_m))
    return MethodOutcome("stand-in", OK, "", tuple(leaks), margins=Margins(min(margins), 1.0, 1.0))


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

    def is_seen(leak):
        return not planted.is_blind(Situation(baseline_m, hfov_deg, len(left), leak.x_m, leak.y_m))

    return leakloc.Estimate(found.method, found.frame, tuple(filter(is_seen, found.leaks)), found.diagnostics)


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
