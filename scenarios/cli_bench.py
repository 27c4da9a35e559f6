"""`leakloc explain` and `leakloc bench`: why an estimator fails, and how often."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from leakloc.outside_file import read_json
from scenarios.cli_options import FILE, SEED, chosen_estimator, clear_errors, estimator_options, scenario_options
from scenarios.output_folder import check_target, write_file, write_json
from scenarios.scenario_file import read_scenario

if TYPE_CHECKING:
    from scenarios.estimators import EstimatorSpec

MAX_BASELINE_BYTES = 6_000_000
"""Of some 15 000 scenes."""

NOT_GOOD_ENOUGH = 1


class BaselineError(ValueError):
    """A baseline that cannot be compared with; the message names the file and the rule."""


def run_bench_command(spec: EstimatorSpec, options: dict[str, Any]) -> None:
    """Run the bench as the command line's options say; exits with 1 when the estimator is not good enough."""
    from scenarios.bench import as_json, check_same_scenes, run_bench, table, worse_than
    from scenarios.junit import junit_xml
    from scenarios.progress import progress
    from scenarios.space import STRATA

    baseline = read_baseline(options["baseline"]) if options["baseline"] else None
    if baseline is not None:
        try:
            check_same_scenes(baseline, options["scenes"], options["seed"])
        except ValueError as error:
            raise BaselineError(f"{options['baseline']}: {error}") from None
    for target in (options["json"], options["junit"]):
        if target is not None:
            check_target(target)
    total = options["scenes"] * len(STRATA)
    running = run_bench(spec, options["scenes"], options["seed"], options["workers"])
    trials = list(progress(running, "scenes", total))
    click.echo(table(trials))
    if options["json"]:
        write_json(options["json"], as_json(trials, spec, options["seed"]))
    if options["junit"]:
        write_file(options["junit"], junit_xml(trials, spec.text))
    problems = [f"{trial.stratum} {trial.number}: {trial.codes[0]}: {trial.detail}" for trial in trials if trial.detail]
    if baseline is not None:
        problems += [f"worse than {options['baseline']}: {line}" for line in worse_than(trials, baseline)]
    if problems:
        click.echo("\n".join(problems), err=True)
        sys.exit(NOT_GOOD_ENOUGH)


def read_baseline(path: Path) -> dict[str, Any]:
    """Read the JSON of an earlier run; raises BaselineError."""
    try:
        content = read_json(path, MAX_BASELINE_BYTES)
    except ValueError as error:
        raise BaselineError(f"{path}: {error}") from None
    try:
        for row in content["trials"]:
            if not (
                isinstance(row["stratum"], str) and isinstance(row["number"], int) and row["right"] in (True, False)
            ):
                raise KeyError("trials")
    except (TypeError, KeyError):
        raise BaselineError(f"{path}: is not the --json of an earlier bench run") from None
    return dict(content)


@click.command()
@scenario_options
@estimator_options
@click.option("-o", "--output", "destination", type=FILE, help="Write a page with pictures here.")
@clear_errors
def explain(
    scenario: str, overrides: tuple[str, ...], seed: int | None, destination: Path | None, **estimator: Any
) -> None:
    """Say why an estimator fails: the same scene without one cause at a time.

    SCENARIO may also be a scene of the bench: nominal:7.
    """
    from scenarios.explain import causes, explain_html, table
    from scenarios.explain import explain as explained
    from scenarios.leaks import resolved
    from scenarios.progress import progress

    if destination is not None:
        check_target(destination)
    whole = resolved(read_scenario(scenario, overrides, seed))
    arms = list(progress(explained(whole, chosen_estimator(estimator)), "runs", 1 + len(causes(whole))))
    click.echo(table(arms))
    broken = [arm for arm in arms if arm.breakdown]
    if broken:
        click.echo(f"{broken[0].breakdown}: {broken[0].detail}", err=True)
    if destination is not None:
        write_file(destination, explain_html(arms))
        click.echo(f"\npictures: {destination}")
    if broken:
        sys.exit(NOT_GOOD_ENOUGH)


@click.command()
@estimator_options
@click.option("--scenes", type=click.IntRange(1, 100_000), default=40, show_default=True, help="Of each stratum.")
@click.option("--seed", type=SEED, default=0, show_default=True)
@click.option("--workers", type=click.IntRange(1, 256), default=2, show_default=True)
@click.option("--json", type=FILE, help="Write every trial here; serves as a later run's baseline.")
@click.option("--junit", type=FILE, help="Write JUnit XML here.")
@click.option("--baseline", type=FILE, help="Earlier --json: exit with 1 when this run is worse.")
@clear_errors
def bench(**options: Any) -> None:
    """Test an estimator on scenes it cannot see the truth of: what it finds, what it misses, and why."""
    run_bench_command(chosen_estimator(options), options)
