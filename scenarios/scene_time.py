"""About how long a scene takes: by it lanes order scenes, and hunts weigh what a scene may show.

A model and not a clock, for what a hunt does must follow from its seed alone.
"""

import math

import numpy as np

from scenarios.scenario import Scenario
from scenarios.space import Space, scenario_at
from scenarios.space_point import n_leaks

SCENE_S, LEAK_S, PIXEL_S = 0.05, 0.1, 2e-7
"""Fitted to rendering and `robust`, 60 scenes each of 320 by 180 and of 480 by 270 pixels; times scatter by 0.13 s."""


def scene_s(scenario: Scenario) -> float:
    """Return about how long a scene takes, s."""
    n = len(scenario.leak) if scenario.layout is None else scenario.layout.n_leaks
    return SCENE_S + LEAK_S * n + PIXEL_S * math.prod(_clip(scenario).values())


class SceneTimes:
    """About how long the scenes of a space take."""

    def __init__(self, space: Space) -> None:
        """Look up what of it the space's axes set."""
        plain = scenario_at(space, {}, 0)
        if space.max_leaks:
            plain = plain.model_copy(update={"leak": (), "layout": None})
        self._space, self._plain_s = space, scene_s(plain)
        clip = _clip(plain)
        self._axes = [(i, axis, clip[axis.key]) for i, axis in enumerate(space.axes) if axis.key in clip]
        self._pixels_s = PIXEL_S * math.prod(clip.values())

    def seconds(self, points: np.ndarray) -> np.ndarray:
        """Return about how long the scene at each of some points (n, shares) takes, s, (n,)."""
        times = np.ones(len(points))
        for i, axis, plain in self._axes:
            step = np.floor(points[:, i] * axis.n_values) / max(axis.n_values - 1, 1)
            times *= (axis.low + (axis.high - axis.low) * step) / plain
        seconds = self._plain_s + self._pixels_s * (times - 1.0)
        if self._space.max_leaks:
            seconds += LEAK_S * n_leaks(self._space, points)
        return seconds


def _clip(scenario: Scenario) -> dict[str, int]:
    """Return what the number of a clip's pixels is the product of, by key."""
    rig, n_frames = scenario.rig, scenario.recording.n_frames
    return {"rig.width_px": rig.width_px, "rig.height_px": rig.height_px, "recording.n_frames": n_frames}
