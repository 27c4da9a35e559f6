"""A clip: the cached static layer of both cameras, and for every frame what the falling drops change.

What moves is linear in time and in drops: frame = exposure * static + sum over drops of streak and shadows. The two
views are rendered by two threads.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np

from simcam.camera import Camera
from simcam.fall import fall_time
from simcam.lens import FloatArray
from simcam.path import landing_m
from simcam.recording import Recording
from simcam.rig import StereoRig
from simcam.scene import Leak, Scene
from simcam.shadows import ShadowTable, expose_shadow, shadow_tables
from simcam.static import light_scene, static_view
from simcam.streaks import StreakTable, expose_drop, streak_table


@dataclass(frozen=True, eq=False)
class StereoClip:
    """Expected photo-electrons, float32 (frames, height, width), of the left and the right camera."""

    left: FloatArray
    right: FloatArray


def render_clip(scene: Scene, rig: StereoRig, recording: Recording) -> StereoClip:
    """Linear expected photo-electrons of both cameras; no noise, no saturation, no quantisation."""
    light_scene(scene)  # once, before two threads ask for it
    with ThreadPoolExecutor(2) as pool:
        left, right = pool.map(lambda camera: render_view(scene, camera, recording), (rig.left, rig.right))
    return StereoClip(left, right)


def render_view(scene: Scene, camera: Camera, recording: Recording) -> FloatArray:
    """Linear expected photo-electrons of one camera, float32 (frames, height, width)."""
    lit, view = light_scene(scene), static_view(scene, camera)
    moving = [
        _Moving(
            leak,
            float(fall_time(landing_m(lit, leak))),
            streak_table(lit, view, camera, leak),
            shadow_tables(lit, view, leak) if scene.drop_shadows else [],
        )
        for leak in scene.leaks
    ]
    still = _blurred(view.radiance, recording.psf_sigma_px) * np.float32(recording.responsivity * recording.exposure_s)
    frames = np.repeat(still[None], recording.n_frames, axis=0)
    delays_s = recording.row_delays_s(camera.height_px)
    for frame in range(recording.n_frames):
        change = _change(moving, still.size, recording.opens_s(frame) + delays_s, recording.closes_s(frame) + delays_s)
        change *= np.float32(recording.responsivity)
        frames[frame] += _blurred(change.reshape(still.shape), recording.psf_sigma_px)
    return np.maximum(frames, 0, out=frames)


@dataclass(frozen=True)
class _Moving:
    """A leak's tables in a view; the longest time that a drop of it can matter."""

    leak: Leak
    fall_s: float
    streak: StreakTable | None
    shadows: list[ShadowTable]


def _change(moving: list[_Moving], size: int, opens_s: FloatArray, closes_s: FloatArray) -> FloatArray:
    """What the drops add to a flat image (size,), radiance times seconds, in exposures (height,) per row."""
    change = np.zeros(size, np.float32)
    first_s, last_s = opens_s.min(), closes_s.max()
    for leak in moving:
        released = leak.leak.drop_times_s
        for released_s in released[(released < last_s) & (released + leak.fall_s > first_s)]:
            opens, closes = opens_s - released_s, closes_s - released_s
            landed = np.minimum(closes, leak.fall_s)
            if leak.streak is not None:
                expose_drop(change, leak.streak, np.maximum(opens, 0), np.maximum(landed, 0))
            for table in leak.shadows:
                expose_shadow(change, table, opens, landed)
    return change


def _blurred(image: FloatArray, sigma_px: float) -> FloatArray:
    if sigma_px == 0:
        return image
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px, borderType=cv2.BORDER_REPLICATE))
