"""Electrons in silicon: stopping power, range, elastic scattering, and the charge that they free."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from noise.arrays import Array

ELECTRON_REST_KEV = 510.99895  # CODATA 2018
FINE_STRUCTURE = 1 / 137.035999  # CODATA 2018
AVOGADRO_PER_MOL = 6.02214076e23  # SI
CLASSICAL_RADIUS_CM = 2.8179403e-13  # CODATA 2018
HBAR_C_KEV_CM = 1.97326980e-8  # CODATA 2018
BOHR_RADIUS_CM = 5.29177211e-9  # CODATA 2018

ATOMIC_NUMBER = 14.0
ATOMIC_MASS_G_MOL = 28.0855  # IUPAC
DENSITY_G_CM3 = 2.33  # ICRU-37
EXCITATION_ENERGY_KEV = 0.173  # ICRU-37: mean excitation energy I of silicon
PAIR_ENERGY_KEV = 3.65e-3  # energy per electron-hole pair, 300 K
FANO_FACTOR = 0.115  # Janesick, Photon Transfer (2007), section 2.2

DENSITY_EFFECT = {"a": 0.1492, "m": 3.2546, "x0": 0.2015, "x1": 2.8716, "c": 4.4355, "delta0": 0.14}
"""Sternheimer, Berger and Seltzer, At. Data Nucl. Data Tables 30 (1984) 261: silicon."""

LOWEST_TABLE_KEV = 0.5
HIGHEST_TABLE_KEV = 1600.0


def stopping_power_mev_cm2_g(kinetic_kev: Array) -> Array:
    """Collision stopping power of silicon for electrons, MeV cm2/g (Berger and Seltzer's formula, ICRU-37 eq. 2.13).

    Any shape; meant for 1 keV to a few MeV. The radiative part (below 1 % here) leaves the sensor and is not counted.
    """
    kinetic_kev = np.asarray(kinetic_kev, dtype=float)
    tau = kinetic_kev / ELECTRON_REST_KEV
    beta2 = tau * (tau + 2) / (tau + 1) ** 2
    excitation = EXCITATION_ENERGY_KEV / ELECTRON_REST_KEV
    f_minus = 1 - beta2 + (tau**2 / 8 - (2 * tau + 1) * np.log(2)) / (tau + 1) ** 2
    bracket = np.log(tau**2 * (tau + 2) / (2 * excitation**2)) + f_minus - density_correction(tau)
    return 0.153536 * ATOMIC_NUMBER / ATOMIC_MASS_G_MOL / beta2 * bracket


def density_correction(tau: Array) -> Array:
    """Density-effect correction delta of a conductor-like medium at kinetic energy tau (in electron masses)."""
    d = DENSITY_EFFECT
    x = np.log10(np.sqrt(tau * (tau + 2)))
    core = 2 * np.log(10) * x - d["c"]
    middle = core + d["a"] * np.clip(d["x1"] - x, 0, None) ** d["m"]
    return np.where(x >= d["x0"], middle, d["delta0"] * 10 ** (2 * (x - d["x0"])))


@lru_cache(maxsize=1)
def _range_table() -> tuple[Array, Array]:
    kinetic_kev = np.geomspace(LOWEST_TABLE_KEV, HIGHEST_TABLE_KEV, 2000)
    um_per_kev = 1 / loss_kev_um(kinetic_kev)
    steps = np.diff(kinetic_kev) * (um_per_kev[1:] + um_per_kev[:-1]) / 2
    # Below the table the electron goes on for about half of T/S: 10 nm, nothing on the scale of a pixel.
    start = kinetic_kev[0] * um_per_kev[0] / 2
    return kinetic_kev, start + np.concatenate([[0.0], np.cumsum(steps)])


def loss_kev_um(kinetic_kev: Array) -> Array:
    """Mean energy loss of an electron in silicon, keV per um of path."""
    return stopping_power_mev_cm2_g(kinetic_kev) * DENSITY_G_CM3 * 0.1  # MeV/cm is 0.1 keV/um


def csda_range_um(kinetic_kev: Array) -> Array:
    """Path in silicon until rest at the mean rate of loss (continuous slowing down), um."""
    energy, path_um = _range_table()
    return np.interp(kinetic_kev, energy, path_um)


def energy_after_kev(kinetic_kev: Array, path_um: Array) -> Array:
    """Kinetic energy that the mean rate of loss leaves after a path; 0 where the range is shorter than the path."""
    energy, range_um = _range_table()
    left_um = csda_range_um(kinetic_kev) - path_um
    return np.where(left_um > 0, np.interp(left_um, range_um, energy, left=0.0), 0.0)


def screening(kinetic_kev: Array) -> Array:
    """Moliere's screening constant A of the Rutherford cross-section in 1 - cos (Bethe, Phys. Rev. 89 (1953) 1256)."""
    tau = np.asarray(kinetic_kev, dtype=float) / ELECTRON_REST_KEV
    beta2 = tau * (tau + 2) / (tau + 1) ** 2
    momentum_kev = ELECTRON_REST_KEV * np.sqrt(tau * (tau + 2))
    thomas_fermi_cm = 0.88534 * BOHR_RADIUS_CM / ATOMIC_NUMBER ** (1 / 3)
    born = (HBAR_C_KEV_CM / (2 * momentum_kev * thomas_fermi_cm)) ** 2
    return born * (1.13 + 3.76 * (FINE_STRUCTURE * ATOMIC_NUMBER) ** 2 / beta2)


def elastic_free_path_um(kinetic_kev: Array) -> Array:
    """Mean path between elastic collisions, um: screened Rutherford with Z(Z+1) for the atomic electrons."""
    tau = np.asarray(kinetic_kev, dtype=float) / ELECTRON_REST_KEV
    beta2 = tau * (tau + 2) / (tau + 1) ** 2
    momentum2 = tau * (tau + 2)
    a = screening(kinetic_kev)
    rutherford_cm2 = ATOMIC_NUMBER * (ATOMIC_NUMBER + 1) * CLASSICAL_RADIUS_CM**2 / (momentum2 * beta2)
    cross_section_cm2 = np.pi * rutherford_cm2 / (a * (1 + a))
    atoms_cm3 = AVOGADRO_PER_MOL * DENSITY_G_CM3 / ATOMIC_MASS_G_MOL
    return 1e4 / (atoms_cm3 * cross_section_cm2)


def transport_free_path_um(kinetic_kev: Array) -> Array:
    """Path over which elastic scattering turns an electron around (mean cosine e^-1), um."""
    a = screening(kinetic_kev)
    mean_one_minus_cos = 2 * a * ((1 + a) * np.log1p(1 / a) - 1)
    return elastic_free_path_um(kinetic_kev) / mean_one_minus_cos
