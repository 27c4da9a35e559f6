"""Export a clip folder for other tools: videos, COCO annotations, truth as a table; each read back and compared."""

import hashlib
import json
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from leakloc import read_clip
from scenarios.clip_folder import MANIFEST, verify_clip
from scenarios.export_coco import coco_annotations
from scenarios.export_csv import read_truth_csv, truth_csv
from scenarios.export_video import write_video
from scenarios.output_folder import OutputError, made_by, write_file, write_json
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
        sums = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(folder.iterdir())}
        source = hashlib.sha256((clip / MANIFEST).read_bytes()).hexdigest()
        write_json(folder / MARKER, {"made_by": made_by(), "clip_sha256": source, "files": sums})
    return list(sums)


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
