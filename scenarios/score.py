"""Score estimates against the truth: one-to-one assignment, errors of found leaks, and rates that say of which leaks.

The gate is that of the contract, max(0.3 m, 3 px of disparity); the paper's own rule, which has no gate, is beside it.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from leakloc import ResultError, read_result
from scenarios.truth import Truth

GATE_M = 0.3
GATE_DISPARITY_PX = 3.0
FAR_M = 1e6
"""Cost of a pair beyond the gate: more than all pairs within can add up to, so the gate decides before distance."""


@dataclass(frozen=True)
class Pair:
    """A true leak and the estimate assigned to it."""

    leak_id: int
    estimate: int
    error_m: float


@dataclass(frozen=True)
class Rate:
    """Found leaks out of those that count."""

    found: int
    of: int


@dataclass(frozen=True)
class Assignment:
    """Result of one assignment rule; errors are over found leaks, NaN when there are none."""

    pairs: tuple[Pair, ...]
    missed: tuple[int, ...]
    false: tuple[int, ...]
    all: Rate
    in_view: Rate
    observable: Rate
    mean_error_m: float
    worst_error_m: float
    mean_error_percent_of_diameter: float


@dataclass(frozen=True)
class Score:
    """A clip's score by the contract's rule (gated) and by the paper's (no gate)."""

    gated: Assignment
    paper_rule: Assignment


def score(estimates_m: Sequence[tuple[float, float]], truth: Truth) -> Score:
    """Score (x, y) estimates in world metres; an estimate that is not finite is a false one."""
    leaks_m = np.array([(leak.x_m, leak.y_m) for leak in truth.leaks], dtype=float).reshape(-1, 2)
    estimated_m = np.array(estimates_m, dtype=float).reshape(-1, 2)
    with np.errstate(over="ignore", invalid="ignore"):  # a result may say 1e308
        distance_m = np.linalg.norm(leaks_m[:, None] - estimated_m[None], axis=-1)
    distance_m[~np.isfinite(distance_m)] = np.inf
    gates_m = np.array([gate_m(truth, leak.x_m, leak.y_m) for leak in truth.leaks])
    return Score(
        gated=_assign(np.where(distance_m <= gates_m[:, None], distance_m, np.inf), truth),
        paper_rule=_assign(distance_m, truth),
    )


def world_positions(path: Path) -> list[tuple[float, float]]:
    """Return the (x, y) of the leaks of a result file, m; raises ResultError unless they are in the world frame."""
    estimate = read_result(path)
    if estimate.frame != "world":
        raise ResultError(f"{path}: frame must be 'world' to be compared with the truth, got {estimate.frame!r}")
    return [(leak.x_m, leak.y_m) for leak in estimate.leaks]


def gate_m(truth: Truth, x_m: float, y_m: float) -> float:
    """Largest error that still counts as found: max(0.3 m, 3 Z^2 / (f B)), Z the depth before the left camera."""
    camera = truth.rig.left
    pose = np.array(camera.world_from_camera)
    depth_m = float((np.array([x_m, y_m, 0.0]) - pose[:3, 3]) @ pose[:3, 2])
    return max(GATE_M, GATE_DISPARITY_PX * depth_m**2 / (camera.camera_matrix[0][0] * truth.rig.baseline_m))


def _assign(distance_m: np.ndarray, truth: Truth) -> Assignment:
    """Assign at minimum total distance; infinite distances never pair."""
    rows, columns = linear_sum_assignment(np.minimum(distance_m, FAR_M))
    pairs = tuple(
        Pair(truth.leaks[row].id, int(column), float(distance_m[row, column]))
        for row, column in zip(rows, columns, strict=True)
        if math.isfinite(distance_m[row, column])
    )
    found = {pair.leak_id for pair in pairs}
    used = {pair.estimate for pair in pairs}
    errors_m = np.array([pair.error_m for pair in pairs])
    mean_m, worst_m = (errors_m.mean(), errors_m.max()) if pairs else (math.nan, math.nan)
    return Assignment(
        pairs=pairs,
        missed=tuple(leak.id for leak in truth.leaks if leak.id not in found),
        false=tuple(i for i in range(distance_m.shape[1]) if i not in used),
        all=_rate(found, [leak.id for leak in truth.leaks]),
        in_view=_rate(found, [leak.id for leak in truth.leaks if leak.in_view]),
        observable=_rate(found, [leak.id for leak in truth.leaks if leak.observable]),
        mean_error_m=float(mean_m),
        worst_error_m=float(worst_m),
        mean_error_percent_of_diameter=float(100.0 * mean_m / (2.0 * truth.rig.pedestal_radius_m)),
    )


def _rate(found: set[int], counted: list[int]) -> Rate:
    return Rate(sum(leak in found for leak in counted), len(counted))


def as_json(result: Score) -> dict[str, Any]:
    """Return the score as plain data; undefined is null."""
    return {rule: nulled(asdict(getattr(result, rule))) for rule in ("gated", "paper_rule")}


def nulled(value: Any) -> Any:
    """Return plain data with every number that is not finite as None: undefined is null."""
    if isinstance(value, dict):
        return {key: nulled(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [nulled(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def table(result: Score, truth: Truth) -> str:
    """Return the score as a text table for people: a row per leak, then the rates, never one without the others."""
    pair_of = {pair.leak_id: pair for pair in result.gated.pairs}
    lines = [f"{'leak':>4}  {'x_m':>7} {'y_m':>7}  {'error_m':>8}  verdict"]
    for leak in truth.leaks:
        pair = pair_of.get(leak.id)
        error = f"{pair.error_m:8.3f}" if pair else f"{'-':>8}"
        seen = "observable" if leak.observable else f"not observable: {leak.reason}"
        lines.append(
            f"{leak.id:>4}  {leak.x_m:7.3f} {leak.y_m:7.3f}  {error}  {'found' if pair else 'missed'} ({seen})"
        )
    lines.append("")
    for name, rule in (("gated", result.gated), ("paper's rule", result.paper_rule)):
        rates = ", ".join(
            f"{rate.found}/{rate.of} {which}"
            for which, rate in (("all", rule.all), ("in view", rule.in_view), ("observable", rule.observable))
        )
        error = "-" if math.isnan(rule.mean_error_m) else f"{rule.mean_error_m:.3f} m"
        percent = "" if math.isnan(rule.mean_error_m) else f" ({rule.mean_error_percent_of_diameter:.1f} % of diameter)"
        lines.append(f"{name + ':':<13} found {rates}; {len(rule.false)} false; mean error {error}{percent}")
    return "\n".join(lines)
