"""What an estimator must do over random layouts, baselines, fields of view, noise, frames and tilt, stratum by stratum.

The leaks of a clip are not independent, so a trial is one observable leak drawn from each clip that has any: its rate
is a rate over observable leaks, and an interval may be quoted for it. Errors are in pixels of disparity, error /
(Z^2 / (f B)), so that one bound serves every rig; the half of the leaks where a pixel is worth least and the half where
it is worth most hold it each, which an error that scales otherwise breaks in one of them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
import pytest
from scipy.stats import poisson

from scenarios.bench import Trial, Work, trial_on
from scenarios.estimators import EstimatorSpec
from scenarios.simulate import simulate
from scenarios.space import STRATA, scene_of
from scenarios.statistics import RateVerdict, assert_quantile, assert_rate

METHODS = ("robust", "paper", "naive")
FALSE_PER_CLIP = 0.05  # what `robust` is asked for
CAP = 120


@dataclass(frozen=True)
class Claim:
    """Of a method in a stratum: rate of observable leaks found, the rate that must be caught, and bounds on errors."""

    method: str
    stratum: str
    at_least: float
    reject_below: float
    median_px: float
    error_95_px: float

    def replay(self, seed: int, number: int) -> str:
        scene = scene_with_leaks(self.stratum, number, seed)
        return f"leakloc explain {self.stratum}:{scene}{f':{seed}' if seed else ''} --method {self.method}"


ROBUST = [
    Claim("robust", "easy", 0.99, 0.80, 0.3, 1.5),  # the design's bars; passes after 15 clips without a miss
    Claim("robust", "nominal", 0.97, 0.78, 0.3, 1.5),  # 14
    Claim("robust", "hard", 0.90, 0.65, 0.3, 1.5),  # 10
]
CLIPS = {"easy": 15, "nominal": 14, "hard": 10}
PAPER = Claim("paper", "easy", 0.45, 0.20, 1.5, 4.0)
"""Whole columns of half the paper's image, and shadows that pull; with more noise its rate is no more to speak of."""
by_stratum = pytest.mark.parametrize(
    "claim", [pytest.param(c, id=c.stratum, marks=pytest.mark.xdist_group(c.stratum)) for c in ROBUST]
)


@cache
def trials(stratum: str, number: int, seed: int) -> dict[str, Trial]:
    """All methods on one scene, rendered once."""
    clip = simulate(scene_of(stratum, number, seed))
    return {m: trial_on(clip, Work(EstimatorSpec("method", m), stratum, number, seed)) for m in METHODS}


@cache
def scene_with_leaks(stratum: str, number: int, seed: int) -> int:
    """Number, among all, of scene `number` of those with an observable leak."""
    after = -1 if number == 0 else scene_with_leaks(stratum, number - 1, seed)
    scene = after + 1
    while trials(stratum, scene, seed)["robust"].of["observable"] == 0:
        scene += 1
    return scene


def finds_a_leak(claim: Claim, seed: int) -> Callable[[int], bool]:
    """Whether one observable leak of a scene, drawn at random, is found."""

    def success(number: int) -> bool:
        row = trials(claim.stratum, scene_with_leaks(claim.stratum, number, seed), seed)[claim.method]
        drawn = np.random.default_rng((seed, number)).integers(row.of["observable"])
        return bool(drawn < row.found["observable"])

    return success


def held_rate(claim: Claim, seed: int) -> RateVerdict:
    return assert_rate(
        finds_a_leak(claim, seed),
        at_least=claim.at_least,
        reject_below=claim.reject_below,
        cap=CAP,
        replay=partial(claim.replay, seed),
    )


def rows_of(claim: Claim, seed: int, n: int) -> list[Trial]:
    """The first scenes, to the n-th with an observable leak."""
    last = scene_with_leaks(claim.stratum, n - 1, seed)
    return [trials(claim.stratum, number, seed)[claim.method] for number in range(last + 1)]


def errors_of(rows: list[Trial]) -> tuple[np.ndarray, np.ndarray]:
    """Errors of observable leaks found, px of disparity, and the metres that a pixel is worth there."""
    px = np.array([error for row in rows for error in row.disparity_errors_px])
    metres = np.array([error for row in rows for error in row.errors_m])
    return px, metres / px


