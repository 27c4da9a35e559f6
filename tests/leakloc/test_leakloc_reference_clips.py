"""The robust method on path-traced clips of 10 ms exposures, clean and at 10 Gy/h: an independent renderer's drops."""

import json
from pathlib import Path

import numpy as np
import pytest

from leakloc import Rig, locate
from noise import GammaField, Sensor, add_noise

REFERENCE = Path(__file__).parent.parent / "reference"
VIEWS = ("left", "right")
FOCAL_PX = 480 / np.tan(np.radians(35))
K = np.array([[FOCAL_PX, 0, 479.5], [0, FOCAL_PX, 269.5], [0, 0, 1]])
POSE = [[0, 0, 1, -2.4], [-1, 0, 0, 0.25], [0, -1, 0, 0], [0, 0, 0, 1]]


def clip(name):
    with np.load(REFERENCE / f"{name}.npz", allow_pickle=False) as deltas:
        frames = {view: np.cumsum(deltas[f"{view}_delta"], axis=0, dtype=np.uint8) for view in VIEWS}
    return frames, json.loads((REFERENCE / f"{name}.json").read_text())


def irradiated(frames, seed):
    field, sensor = GammaField(10.0, 661.7), Sensor(tone="srgb")
    return {
        view: add_noise(grey, field, sensor, exposure_s=0.01, seed=seed, camera=view).frames
        for view, grey in frames.items()
    }


def rig_of(scene, lamp_off_m=(0, 0, 0), radius_factor=1.0):
    lamps = np.array([[*np.add(one["position_m"], lamp_off_m), one["radius_m"]] for one in scene["lamps"]])
    none = np.zeros(5)
    return Rig(
        K, none, K, none, np.eye(3), [-0.5, 0, 0], (960, 540), POSE, lamps=lamps, pedestal_radius=2.5 * radius_factor
    )


def errors_and_false(frames, scene, rig):
    places = np.array([(leak.x_m, leak.y_m) for leak in locate(frames["left"], frames["right"], rig).leaks])
    truth = np.array([(leak["x_m"], leak["y_m"]) for leak in scene["leaks"]])
    apart = np.linalg.norm(truth[:, None] - places.reshape(-1, 2), axis=2)
    return apart.min(axis=1, initial=np.inf), int((apart.min(axis=0) > 0.3).sum())


@pytest.mark.parametrize("name", ["separated", "crowded"])
def test_clean_every_leak_is_found_within_two_centimetres(name):
    frames, scene = clip(name)
    errors_m, false = errors_and_false(frames, scene, rig_of(scene))
    assert errors_m.max() < 0.02
    assert false == 0


@pytest.mark.parametrize(("name", "seed"), [("separated", 1), ("separated", 4), ("crowded", 1)])
def test_at_h_every_leak_is_found_within_three_centimetres_by_its_drops_or_beside_its_shadow(name, seed):
    frames, scene = clip(name)
    errors_m, false = errors_and_false(irradiated(frames, seed), scene, rig_of(scene))
    assert errors_m.max() < 0.03  # also 0.22 m from the wall, where hits drown the drop and its shadow outshouts it
    assert false == 0  # under the seed 4 a shadow of a leak in mid-air stands off the wall


def test_a_lamp_and_wall_that_are_slightly_wrong_cost_nothing():
    frames, scene = clip("separated")
    errors_m, false = errors_and_false(frames, scene, rig_of(scene, (0.0, 0.1, -0.1), 0.98))
    assert errors_m.max() < 0.03
    assert false == 0
