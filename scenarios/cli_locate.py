"""`leakloc locate`: one clip, two videos or folders with a calibration, or several views of a panned rig."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from scenarios.cli_options import FILE, FiniteRange, clear_errors
from scenarios.clip_folder import has_manifest, verify_input
from scenarios.condition import condition_table
from scenarios.export import verify_exported
from scenarios.output_folder import OutputError, check_target, write_file
from scenarios.score import nulled

if TYPE_CHECKING:
    from leakloc import Clip, Estimate, Rig

METHODS = ("robust", "paper")
PATHS = "CLIP | LEFT RIGHT | VIEW..."


class ManyValues(click.Command):
    """A command whose --pan takes all numbers that follow it: --pan -40 0 40."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Join the numbers after --pan into one value before click sees them."""
        if "--pan" in args:
            start = args.index("--pan") + 1
            end = start
            while end < len(args) and _is_number(args[end]):
                end += 1
            args = [*args[: start - 1], f"--pan={' '.join(args[start:end])}", *args[end:]]
        return super().parse_args(ctx, args)


@click.command(cls=ManyValues)
@click.argument(
    "paths", metavar="CLIP | LEFT RIGHT | VIEW...", nargs=-1, required=True, type=click.Path(path_type=Path)
)
@click.option("--method", type=click.Choice(METHODS), default="robust", show_default=True)
@click.option("--rig", "rigs", multiple=True, type=FILE, help="Calibration of LEFT RIGHT (OpenCV, Kalibr; ROS: twice).")
@click.option("--pan", "pans", metavar="DEG...", help="Pan angle of each VIEW, + left: --pan -40 0 40.")
@click.option("-o", "--output", "destination", type=FILE, help="Write result.json here.")
@click.option("--figure", type=FILE, help="Write a page with pictures here.")
@click.option("--expected-false-leaks", type=FiniteRange(0.0, 1.0, min_open=True), help="robust: a clip [0.05].")
@click.option("--k-sigma", type=FiniteRange(min=0.0), help="paper: threshold, mean + k standard deviations [2].")
@click.option("--g-win", type=click.IntRange(0, 4096), help="paper: non-maximum suppression, columns each way [10].")
@click.option("--subtractor", type=click.Choice(["median", "mean", "mog2"]), help="paper: background [median].")
@clear_errors
def locate(paths: tuple[Path, ...], **options: Any) -> None:
    """Find the leaks of a clip; the truth, if the folder holds it, is not looked at.

    One path is a clip folder. LEFT and RIGHT are two videos or folders of images, with --rig. Several clip folders are
    views of a rig that turned in between, by --pan or by the world_from_left of each, fused into one map.
    """
    for target in (options["destination"], options["figure"]):
        if target is not None:
            check_target(target)
    if options["figure"] is not None and len(paths) > 1 and not options["rigs"]:
        raise click.UsageError("--figure shows one view")
    views = _views(paths, options)
    estimates = [_located(view, options) for view in views]
    estimate = estimates[0] if len(views) == 1 else _fused(estimates)
    if options["figure"] is not None:
        from scenarios.report import estimate_html

        write_file(options["figure"], estimate_html(paths[0].name, views[0], estimate))
    if options["destination"] is not None:
        _write_result(estimate, options["destination"])
    _echo(estimate)


