"""Near the wall a drop stands beside its own shadow, which outshouts it: look for the bright line that it implies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from leakloc.levelled import LevelPair
from leakloc.linefit import BLUR_PX, Profile, gaussian
from leakloc.rig import Array, Rig
from leakloc.shadows import shadow_places

KERNEL_PX = 3
SLACK_PX = 1  # how far a drop may stand off its predicted column in either view
NEAREST_M, FARTHEST_M, STEP_M = 0.03, 1.5, 0.01  # from the wall along the ray to the lamp
FREE_REACH_PX = 12  # without lamp or wall: how far from its shadow a drop is looked for
KERNEL = gaussian(np.arange(-KERNEL_PX, KERNEL_PX + 1, dtype=np.float64), 0.0, BLUR_PX)


def glint_filter(profile: Profile) -> Array:
    """Significance of a bright line on every column, (width,): matched to a glint on an even ground."""
    kernel = KERNEL - KERNEL.mean()
    return np.asarray(np.convolve(profile.values, kernel[::-1], mode="same") / (np.linalg.norm(kernel) * profile.sigma))


def drop_beside_shadow(
    profiles: Sequence[Profile], shadow_px: Array, level: LevelPair, rig: Rig
) -> tuple[Array, float]:
    """Columns (2,) of the best bright line near a shadow's columns (2,), and the lesser view's significance.

    With lamp and wall, along the ray from the shadow to the lamp; without, anywhere within FREE_REACH_PX.
    """
    brightness = [glint_filter(profile) for profile in profiles]
    if rig.lamps is None or rig.pedestal_radius is None:
        return _brightest_near(brightness, shadow_px)
    found = [_brightest_on_ray(brightness, shadow_px, lamp, (level, rig.pedestal_radius)) for lamp in rig.lamps]
    return max(found, key=lambda candidate: candidate[1])


def _brightest_near(brightness: Sequence[Array], shadow_px: Array) -> tuple[Array, float]:
    columns, heights = np.zeros(2), np.zeros(2)
    for view, values in enumerate(brightness):
        first = max(0, round(shadow_px[view]) - FREE_REACH_PX)
        near = values[first : round(shadow_px[view]) + FREE_REACH_PX + 1]
        columns[view], heights[view] = first + near.argmax(), near.max()
    return columns, float(heights.min())


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
    lesser = np.minimum(*heights)
    best = int(lesser.argmax())
    return np.array([places[0][best], places[1][best]], dtype=np.float64), float(lesser[best])
