"""Where drops and their shadows are in a frame: soft masks, shares of each pixel and of its exposure; drop centres.

Made by the same tables as the pictures, with a drop of radiance 1 before a black scene, and lamps of radiance 1.
"""

from dataclasses import replace

import numpy as np

from simcam.camera import Camera
from simcam.exposure import drop_exposures
from simcam.fall import fall_depth, fall_time
from simcam.lens import FloatArray
from simcam.path import landing_m
from simcam.recording import Recording
from simcam.scene import Scene
from simcam.shadows import expose_shadows, shadow_tables
from simcam.static import light_scene, static_view
from simcam.streaks import coverage_table, expose_drops


def drop_mask(scene: Scene, camera: Camera, recording: Recording, frame: int) -> FloatArray:
    """Share 0..1 of pixel and exposure that drops cover, float32 (height, width); overlapping drops add."""
    lit, view = light_scene(scene), static_view(scene, camera)
    mask = np.zeros(view.radiance.size, np.float32)
    for leak in scene.leaks:
        table = coverage_table(lit, view, camera, leak)
        if table is None:
            continue
        falling_s = float(fall_time(landing_m(lit, leak)))
        expose_drops(mask, table, drop_exposures(recording, [frame], leak.drop_times_s, falling_s, view.radiance.shape))
    return (mask / np.float32(recording.exposure_s)).reshape(view.radiance.shape)


def drop_centres(scene: Scene, camera: Camera, recording: Recording, frame: int) -> FloatArray:
    """Pixels (leaks, drops, 2) of every drop at the middle of a frame's exposure; NaN when not falling or not in front.

    Padded to the leak with most drops; a rolling shutter's delay is left out.
    """
    lit = light_scene(scene)
    most = max((len(leak.drop_times_s) for leak in scene.leaks), default=0)
    centres = np.full((len(scene.leaks), most, 2), np.nan)
    for index, leak in enumerate(scene.leaks):
        depth_m = fall_depth(frame / recording.fps - leak.drop_times_s)
        falling = (leak.drop_times_s < frame / recording.fps) & (depth_m < landing_m(lit, leak))
        places_m = leak.position_m - depth_m[:, None] * np.array([0.0, 0.0, 1.0])
        centres[index, : len(depth_m)] = np.where(falling[:, None], camera.project(places_m), np.nan)
    return centres


def static_depth(scene: Scene, camera: Camera) -> FloatArray:
    """Depth in metres along the optical axis of what each pixel sees without drops, float32 (height, width)."""
    view = static_view(scene, camera)
    cosine = camera.pixel_rays() @ camera.rotation[:, 2]
    return view.range_m * cosine.astype(np.float32)


def shadow_mask(scene: Scene, camera: Camera, recording: Recording, frame: int) -> FloatArray:
    """Share of a lamp's disc that drops hide from what each pixel sees, mean over the exposure, summed over lamps.

    Float32 (height, width); 0 where structure hides the lamp anyway, and in a scene without drop shadows.
    """
    lit, view = light_scene(scene), static_view(scene, camera)
    lamps_on = replace(view, by_source=(view.direct > 0).astype(np.float32))  # without the lamps' feet
    mask = np.zeros(view.radiance.size, np.float32)
    for leak in scene.leaks if scene.drop_shadows else ():
        falling_s = float(fall_time(landing_m(lit, leak)))
        exposures = drop_exposures(recording, [frame], leak.drop_times_s, falling_s, view.radiance.shape)
        for table in shadow_tables(lit, lamps_on, leak):
            expose_shadows(mask, table, exposures)
    return (-mask / np.float32(recording.exposure_s)).reshape(view.radiance.shape)
