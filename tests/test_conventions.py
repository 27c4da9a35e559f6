"""The contract between the parts, pinned by numbers that a reader can check by hand and by laws across the packages."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import simcam
from leakloc.paper import triangulate_columns
from leakloc.triangulate import column_planes, meet_at_camera_height
from scenarios.build import believed_rig, true_rig
from scenarios.rules import violations
from scenarios.scenario import BelievedRigTable, RigTable, Scenario

PAPER = Scenario()


def test_the_papers_rig_is_the_default():
    assert true_rig(PAPER).left.centre_world_m == pytest.approx([-2.4, 0.25, 0.0])
    assert true_rig(PAPER).right.centre_world_m == pytest.approx([-2.4, -0.25, 0.0])
    # f = (960 / 2) / tan(35 deg) = 480 / 0.700208 = 685.51
    assert true_rig(PAPER).left.camera_matrix[0, 0] == pytest.approx(685.51, abs=0.005)


def test_a_leak_on_the_axis_is_seen_at_columns_550_91_and_408_09():
    # 479.5 +- 685.51 * 0.25 / 2.4
    rig = true_rig(PAPER)
    assert rig.left.project(np.zeros(3)) == pytest.approx([550.91, 269.5], abs=0.005)
    assert rig.right.project(np.zeros(3)) == pytest.approx([408.09, 269.5], abs=0.005)


def test_the_believed_rig_of_the_paper_is_that_of_the_contract():
    rig = believed_rig(PAPER)
    assert np.allclose(rig.R, np.eye(3))
    assert np.allclose(rig.T, [-0.5, 0.0, 0.0])
    assert np.allclose(rig.world_from_left, [[0, 0, 1, -2.4], [-1, 0, 0, 0.25], [0, -1, 0, 0], [0, 0, 0, 1]])
    assert np.allclose(rig.lamps, [[-2.3, 0.0, 0.4, 0.1]])
    assert rig.pedestal_radius == 2.5


@pytest.mark.parametrize(
    ("turn", "point_m", "axis", "sign"),
    [
        pytest.param({"yaw_deg": 3.0}, (1.0, 0.0, 0.0), 0, +1, id="+yaw turns left, so things move right"),
        pytest.param({"pitch_deg": 3.0}, (1.0, 0.0, 0.0), 1, -1, id="+pitch looks down, so things move up"),
        pytest.param(
            {"roll_deg": 3.0}, (1.0, 0.0, 1.0), 0, -1, id="+roll is clockwise from behind, so the top goes left"
        ),
    ],
)
def test_the_image_moves_against_the_turn_of_the_rig(turn, point_m, axis, sign):
    level, turned = (
        true_rig(Scenario(rig=RigTable(baseline_m=1e-6, **angles))).left.project(np.array(point_m))
        for angles in ({}, turn)
    )
    assert sign * (turned - level)[axis] > 1.0


def test_plus_roll_lifts_the_left_camera():
    rig = true_rig(Scenario(rig=RigTable(roll_deg=10.0)))
    assert rig.left.centre_world_m[2] == pytest.approx(0.25 * math.sin(math.radians(10.0)))
    assert rig.right.centre_world_m[2] == pytest.approx(-0.25 * math.sin(math.radians(10.0)))


rigs = st.builds(
    RigTable,
    position_m=st.tuples(st.floats(-1.5, 0.0), st.floats(-0.5, 0.5), st.floats(-1, 1)),
    baseline_m=st.floats(0.05, 0.8),
    hfov_deg=st.floats(40, 110),
    roll_deg=st.floats(-3, 3),
    pitch_deg=st.floats(-3, 3),
    yaw_deg=st.floats(-60, 60),
)
places = st.tuples(st.floats(0.5, 2.2), st.floats(-1.0, 1.0), st.floats(-1, 1))


@given(rigs, places)
def test_simulator_and_estimator_project_alike_when_the_belief_is_true(rig, place_m):
    belief = BelievedRigTable(roll_deg=rig.roll_deg, pitch_deg=rig.pitch_deg, yaw_deg=rig.yaw_deg)
    scenario = Scenario(rig=rig, believed_rig=belief)
    for camera, projection in zip(
        (true_rig(scenario).left, true_rig(scenario).right),
        (believed_rig(scenario).P1, believed_rig(scenario).P2),
        strict=True,
    ):
        u, v, w = projection @ np.array([*place_m, 1.0])
        if w > 0.1:
            assert camera.project(np.array(place_m)) == pytest.approx([u / w, v / w], abs=1e-6)


@given(rigs, places)
def test_a_leak_seen_by_the_simulator_is_triangulated_to_its_place(rig, place_m):
    level = rig.model_copy(update={"roll_deg": 0.0, "pitch_deg": 0.0})
    scenario = Scenario(rig=level, believed_rig=BelievedRigTable(yaw_deg=rig.yaw_deg))
    cameras, belief = true_rig(scenario), believed_rig(scenario)
    leak_m = np.array([*place_m[:2], level.position_m[2]])
    if min(cameras.left.depth(leak_m), cameras.right.depth(leak_m)) < 0.3:
        return
    columns = [np.array([camera.project(leak_m)[0]]) for camera in (cameras.left, cameras.right)]
    planes = [
        column_planes(column, projection, level.height_px)
        for column, projection in zip(columns, (belief.P1, belief.P2), strict=True)
    ]
    assert meet_at_camera_height(*planes)[0] == pytest.approx(place_m[:2], abs=1e-6)


@pytest.mark.parametrize("range_m", [2.4, 4.9])
def test_a_pixel_of_disparity_is_z_squared_over_f_b(range_m):
    # CONVENTIONS: 17 mm/px in mid-pedestal and 70 mm/px at the far wall
    rig = believed_rig(PAPER)
    left = np.array([550.91, 550.91 + 0.5]) if range_m == 2.4 else np.array([514.47, 514.97])
    right = np.array([408.09, 408.09 - 0.5]) if range_m == 2.4 else np.array([444.53, 444.03])
    x_m = triangulate_columns(np.stack([left, right], axis=1), rig)[:, 0]
    assert x_m[0] - x_m[1] == pytest.approx(range_m**2 / (685.51 * 0.5), rel=0.02)


def test_a_wrong_pan_angle_moves_every_estimate_by_range_times_two_sine_half():
    wrong = Scenario(rig=RigTable(yaw_deg=3.0))  # believed 0
    cameras, belief = true_rig(wrong), believed_rig(wrong)
    leak_m = np.array([2.5, 0.0, 0.0])
    columns = [np.array([camera.project(leak_m)[0]]) for camera in (cameras.left, cameras.right)]
    planes = [column_planes(c, p, 540) for c, p in zip(columns, (belief.P1, belief.P2), strict=True)]
    moved_m = np.linalg.norm(meet_at_camera_height(*planes)[0] - leak_m[:2])
    assert moved_m == pytest.approx(4.9 * 2 * math.sin(math.radians(1.5)))  # 0.26 m


def test_the_default_scenario_breaks_no_rule():
    assert violations(PAPER) == []


def test_frames_are_centred_on_their_time():
    recording = simcam.Recording(fps=12.0, exposure_s=0.01)
    assert (recording.opens_s(6) + recording.closes_s(6)) / 2 == pytest.approx(0.5)
