"""Random draws of the harness, keyed by purpose and place: leak 2 drips the same whether or not leak 1 exists."""

from enum import IntEnum

import numpy as np


class Stream(IntEnum):
    """What a draw is for. Numbers are part of the format: the same seed must give the same scene in later versions."""

    LAYOUT = 1
    DRIPS = 2
    CLIP_SEED = 3
    HUNT = 4
    ENVELOPE = 5


def rng_for(seed: int, stream: Stream, *place: int) -> np.random.Generator:
    """Return the generator of one purpose at one place (leak number, clip number, ...)."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(0x5CE, stream, *place))))


def seed_of_clip(seed: int, clip: int) -> int:
    """Return the seed of one clip of a data set."""
    return int(rng_for(seed, Stream.CLIP_SEED, clip).integers(2**63))
