"""The command line: `leakloc`, or `python -m scenarios`."""

import io
import json
import sys
from pathlib import Path
from typing import Any

import click

from scenarios.cli_bench import bench, explain
from scenarios.cli_campaign import campaign
from scenarios.cli_export import export
from scenarios.cli_hunt import envelope, hunt, shrink
from scenarios.cli_locate import inspect, locate
from scenarios.cli_options import FILE, FOLDER, SEED, FiniteRange, clear_errors, scenario_options
from scenarios.cli_reproduce import reproduce
from scenarios.clip_folder import verify_clip, write_clip
from scenarios.output_folder import check_destination, creating, replacing
from scenarios.scenario import Scenario
from scenarios.scenario_file import library_names, read_scenario
from scenarios.truth import read_truth

SCHEMAS = ("scenario", "campaign", "space", "result", "truth")


@click.group(
    context_settings={"help_option_names": ["-h", "--help"]}, epilog=f"Shipped scenarios: {', '.join(library_names())}."
)
@click.version_option(package_name="leakloc", prog_name="leakloc")
def main() -> None:
    """Simulate leaks in a dark pedestal, find them, and score what was found.

    SCENARIO is a TOML file or the name of a shipped scenario. Start with: leakloc demo
    """
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a file's name may be no text at all


@main.command()
@scenario_options
@click.option("-o", "--output", "destination", type=FOLDER, required=True, help="Clip folder to make.")
@click.option("--force", is_flag=True, help="Replace a clip that is already there.")
@clear_errors
def simulate(scenario: str, overrides: tuple[str, ...], seed: int | None, destination: Path, *, force: bool) -> None:
    """Render a stereo clip with its radiation, sensor and truth."""
    from scenarios.simulate import simulate as simulated

    check_destination(destination, "clip.json", force=force)
    clip = simulated(read_scenario(scenario, overrides, seed))
    write_clip(clip, destination, replacing if force else creating)
    seen = sum(leak.observable for leak in clip.truth.leaks)
    click.echo(f"{destination}: {len(clip.left)} stereo frames, {len(clip.truth.leaks)} leaks, {seen} observable")


@main.command()
@click.argument("result", type=FILE)
@click.argument("clip", type=FOLDER)
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of a table.")
@clear_errors
def score(result: Path, clip: Path, *, as_json: bool) -> None:
    """Compare a result with the truth of its clip."""
    from scenarios import score as scoring

    verify_clip(clip)
    truth = read_truth(clip / "truth.json")
    scored = scoring.score(scoring.world_positions(result), truth)
    click.echo(json.dumps(scoring.as_json(scored), indent=1) if as_json else scoring.table(scored, truth))


@main.command()
@scenario_options
@click.option("-n", "n_clips", type=click.IntRange(1, 100_000), required=True, help="How many clips.")
@click.option(
    "-o", "--output", "destination", type=FOLDER, required=True, help="Data set folder; a killed run goes on."
)
@click.option("--workers", "n_workers", type=click.IntRange(1, 256), default=2, show_default=True)
@clear_errors
def generate(  # noqa: PLR0913  one argument per option
    scenario: str, overrides: tuple[str, ...], seed: int | None, n_clips: int, destination: Path, n_workers: int
) -> None:
    """Make a data set: many clips of one scenario with leaks at random places."""
    from scenarios.generate import generate as generated
    from scenarios.progress import progress

    base = read_scenario(scenario, overrides, seed)
    for _ in progress(generated(base, n_clips, destination, n_workers), "clips", n_clips):
        pass
    click.echo(f"{destination}: {n_clips} clips")


