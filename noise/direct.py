"""The definition of a noisy frame's hits: every electron transported for itself, every deposit diffused exactly."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from noise.arrays import Array
from noise.bank import BankKey, electrons_of
from noise.beam import crossing
from noise.hits import GammaHits
from noise.sensor import Sensor
from noise.transport import transport

MARGIN_PER_THICKNESS = 20.0
MARGIN_UM = 30.0
"""Tracks that enter so far outside the image are followed too: 1 in 10 000 of a 5 um layer goes 130 um sideways."""

DEPOSITS_AT_A_TIME = 100_000


def direct_hits(
    per_pixel: float, charge_e: Array, key: BankKey, sensor: Sensor, *, rng: np.random.Generator
) -> GammaHits:
    """Add the electrons of one exposure to an image (height, width), in place; its tracks, as of frame 0.

    Tracks are a Poisson process of `per_pixel` mean entries, over the image and a margin around it: the table has
    those outside as well.
    """
    height, width = charge_e.shape
    margin = (MARGIN_PER_THICKNESS * key.thickness_um + MARGIN_UM) / sensor.pitch_um
    n = int(rng.poisson(per_pixel * (height + 2 * margin) * (width + 2 * margin)))
    x_px = rng.random(n) * (width + 2 * margin) - margin - 0.5
    y_px = rng.random(n) * (height + 2 * margin) - margin - 0.5
    kinetic_kev, heading = crossing(key.photon_energy_kev, key.direction, n, rng=rng)
    deposits = transport(kinetic_kev, heading, key.thickness_um, rng=rng)
    electrons = electrons_of(deposits.energy_kev, rng=rng)
    collect(
        charge_e,
        x_px[deposits.track] + deposits.x_um / sensor.pitch_um,
        y_px[deposits.track] + deposits.y_um / sensor.pitch_um,
        electrons,
        sensor.charge_diffusion_um / sensor.pitch_um,
    )
    return GammaHits(
        frame=np.zeros(n, dtype=np.int32),
        x_px=x_px,
        y_px=y_px,
        length_px=key.thickness_um * np.hypot(heading[:, 0], heading[:, 1]) / heading[:, 2] / sensor.pitch_um,
        azimuth_rad=np.arctan2(heading[:, 1], heading[:, 0]),
        deposit_kev=deposits.per_track_kev(n),
        charge_e=np.bincount(deposits.track, electrons, minlength=n),
    )


def collect(image_e: Array, x_px: Array, y_px: Array, charge_e: Array, sigma_px: float) -> None:
    """Add point charges, diffused by a Gauss of `sigma_px`, to the pixels of an image, in place.

    A pixel gets the integral of the Gauss over its square; what falls outside the image is lost.
    """
    height, width = image_e.shape
    reach = int(np.ceil(4 * sigma_px)) + 1
    near = (x_px > -reach - 1) & (x_px < width + reach) & (y_px > -reach - 1) & (y_px < height + reach)
    rows = np.flatnonzero(near)
    offset = np.arange(-reach, reach + 1)
    for part in np.array_split(rows, len(rows) // DEPOSITS_AT_A_TIME + 1):
        column, across = pixel_shares(x_px[part], offset, sigma_px)
        row, down = pixel_shares(y_px[part], offset, sigma_px)
        share = charge_e[part, None, None] * down[:, :, None] * across[:, None, :]
        inside = ((row >= 0) & (row < height))[:, :, None] & ((column >= 0) & (column < width))[:, None, :]
        index = row[:, :, None] * width + column[:, None, :]
        np.add.at(image_e.reshape(-1), index[inside], share[inside].astype(image_e.dtype))


def pixel_shares(place_px: Array, offset: np.ndarray, sigma_px: float) -> tuple[np.ndarray, Array]:
    """Pixels (n, k) around points along one axis, and the share of the Gauss that each holds."""
    pixel = np.floor(place_px + 0.5).astype(np.int64)[:, None] + offset
    if sigma_px == 0:
        return pixel, np.broadcast_to(offset == 0, pixel.shape).astype(float)
    left = (pixel - 0.5 - place_px[:, None]) / sigma_px
    return pixel, ndtr(left + 1 / sigma_px) - ndtr(left)
