"""The chance of a leak to be observable is learnt from leaks, and the fast form of it is the slow one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.visibility import FEWEST, LEAST_CHANCE, Visibility, _features, _logits


@given(st.integers(1, 7), st.integers(0, 10**6))
def test_the_quadratic_form_is_the_product_of_features_and_weights(n_parameters, seed):
    rng = np.random.default_rng(seed)
    rows = rng.random((9, n_parameters))
    weights = rng.normal(size=_features(rows).shape[1])
    assert _logits(rows, weights) == pytest.approx(_features(rows) @ weights, abs=1e-12)


@given(st.integers(0, 10**6))
def test_where_leaks_were_seen_they_are_likely_and_where_none_were_no_corner_is_written_off(seed):
    rows = np.random.default_rng(seed).random((300, 4))
    visibility = Visibility()
    visibility.add(rows, rows[:, 0] + rows[:, 2] < 1.0)
    near, far = visibility.chance(np.array([[0.1, 0.5, 0.1, 0.5], [0.9, 0.5, 0.9, 0.5]]))
    assert near > 0.9
    assert LEAST_CHANCE <= far < LEAST_CHANCE + 0.1


def test_as_long_as_next_to_nothing_is_known_every_leak_may_be_observable():
    visibility = Visibility()
    visibility.add(np.full((FEWEST - 1, 3), 0.5), np.zeros(FEWEST - 1, dtype=bool))
    assert visibility.chance(np.full((2, 3), 0.5)) == pytest.approx([1.0, 1.0])
