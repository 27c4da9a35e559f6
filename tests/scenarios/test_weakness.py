"""Dips: where leaks are found less strongly than leaks like them, told from chance and from what is smooth."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarios.weakness import DISC, FEWEST, LEAST_Z, PATIENCE, Aim, Weakness

N_PARAMETERS = 5
SPREAD = 0.3
"""Of logarithms of scores, as of the robust method."""

centres = st.tuples(st.floats(0.2, 0.8), st.floats(0.2, 0.8))
pairs = st.permutations(range(N_PARAMETERS)).map(lambda order: tuple(sorted(order[:2])))


def margins_of(log_ratios):
    return np.tanh(np.asarray(log_ratios) / 2.0)


def leaks_with_a_dip(pair, centre, seed, n=400):
    """Leaks anywhere, a third as strong on average within 0.15 of a place in the plane of two parameters."""
    rng = np.random.default_rng(seed)
    trials = rng.random((n, N_PARAMETERS))
    away = np.linalg.norm(trials[:, list(pair)] - centre, axis=1)
    log_ratios = 1.5 + SPREAD * rng.standard_normal(n) - 2.5 * np.clip(1.0 - away / 0.15, 0.0, 1.0)
    weakness = Weakness([math.inf] * N_PARAMETERS)
    weakness.add(trials, margins_of(log_ratios))
    return weakness


@pytest.mark.statistical
@settings(max_examples=20)
@given(pairs, centres, st.integers(0, 1000))
def test_the_surest_dip_is_the_one_that_is_there(pair, centre, seed):
    first, *_ = leaks_with_a_dip(pair, centre, seed).aims(5, rng=np.random.default_rng(seed))
    here = [share for parameter, share in zip(pair, centre, strict=True) if parameter in first.parameters]
    assert set(first.parameters) <= set(pair)
    assert np.linalg.norm(np.subtract(first.shares, here)) < 0.15 + 3.0 * DISC


@settings(max_examples=20)
@given(st.integers(0, 1000), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_what_is_smooth_in_a_parameter_is_no_dip(seed, slope, curvature):
    trials = np.random.default_rng(seed).random((300, N_PARAMETERS))
    weakness = Weakness([math.inf] * N_PARAMETERS)
    weakness.add(trials, margins_of(1.5 + slope * trials[:, 0] + curvature * trials[:, 1] ** 2))
    assert weakness.aims(5, rng=np.random.default_rng(seed)) == []


def test_few_leaks_tell_nothing():
    weakness = leaks_with_a_dip((0, 1), (0.5, 0.5), 0, n=FEWEST - 1)
    assert weakness.aims(5, rng=np.random.default_rng(0)) == []


def test_a_dip_is_over_when_it_led_to_a_failure():
    weakness = leaks_with_a_dip((0, 1), (0.5, 0.5), 1)
    aim = Aim((0, 1), (0.5, 0.5))
    assert any(map(aim.is_near, weakness.aims(1, rng=np.random.default_rng(0))))
    weakness.learn(aim, has_failed=True)
    assert not any(map(aim.is_near, weakness.aims(1, rng=np.random.default_rng(0))))


def test_a_dip_that_leads_nowhere_is_left_alone_at_last():
    weakness = leaks_with_a_dip((0, 1), (0.5, 0.5), 1)
    (first,) = weakness.aims(1, rng=np.random.default_rng(0))
    tried = 0
    while any(map(first.is_near, weakness.aims(1, rng=np.random.default_rng(tried)))):
        weakness.learn(first, has_failed=False)
        tried += 1
        assert tried < 1000
    assert tried >= PATIENCE * LEAST_Z


def test_aims_lie_within_the_space():
    weakness = leaks_with_a_dip((1, 3), (0.02, 0.98), 2)
    aims = [aim for seed in range(20) for aim in weakness.aims(1, rng=np.random.default_rng(seed))]
    assert len(aims) == 20
    assert all(0.0 <= share < 1.0 for aim in aims for share in aim.shares)


def test_a_parameter_with_one_value_has_no_dips():
    rng = np.random.default_rng(3)
    trials = rng.random((400, 2))
    margins = margins_of(1.5 + 0.1 * rng.standard_normal(400) - 2.0 * (np.abs(trials[:, 0] - 0.5) < 0.05))
    for n_values, seen in (([math.inf, math.inf], True), ([1.0, math.inf], False)):
        weakness = Weakness(n_values)
        weakness.add(trials, margins)
        assert any(0 in aim.parameters for aim in weakness.aims(5, rng=rng)) is seen


def test_scores_that_are_not_told_make_no_dips():
    trials = np.random.default_rng(0).random((200, N_PARAMETERS))
    weakness = Weakness([math.inf] * N_PARAMETERS)
    weakness.add(trials, np.ones(200))  # found, and by how much is unknown
    assert weakness.aims(5, rng=np.random.default_rng(0)) == []
