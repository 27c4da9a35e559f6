"""What a drop shows at places along its path: light on a disc of samples, and the glints of the lamps.

The disc is cut in strips along the image's rows, each with the same number of samples. Refracted and reflected rays
look up the static scene; the lamps themselves are left to the glints, which are too small and bright for samples.
"""

from dataclasses import dataclass

import numpy as np

from simcam.lens import FloatArray
from simcam.light import lamp_visibility
from simcam.optics import ORDERS, Branch, glint, glint_branches, path_through_drop
from simcam.path import DropPath
from simcam.penumbra import blocked_share
from simcam.static import LitScene
from simcam.surface import Surface

SAMPLES_ACROSS = 24  # of a strip; with 24 strips the disc's light is right to 0.6 %: the wall by a lamp is a hot spot
GLINT_LAMP_SAMPLES = 8  # of a lamp's visibility from the drop


@dataclass(frozen=True)
class Disc:
    """Samples of the unit disc in strips: middle (strips,) down, half_width (strips,), height of every strip."""

    middle: FloatArray
    half_width: FloatArray
    height: float

    @property
    def samples(self) -> tuple[FloatArray, FloatArray]:
        """Places right and down (strips, across) of the samples, all within the disc."""
        across = (np.arange(SAMPLES_ACROSS) + 0.5) / SAMPLES_ACROSS * 2 - 1
        right = self.half_width[:, None] * across
        return right, np.broadcast_to(self.middle[:, None], right.shape)


def disc_strips(strips: int) -> Disc:
    """Strips of equal height whose widths give each its exact share of the disc's area."""
    edges = np.linspace(-1, 1, strips + 1)
    primitive = edges * np.sqrt(1 - edges**2) + np.arcsin(edges)  # integral of the chord
    height = 2 / strips
    return Disc((edges[1:] + edges[:-1]) / 2, np.diff(primitive) / height / 2, height)


@dataclass(frozen=True)
class Glints:
    """Images of lamps in a drop, per place on the path and image: right, down in radii, half_width in radii, strength.

    Arrays (places, images). Strength is radiance times area of the unit disc, W m^-2 sr^-1.
    """

    right: FloatArray
    down: FloatArray
    half_width: FloatArray
    strength: FloatArray


def disc_radiance(lit: LitScene, path: DropPath, drop_radius_m: float, disc: Disc) -> FloatArray:
    """Radiance W m^-2 sr^-1 (places, strips, across) that reaches the camera from the samples of the disc.

    The sum over three paths (optics) of their share times the radiance of the static surface where they end, with the
    drop's own shadow on it.
    """
    right, down = (place.ravel() for place in disc.samples)
    impact = np.minimum(np.hypot(right, down), 0.9999)
    outward = (right[:, None] * path.right[:, None, :] + down[:, None] * path.down[:, None, :]) / np.maximum(
        np.hypot(right, down), 1e-9
    )[:, None]
    sight = path.sight[:, None, :]
    total = np.zeros(outward.shape[:2], np.float32)
    for order in ORDERS:
        ray = path_through_drop(impact, order)
        direction = np.cos(ray.turn_rad)[:, None] * sight + np.sin(ray.turn_rad)[:, None] * outward
        leaves = ray.along[:, None] * sight + ray.across[:, None] * outward
        origin_m = path.centre_m[:, None, :] + drop_radius_m * leaves
        seen = _looked_up(lit, origin_m, direction, path.centre_m, drop_radius_m)
        total += ray.share.astype(np.float32) * seen
    return total.reshape(len(total), len(disc.middle), SAMPLES_ACROSS)


def _looked_up(
    lit: LitScene, origin_m: FloatArray, direction: FloatArray, centre_m: FloatArray, drop_radius_m: float
) -> FloatArray:
    """Static radiance (places, samples) along rays (places, samples, 3), darkened by the drop's own shadow."""
    shape = direction.shape[:2]
    surface = lit.look(_rows(origin_m), _rows(direction))
    leaving = lit.leaving(surface, 1)
    radiance = leaving.total
    drops_m = np.repeat(centre_m, shape[1], axis=0)
    for source, light in zip(lit.sources, leaving.by_source, strict=True):
        radiance -= light * own_shadow(surface, np.asarray(source.position_m), source.radius_m, drops_m, drop_radius_m)
    return radiance.reshape(shape)


