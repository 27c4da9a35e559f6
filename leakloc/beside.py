"""Near the wall a drop stands beside its own shadow, which outshouts it: look for the bright line that it implies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from leakloc.levelled import LevelPair
from leakloc.linefit import BLUR_PX, MODEL_ERROR, Profile, blurred_chord, gaussian
from leakloc.rig import Array, Rig
from leakloc.shadows import shadow_places

REACH_PX = 30  # of the window in which a shadow is taken off
SHADOW_RADII_PX = (1.0, 2.0, 4.0, 8.0)  # penumbras from a drop at the wall to one in mid-air
SHIFTS_PX = np.arange(-1.5, 1.6, 0.5)  # of the shadow against its column, which its drop may have pulled
SLACK_PX = 1  # how far a drop may stand off its predicted column in either view
NEAREST_M, FARTHEST_M, STEP_M = 0.03, 1.5, 0.01  # from the wall along the ray to the lamp
FREE_REACH_PX = 12  # without lamp or wall: how far from its shadow a drop is looked for
LEAST_SHARE = 0.25  # of a glint's light that is left beside the shadow's shapes: less says nothing


def brightness_beside(profile: Profile, shadow_px: float) -> Array:
    """Significance of a glint on every column, (width,), once a dark line of free width at shadow_px is taken off.

    Only columns within REACH_PX of the shadow are told; others are 0.
    """
    width = len(profile.values)
    columns = np.arange(max(0, round(shadow_px) - REACH_PX), min(width, round(shadow_px) + REACH_PX + 1))
    x, data = columns.astype(np.float64), profile.values[columns]
    bases = [_shadow_shapes(x, shadow_px + shift) for shift in SHIFTS_PX]
    basis = max(bases, key=lambda shapes: float(((shapes.T @ data) ** 2).sum()))
    glints = np.stack([gaussian(x, float(c), BLUR_PX) for c in columns])
    beside = glints - (glints @ basis) @ basis.T
    norms = np.linalg.norm(beside, axis=1)
    told = norms > LEAST_SHARE * np.linalg.norm(glints, axis=1)
    sigma = np.hypot(profile.sigma, MODEL_ERROR * np.abs(data).max())
    found = np.zeros(width)
    found[columns[told]] = beside[told] @ data / (norms[told] * sigma)
    return found


def _shadow_shapes(x_px: Array, centre_px: float) -> Array:
    """Orthonormal shapes (columns, shapes) that span shadows of all widths."""
    return np.linalg.qr(np.stack([blurred_chord(x_px, centre_px, r) for r in SHADOW_RADII_PX], axis=1))[0]


def drop_beside_shadow(
    profiles: Sequence[Profile], shadow_px: Array, level: LevelPair, rig: Rig
) -> tuple[Array, float]:
    """Columns (2,) of the best bright line near a shadow's columns (2,), and its significance in both views together.

    With lamp and wall, along the ray from the shadow to the lamp; without, anywhere within FREE_REACH_PX.
    """
    brightness = [
        brightness_beside(profile, float(column)) for profile, column in zip(profiles, shadow_px, strict=True)
    ]
    if rig.lamps is None or rig.pedestal_radius is None:
        return _brightest_near(brightness, shadow_px)
    found = [_brightest_on_ray(brightness, shadow_px, lamp, (level, rig.pedestal_radius)) for lamp in rig.lamps]
    return max(found, key=lambda candidate: candidate[1])


def together(one: Array, other: Array) -> Array:
    """Significance of two independent ones, both of which must speak for it."""
    return np.where(np.minimum(one, other) > 0, (one + other) / np.sqrt(2), np.minimum(one, other))


def _brightest_near(brightness: Sequence[Array], shadow_px: Array) -> tuple[Array, float]:
    columns, heights = np.zeros(2), np.zeros(2)
    for view, values in enumerate(brightness):
        first = max(0, round(shadow_px[view]) - FREE_REACH_PX)
        near = values[first : round(shadow_px[view]) + FREE_REACH_PX + 1]
        columns[view], heights[view] = first + near.argmax(), near.max()
    return columns, float(together(heights[0], heights[1]))


def _brightest_on_ray(
    brightness: Sequence[Array], shadow_px: Array, lamp: Array, stage: tuple[LevelPair, float]
) -> tuple[Array, float]:
    level, radius_m = stage
    seen_m = level.places_of(shadow_px[None])[0]
    towards = lamp[:2] - seen_m
    towards = towards / np.linalg.norm(towards)
    inside_m = seen_m * min(1.0, 0.98 * radius_m / np.hypot(*seen_m))
    wall_m = shadow_places(inside_m, lamp[:2], radius_m)[0]
    steps_m = np.arange(NEAREST_M, FARTHEST_M, STEP_M)
    ahead = level.columns_of(wall_m + steps_m[:, None] * towards) - level.columns_of(wall_m[None]) + shadow_px
    width = len(brightness[0])
    heights, places = [], []
    for view, values in enumerate(brightness):
        at = np.clip(np.nan_to_num(np.rint(ahead[:, view]), nan=0), SLACK_PX, width - 1 - SLACK_PX).astype(int)
        around = np.stack([values[at + slack] for slack in range(-SLACK_PX, SLACK_PX + 1)])
        heights.append(around.max(axis=0))
        places.append(at + around.argmax(axis=0) - SLACK_PX)
    both = together(heights[0], heights[1])
    best = int(both.argmax())
    return np.array([places[0][best], places[1][best]], dtype=np.float64), float(both[best])
