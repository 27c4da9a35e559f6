"""Statistical tests that do not flake: claims about rates and quantiles, what they must catch, how often they may err.

Every test has three outcomes. *Pass* and *fail* are decisions with the stated error rates; *inconclusive* means that
the trials allowed were too few for either, and fails under its own name.

Usable from any pytest suite: `from scenarios.statistics import assert_rate`.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import betainc, betaincinv, ndtri  # scipy.stats would add half a second to every command

from scenarios.hunted import refuse_hunted

Decision = Literal["pass", "fail", "inconclusive"]
SHOWN_SEEDS = 10
FEWEST_CLIPS = 5
N_RESAMPLES = 4000


@dataclass(frozen=True)
class RateVerdict:
    """What trials said of a rate: `k` successes of `n`, the seeds that failed, and the decision."""

    decision: Decision
    n: int
    k: int
    failed_seeds: tuple[int, ...]

    @property
    def interval(self) -> tuple[float, float]:
        """Clopper-Pearson interval of 95 % as if n had been fixed; after a sequential stop it is a description."""
        return clopper_pearson(self.k, self.n)


@dataclass(frozen=True)
class FixedSizePlan:
    """A fixed-size test: run `n` trials, pass at `k` successes or more."""

    n: int
    k: int


def clopper_pearson(k: int, n: int, confidence: float = 0.95) -> tuple[float, float]:
    """Exact interval of a binomial rate (Clopper and Pearson, Biometrika 26, 1934); (0, 1) without trials.

    Like all of this file it raises HuntedDataError for what a hunt found, which is no sample.
    """
    refuse_hunted(k, n)
    tail = (1.0 - confidence) / 2.0
    low = float(betaincinv(k, n - k + 1, tail)) if k > 0 else 0.0
    high = float(betaincinv(k + 1, n - k, 1.0 - tail)) if k < n else 1.0
    return low, high


def binomial_tail(k: ArrayLike, n: int, rate: float) -> NDArray[np.float64]:
    """Probability of k or more successes (of each of an array of k) in n trials (DLMF 8.17.5)."""
    least = np.maximum(k, 1)
    return np.where(np.asarray(k) <= 0, 1.0, betainc(least, n + 1 - least, rate))


def median_interval(values: Sequence[float], confidence: float = 0.95) -> tuple[float, float, float]:
    """Median of a sample, and the interval between two of its values that holds the distribution's median.

    Distribution-free: the number of values below the median is binomial with 1/2 (Conover, Practical Nonparametric
    Statistics, 3.2). The ends are NaN below 6 values, with which no interval of 95 % exists; all are without any.
    """
    refuse_hunted(values)
    sample = np.sort(np.asarray(values, dtype=float))
    if len(sample) == 0:
        return math.nan, math.nan, math.nan
    n = len(sample)
    at_most = binomial_tail(np.arange(n, -1, -1), n, 0.5)  # that 0, 1, 2 ... values or fewer are below the median
    outside = int(np.searchsorted(at_most, (1.0 - confidence) / 2.0, side="right")) - 1
    if outside < 0:
        return float(np.median(sample)), math.nan, math.nan
    return float(np.median(sample)), float(sample[outside]), float(sample[-1 - outside])


def mean_interval(clips: Sequence[Sequence[float]], confidence: float = 0.95) -> tuple[float, float]:
    """Bootstrap interval of the mean of all values, clips being what is drawn, for values of one clip hang together.

    Percentiles of 4000 resamples with a fixed seed (Davison and Hinkley, Bootstrap Methods and their Application, 1997,
    3.8: clusters). NaN below 5 clips that have a value; with few more it is rather too short.
    """
    refuse_hunted(clips, *clips)
    sums = np.array([sum(clip) for clip in clips if len(clip)])
    counts = np.array([len(clip) for clip in clips if len(clip)])
    if len(sums) < FEWEST_CLIPS:
        return math.nan, math.nan
    drawn = np.random.default_rng(0).integers(len(sums), size=(N_RESAMPLES, len(sums)))
    means = sums[drawn].sum(axis=1) / counts[drawn].sum(axis=1)
    tail = (1.0 - confidence) / 2.0
    return float(np.quantile(means, tail)), float(np.quantile(means, 1.0 - tail))


def sequential_test(  # noqa: PLR0913  the five numbers that define Wald's test
    trial: Callable[[int], bool],
    *,
    at_least: float,
    reject_below: float,
    alpha: float,
    beta: float,
    seeds: Iterable[int],
) -> RateVerdict:
    """Wald's sequential probability ratio test of a success rate over a fixed list of seeds.

    Fails a rate of `at_least` or more with probability `alpha` at most, passes one of `reject_below` or less with
    probability `beta` at most (Wald, Sequential Analysis, 1947, 3.5). Inconclusive when the seeds run out.
    """
    check_claim(at_least, reject_below, alpha, beta)
    step = {True: math.log(at_least / reject_below), False: _log_ratio(1.0 - at_least, 1.0 - reject_below)}
    pass_at, fail_at = math.log((1.0 - alpha) / beta), math.log(alpha / (1.0 - beta))
    evidence, n, failed = 0.0, 0, []
    for n, seed in enumerate(seeds, 1):
        success = bool(trial(seed))  # which a hunted outcome refuses to be
        if not success:
            failed.append(seed)
        evidence += step[success]
        if evidence >= pass_at:
            return RateVerdict("pass", n, n - len(failed), tuple(failed))
        if evidence <= fail_at:
            return RateVerdict("fail", n, n - len(failed), tuple(failed))
    return RateVerdict("inconclusive", n, n - len(failed), tuple(failed))


def assert_rate(  # noqa: PLR0913  the contract of the harness: one claim, its errors, its budget
    trial: Callable[[int], bool],
    *,
    at_least: float = 0.95,
    reject_below: float = 0.85,
    alpha: float = 1e-6,
    beta: float = 0.05,
    cap: int = 400,
    first_seed: int = 0,
    replay: Callable[[int], str] = "seed {}".format,
) -> RateVerdict:
    """Assert that `trial(seed)` succeeds at a rate, by `sequential_test` over at most `cap` seeds.

    `replay` makes the command that repeats one seed. Raises AssertionError, worded for failed or inconclusive, with n,
    k, interval, the seeds that failed and the command that replays the first of them.
    """
    seeds = range(first_seed, first_seed + cap)
    verdict = sequential_test(trial, at_least=at_least, reject_below=reject_below, alpha=alpha, beta=beta, seeds=seeds)
    if verdict.decision != "pass":
        claim = f"rate >= {at_least:g} (must catch {reject_below:g}, alpha {alpha:g}, beta {beta:g})"
        raise AssertionError(rate_message(verdict, claim, replay))
    return verdict


def fixed_size_plan(at_least: float, reject_below: float, alpha: float, beta: float) -> FixedSizePlan:
    """Smallest test of a fixed number of trials: fails `at_least` with probability <= alpha, passes `reject_below`
    with probability <= beta.
    """
    from scipy.stats import binom  # half a second of imports that most commands do not need

    check_claim(at_least, reject_below, alpha, beta)
    largest = 64
    while True:
        n = np.arange(1, largest + 1)
        k = binom.ppf(alpha, n, at_least)  # smallest k with P(X <= k) >= alpha, so P(X < k) < alpha
        feasible = np.flatnonzero(binom.sf(k - 1, n, reject_below) <= beta)
        if len(feasible):
            return FixedSizePlan(int(n[feasible[0]]), int(k[feasible[0]]))
        largest *= 4


def assert_rate_of_fixed_size(
    trial: Callable[[int], bool],
    plan: FixedSizePlan,
    *,
    first_seed: int = 0,
    replay: Callable[[int], str] = "seed {}".format,
) -> RateVerdict:
    """Assert that at least `plan.k` of `plan.n` trials succeed; stops as soon as that is decided."""
    failed: list[int] = []
    for n, seed in enumerate(range(first_seed, first_seed + plan.n), 1):
        if not trial(seed):
            failed.append(seed)
        if len(failed) > plan.n - plan.k:
            verdict = RateVerdict("fail", n, n - len(failed), tuple(failed))
            raise AssertionError(rate_message(verdict, f"{plan.k} of {plan.n}", replay))
        if n - len(failed) >= plan.k:
            return RateVerdict("pass", n, n - len(failed), tuple(failed))
    raise AssertionError("unreachable: all trials decide")


def assert_quantile(
    values: Sequence[float], quantile: float, at_most: float, *, alpha: float = 1e-6, beta: float = 0.05
) -> float:
    """Assert that a quantile of a distribution is at most a bound, by the number of values above it (sign test).

    NaN counts as above. Fails when that many above have probability < alpha under the claim. Passes when that few have
    probability <= beta under twice the odds of being above; else inconclusive: more values are needed. Returns the
    sample's quantile.
    """
    refuse_hunted(values)
    sample = np.asarray(values, dtype=float)
    n, above = len(sample), int(np.sum(~(sample <= at_most)))
    share = 1.0 - quantile
    doubled = 2.0 * share / (1.0 + share)
    found = f"{quantile:.0%} quantile <= {at_most:g}: {above} of {n} values above"
    if binomial_tail(above, n, share) < alpha:
        raise AssertionError(f"failed: {found}, {share * n:.1f} expected (alpha {alpha:g})")
    if not binomial_tail(n - above, n, 1.0 - doubled) <= beta:
        raise AssertionError(
            f"inconclusive: {found}; too few values to tell a share of {share:.3g} from {doubled:.3g} (beta {beta:g})"
        )
    return float(np.quantile(np.where(np.isnan(sample), np.inf, sample), quantile, method="higher"))


def assert_independent(one: Sequence[float], other: Sequence[float], *, alpha: float = 1e-6) -> float:
    """Assert that two samples are not correlated: |atanh r| within the normal quantile of alpha over sqrt(n - 3).

    Fisher, Metron 1, 1921. Returns r. Inconclusive below 50 pairs, where a correlation of 0.7 could pass.
    """
    refuse_hunted(one, other)
    x, y = np.asarray(one, dtype=float), np.asarray(other, dtype=float)
    if len(x) != len(y):
        raise ValueError(f"assert_independent: samples must be as long as each other, got {len(x)} and {len(y)}")
    if len(x) < 50:
        raise AssertionError(f"inconclusive: {len(x)} pairs are too few to speak of independence (50 needed)")
    r = float(np.corrcoef(x, y)[0, 1])
    allowed = math.tanh(-float(ndtri(alpha / 2.0)) / math.sqrt(len(x) - 3))
    if not abs(r) <= allowed:
        raise AssertionError(
            f"failed: correlation {r:.4f} of {len(x)} pairs is beyond +-{allowed:.4f} (alpha {alpha:g})"
        )
    return r


def rate_message(verdict: RateVerdict, claim: str, replay: Callable[[int], str]) -> str:
    """Say what was claimed, what was found, and how to see the first failure again."""
    low, high = verdict.interval
    word = "failed" if verdict.decision == "fail" else "inconclusive"
    lines = [
        f"{word}: {claim}: {verdict.k} of {verdict.n} succeeded, 95 % interval {low:.3f} to {high:.3f}"
        + ("" if word == "failed" else "; more trials are needed to decide")
    ]
    if verdict.failed_seeds:
        shown = ", ".join(map(str, verdict.failed_seeds[:SHOWN_SEEDS]))
        more = f" and {len(verdict.failed_seeds) - SHOWN_SEEDS} more" if len(verdict.failed_seeds) > SHOWN_SEEDS else ""
        lines += [f"seeds that failed: {shown}{more}", f"replay the first: {replay(verdict.failed_seeds[0])}"]
    return "\n".join(lines)


def check_claim(at_least: float, reject_below: float, alpha: float, beta: float) -> None:
    """Refuse a claim that no test can hold."""
    if not 0.0 < reject_below < at_least <= 1.0:
        raise ValueError(f"must have 0 < reject_below < at_least <= 1, got {reject_below} and {at_least}")
    if not (0.0 < alpha < 0.5 and 0.0 < beta < 0.5):
        raise ValueError(f"alpha and beta must be in (0, 0.5), got {alpha} and {beta}")


def _log_ratio(top: float, bottom: float) -> float:
    return math.log(top / bottom) if top > 0.0 else -math.inf
