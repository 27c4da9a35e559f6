"""`leakloc hunt`, `shrink` and `envelope`: where an estimator fails, as plainly as can be, and where it does not."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from scenarios.cli_options import FOLDER, SEED, chosen_estimator, clear_errors, estimator_options, scenario_options
from scenarios.output_folder import check_apart, check_destination, creating, replacing
from scenarios.scenario_file import read_scenario

if TYPE_CHECKING:
    from scenarios.atlas import Tried
    from scenarios.hunt import Quarry

UNIT_S = {"s": 1.0, "min": 60.0, "h": 3600.0}
MAX_BUDGET_S = 7 * 24 * 3600.0


class Duration(click.ParamType):
    """A time with its unit: 30s, 10min, 2h."""

    name = "time"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Convert to seconds and check."""
        if isinstance(value, float):
            return value
        match = re.fullmatch(r"(\d+(?:\.\d+)?) *(s|min|h)", str(value).strip())
        seconds = float(match[1]) * UNIT_S[match[2]] if match else 0.0
        if not 0.0 < seconds <= MAX_BUDGET_S:
            self.fail(f"{value!r} must be a time up to a week with its unit: 30s, 10min, 2h", param, ctx)
        return seconds


@click.command()
@click.argument("space", metavar="SPACE")
@estimator_options
@click.option("--budget", type=Duration(), help="Time to look for failures, say 10min.  [default: 5min]")
@click.option("--scenes", type=click.IntRange(1, 1_000_000), help="Scenes to try, in place of or beside --budget.")
@click.option("--shrink", "n_shrunk", type=click.IntRange(0, 1000), default=1, show_default=True, help="Of each code.")
@click.option("--seed", type=SEED, default=0, show_default=True)
@click.option("--workers", "n_workers", type=click.IntRange(1, 256), default=2, show_default=True)
@click.option("-o", "--output", "destination", type=FOLDER, required=True, help="Folder to make.")
@click.option("--force", is_flag=True, help="Replace an earlier hunt.")
@clear_errors
def hunt(space: str, destination: Path, *, force: bool, **options: Any) -> None:
    """Look for scenes in which an estimator fails, and write an atlas of them.

    SPACE is easy, nominal, hard, a shipped space (drops, misaligned, optics) or a TOML file (leakloc schema space).
    Kept are the plainest scene of every outcome code in every third of every parameter's range, never a rate: they were
    looked for. With --scenes alone the result follows from the seed, whatever the number of workers.
    """
    from scenarios.atlas import Atlas
    from scenarios.hunt import Quarry
    from scenarios.hunt_folder import Hunt, plain_examples, write_hunt
    from scenarios.progress import progress
    from scenarios.space_file import read_space

    quarry = Quarry(read_space(space), chosen_estimator(options), options["seed"])
    check_destination(destination, "hunt.json", force=force)
    _check_input_apart(space, destination)
    atlas, n_scenes = Atlas(quarry.space), 0
    budget_s = options["budget"] or (None if options["scenes"] else 300.0)
    with (replacing if force else creating)(destination) as folder:
        try:
            for tried in _hunted(quarry, options["scenes"], budget_s, options["n_workers"]):
                n_scenes += 1
                atlas.add(tried)
        except KeyboardInterrupt:
            click.echo("\nstopped: what was found so far is written", err=True)
        done = Hunt(quarry, n_scenes, atlas)
        examples = plain_examples(done, options["n_shrunk"])
        entries = list(progress(examples, "counterexamples", len(atlas.counterexamples())))
        write_hunt(folder, done, entries)
    click.echo(f"{n_scenes} scenes tried; --scenes {n_scenes} --seed {quarry.seed} finds the same again")
    for code in atlas.codes():
        first = min((e for e in entries if e.found.code == code), key=lambda e: (e.shrunk is None, e.found.plainness))
        file = first.file if first.shrunk is None else first.plain_file
        click.echo(f"{code}: {destination / file}")
    click.echo(f"atlas: {destination / 'atlas.html'}" if atlas.codes() else "no failure was met")


def _check_input_apart(given: str, destination: Path) -> None:
    """Refuse to replace a folder that holds the file given: it would be gone; a name of a shipped one is no file."""
    if os.path.isfile(given):
        check_apart(Path(given), destination)


def _hunted(quarry: Quarry, n_scenes: int | None, budget_s: float | None, n_workers: int) -> Iterator[Tried]:
    """Yield scenes tried until their number or the time is spent, whichever is first; rounds are not cut by time."""
    from scenarios.hunt import hunt as hunted
    from scenarios.hunt_progress import hunting
    from scenarios.lanes import lanes_of, on_lanes
    from scenarios.run_campaign import local_workers

    end_s = None if budget_s is None else time.monotonic() + budget_s
    with (
        lanes_of(local_workers(n_workers)) as lanes,
        on_lanes(lanes) as evaluate,
        hunting(n_scenes, budget_s) as tell,
    ):
        for tried in hunted(quarry, evaluate, n_scenes):
            for one in tried:
                tell(one)
                yield one
            if end_s is not None and time.monotonic() >= end_s:
                return


