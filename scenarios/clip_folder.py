"""Clip folders on disk: written whole and read back, checked against their manifest, copied without the truth."""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from leakloc import write_rig
from leakloc.outside_file import read_json
from scenarios.output_folder import OutputError, made_by, write_file, write_json
from scenarios.scenario_toml import scenario_toml
from scenarios.truth import truth_json

if TYPE_CHECKING:
    from scenarios.simulate import SimulatedClip

MANIFEST = "clip.json"
ESTIMATORS_FILES = ("rig.yaml", "input.json")
ESTIMATORS_FOLDERS = ("left", "right")
TRUTH_FILES = ("truth.json", "scenario.toml")
MAX_MANIFEST_BYTES = 1_000_000
"""Of 2000 frames some 400 000."""

MAX_LISTED_BYTES = 64 << 20
"""Of one file of a clip."""

PNG_FAST = (cv2.IMWRITE_PNG_COMPRESSION, 1)
"""Noise does not compress: higher levels cost time and save 2 %."""


class DamagedClipError(ValueError):
    """A clip folder that is not what was written; the message names the frame or file."""


def write_clip(
    clip: SimulatedClip, destination: Path, new_folder: Callable[[Path], AbstractContextManager[Path]]
) -> None:
    """Write a clip folder: staged, read back and compared, then renamed into place.

    `new_folder` is `output_folder.creating` or `output_folder.replacing`.
    """
    with new_folder(destination) as folder:
        sums = _write_input(clip, folder)
        (folder / "truth.json").write_text(truth_json(clip.truth), encoding="utf-8")
        (folder / "scenario.toml").write_text(scenario_toml(clip.scenario), encoding="utf-8")
        for name in (*ESTIMATORS_FILES, *TRUTH_FILES):
            sums[name] = sha256_of(folder / name)
        write_json(folder / MANIFEST, _manifest(clip, sums))
        verify_clip(folder)


def write_estimators_clip(clip: SimulatedClip, folder: Path) -> None:
    """Write what an estimator may see of a clip, and nothing else, into a new folder."""
    folder.mkdir()
    _write_input(clip, folder)


def verify_clip(folder: Path) -> None:
    """Check every file of a clip against the manifest's SHA-256; raises DamagedClipError naming the first bad one."""
    _verify(folder, read_manifest(folder)["files"])


def verify_input(folder: Path) -> None:
    """Like `verify_clip`, but only what an estimator may see; the truth may be missing, changed or anything."""
    sums = read_manifest(folder)["files"]
    shown = {name: value for name, value in sums.items() if "/" in name or name in ESTIMATORS_FILES}
    _verify(folder, shown)


def _verify(folder: Path, sums: dict[str, str]) -> None:
    with ThreadPoolExecutor(2) as threads:
        for name, broken in zip(sums, threads.map(lambda item: _damage(folder, *item), sums.items()), strict=True):
            if broken:
                raise DamagedClipError(f"{folder / name}: damaged: {broken}")
    for side in ESTIMATORS_FOLDERS:
        if not (folder / side).is_dir():
            raise DamagedClipError(f"{folder / side}: damaged: missing")
        extra = sorted({f"{side}/{path.name}" for path in (folder / side).iterdir()} - set(sums))
        if extra:
            raise DamagedClipError(f"{folder / extra[0]}: does not belong to the clip: it is not in {MANIFEST}")


def has_manifest(folder: Path) -> bool:
    """Whether a folder is a simulated clip with its manifest (an estimator's copy and real footage have none)."""
    return (folder / MANIFEST).is_file()


def _write_input(clip: SimulatedClip, folder: Path) -> dict[str, str]:
    """Write images, believed rig and recording; returns the SHA-256 of the images."""
    sums = _write_frames(clip.left, folder / "left") | _write_frames(clip.right, folder / "right")
    write_rig(clip.believed_rig, folder / "rig.yaml")
    recording = clip.scenario.recording
    write_json(
        folder / "input.json",
        {
            "fps": recording.fps,
            "exposure_s": recording.exposure_s,
            "n_frames": recording.n_frames,
            "tone": clip.scenario.sensor.tone,
        },
    )
    return sums


def _write_frames(frames: np.ndarray, folder: Path) -> dict[str, str]:
    """Write PNG frames by two threads, read each back, and return their SHA-256 by name inside the clip."""
    folder.mkdir()

    def write(number: int) -> tuple[str, str]:
        path = folder / f"{number:04d}.png"
        write_file(path, encode_png(frames[number]))
        back = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        if back is None or not np.array_equal(back, frames[number]):
            raise OutputError(f"{path}: reads back differently from what was written; is the disk full?")
        return f"{folder.name}/{path.name}", sha256_of(path)

    with ThreadPoolExecutor(2) as threads:
        return dict(threads.map(write, range(len(frames))))


def encode_png(frame: np.ndarray) -> bytes:
    """Return a grey image (height, width) as the bytes of a PNG."""
    made, png = cv2.imencode(".png", frame, PNG_FAST)
    if not made:
        raise ValueError(f"encode_png: cannot encode an array of {frame.dtype} and shape {frame.shape}")
    return png.tobytes()


def _manifest(clip: SimulatedClip, sums: dict[str, str]) -> dict[str, Any]:
    packages = ("leakloc", "numpy", "scipy", "opencv-python-headless", "trimesh", "embreex")
    return {
        "made_by": made_by(),
        "name": clip.scenario.name,
        "seed": clip.scenario.seed,
        "scenario_sha256": sums["scenario.toml"],
        "versions": {"python": platform.python_version(), **{name: version(name) for name in packages}},
        "files": sums,
    }


def read_manifest(folder: Path) -> dict[str, Any]:
    """Content of clip.json; raises DamagedClipError where it is not what `write_clip` writes."""
    path = folder / MANIFEST
    try:
        manifest = read_json(path, MAX_MANIFEST_BYTES)
    except ValueError as error:
        raise DamagedClipError(f"{path}: {error}") from None
    files = manifest.get("files") if isinstance(manifest, dict) else None
    if not isinstance(files, dict) or not all(isinstance(value, str) for value in files.values()):
        raise DamagedClipError(f"{path}: files must be a table of SHA-256 by file name")
    views = {name.partition("/")[0] for name in files if "/" in name}
    missing = sorted({*ESTIMATORS_FILES, *TRUTH_FILES} - set(files)) or sorted(set(ESTIMATORS_FOLDERS) - views)
    if missing:
        raise DamagedClipError(f"{path}: files must list {missing[0]}")
    for name in files:
        parts = Path(name).parts
        if Path(name).is_absolute() or ".." in parts or len(parts) > 2:
            raise DamagedClipError(f"{path}: files: {name!r} must be a name inside the clip")
    return manifest


def _damage(folder: Path, name: str, expected: str) -> str | None:
    path = folder / name
    if os.path.islink(path) or not os.path.isfile(path):  # for any name, be it too long for the file system
        return "missing"
    if path.stat().st_size > MAX_LISTED_BYTES:
        return f"must be at most {MAX_LISTED_BYTES} bytes"
    return None if sha256_of(path) == expected else f"its SHA-256 differs from {MANIFEST}"


def sha256_of(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal digits."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
