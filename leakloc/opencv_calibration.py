"""stereoCalibrate's output in OpenCV FileStorage, under the names that people give its matrices."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import cv2
import numpy as np

from leakloc.rig import Rig, RigError
from leakloc.rig_file import _matrix, _number, _reason, _sequence

NAMES = {
    "K1": ("K1", "M1", "CM1", "cameraMatrix1", "camera_matrix_1", "camera_matrix1", "K_left", "left_camera_matrix"),
    "D1": ("D1", "distCoeffs1", "dist_coeffs_1", "dist_coeffs1", "D_left", "left_distortion_coefficients"),
    "K2": ("K2", "M2", "CM2", "cameraMatrix2", "camera_matrix_2", "camera_matrix2", "K_right", "right_camera_matrix"),
    "D2": ("D2", "distCoeffs2", "dist_coeffs_2", "dist_coeffs2", "D_right", "right_distortion_coefficients"),
    "R": ("R", "rotation", "rotation_matrix"),
    "T": ("T", "translation", "translation_vector"),
    "image_size": ("image_size", "imageSize", "img_size"),
    "world_from_left": ("world_from_left",),
    "lamps": ("lamps",),
    "pedestal_radius": ("pedestal_radius",),
}
SIDES = (("image_width", "imageWidth", "width"), ("image_height", "imageHeight", "height"))
REQUIRED = ("K1", "D1", "K2", "D2", "R", "T")


def opencv_values(text: str) -> dict[str, Any]:
    """What a FileStorage text holds of a `Rig`, under the rig's own names. Raises RigError naming key and rule."""
    try:
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    except (cv2.error, SystemError) as error:  # the bindings wrap a parser's cv2.error in a SystemError
        raise RigError(f"not OpenCV FileStorage YAML or XML{_reason(error)}") from None
    try:
        if not storage.isOpened() or not storage.root().isMap():
            raise RigError("not OpenCV FileStorage YAML or XML: no keys at the top")
        return _values_in(storage)
    finally:
        storage.release()


def opencv_rig(files: Iterable[dict[str, Any]], image_size: tuple[int, int] | None) -> Rig:
    """The rig of one file, or of two such as intrinsics.yml and extrinsics.yml, X2 = R X1 + T.

    `image_size` stands in for a missing one. Raises RigError naming key, value and rule.
    """
    values: dict[str, Any] = {}
    for file in files:
        for key, value in file.items():
            if key in values and not np.array_equal(values[key], value):
                raise RigError(f"{key} must be given once, got two that differ")
            values[key] = value
    missing = [key for key in REQUIRED if key not in values]
    if missing:
        raise RigError(f"{', '.join(missing)} must be given, got only {', '.join(sorted(values)) or 'nothing known'}")
    if "image_size" not in values:
        if image_size is None:
            raise RigError("image_size must be given: [width, height], or image_width and image_height")
        values["image_size"] = image_size
    return Rig(**values)


def _values_in(storage: cv2.FileStorage) -> dict[str, Any]:
    present = set(storage.root().keys())
    values: dict[str, Any] = {}
    for key, names in NAMES.items():
        given = [name for name in names if name in present]
        if len(given) > 1:
            raise RigError(f"{key} must be given once, got {' and '.join(given)}")
        if given:
            values[key] = _value(key, given[0], storage.getNode(given[0]))
    sides = [next((name for name in names if name in present), None) for names in SIDES]
    if "image_size" not in values and sides[0] and sides[1]:
        values["image_size"] = tuple(_number(name, storage.getNode(name)) for name in sides if name)
    return values


def _value(key: str, name: str, node: cv2.FileNode) -> Any:
    if key == "pedestal_radius":
        return _number(name, node)
    if key == "image_size":
        return tuple(_matrix(name, node).ravel().tolist() if node.isMap() else _sequence(name, node, 2))
    return _matrix(name, node)
