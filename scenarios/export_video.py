"""A clip as a pair of videos, FFV1 in AVI: exact for grey of 8 bit, and proved so by reading every frame back."""

from pathlib import Path

import cv2
import numpy as np

from leakloc.video_file import video_frames
from scenarios.output_folder import OutputError

FFV1 = cv2.VideoWriter.fourcc(*"FFV1")


def write_video(frames: np.ndarray, fps: float, path: Path) -> None:
    """Write grey frames (frames, height, width) uint8 as a new video and compare what is there with what was meant.

    Raises OutputError where a single pixel differs: OpenCV reports success on a full disk, too.
    """
    height_px, width_px = frames.shape[1:]
    video = cv2.VideoWriter(str(path.absolute()), cv2.CAP_FFMPEG, FFV1, fps, (width_px, height_px), isColor=False)
    if not video.isOpened():
        raise OutputError(f"{path}: cannot be written: this OpenCV has no FFV1, or the folder is not writable")
    for frame in frames:
        video.write(np.ascontiguousarray(frame))
    video.release()
    check_video(frames, path)


def check_video(frames: np.ndarray, path: Path) -> None:
    """Read a video back and compare it frame by frame; raises OutputError naming the first that differs."""
    try:
        back, _ = video_frames(path, len(frames) + 1, 2 * frames.nbytes + 1)
    except ValueError as error:
        raise OutputError(f"{path}: does not read back: {error}") from None
    if back.shape != frames.shape or back.dtype != frames.dtype:
        raise OutputError(f"{path}: reads back as {back.dtype} {back.shape}, not {frames.dtype} {frames.shape}")
    for number, (one, other) in enumerate(zip(frames, back, strict=True)):
        if not np.array_equal(one, other):
            raise OutputError(f"{path}: frame {number} reads back differently; is the disk full?")
