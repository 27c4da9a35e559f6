"""Where two image columns meet on the top view (paper eq. 5-8)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

PARALLEL_SINE = 1e-12  # of the angle between two planes: below it rounding alone decides where they meet
UNDISTORT = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-12)  # OpenCV's own 5 steps leave 0.02 px


def column_planes(columns_px: ArrayLike, P: Array, height_px: int) -> Array:
    """Planes that the camera centre spans with image columns, (n, 4) with plane . (x, y, z, 1) = 0 (paper eq. 5-6).

    The image line of column c is l = (c, H, 1) x (c, 0, 1), its plane P^T l (Hartley and Zisserman, Multiple View
    Geometry, result 8.2). columns_px (n,) undistorted; P (3, 4), m to px.
    """
    columns = np.asarray(columns_px, dtype=np.float64)
    bottom = np.stack([columns, np.full_like(columns, height_px), np.ones_like(columns)], axis=-1)
    top = np.stack([columns, np.zeros_like(columns), np.ones_like(columns)], axis=-1)
    return np.cross(bottom, top) @ P


def meet_at_camera_height(left_planes: Array, right_planes: Array) -> Array:
    """(x, y) of the line in which two planes meet, at z = 0, in m (paper eq. 7-8).

    Planes (n, 4) each; returns (n, 2), NaN where the two traces at z = 0 are parallel.
    """
    a, b, c = left_planes[:, 0], left_planes[:, 1], left_planes[:, 3]
    d, e, f = right_planes[:, 0], right_planes[:, 1], right_planes[:, 3]
    determinant = a * e - b * d
    parallel = np.abs(determinant) <= PARALLEL_SINE * np.hypot(a, b) * np.hypot(d, e)
    safe = np.where(parallel, np.nan, determinant)
    return np.stack([(b * f - c * e) / safe, (c * d - a * f) / safe], axis=-1)


def undistort_columns(columns_px: ArrayLike, K: Array, D: Array, height_px: int) -> Array:
    """The columns of an image without distortion on which raw columns lie at mid-row, (n,), px.

    A distorted column is no line any more; the paper's images have none, and its method keeps columns, so the point at
    row (H - 1) / 2 stands for the whole column. Columns are returned as they are when D is zero.
    """
    columns = np.asarray(columns_px, dtype=np.float64)
    if not D.any() or not len(columns):
        return columns
    points = np.stack([columns, np.full_like(columns, (height_px - 1) / 2)], axis=-1)[:, None, :]
    straight = cv2.undistortPoints(points, K, D, R=np.eye(3), P=K, criteria=UNDISTORT)
    return straight[:, 0, 0].astype(np.float64)
