"""Dips: where leaks are found less strongly than leaks like them, told from chance and from what is smooth."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarios.weakness import ENOUGH, FEWEST, NEAR, Aim, Weakness

N_PARAMETERS = 5
SPREAD = 0.3
"""Of logarithms of scores, as of the robust method."""

RADIUS = 0.15
N_AIMS = 100

centres = st.tuples(st.floats(0.2, 0.8), st.floats(0.2, 0.8))
pairs = st.permutations(range(N_PARAMETERS)).map(lambda order: tuple(sorted(order[:2])))
seeds = st.integers(0, 1000)


def margins_of(log_ratios):
    return np.tanh(np.asarray(log_ratios) / 2.0)


def weakness_of(trials, log_ratios):
    weakness = Weakness([math.inf] * trials.shape[1])
    weakness.add(trials, margins_of(log_ratios))
    return weakness


def leaks_with_a_dip(parameters, centre, seed, n=400):
    """Leaks anywhere, and less strongly found within 0.15 of a place in one parameter or the plane of two."""
    rng = np.random.default_rng(seed)
    trials = rng.random((n, N_PARAMETERS))
    away = Aim(parameters, centre).distance(trials[:, list(parameters)])
    dip = 2.0 * np.clip(1.0 - away / RADIUS, 0.0, 1.0)
    return weakness_of(trials, 1.5 + SPREAD * rng.standard_normal(n) - dip)


def share_near(aims, pair, centre, radius):
    """Share of aims that lie near a place of a plane."""
    return np.mean([aim.parameters == pair and aim.distance(np.array(centre)) < radius for aim in aims])


def n_around(trials, aim):
    """How many leaks have tried what an aim is going to."""
    return np.sum(aim.distance(trials[:, list(aim.parameters)]) < NEAR)


@pytest.mark.statistical
@settings(max_examples=20)
@given(pairs, centres, seeds)
def test_most_places_to_try_lie_in_the_dip_that_is_there(pair, centre, seed):
    aims = leaks_with_a_dip(pair, centre, seed).aims(N_AIMS, rng=np.random.default_rng(seed))
    assert share_near(aims, pair, centre, RADIUS) > 0.5


@settings(max_examples=20)
@given(seeds, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_what_is_smooth_in_a_parameter_is_no_dip(seed, slope, curvature):
    trials = np.random.default_rng(seed).random((400, N_PARAMETERS))
    smooth = 1.5 + slope * trials[:, 0] + curvature * trials[:, 1] ** 2
    noise = SPREAD * np.random.default_rng(seed + 1).standard_normal(400)
    bumpy, flat = (
        weakness_of(trials, height + noise).aims(N_AIMS, rng=np.random.default_rng(seed)) for height in (smooth, 1.5)
    )
    assert np.mean([one.parameters == other.parameters for one, other in zip(bumpy, flat, strict=True)]) > 0.8


@settings(max_examples=20)
@given(seeds)
def test_where_scores_are_not_told_it_is_looked_where_few_leaks_were(seed):
    trials = np.random.default_rng(seed).random((200, N_PARAMETERS))
    weakness = Weakness([math.inf] * N_PARAMETERS)
    weakness.add(trials, np.ones(200))  # found, and by how much is unknown
    aims = weakness.aims(N_AIMS, rng=np.random.default_rng(seed))
    anywhere = [
        Aim(aim.parameters, tuple(np.random.default_rng([seed, i]).random(len(aim.shares))))
        for i, aim in enumerate(aims)
    ]
    assert np.mean([n_around(trials, aim) for aim in aims]) < 0.5 * np.mean([n_around(trials, a) for a in anywhere])


@pytest.mark.statistical
def test_one_unlucky_leak_is_no_dip(harness_seed):
    around = []
    for number in range(12):
        rng = np.random.default_rng([harness_seed, number])
        weakness = weakness_of(rng.random((400, N_PARAMETERS)), 1.5 + SPREAD * rng.standard_normal(400))
        unlucky = rng.uniform(0.2, 0.8, (1, N_PARAMETERS))
        weakness.add(unlucky, np.array([-0.9]))
        aims = weakness.aims(N_AIMS, rng=rng)
        around += [aim.distance(unlucky[0, list(aim.parameters)]) < NEAR for aim in aims]
    assert np.mean(around) < 0.5  # 0.2; 1.0 where scores may have any tail


@settings(max_examples=20)
@given(pairs, centres, seeds)
def test_a_place_where_leaks_are_found_as_they_should_be_is_left_alone(pair, centre, seed):
    weakness = leaks_with_a_dip(pair, centre, seed)
    strong = np.random.default_rng(seed + 1).random((12, N_PARAMETERS))
    strong[:, list(pair)] = centre
    weakness.add(strong, margins_of(np.full(12, 1.5)))
    aims = weakness.aims(N_AIMS, rng=np.random.default_rng(seed))
    assert share_near(aims, pair, centre, 0.04) <= 0.02


def test_few_leaks_tell_nothing():
    weakness = leaks_with_a_dip((0, 1), (0.5, 0.5), 0, n=FEWEST - 1)
    assert weakness.aims(5, rng=np.random.default_rng(0)) == []


@pytest.mark.statistical
@settings(max_examples=10)
@given(st.one_of(pairs, st.integers(0, N_PARAMETERS - 1).map(lambda one: (one,))), seeds)
def test_a_dip_that_has_shown_enough_failures_is_left_alone(parameters, seed):
    here, rng = Aim(parameters, (0.5,) * len(parameters)), np.random.default_rng(seed)
    weakness = leaks_with_a_dip(parameters, here.shares, seed)
    for n_failures in range(ENOUGH + 1):
        aims = weakness.aims(N_AIMS, rng=rng)
        near = np.mean([aim.is_near(here) for aim in aims])
        assert near == 0.0 if n_failures == ENOUGH else near > 0.5
        weakness.add_failure(here)
    assert len(aims) == N_AIMS
    in_its_shadow = [
        any(p in parameters and abs(share - 0.5) < NEAR for p, share in zip(aim.parameters, aim.shares, strict=True))
        for aim in aims
    ]
    assert np.mean(in_its_shadow) < 0.5  # nor is it looked for in other planes


def test_aims_lie_within_the_space():
    aims = leaks_with_a_dip((1, 3), (0.02, 0.98), 2).aims(N_AIMS, rng=np.random.default_rng(0))
    assert len(aims) == N_AIMS
    assert all(0.0 <= share < 1.0 for aim in aims for share in aim.shares)


def test_a_parameter_with_one_value_has_no_dips():
    rng = np.random.default_rng(3)
    trials = rng.random((400, 2))
    margins = margins_of(1.5 + 0.1 * rng.standard_normal(400) - 2.0 * (np.abs(trials[:, 0] - 0.5) < 0.05))
    for n_values, seen in (([math.inf, math.inf], True), ([1.0, math.inf], False)):
        weakness = Weakness(n_values)
        weakness.add(trials, margins)
        assert any(0 in aim.parameters for aim in weakness.aims(N_AIMS, rng=rng)) is seen
    assert Weakness([1.0, 1.0]).aims(5, rng=rng) == []
