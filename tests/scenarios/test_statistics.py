"""The harness's own statistics: error rates as stated, three outcomes, messages that can be acted on."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom

from scenarios.statistics import (
    assert_independent,
    assert_quantile,
    assert_rate,
    assert_rate_of_fixed_size,
    binomial_tail,
    clopper_pearson,
    fixed_size_plan,
    sequential_test,
)

pytestmark = [pytest.mark.statistical, pytest.mark.usefixtures("fresh_draws")]


def coin(rate, salt=0):
    """A trial that succeeds at a rate: the same seed, the same outcome."""
    return lambda seed: np.random.default_rng((salt, seed)).random() < rate


def decisions(rate, n_tests, **claim):
    verdicts = [sequential_test(coin(rate, salt), seeds=range(2000), **claim) for salt in range(n_tests)]
    return [verdict.decision for verdict in verdicts], np.mean([verdict.n for verdict in verdicts])


def test_a_detector_at_99_percent_passes_after_about_31_scenes_whatever_alpha_is():
    for alpha in (1e-2, 1e-6, 1e-9):
        _, mean_n = decisions(0.99, 400, at_least=0.95, reject_below=0.85, alpha=alpha, beta=0.05)
        assert 28 < mean_n < 34


@given(n=st.integers(0, 300), rate=st.floats(0.001, 0.999))
def test_the_binomial_tail_is_the_sum_of_its_terms(n, rate):
    k = np.arange(n + 1)
    assert binomial_tail(k, n, rate) == pytest.approx(binom.sf(k - 1, n, rate), rel=1e-9, abs=1e-300)


def test_thirty_of_thirty_alone_proves_only_0_884():
    assert clopper_pearson(30, 30)[0] == pytest.approx(0.884, abs=0.0005)


@pytest.mark.parametrize("k", [0, 1, 7, 19, 20])
def test_the_interval_is_where_the_tails_have_2_5_percent(k):
    low, high = clopper_pearson(k, 20)
    assert low == 0.0 if k == 0 else binom.sf(k - 1, 20, low) == pytest.approx(0.025)
    assert high == 1.0 if k == 20 else binom.cdf(k, 20, high) == pytest.approx(0.025)


def test_sequential_errors_stay_within_alpha_and_beta():
    claim = {"at_least": 0.9, "reject_below": 0.7, "alpha": 0.05, "beta": 0.05}
    for rate, wrong in ((0.9, "fail"), (0.7, "pass")):
        found, _ = decisions(rate, 1000, **claim)
        # Wald: at most 0.05 (and a little over for the overshoot); 5 standard errors of 1000 tests are 0.035
        assert found.count(wrong) < 1000 * (0.05 + 0.035)
        assert "inconclusive" not in found


def test_planted_a_rate_5_percent_too_low_is_caught_and_the_claimed_one_is_not():
    claim = {"at_least": 0.95, "reject_below": 0.90, "alpha": 1e-6, "beta": 0.01}
    assert decisions(0.95, 40, **claim)[0] == ["pass"] * 40
    assert decisions(0.89, 40, **claim)[0].count("pass") <= 3


def test_a_test_of_fixed_size_has_the_numbers_of_the_binomial_law():
    assert (fixed_size_plan(0.95, 0.80, 1e-6, 1e-2).n, fixed_size_plan(0.95, 0.80, 1e-6, 1e-2).k) == (208, 180)
    plan = fixed_size_plan(0.95, 0.90, 1e-6, 1e-2)
    assert plan.n <= 1337
    assert binom.cdf(plan.k - 1, plan.n, 0.95) <= 1e-6
    assert binom.sf(plan.k - 1, plan.n, 0.90) <= 1e-2


@given(
    st.floats(0.5, 0.99), st.floats(0.05, 0.4), st.sampled_from([1e-2, 1e-4, 1e-6]), st.sampled_from([0.2, 0.05, 0.01])
)
def test_every_plan_keeps_its_promise(at_least, gap, alpha, beta):
    plan = fixed_size_plan(at_least, at_least - gap, alpha, beta)
    assert binom.cdf(plan.k - 1, plan.n, at_least) <= alpha * (1 + 1e-9)
    assert binom.sf(plan.k - 1, plan.n, at_least - gap) <= beta


def test_a_failure_prints_n_k_interval_seeds_and_the_replay():
    with pytest.raises(AssertionError) as caught:
        assert_rate(coin(0.3), cap=400, replay="leakloc replay --seed {}".format)
    message = str(caught.value)
    first = next(seed for seed in range(100) if not coin(0.3)(seed))
    assert message.startswith("failed: rate >= 0.95")
    assert "95 % interval" in message
    assert f"seeds that failed: {first}, " in message
    assert message.endswith(f"leakloc replay --seed {first}")


def test_too_few_trials_are_inconclusive_and_say_so():
    with pytest.raises(AssertionError, match=r"^inconclusive: .*20 of 20 succeeded.*more trials"):
        assert_rate(lambda _: True, cap=20)


def test_the_fixed_size_test_stops_when_it_is_decided():
    plan = fixed_size_plan(0.95, 0.80, 1e-6, 1e-2)
    assert assert_rate_of_fixed_size(lambda _: True, plan).n == plan.k
    seen = []
    with pytest.raises(AssertionError, match="failed"):
        assert_rate_of_fixed_size(lambda seed: seen.append(seed), plan)
    assert len(seen) == plan.n - plan.k + 1


@pytest.mark.parametrize("quantile", [0.5, 0.95])
def test_a_quantile_is_held_to_its_bound(quantile):
    rng = np.random.default_rng(1)
    values = np.abs(rng.normal(size=2000))
    true = float(np.quantile(np.abs(np.random.default_rng(2).normal(size=10**6)), quantile))
    assert assert_quantile(values, quantile, at_most=1.02 * true) == pytest.approx(true, rel=0.1)
    with pytest.raises(AssertionError, match=r"^failed"):
        assert_quantile(1.3 * values, quantile, at_most=true)  # planted: errors 30 % too large
    above = round(8 * (1 - quantile))  # as many as there should be; eight drawn ones may all be small
    with pytest.raises(AssertionError, match=r"^inconclusive"):
        assert_quantile([1.1 * true] * above + [0.9 * true] * (8 - above), quantile, at_most=true)


def test_an_undefined_error_is_not_a_small_one():
    with pytest.raises(AssertionError, match=r"^failed"):
        assert_quantile([math.nan] * 100, 0.5, at_most=1.0)


def test_independent_samples_pass_and_shared_ones_do_not():
    one, other = np.random.default_rng(0).normal(size=(2, 5000))
    assert abs(assert_independent(one, other)) < 0.07
    with pytest.raises(AssertionError, match=r"^failed"):
        assert_independent(one, 0.9 * other + 0.3 * one)  # planted: a tenth of the variance is shared
    with pytest.raises(AssertionError, match=r"^inconclusive"):
        assert_independent(one[:20], other[:20])


@pytest.mark.parametrize("claim", [(0.9, 0.95), (1.1, 0.5), (0.9, 0.0), (0.9, 0.9)])
def test_a_claim_that_no_test_can_hold_is_refused(claim):
    with pytest.raises(ValueError, match="reject_below"):
        assert_rate(coin(0.9), at_least=claim[0], reject_below=claim[1])
