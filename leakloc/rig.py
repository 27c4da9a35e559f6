"""The believed rig: two calibrated cameras and, where it is known, their pose in the world and the lamps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

MAX_SIDE_PX = 8192
MAX_LAMPS = 100
MAX_NUMBER = 1e6  # m, px or distortion: beyond it nothing is a calibration, and sums of squares overflow
MIN_FOCAL_PX = 1.0
MIN_BASELINE_M = 1e-6
DISTORTION_LENGTHS = (4, 5, 8, 12, 14)  # OpenCV's pinhole models
ROTATION_TOLERANCE = 1e-5  # largest entry of R R^T - I; leaves room for six written decimals

# Left camera axes (x right, y down, z forward) seen from the frame x forward, y left, z up at the same origin.
FORWARD_LEFT_UP_FROM_CAMERA = np.array(
    [[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)


class RigError(ValueError):
    """A rig that cannot be: names the file (if any), the key, the rule and the value."""


@dataclass(frozen=True, eq=False)
class Rig:
    """Two pinhole cameras as OpenCV's stereoCalibrate gives them, and where the left one stands.

    `K1`, `K2` (3, 3) in px; `D1`, `D2` distortion of 4, 5, 8, 12 or 14 numbers; `R` (3, 3) and `T` (3,) in m with
    X2 = R X1 + T; `image_size` = (width, height) in px. `world_from_left` (4, 4) or None: without it results are in
    the frame of the left camera taken as level (x forward, y left, z up, left camera at the origin). `lamps` (n, 4)
    of x, y, z, radius in m or None; `pedestal_radius` in m or None. Arrays are float64 copies and read-only.

    Raises RigError for shapes, NaN, an image size or focal length that is not positive, a matrix that is no
    rotation, cameras in one place.
    """

    K1: Array
    D1: Array
    K2: Array
    D2: Array
    R: Array
    T: Array
    image_size: tuple[int, int]
    world_from_left: Array | None = None
    lamps: Array | None = None
    pedestal_radius: float | None = None

    def __post_init__(self) -> None:
        """Copy, check and freeze what was given."""
        checked = {
            "K1": _camera_matrix("K1", self.K1),
            "D1": _distortion("D1", self.D1),
            "K2": _camera_matrix("K2", self.K2),
            "D2": _distortion("D2", self.D2),
            "R": _rotation("R", _numbers("R", self.R, (3, 3))),
            "T": _baseline("T", self.T),
            "image_size": _image_size("image_size", self.image_size),
            "world_from_left": None if self.world_from_left is None else _pose("world_from_left", self.world_from_left),
            "lamps": None if self.lamps is None else _lamps("lamps", self.lamps),
            "pedestal_radius": None
            if self.pedestal_radius is None
            else _radius("pedestal_radius", self.pedestal_radius),
        }
        for key, value in checked.items():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
            object.__setattr__(self, key, value)

    @property
    def frame(self) -> str:
        """The frame of every position got with this rig: "world", or "left camera" (levelled) without a pose."""
        return "left camera" if self.world_from_left is None else "world"

    @property
    def frame_from_left(self) -> Array:
        """(4, 4) left camera coordinates to the frame of the results, m."""
        return FORWARD_LEFT_UP_FROM_CAMERA if self.world_from_left is None else self.world_from_left

    @property
    def left_from_frame(self) -> Array:
        """(4, 4) frame of the results to the left camera, m: the inverse of a rigid motion."""
        return _inverse_motion(self.frame_from_left)

    @property
    def right_from_frame(self) -> Array:
        """(4, 4) frame of the results to the right camera, m: X2 = R X1 + T after `left_from_frame`."""
        right_from_left = np.eye(4)
        right_from_left[:3, :3], right_from_left[:3, 3] = self.R, self.T
        return right_from_left @ self.left_from_frame

    def of_known_place(self) -> Rig:
        """This rig; without `world_from_left` less its lamps and wall, for where their world is nobody knows."""
        return self if self.world_from_left is not None else replace(self, lamps=None, pedestal_radius=None)

    @property
    def P1(self) -> Array:  # noqa: N802
        """(3, 4) projection of the left camera, frame of the results (m) to undistorted pixels."""
        return self.K1 @ self.left_from_frame[:3]

    @property
    def P2(self) -> Array:  # noqa: N802
        """(3, 4) projection of the right camera, frame of the results (m) to undistorted pixels."""
        return self.K2 @ self.right_from_frame[:3]


def depths_m(points_m: ArrayLike, camera_from_frame: Array) -> Array:
    """Distance of points (n, 3) along the optical axis of a camera, m: positive in front of it. Returns (n,)."""
    return np.asarray(points_m, dtype=np.float64) @ camera_from_frame[2, :3] + camera_from_frame[2, 3]


def _inverse_motion(motion: Array) -> Array:
    inverse = np.eye(4)
    inverse[:3, :3] = motion[:3, :3].T
    inverse[:3, 3] = -motion[:3, :3].T @ motion[:3, 3]
    return inverse


def _numbers(key: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    try:
        numbers = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise RigError(f"{key} must be numbers, got {value!r}") from error
    if numbers.shape != shape:
        raise RigError(f"{key} must have the shape {shape}, got {numbers.shape}")
    if not np.isfinite(numbers).all():
        raise RigError(f"{key} must be finite numbers, got {numbers.tolist()}")
    if (np.abs(numbers) > MAX_NUMBER).any():
        raise RigError(f"{key} must be numbers up to {MAX_NUMBER:g}, got {numbers.tolist()}")
    return numbers


def _camera_matrix(key: str, value: ArrayLike) -> Array:
    K = _numbers(key, value, (3, 3))
    if min(K[0, 0], K[1, 1]) < MIN_FOCAL_PX:
        raise RigError(f"{key} must have focal lengths >= {MIN_FOCAL_PX:g} px, got {K[0, 0]:g} and {K[1, 1]:g}")
    if K[1, 0] != 0 or not np.array_equal(K[2], [0, 0, 1]):
        raise RigError(f"{key} must be [[fx, skew, cx], [0, fy, cy], [0, 0, 1]], got {K.tolist()}")
    return K


def _distortion(key: str, value: ArrayLike) -> Array:
    count = np.size(value)
    if count not in DISTORTION_LENGTHS:
        raise RigError(f"{key} must have 4, 5, 8, 12 or 14 coefficients, got {count}")
    return _numbers(key, np.ravel(value), (count,))


def _rotation(key: str, R: Array) -> Array:
    error = float(np.abs(R @ R.T - np.eye(3)).max())
    if error > ROTATION_TOLERANCE or np.linalg.det(R) < 0:
        raise RigError(f"{key} must be a rotation (R R^T = I within {ROTATION_TOLERANCE:g}, det +1), got {R.tolist()}")
    return R


def _baseline(key: str, value: ArrayLike) -> Array:
    T = _numbers(key, np.ravel(value), (3,))
    if np.linalg.norm(T) < MIN_BASELINE_M:
        raise RigError(f"{key} must not be zero: two cameras in one place have no baseline, got {T.tolist()}")
    return T


def _image_size(key: str, value: tuple[int, int]) -> tuple[int, int]:
    numbers = _numbers(key, value, (2,))
    if not (np.array_equal(numbers, np.round(numbers)) and (numbers >= 1).all() and (numbers <= MAX_SIDE_PX).all()):
        raise RigError(f"{key} must be [width, height], whole px from 1 to {MAX_SIDE_PX}, got {numbers.tolist()}")
    return int(numbers[0]), int(numbers[1])


def _pose(key: str, value: ArrayLike) -> Array:
    pose = _numbers(key, value, (4, 4))
    if not np.array_equal(pose[3], [0, 0, 0, 1]):
        raise RigError(f"{key} must end in the row [0, 0, 0, 1], got {pose[3].tolist()}")
    _rotation(f"{key} (upper left 3 x 3)", pose[:3, :3])
    return pose


def _lamps(key: str, value: ArrayLike) -> Array:
    count = len(np.atleast_1d(np.asarray(value)))
    if not 1 <= count <= MAX_LAMPS:
        raise RigError(f"{key} must be 1 to {MAX_LAMPS} rows of x, y, z, radius, got {count}")
    lamps = _numbers(key, value, (count, 4))
    if (lamps[:, 3] < 0).any():
        raise RigError(f"{key} must have radii >= 0 m, got {lamps[:, 3].tolist()}")
    return lamps


def _radius(key: str, value: float) -> float:
    radius = float(_numbers(key, value, ()))
    if radius <= 0:
        raise RigError(f"{key} must be > 0 m, got {radius:g}")
    return radius
