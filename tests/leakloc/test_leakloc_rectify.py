import cv2
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from leakloc import RigError, locate
from leakloc.rectify import MAX_GROWTH, is_rectified, rectified_rig, rectify
from leakloc.rig import depths_m

W, H = 960, 540
MIDDLE = (H - 1) / 2


@st.composite
def raw_rigs(draw, make_rig):
    """Lenses and turns as calibrations find them: barrel or pincushion, some degrees apart, any pose or none."""

    def between(a, b):
        return draw(st.floats(a, b))

    lenses = [
        [between(-0.25, 0.1), between(-0.02, 0.06), between(-2e-3, 2e-3), between(-2e-3, 2e-3), 0.0] for _ in range(2)
    ]
    matrices = []
    for _ in range(2):
        f = between(650, 720)
        matrices.append(
            [[f, 0, 479.5 + between(-15, 15)], [0, f * between(0.99, 1.01), 269.5 + between(-15, 15)], [0, 0, 1]]
        )
    turn = Rotation.from_euler("xyz", [between(-3, 3) for _ in range(3)], degrees=True).as_matrix()
    pose = None
    if draw(st.booleans()):
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_euler("xyz", [between(-180, 180) for _ in range(3)], degrees=True).as_matrix()
        pose[:3, 3] = [between(-5, 5) for _ in range(3)]
    return make_rig(
        D1=lenses[0],
        D2=lenses[1],
        K1=matrices[0],
        K2=matrices[1],
        R=turn,
        T=-turn @ [between(0.2, 0.6), between(-0.02, 0.02), between(-0.02, 0.02)],
        world_from_left=pose,
    )


def project_raw(rig, points_m):
    """Both cameras' raw pixels of points (n, 3) in the rig's frame, by OpenCV's own projection."""
    cameras = ((rig.left_from_frame, rig.K1, rig.D1), (rig.right_from_frame, rig.K2, rig.D2))
    return [
        cv2.projectPoints(points_m, cv2.Rodrigues(pose[:3, :3])[0], pose[:3, 3], K, D)[0][:, 0]
        for pose, K, D in cameras
    ]


def project(P, points_m):
    homogeneous = np.column_stack([points_m, np.ones(len(points_m))]) @ P.T
    return homogeneous[:, :2] / homogeneous[:, 2:]


def points_in_view(rig, seed):
    """Places 1.5 m to 5 m ahead of the left camera within its image, in the rig's frame."""
    rng = np.random.default_rng(seed)
    depth = rng.uniform(1.5, 5, 50)
    camera = np.column_stack([depth * rng.uniform(-0.6, 0.6, 50), depth * rng.uniform(-0.3, 0.3, 50), depth])
    return camera @ rig.frame_from_left[:3, :3].T + rig.frame_from_left[:3, 3]


@given(st.data(), st.integers(0, 2**32))
def test_a_raw_projection_brought_over_is_the_rectified_rigs_own(make_rig, data, seed):
    rig = data.draw(raw_rigs(make_rig))
    straight, views = rectified_rig(rig)
    points = points_in_view(rig, seed)
    rectified = []
    for view, raw, P in zip(views, project_raw(rig, points), (straight.P1, straight.P2), strict=True):
        rectified.append(project(P, points))
        np.testing.assert_allclose(view.to_rectified(raw), rectified[-1], atol=0.02)
        np.testing.assert_allclose(view.to_raw(rectified[-1]), raw, atol=0.02)
    np.testing.assert_allclose(rectified[0][:, 1], rectified[1][:, 1], atol=1e-6)  # rows agree
    disparity = rectified[0][:, 0] - rectified[1][:, 0]
    depth = depths_m(points, straight.left_from_frame)
    np.testing.assert_allclose(disparity, straight.K1[0, 0] * -straight.T[0] / depth, rtol=1e-6)


