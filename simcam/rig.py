"""A stereo rig: two cameras on a baseline, turned as one body about its middle, with small errors between them.

R = Rz(yaw) Ry(pitch) Rx(roll) in world axes (x forward, y left, z up): +yaw turns left, +pitch looks down,
+roll lifts the left side.
"""

from dataclasses import dataclass

import numpy as np

from simcam.camera import Camera
from simcam.lens import FloatArray

# Columns: the camera's x (right), y (down) and z (forward) in the rig's axes x forward, y left, z up.
RIG_FROM_CAMERA = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True)
class Lens:
    """What both cameras share: horizontal field of view, image size, Brown coefficients k1 k2 p1 p2 k3."""

    hfov_deg: float = 70.0
    width_px: int = 960
    height_px: int = 540
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Check the field of view and the number of coefficients."""
        if not 0.0 < self.hfov_deg < 180.0:
            raise ValueError(f"Lens: hfov_deg must lie in (0, 180), got {self.hfov_deg}")
        if len(self.distortion) != 5:
            raise ValueError(f"Lens: distortion needs the 5 values k1 k2 p1 p2 k3, got {len(self.distortion)}")

    @property
    def focal_px(self) -> float:
        """Focal length in pixels, (W / 2) / tan(hfov / 2)."""
        return self.width_px / 2 / np.tan(np.radians(self.hfov_deg) / 2)

    @property
    def camera_matrix(self) -> FloatArray:
        """Pin-hole matrix (3, 3) with square pixels and the principal point in the middle of the image."""
        return np.array(
            [
                [self.focal_px, 0.0, (self.width_px - 1) / 2],
                [0.0, self.focal_px, (self.height_px - 1) / 2],
                [0.0, 0.0, 1.0],
            ]
        )


@dataclass(frozen=True)
class Tilt:
    """A turn Rz(yaw) Ry(pitch) Rx(roll), degrees: +yaw turns left, +pitch looks down, +roll lifts the left side."""

    roll_deg: float = 0.0
    pitch_deg: float = 0.0
    yaw_deg: float = 0.0

    @property
    def rotation(self) -> FloatArray:
        """Rotation matrix (3, 3)."""
        return rotation_zyx(self.yaw_deg, self.pitch_deg, self.roll_deg)


@dataclass(frozen=True)
class Pose(Tilt):
    """Place of the rig's origin (the midpoint of the baseline) and its turn about it."""

    position_m: tuple[float, float, float] = (-2.4, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class StereoRig:
    """Left and right camera."""

    left: Camera
    right: Camera


def rotation_zyx(yaw_deg: float, pitch_deg: float, roll_deg: float) -> FloatArray:
    """Rotation (3, 3) R = Rz(yaw) Ry(pitch) Rx(roll), right-handed."""
    (cz, cy, cx), (sz, sy, sx) = (trig(np.radians([yaw_deg, pitch_deg, roll_deg])) for trig in (np.cos, np.sin))
    about_z = np.array([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]])
    about_y = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
    return about_z @ about_y @ about_x


def stereo_rig(
    *,
    pose: Pose | None = None,
    lens: Lens | None = None,
    baseline_m: float = 0.5,
    right_error: Tilt | None = None,
) -> StereoRig:
    """Two equal cameras at +-baseline/2 along the rig's y axis (left = +), turned with the rig about its origin.

    `right_error` turns the right camera alone about its own centre, in the rig's axes. Defaults: the paper's rig.
    """
    pose, lens, right_error = pose or Pose(), lens or Lens(), right_error or Tilt()
    if not baseline_m > 0:
        raise ValueError(f"stereo_rig: baseline_m must be > 0, got {baseline_m}")
    origin_m = np.asarray(pose.position_m, float)
    offset_m = pose.rotation @ np.array([0.0, baseline_m / 2, 0.0])
    left = _camera(lens, origin_m + offset_m, pose.rotation)
    right = _camera(lens, origin_m - offset_m, pose.rotation @ right_error.rotation)
    return StereoRig(left, right)


def _camera(lens: Lens, centre_m: FloatArray, world_from_rig: FloatArray) -> Camera:
    world_from_camera = np.eye(4)
    world_from_camera[:3, :3] = world_from_rig @ RIG_FROM_CAMERA
    world_from_camera[:3, 3] = centre_m
    return Camera(
        lens.width_px, lens.height_px, lens.camera_matrix, np.asarray(lens.distortion, float), world_from_camera
    )
