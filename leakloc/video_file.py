"""The grey frames of one video, decoded by OpenCV's FFmpeg behind a fence.

FFmpeg follows addresses, lists of other files ("concat", playlists) and waits for pipes; it opens by content, whatever
the name ends in. So only regular files are opened, by absolute path, with its protocols and containers listed.
A damaged frame is mostly decoded into something else without an error: use PNG where every pixel counts.
"""

from __future__ import annotations

import math
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Lock
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from leakloc.image_file import grey_of
from leakloc.rig import MAX_SIDE_PX

MAX_VIDEO_BYTES = 16 << 30
CONTAINERS = "avi,matroska,webm,mov,mp4,m4a,3gp,3g2,mj2,mpegts,mpeg,mpegvideo,yuv4mpegpipe,mxf,asf,flv,ogg,dv,wmv"
ENVIRONMENT = {
    "OPENCV_FFMPEG_CAPTURE_OPTIONS": f"protocol_whitelist;file|format_whitelist;{CONTAINERS}",
    "OPENCV_FFMPEG_LOGLEVEL": "-8",  # AV_LOG_QUIET; FFmpeg looks at it once, at the first video of a process
}
GREY_FORMATS = {int.from_bytes(code, "little") for code in (b"Y800", b"GREY", b"Y1\x00\x10")}  # 8 bit, 8 bit, 16 bit

_environment_lock = Lock()


def video_frames(path: Path, max_frames: int, max_bytes: int) -> tuple[NDArray[Any], float]:
    """All frames of a video, (frames, height, width) uint8 (uint16 if grey of 16 bit), and its frames/s or NaN.

    Colours are turned to grey by the weights of ITU-R BT.601. Raises ValueError with what is wrong, without the file's
    name: not a regular file, no video, fewer frames than its container announces, frames over the limits.
    """
    with _open(path) as video:
        size = tuple(int(video.get(side)) for side in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
        if not all(0 < side <= MAX_SIDE_PX for side in size):
            raise ValueError(f"video must be 1 to {MAX_SIDE_PX} px wide and high, got {size}")
        frames: list[NDArray[Any]] = []
        for frame in _decoded(video):
            if (len(frames) + 1) * frame.nbytes > max_bytes or len(frames) == max_frames:
                raise ValueError(f"video must have at most {max_frames} frames and {max_bytes} bytes decoded")
            frames.append(frame)
        _check_announced(len(frames), video.get(cv2.CAP_PROP_FRAME_COUNT))
        fps = video.get(cv2.CAP_PROP_FPS)
    return np.stack(frames), fps if math.isfinite(fps) and fps > 0 else math.nan


def video_size(path: Path) -> tuple[int, int]:
    """(width, height) in px of a video as its container says. Raises ValueError as `video_frames` does."""
    with _open(path) as video:
        return int(video.get(cv2.CAP_PROP_FRAME_WIDTH)), int(video.get(cv2.CAP_PROP_FRAME_HEIGHT))


@contextmanager
def _open(path: Path) -> Iterator[cv2.VideoCapture]:
    try:
        real = path.resolve(strict=True)
        status = real.stat()
    except (OSError, RuntimeError) as error:  # RuntimeError: links in a circle, before Python 3.13
        raise ValueError(f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if not stat.S_ISREG(status.st_mode):
        raise ValueError("must be a regular file")
    if status.st_size > MAX_VIDEO_BYTES:
        raise ValueError(f"must be at most {MAX_VIDEO_BYTES} bytes")
    with _environment():
        video = cv2.VideoCapture(str(real), cv2.CAP_FFMPEG)
    try:
        if not video.isOpened():
            raise ValueError("not a video that can be decoded, or truncated")
        video.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)  # a calibration is of the pixels as the sensor has them
        if int(video.get(cv2.CAP_PROP_CODEC_PIXEL_FORMAT)) in GREY_FORMATS:
            video.set(cv2.CAP_PROP_CONVERT_RGB, 0)  # would lose the lower 8 of 16 bits
        yield video
    finally:
        video.release()


def _decoded(video: cv2.VideoCapture) -> Iterator[NDArray[Any]]:
    first = None
    while True:
        try:
            decoded, image = video.read()
        except cv2.error:
            decoded = False
        if not decoded:
            return
        frame = grey_of(image)
        first = frame if first is None else first
        if frame.shape != first.shape or frame.dtype != first.dtype:
            raise ValueError("its frames must all have one size and depth")
        yield frame


def _check_announced(decoded: int, announced: float) -> None:
    if decoded == 0:
        raise ValueError("truncated or damaged video: no frame can be decoded")
    if math.isfinite(announced) and decoded < announced:
        raise ValueError(f"truncated or damaged video: announces {announced:.0f} frames, {decoded} can be decoded")


@contextmanager
def _environment() -> Iterator[None]:
    """OpenCV takes FFmpeg's options from the environment and from nowhere else."""
    with _environment_lock:
        before = {key: os.environ.get(key) for key in ENVIRONMENT}
        os.environ.update(ENVIRONMENT)
        try:
            yield
        finally:
            for key, value in before.items():
                if value is None:
                    del os.environ[key]
                else:
                    os.environ[key] = value