@given(st.data())
def test_the_rectified_rig_needs_no_rectification_and_keeps_baseline_and_places(make_rig, data):
    rig = data.draw(raw_rigs(make_rig))
    straight, _ = rectified_rig(rig)
    assert is_rectified(straight)
    assert rectified_rig(straight)[0] is straight
    assert np.linalg.norm(straight.T) == pytest.approx(np.linalg.norm(rig.T))
    for ours, theirs in (
        (straight.left_from_frame, rig.left_from_frame),
        (straight.right_from_frame, rig.right_from_frame),
    ):
        centres = [-pose[:3, :3].T @ pose[:3, 3] for pose in (ours, theirs)]
        np.testing.assert_allclose(*centres, atol=1e-5)  # m; stereoRectify takes 1e-5 rad for none


@given(st.data(), st.lists(st.floats(0, W - 1), min_size=1, max_size=9))
def test_the_raw_column_of_a_rectified_one_is_where_it_crosses_the_raw_middle_row(make_rig, data, columns):
    rig = data.draw(raw_rigs(make_rig))
    for view in rectified_rig(rig)[1]:
        raw = np.column_stack([columns, np.full(len(columns), MIDDLE)])
        there = view.to_rectified(raw)
        assume(np.abs(view.to_raw(there) - raw).max() < 1e-6)  # else the lens folds back before it reaches that pixel
        np.testing.assert_allclose(view.raw_columns(there[:, 0], H), columns, atol=1e-4)


@given(st.data())
def test_no_column_of_the_raw_middle_row_is_cut_off_unless_the_image_would_grow_over_its_limit(make_rig, data):
    rig = data.draw(raw_rigs(make_rig))
    straight, views = rectified_rig(rig)
    assert straight.image_size[0] <= MAX_GROWTH * W + 2
    middle_row = np.column_stack([np.arange(W), np.full(W, MIDDLE)])
    rows = [view.to_rectified(middle_row).T for view in views]
    assume(np.ptp([u_px for u_px, _ in rows]) < 1.25 * W)  # else lenses that all but fold at the edge of the image
    for u_px, v_px in rows:
        assert u_px.min() >= 0
        assert u_px.max() <= straight.image_size[0] - 1
        assert v_px.min() >= 0
        assert v_px.max() <= straight.image_size[1] - 1


def test_a_column_that_never_meets_the_middle_row_is_undefined(make_rig):
    view = rectified_rig(make_rig(D1=[-0.3, 0, 0, 0, 0]))[1][0]
    assert np.isnan(view.raw_columns([1e6], H)).all()
    assert len(view.raw_columns([], H)) == 0


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_blob_of_the_raw_frames_lands_where_the_rectified_rig_projects_its_place(make_rig, dtype):
    R = Rotation.from_euler("xyz", [1, -2, 1.5], degrees=True).as_matrix()
    rig = make_rig(D1=[-0.2, 0.05, 1e-3, 1e-3, 0], D2=[-0.1, 0, 0, 0, 0], R=R, T=-R @ [0.5, 0.01, -0.02])
    points = points_in_view(rig, 3)[:8]
    top = 200 * (257 if dtype == np.uint16 else 1)
    v_px, u_px = np.mgrid[:H, :W]
    frames = [
        np.array([top * np.exp(-((u_px - u) ** 2 + (v_px - v) ** 2) / 18) for u, v in raw]).round().astype(dtype)
        for raw in project_raw(rig, points)
    ]
    rectified = rectify(*frames, rig)
    v_px, u_px = np.mgrid[: rectified.rig.image_size[1], : rectified.rig.image_size[0]]
    for straight, P in ((rectified.left, rectified.rig.P1), (rectified.right, rectified.rig.P2)):
        assert straight.dtype == dtype
        seen = 0
        for image, (u, v) in zip(straight.astype(float), project(P, points), strict=True):
            if image.max() > 0.9 * top and 20 < u < u_px.shape[1] - 20 and 20 < v < u_px.shape[0] - 20:
                centroid = np.array([(image * u_px).sum(), (image * v_px).sum()]) / image.sum()
                np.testing.assert_allclose(centroid, [u, v], atol=0.05)
                seen += 1
        assert seen >= 4


def test_a_rig_that_needs_nothing_gets_the_very_same_arrays(make_rig, make_dripping):
    left, right = make_dripping([70]), make_dripping([50])
    for rig in (make_rig(120, 40), make_rig(120, 40, world_from_left=None)):
        rectified = rectify(left, right, rig)
        assert rectified.left is left
        assert rectified.right is right
        assert rectified.rig is rig
        estimate = locate(left, right, rig, method="paper")
        back = rectified.estimate_of_raw(estimate)
        assert back.frame == estimate.frame
        assert back.leaks[0].left_column_px == pytest.approx(70, abs=1e-9)
        assert back.leaks[0].x_m == estimate.leaks[0].x_m


