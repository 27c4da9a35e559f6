"""Leaks known by their shadows: the drop that a shadow belongs to is looked for on the ray to the lamp, in its rhythm.

A shadow is often much surer than the drop that throws it: nothing darkens but drops and shadows, while hits drown what
glitters. Drop and shadow pass at the same instants, and lamp, drop and shadow lie on one line, which maps the rows of
the one to those of the other: a shadow's signature is the matched filter for its own drop at every place on the ray.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from leakloc.levelled import LevelPair
from leakloc.rig import Array, Rig
from leakloc.shadows import ray_to_lamp
from leakloc.signature import Signature, signature
from leakloc.streaks import Streaks

STEP_M = 0.02  # along the ray
NEAREST_LAMP_M = 0.3
REACH_PX = 2  # columns on both sides that a drop fills, bright on one side and dark on the other
LEAST_APART_PX = 3.0  # from the shadow's own border: nearer, a drop is told from it by `beside`
WIDTH_REACH_PX, WIDTH_SHARE = 30, 0.2  # how far a shadow is followed, until so much of its height
LAMP_ERROR_M = 0.1  # by which the lamp may stand beside its believed place
LEAST_CHI2 = 30.0  # of 5 columns in either view: 1.5e-5, and both at once on some thousand places: below 1e-6 a shadow
LEAST_SHARE = 0.06  # of the shadow's own height: drops in step with other leaks' leave less
COLUMN_SIGMA_PX = 0.8  # of the middle of what is bright and dark


@dataclass(frozen=True, eq=False)
class ShadedDrop:
    """A drop found by its shadow: columns (2,) in px and significance of the weaker view."""

    columns_px: Array
    sigmas: float


def drop_of_shadow(shadow_px: Array, views: Sequence[Streaks], level: LevelPair, rig: Rig) -> ShadedDrop | None:
    """The drop that throws a shadow seen at columns (2,), or None; by one lamp alone, for those of several pair

    crosswise.
    """
    if rig.lamps is None or rig.pedestal_radius is None or len(rig.lamps) != 1:
        return None
    return _on_ray(shadow_px, rig.lamps[0], views, (level, rig.pedestal_radius))


def _on_ray(
    shadow_px: Array, lamp: Array, views: Sequence[Streaks], stage: tuple[LevelPair, float]
) -> ShadedDrop | None:
    level, radius_m = stage
    wall_m, towards = ray_to_lamp(shadow_px, lamp, level, radius_m)
    whole_m = float(np.linalg.norm(lamp[:2] - wall_m))
    if not np.isfinite(whole_m):
        return None
    from_wall_m = np.arange(STEP_M, whole_m - NEAREST_LAMP_M, STEP_M)
    places_m = wall_m + from_wall_m[:, None] * towards
    columns = level.columns_of(places_m)
    slack_px = LAMP_ERROR_M * from_wall_m / whole_m * level.focal_px / level.depths_m(places_m)
    rhythm = np.sum([signature(v.activity, round(c), -1.0) for v, c in zip(views, shadow_px, strict=True)], axis=0)
    own = min(float(_energies(view, rhythm, c, 0)[0]) for view, c in zip(views, shadow_px, strict=True))
    wide_px = [_half_width(view, rhythm, c) + LEAST_APART_PX for view, c in zip(views, shadow_px, strict=True)]
    best, found = max(LEAST_CHI2, LEAST_SHARE**2 * own), None
    for i in np.flatnonzero(_inside(columns, slack_px, level.image_size[0])):
        slack = int(slack_px[i])
        shifted = np.rint(columns[i])[:, None] + np.arange(-slack, slack + 1)
        apart = (np.abs(shifted - shadow_px[:, None]) > np.array(wide_px)[:, None]).all(axis=0)
        if not apart.any():
            continue
        template = _seen_at(rhythm, places_m[i], (wall_m, lamp), views[0].rows_px, level)
        both = np.minimum(*(_energies(view, template, c, slack) for view, c in zip(views, columns[i], strict=True)))
        both *= apart
        if both.max() > best:
            best = float(both.max())
            found = template, np.rint(columns[i]) + int(both.argmax()) - slack
    if found is None:
        return None
    middles = [_middle(view, found[0], c) for view, c in zip(views, found[1], strict=True)]
    return ShadedDrop(np.array(middles), float(np.sqrt(best)))


def _inside(columns_px: Array, slack_px: Array, width: int) -> Array:
    """Places (n,) whose columns (n, 2) lie off both images' edges, by their slack (n,) too."""
    edge = (REACH_PX + 1 + slack_px)[:, None]
    return np.asarray(((columns_px >= edge) & (columns_px <= width - 1 - edge)).all(axis=1))


