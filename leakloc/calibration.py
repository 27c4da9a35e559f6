"""Calibrations as people have them, read as a believed rig: OpenCV, ROS camera_info and Kalibr, told by content."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from leakloc.kalibr_calibration import kalibr_rig
from leakloc.opencv_calibration import opencv_rig, opencv_values
from leakloc.plain_yaml import load_mapping
from leakloc.rig import Rig, RigError
from leakloc.rig_file import _text_of
from leakloc.ros_calibration import ros_camera, ros_rig

PathLike = str | os.PathLike[str]

OPENCV, ROS, KALIBR = "OpenCV FileStorage", "ROS camera_info", "Kalibr camchain"
MAX_BASELINE_M = 10.0  # far over any rig's; a calibration in millimetres is far over this
ROS_KEYS = {"projection_matrix", "P", "p"}


def read_calibration(paths: PathLike | tuple[PathLike, PathLike], *, image_size: tuple[int, int] | None = None) -> Rig:
    """The rig that a calibration describes; `image_size` (width, height) is used where the calibration gives none.

    `paths` is one OpenCV FileStorage (YAML or XML; `leakloc.opencv_calibration` lists the names of keys), one Kalibr
    camchain (cam0 left), a pair of ROS camera_info (left, right), or a pair of OpenCV files that together hold the
    rig. X2 = R X1 + T, so the right camera has T.x < 0; m. Without `world_from_left`, which only OpenCV files can
    hold, results are in the frame of the left camera taken as level. Raises RigError naming file, key, value and rule:
    not a regular file, over 1 MiB, no known format, fisheye lenses, left and right swapped, cameras above each other,
    millimetres, and whatever `Rig` refuses.
    """
    files = [Path(path) for path in (paths if isinstance(paths, tuple) else (paths,))]
    if not 1 <= len(files) <= 2:
        raise RigError(f"a calibration must be one file or a pair, got {len(files)}")
    formats, parts = zip(*(_read_part(path) for path in files), strict=True)
    if len(set(formats)) > 1:
        raise RigError(f"{files[1]}: must be {formats[0]} as {files[0]}, got {formats[1]}")
    try:
        rig = _assemble(formats[0], parts, image_size)
        _check_sides(rig)
    except RigError as error:
        raise RigError(f"{' and '.join(map(str, files))}: {error}") from None
    return rig


def _read_part(path: Path) -> tuple[str, Any]:
    """Format and content of one file, told by what it holds and not by its name."""
    text = _text_of(path)
    try:
        if re.match(r"\s*(<\?xml|<opencv_storage|%YAML:)", text) or "!!opencv-matrix" in text:
            return OPENCV, opencv_values(text)
        mapping = load_mapping(text)
        if any(re.fullmatch(r"cam\d+", str(key)) for key in mapping):
            return KALIBR, mapping
        if ROS_KEYS & set(mapping):
            return ROS, ros_camera(mapping)
        raise RigError(f"must be {OPENCV} (K1 ...), {ROS} (projection_matrix ...) or a {KALIBR} (cam0 ...)")
    except RigError as error:
        raise RigError(f"{path}: {error}") from None


def _assemble(kind: str, parts: Sequence[Any], image_size: tuple[int, int] | None) -> Rig:
    if kind == OPENCV:
        return opencv_rig(parts, image_size)
    if kind == ROS:
        if len(parts) != 2:
            raise RigError(f"{ROS} must be a pair of files, left and right, got one")
        return ros_rig(parts[0], parts[1], image_size)
    if len(parts) != 1:
        raise RigError(f"a {KALIBR} must be one file that holds both cameras, got two")
    return kalibr_rig(parts[0], image_size)


def _check_sides(rig: Rig) -> None:
    """Refuse what no side-by-side pair in metres gives, T.x of the right camera being minus the baseline."""
    x_m, y_m, _ = rig.T.tolist()
    if abs(y_m) >= abs(x_m):
        raise RigError(f"T must be of cameras side by side (|T.x| > |T.y|), got {rig.T.tolist()}")
    if x_m > 0:
        raise RigError(
            f"T.x must be < 0 (X2 = R X1 + T, camera 2 on the right), got {x_m:g}: left and right seem to be swapped"
        )
    if np.linalg.norm(rig.T) > MAX_BASELINE_M:
        raise RigError(f"T must be at most {MAX_BASELINE_M:g} m long, got {rig.T.tolist()}: is it in millimetres?")
