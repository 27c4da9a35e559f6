"""A point of a space: a share of every axis, of the number of leaks and of every leak's place; and its scenario.

Nothing of it is left to chance but when drops fall and what the noise is, so that a search may move it step by step.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenarios.rules import violations
from scenarios.scenario import LeakTable, Scenario
from scenarios.space import Space, drip_at, scenario_at

PLACES = ("leak range", "leak azimuth")
LEAKS = "leaks"
BELOW_ONE = math.nextafter(1.0, 0.0)


@dataclass(frozen=True)
class Place:
    """Where a leak stands, and which of the point's leaks it is: those too near to an earlier one are left out."""

    leak: int
    x_m: float
    y_m: float


def n_shares(space: Space) -> int:
    """Length of a point: the axes, the number of leaks, and a range and an azimuth for each of them."""
    return len(space.axes) + (1 + 2 * space.max_leaks if space.max_leaks else 0)


def n_leaks(space: Space, points: np.ndarray) -> NDArray[np.int_]:
    """Leaks that each of some points (..., shares) asks for, (...)."""
    return np.asarray(1 + np.minimum((points[..., len(space.axes)] * space.max_leaks).astype(int), space.max_leaks - 1))


def places(space: Space, shares: Sequence[float]) -> list[Place]:
    """Places of a point's leaks, uniform in the half disc x >= 0 when shares are; to the centimetre."""
    if space.max_leaks == 0:
        return []
    kept: list[Place] = []
    for leak in range(int(n_leaks(space, np.asarray(shares)))):
        along, around = _place_shares(space, shares, leak)
        range_m, azimuth = reach_m(space) * math.sqrt(along), math.pi * (around - 0.5)
        place = Place(leak, round(range_m * math.cos(azimuth), 2), round(range_m * math.sin(azimuth), 2))
        if all(math.hypot(place.x_m - p.x_m, place.y_m - p.y_m) >= space.min_separation_m for p in kept):
            kept.append(place)
    return kept


def values_at(space: Space, shares: Sequence[float]) -> dict[str, float]:
    """Value of every axis at a point."""
    return {axis.key: axis.at(share) for axis, share in zip(space.axes, shares, strict=False)}


def scenario_of(space: Space, shares: Sequence[float], seed: int) -> Scenario | None:
    """Return the scenario at a point; None where it breaks a rule between values, for it is then no point at all."""
    values = values_at(space, shares)
    scenario = scenario_at(space, values, seed)
    if space.max_leaks:
        drip = drip_at(space, values)
        leaks = tuple(LeakTable(x_m=place.x_m, y_m=place.y_m, **drip) for place in places(space, shares))
        scenario = scenario.model_copy(update={"leak": leaks})
    return None if violations(scenario) else scenario


def parameters(space: Space) -> list[str]:
    """Names of what one leak of a scene has tried: the axes, the number of leaks, and its place."""
    return [axis.key for axis in space.axes] + ([LEAKS, *PLACES] if space.max_leaks else [])


def n_values(space: Space) -> list[float]:
    """How many values each of the parameters can take."""
    of_leaks = [float(space.max_leaks), math.inf, math.inf] if space.max_leaks else []
    return [float(axis.n_values) for axis in space.axes] + of_leaks


def trials_of(space: Space, shares: Sequence[float]) -> np.ndarray:
    """What each leak of a point tries: (leaks, parameters) shares; one row where the leaks are those of the base.

    A leak's place is the one that it has, to the centimetre, not the one asked for.
    """
    n_axes = len(space.axes)
    if space.max_leaks == 0:
        return np.array([shares[:n_axes]])
    return np.array([[*shares[: n_axes + 1], *shares_of(space, place)] for place in places(space, shares)])


def plainness(space: Space, shares: Sequence[float]) -> float:
    """Distance from the plain scene: ranges of every axis from its plain value, and leaks beyond one."""
    away = [
        abs(share - axis.share_of(axis.plain))
        for axis, share in zip(space.axes, shares, strict=False)
        if axis.n_values > 1
    ]
    return sum(away) + (0.5 * (len(places(space, shares)) - 1) if space.max_leaks else 0.0)


def shares_of(space: Space, place: Place) -> tuple[float, float]:
    """Return the shares of range and azimuth that a place is at, in [0, 1)."""
    along = (place.x_m**2 + place.y_m**2) / reach_m(space) ** 2
    around = math.atan2(place.y_m, place.x_m) / math.pi + 0.5
    return min(along, BELOW_ONE), min(max(around, 0.0), BELOW_ONE)


def reach_m(space: Space) -> float:
    """Range of the farthest leaks, m."""
    return space.base_scenario.pedestal.radius_m - space.wall_margin_m


def _place_shares(space: Space, shares: Sequence[float], leak: int) -> tuple[float, float]:
    first = len(space.axes) + 1 + 2 * leak
    return shares[first], shares[first + 1]
