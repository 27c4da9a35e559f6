"""`leakloc reproduce`: the paper's evaluation, its tables and figures, in one command."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import click

from scenarios.cli_options import FOLDER, STOPPED, clear_errors
from scenarios.output_folder import check_destination, creating, replacing


@click.command()
@click.option("-o", "--output", "destination", type=FOLDER, default=Path("reproduced"), show_default=True)
@click.option("--quick", is_flag=True, help="Fewer scenes, noise and frame counts: a minute or two.")
@click.option(
    "--scenes", type=click.IntRange(1, 1000), help="Random scenes of three leaks: 30, quick 5; the paper has 10."
)
@click.option("--workers", "n_workers", type=click.IntRange(1, 256), default=2, show_default=True)
@click.option("--force", is_flag=True, help="Replace an earlier evaluation.")
@click.option("--set", "overrides", multiple=True, hidden=True, help="Change all scenarios: for tests.")
@clear_errors
def reproduce(  # noqa: PLR0913  one argument per option
    destination: Path, n_workers: int, scenes: int | None, overrides: tuple[str, ...], *, quick: bool, force: bool
) -> None:
    """Run the paper's evaluation for its method and ours, and put both beside the published numbers.

    Writes report.html, tables.json, tables.csv, figures/ and stores/. A run that was stopped or killed goes on when it
    is started again.
    """
    from scenarios.evaluation import FULL, QUICK, campaign_files, evaluating, evaluation_of, remove_stores
    from scenarios.progress import progress
    from scenarios.reproduce import write_evaluation
    from scenarios.run_campaign import local_workers

    check_destination(destination, "tables.json", force=force)
    size = QUICK if quick else FULL
    size = size if scenes is None else replace(size, separated=scenes)
    files = campaign_files(size, overrides)
    unfinished = destination.with_name(f"{destination.name}.unfinished")
    with evaluating(files, unfinished, local_workers(n_workers)) as under_way:
        if under_way.n_there:
            click.echo(f"{unfinished}: {under_way.n_there} of {under_way.n_scenes} scenes are there already", err=True)
        try:
            for _ in progress(under_way.left, "scenes", under_way.n_scenes - under_way.n_there):
                pass
        except KeyboardInterrupt:
            click.echo(f"\n{unfinished}: stopped; the same command goes on", err=True)
            sys.exit(STOPPED)
    evaluation = evaluation_of(size, files, unfinished)
    click.echo(write_evaluation(evaluation, unfinished, destination, replacing if force else creating))
    remove_stores(files, unfinished)
    click.echo(f"\nreport: {destination / 'report.html'}")
