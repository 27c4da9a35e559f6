"""Close-ups of still drops, rendered by simcam in the crops of the path-traced ones."""

import json
from dataclasses import dataclass

import numpy as np
from reference_clips import REFERENCE

from simcam import Camera, Lamp, Leak, Pedestal, Recording, Scene, UniformTexture, render_view, stereo_rig
from simcam.static import static_view

WALL_REFLECTANCE = 0.2  # the close-ups' wall over irradiance / pi is 0.2 in all of them
FALLING_S = 5e-4


@dataclass(frozen=True)
class CloseUp:
    """One drop in one view: both renderings with and without it, its centre and radius in pixels of the crop."""

    name: str
    reference: np.ndarray
    reference_wall: np.ndarray
    ours: np.ndarray
    ours_wall: np.ndarray
    centre: tuple
    radius: float
    lamp_path_light: float  # what one path that meets the lamp adds to a pixel of the reference


def close_ups():
    """All twelve."""
    arrays = np.load(REFERENCE / "drops.npz", allow_pickle=False)
    description = json.loads((REFERENCE / "drops.json").read_text())
    (one_lamp,) = description["lamp"]
    lamp = Lamp(tuple(one_lamp["pos"]), one_lamp["radius"], one_lamp["power"])
    pedestal = Pedestal(texture=UniformTexture(WALL_REFLECTANCE))
    for crop in description["crops"]:
        key = f"{crop['drop']}_{crop['view']}"
        reference, wall = arrays[f"drop_{key}"].astype(float), arrays[f"wall_{key}"].astype(float)
        camera = _zoomed(getattr(stereo_rig(), crop["view"]), crop, reference.shape)
        x, y, z = crop["position_m"]
        depth_m = camera.depth(np.array([x, y, z]))
        # a third of a crop's pixel of motion smears the strips of the disc into each other
        speed = 9.81 * FALLING_S
        exposure_s = min(0.9 * 2 * FALLING_S, 0.3 * depth_m / camera.camera_matrix[1, 1] / speed)
        leak = Leak(x, y, z + 9.81 * FALLING_S**2 / 2, description["drop_radius_m"], np.array([-FALLING_S]))
        scene = Scene(pedestal, (lamp,), (leak,), (), 0)
        ours = render_view(scene, camera, Recording(1, 1.0, exposure_s, responsivity=1 / exposure_s))[0]
        centre = tuple(
            (np.array(crop["centre_px"]) - (crop["first_column_px"], crop["first_row_px"])) / crop["pixel_step_px"]
        )
        radius = description["drop_radius_m"] * camera.camera_matrix[0, 0] / depth_m
        path = lamp.radiance_w_m2_sr / description["samples_per_px"]
        yield CloseUp(key, reference, wall, ours, static_view(scene, camera).radiance, centre, radius, path)


def _zoomed(camera, crop, shape):
    scale = 1 / crop["pixel_step_px"]
    matrix = camera.camera_matrix * [[scale], [scale], [1]]
    first = np.array([crop["first_column_px"], crop["first_row_px"]])
    matrix[:2, 2] = (camera.camera_matrix[:2, 2] - first) * scale
    return Camera(shape[1], shape[0], matrix, camera.distortion, camera.world_from_camera)


def inside(one, radii=1.1):
    """Pixels within `radii` of the drop's centre."""
    rows, columns = np.indices(one.reference.shape)
    return np.hypot(columns - one.centre[0], rows - one.centre[1]) < radii * one.radius


def glint_light(image, wall):
    """Light above 1.5 times the wall in units of a wall's pixel, and its centroid (column, row)."""
    extra = np.where(image > 1.5 * wall, image - wall, 0) / wall.mean()
    rows, columns = np.indices(image.shape)
    return extra.sum(), np.array([(extra * columns).sum(), (extra * rows).sum()]) / max(extra.sum(), 1e-9)


def without_glints(one):
    """Drop over wall of both renderings at the pixels that no glint touches in either."""
    bright = np.maximum(one.reference / one.reference_wall, one.ours / one.ours_wall) > 1.5
    near = np.zeros_like(bright)
    for row in (-1, 0, 1):
        for column in (-1, 0, 1):
            near |= np.roll(bright, (row, column), (0, 1))
    kept = inside(one) & ~near
    return (one.reference / one.reference_wall)[kept], (one.ours / one.ours_wall)[kept]
