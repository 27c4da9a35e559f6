"""Drop and shadow told apart by rows: a drop as faint as one near the wall is placed, and no shadow looks like one."""

from functools import partial
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from leakloc.above import bright_above, distances, drop_above_shadow, placed_by_rows, rows_above
from leakloc.background import TemporalMedian, temporal_median
from leakloc.levelled import level_pair
from leakloc.pixels import Pixels
from leakloc.rig import Rig
from leakloc.shadows import ray_to_lamp, shadow_places
from leakloc.tilt import leaning_columns

LAMP = np.array([-2.3, 0.0, 0.4, 0.1])
RADIUS_M = 2.5
GREY, NOISE_GREY = 60, 2.0
N_FRAMES, N_DROPS = 24, 40
STREAK_ROWS = 9
NEAR_WALL = np.array([2.2, 0.6])  # 0.23 m from it
APART_PX = np.array([0.8, -0.8])


def staged(make_rig, lamp=LAMP):
    rig = make_rig()
    lamps = np.atleast_2d(lamp)
    rig = Rig(
        rig.K1,
        rig.D1,
        rig.K2,
        rig.D2,
        rig.R,
        rig.T,
        rig.image_size,
        rig.world_from_left,
        lamps,
        pedestal_radius=RADIUS_M,
    )
    return level_pair(rig), rig


def crisp(off_px):
    return 9 * np.exp(-0.5 * (off_px / 1.2) ** 2)


def median_of(frames, seen):
    median = temporal_median(np.ascontiguousarray(frames[:, :, seen]))
    lower, upper = (np.full(frames.shape[1:], GREY, np.uint8) for _ in range(2))
    lower[:, seen], upper[:, seen] = median.lower, median.upper
    return TemporalMedian(lower, upper)


def views_of(level, place_m, shape=crisp, drop_grey=6.0, lag_rows=0, seed=0, lamp=LAMP):
    """Pixels of both views: in each of N_DROPS random instants a dark streak of the given profile (grey) across its

    column, and a drop's bright one as many rows higher as it must be.
    """
    rng = np.random.default_rng(seed)
    wall_m = shadow_places(place_m, lamp[:2], RADIUS_M)[0]
    shadow_px, drop_px = level.columns_of(np.stack([wall_m, place_m]))
    passes = [(rng.integers(N_FRAMES), rng.integers(60, 460)) for _ in range(N_DROPS)]
    seen = slice(round(shadow_px.min()) - 30, round(shadow_px.max()) + 31)  # nothing else is looked at
    x, views = np.arange(960)[seen], []
    for view in range(2):
        light = rng.normal(GREY, NOISE_GREY, (N_FRAMES, 540, len(x)))
        for frame, row in passes:
            top = row + lag_rows * view
            up = round(float(rows_above(place_m[None], wall_m, lamp, level, np.array([row]))[view, 0, 0]))
            light[frame, top : top + STREAK_ROWS] -= shape(x - shadow_px[view])
            glint = np.exp(-0.5 * ((x - drop_px[view]) / 0.65) ** 2)
            light[frame, top - up : top - up + STREAK_ROWS] += drop_grey * glint
        frames = np.full((N_FRAMES, 540, 960), GREY, np.uint8)
        frames[:, :, seen] = np.clip(np.rint(light), 0, 255)
        views.append(SimpleNamespace(pixels=Pixels(frames, median_of(frames, seen), np.full(511, NOISE_GREY))))
    return views, shadow_px


def found(level, views, shadow_px, lamp=LAMP):
    ray = ray_to_lamp(shadow_px, lamp, level, RADIUS_M)
    return drop_above_shadow(shadow_px, ray, distances(0.2, 0.1, 2.0), views, (level, lamp)), ray