def own_shadow(
    surface: Surface, lamp_m: FloatArray, lamp_radius_m: float, drops_m: FloatArray, drop_radius_m: float
) -> FloatArray:
    """Share (n,) of the lamp that the drop itself hides from the points (3, n) that are seen through it.

    Evaluated where the segment to the lamp passes the drop by less than both radii; elsewhere 0.
    """
    points_m = surface.points_m
    to_lamp = lamp_m.astype(np.float32)[:, None] - points_m
    to_drop = drops_m.T.astype(np.float32) - points_m
    lamp_squared, across, drop_squared = (
        np.einsum("kn,kn->n", one, other) for one, other in ((to_lamp, to_lamp), (to_drop, to_lamp), (to_drop, to_drop))
    )
    along = across / lamp_squared
    miss = drop_squared - along * across
    near = np.flatnonzero((miss < (lamp_radius_m * along + drop_radius_m) ** 2) & (along > 0) & (along < 1))
    share = np.zeros(points_m.shape[1], np.float32)
    if near.size:
        seen_m = points_m[:, near].T.astype(float)
        share[near] = blocked_share(seen_m, lamp_m, lamp_radius_m, drops_m[near], drop_radius_m)
    return share


def drop_glints(lit: LitScene, path: DropPath) -> Glints:
    """Every lamp's images by the three orders, in closed form, dimmed where structure hides the lamp from the drop."""
    images = [
        (
            *_glint(path, np.asarray(lamp.position_m), lamp.radius_m, branch),
            _lamp_seen(lit, lamp_index, path) * lamp.intensity_w_sr,
        )
        for lamp_index, lamp in enumerate(lit.lamps)
        for branch in glint_branches()
    ]
    if not images:
        return no_glints(len(path.fall_s))
    right, down, half_width, gain, intensity = (np.stack(column, axis=1) for column in zip(*images, strict=True))
    return Glints(right, down, half_width, gain * intensity)


def no_glints(places: int) -> Glints:
    """Glints of no lamp."""
    none = np.zeros((places, 0))
    return Glints(none, none, none, none)


def _glint(path: DropPath, lamp_m: FloatArray, lamp_radius_m: float, branch: Branch) -> tuple[FloatArray, ...]:
    """Place right, down and half width in radii, and gain: W m^-2 sr^-1 of unit-disc area per W/sr of the lamp."""
    to_lamp = lamp_m - path.centre_m
    distance_m = np.linalg.norm(to_lamp, axis=1)
    to_lamp /= distance_m[:, None]
    angle = np.arccos(np.clip(np.sum(to_lamp * path.sight, axis=1), -1, 1))
    half_angle = np.arcsin(np.minimum(lamp_radius_m / distance_m, 1))
    impact, strength = glint(branch, angle, half_angle)
    right, down = np.sum(to_lamp * path.right, axis=1), np.sum(to_lamp * path.down, axis=1)
    across = np.maximum(np.hypot(right, down), 1e-12)
    low, _ = glint(branch, np.maximum(angle - half_angle, 0), half_angle)
    high, _ = glint(branch, np.minimum(angle + half_angle, np.pi), half_angle)
    place = branch.side * impact / across
    return place * right, place * down, np.abs(high - low) / 2, strength / distance_m**2


def _lamp_seen(lit: LitScene, lamp_index: int, path: DropPath) -> FloatArray:
    """Share (places,) of the lamp that the drop's centre sees past structure."""
    points = path.centre_m.T.astype(np.float32)
    nothing = np.zeros(points.shape[1], np.float32)
    here = Surface(points, np.zeros_like(points), nothing, nothing.astype(np.int8))
    return lamp_visibility(lit.lamps[lamp_index], here, lit.obstacles, GLINT_LAMP_SAMPLES)


def _rows(vectors: FloatArray) -> FloatArray:
    """Vectors (..., 3) as contiguous rows (3, n) float32."""
    return np.ascontiguousarray(vectors.reshape(-1, 3).T, np.float32)
