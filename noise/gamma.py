"""A gamma field, and what it does to a sensor in closed form: how many tracks, how long, how much energy."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from noise.arrays import Array
from noise.beam import mean_crossing_cosine
from noise.compton import crossing_electrons
from noise.silicon import DENSITY_G_CM3, PAIR_ENERGY_KEV, loss_kev_um

CS137_KEV = 661.7
CO60_MEAN_KEV = 1252.9  # mean of its two lines, 1173.2 and 1332.5 keV

LOWEST_PHOTON_KEV = 300.0  # below, the photoelectric effect in silicon matters
HIGHEST_PHOTON_KEV = 1500.0  # above, pair production begins to

KEV_PER_G_GY = 6.2415e12  # 1 Gy = 1 J/kg
SECONDS_PER_HOUR = 3600.0

Level = Literal["salt", "tracks", "transport"]


@dataclass(frozen=True)
class GammaField:
    """Gamma radiation at the sensor: air kerma rate (Gy/h, constant or of t in seconds), photon energy, direction.

    `direction` None is the isotropic field; (x, y, z) is a beam's direction of flight in camera axes (x right, y down,
    z into the sensor). `level` is how hits are drawn: "tracks" (bank of tracks), "transport" (its slow definition),
    "salt" (white single pixels, the baseline that others use). ValueError outside 300-1500 keV, where effects that are
    not modelled begin.
    """

    dose_rate_gy_h: float | Callable[[float], float] = 10.0
    photon_energy_kev: float = CS137_KEV
    direction: tuple[float, float, float] | None = None
    level: Level = "tracks"

    def __post_init__(self) -> None:
        """Refuse what the physics does not cover."""
        if not callable(self.dose_rate_gy_h):
            checked_dose_rate(self.dose_rate_gy_h)
        if not LOWEST_PHOTON_KEV <= self.photon_energy_kev <= HIGHEST_PHOTON_KEV:
            raise ValueError(f"GammaField: photon_energy_kev must be 300 to 1500, got {self.photon_energy_kev}")
        if self.direction is not None and not (len(self.direction) == 3 and 0 < math.hypot(*self.direction) < math.inf):
            raise ValueError(f"GammaField: direction must be a vector (x, y, z) that is not 0, got {self.direction}")
        if self.level not in ("salt", "tracks", "transport"):
            raise ValueError(f"GammaField: level must be salt, tracks or transport, got {self.level!r}")

    def dose_rate_at(self, t_s: float) -> float:
        """Dose rate at a time, Gy/h."""
        if callable(self.dose_rate_gy_h):
            return checked_dose_rate(self.dose_rate_gy_h(t_s))
        return self.dose_rate_gy_h


def checked_dose_rate(dose_rate_gy_h: float) -> float:
    """The rate itself, or ValueError where it is negative or not a finite number."""
    if not (math.isfinite(dose_rate_gy_h) and dose_rate_gy_h >= 0):
        raise ValueError(f"GammaField: dose_rate_gy_h must be >= 0 and finite, got {dose_rate_gy_h}")
    return float(dose_rate_gy_h)


def tracks_per_cm2_gy(field: GammaField) -> float:
    """Electrons that enter a thin layer per cm2 and Gy: fluence D <R> / <T>, times the mean cosine of crossing.

    1.129e9 at 662 keV isotropic (mean cosine 1/2), whatever the layer's thickness. Attix (1986), section 8.2.2.
    """
    electrons = crossing_electrons(field.photon_energy_kev)
    range_g_cm2 = electrons.mean_range_um * 1e-4 * DENSITY_G_CM3
    return (
        KEV_PER_G_GY
        * range_g_cm2
        / electrons.mean_recoil_kev
        * mean_crossing_cosine(field.photon_energy_kev, field.direction)
    )


def expected_tracks(
    field: GammaField, pitch_um: float, shape: tuple[int, int], *, exposure_s: float, t_s: float = 0.0
) -> float:
    """Mean number of tracks that enter a sensor of (height, width) pixels in one exposure: 12 200 at H, 960 x 540."""
    area_cm2 = shape[0] * shape[1] * (pitch_um * 1e-4) ** 2
    dose_gy = field.dose_rate_at(t_s) * exposure_s / SECONDS_PER_HOUR
    return tracks_per_cm2_gy(field) * area_cm2 * dose_gy


def expected_deposit_kev(
    field: GammaField, pitch_um: float, thickness_um: float, *, exposure_s: float, t_s: float = 0.0
) -> float:
    """Mean energy left in one pixel by one exposure, keV: dose times mass (dose conservation), 0.151 at H."""
    dose_gy = field.dose_rate_at(t_s) * exposure_s / SECONDS_PER_HOUR
    mass_g = DENSITY_G_CM3 * (pitch_um * 1e-4) ** 2 * thickness_um * 1e-4
    return KEV_PER_G_GY * dose_gy * mass_g


def track_length_survival(length_um: Array, thickness_um: float) -> Array:
    """Share of the tracks of an isotropic field whose chord is laterally longer: 1 / (1 + (r/t)^2).

    From the cosine law of directions: length r = t tan(theta), and cos^2(theta) is uniform.
    """
    return 1 / (1 + (np.asarray(length_um, dtype=float) / thickness_um) ** 2)


def mean_pixels_per_track(pitch_um: float, thickness_um: float) -> float:
    """Mean number of pixels that a straight track of an isotropic field crosses: 1 + 2 t / p."""
    return 1 + 2 * thickness_um / pitch_um


def normal_incidence_charge_e(field: GammaField, thickness_um: float) -> float:
    """Mean electrons of a straight track across the layer at its energy's stopping power, cut at the range: 853 e-."""
    electrons = crossing_electrons(field.photon_energy_kev)
    energy = electrons.energy_kev
    deposit_kev = np.minimum(loss_kev_um(energy) * thickness_um, energy)
    return electrons.mean_over(deposit_kev) / PAIR_ENERGY_KEV
