"""Where the simulated paper's method differs from the published values, by how much and why; all from the runs."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from scenarios.campaign_summary import number
from scenarios.evaluation import AS_IT_IS, Evaluation, scenario_of
from scenarios.evaluation_tables import Errors, Row
from scenarios.published import Published
from scenarios.scene_work import NEAR_WALL_M
from scenarios.stored_run import Run, replay_command

LARGE_ERROR_M = 0.1
PAPERS_SCENES = 10
N_SETS = 2000
PAPER = "paper"


@dataclass(frozen=True)
class Cured:
    """Leaks in view that the paper's method misses or places badly, and how many of them each removal cures."""

    n_bad: int
    n_leaks: int
    by_removal: dict[str, int]
    wall_m: tuple[float, ...]
    """Distances of the bad ones from the wall, m."""
    replays: tuple[str, ...]
    """Commands that explain the clips with such leaks."""


def differences(rows: Sequence[Row]) -> list[str]:
    """Return a sentence for every row that the paper has: found and mean error, against the published."""
    return [_difference(row) for row in rows if row.published is not None and row.method == PAPER]


def reasons(evaluation: Evaluation, rows: Sequence[Row]) -> list[str]:
    """Return sentences that say what the error and the missed leaks of the paper's method come from."""
    causes = [row for row in rows if row.experiment == "causes" and row.method == PAPER]
    cured = cures(evaluation)
    return [*_from_causes(causes), *_from_sets_of_ten(evaluation), *_from_cures(cured), *_from_misses(rows)]


def cures(evaluation: Evaluation) -> Cured:
    """Compare the separated scenes at noise H with themselves without one cause at a time, leak by leak."""
    whole = evaluation.runs("causes", AS_IT_IS, PAPER)
    radius_m = scenario_of(evaluation).pedestal.radius_m
    bad = {
        (run.repeat, leak.leak) for run in whole for leak in run.leaks if leak.in_view and not _is_good(run, leak.leak)
    }
    by_removal = {}
    for setting in evaluation.settings("causes"):
        if setting != AS_IT_IS:
            runs = {run.repeat: run for run in evaluation.runs("causes", setting, PAPER)}
            by_removal[setting] = sum(_is_good(runs[repeat], leak) for repeat, leak in bad if repeat in runs)
    repeats = {repeat for repeat, _ in bad}
    replays = tuple(replay_command(run, "--method") for run in whole if run.repeat in repeats)
    wall_m = [
        radius_m - math.hypot(leak.x_m, leak.y_m)
        for run in whole
        for leak in run.leaks
        if (run.repeat, leak.leak) in bad
    ]
    n_leaks = sum(leak.in_view for run in whole for leak in run.leaks)
    return Cured(len(bad), n_leaks, by_removal, tuple(sorted(wall_m)), replays)


def _is_good(run: Run, number: int) -> bool:
    """Whether a leak is found, by the paper's rule, at most a tenth of a metre off."""
    errors = [run.paper_error_m(leak) for leak in run.leaks if leak.leak == number]
    return all(error_m is not None and error_m <= LARGE_ERROR_M for error_m in errors) and bool(errors)


def _difference(row: Row) -> str:
    part, there = row.paper_rule, row.published
    assert there is not None
    found = part.found["all"]
    rate = found.leaks / found.of_leaks - there.found / there.of if found.of_leaks else math.nan
    return (
        f"{there.table}, {row.setting}: found {found.leaks}/{found.of_leaks} against {there.found}/{there.of} "
        f"({number(100.0 * rate, '+.1f')} points); {_error_beside(part.error, there)}"
    )


def _error_beside(error: Errors, there: Published) -> str:
    if not error.n:
        return f"no leak found, so no mean error to put beside {there.mean_error_m:.2f} m"
    by_m = error.mean_m - there.mean_error_m
    return (
        f"mean error {error.mean_m:.3f} m against {there.mean_error_m:.2f} m ({by_m:+.3f} m; {_inside(error, there)})"
    )


