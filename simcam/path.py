"""The falling drop as a camera sees it: the leak's line in the image, as a function of the time since release."""

from dataclasses import dataclass, fields

import numpy as np

from simcam.camera import Camera
from simcam.fall import fall_depth, fall_time
from simcam.lens import FloatArray
from simcam.scene import Leak
from simcam.static import LitScene
from simcam.structures import IndexArray

PATH_POINTS = 513
SHORTEST_STEP_S = 1e-7  # in which no drop passes a row
RIM_RADII, RIM_PX = 2.0, 2.0  # how far outside a drop's centre may be while its rim is inside


@dataclass(frozen=True)
class DropPath:
    """A drop's path while any of it may be in the image: arrays over points, from high to low.

    fall_s (n,); centre_m (n, 3); centre_px (n, 2); right, down (n, 3) unit vectors across the line of sight, `right`
    along the image's rows; right_px (n,) columns per metre along `right`; down_px (n, 2) columns, rows per metre along
    `down`; range_m (n,) from the camera.
    """

    fall_s: FloatArray
    centre_m: FloatArray
    centre_px: FloatArray
    right: FloatArray
    down: FloatArray
    right_px: FloatArray
    down_px: FloatArray
    range_m: FloatArray

    @property
    def sight(self) -> FloatArray:
        """Unit direction (n, 3) from the camera to the drop."""
        return np.cross(self.right, self.down)

    def at(self, fall_s: FloatArray) -> "DropPath":
        """The path at other times since release: positions and scales are interpolated linearly."""

        def pick(values: FloatArray) -> FloatArray:
            if values.ndim == 1:
                return np.interp(fall_s, self.fall_s, values)
            return np.stack([np.interp(fall_s, self.fall_s, column) for column in values.T], axis=-1)

        others = {field.name: pick(getattr(self, field.name)) for field in fields(self) if field.name != "fall_s"}
        return DropPath(fall_s=np.asarray(fall_s), **others)


def landing_m(lit: LitScene, leak: Leak) -> float:
    """Metres that a drop falls from its leak to the first surface below: structure or the floor."""
    down = np.array([[0.0], [0.0], [-1.0]], np.float32)
    return float(lit.look(leak.position_m[:, None].astype(np.float32), down).distance_m[0])


def drop_path(camera: Camera, leak: Leak, landing: float) -> DropPath | None:
    """The visible part of a leak's line, or None when no drop of it can be seen.

    Raises ValueError when the image line is not followed downwards (a camera rolled by more than 90 degrees).
    """
    coarse_s = np.linspace(0.0, float(fall_time(landing)), PATH_POINTS)
    seen = _seen(camera, leak, coarse_s)
    while seen.size == 0:  # a low image may be passed between two points
        rows = camera.project(_places(leak, coarse_s))[:, 1]
        passed = np.flatnonzero((rows[:-1] < camera.middle_px[1]) & (rows[1:] >= camera.middle_px[1]))
        if passed.size == 0 or coarse_s[passed[0] + 1] - coarse_s[passed[0]] < SHORTEST_STEP_S:
            return None
        coarse_s = np.linspace(coarse_s[passed[0]], coarse_s[passed[0] + 1], PATH_POINTS)
        seen = _seen(camera, leak, coarse_s)
    first, last = max(seen[0] - 1, 0), min(seen[-1] + 1, PATH_POINTS - 1)
    fall_s = np.linspace(coarse_s[first], coarse_s[last], PATH_POINTS)
    path = _in_front(_followed(camera, leak, fall_s))
    if len(path.fall_s) < 2:
        return None
    if not (np.diff(path.centre_px[:, 1]) > 0).all():
        raise ValueError("drop_path: drops must fall downwards in the image; roll and pitch are too large")
    return path


def _seen(camera: Camera, leak: Leak, fall_s: FloatArray) -> IndexArray:
    """Which of the times since release any of a drop may be in the image."""
    places_m = _places(leak, fall_s)
    depth_m = np.maximum(camera.depth(places_m), leak.drop_radius_m)
    rim_px = RIM_PX + RIM_RADII * leak.drop_radius_m * camera.camera_matrix[0, 0] / depth_m
    outside = np.abs(camera.project(places_m) - camera.middle_px) - np.array([camera.width_px, camera.height_px]) / 2
    return np.flatnonzero((outside < rim_px[:, None]).all(axis=1))


def _in_front(path: DropPath) -> DropPath:
    """The part of a path that the lens shows."""
    shown = np.isfinite(path.centre_px).all(axis=1) & np.isfinite(path.down_px).all(axis=1)
    return DropPath(**{field.name: getattr(path, field.name)[shown] for field in fields(path)})


def _places(leak: Leak, fall_s: FloatArray) -> FloatArray:
    places = np.repeat(leak.position_m[None], len(fall_s), axis=0)
    places[:, 2] -= fall_depth(fall_s)
    return places


def _followed(camera: Camera, leak: Leak, fall_s: FloatArray) -> DropPath:
    centre_m = _places(leak, fall_s)
    sight = centre_m - camera.centre_world_m
    range_m = np.linalg.norm(sight, axis=1)
    sight /= range_m[:, None]
    first = np.cross(sight, camera.rotation[:, 1])  # camera y is down, so y x sight is roughly left
    first /= -np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(sight, first)
    first_px, second_px = _pixels_per_metre(camera, centre_m, first), _pixels_per_metre(camera, centre_m, second)
    right = first * second_px[:, 1:] - second * first_px[:, 1:]  # the mixture that leaves the row unchanged
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    right *= np.sign(np.sum(right * camera.rotation[:, 0], axis=1, keepdims=True))
    down = np.cross(sight, right)
    return DropPath(
        fall_s,
        centre_m,
        camera.project(centre_m),
        right,
        down,
        _pixels_per_metre(camera, centre_m, right)[:, 0],
        _pixels_per_metre(camera, centre_m, down),
        range_m,
    )


def _pixels_per_metre(camera: Camera, centre_m: FloatArray, direction: FloatArray) -> FloatArray:
    step_m = 1e-4
    return (camera.project(centre_m + step_m * direction) - camera.project(centre_m - step_m * direction)) / (
        2 * step_m
    )
