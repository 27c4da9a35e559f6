"""Several views of one place: the rig turned on its base, and the leaks of all views on one map.

The paper's only missed leaks of the separated set lay outside its one view.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from leakloc.estimate import Estimate, LeakEstimate
from leakloc.rig import Rig

Array = NDArray[np.float64]

GATE_CHI2 = 13.8  # chi-squared of 2 degrees of freedom that 0.1 % of the pairs of one leak exceed
FLOOR_M = 0.02  # of disagreement between views beside their covariances: a pan angle wrong by 0.25 deg, seen 4.9 m away
GATE_M = 0.3  # where a covariance is undefined; the smallest gate that estimates are scored with


def panned(rig: Rig, pan_deg: float) -> Rig:
    """The rig turned on its base about the vertical through the middle of its baseline; + turns left.

    Positions got with it are in the frame of `rig` itself: the world, or without `world_from_left` the level frame of
    the left camera before the turn, which the result then holds as its `world_from_left` whatever the angle, without
    lamps and wall. Lamps stay where they are. Raises ValueError if the angle is not finite.
    """
    if not np.isfinite(pan_deg):
        raise ValueError(f"panned: pan_deg must be finite, got {pan_deg}")
    left, right = (-pose[:3, :3].T @ pose[:3, 3] for pose in (rig.left_from_frame, rig.right_from_frame))
    middle = (left + right) / 2
    cos, sin = np.cos(np.radians(pan_deg)), np.sin(np.radians(pan_deg))
    turn = np.eye(4)
    turn[:2, :2] = [[cos, -sin], [sin, cos]]
    turn[:3, 3] = middle - turn[:3, :3] @ middle
    return replace(rig.of_known_place(), world_from_left=turn @ rig.frame_from_left)


@dataclass(frozen=True, eq=False)
class Sighting:
    """One leak of one view, by the view's number."""

    view: int
    leak: LeakEstimate

    @property
    def place_m(self) -> Array:
        """(x, y), m."""
        return np.array([self.leak.x_m, self.leak.y_m])

    @property
    def precision(self) -> Array | None:
        """Inverse of the covariance, 1/m2; None where that is undefined or no covariance."""
        covariance = np.asarray(self.leak.covariance_m2, dtype=np.float64)
        if not np.isfinite(covariance).all() or (np.linalg.eigvalsh(covariance) <= 0).any():
            return None
        return np.linalg.inv(covariance).astype(np.float64)

    @property
    def order(self) -> tuple[float, ...]:
        """A key that does not know the view's number: sums run in this order whatever the order of the views."""
        leak = self.leak
        numbers = (leak.x_m, leak.y_m, leak.score, leak.left_column_px, leak.right_column_px)
        return tuple(np.nan_to_num(numbers, nan=-np.inf).tolist())


def fuse_views(estimates: Sequence[Estimate]) -> Estimate:
    """The leaks of several views of one place on one map; one view is itself.

    Two leaks of different views are one where they agree: squared Mahalanobis distance, by both covariances and
    `FLOOR_M`, up to `GATE_CHI2`, or `GATE_M` where a covariance is undefined. The closest merge first, every two of a
    merged leak agree, and two leaks of one view never merge. Places are weighted by inverse covariances (undefined
    ones do not count beside defined ones; among themselves they count alike and stay undefined), covariances add as
    inverses, and all else, the columns too, is of the best view: the smallest covariance, else the highest score.
    Leaks are ordered by score. The order of the views does not matter.

    Diagnostics: `views` holds each view's own; `fused` for every leak the numbers `views` that saw it, the `best` of
    them, and `disagreement`, the largest distance between two of them over the gate (0 to 1; NaN of one view).
    Raises ValueError for no estimates, and for several frames or methods.
    """
    if not estimates:
        raise ValueError("fuse_views: at least one estimate must be given, got none")
    for name in ("frame", "method"):
        found = {getattr(estimate, name) for estimate in estimates}
        if len(found) > 1:
            raise ValueError(f"fuse_views: estimates must have one {name}, got {', '.join(sorted(found))}")
    if len(estimates) == 1:
        return estimates[0]
    sightings = [Sighting(view, leak) for view, estimate in enumerate(estimates) for leak in estimate.leaks]
    fused = [(_merged(group), _described(group)) for group in _groups(sorted(sightings, key=lambda s: s.order))]
    fused.sort(key=lambda pair: (-np.nan_to_num(pair[0].score, nan=-np.inf), pair[0].x_m, pair[0].y_m))
    diagnostics = {
        "views": [dict(estimate.diagnostics) for estimate in estimates],
        "fused": [description for _, description in fused],
    }
    return Estimate(estimates[0].method, estimates[0].frame, tuple(leak for leak, _ in fused), diagnostics)


def _groups(sightings: list[Sighting]) -> list[list[Sighting]]:
    """Sightings of one leak each: closest pairs first, as long as all of a group agree and no view is in it twice."""
    count = len(sightings)
    distance = np.full((count, count), np.inf)
    for a, b in combinations(range(count), 2):
        if sightings[a].view != sightings[b].view:
            distance[a, b] = distance[b, a] = _distance_over_gate(sightings[a], sightings[b])
    group_of = {index: [index] for index in range(count)}
    pairs = [(distance[a, b], a, b) for a, b in combinations(range(count), 2) if distance[a, b] <= 1]
    for _, a, b in sorted(pairs):
        ours, theirs = group_of[a], group_of[b]
        if ours is not theirs and distance[np.ix_(ours, theirs)].max() <= 1:
            ours += theirs
            for index in theirs:
                group_of[index] = ours
    unique = {id(group): group for group in group_of.values()}
    return [[sightings[index] for index in sorted(group)] for group in unique.values()]


def _distance_over_gate(a: Sighting, b: Sighting) -> float:
    apart_m = a.place_m - b.place_m
    if a.precision is None or b.precision is None:
        return float(np.hypot(*apart_m)) / GATE_M
    covariance = a.leak.covariance_m2 + b.leak.covariance_m2 + FLOOR_M**2 * np.eye(2)
    return float(np.sqrt(apart_m @ np.linalg.solve(covariance, apart_m) / GATE_CHI2))


def _merged(group: list[Sighting]) -> LeakEstimate:
    if len(group) == 1:
        return group[0].leak
    weighed = [(sighting.precision, sighting.place_m) for sighting in group if sighting.precision is not None]
    if weighed:
        covariance = np.linalg.inv(sum(precision for precision, _ in weighed)).astype(np.float64)
        place_m = covariance @ sum(precision @ place for precision, place in weighed)
    else:
        covariance, place_m = np.full((2, 2), np.nan), np.mean([sighting.place_m for sighting in group], axis=0)
    return replace(
        _best(group).leak,
        x_m=float(place_m[0]),
        y_m=float(place_m[1]),
        covariance_m2=covariance,
        score=float(np.fmax.reduce([sighting.leak.score for sighting in group])),
    )


def _best(group: list[Sighting]) -> Sighting:
    def worth(sighting: Sighting) -> tuple[float, float]:
        variance = np.inf if sighting.precision is None else float(np.trace(sighting.leak.covariance_m2))
        return -variance, float(np.nan_to_num(sighting.leak.score, nan=-np.inf))

    return max(group, key=worth)


def _described(group: list[Sighting]) -> dict[str, Any]:
    apart = [_distance_over_gate(a, b) for a, b in combinations(group, 2)]
    return {
        "views": sorted(sighting.view for sighting in group),
        "best": _best(group).view,
        "disagreement": max(apart) if apart else float("nan"),
    }
