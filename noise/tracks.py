"""The fast generator: tracks of a bank stamped at random places, sub-pixel offsets and orientations.

Its slow definition is `noise.transport`, drawn hit by hit by `noise.direct`: same law, other draws.
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

MIRRORED_AZIMUTH = np.array(
    [[1, 0], [-1, np.pi], [-1, 0], [1, np.pi], [-1, np.pi / 2], [1, np.pi / 2], [1, -np.pi / 2], [-1, -np.pi / 2]]
)
"""Azimuth of a track after each symmetry: factor, offset. Number = 4 * (axes swapped) + 2 * (y turned) + (x turned)."""


@dataclass(frozen=True)
class Stamps:
    """Tracks of one exposure: entry `x_px`, `y_px`, number in the bank `track`, `symmetry` of the pixel grid (0-7)."""

    x_px: Array
    y_px: Array
    track: np.ndarray
    symmetry: np.ndarray

    def __len__(self) -> int:
        """Number of tracks."""
        return len(self.x_px)

    def where(self, rows: np.ndarray | slice) -> Stamps:
        """Some of the rows."""
        return Stamps(self.x_px[rows], self.y_px[rows], self.track[rows], self.symmetry[rows])


def draw_stamps(
    mean_number: float, shape: tuple[int, int], n_tracks: int, n_symmetries: int, *, rng: np.random.Generator
) -> Stamps:
    """Tracks that enter an image of (height, width): Poisson in number, uniform in place, any of the bank."""
    n = int(rng.poisson(mean_number))
    height, width = shape
    return Stamps(
        x_px=rng.random(n) * width - 0.5,
        y_px=rng.random(n) * height - 0.5,
        track=rng.integers(0, n_tracks, n, dtype=np.int32),
        symmetry=rng.integers(0, n_symmetries, n, dtype=np.int8),
    )


def draw_border_stamps(
    per_pixel: float, shape: tuple[int, int], prints: Footprints, n_symmetries: int, *, rng: np.random.Generator
) -> Stamps:
    """Tracks that enter outside the image but near enough to reach it; without them its borders get too little dose."""
    parts = []
    low = -1
    for margin in (*BORDER_CLASSES_PX, int(prints.reach_px.max())):
        members = np.flatnonzero((prints.reach_px > low) & (prints.reach_px <= margin))
        low = margin
        x_px, y_px = points_around(per_pixel * len(members) / prints.n_tracks, shape, margin, rng=rng)
        track = members[rng.integers(0, max(len(members), 1), len(x_px))] if len(members) else np.zeros(0, dtype=int)
        symmetry = rng.integers(0, n_symmetries, len(x_px), dtype=np.int8)
        parts.append((x_px, y_px, track.astype(np.int32), symmetry))
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
    inside = (column >= SHORT_PX) & (column < width - SHORT_PX) & (row >= SHORT_PX) & (row < height - SHORT_PX)
    inside &= prints.reach_px[stamps.track] <= SHORT_PX
    flat = charge_e.reshape(-1)
    hit, entry, sx, sy, swap = footprint_rows(stamps.where(inside), prints)
    along_x, along_y = np.where(swap, width * sy, sx), np.where(swap, sx, width * sy)
    base = row[inside] * width + column[inside]
    pixel = prints.pixels[entry]
    index = pixel["dx_px"] * along_x[hit]
    index += pixel["dy_px"] * along_y[hit]
    index += base[hit]
    np.add.at(flat, index, pixel["charge_e"])
    stamp_with_borders(charge_e, stamps.where(~inside), prints)


def stamp_with_borders(charge_e: Array, stamps: Stamps, prints: Footprints) -> None:
    """The same for tracks that may lie partly outside: every pixel is looked at."""
    height, width = charge_e.shape
    hit, entry, sx, sy, swap = footprint_rows(stamps, prints)
    pixel = prints.pixels[entry]
    dx, dy = pixel["dx_px"], pixel["dy_px"]
    x = np.where(swap[hit], dy, dx) * sx[hit] + np.floor(stamps.x_px + 0.5).astype(np.int64)[hit]
    y = np.where(swap[hit], dx, dy) * sy[hit] + np.floor(stamps.y_px + 0.5).astype(np.int64)[hit]
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    np.add.at(charge_e.reshape(-1), y[inside] * width + x[inside], pixel["charge_e"][inside])


def footprint_rows(
    stamps: Stamps, prints: Footprints
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """For every pixel of every stamp its stamp and its entry in the bank; and per stamp the signs and the axis swap."""
    swap = stamps.symmetry >= 4
    sx = 1 - 2 * (stamps.symmetry & 1).astype(np.int64)
    sy = 1 - (stamps.symmetry & 2).astype(np.int64)
    # The phase before the symmetry is the one that the symmetry maps to where the track enters.
    phase_x = phase_of(stamps.x_px, sx)
    phase_y = phase_of(stamps.y_px, sy)
    label = stamps.track.astype(np.int64) * PHASES**2
    label += np.where(swap, phase_x * PHASES + phase_y, phase_y * PHASES + phase_x)
    count = prints.count[label]
    hit = np.repeat(np.arange(len(stamps)), count)
    first = prints.start[label] - np.concatenate([[0], np.cumsum(count)])[:-1]
    return hit, np.arange(len(hit)) + first[hit], sx, sy, swap


def phase_of(place_px: Array, sign: np.ndarray) -> np.ndarray:
    """Quarter of its pixel that a point is in, counted from the side that the sign turns to."""
    quarter = ((place_px + 0.5) % 1.0 * PHASES).astype(np.int64)
    return np.where(sign > 0, quarter, PHASES - 1 - quarter)


def hit_table(stamps: Stamps, prints: Footprints, frame: int, pitch_um: float) -> GammaHits:
    """The truth of stamped tracks."""
    bank = prints.bank
    factor, offset = MIRRORED_AZIMUTH[stamps.symmetry].T
    azimuth = bank.azimuth_rad[stamps.track] * factor + offset
    return GammaHits(
        frame=np.full(len(stamps), frame, dtype=np.int32),
        x_px=stamps.x_px,
        y_px=stamps.y_px,
        length_px=bank.length_um[stamps.track] / pitch_um,
        azimuth_rad=np.pi - (np.pi - azimuth) % (2 * np.pi),
        deposit_kev=bank.deposit_kev[stamps.track],
        charge_e=prints.track_charge_e[stamps.track],
    )
