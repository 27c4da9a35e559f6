"""Leaks told by their shadows: the path of a fall, a shadow's rhythm at its drop, and how near the wall is near."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from leakloc.background import temporal_median
from leakloc.fall import FRAMES_PER_S, GRAVITY_M_S2, LEAK_ABOVE_M, STEPS, along_fall, fall_path
from leakloc.levelled import level_pair
from leakloc.linefit import Profile
from leakloc.lineshape import blurred_chord
from leakloc.nearwall import near_wall
from leakloc.pixels import Pixels
from leakloc.rig import Rig
from leakloc.shaded import drop_of_shadow
from leakloc.shadows import penumbra_m, ray_to_lamp, shadow_places
from leakloc.streaks import Streaks

ROWS = np.arange(36) * 15 + 7.0
LAMP = np.array([[-2.3, 0.0, 0.4, 0.1]])
NO_PIXELS = Pixels(np.zeros((1, 1, 1), np.uint8), temporal_median(np.zeros((1, 1, 1), np.uint8)), np.ones(511))


def with_lamp(rig):
    return Rig(
        rig.K1, rig.D1, rig.K2, rig.D2, rig.R, rig.T, rig.image_size, rig.world_from_left, LAMP, pedestal_radius=2.5
    )


@given(st.floats(1.5, 4.9), st.integers(0, 35), st.sampled_from(STEPS))
def test_a_drop_is_a_frame_later_or_earlier_where_free_fall_takes_it(depth_m, band, step):
    below_leak_m = LEAK_ABOVE_M + (ROWS[band] - 269.5) * depth_m / 685.5
    there = fall_path(ROWS, 269.5, 685.5, depth_m).bands[STEPS.index(step), band]
    if below_leak_m <= 0 or there < 0:
        return
    then_s = np.sqrt(2 * below_leak_m / GRAVITY_M_S2) + step / FRAMES_PER_S
    row = 269.5 + (GRAVITY_M_S2 * then_s**2 / 2 - LEAK_ABOVE_M) * 685.5 / depth_m
    assert abs(ROWS[there] - row) <= 7.5 + 1e-6  # half a band


def test_the_sum_along_a_fall_is_that_of_its_definition_and_keeps_unit_noise():
    rng = np.random.default_rng(0)
    activity = rng.normal(0, 1, (8, 36, 300)).astype(np.float32)
    path = fall_path(ROWS, 269.5, 685.5, 4.0)
    summed = along_fall(activity, path)
    fold, middle, frame = 4, 4 * 4 + 2, 3
    total, terms = np.zeros(300), 0
    for step, bands in zip(STEPS, path.bands, strict=True):
        if bands[middle] >= 0:
            first = bands[middle] - fold // 2
            total += activity[frame + step, first : first + fold].sum(axis=0) / np.sqrt(fold)
            terms += 1
    np.testing.assert_allclose(summed[frame, 4], total / np.sqrt(terms), atol=1e-4)
    assert summed[:, 2:7].std() == pytest.approx(1.0, abs=0.05)


@given(st.floats(-0.5, 2.2), st.floats(-1.2, 1.2))
def test_the_ray_from_a_shadow_to_the_lamp_passes_its_leak(make_rig, x_m, y_m):
    rig = with_lamp(make_rig())
    level, place = level_pair(rig), np.array([x_m, y_m])
    if np.hypot(x_m, y_m) > 2.4:
        return
    shadow_px = level.columns_of(shadow_places(place, LAMP[0, :2], 2.5))[0]
    wall_m, towards = ray_to_lamp(shadow_px, LAMP[0], level, 2.5)
    assert np.hypot(*wall_m) == pytest.approx(2.5, abs=1e-6)
    offset = place - wall_m
    assert abs(offset[0] * towards[1] - offset[1] * towards[0]) < 1e-6


def shadowed_views(level, place, rng, drop_amplitude):
    """Activity of both views: a dark shadow and, in its rhythm, a faint drop half bright and half dark."""
    wall = shadow_places(place, LAMP[0, :2], 2.5)[0]
    shadow_px, drop_px = level.columns_of(np.stack([wall, place]))
    depth, wall_depth = level.depths_m(np.stack([place, wall]))
    stretch = np.linalg.norm(wall - LAMP[0, :2]) / np.linalg.norm(place - LAMP[0, :2])
    x, views = np.arange(960), []

    def dark(off):
        return -12 * np.exp(-0.5 * (off / 2.0) ** 2)

    def two_sided(off):
        return drop_amplitude * (np.exp(-0.5 * ((off + 1) / 0.8) ** 2) - np.exp(-0.5 * ((off - 1) / 0.8) ** 2))

    activity = rng.normal(0, 1, (2, 24, 36, 960))
    for start in rng.uniform(-1.5, 0, 12):
        for frame in range(24):
            z_m = 2.0 - 4.905 * max(0.0, start + frame / 12 + 1.0) ** 2
            shadow_z = 0.4 + (z_m - 0.4) * stretch
            for view in range(2):
                seen = ((shadow_z, wall_depth, shadow_px, dark), (z_m, depth, drop_px, two_sided))
                for z, d, columns, shape in seen:
                    band = round((269.5 - z * level.focal_px / d - ROWS[0]) / 15)
                    if 0 <= band < 36:
                        activity[view, frame, band] += shape(x - columns[view])
    for view in range(2):
        views.append(
            Streaks(
                *[activity[view].astype(np.float32)] * 2,
                np.ones((36, 960), np.float32),
                ROWS,
                1.0,
                np.ones(960),
                np.zeros(960),
                NO_PIXELS,
            )
        )
    return views, shadow_px


def test_a_faint_drop_is_found_by_its_shadow_and_none_where_there_is_none(make_rig):
    rig = with_lamp(make_rig())
    level, place = level_pair(rig), np.array([0.8, -1.1])
    views, shadow_px = shadowed_views(level, place, np.random.default_rng(1), 2.5)
    drop = drop_of_shadow(np.rint(shadow_px), views, level, rig)
    assert drop is not None
    assert np.hypot(*(level.places_of(drop.columns_px[None])[0] - place)) < 0.05
    bare, shadow_px = shadowed_views(level, place, np.random.default_rng(1), 0.0)
    assert drop_of_shadow(np.rint(shadow_px), bare, level, rig) is None


def shadow_profiles(level, distance_m, rng):
    """Noisy profiles of a shadow thrown from this far before the wall, its drop invisible."""
    wall = shadow_places(np.array([1.0, 0.3]), LAMP[0, :2], 2.5)[0]
    towards = (LAMP[0, :2] - wall) / np.linalg.norm(LAMP[0, :2] - wall)
    place = wall + distance_m * towards
    blur_m, magnified = penumbra_m(place, wall, LAMP[0, :2], 0.1)
    shadow_px = level.columns_of(wall[None])[0]
    half_px = level.focal_px / float(level.depths_m(wall[None])[0]) * np.hypot(blur_m, 0.006 * magnified)
    x = np.arange(960)
    noise = [rng.normal(0, 1, 960) for _ in range(2)]
    return [Profile(n - 150 * blurred_chord(x, c, half_px), 1.0) for n, c in zip(noise, shadow_px, strict=True)], (
        shadow_px,
        place,
    )


@pytest.mark.parametrize("distance_m", [0.1, 0.25, 0.4])
def test_a_crisp_shadow_is_thrown_from_near_the_wall_within_what_is_said_of_it(make_rig, distance_m):
    rig = with_lamp(make_rig())
    level = level_pair(rig)
    profiles, (shadow_px, place) = shadow_profiles(level, distance_m, np.random.default_rng(2))
    found = near_wall(profiles, shadow_px, level, rig)
    assert found is not None
    off = found.place_m - place
    assert off @ np.linalg.solve(found.covariance_m2, off) < 9.2  # 99 % of two degrees of freedom
    assert np.sqrt(np.linalg.eigvalsh(found.covariance_m2)[-1]) < 0.3


def test_a_soft_shadow_says_nothing_of_the_wall(make_rig):
    rig = with_lamp(make_rig())
    level = level_pair(rig)
    profiles, (shadow_px, _) = shadow_profiles(level, 1.1, np.random.default_rng(3))
    assert near_wall(profiles, shadow_px, level, rig) is None
