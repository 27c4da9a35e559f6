"""Signed margins: how far a clip is from a missed leak, a false one and an error beyond the bound; > 0 is right.

Every margin is (1 - r) / (1 + r) of a ratio r that is 1 where right turns to wrong, so it lies in [-1, 1], and twice
too much is as far from 0 as half of it. What an estimator does not say (a foreign one has no scores) is NaN, and the
outcome alone decides.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from leakloc import Estimate, PaperOptions
from scenarios.outcome import COLUMN_TOLERANCE_PX
from scenarios.score import GATE_DISPARITY_PX, GATE_M, Score, gate_m
from scenarios.truth import LeakTruth, Truth

SIDES = ("left", "right")

BOUND_OF_GATE = 0.5
"""An error is beyond the bound from half the gate on: max(0.15 m, 1.5 px of disparity)."""

REJECTED = -0.1
"""Margin of what is wrong by a hair: a leak seen strongly enough and yet not told of, a false one just told of."""

SHOULD_BE_RIGHT, SHOULD_BE_WRONG = 1.0, -1.0
"""Margins where an outcome is all that is known."""


@dataclass(frozen=True)
class Margins:
    """Of one clip: the least over observable leaks found or missed, over estimates told, and over errors.

    NaN: no leak is observable, or none of them is found. `errors` holds, by leak, the margin of each found one, and
    `strengths` of each observable one how far it is from being missed.
    """

    missing: float
    false: float
    error: float
    errors: tuple[tuple[int, float], ...] = ()
    strengths: tuple[tuple[int, float], ...] = ()

    @property
    def least(self) -> float:
        """The scene's margin; 1 where there is nothing to be wrong about."""
        known = [margin for margin in (self.missing, self.false, self.error) if not math.isnan(margin)]
        return min(known, default=SHOULD_BE_RIGHT)


BROKEN_DOWN = Margins(SHOULD_BE_WRONG, SHOULD_BE_WRONG, SHOULD_BE_WRONG)


def margins(estimate: Estimate, truth: Truth, scored: Score) -> Margins:
    """Return the margins of what an estimator made of a clip."""
    observable = {leak.id: leak for leak in truth.leaks if leak.observable}
    found = {pair.leak_id: pair for pair in scored.gated.pairs if pair.leak_id in observable}
    threshold = threshold_of(estimate)
    strengths = [
        _above(estimate.leaks[found[leak.id].estimate].score / threshold, SHOULD_BE_RIGHT)
        if leak.id in found
        else min(_above(_strength_near(estimate, leak) / threshold, SHOULD_BE_WRONG), REJECTED)
        for leak in observable.values()
    ]
    told = tuple(zip(observable, strengths, strict=True))
    false = [
        min(-_above(estimate.leaks[i].score / threshold, SHOULD_BE_RIGHT), REJECTED) for i in scored.gated.false
    ] or [SHOULD_BE_RIGHT]
    errors = tuple(
        (leak_id, _below(pair.error_m / bound_m(truth, observable[leak_id]))) for leak_id, pair in found.items()
    )
    return Margins(_least(strengths), min(false), _least([margin for _, margin in errors]), errors, told)


def bound_m(truth: Truth, leak: LeakTruth) -> float:
    """Largest error of a leak that is no failure: half the gate."""
    return BOUND_OF_GATE * gate_m(truth, leak.x_m, leak.y_m)


def bound_words() -> str:
    """Say what the bound is."""
    return f"max({BOUND_OF_GATE * GATE_M:g} m, {BOUND_OF_GATE * GATE_DISPARITY_PX:g} px of disparity)"


def threshold_of(estimate: Estimate) -> float:
    """Score at which a method tells of a leak; NaN where it does not say so."""
    if estimate.method == "paper":
        return PaperOptions().k_sigma
    threshold = _number(estimate.diagnostics.get("threshold_sigmas"))
    return threshold if threshold > 0.0 else math.nan


def _strength_near(estimate: Estimate, leak: LeakTruth) -> float:
    """What a method saw at the columns of a leak that it does not tell of, in units of its scores; NaN if unknown."""
    if estimate.method == "paper":
        return min(_peak_sigmas(estimate, side, leak) for side in SIDES)
    return max((sigmas for sigmas in _lines_near(estimate, leak)), default=math.nan)


def _lines_near(estimate: Estimate, leak: LeakTruth) -> Iterator[float]:
    lines = estimate.diagnostics.get("lines")
    for line in map(_table, lines if isinstance(lines, list | tuple) else ()):
        columns = [(_number(line.get(f"{side}_column_px")), getattr(leak, f"{side}_column_px")) for side in SIDES]
        if all(true is not None and abs(seen - true) <= COLUMN_TOLERANCE_PX for seen, true in columns):
            yield _number(line.get("sigmas"))


def _peak_sigmas(estimate: Estimate, side: str, leak: LeakTruth) -> float:
    """Highest column aggregate near a leak in standard deviations above the mean, as Algorithm 1 has it."""
    column = getattr(leak, f"{side}_column_px")
    told = _table(estimate.diagnostics.get(side)).get("profile_grey")
    profile = np.array([_number(value) for value in told] if isinstance(told, list | tuple | np.ndarray) else [])
    if column is None or not len(profile) or not profile.std() > 0.0:
        return math.nan
    first, last = (max(round(column + way * COLUMN_TOLERANCE_PX), 0) for way in (-1, 1))
    near = profile[first : last + 1]
    return float((near.max() - profile.mean()) / profile.std()) if len(near) else math.nan


def _table(value: Any) -> Mapping[str, Any]:
    """What a foreign estimator says where ours says a mapping: it owes us none."""
    return value if isinstance(value, Mapping) else {}


def _number(value: Any) -> float:
    """The same where ours says a number: NaN."""
    try:
        number = float(value) if isinstance(value, int | float | np.number) else math.nan
    except OverflowError:
        return math.nan
    return number if math.isfinite(number) else math.nan


def _above(ratio: float, otherwise: float) -> float:
    """Margin of a ratio that ought to be large."""
    if math.isnan(ratio):
        return otherwise
    return 1.0 - 2.0 / (ratio + 1.0) if ratio > 0.0 else SHOULD_BE_WRONG  # of an infinite one, too


def _below(ratio: float) -> float:
    """Margin of a ratio that ought to be small."""
    return (1.0 - ratio) / (1.0 + ratio)


def _least(values: list[float]) -> float:
    return min(values, default=math.nan)
