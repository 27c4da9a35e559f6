"""Pose, projection and lens conventions, pinned by numbers that can be checked by hand."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simcam import Camera, Lens, Pose, Tilt, stereo_rig

ANGLE_DEG = 2.0
PAPER_F = 480 / np.tan(np.radians(35))
BARREL = (-0.2, 0.05, 0.001, -0.002, 0.01)


def columns(rig, point):
    return rig.left.project(np.array(point, float))[0], rig.right.project(np.array(point, float))[0]


def test_the_papers_rig_sees_a_leak_on_the_axis_at_550_91_and_408_09():
    left, right = columns(stereo_rig(), (0, 0, 0))
    assert left == pytest.approx(550.91, abs=0.005)
    assert right == pytest.approx(408.09, abs=0.005)
    assert stereo_rig().left.camera_matrix[0, 0] == pytest.approx(685.51, abs=0.005)


# u = 479.5 - f (y -+ 0.25) / (x + 2.4) by hand
@pytest.mark.parametrize(
    ("place", "left", "right"),
    [((0.0, 0.1, 0.0), 522.34, 379.53), ((1.0, 0.0, 0.0), 529.91, 429.09), ((0.6, -0.5, 0.0), 650.88, 536.63)],
)
def test_other_leaks_are_where_the_pin_hole_puts_them(place, left, right):
    assert columns(stereo_rig(), place) == pytest.approx((left, right), abs=0.01)


def test_the_pose_of_the_papers_left_camera_is_the_contracts_matrix():
    expected = [[0, 0, 1, -2.4], [-1, 0, 0, 0.25], [0, -1, 0, 0], [0, 0, 0, 1]]
    np.testing.assert_allclose(stereo_rig().left.world_from_camera, expected, atol=1e-15)


def test_the_centre_of_the_top_left_pixel_is_the_origin():
    camera = stereo_rig().left
    ray = camera.rays(np.array([0.0, 0.0]))
    expected = [1.0, 479.5 / PAPER_F, 269.5 / PAPER_F]
    np.testing.assert_allclose(ray / ray[0], expected, rtol=1e-12)


def test_pitch_looks_down_so_the_axis_point_moves_up_by_f_tan_pitch():
    rig = stereo_rig(pose=Pose(pitch_deg=ANGLE_DEG))
    _, row = rig.left.project([0.0, 0.25, 0.0])
    assert row == pytest.approx(269.5 - PAPER_F * np.tan(np.radians(ANGLE_DEG)), abs=1e-6)


def test_yaw_turns_left_so_the_axis_point_moves_right_by_f_tan_yaw():
    rig = stereo_rig(pose=Pose(yaw_deg=ANGLE_DEG))
    middle = np.mean([camera.project([0.0, 0.0, 0.0])[0] for camera in (rig.left, rig.right)])
    assert middle > 479.5 + 0.95 * PAPER_F * np.tan(np.radians(ANGLE_DEG))
    turned = stereo_rig(pose=Pose(position_m=(0.0, 0.0, 0.0), yaw_deg=90.0))
    np.testing.assert_allclose(turned.left.rotation[:, 2], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(turned.left.centre_world_m, [-0.25, 0, 0], atol=1e-15)


def test_roll_lifts_the_left_side():
    rig = stereo_rig(pose=Pose(roll_deg=ANGLE_DEG))
    lift = 0.25 * np.sin(np.radians(ANGLE_DEG))
    assert rig.left.centre_world_m[2] == pytest.approx(lift)
    assert rig.right.centre_world_m[2] == pytest.approx(-lift)
    # clockwise seen from behind: a plumb line's lower end appears to the right of its upper end
    camera = stereo_rig(pose=Pose(roll_deg=ANGLE_DEG), baseline_m=1e-9).left
    top, bottom = camera.project([[0.0, 0.0, 0.5], [0.0, 0.0, -0.5]])
    assert (bottom[0] - top[0]) / (bottom[1] - top[1]) == pytest.approx(np.tan(np.radians(ANGLE_DEG)))


def test_a_relative_error_turns_the_right_camera_about_its_own_centre():
    straight, turned = stereo_rig(), stereo_rig(right_error=Tilt(yaw_deg=0.1))
    np.testing.assert_array_equal(straight.left.world_from_camera, turned.left.world_from_camera)
    np.testing.assert_array_equal(straight.right.centre_world_m, turned.right.centre_world_m)
    shift = turned.right.project([0.0, -0.25, 0.0])[0] - 479.5
    assert shift == pytest.approx(PAPER_F * np.tan(np.radians(0.1)))


def test_a_point_behind_the_camera_has_no_pixel():
    assert np.isnan(stereo_rig().left.project([-3.0, 0.0, 0.0])).all()


def test_projection_with_distortion_is_opencvs():
    camera = stereo_rig(pose=Pose(roll_deg=3, pitch_deg=-2, yaw_deg=5), lens=Lens(distortion=BARREL)).left
    points = np.random.default_rng(1).uniform((-0.5, -1, -0.8), (2, 1, 0.8), (50, 3))
    world_to_camera = np.linalg.inv(camera.world_from_camera)
    rotation, _ = cv2.Rodrigues(world_to_camera[:3, :3])
    expected, _ = cv2.projectPoints(points, rotation, world_to_camera[:3, 3], camera.camera_matrix, camera.distortion)
    np.testing.assert_allclose(camera.project(points), expected[:, 0], atol=1e-9)


@given(
    angles=st.tuples(*[st.floats(-20, 20)] * 3),
    k1=st.floats(-0.2, 0.2),
    p1=st.floats(-0.005, 0.005),
    pixel=st.tuples(st.floats(0, 959), st.floats(0, 539)),
    range_m=st.floats(0.1, 5),
)
def test_projecting_a_back_projected_pixel_returns_the_pixel(angles, k1, p1, pixel, range_m):
    lens = Lens(distortion=(k1, 0.02, p1, -p1, 0.0))
    camera = stereo_rig(pose=Pose(*angles), lens=lens).right
    ray = camera.rays(np.array(pixel))
    assert np.linalg.norm(ray) == pytest.approx(1)
    np.testing.assert_allclose(camera.project(camera.centre_world_m + range_m * ray), pixel, atol=1e-6)


def test_a_lens_that_folds_has_no_ray_beyond_the_fold():
    camera = stereo_rig(lens=Lens(distortion=(-2.0, 0.0, 0.0, 0.0, 0.0))).left
    assert np.isnan(camera.rays(np.array([0.0, 0.0]))).all()
    assert np.isfinite(camera.rays(np.array([479.5, 269.5]))).all()


@pytest.mark.parametrize(
    ("make", "rule"),
    [
        (lambda: Lens(hfov_deg=180.0), "hfov_deg"),
        (lambda: Lens(distortion=(0.1,)), "distortion"),
        (lambda: stereo_rig(baseline_m=0.0), "baseline_m"),
        (lambda: Camera(0, 10, np.eye(3), np.zeros(5), np.eye(4)), "1 x 1"),
        (lambda: Camera(10, 10, np.eye(3), np.zeros(4), np.eye(4)), "distortion"),
        (lambda: Camera(10, 10, np.eye(3), np.zeros(5), 2 * np.eye(4)), "rotation"),
    ],
)
def test_impossible_cameras_are_refused_by_name(make, rule):
    with pytest.raises(ValueError, match=rule):
        make()
