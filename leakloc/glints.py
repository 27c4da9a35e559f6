"""Where a lamp glitters in a falling drop: not at the drop's centre, which decides the last centimetres."""

from __future__ import annotations

import numpy as np

from leakloc.rig import Array

WATER_INDEX = 1.333
INTERNAL_OVER_EXTERNAL = 3.9  # light of the internal glint over that of the external one (Fresnel, near backscatter)
RAINBOW_IMPACT = 0.861  # impact parameter of the primary rainbow: beyond its angle there is no internal glint


def glint_offsets(camera_m: Array, lamp_m: Array, drop_m: Array, right: Array) -> tuple[Array, Array]:
    """Offsets of the two glints from the drop's centre along the image's row, in drop radii, and their shares of light.

    The external glint is the mirror image on the front, sin(theta / 2) towards the lamp, theta the angle between lamp
    and camera seen from the drop. The internal one, reflected once at the back, leaves at the impact parameter b with
    theta = 4 asin(b / n) - 2 asin(b), on the side away from the lamp (Bohren and Huffman, 4.2, geometric optics).
    camera_m, lamp_m, drop_m (3,) and right (3,), the row's direction, in one frame. Returns ((2,), (2,)).
    """
    to_camera, to_lamp = _unit(camera_m - drop_m), _unit(lamp_m - drop_m)
    across = to_lamp - (to_lamp @ to_camera) * to_camera
    sine = float(np.linalg.norm(across))
    if sine == 0.0:
        return np.zeros(2), np.array([1.0, INTERNAL_OVER_EXTERNAL]) / (1 + INTERNAL_OVER_EXTERNAL)
    theta = float(np.arctan2(sine, to_lamp @ to_camera))
    sideways = float(across @ right) / sine
    b = np.linspace(0.0, RAINBOW_IMPACT, 200)
    angle = 4 * np.arcsin(b / WATER_INDEX) - 2 * np.arcsin(b)
    internal = float(np.interp(theta, angle, b))
    share = INTERNAL_OVER_EXTERNAL if theta <= angle[-1] else 0.0
    offsets = np.array([np.sin(theta / 2), -internal]) * sideways
    return offsets, np.array([1.0, share]) / (1 + share)


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))
