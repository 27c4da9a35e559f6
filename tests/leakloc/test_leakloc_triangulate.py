import cv2
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from leakloc import Rig
from leakloc.paper import triangulate_columns
from leakloc.rig import depths_m
from leakloc.triangulate import column_planes, meet_at_camera_height, undistort_columns

W, H = 960, 540


def pixels(P, points):
    homogeneous = np.atleast_2d(np.column_stack([points, np.ones(len(points))])) @ P.T
    return homogeneous[:, :2] / homogeneous[:, 2:]


@st.composite
def rigs(draw):
    """Any baseline, fields of view, place and attitude; the cameras also turned against each other."""
    angle = st.floats(-10, 10)
    hfov = draw(st.floats(30, 110))
    f = (W / 2) / np.tan(np.radians(hfov) / 2)
    K = np.array([[f, 0, (W - 1) / 2], [0, f, (H - 1) / 2], [0, 0, 1]])
    K2 = K.copy()
    K2[0] = draw(st.floats(0.9, 1.1)) * f, 0, draw(st.floats(-9, 9)) + (W - 1) / 2
    world_from_left = np.eye(4)
    forward = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    turn = Rotation.from_euler("ZYX", [draw(st.floats(-180, 180)), draw(angle), draw(angle)], degrees=True).as_matrix()
    world_from_left[:3, :3] = turn @ forward
    world_from_left[:3, 3] = draw(st.tuples(*[st.floats(-3, 3)] * 3))
    R = Rotation.from_euler(
        "yxz", [draw(st.floats(-5, 5)), draw(st.floats(-1, 1)), draw(st.floats(-1, 1))], degrees=True
    )
    T = [-draw(st.floats(0.05, 1.0)), draw(st.floats(-0.01, 0.01)), draw(st.floats(-0.01, 0.01))]
    return Rig(K, np.zeros(5), K2, np.zeros(5), R.as_matrix(), T, (W, H), world_from_left)


def seen_from(rig, depth_m, sideways):
    """A point at z = 0 of the frame, about `depth_m` in front of the left camera."""
    forward = rig.frame_from_left[:2, 2]
    right = rig.frame_from_left[:2, 0]
    x, y = rig.frame_from_left[:2, 3] + depth_m * (forward + sideways * right)
    return np.array([[x, y, 0.0]])


@given(rigs(), st.floats(0.5, 6), st.floats(-0.5, 0.5))
def test_projecting_a_place_and_triangulating_its_columns_returns_the_place(rig, depth_m, sideways):
    place = seen_from(rig, depth_m, sideways)
    assume(depths_m(place, rig.left_from_frame)[0] > 0.1 and depths_m(place, rig.right_from_frame)[0] > 0.1)
    columns = np.column_stack([pixels(P, place)[:, 0] for P in (rig.P1, rig.P2)])
    found = triangulate_columns(columns, rig)
    np.testing.assert_allclose(found, place[:, :2], atol=1e-6)


@given(st.floats(0.5, 6), st.floats(-0.5, 0.5), st.floats(-180, 180), st.floats(-0.3, 0.3))
def test_any_height_of_a_vertical_line_gives_its_place_when_the_rig_is_level(make_rig, depth_m, sideways, yaw, z_m):
    world_from_left = np.eye(4)
    world_from_left[:3, :3] = (
        Rotation.from_euler("z", yaw, degrees=True).as_matrix() @ make_rig().frame_from_left[:3, :3]
    )
    rig = make_rig(world_from_left=world_from_left)
    place = seen_from(rig, depth_m, sideways) + np.array([0, 0, z_m])
    columns = np.column_stack([pixels(P, place)[:, 0] for P in (rig.P1, rig.P2)])
    np.testing.assert_allclose(triangulate_columns(columns, rig), place[:, :2], atol=1e-8)


def test_the_middle_of_the_pedestal_is_seen_at_columns_550_91_and_408_09(make_rig):
    rig = make_rig()
    assert rig.K1[0, 0] == pytest.approx(685.51, abs=0.005)
    assert pixels(rig.P1, np.zeros((1, 3)))[0] == pytest.approx([550.91, 269.5], abs=0.005)
    assert pixels(rig.P2, np.zeros((1, 3)))[0] == pytest.approx([408.09, 269.5], abs=0.005)
    np.testing.assert_allclose(triangulate_columns(np.array([[550.91, 408.09]]), rig), [[0, 0]], atol=2e-4)


