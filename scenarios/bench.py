"""The bench: one suite of scenes, in three strata, for anybody's estimator; what it finds, what it misses, and why.

Clips are the trials, for the leaks of one clip are not independent: a clip is right when every observable leak is found
and nothing false is.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from scenarios.estimators import Broken, EstimatorSpec, run_estimator
from scenarios.outcome import outcomes
from scenarios.score import score
from scenarios.simulate import SimulatedClip, simulate
from scenarios.space import STRATA, scene_of
from scenarios.statistics import binomial_tail, clopper_pearson
from scenarios.truth import LeakTruth, Truth
from scenarios.workers import all_done, in_order

WORSE_ALPHA = 0.05


@dataclass(frozen=True)
class Trial:
    """One clip: counts, codes and errors.

    `errors_m` are those of observable leaks found, `disparity_errors_px` the same over Z^2/(fB).
    """

    stratum: str
    number: int
    right: bool
    found: dict[str, int]
    of: dict[str, int]
    false: int
    codes: tuple[str, ...]
    disparity_errors_px: tuple[float, ...]
    detail: str = ""
    errors_m: tuple[float, ...] = ()


@dataclass(frozen=True)
class Work:
    """One clip to do."""

    estimator: EstimatorSpec
    stratum: str
    number: int
    seed: int


def run_bench(estimator: EstimatorSpec, n_scenes: int, seed: int, n_workers: int) -> Iterator[Trial]:
    """Yield a trial per scene, `n_scenes` of each stratum; the same trials whatever the number of workers."""
    work = [Work(estimator, space.name, i, seed) for space in STRATA for i in range(n_scenes)]
    yield from in_order(all_done(run_trial, work, n_workers))


def run_trial(work: Work) -> Trial:
    """Simulate one scene, run the estimator on it and say what came out."""
    return trial_on(simulate(scene_of(work.stratum, work.number, work.seed)), work)


def trial_on(clip: SimulatedClip, work: Work) -> Trial:
    """Run the estimator on the clip of its scene, rendered before, and say what came out."""
    answer = run_estimator(work.estimator, clip)
    of = {which: sum(counts(leak) for leak in clip.truth.leaks) for which, counts in COUNTED.items()}
    if isinstance(answer, Broken):
        nothing = dict.fromkeys(of, 0)
        return Trial(
            stratum=work.stratum,
            number=work.number,
            right=False,
            found=nothing,
            of=of,
            false=0,
            codes=(answer.code,),
            disparity_errors_px=(),
            detail=answer.detail,
        )
    scored = score([(leak.x_m, leak.y_m) for leak in answer.leaks], clip.truth)
    gated, codes = scored.gated, outcomes(answer, clip.truth, clip.believed_rig, scored)
    observable = {leak.id: leak for leak in clip.truth.leaks if leak.observable}
    counted = [pair for pair in gated.pairs if pair.leak_id in observable]
    errors_px = tuple(pair.error_m / metres_per_px(clip.truth, observable[pair.leak_id]) for pair in counted)
    return Trial(
        work.stratum,
        work.number,
        gated.observable.found == gated.observable.of and not gated.false,
        {"all": gated.all.found, "in_view": gated.in_view.found, "observable": gated.observable.found},
        of,
        len(gated.false),
        (*codes.leaks.values(), *codes.estimates.values()),
        errors_px,
        errors_m=tuple(pair.error_m for pair in counted),
    )


COUNTED = {
    "all": lambda _: True,
    "in_view": lambda leak: leak.in_view,
    "observable": lambda leak: leak.observable,
}


def metres_per_px(truth: Truth, leak: LeakTruth) -> float:
    """Depth error per pixel of disparity at a leak, Z^2 / (f B)."""
    camera = truth.rig.left
    pose = np.array(camera.world_from_camera)
    depth_m = float((np.array([leak.x_m, leak.y_m, 0.0]) - pose[:3, 3]) @ pose[:3, 2])
    return depth_m**2 / (camera.camera_matrix[0][0] * truth.rig.baseline_m)


def summary(trials: list[Trial]) -> dict[str, Any]:
    """Summarise each stratum: clips right with interval, rates over leaks, false per clip, errors, codes."""
    return {space.name: _stratum_summary([t for t in trials if t.stratum == space.name]) for space in STRATA}


def _stratum_summary(trials: list[Trial]) -> dict[str, Any]:
    n_right = sum(trial.right for trial in trials)
    errors_px = [error for trial in trials for error in trial.disparity_errors_px]
    return {
        "clips": len(trials),
        "clips_right": n_right,
        "interval_95": list(clopper_pearson(n_right, len(trials))),
        "leaks": {
            which: {"found": sum(t.found[which] for t in trials), "of": sum(t.of[which] for t in trials)}
            for which in COUNTED
        },
        "false_per_clip": sum(trial.false for trial in trials) / max(len(trials), 1),
        "median_error_px": float(np.median(errors_px)) if errors_px else None,
        "error_95_px": float(np.quantile(errors_px, 0.95)) if errors_px else None,
        "codes": dict(sorted(Counter(code for trial in trials for code in trial.codes).items())),
    }


def as_json(trials: list[Trial], estimator: EstimatorSpec, seed: int) -> dict[str, Any]:
    """Return the result of a run as plain data, every trial included: it serves as a baseline of later runs."""
    return {
        "estimator": {"kind": estimator.kind, "text": estimator.text},
        "seed": seed,
        "summary": summary(trials),
        "trials": [asdict(trial) for trial in trials],
    }


def table(trials: list[Trial]) -> str:
    """Return the summary as a text table, and the codes of what went wrong."""
    lines = [
        f"{'stratum':<8} {'clips right':>12} {'95 % interval':>15} {'observable':>11} {'in view':>9} {'all':>9} "
        f"{'false/clip':>10} {'median px':>9} {'95 % px':>8}"
    ]
    for name, row in summary(trials).items():
        low, high = row["interval_95"]
        rates = [
            f"{row['leaks'][which]['found']}/{row['leaks'][which]['of']}" for which in ("observable", "in_view", "all")
        ]
        errors = ["-" if row[key] is None else f"{row[key]:.2f}" for key in ("median_error_px", "error_95_px")]
        lines.append(
            f"{name:<8} {row['clips_right']:>6}/{row['clips']:<5} {low:>7.3f}-{high:.3f}  {rates[0]:>11} {rates[1]:>9} "
            f"{rates[2]:>9} {row['false_per_clip']:>10.2f} {errors[0]:>9} {errors[1]:>8}"
        )
    for name, row in summary(trials).items():
        wrong = ", ".join(f"{count} {code}" for code, count in row["codes"].items() if code != "found")
        lines.append(f"{name}: {wrong or 'nothing wrong'}")
    return "\n".join(lines)


def check_same_scenes(baseline: dict[str, Any], n_scenes: int, seed: int) -> None:
    """Raise ValueError when an earlier run is not of the scenes that a run of this size and seed will be of."""
    if {(row["stratum"], row["number"]) for row in baseline["trials"]} != {
        (space.name, number) for space in STRATA for number in range(n_scenes)
    }:
        raise ValueError("the baseline is a run of other scenes: run the bench with its --scenes")
    if baseline.get("seed") != seed:
        raise ValueError(f"the baseline is a run of other scenes: its seed is {baseline.get('seed')!r:.40}, not {seed}")


def worse_than(trials: list[Trial], baseline: dict[str, Any]) -> list[str]:
    """Say what got worse against an earlier run of the same scenes: exact McNemar test on the clips that changed."""
    before = {(row["stratum"], row["number"]): bool(row["right"]) for row in baseline["trials"]}
    after = {(trial.stratum, trial.number): trial.right for trial in trials}
    worse = []
    for space in STRATA:
        places = [place for place in after if place[0] == space.name]
        lost = [number for name, number in places if before[name, number] and not after[name, number]]
        won = [number for name, number in places if after[name, number] and not before[name, number]]
        changed = len(lost) + len(won)
        if changed and binomial_tail(len(lost), changed, 0.5) < WORSE_ALPHA:
            worse.append(f"{space.name}: {len(lost)} clips lost ({', '.join(map(str, lost[:10]))}), {len(won)} won")
    return worse
