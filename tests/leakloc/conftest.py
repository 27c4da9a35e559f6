"""The paper's rig from its numbers, drawn drops, and the straightforward version that defines the results."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from leakloc import Rig

sys.path.insert(0, str(Path(__file__).parent))  # robust_table, which a benchmark shares

WORLD_FROM_LEFT = [[0, 0, 1, -2.4], [-1, 0, 0, 0.25], [0, -1, 0, 0], [0, 0, 0, 1]]


def _rig(width_px=960, height_px=540, **changes):
    f = (width_px / 2) / np.tan(np.radians(70) / 2)
    K = np.array([[f, 0, (width_px - 1) / 2], [0, f, (height_px - 1) / 2], [0, 0, 1]])
    values = {
        "K1": K,
        "D1": np.zeros(5),
        "K2": K,
        "D2": np.zeros(5),
        "R": np.eye(3),
        "T": [-0.5, 0, 0],
        "image_size": (width_px, height_px),
        "world_from_left": WORLD_FROM_LEFT,
    }
    return Rig(**(values | changes))


def _dripping(columns_px, n=6, height_px=40, width_px=120):
    """Grey 20 everywhere; leak k drips a bright drop of k + 1 rows height down its column, one place a frame."""
    frames = np.full((n, height_px, width_px), 20, np.uint8)
    for leak, column in enumerate(columns_px):
        for frame in range(n):
            top = frame * (height_px // n)
            frames[frame, top : top + leak + 2, column] = 120
    return frames


@pytest.fixture(scope="session")
def straightforward():
    path = Path(__file__).with_name("straightforward.py")
    spec = importlib.util.spec_from_file_location("leakloc_straightforward", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def make_rig():
    """make_rig(width_px, height_px, **fields): the paper's rig, at another size or with other fields."""
    return _rig


@pytest.fixture(scope="session")
def make_dripping():
    """make_dripping(columns_px, n): a view with one drop falling down each column."""
    return _dripping