def test_one_pixel_of_disparity_at_mid_pedestal_is_17_millimetres(make_rig):
    """Z^2 / (f B) = 2.4^2 / (685.51 * 0.5) = 16.8 mm."""
    places = triangulate_columns(np.array([[550.91, 408.09], [551.41, 407.59]]), make_rig())
    assert places[0, 0] - places[1, 0] == pytest.approx(0.0168, rel=0.01)


def test_without_a_pose_places_are_forward_and_left_of_the_left_camera(make_rig):
    rig = make_rig(world_from_left=None)
    assert rig.frame == "left camera"
    np.testing.assert_allclose(triangulate_columns(np.array([[550.91, 408.09]]), rig), [[2.4, -0.25]], atol=2e-4)


@given(rigs(), st.floats(0.5, 6), st.floats(-0.5, 0.5))
def test_opencv_triangulates_the_same_place(rig, depth_m, sideways):
    place = seen_from(rig, depth_m, sideways)
    assume(depths_m(place, rig.left_from_frame)[0] > 0.1 and depths_m(place, rig.right_from_frame)[0] > 0.1)
    left, right = (pixels(P, place) for P in (rig.P1, rig.P2))
    homogeneous = cv2.triangulatePoints(rig.P1, rig.P2, left.T, right.T)[:, 0]
    theirs = homogeneous[:2] / homogeneous[3]
    ours = triangulate_columns(np.column_stack([left[:, 0], right[:, 0]]), rig)[0]
    np.testing.assert_allclose(ours, theirs, atol=1e-6)


@given(rigs(), st.floats(0, W - 1), st.floats(0, W - 1))
def test_swapping_the_cameras_swaps_nothing_on_the_top_view(rig, left_px, right_px):
    left, right = column_planes([left_px], rig.P1, H), column_planes([right_px], rig.P2, H)
    one, other = meet_at_camera_height(left, right), meet_at_camera_height(right, left)
    np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)


@given(rigs(), st.floats(0, W - 1), st.floats(0, H - 1), st.floats(0.3, 6))
def test_the_plane_of_a_column_holds_everything_seen_on_it(rig, column_px, row_px, depth_m):
    ray = np.linalg.solve(rig.K1, [column_px, row_px, 1.0]) * depth_m
    point = rig.frame_from_left @ [*ray, 1.0]
    plane = column_planes([column_px], rig.P1, H)[0]
    assert plane @ point == pytest.approx(0, abs=1e-9 * np.linalg.norm(plane))


def test_equal_columns_of_parallel_cameras_meet_nowhere(make_rig):
    assert np.isnan(triangulate_columns(np.array([[300, 300], [0, 0]]), make_rig())).all()


@given(st.floats(-0.35, 0.2), st.floats(-0.05, 0.05), st.floats(1.5, 6), st.floats(-0.4, 0.4))
def test_a_distorted_column_is_put_straight_at_mid_row(make_rig, k1, k2, depth_m, sideways):
    rig = make_rig(D1=[k1, k2, 0, 0, 0], D2=[k1 / 2, 0, 0, 0, 0], K2=make_rig().K1 * [[1.1], [1], [1]])
    place = seen_from(rig, depth_m, sideways)
    columns = []
    for K, D, pose in ((rig.K1, rig.D1, rig.left_from_frame), (rig.K2, rig.D2, rig.right_from_frame)):
        seen, _ = cv2.projectPoints(place, cv2.Rodrigues(pose[:3, :3])[0], pose[:3, 3], K, D)
        columns.append(seen[0, 0, 0])
    np.testing.assert_allclose(triangulate_columns(np.array([columns]), rig), place[:, :2], atol=1e-5)


def test_columns_of_a_lens_without_distortion_are_returned_to_the_bit(make_rig):
    columns = np.array([0.0, 123.4, 959.0])
    assert np.array_equal(undistort_columns(columns, make_rig().K1, np.zeros(5), H), columns)