def _inside(error: Errors, there: Published) -> str:
    if math.isnan(error.low_m):
        return "too few clips for an interval"
    within = error.low_m <= there.mean_error_m <= error.high_m
    return f"the published value is {'inside' if within else 'outside'} our 95 % interval"


def _from_causes(causes: Sequence[Row]) -> Iterator[str]:
    whole = next((row for row in causes if row.setting == AS_IT_IS), None)
    if whole is None or not whole.paper_rule.error.n:
        return
    error, near = whole.paper_rule.error, whole.paper_rule.near_wall
    yield (
        f"At noise H, {near.n} of the {error.n} leaks found are less than {NEAR_WALL_M:g} m from the wall; "
        f"{whole.paper_rule.near_wall_share:.0%} of the sum of errors is theirs."
    )
    for row in causes:
        without = row.paper_rule.error
        if row is not whole and without.n:
            yield (
                f"The same clips {row.setting}: mean error {without.mean_m:.3f} m instead of {error.mean_m:.3f} m, "
                f"median {without.median_m:.3f} m instead of {error.median_m:.3f} m."
            )


def _from_sets_of_ten(evaluation: Evaluation) -> Iterator[str]:
    """How much a mean of as few scenes as the paper had hangs on which they are: sets of ten, drawn from ours."""
    for setting in evaluation.settings("separated"):
        runs = evaluation.runs("separated", setting, PAPER)
        clips = [[error_m for leak in run.leaks if (error_m := run.paper_error_m(leak)) is not None] for run in runs]
        if len(clips) >= 2 * PAPERS_SCENES and any(clips):
            low_m, middle_m, high_m = means_of_sets_m(clips)
            yield (
                f"Separated, {setting}: sets of {PAPERS_SCENES} scenes drawn from our {len(clips)} have mean errors of "
                f"{low_m:.2f} to {high_m:.2f} m (90 % of them; median {middle_m:.2f} m): few wrong matches decide."
            )


def means_of_sets_m(clips: Sequence[Sequence[float]]) -> tuple[float, float, float]:
    """Return the 5 %, 50 % and 95 % quantiles of the mean error of sets of as many scenes as the paper has, m.

    Sets are drawn with replacement from clips' errors (m); drawn ones without any error are left out.
    """
    sums, counts = (np.array(list(map(what, clips)), dtype=float) for what in (sum, len))
    drawn = np.random.default_rng(0).integers(len(clips), size=(N_SETS, PAPERS_SCENES))
    n = counts[drawn].sum(axis=1)
    means_m = sums[drawn].sum(axis=1)[n > 0] / n[n > 0]
    low_m, middle_m, high_m = np.quantile(means_m, [0.05, 0.5, 0.95])
    return float(low_m), float(middle_m), float(high_m)


def _from_cures(cured: Cured) -> Iterator[str]:
    yield (
        f"Of {cured.n_leaks} leaks in view at noise H, {cured.n_bad} are missed or more than {LARGE_ERROR_M:g} m off. "
        + " ".join(f"{n} of these are cured {setting}." for setting, n in cured.by_removal.items())
    )
    if cured.wall_m:
        where = f"{cured.wall_m[0]:.2f} to {cured.wall_m[-1]:.2f} m"
        yield f"They are {where} from the wall; near the wall, in the tables, means less than {NEAR_WALL_M:g} m."


def _from_misses(rows: Sequence[Row]) -> Iterator[str]:
    for row in rows:
        if row.experiment in ("separated", "frames", "crowded") and row.method == PAPER:
            part = row.paper_rule
            codes = ", ".join(f"{n} {code}" for code, n in sorted(row.codes.items()) if code != "found")
            yield (
                f"{row.experiment.capitalize()}, {row.setting}: missed {part.missed_out_of_view} leaks out of view and "
                f"{part.missed_in_view} in view; by the gate: {codes or 'nothing missed, nothing false'}."
            )
