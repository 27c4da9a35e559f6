"""Metamorphic relations: what must happen to an answer when the scene or the footage changes in a known way.

They need no truth; the ones on footage alone also hold for real clips.
"""

from dataclasses import replace

import numpy as np
import pytest

import leakloc
from scenarios.leaks import resolved
from scenarios.scenario_file import read_scenario
from scenarios.simulate import simulate

SMALL = ["rig.width_px=480", "rig.height_px=270", "gamma.dose_rate_gy_h=1.7"]
DRIP = "drop_radius_m=0.0115,drip_period_s=0.27"
LEAKS = f"leak=[{{x_m=0.3,y_m=0.5,{DRIP}}},{{x_m=0.9,y_m=-0.4,{DRIP}}}]"
SAME_M = 1e-9
CLOSE_PX = 2.0
"""Of disparity: how far a place may move when the noise, and nothing that matters, changes."""


def scenario(*overrides):
    return read_scenario("crowded_1", [*SMALL, LEAKS, *overrides])


@pytest.fixture(scope="module")
def clip():
    return simulate(scenario())


@pytest.fixture(params=leakloc.METHODS)
def method(request):
    return request.param


def test_a_clip_is_the_same_to_the_byte_on_one_thread(clip):
    alone = simulate(scenario(), threads=1)
    np.testing.assert_array_equal(alone.left, clip.left)
    np.testing.assert_array_equal(alone.right, clip.right)
    assert alone.truth == clip.truth


def places(left, right, rig, method):
    """Estimated places (n, 2), m, by their first coordinate."""
    estimate = leakloc.locate(np.ascontiguousarray(left), np.ascontiguousarray(right), rig, method=method)
    found = np.array([(leak.x_m, leak.y_m) for leak in estimate.leaks]).reshape(-1, 2)
    return found[np.argsort(found[:, 0])]


def assert_same(found, expected, tolerance_m=SAME_M):
    assert found.shape == expected.shape
    assert found == pytest.approx(expected[np.argsort(expected[:, 0])], abs=tolerance_m)


def metres_per_px(places_m, rig):
    depth_m = places_m[:, 0] - rig.world_from_left[0, 3]
    return depth_m**2 / (rig.K1[0, 0] * np.abs(rig.T[0]))


def assert_close(found, expected, rig):
    """Every expected place has its own estimate within the tolerance in pixels of disparity."""
    for place, tolerance_m in zip(expected, CLOSE_PX * metres_per_px(expected, rig), strict=True):
        assert np.linalg.norm(found - place, axis=1).min() < tolerance_m


@pytest.fixture
def found(clip, method):
    answer = places(clip.left, clip.right, clip.believed_rig, method)
    assert len(answer) >= 2
    return answer


def test_the_leaks_of_the_base_clip_are_found(clip, found):
    assert_close(found, np.array([(leak.x_m, leak.y_m) for leak in clip.truth.leaks]), clip.believed_rig)


def test_mirroring_the_images_and_swapping_the_cameras_mirrors_the_places(clip, found, method):
    # the paper's rig is its own mirror image in the plane y = 0, and so are its lamp and wall
    mirrored = places(clip.right[:, :, ::-1], clip.left[:, :, ::-1], clip.believed_rig, method)
    # 1 mm: ties and rounding at the mirrored pixel edges
    assert_same(mirrored, found * [1.0, -1.0], 1e-3)


def test_the_order_of_the_frames_does_not_matter_to_the_papers_method(clip):
    order = np.random.default_rng(0).permutation(len(clip.left))
    assert_same(
        places(clip.left[order], clip.right[order], clip.believed_rig, "paper"),
        places(clip.left, clip.right, clip.believed_rig, "paper"),
    )


def test_moving_the_believed_rig_moves_every_place_as_much(clip, found, method):
    pose = clip.believed_rig.world_from_left.copy()
    pose[:3, 3] += [0.3, -0.2, 0.0]
    moved = replace(clip.believed_rig, world_from_left=pose, lamps=None, pedestal_radius=None)
    still = replace(clip.believed_rig, lamps=None, pedestal_radius=None)
    base = places(clip.left, clip.right, still, method)
    assert_same(places(clip.left, clip.right, moved, method), base + np.array([0.3, -0.2]), 1e-6)


def test_believing_a_baseline_twice_as_long_doubles_every_distance_from_the_left_camera(clip, method):
    still = replace(clip.believed_rig, lamps=None, pedestal_radius=None)
    base = places(clip.left, clip.right, still, method)
    doubled = places(clip.left, clip.right, replace(still, T=2.0 * still.T), method)
    camera = still.world_from_left[:2, 3]
    # 1 cm: the robust method's priors and gates are in metres
    assert_same(doubled, camera + 2.0 * (base - camera), 0.01 if method != "paper" else 1e-9)


