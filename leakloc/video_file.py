"""The grey frames of one video, decoded by OpenCV's FFmpeg behind a fence.

FFmpeg follows addresses, lists of other files ("concat", playlists) and waits for pipes; it opens by content, whatever
the name ends in. So only regular files are opened, by absolute path, with its protocols and containers listed, in a
process of its own. It decodes most damaged frames into something else and complains in its log alone: a video that it
complains of is refused. Formats without checksums (Motion JPEG, MPEG-4) may still hide damage that FFV1 would tell.
"""

from __future__ import annotations

import json
import math
import os
import re
import stat
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Thread
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from leakloc import video_decoder
from leakloc.image_file import grey_of
from leakloc.rig import MAX_SIDE_PX

MAX_VIDEO_BYTES = 16 << 30
CONTAINERS = "avi,matroska,webm,mov,mp4,m4a,3gp,3g2,mj2,mpegts,mpeg,mpegvideo,yuv4mpegpipe,mxf,asf,flv,ogg,dv,wmv"
ENVIRONMENT = {
    "OPENCV_FFMPEG_CAPTURE_OPTIONS": f"protocol_whitelist;file|format_whitelist;{CONTAINERS}",
    "OPENCV_FFMPEG_LOGLEVEL": "16",  # AV_LOG_ERROR
    "OPENCV_LOG_LEVEL": "OFF",
}
COMPLAINT = re.compile(rb"\[OPENCV:FFMPEG:\d+\]\s*([^\r\n\[]*)")
LAST_FRAME_STEPS = 1.5  # mean steps from the last frame within which a whole video ends: one more is missed at 2
MAX_LOG_BYTES, MAX_COMPLAINT = 4096, 80

Size = tuple[int, int]


def video_frames(
    path: Path, max_frames: int, max_bytes: int, check_size: Callable[[Size], None] = lambda _: None
) -> tuple[NDArray[Any], float]:
    """All frames of a video, (frames, height, width) uint8 (uint16 if grey of 16 bit), and its frames/s or NaN.

    Colours are turned to grey by the weights of ITU-R BT.601. `check_size` may refuse the (width, height) in px that
    the container announces before anything is decoded. Raises ValueError with what is wrong, without the file's name:
    not a regular file, no video, fewer frames than its container announces, frames over the limits, damage.
    """
    with _decoding(path, max_frames + 1) as video:
        if not all(0 < side <= MAX_SIDE_PX for side in video.size_px):
            raise ValueError(f"video must be 1 to {MAX_SIDE_PX} px wide and high, got {video.size_px}")
        check_size(video.size_px)
        if video.grey_bits not in (None, 16):
            raise ValueError(
                f"grey of {video.grey_bits} bits would be decoded to 8: give it as grey of 16 bits, or as PNG images"
            )
        frames: list[NDArray[Any]] = []
        for frame in _grey(video):
            if (len(frames) + 1) * frame.nbytes > max_bytes or len(frames) == max_frames:
                raise ValueError(f"video must have at most {max_frames} frames and {max_bytes} bytes decoded")
            frames.append(frame)
        even = _check_announced(len(frames), video)
        video.check_undamaged()
    return np.stack(frames), video.fps if even and math.isfinite(video.fps) and video.fps > 0 else math.nan


def video_size(path: Path) -> Size:
    """(width, height) in px of a video as its container says. Raises ValueError as `video_frames` does."""
    with _decoding(path, 0) as video:
        return video.size_px


class _Log:
    """The start of what a process writes to a pipe; the rest is read and forgotten, lest the process waits."""

    def __init__(self, pipe: IO[bytes]) -> None:
        self._start = b""
        self._reader = Thread(target=self._read, args=(pipe,), daemon=True)
        self._reader.start()

    def _read(self, pipe: IO[bytes]) -> None:
        while part := os.read(pipe.fileno(), MAX_LOG_BYTES):
            self._start += part[: MAX_LOG_BYTES - len(self._start)]

    def whole(self) -> bytes:
        """Return it once the process has ended."""
        self._reader.join()
        return self._start


