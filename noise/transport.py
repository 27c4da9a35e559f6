"""The slow definition: electrons through the sensitive layer, elastic collision by elastic collision.

Single scattering (screened Rutherford) between which the energy loss fluctuates (`noise.straggling`); energy is
deposited where it is lost. Energetic delta rays are not followed: in equilibrium as many come in as go out. Electrons
born in the layer itself are left out: 2 % of the dose in 5 um at 662 keV, but 9 % in 4 um at 300 keV and 15 % in 50 um.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from noise.arrays import Array
from noise.silicon import elastic_free_path_um, screening
from noise.straggling import sample_loss_kev

STOPPED_KEV = 1.5
"""Below this an electron has 0.1 um to go: the rest is deposited on the spot."""

TABLE_KEV = np.geomspace(STOPPED_KEV / 3, 1600, 4000)
LOG_TABLE = np.log(TABLE_KEV)
FREE_PATH_UM = elastic_free_path_um(TABLE_KEV)
SCREENING = screening(TABLE_KEV)


@dataclass(frozen=True)
class Deposits:
    """Energy deposits in the layer: `track` each belongs to, `x_um`, `y_um` from its entry, `energy_kev`."""

    track: np.ndarray
    x_um: Array
    y_um: Array
    energy_kev: Array

    def per_track_kev(self, n_tracks: int) -> Array:
        """Energy that each track leaves in the layer, keV (n_tracks,)."""
        return np.bincount(self.track, self.energy_kev, minlength=n_tracks)


def transport(kinetic_kev: Array, direction: Array, thickness_um: float, *, rng: np.random.Generator) -> Deposits:
    """Deposits of electrons that enter a silicon layer at its face z = 0, until they leave it or stop.

    `kinetic_kev` (n,), `direction` (n, 3) unit vectors with z > 0 into the layer.
    """
    n = len(kinetic_kev)
    alive = np.arange(n)
    energy = np.array(kinetic_kev, dtype=float)
    place = np.zeros((n, 3))
    heading = np.array(direction, dtype=float)
    rows: list[tuple[np.ndarray, Array, Array]] = []
    while len(alive):
        free_path = np.interp(np.log(energy), LOG_TABLE, FREE_PATH_UM) * rng.standard_exponential(len(alive))
        path = np.minimum(free_path, distance_to_face_um(place[:, 2], heading[:, 2], thickness_um))
        leaves = path < free_path
        lost = np.minimum(sample_loss_kev(energy, path, rng=rng), energy)
        stops = energy - lost < STOPPED_KEV
        lost = np.where(stops & ~leaves, energy, lost)
        rows.append((alive, place[:, :2] + heading[:, :2] * path[:, None] / 2, lost))
        going = ~(leaves | stops)
        alive, energy = alive[going], (energy - lost)[going]
        place = (place + heading * path[:, None])[going]
        heading = scatter(heading[going], np.interp(np.log(energy), LOG_TABLE, SCREENING), rng=rng)
    track, xy, lost = (np.concatenate(column) for column in zip(*rows, strict=True))
    return Deposits(track, xy[:, 0], xy[:, 1], lost)


def distance_to_face_um(depth_um: Array, cosine: Array, thickness_um: float) -> Array:
    """Path to the face of the layer ahead, um; infinite for a heading parallel to it."""
    ahead = np.where(cosine > 0, thickness_um - depth_um, depth_um)
    return np.divide(ahead, np.abs(cosine), out=np.full_like(ahead, np.inf), where=cosine != 0)


def scatter(heading: Array, screening_a: Array, *, rng: np.random.Generator) -> Array:
    """Headings (n, 3) after one elastic collision each: cos = 1 - 2 A u / (1 + A - u), azimuth uniform."""
    u = rng.random(len(heading))
    loss = 2 * screening_a * u / (1 + screening_a - u)
    sine = np.sqrt(loss * (2 - loss))
    phi = rng.random(len(heading)) * 2 * np.pi
    across, up = normals(heading)
    turned = heading * (1 - loss)[:, None] + (sine * np.cos(phi))[:, None] * across + (sine * np.sin(phi))[:, None] * up
    return turned / np.linalg.norm(turned, axis=1, keepdims=True)


def normals(heading: Array) -> tuple[Array, Array]:
    """Two unit vectors (n, 3) across each heading, without a singular direction (Duff et al., JCGT 6 (2017) 1)."""
    x, y, z = heading.T
    sign = np.copysign(1.0, z)
    a = -1 / (sign + z)
    b = x * y * a
    across = np.stack([1 + sign * x * x * a, sign * b, -sign * x], axis=1)
    up = np.stack([b, sign + y * y * a, -y], axis=1)
    return across, up
