"""`leakloc export`: a clip for other tools."""

from __future__ import annotations

from pathlib import Path

import click

from scenarios.cli_options import FOLDER, clear_errors
from scenarios.output_folder import check_apart, check_destination, creating, replacing


@click.command()
@click.argument("clip", type=FOLDER)
@click.option("-o", "--output", "destination", type=FOLDER, required=True, help="Folder to make.")
@click.option("--video", is_flag=True, help="left.avi and right.avi, FFV1: exact.")
@click.option("--coco", is_flag=True, help="annotations.json: drops and shadows, COCO instances.")
@click.option("--csv", is_flag=True, help="truth.csv: a row per leak.")
@click.option("--force", is_flag=True, help="Replace an earlier export.")
@clear_errors
def export(clip: Path, destination: Path, *, force: bool, **chosen: bool) -> None:
    """Write a clip as videos, COCO annotations or a table of its truth; everything is read back and compared."""
    from scenarios.export import export_clip

    kinds = [kind for kind, wanted in chosen.items() if wanted]
    if not kinds:
        raise click.UsageError("at least one of --video, --coco and --csv must say what to write")
    check_apart(clip, destination)
    check_destination(destination, "export.json", force=force)
    names = export_clip(clip, kinds, destination, replacing if force else creating)
    click.echo(f"{destination}: {', '.join(names)}")