def drips(rig, place_m, n=8):
    """Drops of 6 cm falling along the vertical line through a place, in both raw images."""
    frames = np.full((2, n, H, W), 20, np.uint8)
    for k in range(n):
        for top in np.arange(-1, 1, 0.25):
            z_m = np.linspace(top, top - 0.06, 60) - 0.031 * k
            line = np.column_stack([np.tile(place_m, (60, 1)), z_m])
            for view, raw in enumerate(project_raw(rig, line)):
                u, v = raw.round().astype(int).T
                inside = (u >= 0) & (u < W) & (v >= 0) & (v < H)
                frames[view, k, v[inside], u[inside]] = 150
    return frames


@pytest.mark.parametrize("pose", ["world", "left camera"])
def test_a_leak_behind_bent_lenses_is_found_at_its_place_and_reported_in_raw_columns(make_rig, pose):
    R = Rotation.from_euler("y", -2, degrees=True).as_matrix()  # toed: the rig stays level
    rig = make_rig(D1=[-0.2, 0.05, 0, 0, 0], D2=[-0.2, 0.05, 0, 0, 0], R=R, T=-R @ [0.5, 0, 0])
    if pose == "left camera":
        rig = make_rig(D1=rig.D1, D2=rig.D2, R=R, T=rig.T, world_from_left=None)
    place = (rig.frame_from_left @ [0.9, 0, 2.2, 1])[:2]  # near the edge, where the lens bends by 30 px
    left, right = drips(rig, place)
    rectified = rectify(left, right, rig)
    estimate = rectified.estimate_of_raw(locate(rectified.left, rectified.right, rectified.rig, method="paper"))
    assert estimate.frame == pose
    (leak,) = estimate.leaks
    assert np.hypot(leak.x_m - place[0], leak.y_m - place[1]) < 0.03  # a pixel of disparity is 14 mm here
    at_camera_height = np.array([[*place, z] for z in np.linspace(-1, 1, 2001)])
    for raw, column in zip(
        project_raw(rig, at_camera_height), (leak.left_column_px, leak.right_column_px), strict=True
    ):
        crossing = np.interp(MIDDLE, *raw[np.argsort(raw[:, 1])].T[::-1])
        assert column == pytest.approx(crossing, abs=1.0)
    wrong = locate(left, right, make_rig(R=R, T=rig.T, world_from_left=rig.world_from_left), method="paper")
    assert all(np.hypot(k.x_m - place[0], k.y_m - place[1]) > 0.05 for k in wrong.leaks)  # without the lenses it is off


def test_the_deviation_of_a_column_is_scaled_with_it(make_rig):
    rig = make_rig(D1=[-0.2, 0, 0, 0, 0], D2=[-0.2, 0, 0, 0, 0])
    left, right = drips(rig, (0.0, 0.0))
    rectified = rectify(left, right, rig)
    estimate = locate(rectified.left, rectified.right, rectified.rig, method="paper")
    object.__setattr__(estimate.leaks[0], "column_sigma_px", 1.0)
    back = rectified.estimate_of_raw(estimate).leaks[0]
    columns = [estimate.leaks[0].left_column_px, estimate.leaks[0].right_column_px]
    slopes = [view.raw_columns([c, c + 1], H) @ [-1, 1] for view, c in zip(rectified.views, columns, strict=True)]
    assert back.column_sigma_px == pytest.approx(np.mean(slopes))
    assert 0.9 < back.column_sigma_px < 1.0


def test_cameras_above_each_other_and_frames_of_another_size_are_refused(make_rig, make_dripping):
    with pytest.raises(RigError, match="cameras side by side"):
        rectified_rig(make_rig(T=[-0.1, -0.5, 0]))
    frames = make_dripping([70])
    with pytest.raises(ValueError, match=r"rectify: right must be .*\(120, 40\), got shape \(6, 40, 100\)"):
        rectify(frames, frames[:, :, :100], make_rig(120, 40))
