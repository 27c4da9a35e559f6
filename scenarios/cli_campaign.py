"""`leakloc campaign`: run a study, see how it stands, export it, report it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from scenarios.campaign_file import CAMPAIGNS, CampaignFile, read_campaign, repeated
from scenarios.cli_options import FILE, STOPPED, FiniteRange, clear_errors
from scenarios.output_folder import check_apart, check_target, write_file

if TYPE_CHECKING:
    from scenarios.estimators import EstimatorSpec
    from scenarios.lanes import Kind
    from scenarios.scene_work import SceneOutcome


@click.group(epilog=f"Shipped campaigns: {', '.join(CAMPAIGNS.names())}.")
def campaign() -> None:
    """Run a study: a scenario by a sweep, or a space, times repeats, times methods, into a results store.

    FILE is a TOML file or the name of a shipped campaign. A run that was stopped or killed goes on when it is started
    again.
    """


@campaign.command()
@click.argument("file", metavar="FILE")
@click.option("-o", "--output", "store", type=FILE, required=True, help="Results store; a stopped run goes on.")
@click.option("--repeats", type=click.IntRange(1, 100_000), help="Instead of the file's: a first look, or more clips.")
@click.option("--workers", "n_workers", type=click.IntRange(1, 256), default=2, show_default=True)
@click.option("--dask", metavar="ADDRESS", help="Use the workers of a Dask cluster instead: tcp://host:port.")
@click.option("--estimator", "callables", multiple=True, metavar="MODULE:FUNCTION", help="Test this one too.")
@click.option(
    "--command", "commands", multiple=True, metavar="COMMAND", help='Test this too: "mytool {clip} {result}".'
)
@click.option(
    "--timeout", type=FiniteRange(0.0, 3600.0, min_open=True), default=60.0, show_default=True, help="Of these, s."
)
@clear_errors
def run(  # noqa: PLR0913  one argument per option
    file: str,
    store: Path,
    repeats: int | None,
    n_workers: int,
    dask: str | None,
    callables: tuple[str, ...],
    commands: tuple[str, ...],
    timeout: float,
) -> None:
    """Run what is not there yet, and say what came out."""
    from scenarios.estimators import EstimatorSpec, check_there

    foreign = [EstimatorSpec("callable", text, timeout) for text in callables]
    foreign += [EstimatorSpec("command", text, timeout) for text in commands]
    for spec in foreign:
        check_there(spec)
    wanted = read_campaign(file) if repeats is None else repeated(read_campaign(file), repeats)
    check_target(store)
    if dask is None:
        from scenarios.run_campaign import local_workers

        _run(wanted, foreign, store, local_workers(n_workers))
        return
    from scenarios.dask_workers import dask_workers

    with dask_workers(dask) as kind:
        _run(wanted, foreign, store, kind)


def _run(wanted: CampaignFile, foreign: list[EstimatorSpec], store: Path, kind: Kind) -> None:
    from scenarios.progress import progress
    from scenarios.run_campaign import running

    with running(wanted, foreign, store, kind) as under_way:
        if under_way.n_there:
            click.echo(f"{store}: {under_way.n_there} of {under_way.n_scenes} scenes are there already", err=True)
        n_left = under_way.n_scenes - under_way.n_there
        try:
            for outcome in progress(under_way.left, "scenes", n_left):
                _tell_breakdowns(outcome)
        except KeyboardInterrupt:
            click.echo(f"\n{store}: stopped; the same command goes on", err=True)
            sys.exit(STOPPED)
    _show(store)


def _tell_breakdowns(outcome: SceneOutcome) -> None:
    for ended in outcome.runs:
        if ended.outcome in ("crash", "timeout"):
            click.echo(f"scene {outcome.number}, {ended.method}: {ended.outcome}: {ended.detail}", err=True)


@campaign.command()
@click.argument("store", type=FILE)
@clear_errors
def show(store: Path) -> None:
    """Print a table: arm by method, what was found of all, of in-view and of observable leaks, and how far off."""
    _show(store)


def _show(path: Path) -> None:
    from scenarios.campaign_summary import NOTE, cells, table, wrong_codes
    from scenarios.store import read_store, read_timings

    stored = read_store(path)
    there, n_scenes = len({run.scene for run in stored.runs}), stored.identity.campaign.n_scenes
    click.echo(f"{path}: {stored.identity.campaign.name or 'campaign'}, {there} of {n_scenes} scenes\n")
    if not stored.runs:
        return
    click.echo(table(stored.runs))
    click.echo(f"\n{NOTE}\n")
    for cell in cells(stored.runs):
        arm = ", ".join(f"{axis} {value}" for axis, value in cell.values.items())
        click.echo(f"wrong, {f'{arm}, ' if arm else ''}{cell.method}: {wrong_codes(cell)}")
    render_s, method_s = read_timings(path)
    click.echo(f"\nworkers spent {render_s:.1f} s on rendering and {method_s:.1f} s on the methods")


@campaign.command()
@click.argument("store", type=FILE)
@click.option("--csv", "as_csv", is_flag=True, required=True, help="A row per run.")
@click.option("-o", "--output", "destination", type=FILE, required=True, help="File to write.")
@clear_errors
def export(store: Path, destination: Path, *, as_csv: bool) -> None:
    """Write the runs as a table for other tools; the same bytes whatever the workers, stops and order were."""
    from scenarios.campaign_csv import campaign_csv
    from scenarios.store import read_store

    del as_csv  # the one format there is
    check_apart(store, destination)
    write_file(destination, campaign_csv(read_store(store)))


@campaign.command()
@click.argument("store", type=FILE)
@click.option("-o", "--output", "destination", type=FILE, required=True, help="Page to write.")
@clear_errors
def report(store: Path, destination: Path) -> None:
    """Write one offline page: tables, figures with intervals, outcome codes, and how to replay the worst scenes."""
    from scenarios.campaign_report import report_html
    from scenarios.store import read_store

    check_apart(store, destination)
    check_target(destination)
    write_file(destination, report_html(read_store(store)))


@campaign.command()
@click.argument("store", type=FILE)
@click.option("-o", "--output", "destination", type=FILE, required=True, help="SVG file to write.")
@clear_errors
def figure(store: Path, destination: Path) -> None:
    """Write the report's figure alone: detection and error against the swept axis, with intervals."""
    from scenarios.campaign_figures import main_axis, sweep_figure
    from scenarios.campaign_summary import cells
    from scenarios.store import read_store
    from scenarios.store_identity import StoreError

    check_apart(store, destination)
    check_target(destination)
    stored = read_store(store)
    table_cells = cells(stored.runs)
    axis = main_axis(table_cells)
    if axis is None:
        raise StoreError(f"{store}: nothing is swept in it: there is no figure to draw")
    write_file(destination, sweep_figure(stored.identity.campaign, table_cells, axis))


@campaign.command()
@click.argument("file", metavar="FILE")
@clear_errors
def check(file: str) -> None:
    """Read a campaign, report every mistake in it and in its arms, or say how large it is."""
    wanted = read_campaign(file).campaign
    n_runs = wanted.n_scenes * len(wanted.methods)
    what = f"{wanted.n_arms} arms of {wanted.repeats} repeats" if wanted.space is None else "a space"
    click.echo(f"{file}: ok: {what}, {wanted.n_scenes} scenes, {n_runs} runs ({', '.join(wanted.methods)})")
