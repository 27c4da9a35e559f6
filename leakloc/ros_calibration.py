"""ROS camera_info: one file per camera, written by camera_calibration or dumped from the topic.

Neither file holds R and T of the pair: they follow from how each camera is rectified. Source: sensor_msgs/CameraInfo.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from leakloc.plain_yaml import need, numbers, shaped
from leakloc.rig import Rig, RigError

Array = NDArray[np.float64]

MODELS = {"plumb_bob": (4, 5), "rational_polynomial": (8, 12, 14)}  # OpenCV's, and how many coefficients each has


@dataclass(frozen=True, eq=False)
class RosCamera:
    """K (3, 3) and D of the raw image; X_rectified = rectification X_camera; P (3, 4) of the rectified image."""

    K: Array
    D: Array
    rectification: Array
    P: Array
    image_size: tuple[float, float] | None


def ros_camera(info: dict[str, Any]) -> RosCamera:
    """One camera_info: the calibration's file (camera_matrix: {rows, cols, data} ...) or the message (K, D, R, P).

    Raises RigError naming key, value and rule.
    """
    model = need(info, "distortion_model")
    if not isinstance(model, str) or model not in MODELS:
        raise RigError(f"distortion_model must be one of {', '.join(MODELS)}, got {model!r:.80}")
    D = numbers("distortion_coefficients", _data(need(info, "distortion_coefficients", "D", "d"))).ravel()
    if len(D) not in MODELS[model]:
        counts = " or ".join(map(str, MODELS[model]))
        raise RigError(f"distortion_coefficients of {model} must be {counts}, got {len(D)}")
    P = shaped("projection_matrix", _data(need(info, "projection_matrix", "P", "p")), 3, 4)
    if not (P[0, 0] > 0 and P[1, 1] > 0 and P[1, 0] == 0 and np.array_equal(P[2], [0, 0, 1, 0])):
        raise RigError(f"projection_matrix must be [fx 0 cx fx*tx, 0 fy cy fy*ty, 0 0 1 0], got {P.tolist()}")
    return RosCamera(
        K=shaped("camera_matrix", _data(need(info, "camera_matrix", "K", "k")), 3, 3),
        D=D,
        rectification=shaped("rectification_matrix", _data(need(info, "rectification_matrix", "R", "r")), 3, 3),
        P=P,
        image_size=_image_size(info),
    )


def ros_rig(left: RosCamera, right: RosCamera, image_size: tuple[int, int] | None) -> Rig:
    """The rig of a pair: with X' = R_i X_i in rectified axes and X2' = X1' + t, X2 = R_2^T R_1 X1 + R_2^T t.

    t is what the projections say: P = K' (1 | t), so t.x = P[0, 3] / P[0, 0] = -baseline for the right camera.
    `image_size` stands in for a missing one. Raises RigError.
    """
    sizes = [camera.image_size or image_size for camera in (left, right)]
    if sizes[0] is None or sizes[1] is None:
        raise RigError("image_width and image_height must be given")
    if sizes[0] != sizes[1]:
        raise RigError(f"both cameras must have one image size, got {sizes[0]} and {sizes[1]}")
    shift_m = _shift_m(right) - _shift_m(left)
    R = right.rectification.T @ left.rectification
    return Rig(left.K, left.D, right.K, right.D, R, right.rectification.T @ shift_m, sizes[0])  # type: ignore[arg-type]


def _shift_m(camera: RosCamera) -> Array:
    return np.linalg.solve(camera.P[:, :3], camera.P[:, 3]).astype(np.float64)


def _data(value: Any) -> Any:
    return need(value, "data") if isinstance(value, dict) else value


def _image_size(info: dict[str, Any]) -> tuple[float, float] | None:
    sides = [
        next((info[name] for name in names if name in info), None)
        for names in (("image_width", "width"), ("image_height", "height"))
    ]
    if None in sides:
        return None
    width_px, height_px = shaped("image_width and image_height", sides, 2).tolist()
    return width_px, height_px
