"""Decodes one video in a process of its own: frames to standard output, what FFmpeg complains of to standard error.

Its complaints are the only sign of most damage, and OpenCV prints them to the standard output of the whole process; a
hostile file may also take its decoder down. `video_file.py` runs this file: python video_decoder.py PATH N_FRAMES
"""

import sys
from typing import Any, BinaryIO

NO_VIDEO = 3
"""Exit code: nothing that can be decoded."""


def main() -> int:
    """Write a line of JSON about the video, then one about each frame followed by its bytes, at most N_FRAMES."""
    del sys.path[0]  # this folder: its modules are no libraries
    import os

    import cv2

    frames = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    video = cv2.VideoCapture(sys.argv[1], cv2.CAP_FFMPEG)
    if not video.isOpened():
        return NO_VIDEO
    video.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)  # a calibration is of the pixels as the sensor has them
    grey = {int.from_bytes(code, "little") for code in (b"Y800", b"GREY", b"Y1\x00\x10")}  # 8 bit, 8 bit, 16 bit
    pixels = int(video.get(cv2.CAP_PROP_CODEC_PIXEL_FORMAT)).to_bytes(4, "little", signed=True)
    if int.from_bytes(pixels, "little") in grey:
        video.set(cv2.CAP_PROP_CONVERT_RGB, 0)  # would lose the lower 8 of 16 bits
    _tell(
        frames,
        size=[int(video.get(side)) for side in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)],
        n_frames=video.get(cv2.CAP_PROP_FRAME_COUNT),
        fps=video.get(cv2.CAP_PROP_FPS),
        grey_bits=pixels[3] if pixels[:3] == b"Y1\x00" else None,
    )
    for _ in range(int(sys.argv[2])):
        try:
            decoded, image = video.read()
        except cv2.error:
            break
        if not decoded:
            break
        _tell(frames, shape=image.shape, dtype=image.dtype.str, at_ms=video.get(cv2.CAP_PROP_POS_MSEC))
        frames.write(image.tobytes())
    frames.close()
    return 0


def _tell(out: BinaryIO, **words: Any) -> None:
    import json

    out.write(json.dumps(words).encode() + b"\n")
    out.flush()


if __name__ == "__main__":
    sys.exit(main())
