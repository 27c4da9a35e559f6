from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import leakloc
from leakloc import PaperOptions

locate = partial(leakloc.locate, method="paper")


@st.composite
def noisy_clips(draw):
    """Two views of random grey: few levels make ties, many make none."""
    dtype = draw(st.sampled_from([np.uint8, np.uint16]))
    levels = draw(st.sampled_from([2, 4, 50, np.iinfo(dtype).max]))
    shape = draw(st.integers(3, 30)), draw(st.integers(2, 12)), draw(st.integers(20, 50))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    return tuple(rng.integers(0, levels + 1, shape).astype(dtype) for _ in range(2))


@given(noisy_clips(), st.sampled_from([0.0, 0.5, 1.0, 2.0]), st.integers(0, 10))
def test_the_fast_method_is_the_straightforward_one_to_the_bit(straightforward, make_rig, views, k_sigma, g_win_px):
    left, right = views
    rig = make_rig(left.shape[2], left.shape[1])
    estimate = locate(left, right, rig, options=PaperOptions(k_sigma, g_win_px))
    profiles, candidates, pairs, places = straightforward.locate(left, right, rig.P1, rig.P2, k_sigma, g_win_px)
    for view, profile, columns in zip(("left", "right"), profiles, candidates, strict=True):
        assert estimate.diagnostics[view]["profile_grey"] == profile.tolist()
        assert estimate.diagnostics[view]["candidate_columns_px"] == columns
    found = estimate.diagnostics["pairs"]
    assert [(pair["left_column_px"], pair["right_column_px"]) for pair in found] == pairs
    for pair, place in zip(found, places, strict=True):
        if pair["left_column_px"] != pair["right_column_px"]:
            assert [pair["x_m"], pair["y_m"]] == pytest.approx(place, rel=1e-9, abs=1e-9)
        else:
            assert pair["verdict"] == "parallel planes"


def test_drops_in_two_views_become_leaks_where_their_columns_meet(make_rig, make_dripping):
    rig = make_rig(120, 40)  # f = 85.69, cx = 59.5: disparity d is depth f B / d
    estimate = locate(make_dripping([70, 40]), make_dripping([50, 10]), rig)
    assert (estimate.method, estimate.frame) == ("paper", "world")
    f = rig.K1[0, 0]
    for leak, (left_px, right_px) in zip(estimate.leaks, [(40, 10), (70, 50)], strict=True):
        depth_m = f * 0.5 / (left_px - right_px)
        assert (leak.left_column_px, leak.right_column_px) == (left_px, right_px)
        assert leak.x_m == pytest.approx(-2.4 + depth_m)
        assert leak.y_m == pytest.approx(0.25 - depth_m * (left_px - 59.5) / f)
        assert leak.score > 2.0
        assert np.isnan(leak.covariance_m2).all()
        assert leak.covariance_m2.shape == (2, 2)
        assert np.isnan(leak.column_sigma_px)


def test_a_still_clip_has_no_leaks(make_rig):
    frames = np.broadcast_to(np.arange(120, dtype=np.uint8), (4, 40, 120))
    assert locate(frames, frames, make_rig(120, 40)).leaks == ()


def test_a_lamp_that_flickers_evenly_is_no_leak(make_rig):
    frames = np.repeat(np.array([10, 11, 10, 10, 13], np.uint8), 40 * 120).reshape(5, 40, 120)
    assert locate(frames, frames, make_rig(120, 40)).diagnostics["left"]["candidate_columns_px"] == []


@pytest.mark.parametrize(
    ("left_px", "right_px", "verdict"), [(40, 60, "behind a camera"), (60, 60, "parallel planes"), (60, 40, "leak")]
)
def test_a_pair_that_no_camera_can_see_is_kept_but_is_no_leak(make_rig, make_dripping, left_px, right_px, verdict):
    estimate = locate(make_dripping([left_px]), make_dripping([right_px]), make_rig(120, 40))
    (pair,) = estimate.diagnostics["pairs"]
    assert pair["verdict"] == verdict
    assert len(estimate.leaks) == (verdict == "leak")
    assert np.isnan(pair["x_m"]) == (verdict == "parallel planes")


def test_what_is_behind_one_camera_alone_is_no_leak_either(make_rig, make_dripping):
    """The right camera 1 m ahead of the left: columns 111 and 94 meet 0.5 m in front of one, 0.5 m behind the other."""
    rig = make_rig(120, 40, T=[-0.5, 0, -1.0], world_from_left=None)
    (pair,) = locate(make_dripping([111]), make_dripping([94]), rig).diagnostics["pairs"]
    assert pair["x_m"] == pytest.approx(0.5, abs=0.02)
    assert pair["verdict"] == "behind a camera"


