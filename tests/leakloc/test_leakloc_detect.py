import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from leakloc.detect import detect_columns, threshold_grey

profiles = st.lists(st.sampled_from([0.0, 0.1, 0.5, 1.0, 1.5, 3.0]), min_size=1, max_size=60).map(np.array)


def peaks(heights, width=100, floor=0.0):
    profile = np.full(width, floor)
    for column, height in heights.items():
        profile[column] = height
    return profile


def found(profile, k_sigma=2.0, g_win_px=10):
    return detect_columns(np.asarray(profile, float), k_sigma=k_sigma, g_win_px=g_win_px).tolist()


def test_the_threshold_is_the_mean_and_two_standard_deviations_without_bessel():
    # mean 1, squared deviations 1 1 1 9 over n = 4: std sqrt(3)
    assert threshold_grey(np.array([0.0, 0.0, 0.0, 4.0]), 2.0) == pytest.approx(1 + 2 * np.sqrt(3))


def test_a_column_at_the_threshold_itself_is_no_candidate():
    # mean 1/2 and std 1/2: with k_sigma = 1 the high columns stand exactly on the threshold of 1
    assert found([0, 1, 0, 1], k_sigma=1.0, g_win_px=0) == []
    assert found([0, 1, 0, 1], k_sigma=0.999, g_win_px=0) == [1, 3]


def test_the_window_is_inclusive_so_ten_columns_away_suppresses_and_eleven_does_not():
    assert found(peaks({40: 5.0, 50: 4.0})) == [40]
    assert found(peaks({40: 4.0, 50: 5.0})) == [50]
    assert found(peaks({40: 5.0, 51: 4.0})) == [40, 51]


def test_the_window_is_clipped_at_the_border():
    assert found(peaks({0: 5.0, 99: 5.0})) == [0, 99]


def test_a_plateau_is_one_peak_on_its_lowest_column():
    assert found(peaks({40: 5.0, 41: 5.0, 42: 5.0})) == [40]
    assert found(peaks({40: 5.0, 50: 5.0})) == [40]


def test_a_peak_that_a_higher_one_suppresses_still_suppresses_its_own_neighbours():
    """Algorithm 1 compares profiles, not survivors: 59 falls to 50, which itself falls to 41."""
    assert found(peaks({41: 6.0, 50: 5.0, 59: 4.0})) == [41]


@given(st.floats(0, 255), st.integers(1, 1000), st.floats(0, 3))
def test_a_flat_profile_has_no_candidates(grey, width, k_sigma):
    assert found(np.full(width, grey), k_sigma=k_sigma) == []


@given(profiles, st.sampled_from([0.0, 0.5, 1.0, 2.0]), st.integers(0, 12))
def test_detection_is_the_definition_column_by_column(straightforward, profile, k_sigma, g_win_px):
    assert found(profile, k_sigma, g_win_px) == straightforward.detect(profile, k_sigma, g_win_px)


@given(profiles, st.integers(0, 12))
def test_candidates_are_farther_apart_than_the_window(profile, g_win_px):
    assert (np.diff(found(profile, 0.0, g_win_px)) > g_win_px).all()
