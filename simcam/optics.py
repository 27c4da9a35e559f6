"""What a drop of water does with light: a dielectric sphere in geometrical optics, three paths through it.

A ray that meets the sphere at impact parameter b (in radii) has angle of incidence i = asin(b) and of refraction
t = asin(b / n). Order 0 is reflected outside, order 1 passes straight through, order 2 is reflected once inside.
Source: van de Hulst, "Light Scattering by Small Particles", ch. 12. Higher orders carry under 1 % of the light.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from simcam.lens import FloatArray

WATER_INDEX = 1.333  # visible light, 20 C
ORDERS = (0, 1, 2)
BRANCH_POINTS = 2001  # of b in the tables of glints


@dataclass(frozen=True)
class Path:
    """One order of light at impact parameters b: share of the light, turn of the ray and where it leaves the sphere.

    The plane is spanned by the ray's direction k and the outward direction e of its entry point: the ray leaves along
    k cos(turn) + e sin(turn), from the point r (k along + e across).
    """

    share: FloatArray
    turn_rad: FloatArray
    along: FloatArray
    across: FloatArray


def fresnel_reflectance(incidence_rad: FloatArray) -> FloatArray:
    """Share of unpolarised light that water reflects (Hecht, Optics, 4.6); the same from inside."""
    refraction_rad = np.arcsin(np.sin(incidence_rad) / WATER_INDEX)
    cos_i, cos_t = np.cos(incidence_rad), np.cos(refraction_rad)
    across = (cos_i - WATER_INDEX * cos_t) / (cos_i + WATER_INDEX * cos_t)
    along = (WATER_INDEX * cos_i - cos_t) / (WATER_INDEX * cos_i + cos_t)
    return (across**2 + along**2) / 2


def path_through_drop(impact: FloatArray, order: int) -> Path:
    """The order's path of rays at impact parameters 0 <= b < 1."""
    incidence, refraction = np.arcsin(impact), np.arcsin(np.asarray(impact) / WATER_INDEX)
    reflected = fresnel_reflectance(incidence)
    if order == 0:
        return Path(reflected, np.pi - 2 * incidence, -np.cos(incidence), np.sin(incidence))
    transmitted = (1 - reflected) ** 2
    if order == 1:
        leaves = 2 * refraction - incidence
        return Path(transmitted, -2 * (incidence - refraction), np.cos(leaves), np.sin(leaves))
    leaves = incidence - 4 * refraction
    turn = -(np.pi + 2 * incidence - 4 * refraction)
    return Path(transmitted * reflected, turn, -np.cos(leaves), np.sin(leaves))


@dataclass(frozen=True)
class Branch:
    """Part of an order on which the scattering angle (0 forward, pi back) is monotonic in b, ordered by that angle.

    `side` is +1 where the glint lies on the lamp's side of the disc as seen along the ray, else -1.
    """

    order: int
    angle_rad: FloatArray
    impact: FloatArray
    share: FloatArray
    side: float


@lru_cache(maxsize=1)
def glint_branches() -> tuple[Branch, ...]:
    """Branches of the three orders: 0 reflects to every angle; 2 has two, that meet at the rainbow (138 degrees)."""
    impact = np.sin(np.linspace(0, np.pi / 2, BRANCH_POINTS) * 0.9999)
    rainbow = int(np.argmin(np.abs(path_through_drop(impact, 2).turn_rad)))
    return (
        _branch(0, impact),
        _branch(1, impact),
        _branch(2, impact[: rainbow + 1]),
        _branch(2, impact[rainbow:]),
    )


def _branch(order: int, impact: FloatArray) -> Branch:
    path = path_through_drop(impact, order)
    angle = np.abs(path.turn_rad)
    ordered = np.argsort(angle)
    side = 1.0 if order == 0 else -1.0  # refraction bends towards the axis and beyond it
    return Branch(order, angle[ordered], impact[ordered], path.share[ordered], side)


def glint(branch: Branch, angle_rad: FloatArray, lamp_half_angle_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Impact parameter (n,) of the lamp's image and its strength (n,), d(sigma)/d(Omega) / r^2 with the Fresnel share.

    Averaged over the lamp's angular radius, which keeps the rainbow finite; strength 0 where the branch has no image.
    Without losses the strength of a branch is b db / (sin(angle) d(angle)).
    """
    low = np.maximum(angle_rad - lamp_half_angle_rad, 0)
    high = np.minimum(angle_rad + lamp_half_angle_rad, np.pi)
    impact_low = np.interp(low, branch.angle_rad, branch.impact)
    impact_high = np.interp(high, branch.angle_rad, branch.impact)
    strength = np.abs(impact_high**2 - impact_low**2) / 2 / (np.cos(low) - np.cos(high))
    impact = np.interp(angle_rad, branch.angle_rad, branch.impact)
    share = np.interp(angle_rad, branch.angle_rad, branch.share)
    return impact, strength * share