@main.command()
@click.argument("source", metavar="CLIP_OR_FOLDER", type=FOLDER)
@click.option("-o", "--output", "destination", type=FOLDER, required=True, help="Folder to make.")
@click.option("--dose-rate", type=FiniteRange(0.0, 10_000.0), required=True, help="Gy/h; L, M, H = 1.7, 3.3, 10.")
@click.option("--exposure", type=FiniteRange(0.0, 100.0, min_open=True), help="s a frame; default: input.json.")
@click.option("--energy", type=FiniteRange(300.0, 1500.0), default=661.7, show_default=True, help="Photons, keV.")
@click.option("--level", type=click.Choice(["tracks", "salt", "transport"]), default="tracks", show_default=True)
@click.option("--electrons-per-grey", type=FiniteRange(0.0, 1e4, min_open=True), default=33.0, show_default=True)
@click.option("--pitch-um", type=FiniteRange(0.5, 50.0), default=3.0, show_default=True, help="Of a pixel.")
@click.option("--tone", type=click.Choice(["linear", "srgb"]), help="Default: input.json, else linear.")
@click.option("--seed", type=SEED, default=0, show_default=True)
@click.option("--force", is_flag=True, help="Replace what leakloc made there before.")
@clear_errors
def noise(source: Path, destination: Path, exposure: float | None, *, force: bool, **options: Any) -> None:
    """Add gamma hits to frames: a clip folder, or any folder of images.

    Writes the truth of every hit beside them. What is then found in a clip is scored against the clip it came from.
    """
    from noise import GammaField, Sensor
    from noise.sensor import Tone
    from scenarios.irradiate import Exposure, irradiate, recorded_exposure_s, recorded_tone

    check_destination(destination, "noise.json", force=force)
    exposure_s = exposure or recorded_exposure_s(source)
    if exposure_s is None:
        raise click.UsageError("--exposure is needed: there is no input.json that states it")
    field = GammaField(options["dose_rate"], options["energy"], level=options["level"])
    tone: Tone = options["tone"] or recorded_tone(source) or "linear"
    sensor = Sensor(options["pitch_um"], electrons_per_grey=options["electrons_per_grey"], tone=tone)
    new_folder = replacing if force else creating
    n_hits = irradiate(source, destination, (field, sensor), Exposure(exposure_s, options["seed"]), new_folder)
    click.echo(f"{destination}: {n_hits} hits at {options['dose_rate']:g} Gy/h, {exposure_s:.4g} s a frame")


@main.command()
@click.option("-o", "--output", "destination", type=FOLDER, default=Path("demo"), show_default=True)
@click.option("--seed", type=SEED, help="Another scene of the same kind.")
@click.option("--force", is_flag=True, help="Replace an earlier demo.")
@clear_errors
def demo(destination: Path, seed: int | None, *, force: bool) -> None:
    """Simulate three leaks, find them, score them, and write a report to look at."""
    from scenarios.demo import run_demo

    check_destination(destination, "demo.json", force=force)
    click.echo(run_demo(destination, replacing if force else creating, seed))


@main.command()
@scenario_options
@clear_errors
def check(scenario: str, overrides: tuple[str, ...], seed: int | None) -> None:
    """Read a scenario, report every mistake in it, or say what it holds."""
    from scenarios.build import build_scene
    from scenarios.leaks import resolved

    whole = resolved(read_scenario(scenario, overrides, seed))
    build_scene(whole)  # meshes are read, too
    click.echo(_summary(whole, scenario))


@main.command()
@click.argument("name", type=click.Choice(SCHEMAS))
def schema(name: str) -> None:
    """Print the JSON Schema of a file."""
    from scenarios.schemas import schema as schema_of

    click.echo(json.dumps(schema_of(name), indent=1))


def _summary(scenario: Scenario, source: str) -> str:
    rig, recording = scenario.rig, scenario.recording
    rows = [
        f"{source}: ok",
        f"  rig        {rig.width_px} x {rig.height_px} px, {rig.hfov_deg:g} deg, baseline {rig.baseline_m:g} m",
        f"  recording  {recording.n_frames} frames at {recording.fps:g} / s, exposure {recording.exposure_s:.4g} s",
        f"  gamma      {scenario.gamma.dose_rate_gy_h:g} Gy/h",
        f"  lamps      {len(scenario.lamp)}",
        f"  leaks      {len(scenario.leak)} (seed {scenario.seed})",
    ]
    for leak in scenario.leak:
        drops = f"{len(leak.drop_times_s or ())} drops of radius {1e3 * leak.drop_radius_m:g} mm"
        rows.append(f"             {leak.x_m:6.3f} {leak.y_m:7.3f} m, {drops}")
    return "\n".join(rows)


main.add_command(bench)
main.add_command(campaign)
main.add_command(envelope)
main.add_command(explain)
main.add_command(export)
main.add_command(hunt)
main.add_command(inspect)
main.add_command(locate)
main.add_command(reproduce)
main.add_command(shrink)