def assert_errors_scale(errors_px: np.ndarray, metres_per_px: np.ndarray, claim: Claim, beta_95: float) -> None:
    assert_quantile(errors_px, 0.5, at_most=claim.median_px, beta=0.3)
    assert_quantile(errors_px, 0.95, at_most=claim.error_95_px, beta=beta_95)
    order = np.argsort(metres_per_px)
    near, far = order[: len(order) // 2], order[len(order) // 2 :]
    for half in (near, far):
        assert_quantile(errors_px[half], 0.5, at_most=claim.median_px, beta=0.6)


@pytest.mark.statistical
@by_stratum
def test_robust_finds_observable_leaks_at_the_bars_of_the_design(claim, harness_seed):
    assert held_rate(claim, harness_seed).decision == "pass"


@pytest.mark.statistical
@by_stratum
def test_robust_errs_by_less_than_a_third_of_a_pixel_whatever_a_pixel_is_worth(claim, harness_seed):
    # 95 %: no error above among seven leaks, or one among 17, tells 5 % from 9.5 % with beta 0.5
    assert_errors_scale(*errors_of(rows_of(claim, harness_seed, CLIPS[claim.stratum])), claim, 0.5)


@pytest.mark.statistical
@by_stratum
def test_robust_invents_few_leaks(claim, harness_seed):
    rows = rows_of(claim, harness_seed, CLIPS[claim.stratum])
    # Poisson exceeds this many with probability 1e-6; naive invents 2.6 a clip
    assert sum(row.false for row in rows) <= poisson.isf(1e-6, FALSE_PER_CLIP * len(rows))


@pytest.mark.statistical
@pytest.mark.xdist_group("easy")
def test_the_paper_finds_leaks_and_errs_by_columns_whatever_a_column_is_worth(harness_seed):
    held_rate(PAPER, harness_seed)
    assert_errors_scale(*errors_of(rows_of(PAPER, harness_seed, CLIPS["easy"])), PAPER, 0.95)


@pytest.mark.deep
@by_stratum
def test_robust_holds_every_bar_over_two_hundred_scenes(claim, harness_seed):
    rows = rows_of(claim, harness_seed, 200)
    found, of = (sum(getattr(row, count)["observable"] for row in rows) for count in ("found", "of"))
    errors = errors_of(rows)
    print(f"{claim.stratum}: {found}/{of}, px {np.quantile(errors[0], [0.5, 0.95]).round(3)}, seed {harness_seed}")  # noqa: T201
    assert_errors_scale(*errors, claim, 0.05)
    assert sum(row.false for row in rows) <= poisson.isf(1e-6, FALSE_PER_CLIP * len(rows))
    # three standard errors of a binomial rate below the bar
    assert found >= claim.at_least * of - 3 * np.sqrt(of * claim.at_least * (1 - claim.at_least))


@pytest.mark.xdist_group("easy")
def test_the_suite_discriminates_the_naive_estimator_fails_where_robust_passes():
    easy = ROBUST[0]
    naive = Claim("naive", "easy", easy.at_least, easy.reject_below, easy.median_px, easy.error_95_px)
    with pytest.raises(AssertionError, match=r"^failed: (.|\n)*leakloc explain easy:\d+ --method naive"):
        held_rate(naive, 0)
    rows = rows_of(naive, 0, CLIPS["easy"])
    assert sum(row.false for row in rows) > poisson.isf(1e-6, FALSE_PER_CLIP * len(rows))


def test_an_error_of_as_many_metres_everywhere_breaks_the_bound_where_a_pixel_is_worth_least():
    metres_per_px = np.geomspace(0.02, 0.4, 60)
    claim = ROBUST[2]
    assert_errors_scale(np.full(60, 0.2), metres_per_px, claim, 0.1)
    with pytest.raises(AssertionError, match=r"^failed: 50% quantile"):
        assert_errors_scale(0.03 / metres_per_px, metres_per_px, claim, 0.1)


def test_every_stratum_has_its_bars():
    assert [claim.stratum for claim in ROBUST] == [space.name for space in STRATA]
    assert [claim.at_least for claim in ROBUST] == [0.99, 0.97, 0.90]
