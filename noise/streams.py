"""Keyed random streams: every draw belongs to a purpose, a camera and a frame, not to an order of execution."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

CAMERAS: dict[int | str, int] = {0: 0, 1: 1, "left": 0, "right": 1}

CLIP = -1
"""In place of a frame number: the draw belongs to the whole clip (hot pixels, for one)."""


class Stream(IntEnum):
    """Purposes of random draws; the numbers are part of what a seed means, so they are never re-used."""

    HIT_NUMBER = 1
    HIT_PLACE = 2
    HIT_TRACK = 3
    BORDER = 4
    SHOT = 5
    SHOT_DIM = 6
    DARK = 7
    READ = 8
    HOT_PIXEL = 9
    ROW = 10
    COLUMN = 11
    DUPLICATE = 12
    BANK = 13
    EXPECTATION = 14


def camera_key(camera: int | str) -> int:
    """Number of a camera: 0 or "left", 1 or "right", any other non-negative integer for itself.

    ValueError for anything else.
    """
    if camera in CAMERAS:
        return CAMERAS[camera]
    if isinstance(camera, str) or int(camera) != camera or camera < 0:
        raise ValueError(f"rng_for: camera must be 'left', 'right' or an integer >= 0, got {camera!r}")
    return int(camera)


def rng_for(seed: int, stream: Stream, camera: int | str = 0, frame: int = CLIP) -> np.random.Generator:
    """Generator of one purpose, camera and frame: independent of all others, the same in any order of calls.

    The seed is the entropy of a `SeedSequence`, the rest its spawn key (numpy reference, "Parallel random number
    generation"); SFC64 is the fastest of numpy's generators for 32-bit normals.
    """
    if seed < 0:
        raise ValueError(f"rng_for: seed must be >= 0, got {seed}")
    key = np.random.SeedSequence(int(seed), spawn_key=(int(stream), camera_key(camera), frame - CLIP))
    return np.random.Generator(np.random.SFC64(key))
