"""A failure shrinks to the plainest scene that still fails, and is told as a command that replays it."""

import os
import re
import shlex
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import find, given, settings
from hypothesis import strategies as st

from scenarios.build import believed_rig
from scenarios.leaks import resolved
from scenarios.replay import overrides, replay_command
from scenarios.scenario_file import read_scenario
from scenarios.score import score
from scenarios.simulate import simulate
from scenarios.space import FULL, scenarios

SMALL = replace(FULL, width_px=96, height_px=54, max_leaks=4)


def blind_below_20_cm(scenario):
    """Places that an estimator gives which is broken for baselines under 0.2 m, and otherwise perfect."""
    if np.abs(believed_rig(scenario).T[0]) < 0.2 - 1e-9:
        return []
    return [(leak.x_m, leak.y_m) for leak in scenario.leak]


def misses_a_leak(scenario):
    """Of the estimator above it is known without rendering."""
    return len(blind_below_20_cm(scenario)) < len(scenario.leak)


def misses_a_leak_of_a_rendered_clip(scenario):
    clip = simulate(scenario)
    scored = score(blind_below_20_cm(scenario), clip.truth)
    return scored.gated.all.found < scored.gated.all.of


@pytest.mark.parametrize(
    "fails", [misses_a_leak, pytest.param(misses_a_leak_of_a_rendered_clip, marks=pytest.mark.deep)]
)
def test_an_estimator_blind_below_20_cm_is_shown_with_one_leak_no_noise_and_a_baseline_of_15_cm(fails):
    minimal = find(scenarios(SMALL), fails, settings=settings(max_examples=200, database=None))
    assert len(minimal.leak) == 1
    assert (minimal.leak[0].x_m, minimal.leak[0].y_m) == (1.0, 0.0)
    assert minimal.gamma.dose_rate_gy_h == 0.0
    assert (minimal.rig.roll_deg, minimal.rig.pitch_deg, minimal.rig.yaw_deg) == (0.0, 0.0, 0.0)
    assert (minimal.rig.baseline_m, minimal.rig.hfov_deg, minimal.recording.n_frames) == (0.15, 70.0, 24)
    command = replay_command(minimal, "--method robust")
    assert command == (
        "leakloc explain plain --set rig.baseline_m=0.15 --set rig.width_px=96 --set rig.height_px=54 --method robust"
    )
    again = read_scenario("plain", [w for w in shlex.split(command) if "=" in w])
    assert misses_a_leak_of_a_rendered_clip(again)


@pytest.mark.deep
def test_a_suite_fails_on_a_broken_estimator_and_prints_the_plainest_scene_as_a_command_that_replays_it():
    here = Path(__file__).parent / "scenarios"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(here), str(here.parents[1])])}
    words = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", str(here / "suite_of_a_broken_estimator.py")]
    suite = subprocess.run(words, env=environment, capture_output=True, text=True, check=False)
    assert suite.returncode == 1, suite.stdout
    command = re.search(r"replay: (leakloc explain plain .* --estimator \S+)$", suite.stdout, re.MULTILINE).group(1)
    print(command)  # noqa: T201
    # one leak where the plain scene has it, no radiation, level, and 15 cm: nothing else is told
    assert command == (
        "leakloc explain plain --set rig.baseline_m=0.15 --set rig.width_px=480 --set rig.height_px=270 "
        "--estimator foreign_estimators:blind_below_20_cm"
    )
    replayed = [sys.executable, "-m", "scenarios", *shlex.split(command)[1:]]
    again = subprocess.run(replayed, env=environment, capture_output=True, text=True, check=False)
    print(again.stdout)  # noqa: T201
    assert re.search(r"^\(as it is\) +missed\.unexplained", again.stdout, re.MULTILINE), again.stdout + again.stderr
    assert "leak 0 is found without: none of these alone" in again.stdout


@settings(max_examples=50)
@given(scenarios(FULL), st.integers(0, 2**40))
def test_the_told_overrides_make_the_same_scenario_again(scenario, seed):
    scenario = scenario.model_copy(update={"seed": seed})
    again = read_scenario("plain", overrides(scenario), seed)
    unnamed = {"name": "", "description": ""}
    assert again.model_copy(update=unnamed) == scenario.model_copy(update=unnamed)
    assert resolved(again).leak == resolved(scenario).leak
