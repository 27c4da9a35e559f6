"""A clip folder as an estimator gets it: left/, right/, rig.yaml and input.json."""

from __future__ import annotations

import os
import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from leakloc.background import Frames
from leakloc.methods import MIN_FRAMES
from leakloc.outside_file import read_json
from leakloc.png import check_png
from leakloc.rig import Rig, RigError
from leakloc.rig_file import read_rig

MAX_FRAMES = 2000
MAX_CLIP_BYTES = 4 << 30  # of both views, decoded
MAX_PNG_BYTES = 64 << 20
MAX_INPUT_BYTES = 1 << 20
MAX_FPS = 1e6
TONES = ("linear", "srgb")
DTYPES = {8: np.uint8, 16: np.uint16}
DECODERS = 2  # threads; OpenCV lets go of the interpreter while it decodes


class ClipError(ValueError):
    """A clip that cannot be used: names the file or frame and the rule."""


@dataclass(frozen=True, eq=False)
class Clip:
    """Raw stereo frames and what was said of their taking.

    `left`, `right` (frames, height, width) uint8 or uint16 grey; `rig` is the believed one; frame n was exposed for
    `exposure_s` around n / `fps`; `tone` is "linear" or "srgb".
    """

    left: Frames
    right: Frames
    rig: Rig
    fps: float
    exposure_s: float
    tone: str


