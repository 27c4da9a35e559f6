"""What a bank's tracks leave in pixels: charge diffused and collected, at every quarter-pixel offset of the entry."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from scipy.special import ndtr

from noise.arrays import Array
from noise.bank import CELL_UM, BankKey, TrackBank, bank_for

PHASES = 4
"""Sub-pixel offsets per axis: an entry is placed to an eighth of a pixel, well under the diffusion."""

SMALLEST_E = 2.0
"""Less charge in a pixel than this is dropped from a footprint, and the rest is scaled to keep the sum."""

DIFFUSION_REACH = 3.0  # standard deviations of the diffusion that a footprint includes
PATCH_SIDES_PX = (10, 12, 14, 16, 20, 24, 32, 48, 64, 128, 192, 256, 384, 512, 768, 1024)


PIXEL = np.dtype([("dx_px", np.int16), ("dy_px", np.int16), ("charge_e", np.float32)])
"""One pixel of a footprint: 8 bytes together, because fetching them is what stamping costs."""

MOST_FINE_CELLS = 2**24
"""Cells of patches that are filtered at a time (64 MB)."""


@dataclass(frozen=True)
class Footprints:
    """Pixels of every track at every phase, in one long row of PIXEL records (offset from the entry's pixel, charge).

    Footprint of track i at phase (row a, column b) is the slice that starts at `start[(i * PHASES + a) * PHASES + b]`
    with `count` entries. `reach_px` (n_tracks,) is the largest offset of each track, `track_charge_e` its sum.
    """

    pixels: np.ndarray
    start: np.ndarray
    count: np.ndarray
    reach_px: np.ndarray
    track_charge_e: Array
    bank: TrackBank

    @property
    def n_tracks(self) -> int:
        """Number of tracks in the bank."""
        return len(self.reach_px)


@lru_cache(maxsize=4)
def footprints_for(key: BankKey, pitch_um: float, diffusion_um: float) -> Footprints:
    """Footprints of a bank for one pitch and diffusion, kept in memory (0.7 s the first time)."""
    bank = bank_for(key)
    fine_per_um = PHASES / pitch_um
    fine_x = np.rint(bank.cell_x * (CELL_UM * fine_per_um)).astype(np.int64)
    fine_y = np.rint(bank.cell_y * (CELL_UM * fine_per_um)).astype(np.int64)
    n_tracks = len(bank.length_um)
    kernel = collection_kernel(diffusion_um * fine_per_um)
    span = largest_of_each(np.maximum(np.abs(fine_x), np.abs(fine_y)), bank.track, n_tracks)
    # A footprint of reach r fine cells needs r and the kernel on each side, and the phase shift.
    side_px = 2 * (-(-(span + len(kernel) // 2 + PHASES) // PHASES)) + 2
    pieces = []
    for low, high in zip((0, *PATCH_SIDES_PX), (*PATCH_SIDES_PX, 1 << 30), strict=True):
        members = np.flatnonzero((side_px > low) & (side_px <= high))
        if len(members):
            patch = int(side_px[members].max())
            n_parts = min(len(members), -(-len(members) * (patch * PHASES) ** 2 // MOST_FINE_CELLS))
            for part in np.array_split(members, n_parts):
                pieces.append(class_footprints(bank, part, (fine_x, fine_y), patch, kernel))
    return sorted_footprints(bank, pieces)


def collection_kernel(sigma_fine: float) -> Array:
    """Charge that a point of the fine grid gives a pixel at each fine offset: a box of PHASES convolved with a Gauss.

    Index c + k holds the share of the pixel whose first fine cell is k cells before the point.
    """
    reach = int(np.ceil(DIFFUSION_REACH * sigma_fine)) + PHASES
    offset = np.arange(-reach, reach + 1)
    if sigma_fine == 0:
        return ((offset >= 0) & (offset < PHASES)).astype(float)
    upper, lower = ndtr((offset + 0.5) / sigma_fine), ndtr((offset + 0.5 - PHASES) / sigma_fine)
    return upper - lower


def class_footprints(
    bank: TrackBank, members: np.ndarray, fine: tuple[np.ndarray, np.ndarray], patch_px: int, kernel: Array
) -> tuple[np.ndarray, ...]:
    """Rows (label, dx, dy, charge), by label, of the tracks that fit a patch; they are filtered as one tall image."""
    side = patch_px * PHASES
    place = np.full(len(bank.length_um), -1)
    place[members] = np.arange(len(members))
    rows = place[bank.track] >= 0
    # Its own pixel's last cell: a pixel that begins k cells left of the entry sees it at phase k, modulo a pixel, and
    # so the cell of a pixel that holds its charge at phase k is the k-th from its end.
    entry = (patch_px // 2) * PHASES + PHASES - 1
    index = (place[bank.track[rows]] * side + entry + fine[1][rows]) * side + entry + fine[0][rows]
    image: Array = np.zeros((len(members) * side, side), dtype=np.float32)
    np.add.at(image.reshape(-1), index, bank.charge_e[rows])
    # sepFilter2D correlates: a tap at +k reads the point k cells after the pixel's first cell.
    taps = kernel.astype(np.float32)
    image = cv2.sepFilter2D(image, -1, taps, taps, borderType=cv2.BORDER_CONSTANT)
    cells = (image >= SMALLEST_E).reshape(len(members), patch_px, PHASES, patch_px, PHASES)
    kept = np.flatnonzero(cells.transpose(0, 2, 4, 1, 3)[:, ::-1, ::-1]).astype(np.uint32)
    label, pixel = np.divmod(kept, np.uint32(patch_px * patch_px))
    y, x = np.divmod(pixel, np.uint32(patch_px))
    slot, phase_y, phase_x = label // PHASES**2, label // PHASES % PHASES, label % PHASES
    line = (slot * np.uint32(patch_px) + y) * PHASES + (PHASES - 1 - phase_y)
    charge = image[line, x * PHASES + (PHASES - 1 - phase_x)]
    label = members.astype(np.int32)[slot] * PHASES**2 + (label % PHASES**2).astype(np.int32)
    middle = patch_px // 2
    return label, x.astype(np.int16) - np.int16(middle), y.astype(np.int16) - np.int16(middle), charge


def sorted_footprints(bank: TrackBank, pieces: list[tuple[np.ndarray, ...]]) -> Footprints:
    """Put the rows of all classes in order of track and phase, scaled to the tracks' own charge."""
    label, dx, dy, charge = (np.concatenate(column) for column in zip(*pieces, strict=True))
    n_tracks = len(bank.length_um)
    n_labels = n_tracks * PHASES**2
    total = np.bincount(label, charge, minlength=n_labels)
    own = np.bincount(bank.track, bank.charge_e, minlength=n_tracks)
    count = np.bincount(label, minlength=n_labels)
    start = np.concatenate([[0], np.cumsum(count)[:-1]])
    # The rows of a label lie together in their class: they are moved as one.
    first = np.flatnonzero(np.diff(label, prepend=-1))
    moved = np.arange(len(label)) + np.repeat(start[label[first]] - first, count[label[first]])
    pixels = np.empty(len(label), dtype=PIXEL)
    pixels["dx_px"][moved], pixels["dy_px"][moved] = dx, dy
    scale = (np.repeat(own, PHASES**2) / np.where(total > 0, total, 1)).astype(np.float32)
    pixels["charge_e"][moved] = charge * scale[label]
    reach_px = np.maximum(np.abs(pixels["dx_px"]), np.abs(pixels["dy_px"]))
    return Footprints(
        pixels=pixels,
        start=start,
        count=count,
        reach_px=largest_of_each(reach_px, np.repeat(np.arange(n_labels) // PHASES**2, count), n_tracks),
        track_charge_e=own,
        bank=bank,
    )


def largest_of_each(values: np.ndarray, owner: np.ndarray, n_owners: int) -> np.ndarray:
    """Largest value of each owner (n_owners,), 0 for one without any; `owner` is in order."""
    largest = np.zeros(n_owners, dtype=np.int64)
    first = np.flatnonzero(np.diff(owner, prepend=-1))
    if len(first):
        largest[owner[first]] = np.maximum.reduceat(values, first)
    return largest
