"""Near the wall a drop stands beside its own shadow, which outshouts it: look for the bright line that it implies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from leakloc.levelled import LevelPair
from leakloc.linefit import MODEL_ERROR, Profile
from leakloc.lineshape import BLUR_PX, blurred_chord, gaussian
from leakloc.rig import Array, Rig
from leakloc.shadows import ray_to_lamp

REACH_PX = 30  # of the window in which drop and shadow are told apart
SHADOW_RADII_PX = np.geomspace(0.7, 8.0, 7)  # penumbras from a drop at the wall to one in mid-air
SHIFTS_PX = np.arange(-2.0, 2.1, 0.25)  # of the shadow against its column, which its drop may have pulled
APART_PX = 8.0  # of drop and shadow: farther off a drop is a line of its own, and what is seen here is another leak's
STEP_PX = 0.25  # between columns on which a drop is tried
NEAREST_M, FARTHEST_M, STEP_M = 0.03, 1.5, 0.01  # from the wall along the ray to the lamp
LEAST_APART = 0.05  # of a drop's light that no shadow can stand for: less says nothing


@dataclass(frozen=True, eq=False)
class Beside:
    """What speaks for a bright line beside a dark one: `sigmas` (shifts, n), drops on `columns_px` (n,) beside shadows

    on `shadows_px` (shifts,); 0 where nothing does.
    """

    columns_px: Array
    shadows_px: Array
    sigmas: Array

    def apart(self, offsets_px: Array) -> tuple[Array, Array]:
        """Greatest significance (m,) of a drop so far (m,) from its shadow, and the drop's column there."""
        columns = self.shadows_px[:, None] + offsets_px
        tried = [
            np.interp(c, self.columns_px, sigmas, left=0, right=0)
            for c, sigmas in zip(columns, self.sigmas, strict=True)
        ]
        best = np.argmax(tried, axis=0)
        return np.max(tried, axis=0), np.take_along_axis(columns, best[None], axis=0)[0]


def drop_beside(profile: Profile, shadow_px: int) -> Beside:
    """How much better a bright line and a dark one explain a profile than the best dark one alone, place by place.

    The dark line's place and width are free, for the drop pulls the one and the lamp decides the other; both lines'
    light is by least squares, with the sign that it must have.
    """
    width = len(profile.values)
    seen = np.arange(-REACH_PX, REACH_PX + 1)
    seen = seen[(shadow_px + seen >= 0) & (shadow_px + seen < width)]
    data = profile.values[shadow_px + seen]
    sigma = np.hypot(profile.sigma, MODEL_ERROR * np.abs(data).max())
    places, drops, shadows = _shapes(int(seen[0]), int(seen[-1]))
    dark, bright, common = np.minimum(shadows @ data, 0)[:, None], drops @ data, shadows @ drops.T
    apart = np.maximum(1 - common**2, LEAST_APART)
    drop_light = (bright - common * dark) / apart
    gain = dark**2 + apart * drop_light**2  # of chi-squared: the shadow alone, then what the drop adds
    gain = np.where((drop_light > 0) & (dark < 0), gain, 0.0) - (dark**2).max()
    gain = gain.reshape(len(SHADOW_RADII_PX), len(SHIFTS_PX), len(places)).max(axis=0)
    return Beside(shadow_px + places, shadow_px + SHIFTS_PX, np.sqrt(np.maximum(gain, 0.0)) / sigma)


@lru_cache(maxsize=8)
def _shapes(first_px: int, last_px: int) -> tuple[Array, Array, Array]:
    """Places of drops about a shadow's column, and unit shapes of drops there and of shadows, (shapes, columns)."""
    x = np.arange(first_px, last_px + 1, dtype=np.float64)
    places = np.arange(first_px, last_px + STEP_PX, STEP_PX)
    drops = np.stack([_unit(gaussian(x, place, BLUR_PX)) for place in places])
    shadows = np.stack([_unit(blurred_chord(x, shift, r)) for r in SHADOW_RADII_PX for shift in SHIFTS_PX])
    return places, drops, shadows


def _unit(shape: Array) -> Array:
    return np.asarray(shape / max(float(np.linalg.norm(shape)), 1e-12))


def drop_beside_shadow(
    profiles: Sequence[Profile], shadow_px: Array, level: LevelPair, rig: Rig
) -> tuple[Array, float]:
    """Columns (2,) of the best bright line near a shadow's columns (2,), and its significance in both views together.

    With lamp and wall, along the ray from the shadow to the lamp; without, anywhere within APART_PX.
    """
    beside = [drop_beside(profile, round(column)) for profile, column in zip(profiles, shadow_px, strict=True)]
    if rig.lamps is None or rig.pedestal_radius is None:
        return _brightest_near(beside)
    found = [_brightest_on_ray(beside, shadow_px, lamp, (level, rig.pedestal_radius)) for lamp in rig.lamps]
    return max(found, key=lambda candidate: candidate[1])


def together(one: Array, other: Array) -> Array:
    """Significance of two independent ones, both of which must speak for it."""
    return np.where(np.minimum(one, other) > 0, (one + other) / np.sqrt(2), np.minimum(one, other))


def _brightest_near(beside: Sequence[Beside]) -> tuple[Array, float]:
    found = [one.apart(np.arange(-APART_PX, APART_PX + STEP_PX, STEP_PX)) for one in beside]
    best = [int(sigmas.argmax()) for sigmas, _ in found]
    heights, columns = zip(*((sigmas[i], px[i]) for i, (sigmas, px) in zip(best, found, strict=True)), strict=True)
    return np.array(columns), float(together(heights[0], heights[1]))


def _brightest_on_ray(
    beside: Sequence[Beside], shadow_px: Array, lamp: Array, stage: tuple[LevelPair, float]
) -> tuple[Array, float]:
    level, radius_m = stage
    wall_m, towards = ray_to_lamp(shadow_px, lamp, level, radius_m)
    steps_m = np.arange(NEAREST_M, FARTHEST_M, STEP_M)
    offsets_px = np.nan_to_num(level.columns_of(wall_m + steps_m[:, None] * towards) - level.columns_of(wall_m[None]))
    heights, columns = zip(*(one.apart(offsets_px[:, view]) for view, one in enumerate(beside)), strict=True)
    both = np.where(np.abs(offsets_px).max(axis=1) <= APART_PX, together(heights[0], heights[1]), 0.0)
    best = int(both.argmax())
    return np.array([columns[0][best], columns[1][best]]), float(both[best])
