"""The covariance that the robust method reports is what its errors are: its 95 % region holds the truth that often."""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest
from scipy.stats import binom, chi2

import leakloc
from scenarios.scenario_file import read_scenario
from scenarios.score import score
from scenarios.simulate import simulate

pytestmark = pytest.mark.xdist_group("uncertainty")  # groups start first: this is the longest

FIRST_SEED = 2000
REGION = chi2.ppf(0.95, 2)  # 5.99
HALF_COVERAGE = (0.40, 0.62)  # of the 50 % region: errors have a heavier tail than their core tells
DEEP_SEED, DEEP_CLIPS = 20_000, 1_170  # 2900 leaks


def squared_distances(first_seed: int, n_clips: int, preset: str = "separated") -> np.ndarray:
    """Squared Mahalanobis distance of every found leak of clips of a setting of the paper."""
    found = []
    for seed in range(first_seed, first_seed + n_clips):
        clip = simulate(read_scenario(preset, [], seed=seed))
        estimate = leakloc.locate(clip.left, clip.right, clip.believed_rig, method="robust")
        truth = {leak.id: np.array([leak.x_m, leak.y_m]) for leak in clip.truth.leaks}
        for pair in score([(leak.x_m, leak.y_m) for leak in estimate.leaks], clip.truth).gated.pairs:
            leak = estimate.leaks[pair.estimate]
            error_m = np.array([leak.x_m, leak.y_m]) - truth[pair.leak_id]
            found.append(float(error_m @ np.linalg.solve(leak.covariance_m2, error_m)))
    return np.array(found)


def assert_calibrated(distances2: np.ndarray, coverage: tuple[float, float], alpha: float = 1e-3) -> None:
    """Refuse a share inside the 95 % region that a coverage in the range gives with a probability below alpha.

    Regions that are too large rarely miss, which few leaks cannot tell from 98 %; their 50 % regions tell.
    """
    for region, (low, high) in ((0.95, coverage), (0.5, HALF_COVERAGE)):
        n, inside = len(distances2), int((distances2 <= chi2.ppf(region, 2)).sum())
        least, most = binom.ppf(alpha, n, low), binom.isf(alpha, n, high)
        assert least <= inside <= most, f"{region:.0%} region: {inside} of {n} inside, {least:g} to {most:g} allowed"


@pytest.mark.statistical
def test_the_95_percent_region_holds_the_truth_in_90_to_98_percent_of_leaks(harness_seed):
    # 14 clips of five leaks, 60 found: 54 to 58 are 90 to 98 %; chance alone is +-1.7 leaks at 95 %
    distances2 = squared_distances(FIRST_SEED + 1000 * harness_seed, 14, "five")
    assert len(distances2) >= 50
    assert_calibrated(distances2, (0.90, 0.98))
    if harness_seed == 0:  # 60 leaks scatter by 2.8 %: one fresh seed in seven is outside by chance
        assert 0.90 <= (distances2 <= REGION).mean() <= 0.98


@pytest.mark.deep
def test_the_95_percent_region_holds_the_truth_in_93_to_97_percent_of_many_leaks(harness_seed):
    # 2850 leaks: chance alone is +-0.4 %
    half, first = DEEP_CLIPS // 2, DEEP_SEED + 10_000 * harness_seed
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as workers:
        found = workers.map(squared_distances, (first, first + half), (half, half))
        distances2 = np.concatenate(list(found))
    share = (distances2 <= REGION).mean()
    print(f"{share:.3f} of {len(distances2)} inside, seed {harness_seed}")  # noqa: T201
    assert len(distances2) >= 2850
    assert 0.93 <= share <= 0.97


@pytest.mark.parametrize(("scale", "calibrated"), [(1.0, True), (2.0, False), (0.25, False)])
def test_a_covariance_twice_too_small_or_four_times_too_large_is_caught(scale, calibrated):
    # `scale`: of squared distances. At a quarter 100.0 % are inside, at twice 77.6 %
    distances2 = scale * np.random.default_rng(5).chisquare(2, 400)
    if calibrated:
        assert_calibrated(distances2, (0.93, 0.97))
    else:
        with pytest.raises(AssertionError, match=r"% region: \d+ of 400 inside"):
            assert_calibrated(distances2, (0.93, 0.97))
