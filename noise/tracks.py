"""The fast generator: tracks of a bank stamped at random places and sub-pixel offsets.

Its slow definition is `noise.transport`, drawn hit by hit by `noise.direct`: same law, other draws. Every track of the
bank has an azimuth of its own, so its orientations are those of the field.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from noise.arrays import Array
from noise.footprints import PHASES, Footprints
from noise.hits import GammaHits

SHORT_PX = 8
"""Reach of the footprints that are stamped without looking at the borders: 95 % of them."""

BORDER_CLASSES_PX = (SHORT_PX, 16, 48)
"""Tracks of up to this reach are drawn in a frame of this width around the image: they may come in from there.

A last class takes the longer ones.
"""

STAMPS_AT_A_TIME = 2**16


@dataclass(frozen=True)
class Stamps:
    """Tracks of one exposure: entry `x_px`, `y_px` and number in the bank `track`."""

    x_px: Array
    y_px: Array
    track: np.ndarray

    def __len__(self) -> int:
        """Number of tracks."""
        return len(self.x_px)

    def where(self, rows: np.ndarray | slice) -> Stamps:
        """Some of the rows."""
        return Stamps(self.x_px[rows], self.y_px[rows], self.track[rows])


def draw_stamps(mean_number: float, shape: tuple[int, int], n_tracks: int, *, rng: np.random.Generator) -> Stamps:
    """Tracks that enter an image of (height, width): Poisson in number, uniform in place, any of the bank."""
    n = int(rng.poisson(mean_number))
    height, width = shape
    return Stamps(
        x_px=rng.random(n) * width - 0.5,
        y_px=rng.random(n) * height - 0.5,
        track=rng.integers(0, n_tracks, n),
    )


def draw_border_stamps(
    per_pixel: float, shape: tuple[int, int], prints: Footprints, *, rng: np.random.Generator
) -> Stamps:
    """Tracks that enter outside the image but near enough to reach it; without them its borders get too little dose."""
    parts = []
    low = -1
    for margin in (*BORDER_CLASSES_PX, int(prints.reach_px.max())):
        members = np.flatnonzero((prints.reach_px > low) & (prints.reach_px <= margin))
        low = margin
        if len(members):
            x_px, y_px = points_around(per_pixel * len(members) / prints.n_tracks, shape, margin, rng=rng)
            parts.append((x_px, y_px, members[rng.integers(0, len(members), len(x_px))]))
    return Stamps(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def points_around(
    per_pixel: float, shape: tuple[int, int], margin_px: int, *, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Poisson points in the frame of a width around an image: above, below, left and right of it."""
    height, width = shape
    bars = (
        (-margin_px, -margin_px, width + 2 * margin_px, margin_px),
        (-margin_px, height, width + 2 * margin_px, margin_px),
        (-margin_px, 0, margin_px, height),
        (width, 0, margin_px, height),
    )
    xs, ys = [], []
    for left, top, wide, high in bars:
        n = int(rng.poisson(per_pixel * wide * high))
        xs.append(left - 0.5 + rng.random(n) * wide)
        ys.append(top - 0.5 + rng.random(n) * high)
    return np.concatenate(xs), np.concatenate(ys)


def stamp_charge(charge_e: Array, stamps: Stamps, prints: Footprints) -> None:
    """Add the footprints of tracks to an image of electrons (height, width), in place; parts outside are lost.

    Slow definition, track by track: `charge_e[y + dy, x + dx] += charge` over the pixels of its footprint.
    """
    for first in range(0, len(stamps), STAMPS_AT_A_TIME):
        stamp_some(charge_e, stamps.where(np.s_[first : first + STAMPS_AT_A_TIME]), prints)


def stamp_some(charge_e: Array, stamps: Stamps, prints: Footprints) -> None:
    """The same for so few tracks that all their pixels fit in memory at once."""
    height, width = charge_e.shape
    column = np.floor(stamps.x_px + 0.5).astype(np.int64)
    row = np.floor(stamps.y_px + 0.5).astype(np.int64)
    far = (column >= SHORT_PX) & (column < width - SHORT_PX) & (row >= SHORT_PX) & (row < height - SHORT_PX)
    far &= prints.reach_px[stamps.track] <= SHORT_PX
    count, pixel = footprint_pixels(stamps.where(far), prints)
    index = np.repeat((row * width + column)[far], count)
    index += pixel["dy_px"] * np.int64(width)
    index += pixel["dx_px"]
    np.add.at(charge_e.reshape(-1), index, pixel["charge_e"])
    stamp_near_border(charge_e, column[~far], row[~far], *footprint_pixels(stamps.where(~far), prints))


def stamp_near_border(
    charge_e: Array, column: np.ndarray, row: np.ndarray, count: np.ndarray, pixel: np.ndarray
) -> None:
    """The same for tracks that may lie partly outside: every pixel is looked at."""
    height, width = charge_e.shape
    x, y = np.repeat(column, count) + pixel["dx_px"], np.repeat(row, count) + pixel["dy_px"]
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    np.add.at(charge_e.reshape(-1), y[inside] * width + x[inside], pixel["charge_e"][inside])


def footprint_pixels(stamps: Stamps, prints: Footprints) -> tuple[np.ndarray, np.ndarray]:
    """How many pixels each track lights, and the PIXEL records of all of them, track after track."""
    label = (stamps.track * PHASES + phase_of(stamps.y_px)) * PHASES + phase_of(stamps.x_px)
    count = prints.count[label]
    entry = np.repeat(prints.start[label] - (np.cumsum(count) - count), count)
    entry += np.arange(len(entry))
    return count, prints.pixels[entry]


def phase_of(place_px: Array) -> np.ndarray:
    """Part of its pixel that a point is in, 0 to PHASES - 1."""
    return ((place_px + 0.5) % 1.0 * PHASES).astype(np.int64)


def hit_table(stamps: Stamps, prints: Footprints, frame: int, pitch_um: float) -> GammaHits:
    """The truth of stamped tracks."""
    bank = prints.bank
    return GammaHits(
        frame=np.full(len(stamps), frame, dtype=np.int32),
        x_px=stamps.x_px,
        y_px=stamps.y_px,
        length_px=bank.length_um[stamps.track] / pitch_um,
        azimuth_rad=bank.azimuth_rad[stamps.track],
        deposit_kev=bank.deposit_kev[stamps.track],
        charge_e=prints.track_charge_e[stamps.track],
    )
