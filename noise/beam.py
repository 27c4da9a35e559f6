"""Directions of the electrons that cross a sensor: cosine law in an isotropic field, forward-peaked in a beam."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from noise.arrays import Array
from noise.compton import GRID, crossing_electrons, edge_kev, recoil_angle_cos, recoil_spectrum_b_kev
from noise.silicon import loss_kev_um, transport_free_path_um
from noise.streams import Stream, rng_for
from noise.transport import normals

Direction = tuple[float, float, float]

SMALLEST_COSINE = 1e-4
"""An electron nearer to the plane of the sensor than this is taken at this angle: 1 in 10^8 of an isotropic field."""

MEAN_COSINE_SAMPLES = 2**17
"""Electrons behind the mean cosine of a beam: 0.2 % of it."""

POOL = 8
"""Electrons of a beam's fluence drawn for each one that crosses the sensor."""


@lru_cache(maxsize=32)
def mean_crossing_cosine(photon_kev: float, direction: Direction | None) -> float:
    """Mean |cosine| to the sensor's normal over the electrons' fluence: 1/2 in an isotropic field."""
    if direction is None:
        return 0.5
    rng = rng_for(0, Stream.EXPECTATION)
    _, heading = beam_fluence(photon_kev, direction, MEAN_COSINE_SAMPLES, rng=rng)
    return float(np.mean(np.abs(heading[:, 2])))


def crossing(
    photon_kev: float, direction: Direction | None, n: int, *, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Energies (n,) and headings (n, 3; z > 0 into the sensor) of n electrons that enter it, in a fair order."""
    if direction is None:
        return isotropic_crossing(photon_kev, n, rng=rng)
    return beam_crossing(photon_kev, direction, n, rng=rng)


def isotropic_crossing(photon_kev: float, n: int, *, rng: np.random.Generator) -> tuple[Array, Array]:
    """Energies (n,) and headings (n, 3) of electrons that enter a plane of an isotropic field: cos = sqrt(uniform).

    Energy, squared cosine and azimuth are stratified: each fills its distribution evenly.
    """
    cosine = np.maximum(np.sqrt(strata(n, rng=rng)), SMALLEST_COSINE)
    azimuth = 2 * np.pi * strata(n, rng=rng)
    sine = np.sqrt(1 - cosine**2)
    heading = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], axis=1)
    return crossing_electrons(photon_kev).quantile_kev(strata(n, rng=rng)), heading


def beam_crossing(photon_kev: float, direction: Direction, n: int, *, rng: np.random.Generator) -> tuple[Array, Array]:
    """Energies (n,) and headings (n, 3) of electrons that enter a sensor in a beam, from either face.

    Those of the fluence are taken in proportion to their |cosine|; one from behind is mirrored, which leaves its mark
    on the image as it is.
    """
    kinetic_kev, heading = beam_fluence(photon_kev, direction, POOL * n, rng=rng)
    heading[:, 2] = np.maximum(np.abs(heading[:, 2]), SMALLEST_COSINE)
    edges = np.cumsum(heading[:, 2])
    taken = rng.permutation(np.searchsorted(edges, (np.arange(n) + rng.random(n)) / n * edges[-1]))
    return kinetic_kev[taken], heading[taken] / np.linalg.norm(heading[taken], axis=1, keepdims=True)


def beam_fluence(photon_kev: float, direction: Direction, n: int, *, rng: np.random.Generator) -> tuple[Array, Array]:
    """Energies (n,) and headings (n, 3) of the electron fluence of a beam in equilibrium.

    An electron now at T was born at T0 > T with the Klein-Nishina spectrum and angle, and multiple scattering on the
    way has turned it: mean cosine exp(-path / transport mean free path), drawn as the Fisher distribution of that mean
    (Lewis, Phys. Rev. 78 (1950) 526, for the mean; Roberts and Ursell, Phil. Trans. A 252 (1960) 317, for the shape).
    """
    kinetic_kev = crossing_electrons(photon_kev).quantile_kev(strata(n, rng=rng))
    born_kev = birth_energy_kev(kinetic_kev, photon_kev, rng=rng)
    beam = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    start = turned(np.tile(beam, (n, 1)), recoil_angle_cos(born_kev, photon_kev), rng=rng)
    mean_cosine = np.exp(turning_depth(kinetic_kev, photon_kev) - turning_depth(born_kev, photon_kev))
    return kinetic_kev, turned(start, fisher_cosine(mean_cosine, rng=rng), rng=rng)


def birth_energy_kev(kinetic_kev: Array, photon_kev: float, *, rng: np.random.Generator) -> Array:
    """Recoil energy at birth of electrons that are at T now: the recoil spectrum above T."""
    grid = np.linspace(0, edge_kev(photon_kev), GRID)
    spectrum = recoil_spectrum_b_kev(grid, photon_kev)
    below = np.concatenate([[0.0], np.cumsum((spectrum[1:] + spectrum[:-1]) / 2)])
    at_t = np.interp(kinetic_kev, grid, below)
    return np.interp(at_t + rng.random(len(at_t)) * (below[-1] - at_t), below, grid)


def turning_depth(kinetic_kev: Array, photon_kev: float) -> Array:
    """Path per transport mean free path, summed while slowing down from 1 keV's side up to T: its difference counts."""
    grid = np.linspace(1.0, edge_kev(photon_kev), GRID)
    turning = 1 / (loss_kev_um(grid) * transport_free_path_um(grid))
    total = np.concatenate([[0.0], np.cumsum((turning[1:] + turning[:-1]) / 2)]) * (grid[1] - grid[0])
    return np.interp(kinetic_kev, grid, total)


def fisher_cosine(mean_cosine: Array, *, rng: np.random.Generator) -> Array:
    """Cosines drawn from Fisher distributions of given means: coth(k) - 1/k = mean (Mardia and Jupp (2000), 9.3.2)."""
    k = np.geomspace(1e-3, 1e5, 2000)
    concentration = np.interp(mean_cosine, 1 / np.tanh(k) - 1 / k, k)
    u = rng.random(len(concentration))
    return 1 + np.log(u + (1 - u) * np.exp(-2 * concentration)) / concentration


def turned(heading: Array, cosine: Array, *, rng: np.random.Generator) -> Array:
    """Headings (n, 3) turned by angles of given cosines, to any side."""
    across, up = normals(heading)
    phi = 2 * np.pi * rng.random(len(heading))
    sine = np.sqrt(np.clip(1 - cosine**2, 0, None))
    side = np.cos(phi)[:, None] * across + np.sin(phi)[:, None] * up
    return heading * cosine[:, None] + sine[:, None] * side


def strata(n: int, *, rng: np.random.Generator) -> Array:
    """One uniform number from each of n equal parts of (0, 1), shuffled (n,)."""
    return (rng.permutation(n) + rng.random(n)) / n
