"""Compton scattering: the recoil electrons of a gamma ray, and the electrons that they are while slowing down."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from noise.arrays import Array
from noise.silicon import CLASSICAL_RADIUS_CM, ELECTRON_REST_KEV, csda_range_um, loss_kev_um

GRID = 4000
"""Points of the energy grid: the quantiles of the spectra are exact to 0.1 keV."""

LOWEST_KEV = 1.0


def edge_kev(photon_kev: float) -> float:
    """Largest recoil energy, of a photon scattered straight back: 477.33 keV at 661.7 keV."""
    return 2 * photon_kev**2 / (ELECTRON_REST_KEV + 2 * photon_kev)


def recoil_spectrum_b_kev(recoil_kev: Array, photon_kev: float) -> Array:
    """Klein-Nishina cross-section per recoil energy, barn per keV and electron; 0 above the edge.

    Evans, The Atomic Nucleus (1955), chapter 23, eq. 5.2.
    """
    alpha = photon_kev / ELECTRON_REST_KEV
    s = np.clip(np.asarray(recoil_kev, dtype=float), 0, edge_kev(photon_kev)) / photon_kev
    shape = 2 + s**2 / (alpha**2 * (1 - s) ** 2) + s / (1 - s) * (s - 2 / alpha)
    value = np.pi * CLASSICAL_RADIUS_CM**2 * 1e24 / (alpha**2 * ELECTRON_REST_KEV) * shape
    return np.where(recoil_kev <= edge_kev(photon_kev), value, 0.0)


def cross_section_b(photon_kev: float) -> float:
    """Total Klein-Nishina cross-section per electron, barn: 0.25620 at 661.7 keV."""
    recoil = np.linspace(0, edge_kev(photon_kev), GRID)
    return float(np.trapezoid(recoil_spectrum_b_kev(recoil, photon_kev), recoil))


def recoil_angle_cos(recoil_kev: Array, photon_kev: float) -> Array:
    """Cosine of the angle between the photon and its recoil electron: 1 at the edge, 0 at zero energy."""
    recoil_kev = np.asarray(recoil_kev, dtype=float)
    momentum = np.sqrt(recoil_kev * (recoil_kev + 2 * ELECTRON_REST_KEV))
    forward = recoil_kev * (photon_kev + ELECTRON_REST_KEV) / photon_kev
    return np.divide(forward, momentum, out=np.zeros_like(momentum), where=momentum > 0)


@dataclass(frozen=True)
class CrossingElectrons:
    """Electrons in equilibrium with a gamma field: `energy_kev` grid, cumulative spectrum, and two means."""

    energy_kev: Array
    cumulative: Array
    mean_recoil_kev: float
    mean_range_um: float

    def quantile_kev(self, probability: Array) -> Array:
        """Energy below which that share of the crossing electrons is."""
        return np.interp(probability, self.cumulative, self.energy_kev)

    def mean_over(self, values: Array) -> float:
        """Mean over the crossing electrons of a quantity given on `energy_kev`."""
        weights = np.diff(self.cumulative)
        return float(np.sum(weights * (values[1:] + values[:-1]) / 2))


@lru_cache(maxsize=32)
def crossing_electrons(photon_kev: float) -> CrossingElectrons:
    """Slowing-down spectrum phi(T) ~ 1/S(T) * (recoils born above T): what crosses any plane in equilibrium.

    Continuous slowing down without escape (Attix, Radiological Physics and Dosimetry (1986), section 8.2.2).
    """
    energy = np.linspace(LOWEST_KEV, edge_kev(photon_kev), GRID)
    born = recoil_spectrum_b_kev(energy, photon_kev)
    step = energy[1] - energy[0]
    above = np.concatenate([np.cumsum(((born[1:] + born[:-1]) / 2)[::-1])[::-1], [0.0]]) * step
    flux = above / loss_kev_um(energy)
    cumulative = np.concatenate([[0.0], np.cumsum((flux[1:] + flux[:-1]) / 2)])
    recoil = np.linspace(0, edge_kev(photon_kev), GRID)
    born = recoil_spectrum_b_kev(recoil, photon_kev)
    return CrossingElectrons(
        energy_kev=energy,
        cumulative=cumulative / cumulative[-1],
        mean_recoil_kev=float(np.trapezoid(recoil * born, recoil) / np.trapezoid(born, recoil)),
        mean_range_um=float(np.trapezoid(csda_range_um(recoil) * born, recoil) / np.trapezoid(born, recoil)),
    )
