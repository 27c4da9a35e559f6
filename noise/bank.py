"""A bank of tracks made once by `transport`: the default one is shipped, any other is made at first use.

In an isotropic field energies, squared cosines and azimuths are stratified, so that the bank as a whole keeps the
length law to a few 1e-4.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from noise.arrays import Array
from noise.beam import Direction, crossing
from noise.gamma import CS137_KEV
from noise.silicon import FANO_FACTOR, PAIR_ENERGY_KEV
from noise.streams import Stream, rng_for
from noise.transport import transport

SHIPPED = Path(__file__).with_name("bank.npz")
BANK_SEED = 662
BATCH = 2048
"""Tracks are made in batches with their own keys, so that a test can make one of them again."""

CELL_UM = 0.5
"""Deposits are summed in cells of this size: 0.14 um rms, against 1.2 um of diffusion."""


COLUMNS = {
    "track": np.int32,
    "cell_x": np.int16,
    "cell_y": np.int16,
    "charge_e": np.float32,
    "length_um": np.float32,
    "azimuth_rad": np.float32,
    "deposit_kev": np.float32,
}
"""Columns of a bank and their types in the file."""


@dataclass(frozen=True)
class BankKey:
    """What a bank depends on: photon energy, thickness, direction of the field, number of tracks."""

    photon_energy_kev: float = CS137_KEV
    thickness_um: float = 5.0
    direction: Direction | None = None
    n_tracks: int = 16384


@dataclass(frozen=True)
class TrackBank:
    """Tracks as cells of charge: `cell_x`, `cell_y` (in CELL_UM, from the entry), `charge_e`, in order of `track`.

    And one row per track: `length_um` is the lateral length of the chord along the entry direction, `azimuth_rad` its
    direction from +u to +v, `deposit_kev` the energy left in the layer.
    """

    key: BankKey
    track: np.ndarray
    cell_x: np.ndarray
    cell_y: np.ndarray
    charge_e: Array
    length_um: Array
    azimuth_rad: Array
    deposit_kev: Array


def bank_for(key: BankKey) -> TrackBank:
    """The bank of a sensor and field: read from the package where it is the default, else made (about 1 s) and kept."""
    if key == BankKey() and SHIPPED.exists():
        return read_bank()
    return make_bank(key)


@lru_cache(maxsize=4)
def make_bank(key: BankKey) -> TrackBank:
    """Make a bank from `transport`, batch by batch."""
    n_batches = -(-key.n_tracks // BATCH)
    return joined(key, [make_batch(key, batch) for batch in range(n_batches)])


def make_batch(key: BankKey, batch: int) -> TrackBank:
    """One batch of tracks, with draws of its own."""
    rng = rng_for(BANK_SEED, Stream.BANK, 0, batch)
    n = min(BATCH, key.n_tracks - batch * BATCH)
    kinetic_kev, heading = crossing(key.photon_energy_kev, key.direction, n, rng=rng)
    deposits = transport(kinetic_kev, heading, key.thickness_um, rng=rng)
    track, cell_x, cell_y, energy_kev = in_cells(deposits.track, deposits.x_um, deposits.y_um, deposits.energy_kev)
    charge_e = electrons_of(energy_kev, rng=rng)
    return TrackBank(
        key=key,
        track=track,
        cell_x=cell_x,
        cell_y=cell_y,
        charge_e=charge_e.astype(np.float32),
        length_um=key.thickness_um * np.hypot(heading[:, 0], heading[:, 1]) / heading[:, 2],
        azimuth_rad=np.arctan2(heading[:, 1], heading[:, 0]),
        deposit_kev=deposits.per_track_kev(n),
    )


def electrons_of(energy_kev: Array, *, rng: np.random.Generator) -> Array:
    """Electrons that deposits free: 3.65 eV each, with Fano's fluctuation."""
    mean_e = energy_kev / PAIR_ENERGY_KEV
    return np.clip(mean_e + np.sqrt(FANO_FACTOR * mean_e) * rng.standard_normal(len(mean_e)), 0, None)


def in_cells(
    track: np.ndarray, x_um: Array, y_um: Array, energy_kev: Array
) -> tuple[np.ndarray, np.ndarray, np.ndarray, Array]:
    """Sum deposits in cells of CELL_UM, track by track: rows (track, cell_x, cell_y, energy) in order of track."""
    half = 2**15
    cell_x = np.clip(np.rint(x_um / CELL_UM), -half, half - 1).astype(np.int64)
    cell_y = np.clip(np.rint(y_um / CELL_UM), -half, half - 1).astype(np.int64)
    label = (track.astype(np.int64) << 32) | ((cell_y + half) << 16) | (cell_x + half)
    label, row = np.unique(label, return_inverse=True)
    summed = np.bincount(row, energy_kev)
    kept = summed > 0
    label, summed = label[kept], summed[kept]
    return (
        (label >> 32).astype(np.int32),
        ((label & 0xFFFF) - half).astype(np.int16),
        (((label >> 16) & 0xFFFF) - half).astype(np.int16),
        summed,
    )


def joined(key: BankKey, batches: list[TrackBank]) -> TrackBank:
    """Batches one after the other as one bank."""
    columns = {
        name: np.concatenate([getattr(batch, name) for batch in batches])
        for name in ("cell_x", "cell_y", "charge_e", "length_um", "azimuth_rad", "deposit_kev")
    }
    track = np.concatenate([batch.track + number * BATCH for number, batch in enumerate(batches)])
    return TrackBank(key=key, track=track, **columns)


def bank_hash(bank: TrackBank) -> str:
    """SHA-256 of a bank's parameters and columns."""
    digest = hashlib.sha256(json.dumps(asdict(bank.key), sort_keys=True).encode())
    for name in COLUMNS:
        digest.update(np.ascontiguousarray(getattr(bank, name)).tobytes())
    return digest.hexdigest()


def write_bank(bank: TrackBank, path: Path) -> None:
    """Write a bank with its parameters and hash (the columns in the types of the file)."""
    columns = {name: getattr(bank, name).astype(kind) for name, kind in COLUMNS.items()}
    stored = TrackBank(key=bank.key, **columns)
    np.savez_compressed(path, **columns, parameters=json.dumps(asdict(bank.key)), sha256=bank_hash(stored))


@lru_cache(maxsize=1)
def read_bank() -> TrackBank:
    """The shipped bank; ValueError where its hash does not match."""
    with np.load(SHIPPED, allow_pickle=False) as stored:
        bank = TrackBank(
            key=BankKey(**json.loads(str(stored["parameters"]))), **{name: stored[name] for name in COLUMNS}
        )
        expected = str(stored["sha256"])
    if bank_hash(bank) != expected:
        raise ValueError(f"read_bank: {SHIPPED.name} does not match its hash {expected}: make it again")
    return bank
