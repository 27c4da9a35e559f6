from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from leakloc import background
from leakloc.background import column_vectors, foreground_total, selection_network, temporal_median
from leakloc.columns import column_profile

clips = st.tuples(st.sampled_from([np.uint8, np.uint16]), st.integers(1, 30)).flatmap(
    lambda kind: hnp.arrays(kind[0], (kind[1], 3, 5), elements=st.integers(0, np.iinfo(kind[0]).max))
)


def test_the_median_of_three_frames_is_the_middle_one():
    frames = np.array([[[7, 0]], [[200, 0]], [[9, 255]]], np.uint8)
    assert temporal_median(frames).grey.tolist() == [[9.0, 0.0]]


def test_the_median_of_four_frames_keeps_its_half_integer():
    frames = np.array([10, 2, 1, 0], np.uint8).reshape(4, 1, 1)
    median = temporal_median(frames)
    assert median.grey.tolist() == [[1.5]]
    assert column_vectors(frames, median, np.array([0])).tolist() == [[[8.5], [0.5], [0.5], [1.5]]]


def test_the_profile_is_the_mean_over_frames_and_rows():
    # column 0 never moves; column 1 is 4 grey off its median (10) in one of 3 frames on one of 2 rows: 4 / 6
    frames = np.array([[[5, 10], [5, 10]], [[5, 14], [5, 10]], [[5, 10], [5, 10]]], np.uint8)
    assert column_profile(frames, temporal_median(frames)).tolist() == [0.0, 4 / 6]


@given(clips)
def test_the_median_is_numpys_and_the_frames_are_left_alone(frames):
    before = frames.copy()
    assert np.array_equal(temporal_median(frames).grey, np.median(frames, axis=0))
    assert np.array_equal(frames, before)


@given(clips)
def test_whole_number_sums_equal_the_half_integer_definition_to_the_bit(straightforward, frames):
    median = temporal_median(frames)
    moved = straightforward.foreground(frames, straightforward.background(frames))
    assert np.array_equal(foreground_total(frames, median), moved.sum(axis=(0, 1)))
    assert np.array_equal(column_profile(frames, median), straightforward.aggregate(moved))
    columns = np.array([4, 0, 3])
    assert np.array_equal(column_vectors(frames, median, columns), moved[:, :, columns].transpose(2, 0, 1))


@pytest.mark.parametrize("count", range(1, 13))
def test_every_pattern_of_zeros_and_ones_leaves_the_network_with_its_median(count):
    """Zero-one principle (Knuth 5.3.4, theorem Z): a network right on all of them is right on everything."""
    middle = ((count - 1) // 2, count // 2)
    values = np.array(list(product((0, 1), repeat=count)), np.uint8).T.copy()
    expected = np.sort(values, axis=0)[list(middle)]
    for low, high, _, _ in selection_network(count, middle):
        values[[low, high]] = values[[low, high]].min(axis=0), values[[low, high]].max(axis=0)
    assert np.array_equal(values[list(middle)], expected)


def test_the_network_for_24_frames_is_cut_back_to_what_its_middle_needs():
    steps = selection_network(24, (11, 12))
    assert len(steps) < 127  # all of Batcher's
    assert sum(minimum + maximum for *_, minimum, maximum in steps) < 2 * len(steps)


@pytest.mark.parametrize("block_bytes", [1, 100, 1 << 20])
def test_the_size_of_a_block_of_rows_changes_nothing(monkeypatch, block_bytes):
    frames = np.random.default_rng(0).integers(0, 256, (8, 13, 7), dtype=np.uint8)
    monkeypatch.setattr(background, "BLOCK_BYTES", block_bytes)
    assert np.array_equal(temporal_median(frames).grey, np.median(frames, axis=0))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_full_swings_of_a_tall_image_do_not_overflow(dtype):
    top = np.iinfo(dtype).max
    frames = np.zeros((5, 2000, 1), dtype)
    frames[3:] = top
    assert foreground_total(frames, temporal_median(frames)).tolist() == [2 * 2000 * int(top)]
