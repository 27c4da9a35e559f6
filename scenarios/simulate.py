"""Simulate a scenario in memory: render, add radiation and sensor, state the truth."""

from dataclasses import dataclass

import numpy as np

import simcam
from leakloc import Rig
from noise import add_noise
from scenarios.build import believed_rig, build_recording, build_scene, gamma_field, image_sensor, true_rig
from scenarios.leaks import resolved
from scenarios.observable import state_truth
from scenarios.scenario import Scenario
from scenarios.truth import Truth

CAMERAS = ("left", "right")


@dataclass(frozen=True)
class SimulatedClip:
    """A clip with everything that is known of it; frames are (frames, height, width), as the sensor gives them."""

    scenario: Scenario
    """Resolved: leaks placed, drop times listed."""
    left: np.ndarray
    right: np.ndarray
    believed_rig: Rig
    truth: Truth


def simulate(scenario: Scenario, *, threads: int | None = None) -> SimulatedClip:
    """Simulate a scenario; the same scenario gives the same bytes, on any number of threads (None: one per core)."""
    whole = resolved(scenario)
    scene, rig, recording = build_scene(whole), true_rig(whole), build_recording(whole)
    clean = simcam.render_clip(scene, rig, recording, workers=threads)
    field, sensor = gamma_field(whole), image_sensor(whole)
    noisy = [
        add_noise(
            frames,
            field,
            sensor,
            exposure_s=whole.recording.exposure_s,
            seed=whole.seed,
            camera=camera,
            workers=threads,
        ).frames
        for camera, frames in zip(CAMERAS, (clean.left, clean.right), strict=True)
    ]
    truth = state_truth(whole, clean, simcam.ground_truth(scene, rig, recording))
    return SimulatedClip(whole, noisy[0], noisy[1], believed_rig(whole), truth)
