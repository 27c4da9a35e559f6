import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from leakloc.match import match_columns


def vectors(*candidates):
    """One row a frame: candidate = its grey in each frame."""
    return np.array(candidates, float)[:, :, None]


def matched(left, right):
    return match_columns(left, right).tolist()


def test_each_candidate_takes_the_column_that_is_nearest_in_most_frames():
    # frame by frame the left column is nearest to 0, 1, 1: one vote against two
    assert matched(vectors([1, 1, 1]), vectors([1, 5, 5], [9, 1, 1])) == [[0, 1]]


def test_nearness_is_euclidean_over_rows():
    left = np.array([[[0.0, 0.0]]])
    right = np.array([[[3.0, 3.0]], [[4.1, 0.0]]])  # sqrt(18) = 4.24 against 4.1; by L1 it would be 6 against 4.1
    assert matched(left, right) == [[0, 1]]
    right = np.array([[[3.0, 3.0]], [[4.5, 0.0]]])  # L1 and the maximum disagree with L2 now: 6 and 3 against 4.5
    assert matched(left, right) == [[0, 0]]


def test_a_taken_column_is_gone_for_the_next_candidate():
    assert matched(vectors([1, 1], [2, 2]), vectors([1, 1], [9, 9])) == [[0, 0], [1, 1]]
    assert matched(vectors([2, 2], [1, 1]), vectors([1, 1], [9, 9])) == [[0, 0], [1, 1]]


def test_the_shorter_list_leads_and_pairs_stay_left_then_right():
    left, right = vectors([5, 5], [1, 1], [9, 9]), vectors([9, 9], [1, 1])
    assert matched(left, right) == [[2, 0], [1, 1]]


def test_ties_of_the_mode_and_of_a_distance_go_to_the_lowest_column():
    assert matched(vectors([0, 0]), vectors([9, 0], [0, 9])) == [[0, 0]]  # one frame each
    assert matched(vectors([5]), vectors([7], [3], [5.5], [4.5])) == [[0, 2]]  # half a grey from both


def test_frames_without_a_drop_vote_for_the_quietest_column():
    """A weakness of the paper's rule, kept: its own column is brightest when the drop is elsewhere."""
    drop, quiet = [9, 0, 0, 0], [0, 0, 0, 0]
    assert matched(vectors(drop), vectors([9, 1, 1, 1], quiet)) == [[0, 1]]


def test_no_candidates_on_one_side_are_no_matches():
    nothing = np.empty((0, 4, 3))
    assert match_columns(nothing, np.ones((2, 4, 3))).shape == (0, 2)
    assert match_columns(np.ones((2, 4, 3)), nothing).shape == (0, 2)


halves = st.integers(0, 4).map(lambda twice: twice / 2)
lists = st.tuples(st.integers(0, 5), st.integers(0, 5), st.integers(1, 6), st.integers(1, 3)).flatmap(
    lambda s: st.tuples(
        hnp.arrays(float, (s[0], s[2], s[3]), elements=halves), hnp.arrays(float, (s[1], s[2], s[3]), elements=halves)
    )
)


@given(lists)
def test_matching_is_the_definition_pair_by_pair(straightforward, both):
    left, right = both
    as_images = [side.transpose(1, 2, 0) for side in both]
    expected = straightforward.match(*as_images, list(range(len(left))), list(range(len(right))))
    assert [tuple(pair) for pair in matched(left, right)] == expected


@given(st.permutations(range(5)))
def test_columns_that_differ_in_every_frame_find_themselves_in_any_order(order):
    left = vectors(*([k] * 3 for k in range(5)))
    assert matched(left, left[list(order)]) == [[k, order.index(k)] for k in range(5)]


@given(lists)
def test_every_candidate_is_in_at_most_one_pair(both):
    pairs = match_columns(*both)
    assert len(pairs) == min(map(len, both))
    assert all(len(set(side)) == len(pairs) for side in pairs.T.tolist())
