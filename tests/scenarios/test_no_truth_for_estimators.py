"""An estimator that goes looking for the truth finds none."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from scenarios.clip_folder import write_clip, write_estimators_clip
from scenarios.output_folder import creating
from scenarios.scenario_file import read_scenario
from scenarios.simulate import simulate

SMALL = ["rig.width_px=160", "rig.height_px=90", "recording.n_frames=4"]


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    simulated = simulate(read_scenario("separated", SMALL))
    folder = tmp_path_factory.mktemp("truth") / "clip"
    write_clip(simulated, folder, creating)
    return simulated, folder


def reachable_files(folder):
    """Everything that a cheat can open from the folder it is given: down, beside it, and through links."""
    for start in (folder, folder.parent):
        for here, folders, names in os.walk(start, followlinks=True):
            folders[:] = [
                name for name in folders if start != folder.parent or here != str(start) or name == folder.name
            ]
            yield from (os.path.join(here, name) for name in names)


def says_where(path, truth):
    """Whether a file holds a leak's coordinate, as text or as a binary number."""
    content = Path(path).read_bytes()
    coordinates = [value for leak in truth.leaks for value in (leak.x_m, leak.y_m)]
    return any(repr(value).encode() in content or np.float64(value).tobytes() in content for value in coordinates)


def test_the_cheat_finds_the_truth_in_the_whole_folder(clip):
    simulated, folder = clip
    assert any(says_where(path, simulated.truth) for path in reachable_files(folder))


def test_the_cheat_finds_nothing_in_what_a_foreign_estimator_gets(clip, tmp_path):
    simulated, folder = clip
    copy = tmp_path / "given" / "clip"
    copy.parent.mkdir()
    write_estimators_clip(simulated, copy)
    paths = list(reachable_files(copy))
    assert len(paths) >= 2 * 4 + 2
    assert {os.path.basename(path) for path in paths if not path.endswith(".png")} == {"rig.yaml", "input.json"}
    assert not any(says_where(path, simulated.truth) for path in paths)
    assert str(folder) not in json.dumps([os.path.realpath(path) for path in paths])


def test_the_believed_rig_does_not_betray_the_misalignment():
    tilted = simulate(
        read_scenario("separated", [*SMALL, "rig.roll_deg=1.5", "rig.yaw_deg=2.0", "rig.right_yaw_deg=0.1"])
    )
    level = simulate(read_scenario("separated", SMALL))
    assert np.array_equal(tilted.believed_rig.world_from_left, level.believed_rig.world_from_left)
    assert np.array_equal(tilted.believed_rig.R, np.eye(3))
    assert tilted.truth.rig.left.world_from_camera != level.truth.rig.left.world_from_camera