@click.command()
@click.argument("paths", metavar="CLIP | LEFT RIGHT", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--rig", "rigs", multiple=True, type=FILE, help="Calibration of LEFT RIGHT.")
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")
@clear_errors
def inspect(paths: tuple[Path, ...], rigs: tuple[Path, ...], *, as_json: bool) -> None:
    """Say what ails a clip: cameras, frames, step between the views, tilt of the rig, and every line that was seen."""
    import leakloc

    views = _views(paths, {"rigs": rigs, "pans": None})
    if len(views) != 1:
        raise click.UsageError("one clip, or LEFT and RIGHT with --rig, can be inspected at a time")
    found = leakloc.locate(views[0].left, views[0].right, views[0].rig, method="robust")
    click.echo(json.dumps(nulled(dict(found.diagnostics)), indent=1) if as_json else condition_table(found.diagnostics))


def _views(paths: tuple[Path, ...], options: dict[str, Any]) -> list[Clip]:
    import leakloc

    if options["rigs"]:
        if len(paths) != 2 or options["pans"] is not None:
            raise click.UsageError("--rig goes with two paths, LEFT and RIGHT, and without --pan")
        for path in paths:
            verify_exported(path)
        size = leakloc.footage_size(paths[0])
        rig = leakloc.read_calibration(
            options["rigs"] if len(options["rigs"]) > 1 else options["rigs"][0], image_size=size
        )
        return [leakloc.read_footage(paths[0], paths[1], rig)]
    for path in paths:
        if path.is_dir() and has_manifest(path):
            verify_input(path)
    clips = [leakloc.read_clip(path) for path in paths]
    if len({clip.rig.frame for clip in clips}) > 1:
        raise click.UsageError("of several views all must state world_from_left, or none")
    if options["pans"] is not None:
        return _turned(clips, options["pans"])
    if len(clips) > 1 and all(_stand_alike(clips[0].rig, other.rig) for other in clips[1:]):
        raise click.UsageError("the rigs of all views stand alike: --pan must say how they turned (0 for not at all)")
    return clips


def _stand_alike(one: Rig, other: Rig) -> bool:
    return bool(np.array_equal(one.frame_from_left, other.frame_from_left))


def _turned(clips: list[Clip], pans: str) -> list[Clip]:
    """Turn the believed rig of each view by its pan angle."""
    from dataclasses import replace

    import leakloc

    words = pans.split()
    if not all(_is_number(word) for word in words):
        raise click.UsageError(f"--pan must be angles in degrees, got {pans!r}")
    angles = [float(word) for word in words]
    if len(angles) != len(clips):
        raise click.UsageError(f"--pan needs an angle for each of the {len(clips)} views, got {len(angles)}")
    return [replace(clip, rig=leakloc.panned(clip.rig, angle)) for clip, angle in zip(clips, angles, strict=True)]


def _located(view: Clip, options: dict[str, Any]) -> Estimate:
    import leakloc

    given = {"k_sigma": options["k_sigma"], "g_win_px": options["g_win"], "subtractor": options["subtractor"]}
    papers = {name: value for name, value in given.items() if value is not None}
    expected = options["expected_false_leaks"]
    if options["method"] == "paper":
        if expected is not None:
            raise click.UsageError("--expected-false-leaks belongs to --method robust")
        straight = leakloc.rectify(view.left, view.right, view.rig)  # the paper's columns must be plumb
        chosen = leakloc.PaperOptions(**papers)
        found = leakloc.locate(straight.left, straight.right, straight.rig, method="paper", options=chosen)
        return straight.estimate_of_raw(found)
    if papers:
        raise click.UsageError("--k-sigma, --g-win and --subtractor belong to --method paper")
    robusts = {} if expected is None else {"expected_false_leaks": expected}
    return leakloc.locate(view.left, view.right, view.rig, method=options["method"], **robusts)


def _fused(estimates: list[Estimate]) -> Estimate:
    import leakloc

    return leakloc.fuse_views(estimates)


def _write_result(estimate: Estimate, destination: Path) -> None:
    import leakloc

    try:
        leakloc.write_result(estimate, destination)
    except OSError as error:
        raise OutputError(f"{destination}: cannot be written: {error.strerror}") from None


def _echo(estimate: Estimate) -> None:
    click.echo(f"{len(estimate.leaks)} leaks found by {estimate.method} (x, y in m, {estimate.frame} frame)")
    for leak in estimate.leaks:
        click.echo(
            f"  {leak.x_m:8.3f} {leak.y_m:8.3f}   columns {leak.left_column_px:7.2f} {leak.right_column_px:7.2f}"
        )


def _is_number(word: str) -> bool:
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False
