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
            streak_table(lit, view, camera, leak, recording.psf_sigma_px),
            shadow_tables(lit, view, leak) if scene.drop_shadows else [],
        )
        for leak in scene.leaks
    ]
    still = _blurred(view.radiance, recording.psf_sigma_px) * np.float32(recording.responsivity * recording.exposure_s)
    frames = np.repeat(still[None], recording.n_frames, axis=0)
    delays_s = recording.row_delays_s(camera.height_px)
    for frame in range(recording.n_frames):
        opens_s, closes_s = recording.opens_s(frame) + delays_s, recording.closes_s(frame) + delays_s
        change = _change(moving, still.shape, (opens_s, closes_s), recording.psf_sigma_px)
        change *= np.float32(recording.responsivity)
        frames[frame] += change
    return np.maximum(frames, 0, out=frames)


@dataclass(frozen=True)
class _Moving:
    """A leak's tables in a view; the longest time that a drop of it can matter."""

    leak: Leak
    fall_s: float
    streak: StreakTable | None
    shadows: list[ShadowTable]


def _change(
    moving: list[_Moving], shape: tuple[int, ...], exposure: tuple[FloatArray, FloatArray], psf_sigma_px: float
) -> FloatArray:
    """What the drops add to an image (height, width), radiance times seconds, in exposures (height,) per row."""
    opens_s, closes_s = exposure
    drops = np.zeros(shape, np.float32)
    shadows = np.zeros(shape, np.float32) if psf_sigma_px > 0 else drops
    _expose(moving, (drops.reshape(-1), shadows.reshape(-1)), opens_s, closes_s)
    if psf_sigma_px == 0:
        return drops
    across, down = (1, 0), (0, 1)  # the drops have their point-spread along the rows already
    shadows = _blurred_along(shadows, psf_sigma_px, across)
    shadows += drops
    return _blurred_along(shadows, psf_sigma_px, down)


def _expose(
    moving: list[_Moving], images: tuple[FloatArray, FloatArray], opens_s: FloatArray, closes_s: FloatArray
) -> None:
    """Add drops and shadows, each to its flat image (height * width,), in place."""
    drops, shadows = images
    first_s, last_s = opens_s.min(), closes_s.max()
    for leak in moving:
        released = leak.leak.drop_times_s
        for released_s in released[(released < last_s) & (released + leak.fall_s > first_s)]:
            opens, closes = opens_s - released_s, closes_s - released_s
            landed = np.minimum(closes, leak.fall_s)
            if leak.streak is not None:
                expose_drop(drops, leak.streak, np.maximum(opens, 0), np.maximum(landed, 0))
            for table in leak.shadows:
                expose_shadow(shadows, table, opens, landed)


def _blurred_along(image: FloatArray, sigma_px: float, direction: tuple[int, int]) -> FloatArray:
    """Gaussian blur along the rows (1, 0) or down the columns (0, 1)."""
    spread = cv2.getGaussianKernel(2 * int(np.ceil(4 * sigma_px)) + 1, sigma_px, cv2.CV_32F)
    still = np.ones((1, 1), np.float32)
    kernels = [spread if along else still for along in direction]
    return np.asarray(cv2.sepFilter2D(image, -1, kernels[0], kernels[1], borderType=cv2.BORDER_REPLICATE))


def _blurred(image: FloatArray, sigma_px: float) -> FloatArray:
    if sigma_px == 0:
        return image
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px, borderType=cv2.BORDER_REPLICATE))
