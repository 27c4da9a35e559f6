"""Direct light of spherical lamps: inverse square, Lambert's cosine, and the share of the lamp that structure hides.

A sphere of uniform radiance wholly above the horizon lights a matt surface exactly like a point of the same intensity,
E = I cos(theta) / d^2 (e.g. Siegel & Howell, Thermal Radiation Heat Transfer, view factor of sphere and disc element).
"""

from typing import Protocol

import numpy as np

from simcam.lens import FloatArray
from simcam.scene import Lamp
from simcam.surface import Obstacles, Surface

LAMP_SAMPLES = 16  # shadow rays per point and lamp for the camera's own picture
GOLDEN_ANGLE_RAD = np.pi * (3 - np.sqrt(5))


class ShadowSource(Protocol):
    """Anything round that gives light: a lamp, or the patch of wall that it lights close behind it (`foot`)."""

    @property
    def position_m(self) -> tuple[float, float, float]:
        """Its middle."""
        ...

    @property
    def radius_m(self) -> float:
        """Radius of the disc that a point sees."""
        ...


def open_irradiance(lamp: Lamp, points_m: FloatArray, normals: FloatArray) -> FloatArray:
    """Irradiance W/m^2 (n,) of a lamp at points (3, n) with normals (3, n), nothing in between."""
    x, y, z = (np.float32(place) - row for place, row in zip(lamp.position_m, points_m, strict=True))
    cosine_times_distance = np.maximum(x * normals[0] + y * normals[1] + z * normals[2], 0)
    squared = x * x + y * y + z * z
    return np.float32(lamp.intensity_w_sr) * cosine_times_distance / (squared * np.sqrt(squared))


def lamp_visibility(lamp: ShadowSource, surface: Surface, obstacles: Obstacles | None, samples: int) -> FloatArray:
    """Share 0..1 (n,) of the lamp's disc that a surface's points see past the structure, by shadow rays.

    Only points whose view of the lamp passes a structure's bounding box are asked.
    """
    points_m = surface.points_m
    visible = np.ones(points_m.shape[1], np.float32)
    if obstacles is None:
        return visible
    may_be_hidden = np.zeros(visible.shape, bool)
    for box_m in obstacles.boxes_m:
        may_be_hidden |= _passes_box(lamp, points_m, box_m)
    asked = np.flatnonzero(may_be_hidden)
    if asked.size == 0:
        return visible
    origins_m = np.ascontiguousarray(points_m[:, asked].T) + np.float32(1e-4) * surface.normals[:, asked].T
    hidden = np.zeros(asked.size, np.float32)
    for target_m in _lamp_disc(lamp, origins_m, samples):
        hidden += obstacles.caster.blocked(origins_m, target_m)
    visible[asked] = 1 - hidden / samples
    return visible


def _lamp_disc(lamp: ShadowSource, origins_m: FloatArray, samples: int) -> list[FloatArray]:
    """Points (n, 3) on the lamp's disc that faces each origin, a sunflower of equal areas; 1 sample = the centre.

    Each origin turns the sunflower by its own angle, so that a penumbra is grained and not banded.
    """
    centre_m = np.asarray(lamp.position_m, np.float32)
    if samples == 1:
        return [np.broadcast_to(centre_m, origins_m.shape)]
    towards = centre_m - origins_m
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    upright = np.abs(towards[:, 2:]) < 0.9
    across = np.cross(towards, np.where(upright, np.array([0, 0, 1], np.float32), np.array([1, 0, 0], np.float32)))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    other = np.cross(towards, across)
    turn = (np.arange(len(origins_m)) * GOLDEN_ANGLE_RAD % (2 * np.pi)).astype(np.float32)[:, None]
    across, other = np.cos(turn) * across + np.sin(turn) * other, np.cos(turn) * other - np.sin(turn) * across
    radii = np.float32(lamp.radius_m) * np.sqrt((np.arange(samples) + 0.5) / samples)
    angles = GOLDEN_ANGLE_RAD * np.arange(samples)
    return [
        centre_m + np.float32(radius * np.cos(angle)) * across + np.float32(radius * np.sin(angle)) * other
        for radius, angle in zip(radii, angles, strict=True)
    ]


def _passes_box(lamp: ShadowSource, points_m: FloatArray, box_m: FloatArray) -> FloatArray:
    """Slab test: does the segment from the point to the lamp's centre meet the box grown by the lamp's radius?"""
    enter = np.zeros(points_m.shape[1], np.float32)
    leave = np.ones(points_m.shape[1], np.float32)
    for axis in range(3):
        low = np.float32(box_m[0, axis] - lamp.radius_m)
        high = np.float32(box_m[1, axis] + lamp.radius_m)
        start = points_m[axis]
        step = np.float32(lamp.position_m[axis]) - start
        step = np.where(np.abs(step) < 1e-9, np.float32(1e-9), step)
        first, second = (low - start) / step, (high - start) / step
        enter = np.maximum(enter, np.minimum(first, second))
        leave = np.minimum(leave, np.maximum(first, second))
    return enter <= leave
