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

    A pixel gets the integral of the Gauss over its square, to 4 sigma; what falls outside the image is lost.
    """
    height, width = image_e.shape
    reach = int(1 + 4 * sigma_px)  # the point is anywhere in its own pixel
    near = (x_px > -reach - 1) & (x_px < width + reach) & (y_px > -reach - 1) & (y_px < height + reach)
    rows = np.flatnonzero(near)
    margin = 2 * reach + 1
    padded = np.zeros((height + 2 * margin, width + 2 * margin))  # nobody has to ask what lies outside
    offset = np.arange(-reach, reach + 1)
    for part in np.array_split(rows, len(rows) // DEPOSITS_AT_A_TIME + 1):
        column, across = pixel_shares(x_px[part], offset, sigma_px)
        row, down = pixel_shares(y_px[part], offset, sigma_px)
        down *= charge_e[part, None]
        index = ((row + margin) * padded.shape[1])[:, :, None] + (column + margin)[:, None, :]
        np.add.at(padded.reshape(-1), index.reshape(-1), (down[:, :, None] * across[:, None, :]).reshape(-1))
    image_e += padded[margin:-margin, margin:-margin]


def pixel_shares(place_px: Array, offset: np.ndarray, sigma_px: float) -> tuple[np.ndarray, Array]:
    """Pixels (n, k) around points along one axis, and the share of the Gauss that each holds."""
    own = np.floor(place_px + 0.5).astype(np.int64)[:, None]
    if sigma_px == 0:
        return own + offset, np.tile((offset == 0).astype(float), (len(own), 1))
    edges = own + np.append(offset, offset[-1] + 1) - 0.5
    return own + offset, np.diff(ndtr((edges - place_px[:, None]) / sigma_px), axis=1)