def test_a_constant_offset_of_the_grey_scale_changes_nothing_for_the_paper(clip):
    darkest = int(min(clip.left.max(), clip.right.max()))
    offset = (255 - darkest) // 2
    brighter = [(frames + np.uint8(offset)) for frames in (clip.left, clip.right)]
    assert_same(
        places(*brighter, clip.believed_rig, "paper"), places(clip.left, clip.right, clip.believed_rig, "paper")
    )


def test_rows_without_a_drop_add_nothing_but_noise(clip, found, method):
    # the same rig with taller images: rows of still background above and below
    pad = ((0, 0), (20, 20), (0, 0))
    left, right = (np.pad(frames, pad, mode="reflect") for frames in (clip.left, clip.right))
    K = clip.believed_rig.K1.copy()
    K[1, 2] += 20
    taller = replace(clip.believed_rig, K1=K, K2=K, image_size=(480, 310))
    assert_close(places(left, right, taller, method), found, clip.believed_rig)


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(["seed=99"], id="another noise"),
        pytest.param(["recording.n_frames=30"], id="more frames"),
        pytest.param(["pedestal.texture_seed=5"], id="another wall"),
        pytest.param(["lamp.0.power_w=150.0"], id="less light"),
        pytest.param(["recording.exposure_s=0.06"], id="a shorter exposure"),
        pytest.param(["rig.yaw_deg=4.0", "believed_rig.yaw_deg=4.0"], id="a pan that is known"),
        pytest.param(["rig.position_m=[-2.3, 0.1, 0.0]"], id="a rig elsewhere that is known to be"),
        pytest.param(["pedestal.radius_m=3.0"], id="a wider pedestal"),
    ],
)
def test_leaks_stay_where_they_are_with(method, change):
    other = simulate(scenario(*change))
    answer = places(other.left, other.right, other.believed_rig, method)
    assert_close(answer, np.array([(leak.x_m, leak.y_m) for leak in other.truth.leaks]), other.believed_rig)


def test_one_more_leak_elsewhere_leaves_the_others_found(clip, method):
    third = f"{LEAKS[:-1]},{{x_m=0.0,y_m=-0.9,{DRIP}}}]"
    more = simulate(read_scenario("crowded_1", [*SMALL, third]))
    answer = places(more.left, more.right, more.believed_rig, method)
    assert_close(answer, np.array([(leak.x_m, leak.y_m) for leak in more.truth.leaks]), more.believed_rig)


def test_mirroring_the_scene_mirrors_the_places(found, method):
    # the wall's rust does not mirror along, nor does the noise
    other_side = LEAKS.replace("y_m=0.5", "y_m=-0.5").replace("y_m=-0.4", "y_m=0.4")
    mirrored = simulate(read_scenario("crowded_1", [*SMALL, other_side]))
    answer = places(mirrored.left, mirrored.right, mirrored.believed_rig, method)
    assert_close(answer, found[:2] * [1.0, -1.0], mirrored.believed_rig)


def test_turning_rig_lamp_and_leaks_about_the_pedestals_axis_turns_the_places(clip, found, method):
    angle_deg = 40.0
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    turn = np.array([[c, -s], [s, c]])
    leaks = ",".join(f"{{x_m={x:.6f},y_m={y:.6f},{DRIP}}}" for x, y in np.array([(0.3, 0.5), (0.9, -0.4)]) @ turn.T)
    changes = [
        f"leak=[{leaks}]",
        f"rig.position_m=[{-2.4 * c:.6f}, {-2.4 * s:.6f}, 0.0]",
        f"lamp.0.position_m=[{-2.3 * c:.6f}, {-2.3 * s:.6f}, 0.4]",
        f"rig.yaw_deg={angle_deg}",
        f"believed_rig.yaw_deg={angle_deg}",
    ]
    turned = simulate(read_scenario("crowded_1", [*SMALL, *changes]))
    answer = places(turned.left, turned.right, turned.believed_rig, method)
    assert_close(answer @ turn, found[:2], clip.believed_rig)  # turned back


def test_two_clips_superposed_have_the_leaks_of_both(method):
    # the light of drops adds up over the same still background; so does noise, hence little
    quiet = ["gamma.dose_rate_gy_h=0.0", "effects.shot_noise=false", "sensor.read_noise_e=1.0"]
    both = resolved(scenario(*quiet))
    one, other = (simulate(both.model_copy(update={"leak": (leak,)})) for leak in both.leak)
    summed = [
        np.clip(a.astype(int) + b - np.rint(np.median(b, axis=0)).astype(int), 0, 255).astype(np.uint8)
        for a, b in ((one.left, other.left), (one.right, other.right))
    ]
    answer = places(*summed, one.believed_rig, method)
    assert_close(answer, np.array([(leak.x_m, leak.y_m) for leak in both.leak]), one.believed_rig)
