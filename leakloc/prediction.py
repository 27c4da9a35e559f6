"""What a leak at a place would look like in both views: its drops' glints, and the shadows of its lamps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from leakloc.glints import IMAGES, glint_offsets
from leakloc.levelled import LevelPair
from leakloc.rig import Array, Rig
from leakloc.shadows import penumbra_m, shadow_places

DROP_RADIUS_M = 0.006  # in the middle of what drips: free drops reach 3 mm, drops of the paper are drawn larger
LAMP_ERROR_M, WALL_ERROR = 0.05, 0.01  # how well lamp and wall (share of its radius) are believed to be known


@dataclass(frozen=True, eq=False)
class Prediction:
    """What a leak at a place would look like, per lamp and view.

    `drop_px` (2,): half-width of a drop of DROP_RADIUS_M. `shadows_px` (lamps, 2): columns of its shadows, NaN where
    there is none or it is not known; `lamp_blur_px`, `core_px` (lamps, 2): half-widths of its penumbra from the lamp's
    disc and from such a drop; `spread_px` (lamps, 2): standard deviation of what is believed of the column. `glints_px`
    (lamps, 2, IMAGES): offsets of the lamp's images in such a drop; `glint_light` (lamps, 2, IMAGES): their light,
    equal lamps, of unit sum in a view.
    """

    drop_px: Array
    shadows_px: Array
    lamp_blur_px: Array
    core_px: Array
    spread_px: Array
    glints_px: Array
    glint_light: Array

    @property
    def blur_px(self) -> Array:
        """Half-width (lamps, 2) of the penumbra of a drop of DROP_RADIUS_M."""
        return np.hypot(self.lamp_blur_px, self.core_px)


def predict(place_m: Array, level: LevelPair, rig: Rig) -> Prediction:
    """Glints and shadows of a leak at place (2,), as far as lamps and wall are known."""
    lamps = rig.lamps if rig.lamps is not None else np.empty((0, 4))
    n = max(1, len(lamps))
    shadows, blur, core, spread = (np.full((n, 2), np.nan) for _ in range(4))
    glints, light = np.zeros((n, 2, IMAGES)), np.full((n, 2, IMAGES), 1 / (n * IMAGES))
    drop_m = np.append(place_m, level.centres_m[:, 2].mean())
    radius_px = DROP_RADIUS_M * level.focal_px / float(level.depths_m(place_m[None])[0])
    slopes = (level.columns_of(place_m[None])[0] - level.principal_px[:, 0]) / level.focal_px
    for i, lamp in enumerate(lamps):
        for view, slope in enumerate(slopes):
            along = level.axes[0] - slope * level.axes[2]  # a small step's way along the row, times depth over focal
            offsets, strengths = glint_offsets(level.centres_m[view], lamp[:3], drop_m, along)
            glints[i, view] = radius_px * offsets
            light[i, view] = strengths / np.sum((lamp[:3] - drop_m) ** 2)
        if rig.pedestal_radius is not None:
            shadows[i], blur[i], core[i], spread[i] = _shadow(place_m, lamp, level, rig.pedestal_radius)
    light /= light.sum(axis=(0, 2), keepdims=True)
    return Prediction(radius_px * np.hypot(1.0, slopes), shadows, blur, core, spread, glints, light)


def predict_shadows(places_m: Array, level: LevelPair, rig: Rig) -> Array:
    """Columns (n, lamps, 2) of the shadows of leaks at places (n, 2) alone; NaN where there is none.

    Lamps and wall are known.
    """
    assert rig.lamps is not None
    assert rig.pedestal_radius is not None
    shadows_m = [shadow_places(places_m, lamp[:2], rig.pedestal_radius) for lamp in rig.lamps]
    return level.columns_of(np.stack(shadows_m, axis=1))


def _shadow(place_m: Array, lamp: Array, level: LevelPair, radius_m: float) -> tuple[Array, Array, Array, Array]:
    shadow_m = shadow_places(place_m, lamp[:2], radius_m)
    depth_m = float(level.depths_m(shadow_m)[0])
    if not depth_m > 0:  # behind the cameras, or no shadow at all
        return (np.full(2, np.nan),) * 4
    blur_m, magnified = penumbra_m(place_m, shadow_m[0], lamp[:2], lamp[3])
    px_per_m = level.focal_px / depth_m
    lamp_error_m, wall_error_m = LAMP_ERROR_M * (magnified - 1), WALL_ERROR * radius_m
    spread = px_per_m * np.hypot(lamp_error_m, 0.3 * wall_error_m) + 0.1
    return (
        level.columns_of(shadow_m)[0],
        np.full(2, px_per_m * blur_m),
        np.full(2, px_per_m * magnified * DROP_RADIUS_M),
        np.full(2, spread),
    )