@given(st.floats(0.5, 2.3), st.floats(-1.0, 1.0), st.floats(-2.9, 0.0), st.floats(-0.8, 1.5), st.floats(0.0, 539.0))
def test_a_drop_is_as_many_rows_above_its_shadow_as_the_line_through_the_lamp_says(
    make_rig, x_m, y_m, lamp_x_m, lamp_z_m, row
):
    if np.hypot(x_m, y_m) > 2.4:
        return
    lamp = np.array([lamp_x_m, 0.0, lamp_z_m, 0.1])
    level, _ = staged(make_rig)
    place_m = np.array([x_m, y_m])
    wall_m = shadow_places(place_m, lamp[:2], RADIUS_M)[0]
    depth_m, wall_depth_m = level.depths_m(np.stack([place_m, wall_m]))
    wall_z_m = (269.5 - row) * wall_depth_m / level.focal_px
    share = np.linalg.norm(wall_m - place_m) / np.linalg.norm(wall_m - lamp[:2])
    drop_z_m = wall_z_m + share * (lamp_z_m - wall_z_m)
    drop_row = 269.5 - level.focal_px * drop_z_m / depth_m
    said = rows_above(place_m[None], wall_m, lamp, level, np.array([row]))
    np.testing.assert_allclose(said[:, 0, 0], row - drop_row, atol=1e-6)


@pytest.mark.parametrize("streak_rows", [5, 9, 20])
@pytest.mark.parametrize("rows", [1.5, 4.0])
def test_noise_alone_has_a_significance_of_unit_spread(streak_rows, rows):
    rng = np.random.default_rng(streak_rows)
    passing = np.zeros((24, 240))
    for frame, row in zip(rng.integers(24, size=60), rng.integers(30, 200, size=60), strict=True):
        passing[frame, row : row + streak_rows] = 8.0
    zones, at_px = np.array_split(np.arange(240), 6), np.arange(40.0)
    drops = np.full(1, 20.0), np.full((1, 6), rows)
    found = [
        bright_above(rng.normal(size=(24, 240, 40)).astype(np.float32), passing, at_px, drops, zones)[0, 0, ::8]
        for _ in range(60)
    ]
    assert np.std(found) == pytest.approx(1.0, abs=0.15)  # 60 noises at three places: some 5 %


@pytest.mark.parametrize(("lamp_x_m", "lamp_z_m"), [(-2.3, 0.4), (-2.3, -0.4), (-1.0, 0.5)])
def test_a_drop_that_is_a_fraction_of_its_shadow_is_placed_within_what_is_said_of_it(make_rig, lamp_x_m, lamp_z_m):
    lamp = np.array([lamp_x_m, 0.0, lamp_z_m, 0.1])
    level, _ = staged(make_rig)
    views, shadow_px = views_of(level, NEAR_WALL, lamp=lamp)
    drop, (wall_m, towards) = found(level, views, np.rint(shadow_px), lamp)
    assert drop.sigmas.min() > 3
    place_m = wall_m + drop.distance_m * towards
    assert np.hypot(*(place_m - NEAR_WALL)) < max(4 * drop.distance_sigma_m, 0.02)


@settings(max_examples=25)  # a tenth of a second each
@given(st.lists(st.floats(0, 12), min_size=9, max_size=9).filter(lambda s: sum(s) > 20), st.integers(0, 9))
def test_a_shadow_of_any_profile_shows_no_drop(make_rig, profile_grey, seed):
    level, _ = staged(make_rig)

    def any_shape(off_px):
        return np.interp(off_px, np.arange(-4, 5), profile_grey, left=0, right=0)

    views, shadow_px = views_of(level, NEAR_WALL, any_shape, drop_grey=0.0, seed=seed)
    drop, _ = found(level, views, np.rint(shadow_px))
    assert drop.sigmas.min() < 1.5 or np.linalg.norm(drop.sigmas) < 5.0  # of thousands of places


def test_views_a_row_and_a_half_off_place_the_same(make_rig):
    level, _ = staged(make_rig)
    straight, shadow_px = views_of(level, NEAR_WALL)
    lagging, _ = views_of(level, NEAR_WALL, lag_rows=2)
    one, other = (found(level, views, np.rint(shadow_px))[0] for views in (straight, lagging))
    assert other.distance_m == pytest.approx(one.distance_m, abs=0.015)
    assert other.sigmas.min() > 0.8 * one.sigmas.min()


def test_lamps_between_the_cameras_tell_nothing(make_rig):
    lamp = np.array([-2.4, 0.0, 0.0, 0.1])
    level, _ = staged(make_rig)
    views, shadow_px = views_of(level, NEAR_WALL, lamp=lamp)
    assert found(level, views, shadow_px, lamp)[0] is None


