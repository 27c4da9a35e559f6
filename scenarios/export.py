"""Export a clip folder for other tools: videos, COCO annotations, truth as a table; each read back and compared."""

import json
import os
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from leakloc import read_clip
from leakloc.outside_file import read_json
from scenarios.clip_folder import MANIFEST, DamagedClipError, sha256_of, verify_clip
from scenarios.export_coco import coco_annotations
from scenarios.export_csv import read_truth_csv, truth_csv
from scenarios.export_video import write_video
from scenarios.output_folder import MAX_MARKER_BYTES, OutputError, made_by, write_file, write_json
from scenarios.scenario_file import read_scenario
from scenarios.truth import read_truth

MARKER = "export.json"


def export_clip(
    clip: Path, kinds: Sequence[str], destination: Path, new_folder: Callable[[Path], AbstractContextManager[Path]]
) -> list[str]:
    """Write the kinds ("video", "coco", "csv") of a clip into a folder that appears whole; returns its file names.

    `new_folder` is `output_folder.creating` or `output_folder.replacing`. Raises DamagedClipError before anything is
    written when a file of the clip, its truth and scenario included, is not what its manifest says.
    """
    verify_clip(clip)
    with new_folder(destination) as folder:
        for kind in kinds:
            WRITERS[kind](clip, folder)
        sums = {path.name: sha256_of(path) for path in sorted(folder.iterdir())}
        source = sha256_of(clip / MANIFEST)
        write_json(folder / MARKER, {"made_by": made_by(), "clip_sha256": source, "files": sums})
    return list(sums)


def verify_exported(video: Path) -> None:
    """Check a video against the SHA-256 that its export states, if it stands in one; raises DamagedClipError.

    A decoder makes frames of a damaged video, too: mostly others, without a word.
    """
    marker = video.parent / MARKER
    if not os.path.lexists(marker) or not os.path.isfile(video):
        return
    try:
        content = read_json(marker, MAX_MARKER_BYTES)
    except ValueError as error:
        raise DamagedClipError(f"{marker}: {error}") from None
    if not isinstance(content, dict) or not str(content.get("made_by", "")).startswith("leakloc "):
        return  # another program's
    files = content.get("files")
    if not isinstance(files, dict):
        raise DamagedClipError(f"{marker}: files must be a table of SHA-256 by file name")
    if files.get(video.name, "") not in ("", sha256_of(video)):
        raise DamagedClipError(f"{video}: damaged: its SHA-256 differs from {MARKER}")


def _write_videos(clip: Path, folder: Path) -> None:
    footage = read_clip(clip)
    for side in ("left", "right"):
        write_video(getattr(footage, side), footage.fps, folder / f"{side}.avi")


def _write_coco(clip: Path, folder: Path) -> None:
    annotations = coco_annotations(read_scenario(clip / "scenario.toml"))
    path = folder / "annotations.json"
    write_file(path, json.dumps(annotations, allow_nan=False) + "\n")
    if json.loads(path.read_text(encoding="utf-8")) != annotations:
        raise OutputError(f"{path}: reads back differently; is the disk full?")


def _write_csv(clip: Path, folder: Path) -> None:
    truth, path = read_truth(clip / "truth.json"), folder / "truth.csv"
    write_file(path, truth_csv(truth))
    if tuple(read_truth_csv(path.read_text(encoding="utf-8"))) != truth.leaks:
        raise OutputError(f"{path}: reads back differently; is the disk full?")


WRITERS: dict[str, Callable[[Path, Path], None]] = {"video": _write_videos, "coco": _write_coco, "csv": _write_csv}
