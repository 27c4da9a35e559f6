"""The Brown-Conrady lens: where radial and tangential distortion put a ray in the image, and back, exactly.

Coordinates are normalised (x/z, y/z in camera axes, z = 1). Coefficients in OpenCV order k1 k2 p1 p2 k3.
Source: D. C. Brown, "Close-range camera calibration", 1971; the OpenCV camera model.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[Any]  # floats of either width

SOLVED = 1e-11  # normalised units: 1e-8 px for the paper's rig
MAX_STEPS = 30


def distort(points: FloatArray, distortion: FloatArray) -> FloatArray:
    """Normalised image points (..., 2) after the lens."""
    k1, k2, p1, p2, k3 = distortion
    x, y = points[..., 0], points[..., 1]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return np.stack(
        [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ],
        axis=-1,
    )


def undistort(points: FloatArray, distortion: FloatArray) -> FloatArray:
    """Normalised points (..., 2) that `distort` maps onto `points`: Newton's method to 1e-11, NaN where none exists."""
    points = np.asarray(points, float)
    if not np.any(distortion):
        return points.copy()
    solution = points.copy()
    for _ in range(MAX_STEPS):
        error = distort(solution, distortion) - points
        if np.nanmax(np.abs(error), initial=0.0) < SOLVED:
            break
        solution -= _newton_step(solution, error, distortion)
    lost = ~(np.abs(distort(solution, distortion) - points).max(axis=-1) < 10 * SOLVED)
    solution[lost | ~unfolded(solution, distortion)] = np.nan
    return solution


def _newton_step(points: FloatArray, error: FloatArray, distortion: FloatArray) -> FloatArray:
    jxx, jxy, jyy = _jacobian(points, distortion)
    determinant = jxx * jyy - jxy * jxy
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.stack(
            [
                (jyy * error[..., 0] - jxy * error[..., 1]) / determinant,
                (jxx * error[..., 1] - jxy * error[..., 0]) / determinant,
            ],
            axis=-1,
        )


def _jacobian(points: FloatArray, distortion: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Derivatives (dx'/dx, dx'/dy = dy'/dx, dy'/dy): the Brown model's Jacobian is symmetric."""
    k1, k2, p1, p2, k3 = distortion
    x, y = points[..., 0], points[..., 1]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3))  # d radial / d r2, times 2
    jxx = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x
    jxy = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y
    jyy = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x
    return jxx, jxy, jyy


def unfolded(points: FloatArray, distortion: FloatArray) -> NDArray[np.bool_]:
    """True where the lens map keeps its orientation: beyond the fold a second, false solution exists."""
    jxx, jxy, jyy = _jacobian(points, distortion)
    return (jxx > 0) & (jxx * jyy - jxy * jxy > 0)