@click.command()
@scenario_options
@estimator_options
@click.option("--code", help="Failure to keep; default: the scene's first.")
@click.option("-o", "--output", "destination", type=FOLDER, required=True, help="Folder to make.")
@click.option("--force", is_flag=True, help="Replace an earlier result.")
@clear_errors
def shrink(  # noqa: PLR0913  one argument per option
    scenario: str,
    overrides: tuple[str, ...],
    seed: int | None,
    code: str | None,
    destination: Path,
    *,
    force: bool,
    **options: Any,
) -> None:
    """Make a failing scene plain: fewer leaks, effects off, round numbers, fewer frames, the same outcome code.

    SCENARIO may also be a scene of the bench: nominal:7. Writes scene.toml of at most 20 lines where the scene allows,
    thumbnail.png and explain.txt.
    """
    from scenarios.failures import CODES, failures
    from scenarios.progress import told_as_it_goes
    from scenarios.shrink import codes_of, run_of
    from scenarios.shrink import shrink as shrunk_of
    from scenarios.shrunk_folder import write_shrunk

    if code not in (None, *CODES):
        raise click.BadParameter(f"{code!r} must be one of {', '.join(CODES)}", param_hint="--code")
    whole, spec = read_scenario(scenario, overrides, seed), chosen_estimator(options)
    check_destination(destination, "shrunk.json", force=force)
    _check_input_apart(scenario, destination)
    with (replacing if force else creating)(destination) as folder:
        befell = [failure for failure in failures(run_of(whole, spec)) if code in (None, failure.code)]
        leak = befell[0].leak if befell else None
        *_, last = told_as_it_goes(shrunk_of(whole, code, codes_of(spec), leak), "shrinking")
        shown = write_shrunk(folder, last, spec)
    click.echo(shown.toml)
    click.echo(shown.why)
    click.echo(f"\n{last.n_tried} scenes tried: {destination / 'scene.toml'}")


@click.command()
@click.argument("space", metavar="SPACE")
@estimator_options
@click.option("--scenes", type=click.IntRange(10, 100_000), default=128, show_default=True, help="To choose boxes on.")
@click.option("--trials", type=click.IntRange(59, 100_000), default=93, show_default=True, help="To test each box on.")
@click.option("--seed", type=SEED, default=0, show_default=True)
@click.option("--workers", "n_workers", type=click.IntRange(1, 256), default=2, show_default=True)
@click.option("-o", "--output", "destination", type=FOLDER, required=True, help="Folder to make.")
@click.option("--force", is_flag=True, help="Replace an earlier envelope.")
@clear_errors
def envelope(space: str, destination: Path, *, force: bool, **options: Any) -> None:
    """Show a box of parameters in which an estimator finds what can be found: the largest that stands the test.

    SPACE is as for `leakloc hunt`. Boxes are chosen on some clips and tested on others, so that it holds with 95 %
    confidence that at least 95 % of a box's clips have every observable leak found within the bound. 59 trials allow no
    failure, 93 one, 124 two. Writes envelope.json and envelope.html.
    """
    from scenarios.envelope import Quest
    from scenarios.envelope import envelope as envelope_of
    from scenarios.envelope_page import as_json, envelope_html
    from scenarios.lanes import lanes_of, on_lanes
    from scenarios.output_folder import write_file, write_json
    from scenarios.progress import counting
    from scenarios.run_campaign import local_workers
    from scenarios.space_file import read_space

    quest = Quest(read_space(space), chosen_estimator(options), options["seed"], options["scenes"], options["trials"])
    check_destination(destination, "envelope.json", force=force)
    _check_input_apart(space, destination)
    with (replacing if force else creating)(destination) as folder:
        with (
            lanes_of(local_workers(options["n_workers"])) as lanes,
            on_lanes(lanes) as evaluate,
            counting("clips") as tell,
        ):
            found = envelope_of(quest, evaluate, tell)
        write_json(folder / "envelope.json", as_json(found))
        write_file(folder / "envelope.html", envelope_html(found))
    shown = found.shown
    click.echo("no box is shown" if shown is None else f"shown: {as_json(found)['claim']}")
    for key, (low, high) in (as_json(found)["box"] or {}).items():
        click.echo(f"  {key:<28} {low:g} to {high:g}")
    click.echo(f"page: {destination / 'envelope.html'}")
