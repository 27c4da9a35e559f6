"""Streak activity, agreement between the views, matching, levelling and the clip's condition, on drawn data."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from leakloc import locate
from leakloc.condition import DARK, FROZEN, SATURATED, describe_condition
from leakloc.correlate import agreement, threshold_sigmas
from leakloc.levelled import level_pair
from leakloc.levelling import fit_tilt, slope_of
from leakloc.result import read_result, write_result
from leakloc.streaks import band_sums, best_bright_clip, streak_median, streaks
from leakloc.tilt import leaning_columns
from leakloc.tracks import match_tracks


def raining(columns_px, rng, n=24, size=(270, 320), grey=8.0):
    """A wall of grey 60 with unit noise; leak k darkens or brightens its column while a drop passes, phases apart."""
    height, width = size
    frames = 60 + rng.normal(0, 1.5, (n, height, width))
    for leak, (column, side) in enumerate(columns_px):
        for frame in range(n):
            top = (frame * 67 + leak * 113) % (3 * height) - height // 2
            frames[frame, max(0, top) : max(0, top + 60), column - 1 : column + 2] += side * grey
    return np.clip(np.rint(frames), 0, 255).astype(np.uint8)


@given(st.integers(0, 2**32), st.integers(3, 6), st.integers(8, 120))
def test_band_sums_are_clipped_frames_summed_over_bands(seed, n, height):
    rng = np.random.default_rng(seed)
    frames = rng.integers(0, 256, (n, height, 40), np.uint8)
    low = rng.integers(0, 100, (height, 40), np.uint8)
    high = rng.integers(120, 256, (height, 40)).astype(np.uint8)
    sums, rows_px = band_sums(frames, low, high)
    rows = round(2 * rows_px[0] + 1)
    bands = height // rows
    slow = np.clip(frames, low, high)[:, : bands * rows].reshape(n, bands, rows, 40).sum(axis=2, dtype=np.float64)
    np.testing.assert_array_equal(sums, slow)


@given(st.integers(0, 2**32), st.integers(5, 40), st.sampled_from([np.uint8, np.uint16]))
def test_the_streak_median_is_that_of_five_rows_of_a_column(seed, height, dtype):
    frame = np.random.default_rng(seed).integers(0, np.iinfo(dtype).max, (height, 7), dtype, endpoint=True)
    rows = np.pad(frame, ((2, 2), (0, 0)), mode="edge")
    slow = np.median([rows[i : i + height] for i in range(5)], axis=0)
    np.testing.assert_array_equal(streak_median(frame), slow)


@given(st.integers(6, 30), st.integers(10, 150), st.integers(1, 2))
def test_a_long_streak_passes_whole_where_a_short_hit_is_cut_off(length, grey, hit_length):
    frames = np.full((1, 60, 20), 50, np.uint8)
    frames[0, 20 : 20 + length, 5] += grey
    frames[0, 20 : 20 + hit_length, 12] += grey
    limits = np.zeros((60, 20), np.uint8), np.full((60, 20), 54, np.uint8)
    cut = np.minimum(frames.astype(int) - 50, 4).sum(axis=(0, 1))
    activity = band_sums(frames, *limits)[0].sum(axis=(0, 1)) - 60 * 50
    glitter = band_sums(frames, *limits, np.full((60, 20), 4, np.uint8))[0].sum(axis=(0, 1)) - 60 * 50
    np.testing.assert_array_equal(activity, cut)
    assert glitter[5] == length * grey
    assert glitter[12] == cut[12]


def test_the_bright_limit_is_wide_without_hits_and_tight_with_them():
    rng = np.random.default_rng(1)
    noise = rng.normal(0, 1, 200_000)
    hits = np.where(rng.random(200_000) < 0.1, rng.exponential(20.0, 200_000), 0.0)
    assert best_bright_clip(noise) >= 3.0
    assert best_bright_clip(noise + hits) <= 1.5
    assert best_bright_clip(np.zeros(1000)) >= 3.0


@pytest.mark.parametrize("side", [-1, 1])
def test_a_line_that_stays_in_the_median_stands_out_of_it_to_its_own_side(side):
    rng = np.random.default_rng(4)
    frames = raining([(200, side)], rng, grey=0.0)
    held = np.array(frames)
    held[:18, :, 199:202] = np.clip(held[:18, :, 199:202].astype(int) + 12 * side, 0, 255)  # 18 of 24 frames
    relief = streaks(held).relief
    assert int(np.argmax(side * relief)) in (199, 200, 201)
    assert side * relief[200] > 6
    assert np.abs(streaks(frames).relief).max() < 5  # 320 columns of noise


def test_the_same_drops_agree_and_hits_do_not():
    rng = np.random.default_rng(2)
    left = streaks(raining([(200, 1), (90, -1)], rng))
    right = streaks(raining([(150, 1), (50, -1)], rng))
    sigmas = agreement(left, right).signed
    assert sigmas[200, 150] > 15
    assert sigmas[90, 50] > 15
    sigmas[195:206, 145:156] = sigmas[85:96, 45:56] = 0
    sigmas[195:206, 45:56] = sigmas[85:96, 145:156] = 0  # their drips overlap by chance
    assert sigmas.max() < 5.5


def test_shadows_leave_nothing_in_the_bright_agreement():
    rng = np.random.default_rng(3)
    left, right = (streaks(raining([(c, -1)], rng)) for c in (200, 150))
    agreed = agreement(left, right)
    assert agreed.signed[200, 150] > 15
    assert agreed.bright[195:206, 145:156].max() < 5.0


def test_a_white_wall_next_to_a_grey_one_makes_no_leaks(make_rig):
    rng = np.random.default_rng(9)
    wall = np.linspace(600, 60, 960) * np.linspace(0.8, 1.2, 540)[:, None]  # half of it saturates
    frames = [np.clip(rng.normal(wall, 3.0, (12, 540, 960)), 0, 255).astype(np.uint8) for _ in range(2)]
    sides = [streaks(view) for view in frames]
    assert sides[0].alive[-100:].min() > 0.9
    assert sides[0].alive[np.argmin(np.abs(wall[270] - 270))] < 0.8
    assert locate(*frames, make_rig(), expected_false_leaks=0.05).leaks == ()


def test_the_threshold_rises_with_pairs_and_falls_with_tolerance():
    assert threshold_sigmas(400_000, 0.05) > threshold_sigmas(100_000, 0.05) > threshold_sigmas(100_000, 0.2) > 3


@given(st.permutations(range(5)), st.integers(0, 2**32))
def test_lines_are_matched_in_any_order_and_none_twice(order, seed):
    rng = np.random.default_rng(seed)
    sigmas = rng.normal(0, 1, (120, 120)).astype(np.float32)
    for i, j in enumerate(order):
        sigmas[10 + 20 * i, 12 + 20 * j] = 30 + i
    tracks = match_tracks(sigmas, np.full((120, 120), 8.0, np.float32))
    assert {(t.left_px, t.right_px) for t in tracks} == {(10 + 20 * i, 12 + 20 * j) for i, j in enumerate(order)}


def test_a_line_on_the_flank_of_a_stronger_one_is_matched_too():
    columns = np.arange(120)
    broad = np.exp(-0.5 * ((columns - 50) / 4) ** 2)[:, None] * np.exp(-0.5 * ((columns - 70) / 4) ** 2)
    for turned in (False, True):
        sigmas = (14 * broad).astype(np.float32)
        sigmas[55, 30] = 8.0
        sigmas = np.ascontiguousarray(sigmas.T) if turned else sigmas
        tracks = match_tracks(sigmas, np.full((120, 120), 5.0, np.float32))
        found = {(t.left_px, t.right_px)[:: -1 if turned else 1] for t in tracks}
        assert found == {(50, 70), (55, 30)}


def test_a_plateau_is_one_line():
    sigmas = np.zeros((120, 120), np.float32)
    sigmas[40:52, 60:72] = 9.0
    tracks = match_tracks(sigmas, np.full((120, 120), 5.0, np.float32))
    assert [(t.left_px, t.right_px) for t in tracks] == [(40, 60)]


def test_below_the_price_nothing_is_matched():
    sigmas = np.zeros((60, 60), np.float32)
    sigmas[20, 30] = 4.9
    assert match_tracks(sigmas, np.full((60, 60), 5.0, np.float32)) == []


@given(st.floats(-0.001, 0.001), st.floats(1.5, 4.0))
def test_the_slope_of_a_leaning_line_is_measured(slope, width_px):
    rows = np.arange(36) * 15 + 7.0
    columns = np.arange(-12, 13)
    profile = 50 * np.exp(-0.5 * ((columns - slope * (rows[:, None] - rows.mean())) / width_px) ** 2)
    measured, _ = slope_of(profile, rows)
    assert measured == pytest.approx(slope, rel=0.1, abs=2e-4)


@given(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))
def test_slopes_of_plumb_lines_give_the_tilt_back(make_rig, roll_deg, pitch_deg):
    level, tilt = level_pair(make_rig()), np.radians([roll_deg, pitch_deg])
    rows = np.array([0.0, 539.0])
    slopes = []
    for view, column in ((0, 200.0), (0, 700.0), (1, 120.0), (1, 620.0)):
        ends = leaning_columns(level, tilt, view, rows, np.array([column]))[:, 0]
        slopes.append((view, column, float(ends[1] - ends[0]) / 539.0, 1e-8))
    found = fit_tilt(slopes, level, np.zeros(2), rows)
    np.testing.assert_allclose(np.degrees(found.tilt_rad), [roll_deg, pitch_deg], atol=0.01)


def views_of(kind, shape, rng):
    noise = rng.integers(90, 110, shape, np.uint8)
    return {
        "black": np.zeros(shape, np.uint8),
        "white": np.full(shape, 255, np.uint8),
        "still": np.repeat(noise[:1], shape[0], axis=0),
        "noisy": noise,
    }[kind]


@pytest.mark.parametrize("right", ["black", "white", "still", "noisy"])
@pytest.mark.parametrize("left", ["black", "white", "still", "noisy"])
def test_a_blind_camera_is_said_to_be_blind_and_finds_nothing(make_rig, left, right):
    rng = np.random.default_rng(4)
    estimate = locate(*(views_of(kind, (6, 54, 96), rng) for kind in (left, right)), make_rig(96, 54), method="robust")
    assert estimate.leaks == ()
    states = {"black": DARK, "white": SATURATED, "still": FROZEN, "noisy": "fit"}
    told = estimate.diagnostics["condition"]
    assert (told["left"]["state"], told["right"]["state"]) == (states[left], states[right])


@given(st.integers(0, 2**32), st.integers(3, 7), st.integers(8, 40), st.integers(16, 90), st.sampled_from([2, 256]))
def test_random_grey_of_any_size_is_answered_without_a_number_that_is_none(make_rig, seed, n, height, width, levels):
    rng = np.random.default_rng(seed)
    views = [rng.integers(0, levels, (n, height, width), np.uint8) for _ in range(2)]
    estimate = locate(*views, make_rig(width, height), method="robust")
    assert all(np.isfinite([leak.x_m, leak.y_m, *leak.covariance_m2.ravel()]).all() for leak in estimate.leaks)


def test_a_repeated_frame_and_a_jump_of_exposure_are_told():
    frames = np.random.default_rng(5).integers(90, 110, (8, 54, 96), np.uint8)
    frames[3] = frames[2]
    frames[0] //= 2
    told = describe_condition(frames)
    assert told["repeated_frames"] == [3]
    assert told["exposure_jumps"] == [0]


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), 2.0])
def test_a_tolerance_that_means_nothing_is_refused(make_rig, value):
    frames = np.zeros((4, 54, 96), np.uint8)
    with pytest.raises(ValueError, match="expected_false_leaks must be > 0 and <= 1"):
        locate(frames, frames, make_rig(96, 54), expected_false_leaks=value)


@pytest.mark.parametrize(("white", "median", "state"), [(4095, 400, "fit"), (4095, 20, DARK), (1023, 5, DARK)])
def test_the_brightness_of_a_camera_of_more_than_8_bit_is_judged_by_its_own_white(white, median, state):
    rng = np.random.default_rng(0)
    frames = rng.integers(median - 5, median + 6, (6, 60, 90)).astype(np.uint16)
    frames[:, ::7, ::7] = np.where(rng.random(frames[:, ::7, ::7].shape) < 0.02, white, frames[:, ::7, ::7])  # hits
    assert describe_condition(frames)["state"] == state


def test_a_camera_of_12_bit_that_sees_nothing_but_its_white_is_saturated():
    frames = np.full((6, 60, 90), 4095, np.uint16)
    frames[:, :20] -= np.arange(6, dtype=np.uint16)[:, None, None]
    assert describe_condition(frames)["state"] == SATURATED


@pytest.mark.parametrize(("n", "height", "width"), [(3, 48, 480), (3, 16, 640), (4, 15, 120)])
def test_a_clip_too_short_and_low_to_tell_its_step_has_a_result_that_can_be_written(
    make_rig, tmp_path, n, height, width
):
    views = np.random.default_rng(0).integers(50, 60, (2, n, height, width), dtype=np.uint8)
    estimate = locate(*views, make_rig(width, height))
    write_result(estimate, tmp_path / "result.json")
    assert np.isnan(read_result(tmp_path / "result.json").diagnostics["step"]["sigmas"])
