"""The lamp's foot: the patch of wall, floor or ceiling close behind a lamp, lit so brightly that it casts shadows too.

A lamp of flux P at distance d from a matt surface lights it by P d / (4 pi (s^2 + d^2)^(3/2)) at distance s from the
point right behind it: P/2 (1 - 1 / sqrt(1 + s^2 / d^2)) in all within s, so 0.553 of the half space's P/2 within 2 d.
What it reflects leaves almost from the lamp's place and is shaded by falling drops like the lamp's own light; straight
ahead it is (0.553 P rho / 2) / pi over P / (4 pi) = 1.1 rho times as strong. It is part of the bounced light
(`radiosity`) and never added to a picture; it is what drops take away from that.

Approximations: a flat Lambertian disc facing every point, of the patch's mean square radius
<s^2> = 1.235 d^2 within 2 d (of a uniform disc R^2 / 2); neither lamp nor structure hides the patch from the lamp's
light. A lamp farther than a fifth of the pedestal's radius from the surface (0.5 m in the paper's) has no foot, since
its patch is neither small nor flat; nor has one whose foot gives less than a hundredth of its own light straight ahead.
"""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from simcam.lens import FloatArray
from simcam.light import GOLDEN_ANGLE_RAD
from simcam.scene import Lamp, Pedestal
from simcam.surface import CEILING, FLOOR, WALL, MapReader, Surface

Place: TypeAlias = tuple[float, float, float]
BoolArray: TypeAlias = NDArray[np.bool_]

REACH = 2.0  # lamp distances that the patch reaches from its middle
SHARE = 1 - 1 / np.sqrt(1 + REACH**2)  # of the light that goes into the surface's half space, lands within
RADIUS = np.sqrt(2 * (np.sqrt(5) - 1))  # lamp distances: uniform disc of the same <s^2> as the patch, for REACH = 2
NEAR = 0.2  # pedestal radii within which a lamp has a foot
LEAST_LIGHT = 0.01  # of the lamp's intensity, straight ahead
SAMPLES = 256  # of the patch's reflectance


@dataclass(frozen=True)
class LampFoot:
    """A bright patch behind a lamp: its middle, the radius of its disc, the surface's normal, what it reflects."""

    position_m: Place
    radius_m: float
    normal: Place
    flux_w: float


def lamp_feet(pedestal: Pedestal, lamps: tuple[Lamp, ...], reflectance: MapReader) -> tuple[LampFoot, ...]:
    """Feet of all lamps, on every surface that one is near and bright enough on."""
    feet = []
    for lamp in lamps:
        for kind, distance_m, middle_m, normal in _surfaces_beside(pedestal, lamp):
            if distance_m > NEAR * pedestal.radius_m:
                continue
            patch, inside = _patch(pedestal, kind, middle_m, distance_m)
            flux_w = lamp.power_w / 2 * SHARE * float(np.mean(reflectance.read(patch) * inside))
            if flux_w / np.pi > LEAST_LIGHT * lamp.intensity_w_sr:
                feet.append(LampFoot(middle_m, float(RADIUS * distance_m), normal, flux_w))
    return tuple(feet)


def foot_irradiance(foot: LampFoot, points_m: FloatArray, normals: FloatArray) -> FloatArray:
    """Irradiance W/m^2 (n,) of a foot at points (3, n) with normals (3, n), nothing in between.

    Lambert's flux / pi cos cos / r^2, with r^2 + R^2 for r^2: exact on a uniform disc's axis, and finite beside it.
    """
    x, y, z = (row - np.float32(place) for place, row in zip(foot.position_m, points_m, strict=True))
    leaving = x * np.float32(foot.normal[0]) + y * np.float32(foot.normal[1]) + z * np.float32(foot.normal[2])
    landing = -(x * normals[0] + y * normals[1] + z * normals[2])
    squared = np.maximum(x * x + y * y + z * z, np.float32(1e-12))
    cosines = np.maximum(leaving, 0) * np.maximum(landing, 0) / squared
    return np.float32(foot.flux_w / np.pi) * cosines / (squared + np.float32(foot.radius_m**2))


def _surfaces_beside(pedestal: Pedestal, lamp: Lamp) -> tuple[tuple[int, float, Place, Place], ...]:
    """Kind, distance, nearest point and its normal, of wall, floor and ceiling."""
    x, y, z = lamp.position_m
    axis_m = float(np.hypot(x, y))
    out_x, out_y = (x / axis_m, y / axis_m) if axis_m > 0 else (1.0, 0.0)
    wall = (out_x * pedestal.radius_m, out_y * pedestal.radius_m, z)
    return (
        (WALL, pedestal.radius_m - axis_m, wall, (-out_x, -out_y, 0.0)),
        (FLOOR, z - pedestal.floor_z_m, (x, y, pedestal.floor_z_m), (0.0, 0.0, 1.0)),
        (CEILING, pedestal.ceiling_z_m - z, (x, y, pedestal.ceiling_z_m), (0.0, 0.0, -1.0)),
    )


def _patch(pedestal: Pedestal, kind: int, middle_m: Place, distance_m: float) -> tuple[Surface, BoolArray]:
    """A sunflower of points that stand for equal light of the lamp, and which of them lie inside the pedestal."""
    share = SHARE * (np.arange(SAMPLES) + 0.5) / SAMPLES
    away_m = distance_m * np.sqrt(1 / (1 - share) ** 2 - 1)
    right_m, up_m = (away_m * turned(GOLDEN_ANGLE_RAD * np.arange(SAMPLES)) for turned in (np.cos, np.sin))
    x, y, z = middle_m
    if kind == WALL:
        azimuth = np.arctan2(y, x) + right_m / pedestal.radius_m
        points_m = np.stack([pedestal.radius_m * np.cos(azimuth), pedestal.radius_m * np.sin(azimuth), z + up_m])
        inside = np.abs(points_m[2] - pedestal.centre_z_m) < pedestal.height_m / 2
    else:
        points_m = np.stack([x + right_m, y + up_m, np.full(SAMPLES, z)])
        inside = np.hypot(points_m[0], points_m[1]) < pedestal.radius_m
    points_m = points_m.astype(np.float32)
    nothing = np.zeros(SAMPLES, np.float32)
    return Surface(points_m, np.zeros_like(points_m), nothing, np.full(SAMPLES, kind, np.int8)), inside
