"""Real footage: two videos or two folders of images, one per camera, as a clip."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

from leakloc.background import Frames
from leakloc.clip import DECODERS, MAX_CLIP_BYTES, MAX_FPS, MAX_FRAMES, Clip, ClipError
from leakloc.image_file import SUFFIXES, read_grey_image, read_image_size
from leakloc.methods import MIN_FRAMES
from leakloc.rig import Rig
from leakloc.video_file import video_frames, video_size

MAX_VIEW_BYTES = MAX_CLIP_BYTES // 2
MAX_NAMES = 100_000  # in a folder
SAME_FPS = 1e-3  # relative; containers round
UNKNOWN_TONE = "unknown"

PathLike = str | os.PathLike[str]


@dataclass(frozen=True, eq=False)
class View:
    """Frames (n, height, width) of one camera, uint8 or uint16 grey, and its frames/s (NaN where nothing says)."""

    frames: Frames
    fps: float


def read_footage(left: PathLike, right: PathLike, rig: Rig) -> Clip:
    """Read two videos, two folders of images or one of each; grey or colour (turned to grey), 8 or 16 bit.

    Images are PNG, JPEG, TIFF, BMP or PGM of one kind, in the order of the numbers in their names; other files in the
    folder are ignored. `fps` is what the videos state, NaN where none does; `exposure_s` is NaN and `tone` "unknown".
    Videos of more than 8 bit keep them only if grey. Raises ClipError naming file or frame and rule: not a regular
    file, unreadable, truncated, frames of several sizes or depths, a size that is not the rig's, unequal lengths,
    depths or frame rates, a gap in numbered frames, fewer than 3 frames, limits (2000 frames, 4 GiB decoded).
    """
    left, right = Path(left), Path(right)
    if _are_one(left, right):
        raise ClipError(f"{right}: left and right must be two cameras, got the same file or folder twice")
    with _quiet_opencv():
        views = [_read_view(path, rig) for path in (left, right)]
    frames = [view.frames for view in views]
    if len(frames[0]) != len(frames[1]):
        raise ClipError(
            f"{left} and {right}: must have the same number of frames, got {len(frames[0])} and {len(frames[1])}"
        )
    if frames[0].dtype != frames[1].dtype:
        raise ClipError(f"{left} and {right}: must have one bit depth, got {frames[0].dtype} and {frames[1].dtype}")
    return Clip(frames[0], frames[1], rig, _common_fps(left, right, views), math.nan, UNKNOWN_TONE)


def footage_size(path: PathLike) -> tuple[int, int]:
    """(width, height) in px of a video or of a folder's first image, for calibrations that give none.

    Raises ClipError as `read_footage` does.
    """
    path = Path(path)
    with _quiet_opencv():
        if path.is_dir():
            path = image_paths(path)[0]
            size_of = read_image_size
        else:
            size_of = video_size
        try:
            return size_of(path)
        except ValueError as error:
            raise ClipError(f"{path}: {error}") from None


def image_paths(folder: Path) -> list[Path]:
    """The images of a folder in the order of the numbers in their names ("2.png" before "10.png").

    Names that count (most steps of their last number are one) must count without a gap. Raises ClipError naming the
    file and the rule.
    """
    try:
        names = os.listdir(folder)
    except OSError as error:
        raise ClipError(f"{folder}: cannot be read: {error.strerror}") from None
    if len(names) > MAX_NAMES:
        raise ClipError(f"{folder}: must hold at most {MAX_NAMES} files, got {len(names)}")
    images = sorted((name for name in names if _is_image(name)), key=_numeric_order)
    if not images:
        raise ClipError(f"{folder}: holds no image ({', '.join(SUFFIXES)})")
    for name in images:
        if Path(name).suffix.lower() != Path(images[0]).suffix.lower():
            raise ClipError(f"{folder / name}: images of a folder must be of one kind, as {images[0]}")
    for before, name in pairwise(images):
        if _numeric_order(before)[0] == _numeric_order(name)[0]:
            raise ClipError(f"{folder / name}: has the same number as {before}")
    _check_count(folder, images)
    return [folder / name for name in images]


def _are_one(left: Path, right: Path) -> bool:
    try:
        return left.samefile(right)
    except OSError:
        return False  # reading will say what is wrong with it


def _is_image(name: str) -> bool:
    return not name.startswith(".") and Path(name).suffix.lower() in SUFFIXES


def _numeric_order(name: str) -> tuple[list[tuple[str, int]], str]:
    """Texts and numbers of a name in turn, then the name itself: its numbers decide whatever their zeros in front."""
    stem = Path(name).stem
    if clock := re.fullmatch(r"(\D*)(\d{1,100})\.(\d{1,100})", stem):  # seconds: of .5 and .25 the second is earlier
        return [(clock[1], int(clock[2])), (".", int(clock[3].ljust(100, "0")))], name
    parts = re.findall(r"(\D*)(\d*)", stem)
    return [(text, int(digits or -1) if len(digits) <= 100 else 0) for text, digits in parts], name


def _check_count(folder: Path, images: list[str]) -> None:
    numbers = [re.findall(r"\d+", Path(name).stem)[-1:] for name in images]
    if any(numbers) and not all(numbers):
        odd = next(name for name, found in zip(images, numbers, strict=True) if not found)
        raise ClipError(f"{folder / odd}: must have a number in its name, as the other images of its folder have")
    if len(images) < MIN_FRAMES or not all(numbers) or max(len(found[0]) for found in numbers) > 18:
        return  # 18 digits hold any count, and any clock
    steps = np.diff([int(found[0]) for found in numbers])
    if np.mean(steps == 1) <= 0.5:
        return  # clock times, or every tenth frame
    gaps = np.flatnonzero(steps != 1)
    if len(gaps):
        raise ClipError(
            f"{folder / images[gaps[0] + 1]}: frames must be numbered without a gap, it follows {images[gaps[0]]}"
        )


def _read_view(path: Path, rig: Rig) -> View:
    if path.is_dir():
        return View(_read_images(image_paths(path), rig), math.nan)
    try:
        # before a long video is decoded in vain
        frames, fps = video_frames(path, MAX_FRAMES, MAX_VIEW_BYTES, lambda size: _check_size(size, rig))
        _check_size((frames.shape[2], frames.shape[1]), rig)
        _check_length(len(frames))
        return View(frames, fps if fps <= MAX_FPS else math.nan)
    except ValueError as error:
        raise ClipError(f"{path}: {error}") from None


def _read_images(paths: list[Path], rig: Rig) -> Frames:
    """All images in one array; the first bad one in order is the one named."""
    try:
        _check_length(len(paths))
    except ValueError as error:
        raise ClipError(f"{paths[0].parent}: {error}") from None
    first = _read_image(paths[0], rig)
    needed_bytes = len(paths) * first.nbytes
    if needed_bytes > MAX_VIEW_BYTES:
        raise ClipError(f"{paths[0].parent}: must be at most {MAX_VIEW_BYTES} bytes decoded, got {needed_bytes}")
    frames = np.empty((len(paths), *first.shape), first.dtype)

    def decode(index: int) -> None:
        image = _read_image(paths[index], rig) if index else first
        if image.dtype != first.dtype:
            raise ClipError(f"{paths[index]}: must have the bit depth of {paths[0].name}, {first.dtype}")
        frames[index] = image

    with ThreadPoolExecutor(DECODERS) as pool:
        list(pool.map(decode, range(len(paths))))
    return frames


def _read_image(path: Path, rig: Rig) -> Frames:
    try:
        return read_grey_image(path, rig.image_size)
    except ValueError as error:
        raise ClipError(f"{path}: {error}") from None


def _check_size(size_px: tuple[int, int], rig: Rig) -> None:
    if size_px != rig.image_size:
        raise ValueError(f"must have the rig's image_size {rig.image_size}, got {size_px}")


def _check_length(n_frames: int) -> None:
    if not MIN_FRAMES <= n_frames <= MAX_FRAMES:
        raise ValueError(f"must have {MIN_FRAMES} to {MAX_FRAMES} frames, got {n_frames}")


def _common_fps(left: Path, right: Path, views: list[View]) -> float:
    stated = [view.fps for view in views if not math.isnan(view.fps)]
    if len(stated) == 2 and abs(stated[0] - stated[1]) > SAME_FPS * stated[0]:
        raise ClipError(f"{left} and {right}: must have one frame rate, got {stated[0]:g} and {stated[1]:g} per second")
    return stated[0] if stated else math.nan


@contextmanager
def _quiet_opencv() -> Iterator[None]:
    """Without OpenCV's own remarks on the terminal: what is wrong is said once, in the error."""
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(level)
