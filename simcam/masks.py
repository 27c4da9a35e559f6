"""Where drops and their shadows are in a frame: soft masks, shares of each pixel and of its exposure.

Made by the same tables as the pictures, with a drop of radiance 1 before a black scene, and lamps of radiance 1.
"""

from dataclasses import replace

import numpy as np

from simcam.camera import Camera
from simcam.fall import fall_time
from simcam.lens import FloatArray
from simcam.path import landing_m
from simcam.recording import Recording
from simcam.scene import Scene
from simcam.shadows import expose_shadow, shadow_tables
from simcam.static import light_scene, static_view
from simcam.streaks import coverage_table, expose_drop


def drop_mask(scene: Scene, camera: Camera, recording: Recording, frame: int) -> FloatArray:
    """Share 0..1 of pixel and exposure that drops cover, float32 (height, width); overlapping drops add."""
    lit, view = light_scene(scene), static_view(scene, camera)
    mask = np.zeros(view.radiance.size, np.float32)
    delays_s = recording.row_delays_s(camera.height_px)
    for leak in scene.leaks:
        table = coverage_table(lit, view, camera, leak)
        if table is None:
            continue
        falling_s = float(fall_time(landing_m(lit, leak)))
        for released_s in leak.drop_times_s:
            opens, closes = (
                np.clip(edge + delays_s - released_s, 0, falling_s)
                for edge in (recording.opens_s(frame), recording.closes_s(frame))
            )
            expose_drop(mask, table, opens, closes)
    return (mask / np.float32(recording.exposure_s)).reshape(view.radiance.shape)


def shadow_mask(scene: Scene, camera: Camera, recording: Recording, frame: int) -> FloatArray:
    """Share of a lamp's disc that drops hide from what each pixel sees, mean over the exposure, summed over lamps.

    Float32 (height, width); 0 where structure hides the lamp anyway.
    """
    lit, view = light_scene(scene), static_view(scene, camera)
    lamps_on = replace(view, direct=(view.direct > 0).astype(np.float32))
    mask = np.zeros(view.radiance.size, np.float32)
    delays_s = recording.row_delays_s(camera.height_px)
    for leak in scene.leaks:
        falling_s = float(fall_time(landing_m(lit, leak)))
        tables = [table for index in range(len(lit.lamps)) for table in shadow_tables(lit, lamps_on, leak, index)]
        for table in tables:
            for released_s in leak.drop_times_s:
                opens, closes = (
                    np.clip(edge + delays_s - released_s, 0, falling_s)
                    for edge in (recording.opens_s(frame), recording.closes_s(frame))
                )
                expose_shadow(mask, table, opens, closes)
    return (-mask / np.float32(recording.exposure_s)).reshape(view.radiance.shape)
