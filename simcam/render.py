"""A clip: the cached static layer of both cameras, and for every frame what the falling drops change.

What moves is linear in time and in drops: frame = exposure * static + sum over drops of streak and shadows. The two
views are rendered by two threads.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np

from simcam.camera import Camera
from simcam.exposure import Exposures, drop_exposures
from simcam.fall import fall_time
from simcam.lens import FloatArray
from simcam.path import landing_m
from simcam.recording import Recording
from simcam.rig import StereoRig
from simcam.scene import Leak, Scene
from simcam.shadows import expose_shadows, shadow_tables
from simcam.static import LitScene, light_scene, static_view
from simcam.streaks import expose_drops, streak_table


@dataclass(frozen=True, eq=False)
class StereoClip:
    """Expected photo-electrons, float32 (frames, height, width), of the left and the right camera."""

    left: FloatArray
    right: FloatArray


def render_clip(scene: Scene, rig: StereoRig, recording: Recording, *, workers: int | None = None) -> StereoClip:
    """Linear expected photo-electrons of both cameras; no noise, no saturation, no quantisation.

    `workers`: threads (None: one a view). One is the cheapest where other processes use the other cores.
    """
    light_scene(scene)  # once, before two threads ask for it
    with ThreadPoolExecutor(workers or 2) as pool:
        each = map if workers == 1 else pool.map
        left, right = each(lambda camera: render_view(scene, camera, recording), (rig.left, rig.right))
    return StereoClip(left, right)


def render_view(scene: Scene, camera: Camera, recording: Recording) -> FloatArray:
    """Linear expected photo-electrons of one camera, float32 (frames, height, width)."""
    lit, view = light_scene(scene), static_view(scene, camera)
    still = _blurred(view.radiance, recording.psf_sigma_px) * np.float32(recording.responsivity * recording.exposure_s)
    frames = np.zeros((recording.n_frames, *still.shape), np.float32)
    falls = [_exposed(lit, leak, recording, still.shape) for leak in scene.leaks]
    across, down = (1, 0), (0, 1)
    for leak, exposures in zip(scene.leaks if scene.drop_shadows else (), falls, strict=False):
        for shadows in shadow_tables(lit, view, leak):
            expose_shadows(frames.reshape(-1), shadows, exposures)
    _blur_along(frames, recording.psf_sigma_px, across)
    for leak, exposures in zip(scene.leaks, falls, strict=True):  # their tables have the blur along the rows already
        streak = streak_table(lit, view, camera, leak, recording.psf_sigma_px)
        if streak is not None:
            expose_drops(frames.reshape(-1), streak, exposures)
    _blur_along(frames, recording.psf_sigma_px, down)
    for frame in frames:
        frame *= np.float32(recording.responsivity)
        frame += still
        np.maximum(frame, 0, out=frame)
    return frames


def _exposed(lit: LitScene, leak: Leak, recording: Recording, shape: tuple[int, int]) -> Exposures:
    """All frames that show a drop of a leak."""
    falling_s = float(fall_time(landing_m(lit, leak)))
    return drop_exposures(recording, range(recording.n_frames), leak.drop_times_s, falling_s, shape)


def _blur_along(images: FloatArray, sigma_px: float, direction: tuple[int, int]) -> None:
    """Gaussian blur in place of every image, along the rows (1, 0) or down the columns (0, 1)."""
    if sigma_px == 0:
        return
    spread = cv2.getGaussianKernel(2 * int(np.ceil(4 * sigma_px)) + 1, sigma_px, cv2.CV_32F)
    still = np.ones((1, 1), np.float32)
    kernels = [spread if along else still for along in direction]
    for image in images:
        cv2.sepFilter2D(image, -1, kernels[0], kernels[1], dst=image, borderType=cv2.BORDER_REPLICATE)


def _blurred(image: FloatArray, sigma_px: float) -> FloatArray:
    if sigma_px == 0:
        return image
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px, borderType=cv2.BORDER_REPLICATE))