def test_swapping_the_views_and_the_rig_returns_the_same_places(make_rig, make_dripping):
    rig = make_rig(120, 40)
    right_from_left = rig.right_from_frame @ rig.frame_from_left
    left_from_right = np.linalg.inv(right_from_left)
    swapped = make_rig(
        120, 40, R=rig.R.T, T=left_from_right[:3, 3], world_from_left=rig.frame_from_left @ left_from_right
    )
    left, right = make_dripping([70, 40, 100]), make_dripping([50, 10, 75])
    places, others = (
        [(k.x_m, k.y_m) for k in e.leaks] for e in (locate(left, right, rig), locate(right, left, swapped))
    )
    assert len(places) == 3
    np.testing.assert_allclose(sorted(places), sorted(others), atol=1e-12)


def test_without_a_pose_the_estimate_says_left_camera(make_rig, make_dripping):
    estimate = locate(make_dripping([60]), make_dripping([40]), make_rig(120, 40, world_from_left=None))
    assert estimate.frame == "left camera"
    assert estimate.leaks[0].x_m == pytest.approx(make_rig(120, 40).K1[0, 0] * 0.5 / 20)


def test_views_of_a_larger_array_give_the_same_leaks_and_stay_as_they_were(make_rig, make_dripping):
    left, right = make_dripping([70, 40]), make_dripping([50, 10])
    before = left.copy()
    plain = locate(left, right, make_rig(120, 40))
    mirrored = locate(left[:, ::-1], np.asfortranarray(right)[:, ::-1], make_rig(120, 40))  # upside down
    assert [k.x_m for k in plain.leaks] == [k.x_m for k in mirrored.leaks]
    assert np.array_equal(left, before)


def test_the_options_reach_the_detector(make_rig, make_dripping):
    left, right = make_dripping([70, 76]), make_dripping([50, 56])
    wide, narrow = (
        locate(left, right, make_rig(120, 40), options=PaperOptions(g_win_px=g)).diagnostics["left"] for g in (10, 5)
    )
    assert (wide["candidate_columns_px"], narrow["candidate_columns_px"]) == ([76], [70, 76])
    strict = locate(left, right, make_rig(120, 40), options=PaperOptions(k_sigma=50.0))
    assert strict.diagnostics["left"]["candidate_columns_px"] == []
    assert strict.leaks == ()


@pytest.mark.parametrize(
    "options",
    [{"k_sigma": -1.0}, {"k_sigma": float("nan")}, {"g_win_px": -1}, {"g_win_px": 2.5}, {"g_win_px": float("nan")}],
)
def test_options_without_a_meaning_are_refused_by_name(options):
    with pytest.raises(ValueError, match=next(iter(options))):
        PaperOptions(**options)


def frames(shape=(3, 40, 120), dtype=np.uint8):
    return np.zeros(shape, dtype)


@pytest.mark.parametrize(
    ("left", "right", "said"),
    [
        (frames(dtype=np.float64), frames(), "left must be a uint8 or uint16 array, got float64"),
        ([[1]], frames(), "left must be a uint8 or uint16 array, got list"),
        (frames(), frames((3, 40)), r"right must be \(frames, height, width\)"),
        (frames((3, 40, 120, 3)), frames(), r"left must be \(frames, height, width\)"),
        (frames((4, 40, 120)), frames(), "left and right must be alike"),
        (frames(dtype=np.uint16), frames(), "left and right must be alike"),
        (frames((2, 40, 120)), frames((2, 40, 120)), "at least 3 frames are needed, got 2"),
        (frames((3, 120, 40)), frames((3, 120, 40)), r"image_size \(120, 40\), got \(40, 120\)"),
    ],
)
def test_arrays_that_are_no_clip_are_refused_with_the_rule(make_rig, left, right, said):
    with pytest.raises(ValueError, match=said):
        locate(left, right, make_rig(120, 40))


def test_an_unknown_method_and_foreign_options_are_refused_with_what_there_is(make_rig):
    with pytest.raises(ValueError, match="method must be one of robust, paper, got 'magic'"):
        locate(frames(), frames(), make_rig(120, 40), method="magic")
    with pytest.raises(ValueError, match="must be PaperOptions, got dict"):
        locate(frames(), frames(), make_rig(120, 40), options={"k_sigma": 2})


hnp_clip = hnp.arrays(np.uint8, (5, 6, 120), elements=st.integers(0, 255))


@given(hnp_clip, hnp_clip, st.integers(1, 50))
def test_brightening_both_views_alike_moves_no_leak(make_rig, left, right, offset_grey):
    """Background subtraction cancels a constant: the method sees only what changes."""
    rig = make_rig(120, 6)
    left, right = left // 2, right // 2
    plain, brighter = locate(left, right, rig), locate(left + np.uint8(offset_grey), right + np.uint8(offset_grey), rig)
    assert plain.diagnostics["left"] == brighter.diagnostics["left"]
    assert [(k.x_m, k.y_m) for k in plain.leaks] == [(k.x_m, k.y_m) for k in brighter.leaks]


def test_the_package_names_what_it_offers():
    assert set(leakloc.__all__) >= {
        "locate",
        "read_rig",
        "write_rig",
        "read_clip",
        "write_result",
        "read_result",
        "Rig",
    }
