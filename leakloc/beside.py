"""Near the wall a drop stands beside its own shadow, which outshouts it: look for the bright line that it implies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from leakloc.levelled import LevelPair
from leakloc.linefit import BLUR_PX, MODEL_ERROR, Profile, blurred_chord, gaussian
from leakloc.rig import Array, Rig
from leakloc.shadows import shadow_places

REACH_PX = 30  # of the window in which drop and shadow are told apart
SHADOW_RADII_PX = np.geomspace(0.7, 8.0, 7)  # penumbras from a drop at the wall to one in mid-air
SHIFTS_PX = np.arange(-2.0, 2.1, 0.25)  # of the shadow against its column, which its drop may have pulled
STEP_PX = 0.25  # between columns on which a drop is tried
NEAREST_M, FARTHEST_M, STEP_M = 0.03, 1.5, 0.01  # from the wall along the ray to the lamp
FREE_REACH_PX = 12.0  # without lamp or wall: how far from its shadow a drop is looked for
LEAST_APART = 0.05  # of a drop's light that no shadow can stand for: less says nothing


@dataclass(frozen=True, eq=False)
class Beside:
    """What speaks for a bright line beside a dark one: columns (n,) px and significances (n,), 0 where nothing does."""

    columns_px: Array
    sigmas: Array

    def at(self, columns_px: Array) -> Array:
        """Significance at columns (m,); 0 beyond those that were tried."""
        return np.interp(columns_px, self.columns_px, self.sigmas, left=0.0, right=0.0)


def drop_beside(profile: Profile, shadow_px: float) -> Beside:
    """How much better a bright line and a dark one explain a profile than the best dark one alone, column by column.

    The dark line's place and width are free, for the drop pulls the one and the lamp decides the other; both lines'
    light is by least squares, with the sign that it must have.
    """
    width = len(profile.values)
    x = np.arange(max(0, round(shadow_px) - REACH_PX), min(width, round(shadow_px) + REACH_PX + 1))
    data = profile.values[x]
    sigma = np.hypot(profile.sigma, MODEL_ERROR * np.abs(data).max())
    columns = np.arange(x[0], x[-1] + STEP_PX, STEP_PX)
    drops = np.stack([_unit(gaussian(x, column, BLUR_PX)) for column in columns])
    shadows = np.stack([_unit(blurred_chord(x, shadow_px + s, r)) for r in SHADOW_RADII_PX for s in SHIFTS_PX])
    dark, bright, common = np.minimum(shadows @ data, 0), drops @ data, drops @ shadows.T
    apart = np.maximum(1 - common**2, LEAST_APART)
    drop_light = (bright[:, None] - common * dark) / apart
    gain = dark**2 + apart * drop_light**2  # of chi-squared: the shadow alone, then what the drop adds
    gain = np.where((drop_light > 0) & (dark < 0), gain, 0.0).max(axis=1) - (dark**2).max()
    return Beside(columns, np.sqrt(np.maximum(gain, 0.0)) / sigma)


def _unit(shape: Array) -> Array:
    return np.asarray(shape / max(float(np.linalg.norm(shape)), 1e-12))


def drop_beside_shadow(
    profiles: Sequence[Profile], shadow_px: Array, level: LevelPair, rig: Rig
) -> tuple[Array, float]:
    """Columns (2,) of the best bright line near a shadow's columns (2,), and its significance in both views together.

    With lamp and wall, along the ray from the shadow to the lamp; without, anywhere within FREE_REACH_PX.
    """
    beside = [drop_beside(profile, float(column)) for profile, column in zip(profiles, shadow_px, strict=True)]
    if rig.lamps is None or rig.pedestal_radius is None:
        return _brightest_near(beside, shadow_px)
    found = [_brightest_on_ray(beside, shadow_px, lamp, (level, rig.pedestal_radius)) for lamp in rig.lamps]
    return max(found, key=lambda candidate: candidate[1])


def together(one: Array, other: Array) -> Array:
    """Significance of two independent ones, both of which must speak for it."""
    return np.where(np.minimum(one, other) > 0, (one + other) / np.sqrt(2), np.minimum(one, other))


def _brightest_near(beside: Sequence[Beside], shadow_px: Array) -> tuple[Array, float]:
    columns, heights = np.zeros(2), np.zeros(2)
    for view, one in enumerate(beside):
        sigmas = np.where(np.abs(one.columns_px - shadow_px[view]) <= FREE_REACH_PX, one.sigmas, 0.0)
        columns[view], heights[view] = one.columns_px[sigmas.argmax()], sigmas.max()
    return columns, float(together(heights[0], heights[1]))


def _brightest_on_ray(
    beside: Sequence[Beside], shadow_px: Array, lamp: Array, stage: tuple[LevelPair, float]
) -> tuple[Array, float]:
    level, radius_m = stage
    seen_m = level.places_of(shadow_px[None])[0]
    towards = lamp[:2] - seen_m
    towards = towards / np.linalg.norm(towards)
    inside_m = seen_m * min(1.0, 0.98 * radius_m / np.hypot(*seen_m))
    wall_m = shadow_places(inside_m, lamp[:2], radius_m)[0]
    steps_m = np.arange(NEAREST_M, FARTHEST_M, STEP_M)
    ahead = level.columns_of(wall_m + steps_m[:, None] * towards) - level.columns_of(wall_m[None]) + shadow_px
    heights = [one.at(np.nan_to_num(ahead[:, view], nan=-1.0)) for view, one in enumerate(beside)]
    both = together(heights[0], heights[1])
    best = int(both.argmax())
    return np.nan_to_num(ahead[best]), float(both[best])