def test_the_pixels_of_a_leaning_view_are_those_of_the_upright_one(make_rig):
    level, _ = staged(make_rig)
    rng, rows, columns = np.random.default_rng(0), np.arange(540.0), np.arange(960.0)
    noise = rng.normal(GREY, 60, (4, 540, 960)).astype(np.float32)
    smooth = np.stack([cv2.GaussianBlur(frame, (0, 0), 3.0) for frame in noise]).astype(np.uint8)
    noise_grey = np.full(511, NOISE_GREY)
    upright = Pixels(smooth, temporal_median(smooth), noise_grey)
    for view in range(2):
        lean = partial(leaning_columns, level, np.radians([1.5, -1.0]), view)
        at_px = lean(rows, columns)
        back = np.stack([np.interp(columns, at_px[row], columns) for row in range(540)]).astype(np.float32)
        grid = np.broadcast_to(np.arange(540, dtype=np.float32)[:, None], back.shape).copy()
        leaning = np.stack([cv2.remap(frame, back, grid, cv2.INTER_LINEAR) for frame in smooth])
        seen, columns_px = Pixels(leaning, temporal_median(leaning), noise_grey, lean).about(400.3, 10)
        straight, same_px = upright.about(400.3, 10)
        np.testing.assert_array_equal(columns_px, same_px)
        assert straight.std() > 2
        assert (seen - straight).std() < 0.25 * straight.std()


def test_an_unsure_place_is_drawn_to_the_drop_and_surer_for_it(make_rig):
    level, rig = staged(make_rig)
    views, shadow_px = views_of(level, NEAR_WALL)
    true_px = level.columns_of(NEAR_WALL[None])[0]
    wrong_px, wide_px2 = true_px + APART_PX, np.diag([0.6, 0.6])
    columns_px, covariance_px2 = placed_by_rows(wrong_px, wide_px2, np.rint(shadow_px), views, (level, rig))
    assert abs((columns_px - true_px) @ APART_PX) < 0.4
    assert np.linalg.eigvalsh(wide_px2 - covariance_px2).min() > -1e-9
    assert APART_PX @ covariance_px2 @ APART_PX < 0.25 * APART_PX @ wide_px2 @ APART_PX
    assert np.linalg.eigvalsh(covariance_px2).min() > 0


def test_a_place_that_took_the_shadow_for_the_drop_is_put_right(make_rig):
    level, rig = staged(make_rig)
    views, shadow_px = views_of(level, NEAR_WALL)
    sure_px2 = np.diag([0.02, 0.02])
    columns_px, _ = placed_by_rows(shadow_px + APART_PX / 3, sure_px2, np.rint(shadow_px), views, (level, rig))
    assert np.hypot(*(level.places_of(columns_px[None])[0] - NEAR_WALL)) < 0.04


def test_sure_places_and_those_of_several_lamps_stay(make_rig):
    level, rig = staged(make_rig)
    _, several = staged(make_rig, np.array([LAMP, [-2.3, 1.0, 0.4, 0.1]]))
    views, shadow_px = views_of(level, NEAR_WALL)
    near_px = level.columns_of(NEAR_WALL[None])[0] + APART_PX
    for covariance_px2, known in ((np.diag([0.005, 0.005]), rig), (np.diag([0.6, 0.6]), several)):
        placed = placed_by_rows(near_px, covariance_px2, shadow_px, views, (level, known))
        np.testing.assert_array_equal(placed[0], near_px)
        np.testing.assert_array_equal(placed[1], covariance_px2)


@pytest.mark.parametrize("apart_px", [-0.05, 0.0, 0.3])
def test_columns_that_meet_nowhere_or_almost_stay(make_rig, apart_px):
    level, rig = staged(make_rig)
    views, shadow_px = views_of(level, NEAR_WALL)
    nowhere_px = np.array([400.0, 400.0 + apart_px])
    with np.errstate(invalid="ignore"):
        placed = placed_by_rows(nowhere_px, np.eye(2), shadow_px, views, (level, rig))
    np.testing.assert_array_equal(placed[0], nowhere_px)


@given(st.floats(-1.0, 8.0), st.floats(0.0, 9.0), st.floats(0.1, 5.0))
def test_drops_are_looked_for_between_the_wall_and_the_lamp_in_even_steps(believed_m, sigma_m, most_m):
    tried_m = distances(believed_m, sigma_m, most_m)
    assert (tried_m < most_m + 0.01).all()
    assert (tried_m >= 0.04).all()
    assert np.diff(tried_m) == pytest.approx(0.01)
