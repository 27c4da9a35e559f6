"""What became of each leak and each estimate, in codes that say why: assigned from the truth, not by the estimator."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from leakloc import Estimate, LeakEstimate, Rig
from scenarios.score import Score
from scenarios.truth import LeakTruth, Truth

COLUMN_TOLERANCE_PX = 3.0
TILT_DEG = 0.25
"""Tilt unknown to the estimator that can explain a wrong place: 1 px over half the paper's image is 0.2 deg."""

MISSED = {"out of view": "out_of_view", "occluded": "occluded", "too few": "occluded", "merged": "merged"}


@dataclass(frozen=True)
class Outcomes:
    """Code of every true leak, by id, and of every false estimate, by its number in the result."""

    leaks: dict[int, str]
    estimates: dict[int, str]


def outcomes(estimate: Estimate, truth: Truth, believed: Rig, scored: Score) -> Outcomes:
    """Codes: found; missed.* (out_of_view, occluded, merged, low_signal, unexplained); bad.* for a leak whose columns
    were found and yet not its place (tilt, wrong_match, depth); false.* for estimates (shadow, ghost, gamma).
    """
    found = {pair.leak_id for pair in scored.gated.pairs}
    strays = [estimate.leaks[i] for i in scored.gated.false]
    tilted = tilt_deg(truth, believed) > TILT_DEG
    leaks = {leak.id: "found" if leak.id in found else _code_of_missed(leak, strays, tilted) for leak in truth.leaks}
    return Outcomes(leaks, {i: _code_of_false(estimate.leaks[i], truth) for i in scored.gated.false})


def tilt_deg(truth: Truth, believed: Rig) -> float:
    """Angle between the vertical as a camera sees it and as it is believed to, the larger of both cameras, degrees.

    `believed` knows its place in the world.
    """
    assert believed.world_from_left is not None
    true = [np.array(camera.world_from_camera)[2, :3] for camera in (truth.rig.left, truth.rig.right)]
    left = believed.world_from_left[2, :3]
    sines = [np.linalg.norm(np.cross(up, told)) for up, told in zip(true, (left, believed.R @ left), strict=True)]
    return float(np.degrees(np.arcsin(np.minimum(sines, 1.0))).max())


def _code_of_missed(leak: LeakTruth, strays: Sequence[LeakEstimate], tilted: bool) -> str:  # noqa: FBT001 - a fact
    seen = [_near(stray.left_column_px, leak.left_column_px) for stray in strays]
    seen_right = [_near(stray.right_column_px, leak.right_column_px) for stray in strays]
    if any(left and right for left, right in zip(seen, seen_right, strict=True)):
        return "bad.tilt" if tilted else "bad.depth"
    if leak.observable and (any(seen) or any(seen_right)):
        return "bad.tilt" if tilted else "bad.wrong_match"
    if leak.observable:
        return "missed.unexplained"
    for words, code in MISSED.items():
        if (leak.reason or "").startswith(words):
            return f"missed.{code}"
    return "missed.low_signal"


def _code_of_false(stray: LeakEstimate, truth: Truth) -> str:
    sides = (("left", stray.left_column_px), ("right", stray.right_column_px))
    on_drop = [any(_near(column, _column(leak, side)) for leak in truth.leaks) for side, column in sides]
    on_shadow = [
        any(_near(column, shadow) for leak in truth.leaks for shadow in getattr(leak.shadow_columns_px, side))
        for side, column in sides
    ]
    if all(on_drop) and not any(on_shadow):
        return "false.ghost"
    if any(on_shadow):
        return "false.shadow"
    return "false.gamma"


def _column(leak: LeakTruth, side: str) -> float | None:
    return leak.left_column_px if side == "left" else leak.right_column_px


def _near(column_px: float, true_px: float | None) -> bool:
    return true_px is not None and math.isfinite(column_px) and abs(column_px - true_px) <= COLUMN_TOLERANCE_PX
