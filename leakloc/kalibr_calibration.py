"""Kalibr's camchain.yaml: cam0 is the left camera, cam1 the right one. Source: Kalibr wiki, YAML formats."""

from __future__ import annotations

from typing import Any

import numpy as np

from leakloc.plain_yaml import need, shaped
from leakloc.rig import Rig, RigError

UNDISTORTED = "none"
BROWN_CONRADY = "radtan"  # k1 k2 r1 r2 = OpenCV's k1 k2 p1 p2


def kalibr_rig(chain: dict[str, Any], image_size: tuple[int, int] | None) -> Rig:
    """The rig of a chain of two pinhole cameras; `T_cn_cnm1` of cam1 is X1 = R X0 + T, so R and T as they stand.

    `image_size` stands in for a missing `resolution`. Raises RigError naming camera, key, value and rule.
    """
    cameras = sorted(str(key) for key in chain if str(key).startswith("cam"))
    if cameras != ["cam0", "cam1"]:
        raise RigError(f"a camchain of two cameras must have cam0 and cam1, got {', '.join(cameras)}")
    intrinsics = [_intrinsics(name, chain[name]) for name in cameras]
    sizes = [_resolution(name, chain[name], image_size) for name in cameras]
    if sizes[0] != sizes[1]:
        raise RigError(f"cam1.resolution must be cam0's {sizes[0]}, got {sizes[1]}")
    right_from_left = shaped("cam1.T_cn_cnm1", need(chain["cam1"], "T_cn_cnm1"), 4, 4)
    if not np.array_equal(right_from_left[3], [0, 0, 0, 1]):
        raise RigError(f"cam1.T_cn_cnm1 must end in the row [0, 0, 0, 1], got {right_from_left[3].tolist()}")
    (K1, D1), (K2, D2) = intrinsics
    R, T = right_from_left[:3, :3], right_from_left[:3, 3]
    return Rig(K1, D1, K2, D2, R, T, sizes[0])


def _intrinsics(name: str, camera: Any) -> tuple[np.ndarray, np.ndarray]:
    if not isinstance(camera, dict):
        raise RigError(f"{name} must be a mapping")
    model = need(camera, "camera_model")
    if model != "pinhole":
        raise RigError(f"{name}.camera_model must be pinhole, got {model!r:.80}")
    lens = camera.get("distortion_model", UNDISTORTED)
    if lens not in (BROWN_CONRADY, UNDISTORTED):
        raise RigError(f"{name}.distortion_model must be radtan or none, got {lens!r:.80}")
    fu, fv, pu, pv = shaped(f"{name}.intrinsics", need(camera, "intrinsics"), 4)
    K = np.array([[fu, 0, pu], [0, fv, pv], [0, 0, 1]])
    if lens == UNDISTORTED:
        return K, np.zeros(4)
    return K, shaped(f"{name}.distortion_coeffs", need(camera, "distortion_coeffs"), 4)


def _resolution(name: str, camera: dict[str, Any], image_size: tuple[int, int] | None) -> tuple[int, int]:
    if "resolution" not in camera and image_size is not None:
        return image_size
    width_px, height_px = shaped(f"{name}.resolution", need(camera, "resolution"), 2).tolist()
    return width_px, height_px  # Rig refuses fractions
