"""Level views, tilt, glints and shadows: laws of geometry that the robust method stands on."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from leakloc import RigError, locate, panned
from leakloc.glints import WATER_INDEX, glint_offsets, reflectance
from leakloc.levelled import level_pair
from leakloc.rectify import rectified_rig
from leakloc.robust import raw_columns
from leakloc.shadows import penumbra_m, shadow_places
from leakloc.tilt import leaning_columns, level_under, tilted_rig
from leakloc.triangulate import column_planes, meet_at_camera_height

places = st.tuples(st.floats(-1.5, 2.4), st.floats(-1.5, 1.5))
seen_places = st.tuples(st.floats(0.0, 2.4), st.floats(-0.8, 0.8))
tilts_deg = st.tuples(st.floats(-3, 3), st.floats(-3, 3))


@given(places)
def test_the_columns_of_a_place_lead_back_to_it(make_rig, place_m):
    level = level_pair(make_rig())
    np.testing.assert_allclose(level.places_of(level.columns_of([place_m]))[0], place_m, atol=1e-9)


def test_a_leak_at_the_origin_has_the_columns_of_the_contract(make_rig):
    np.testing.assert_allclose(level_pair(make_rig()).columns_of([[0.0, 0.0]])[0], [550.91, 408.09], atol=5e-3)


@given(places)
def test_a_level_rig_triangulates_as_the_paper_does(make_rig, place_m):
    rig = make_rig()
    columns = level_pair(rig).columns_of([place_m])[0]
    planes = [column_planes([c], P, 540) for c, P in zip(columns, (rig.P1, rig.P2), strict=True)]
    np.testing.assert_allclose(meet_at_camera_height(*planes)[0], place_m, atol=1e-9)


def test_a_level_rig_needs_no_remapping_and_a_tilted_one_does(make_rig):
    rig = make_rig()
    level = level_pair(rig)
    assert level.maps == (None, None)
    assert None not in level_pair(tilted_rig(rig, level, np.radians([1.0, 0.0]))).maps


@given(k1=st.floats(-0.3, 0.1), tilt_deg=tilts_deg, place_m=places)
def test_the_level_view_holds_what_the_raw_middle_row_sees_whatever_the_lens(make_rig, k1, tilt_deg, place_m):
    lens = np.array([k1, 0.0, 0.0, 0.0, 0.0])
    rig = make_rig(D1=lens, D2=lens)
    believed = level_pair(rig)
    upright = level_under(rig, believed, np.radians(tilt_deg))
    assert upright.image_size == believed.image_size  # one picture, whatever the tilt turns out to be
    assert (np.array(believed.image_size) >= rig.image_size).all()
    np.testing.assert_allclose(believed.places_of(believed.columns_of([place_m]))[0], place_m, atol=1e-9)
    ends = np.array([[0.0, 269.5], [959.0, 269.5], [479.5, 0.0], [479.5, 539.0]])
    for view, K in enumerate((rig.K1, rig.K2)):
        straight = cv2.undistortPoints(ends[:, None], K, lens, criteria=(3, 100, 1e-12))[:, 0]
        seen_px = believed.focal_px * straight + believed.principal_px[view]
        assert (seen_px > -1e-6).all()
        assert (seen_px < np.array(believed.image_size) - 1 + 1e-6).all()


def test_behind_a_barrel_lens_a_leak_at_the_side_is_found(make_rig):
    lens = np.array([-0.3, 0.0, 0.0, 0.0, 0.0])
    rig = make_rig(480, 270, D1=lens, D2=lens)
    # a column of the raw image is no plumb line away from its middle: the drops are drawn where the lens shows them
    place_m, rng = np.array([0.0, 1.6]), np.random.default_rng(3)
    views = [rng.normal(60.0, 1.0, (10, 270, 480)) for _ in range(2)]
    for frame in range(10):
        line_m = np.column_stack([np.tile(place_m, (12, 1)), 0.9 - 0.17 * frame - 0.004 * np.arange(12)])
        for view, motion, K in zip(views, (rig.left_from_frame, rig.right_from_frame), (rig.K1, rig.K2), strict=True):
            camera_m = line_m @ motion[:3, :3].T + motion[:3, 3]
            spots = cv2.projectPoints(camera_m[:, None], np.zeros(3), np.zeros(3), K, lens)[0][:, 0]
            for column, row in spots:
                if 2 <= row < 267:
                    view[frame, int(row) - 2 : int(row) + 3, round(column) - 1 : round(column) + 2] = 110.0
    left, right = (np.clip(np.rint(view), 0, 255).astype(np.uint8) for view in views)
    (leak,) = locate(left, right, rig).leaks
    assert (leak.x_m, leak.y_m) == pytest.approx(tuple(place_m), abs=0.05)
    assert leak.right_column_px < 30  # of a picture that began at column 36 before


@given(places, tilts_deg, st.floats(-0.8, 0.8), st.sampled_from([0, 1]))
def test_a_point_of_a_plumb_line_is_seen_where_leaning_columns_say(make_rig, place_m, tilt_deg, height_m, view):
    rig = make_rig()
    believed, tilt = level_pair(rig), np.radians(tilt_deg)
    standing = tilted_rig(rig, believed, tilt)
    seen = (standing.P1, standing.P2)[view] @ [*place_m, height_m, 1.0]
    assume(seen[2] > 0.5)
    column, row = seen[:2] / seen[2]
    upright = level_under(rig, believed, tilt).columns_of([place_m])[0, view]
    told = leaning_columns(believed, tilt, view, np.array([row]), np.array([upright]))[0, 0]
    assert told == pytest.approx(column, abs=1e-6)


def test_roll_lifts_the_left_side_and_pitch_looks_down(make_rig):
    rig = make_rig()
    level = level_pair(rig)
    rolled, pitched = (tilted_rig(rig, level, np.radians(t)) for t in ([2.0, 0.0], [0.0, 2.0]))
    left_m, right_m = (
        -np.linalg.inv(m)[:3, :3] @ np.zeros(3) + np.linalg.inv(m)[:3, 3]
        for m in (rolled.left_from_frame, rolled.right_from_frame)
    )
    assert left_m[2] > 0 > right_m[2]
    assert pitched.left_from_frame[2, 2] < 0  # the optical axis points below the horizon


def glints_at(angle_rad, side=1.0):
    lamp_m = 3.0 * np.array([np.cos(angle_rad), side * np.sin(angle_rad), 0.0])
    return glint_offsets(np.array([3.0, 0, 0]), lamp_m, np.zeros(3), np.array([0.0, 1.0, 0.0]))


@given(st.floats(0.05, 0.6), st.booleans())
def test_the_glints_stand_on_opposite_sides_of_the_centre(angle_rad, mirrored):
    side = -1.0 if mirrored else 1.0
    offsets, strengths = glints_at(angle_rad, side)
    assert side * offsets[0] == pytest.approx(np.sin(angle_rad / 2), abs=1e-4)
    for image in (1, 2):
        b = -side * offsets[image]
        assert b > 0
        if strengths[image] > 0.1 * strengths[1]:
            assert 4 * np.arcsin(b / WATER_INDEX) - 2 * np.arcsin(b) == pytest.approx(angle_rad, abs=3e-3)
    assert (strengths >= 0).all()


@given(st.floats(0.04, 0.5))
def test_the_mirrored_glint_has_fresnels_share_of_a_quarter(angle_rad):
    # a sphere that mirrors all light sends it evenly in all directions: pi r^2 / (4 pi) per solid angle
    _, strengths = glints_at(angle_rad)
    assert strengths[0] == pytest.approx(float(reflectance(np.array(angle_rad / 2))) / 4, rel=0.02)


def test_near_backscatter_the_inner_glint_is_almost_four_times_the_mirrored_one():
    _, strengths = glints_at(0.05)
    assert strengths[1] / strengths[0] == pytest.approx(3.9, rel=0.03)


def test_below_its_least_angle_the_second_way_round_the_rainbow_is_not_seen():
    least = 4 * np.arcsin(1 / WATER_INDEX) - np.pi
    assert glints_at(least - 0.05)[1][2] == 0
    assert glints_at(least + 0.05)[1][2] > 0


def test_a_lamp_at_the_camera_glitters_in_the_middle():
    offsets, _ = glint_offsets(np.array([3.0, 0, 0]), np.array([2.0, 0, 0]), np.zeros(3), np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(offsets[:2], 0.0, atol=1e-12)


@given(places, st.tuples(st.floats(-2.4, -1.8), st.floats(-0.5, 0.5)))
def test_a_shadow_is_on_the_wall_and_behind_the_leak_as_the_lamp_sees_it(place_m, lamp_m):
    assume(np.hypot(*place_m) < 2.45)
    place, lamp = np.array(place_m), np.array(lamp_m)
    assume(np.linalg.norm(place - lamp) > 0.05)
    shadow = shadow_places(place, lamp, 2.5)[0]
    assert np.hypot(*shadow) == pytest.approx(2.5)
    ray, onward = place - lamp, shadow - lamp
    assert ray[0] * onward[1] - ray[1] * onward[0] == pytest.approx(0.0, abs=1e-9)
    assert onward @ ray >= ray @ ray


def test_a_leak_beyond_the_wall_throws_no_shadow():
    assert np.isnan(shadow_places([2.6, 0.0], np.array([-2.3, 0.0]), 2.5)).all()


def test_a_lamp_half_way_to_the_wall_smears_by_its_own_radius():
    blur_m, magnified = penumbra_m(np.zeros(2), np.array([2.4, 0.0]), np.array([-2.4, 0.0]), 0.1)
    assert (blur_m, magnified) == (pytest.approx(0.1), pytest.approx(2.0))


@given(seen_places, st.floats(-10, 30), st.floats(-2.0, 3.0), st.sampled_from([0.0, -0.2]))
def test_the_columns_of_a_leak_are_where_its_line_crosses_the_middle_row_however_the_rig_looks(
    make_rig, place_m, pitch_deg, camera_z_m, k1
):
    lens = np.array([k1, 0.0, 0.0, 0.0, 0.0])
    upright = make_rig(D1=lens, D2=lens)
    pose = np.array(upright.frame_from_left)
    cos, sin = np.cos(np.radians(pitch_deg)), np.sin(np.radians(pitch_deg))
    pose[:3, :3] = np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]]) @ pose[:3, :3]
    pose[2, 3] = camera_z_m
    rig = replace(upright, world_from_left=pose)
    columns = raw_columns(np.array(place_m), rig)
    for column, motion, K in zip(columns, (rig.left_from_frame, rig.right_from_frame), (rig.K1, rig.K2), strict=True):
        x, y = cv2.undistortPoints(np.array([[[column, 269.5]]]), K, lens, criteria=(3, 100, 1e-12))[0, 0]
        foot_m, up = motion[:3] @ [*place_m, 0.0, 1.0], motion[:3, 2]
        # the ray through the pixel lies in the plane of the line and the camera
        assert np.dot(np.cross(foot_m, up), [x, y, 1.0]) == pytest.approx(0.0, abs=2e-3 * np.linalg.norm(foot_m))


def test_without_a_pose_lamps_and_wall_stand_nowhere_and_count_for_nothing(make_rig):
    lamps = [[-2.3, 0.0, 0.4, 0.1]]
    rig = make_rig(world_from_left=None, lamps=lamps, pedestal_radius=2.5)
    for one in (rig.of_known_place(), panned(rig, 0.0), rectified_rig(replace(rig, D1=[0.01, 0, 0, 0, 0]))[0]):
        assert one.lamps is None
        assert one.pedestal_radius is None
    placed = make_rig(lamps=lamps, pedestal_radius=2.5)
    assert placed.of_known_place() is placed
    assert panned(placed, 10.0).pedestal_radius == 2.5


def test_a_rig_without_a_pose_finds_beyond_the_walls_radius_whether_it_is_panned_or_not(make_rig):
    bare, rng = make_rig(480, 270, world_from_left=None), np.random.default_rng(5)
    walled = replace(bare, pedestal_radius=2.5)
    place_m = np.array([3.0, 0.05])  # of the left camera
    columns_px = np.rint(level_pair(bare).columns_of(place_m[None])[0]).astype(int)
    views = []
    for column in columns_px:
        view = rng.normal(60.0, 1.0, (10, 270, 480))
        for frame in range(10):
            view[frame, 25 * frame : 25 * frame + 20, column - 1 : column + 2] = 110.0
        views.append(np.clip(np.rint(view), 0, 255).astype(np.uint8))
    for rig in (bare, walled, panned(walled, 0.0)):
        (leak,) = locate(*views, rig).leaks
        assert (leak.x_m, leak.y_m) == pytest.approx(tuple(place_m), abs=0.1)


def test_cameras_above_one_another_are_a_rig_error(make_rig):
    with pytest.raises(RigError, match="more level than steep"):
        level_pair(make_rig(T=[0.0, -0.5, 0.0]))
