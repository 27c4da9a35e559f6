"""Where a leak's shadow falls: the plane through a lamp and a plumb line cuts the wall in a plumb line."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from leakloc.levelled import LevelPair
from leakloc.rig import Array, Rig

WALL_PX = 1.5  # error of a line's disparity when it is asked whether it stands on the wall


def shadow_places(places_m: ArrayLike, lamp_m: Array, radius_m: float) -> Array:
    """Place (n, 2) on the wall of the shadow that `lamp_m` (x, y) throws of plumb lines through places (n, 2).

    The wall is the cylinder of `radius_m` around the frame's z axis; NaN for a place on or beyond it.
    """
    places = np.atleast_2d(np.asarray(places_m, dtype=np.float64))
    ray = places - lamp_m
    a = (ray**2).sum(axis=1)
    b = (places * ray).sum(axis=1)
    c = (places**2).sum(axis=1) - radius_m**2
    with np.errstate(invalid="ignore", divide="ignore"):
        step = np.where(c < 0, (-b + np.sqrt(b**2 - a * c)) / a, np.nan)
    return places + step[:, None] * ray


def penumbra_m(place_m: Array, shadow_m: Array, lamp_m: Array, lamp_radius_m: float) -> tuple[float, float]:
    """Half-widths across the ray, on a screen at the shadow: of the lamp's blur, and per metre of drop radius.

    A drop at distance a from the lamp and w - a before the screen magnifies its own radius by w / a and smears it
    by the lamp's radius times (w - a) / a.
    """
    a = float(np.linalg.norm(place_m - lamp_m))
    w = float(np.linalg.norm(shadow_m - lamp_m))
    return lamp_radius_m * (w - a) / a, w / a


def ray_to_lamp(shadow_px: Array, lamp: Array, level: LevelPair, radius_m: float) -> tuple[Array, Array]:
    """Where a shadow seen at columns (2,) lies on the wall, and the direction from there to the lamp, (2,) each.

    The wall tells the depth far better than the columns' disparity does; their mean tells the direction.
    """
    middle_m = level.centres_m[:, :2].mean(axis=0)
    seen_m = level.places_of(shadow_px[None])[0]
    wall_m = shadow_places((middle_m + seen_m) / 2, middle_m, radius_m)[0]
    towards = lamp[:2] - wall_m
    return wall_m, towards / np.linalg.norm(towards)


def stands_on_wall(columns_px: Array, level: LevelPair, rig: Rig, error_px: float = WALL_PX) -> bool:
    """Whether a line may lie on the pedestal's wall or beyond, within the error of its disparity."""
    if rig.pedestal_radius is None or rig.world_from_left is None:
        return False
    right_px = np.array([0.0, error_px])
    nearer, farther = (level.places_of((columns_px + off_px)[None])[0] for off_px in (-right_px, right_px))
    return not (np.hypot(*farther) < rig.pedestal_radius and np.hypot(*nearer) < rig.pedestal_radius)
