"""Fluctuation of the energy loss in thin silicon: collisions with two atomic levels and a 1/E^2 ionisation tail."""

from __future__ import annotations

import numpy as np

from noise.arrays import Array
from noise.silicon import ATOMIC_NUMBER, ELECTRON_REST_KEV, EXCITATION_ENERGY_KEV, loss_kev_um

IONISATION_SHARE = 0.55  # share of the mean loss that goes through the 1/E^2 tail
LOWEST_IONISATION_KEV = 0.010
INNER_LEVEL_KEV = 0.010 * ATOMIC_NUMBER**2
INNER_STRENGTH = 2 / ATOMIC_NUMBER
OUTER_STRENGTH = 1 - INNER_STRENGTH
OUTER_LEVEL_KEV = (EXCITATION_ENERGY_KEV / INNER_LEVEL_KEV**INNER_STRENGTH) ** (1 / OUTER_STRENGTH)
"""Urban's parameters: oscillator strengths f1 + f2 = 1, f1 ln E1 + f2 ln E2 = ln I.

Lassila-Perini and Urban, Nucl. Instrum. Methods A 362 (1995) 416.
"""


def collision_rates_per_um(kinetic_kev: Array) -> tuple[Array, Array, Array]:
    """Collisions per um with the outer level, with the inner level, and in the ionisation tail.

    Their mean losses add up to the stopping power at any energy.
    """
    tau = kinetic_kev / ELECTRON_REST_KEV
    beta2 = tau * (tau + 2) / (tau + 1) ** 2
    loss = loss_kev_um(kinetic_kev)
    excited = loss * (1 - IONISATION_SHARE)
    at_i = np.log(2 * ELECTRON_REST_KEV * tau * (tau + 2) / EXCITATION_ENERGY_KEV) - beta2
    at_inner = np.log(2 * ELECTRON_REST_KEV * tau * (tau + 2) / INNER_LEVEL_KEV) - beta2
    inner_loss = excited * INNER_STRENGTH * np.clip(at_inner / at_i, 0, None)
    outer_loss = excited - inner_loss
    largest = largest_transfer_kev(kinetic_kev)
    mean_tail_kev = np.log(largest / LOWEST_IONISATION_KEV) / (1 / LOWEST_IONISATION_KEV - 1 / largest)
    return outer_loss / OUTER_LEVEL_KEV, inner_loss / INNER_LEVEL_KEV, loss * IONISATION_SHARE / mean_tail_kev


def largest_transfer_kev(kinetic_kev: Array) -> Array:
    """Half the kinetic energy: of two electrons the faster one is the projectile (Moller)."""
    return np.maximum(kinetic_kev / 2, 2 * LOWEST_IONISATION_KEV)


def sample_loss_kev(kinetic_kev: Array, path_um: Array, *, rng: np.random.Generator) -> Array:
    """Energy lost on short paths (n,), keV: a compound Poisson sum, so a path may be cut in any number of pieces."""
    outer, inner, tail = collision_rates_per_um(kinetic_kev)
    total = outer + inner + tail
    number = rng.poisson(total * path_um)
    owner = np.repeat(np.arange(len(number)), number)
    pick = rng.random(len(owner)) * total[owner]
    in_tail = pick < tail[owner]
    lost = np.where(pick < (tail + inner)[owner], INNER_LEVEL_KEV, OUTER_LEVEL_KEV)
    largest = largest_transfer_kev(kinetic_kev)[owner[in_tail]]
    u = rng.random(len(largest))
    # Inverse of the cumulative 1/E^2 law between the two ends.
    lost[in_tail] = 1 / (1 / LOWEST_IONISATION_KEV - u * (1 / LOWEST_IONISATION_KEV - 1 / largest))
    return np.bincount(owner, lost, minlength=len(number))
