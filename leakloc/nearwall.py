"""A crisp shadow is thrown from close by: how far from the wall a leak may be whose own drops do not stand out.

The farther a drop is from the wall, the wider the lamp's disc smears its shadow. The profiles of a shadow whose drop is
not seen apart from it are explained by both together at every distance along the ray to the lamp; what the distances
are worth is their likelihood.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from leakloc.levelled import LevelPair
from leakloc.linefit import MODEL_ERROR, Profile
from leakloc.lineshape import BLUR_PX, blurred_chord, gaussian
from leakloc.rig import Array, Rig
from leakloc.shadows import penumbra_m, ray_to_lamp

DISTANCES_M = np.arange(0.04, 1.2, 0.08)
RADII_M = (0.003, 0.005, 0.008, 0.012)
SHIFTS_PX = np.arange(-1.25, 1.3, 0.25)  # of the shadow in a view, for its columns are known to a pixel
APART_PX = 0.5  # standard deviation of both views' difference: the wall's radius is known to a hundredth
WINDOW_PX = 14
OFF_WALL_PX = 5.0  # a line this far off the columns of its place on the wall does not lie there
FARTHEST_M, LEAST_CERTAINTY = 0.6, 0.99  # from the wall, and how surely the drop is nearer
LATERAL_PX = 0.5  # standard deviation across the ray


@dataclass(frozen=True, eq=False)
class NearWall:
    """Place (2,) m in the frame of the results, its covariance (2, 2), and the columns (2,) it is seen on."""

    place_m: Array
    covariance_m2: Array
    columns_px: Array


def near_wall(profiles: Sequence[Profile], shadow_px: Array, level: LevelPair, rig: Rig) -> NearWall | None:
    """The leak that throws a crisp shadow at columns (2,), or None if it may be far from the wall; one lamp alone."""
    if rig.lamps is None or rig.pedestal_radius is None or len(rig.lamps) != 1:
        return None
    lamp = rig.lamps[0]
    wall_m, towards = ray_to_lamp(shadow_px, lamp, level, rig.pedestal_radius)
    on_wall_px = level.columns_of(wall_m[None])[0]
    if not np.abs(on_wall_px - shadow_px).max() < OFF_WALL_PX:  # NaN, too
        return None
    chi2 = np.array([_chi2(profiles, wall_m, (towards, d), (level, lamp)) for d in DISTANCES_M])
    if not np.isfinite(chi2).all():
        return None
    samples = 2 * (2 * WINDOW_PX + 1)
    worth = np.exp(-0.5 * (chi2 - chi2.min()) / max(1.0, float(chi2.min()) / samples))
    worth /= worth.sum()
    if worth[DISTANCES_M <= FARTHEST_M].sum() < LEAST_CERTAINTY:
        return None
    mean_m = float(worth @ DISTANCES_M)
    place_m = wall_m + mean_m * towards
    across = np.array([-towards[1], towards[0]])
    lateral_m = LATERAL_PX * float(level.depths_m(place_m[None])[0]) / level.focal_px
    along_m2 = float(worth @ (DISTANCES_M - mean_m) ** 2) + (DISTANCES_M[1] - DISTANCES_M[0]) ** 2 / 12
    covariance = along_m2 * np.outer(towards, towards) + lateral_m**2 * np.outer(across, across)
    return NearWall(place_m, covariance, level.columns_of(place_m[None])[0])


def _chi2(
    profiles: Sequence[Profile], wall_m: Array, ray: tuple[Array, float], stage: tuple[LevelPair, Array]
) -> float:
    """Least chi-squared of both profiles with drop and shadow at one distance, over drop radius and shifts."""
    (towards, distance_m), (level, lamp) = ray, stage
    place_m = wall_m + distance_m * towards
    shadow_px, drop_px = level.columns_of(np.stack([wall_m, place_m]))
    depth_m, wall_depth_m = level.depths_m(np.stack([place_m, wall_m]))
    blur_m, magnified = penumbra_m(place_m, wall_m, lamp[:2], lamp[3])
    best = np.inf
    for radius_m in RADII_M:
        half_px = level.focal_px / wall_depth_m * float(np.hypot(blur_m, magnified * radius_m))
        spread_px = float(np.hypot(BLUR_PX, radius_m * level.focal_px / depth_m / 2))
        one, other = (
            _shifted_chi2(profile, shadow, drop - shadow, (half_px, spread_px))
            for profile, shadow, drop in zip(profiles, shadow_px, drop_px, strict=True)
        )
        strays = ((SHIFTS_PX[:, None] - SHIFTS_PX) / APART_PX) ** 2
        best = min(best, float((one[:, None] + other + strays).min()))
    return best


def _shifted_chi2(profile: Profile, shadow_px: float, offset_px: float, widths: tuple[float, float]) -> Array:
    """Chi-squared (shifts,) of a dark line about shadow_px and a line of either sign beside it, best lights."""
    half_px, spread_px = widths
    middle = int(np.clip(round(shadow_px), WINDOW_PX, len(profile.values) - 1 - WINDOW_PX))
    columns = np.arange(middle - WINDOW_PX, middle + WINDOW_PX + 1)
    x, data = columns.astype(np.float64), profile.values[columns]
    sigma = float(np.hypot(profile.sigma, MODEL_ERROR * np.abs(data).max()))
    centres = shadow_px + SHIFTS_PX
    dark = blurred_chord(x, centres, half_px)
    drop = np.stack([gaussian(x, centre + offset_px, spread_px) for centre in centres])
    dd, gg, dg = ((one * other).sum(axis=1) for one, other in ((dark, dark), (drop, drop), (dark, drop)))
    bd, bg = dark @ data, drop @ data
    determinant = np.maximum(dd * gg - dg**2, np.maximum(1e-3 * dd * gg, 1e-12))
    light = (bd * gg - dg * bg) / determinant, (bg * dd - dg * bd) / determinant
    explained = np.where(light[0] < 0, light[0] * bd + light[1] * bg, 0.0)
    return (float(data @ data) - explained) / sigma**2
