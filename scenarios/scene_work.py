"""The work of a campaign's worker: render one scene once, run every method on it, and say what came out."""

import faulthandler
import math
import os
import time
from dataclasses import dataclass

from scenarios.bench import metres_per_px
from scenarios.estimators import Answer, Broken, EstimatorError, EstimatorSpec, run_estimator
from scenarios.margins import BROKEN_DOWN, Margins, margins
from scenarios.outcome import outcomes
from scenarios.scenario import Scenario
from scenarios.score import Score, score
from scenarios.simulate import SimulatedClip, simulate
from scenarios.truth import LeakTruth, Truth
from scenarios.versions import versions

NEAR_WALL_M = 0.5
SHOWN_ERROR_CHARS = 300
OK = "ok"


@dataclass(frozen=True)
class SceneWork:
    """One scene to do."""

    number: int
    scenario: Scenario
    estimators: tuple[EstimatorSpec, ...]
    limit_s: float


def limit_s(base_s: float, estimator: EstimatorSpec) -> float:
    """How long a scene may take, s: the base for what is ours, and what a foreign estimator is allowed."""
    return base_s + (0.0 if estimator.kind == "method" else estimator.timeout_s)


@dataclass(frozen=True)
class LeakOutcome:
    """What became of one true leak: its code, and for a found one the error in m and in px of disparity.

    `paper_estimate` is the number of the estimate that the paper's rule gives to the leak, however far off it is.
    """

    leak: int
    x_m: float
    y_m: float
    in_view: bool
    observable: bool
    near_wall: bool
    code: str
    error_m: float | None
    error_px: float | None
    paper_estimate: int | None = None


@dataclass(frozen=True)
class MethodOutcome:
    """One run: "ok", or how the method or its worker broke down; leaks are none when the scene has no truth to tell.

    `estimates_m` are the places (x, y) of all leaks that the method told of, m.
    """

    method: str
    outcome: str
    detail: str = ""
    leaks: tuple[LeakOutcome, ...] = ()
    false_codes: tuple[str, ...] = ()
    seconds: float = math.nan
    estimates_m: tuple[tuple[float, float], ...] = ()
    margins: Margins = BROKEN_DOWN
    """How far from failing: what a hunt follows, and no store keeps."""


@dataclass(frozen=True)
class SceneOutcome:
    """All runs of a scene, in the order of its estimators."""

    number: int
    runs: tuple[MethodOutcome, ...]
    versions: str
    seconds: float = math.nan
    """Of rendering."""


def run_scene(work: SceneWork) -> SceneOutcome:
    """Render a scene and run all methods on it; a Python error in either is a crash, an outcome like others.

    Ends the process when that takes longer than the limit: nothing else stops a C library that hangs.
    """
    with open(os.devnull, "w") as nowhere:
        faulthandler.dump_traceback_later(work.limit_s, exit=True, file=nowhere)
        try:
            return outcome_of(work, threads=1)  # other scenes use the other cores, and threads cost a tenth
        finally:
            faulthandler.cancel_dump_traceback_later()


def broken_scene(work: SceneWork, outcome: str, detail: str) -> SceneOutcome:
    """Outcome of a scene whose worker died or whose clip could not be made, for all methods alike."""
    runs = tuple(MethodOutcome(spec.text, outcome, detail) for spec in work.estimators)
    return SceneOutcome(work.number, runs, versions())


def outcome_of(work: SceneWork, *, threads: int | None = None) -> SceneOutcome:
    """Like `run_scene`, without the watch over how long it takes: for a process that is not to be ended."""
    start_s = time.perf_counter()
    try:
        clip = simulate(work.scenario, threads=threads)
    except Exception as error:
        return broken_scene(work, "crash", _told(error))
    seconds = time.perf_counter() - start_s
    runs = tuple(_run(spec, clip) for spec in work.estimators)
    return SceneOutcome(work.number, runs, versions(), seconds)


def _run(spec: EstimatorSpec, clip: SimulatedClip) -> MethodOutcome:
    start_s = time.perf_counter()
    answer: Answer
    try:
        answer = run_estimator(spec, clip)
    except EstimatorError:
        raise  # it cannot be started at all: the user's mistake, no outcome
    except Exception as error:
        answer = Broken("crash", _told(error))
    seconds = time.perf_counter() - start_s
    if isinstance(answer, Broken):
        lost = tuple(_leak_outcome(leak, clip.truth, answer.code, Assigned()) for leak in clip.truth.leaks)
        return MethodOutcome(spec.text, answer.code, answer.detail, lost, seconds=seconds)
    places_m = tuple((float(leak.x_m), float(leak.y_m)) for leak in answer.leaks)
    scored = score(places_m, clip.truth)
    codes = outcomes(answer, clip.truth, clip.believed_rig, scored)
    leaks = tuple(
        _leak_outcome(leak, clip.truth, codes.leaks[leak.id], _assigned(scored, leak)) for leak in clip.truth.leaks
    )
    return MethodOutcome(
        spec.text,
        OK,
        "",
        leaks,
        tuple(codes.estimates.values()),
        seconds,
        places_m,
        margins(answer, clip.truth, scored),
    )


@dataclass(frozen=True)
class Assigned:
    """What both rules assign to a leak: the error within the gate, m, and the estimate without one."""

    error_m: float | None = None
    paper_estimate: int | None = None


def _assigned(scored: Score, leak: LeakTruth) -> Assigned:
    error_m = next((pair.error_m for pair in scored.gated.pairs if pair.leak_id == leak.id), None)
    estimate = next((pair.estimate for pair in scored.paper_rule.pairs if pair.leak_id == leak.id), None)
    return Assigned(error_m, estimate)


def _leak_outcome(leak: LeakTruth, truth: Truth, code: str, assigned: Assigned) -> LeakOutcome:
    wall_m = truth.rig.pedestal_radius_m - math.hypot(leak.x_m, leak.y_m)
    metres = metres_per_px(truth, leak)  # none in the cameras' own plane
    error_px = assigned.error_m / metres if assigned.error_m is not None and metres > 0.0 else None
    return LeakOutcome(
        *(leak.id, leak.x_m, leak.y_m, leak.in_view, leak.observable, wall_m < NEAR_WALL_M, code),
        *(assigned.error_m, error_px, assigned.paper_estimate),
    )


def _told(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"[:SHOWN_ERROR_CHARS]