def read_clip(folder: str | os.PathLike[str]) -> Clip:
    """Read a clip folder; nothing outside it is opened, whatever its links say, and other files in it are ignored.

    Frames are grey PNG of 8 or 16 bit, numbered 0000.png, 0001.png, ... without a gap. Raises ClipError naming the
    file and the rule: missing or surplus frames, damaged PNG, colour, a size that is not the rig's, fewer than 3
    frames, bad rig.yaml or input.json, limits (2000 frames, 4 GiB decoded).
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise ClipError(f"{folder}: is not a clip folder")
    recording = _read_recording(_inside(folder, folder / "input.json", MAX_INPUT_BYTES))
    try:
        rig = read_rig(_inside(folder, folder / "rig.yaml", MAX_INPUT_BYTES))
    except RigError as error:
        raise ClipError(str(error)) from None
    paths = [_frame_paths(folder, view, recording["n_frames"]) for view in ("left", "right")]
    frames = _decode(folder, paths[0] + paths[1], rig)
    left, right = frames[: len(paths[0])], frames[len(paths[0]) :]
    return Clip(left, right, rig, recording["fps"], recording["exposure_s"], recording["tone"])


def _inside(folder: Path, path: Path, max_bytes: int) -> Path:
    """The real path of a regular file of bearable size that lies in the folder."""
    try:
        real = path.resolve(strict=True)
        if not real.is_relative_to(folder.resolve()):
            raise ClipError(f"{path}: leads out of the clip folder")
        if not real.is_file():  # a pipe would hang
            raise ClipError(f"{path}: must be a regular file")
        if real.stat().st_size > max_bytes:
            raise ClipError(f"{path}: must be at most {max_bytes} bytes")
    except FileNotFoundError:
        raise ClipError(f"{path}: is missing") from None
    except (OSError, RuntimeError) as error:  # RuntimeError: links in a circle, before Python 3.13
        raise ClipError(f"{path}: cannot be read: {error}") from None
    return real


def _read_recording(path: Path) -> dict[str, Any]:
    try:
        content = read_json(path, MAX_INPUT_BYTES)
    except ValueError as error:
        raise ClipError(f"{path}: {error}") from None
    if not isinstance(content, dict):
        raise ClipError(f"{path}: must be an object with fps, exposure_s, n_frames and tone")
    fps = _positive(path, content, "fps", MAX_FPS)
    exposure_s = _positive(path, content, "exposure_s", 1 / fps * (1 + 1e-6))  # 1/fps was rounded when written
    n_frames = _positive(path, content, "n_frames", MAX_FRAMES)
    if not n_frames.is_integer() or n_frames < MIN_FRAMES:
        raise ClipError(f"{path}: n_frames must be a whole number, at least {MIN_FRAMES}, got {n_frames:g}")
    tone = content.get("tone")
    if not (isinstance(tone, str) and tone.lower() in TONES):
        raise ClipError(f"{path}: tone must be one of {', '.join(TONES)}, got {tone!r:.80}")
    return {"fps": fps, "exposure_s": exposure_s, "n_frames": int(n_frames), "tone": tone.lower()}


def _positive(path: Path, content: dict[str, Any], key: str, largest: float) -> float:
    value = content.get(key)
    if not isinstance(value, int | float) or isinstance(value, bool) or not 0 < value <= largest:
        raise ClipError(f"{path}: {key} must be a number > 0 and <= {largest:g}, got {value!r:.80}")
    return float(value)


def _frame_paths(folder: Path, view: str, n_frames: int) -> list[Path]:
    view_folder = folder / view
    if not view_folder.is_dir() or not view_folder.resolve().is_relative_to(folder.resolve()):
        raise ClipError(f"{view_folder}: must be a folder of frames in the clip folder")
    wanted = [f"{number:04d}.png" for number in range(n_frames)]
    present = {name for name in os.listdir(view_folder) if re.fullmatch(r"\d+\.png", name)}
    missing = [name for name in wanted if name not in present]
    surplus = sorted(present.difference(wanted))
    if missing:
        raise ClipError(f"{view_folder / missing[0]}: frame is missing ({len(missing)} of {n_frames} are)")
    if surplus:
        raise ClipError(f"{view_folder / surplus[0]}: frame is one too many: input.json says n_frames = {n_frames}")
    return [view_folder / name for name in wanted]


def _decode(folder: Path, paths: list[Path], rig: Rig) -> Frames:
    """All frames in one array; the first frame tells 8 from 16 bit. The first bad frame in order is the one named."""
    width_px, height_px = rig.image_size
    first = _read_png(folder, paths[0], rig)
    needed_bytes = len(paths) * first.nbytes
    if needed_bytes > MAX_CLIP_BYTES:
        raise ClipError(f"{folder}: frames must be at most {MAX_CLIP_BYTES} bytes decoded, got {needed_bytes}")
    frames = np.empty((len(paths), height_px, width_px), first.dtype)
    frames[0] = first
    failed: list[int] = []

    def decode(index: int) -> None:
        if failed and index > min(failed):
            return  # an earlier frame will be named
        try:
            image = _read_png(folder, paths[index], rig)
            if image.dtype != first.dtype:
                raise ClipError(f"{paths[index]}: must have the bit depth of {paths[0].name}, {first.dtype}")
        except ClipError:
            failed.append(index)
            raise
        frames[index] = image

    with ThreadPoolExecutor(DECODERS) as pool:
        list(pool.map(decode, range(1, len(paths))))
    return frames


def _read_png(folder: Path, path: Path, rig: Rig) -> Frames:
    real = _inside(folder, path, MAX_PNG_BYTES)
    try:
        content = real.read_bytes()
        header = check_png(content)
    except OSError as error:
        raise ClipError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise ClipError(f"{path}: {error}") from None
    if header.colour != "grey" or header.bits not in DTYPES:
        raise ClipError(f"{path}: must be grey of 8 or 16 bit, got {header.colour} of {header.bits} bit")
    if (header.width_px, header.height_px) != rig.image_size:
        raise ClipError(
            f"{path}: must have the rig's image_size {rig.image_size}, got {(header.width_px, header.height_px)}"
        )
    try:
        image = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        image = None
    if image is None or image.shape != (header.height_px, header.width_px) or image.dtype != DTYPES[header.bits]:
        raise ClipError(f"{path}: damaged PNG: its pixels cannot be decoded")
    return image
