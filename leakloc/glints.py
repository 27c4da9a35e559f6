"""Where a lamp glitters in a falling drop, and how brightly: off the drop's centre, which decides the last millimetres.

Three images of a lamp are seen near backscatter, by geometrical optics (van de Hulst, Light Scattering by Small
Particles, ch. 12): mirrored on the front of the sphere, and reflected once at its back on two ways that meet at the
rainbow. A ray that meets the sphere at impact parameter b (in radii) has the angle of incidence asin(b), is refracted
to asin(b / n) and leaves the front at theta = 2 asin(b), the back at theta = 4 asin(b / n) - 2 asin(b), theta the angle
between lamp and camera as the drop sees them. An image's strength is its share of light times b db / (sin theta
dtheta).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from leakloc.rig import Array

WATER_INDEX = 1.333
IMAGES = 3
LAMP_HALF_ANGLE_RAD = 0.03  # a lamp of 0.1 m some 3 m away: keeps the rainbow finite
TABLE_POINTS = 1000


def reflectance(incidence_rad: Array) -> Array:
    """Share of unpolarised light that water reflects (Fresnel; Hecht, Optics, 4.6); the same from inside."""
    refraction_rad = np.arcsin(np.sin(incidence_rad) / WATER_INDEX)
    cos_i, cos_t = np.cos(incidence_rad), np.cos(refraction_rad)
    across = (cos_i - WATER_INDEX * cos_t) / (cos_i + WATER_INDEX * cos_t)
    along = (WATER_INDEX * cos_i - cos_t) / (WATER_INDEX * cos_i + cos_t)
    return np.asarray((across**2 + along**2) / 2)


@lru_cache(maxsize=1)
def _images() -> tuple[tuple[Array, Array, Array, float], ...]:
    """Per image: theta (ascending), b and share of light there, and +1 if it stands on the lamp's side, else -1."""
    b = np.sin(np.linspace(0.0, np.pi / 2, TABLE_POINTS) * 0.9999)
    incidence = np.arcsin(b)
    mirrored = reflectance(incidence)
    back = 4 * np.arcsin(b / WATER_INDEX) - 2 * incidence
    returned = (1 - mirrored) ** 2 * mirrored
    rainbow = int(back.argmax())
    near, far = slice(0, rainbow + 1), slice(rainbow, None)
    return (
        (2 * incidence, b, mirrored, 1.0),
        (back[near], b[near], returned[near], -1.0),
        (back[far][::-1], b[far][::-1], returned[far][::-1], -1.0),
    )


def glint_offsets(camera_m: Array, lamp_m: Array, drop_m: Array, along: Array) -> tuple[Array, Array]:
    """Offsets of a lamp's images from the drop's centre along a direction, in drop radii, and their strengths.

    camera_m, lamp_m, drop_m and along (3,) in one frame; along need not be a unit vector. Returns ((IMAGES,),
    (IMAGES,)); a strength is in solid angle over the drop's radius squared, 0 where the image is not seen.
    """
    to_camera, to_lamp = _unit(camera_m - drop_m), _unit(lamp_m - drop_m)
    cosine = float(to_lamp @ to_camera)
    across = to_lamp - cosine * to_camera
    sine = float(np.linalg.norm(across))
    theta = float(np.arctan2(sine, cosine))
    sideways = float(across @ along) / sine if sine > 0 else 0.0
    low, high = max(theta - LAMP_HALF_ANGLE_RAD, 0.0), min(theta + LAMP_HALF_ANGLE_RAD, np.pi)
    offsets, strengths = np.zeros(IMAGES), np.zeros(IMAGES)
    for image, (angle, b, share, side) in enumerate(_images()):
        at, b_low, b_high = np.interp((theta, low, high), angle, b)
        offsets[image] = side * at * sideways
        spread = abs(b_high**2 - b_low**2) / 2 / (np.cos(low) - np.cos(high))
        strengths[image] = np.interp(theta, angle, share) * spread
    return offsets, strengths


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))