def _seen_at(
    rhythm: Signature, place_m: Array, ray: tuple[Array, Array], rows_px: Array, level: LevelPair
) -> Signature:
    """The signature of the drop at a place (2,) whose shadow on the wall has `rhythm` (frames, bands)."""
    wall_m, lamp = ray
    drop_depth_m, wall_depth_m = level.depths_m(np.stack([place_m, wall_m]))
    horizon_px, camera_m = level.principal_px[0, 1], level.centres_m[0, 2]
    stretch = np.linalg.norm(wall_m - lamp[:2]) / np.linalg.norm(place_m - lamp[:2])
    drop_z_m = camera_m - (rows_px - horizon_px) * drop_depth_m / level.focal_px
    shadow_z_m = lamp[2] + (drop_z_m - lamp[2]) * stretch
    row = horizon_px - (shadow_z_m - camera_m) * level.focal_px / wall_depth_m
    band = (row - rows_px[0]) / max(rows_px[1] - rows_px[0], 1.0) if len(rows_px) > 1 else np.zeros(1)
    below = np.clip(np.floor(band).astype(int), 0, max(len(rows_px) - 2, 0))
    weight = band - below
    seen = (band >= 0) & (band <= len(rows_px) - 1)
    above = np.minimum(below + 1, len(rows_px) - 1)
    warped = (rhythm[:, below] * (1 - weight) + rhythm[:, above] * weight) * seen
    return np.asarray(warped - warped.mean(axis=0))


def _half_width(view: Streaks, template: Signature, column_px: float) -> float:
    """How far a dark line reaches to either side of its column, px."""
    width = view.activity.shape[2]
    first, last = max(0, round(column_px) - WIDTH_REACH_PX), min(width, round(column_px) + WIDTH_REACH_PX + 1)
    profile = np.abs(np.tensordot(template, view.activity[:, :, first:last], axes=([0, 1], [0, 1])))
    dark = np.flatnonzero(profile > WIDTH_SHARE * profile.max()) + first
    return float(np.abs(dark - column_px).max(initial=0.0))


def _filtered(view: Streaks, template: Signature, column_px: float, reach: int) -> Array:
    """Chi-squared of every column within `reach` of one, filtered by a template."""
    first = round(column_px) - reach
    near = view.activity[:, :, max(0, first) : first + 2 * reach + 1]
    norm = max(float(np.linalg.norm(template)), 1e-9)
    return np.asarray(np.tensordot(template / norm, near, axes=([0, 1], [0, 1])) ** 2)


def _energies(view: Streaks, template: Signature, column_px: float, slack: int) -> Array:
    """Chi-squared (2 slack + 1,) of the columns that a drop fills, at every shift within the slack."""
    return np.convolve(_filtered(view, template, column_px, slack + REACH_PX), np.ones(2 * REACH_PX + 1), "valid")


def _middle(view: Streaks, template: Signature, column_px: float) -> float:
    """Middle of what a drop fills about a column, px."""
    chi2 = _filtered(view, template, column_px, REACH_PX)
    return round(column_px) - REACH_PX + float(chi2 @ np.arange(len(chi2))) / max(float(chi2.sum()), 1e-9)