@dataclass
class _Video:
    """A video that is being decoded: what its container announces, its decoder, and what that complains of.

    `grey_bits` of grey with more than 8 bits, else None; `last_ms` is the time of the last frame decoded.
    """

    size_px: Size
    n_frames: float
    fps: float
    grey_bits: int | None
    decoder: subprocess.Popen[bytes]
    log: _Log
    last_ms: float = math.nan

    def frames(self) -> Iterator[NDArray[Any]]:
        """Yield frames (height, width[, channels]) as they are decoded."""
        assert self.decoder.stdout is not None
        while head := self.decoder.stdout.readline():
            told = json.loads(head)
            frame = np.empty(told["shape"], dtype=told["dtype"])
            if self.decoder.stdout.readinto(frame.reshape(-1).view(np.uint8)) < frame.nbytes:  # type: ignore[attr-defined]
                break
            self.last_ms = told["at_ms"]
            yield frame
        if self.decoder.wait() != 0:
            raise ValueError("damaged video: its decoder broke down")

    def check_undamaged(self) -> None:
        """Raise ValueError with the first thing that FFmpeg complained of."""
        if complaints := COMPLAINT.findall(self.log.whole()):
            first = complaints[0].decode("ascii", "replace").strip()[:MAX_COMPLAINT]
            raise ValueError(
                f"damaged video, FFmpeg says: {''.join(filter(str.isprintable, first))!r}; if its frames will do as "
                "they are decoded, give them as PNG images"
            )


@contextmanager
def _decoding(path: Path, n_frames: int) -> Iterator[_Video]:
    real = _regular_file(path)
    command = [sys.executable, video_decoder.__file__, str(real), str(n_frames)]
    environment = {**os.environ, **ENVIRONMENT}
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, env=environment) as decoder:
        assert decoder.stdout is not None
        assert decoder.stderr is not None
        log = _Log(decoder.stderr)
        try:
            head = decoder.stdout.readline()
            if not head:
                raise ValueError(_why_nothing(decoder.wait(), log.whole()))
            told = json.loads(head)
            yield _Video(tuple(told["size"]), told["n_frames"], told["fps"], told["grey_bits"], decoder, log)
        finally:
            decoder.kill()
            log.whole()  # its reader ends before the pipe is closed


def _regular_file(path: Path) -> Path:
    try:
        real = path.resolve(strict=True)
        status = real.stat()
    except (OSError, RuntimeError) as error:  # RuntimeError: links in a circle, before Python 3.13
        raise ValueError(f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if not stat.S_ISREG(status.st_mode):
        raise ValueError("must be a regular file")
    if status.st_size > MAX_VIDEO_BYTES:
        raise ValueError(f"must be at most {MAX_VIDEO_BYTES} bytes")
    return real


def _why_nothing(code: int, log: bytes) -> str:
    if code == video_decoder.NO_VIDEO or code < 0:
        return "not a video that can be decoded, or truncated"
    lines = log.decode("utf-8", "replace").strip().splitlines()
    return f"the video decoder does not start: {lines[-1] if lines else code}"


def _grey(video: _Video) -> Iterator[NDArray[Any]]:
    first = None
    for image in video.frames():
        frame = grey_of(image)
        first = frame if first is None else first
        if frame.shape != first.shape or frame.dtype != first.dtype:
            raise ValueError("its frames must all have one size and depth")
        yield frame


def _check_announced(decoded: int, video: _Video) -> bool:
    """Refuse a video that ends early; returns whether its frames are as many as its rate and duration make them.

    Some containers announce a duration alone, and a recorder may drop frames or change its pace: a video that is whole
    has a last frame that lasts to its end.
    """
    if decoded == 0:
        raise ValueError("truncated or damaged video: no frame can be decoded")
    if not math.isfinite(video.n_frames) or decoded >= video.n_frames:
        return True
    step_ms = video.last_ms / (decoded - 1) if decoded > 1 else 0.0
    if video.fps > 0 and video.last_ms + LAST_FRAME_STEPS * step_ms >= 1000.0 * video.n_frames / video.fps:
        return False
    raise ValueError(
        f"truncated or damaged video: announces {video.n_frames:.0f} frames, {decoded} can be decoded; if these will "
        "do, give them as PNG images"
    )
