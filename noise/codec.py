"""What happens to frames after the sensor: JPEG and repeated frames."""

from __future__ import annotations

import cv2

from noise.arrays import Frames
from noise.exposure import Key
from noise.streams import Stream


def through_jpeg(frame: Frames, quality: int) -> Frames:
    """A frame after baseline JPEG at a quality of 1 to 100, as in an MJPEG stream."""
    done, packed = cv2.imencode(".jpg", frame, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise ValueError(f"through_jpeg: the codec refused a frame of {frame.shape} and {frame.dtype}")
    shown = cv2.imdecode(packed, cv2.IMREAD_GRAYSCALE)
    if shown is None:
        raise ValueError("through_jpeg: the codec could not read what it wrote")
    return shown


def shown_frame(key: Key, duplicate_share: float) -> int:
    """Number of the frame that a stalled camera shows: itself, or the last one before it that was not a repeat."""
    frame = key.frame
    while frame > 0 and Key(key.seed, key.camera, frame).rng(Stream.DUPLICATE).random() < duplicate_share:
        frame -= 1
    return frame
