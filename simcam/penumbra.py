"""How much of a lamp's disc a drop's disc hides, at one moment and swept along the drop's fall.

In the plane of the drop, seen from a lit point, lamp and drop are discs; their overlap over the lamp's area is the
blocked share. Lengths below are in units of the sum of both radii, `share` is the drop's radius in that unit.
"""

from functools import lru_cache

import numpy as np

from simcam.lens import FloatArray
from simcam.surface import read_map

SHARES = 25  # tables for share = 0 .. 1/2; the shape of the overlap is the same for 1 - share
OFFSETS = 49
TRAVELS = 257


def disc_overlap(radius: FloatArray | float, other: FloatArray | float, separation: FloatArray) -> FloatArray:
    """Area common to two discs (broadcast). Source: Weisstein, MathWorld, "Circle-Circle Intersection"."""
    r, q, d = np.broadcast_arrays(np.asarray(radius, float), np.asarray(other, float), np.asarray(separation, float))
    smaller = np.minimum(r, q)
    inside = d <= np.abs(r - q)
    d = np.where(inside | (d >= r + q), np.maximum(r + q, 1e-300), d)
    angle_r = np.arccos(np.clip((d * d + r * r - q * q) / np.maximum(2 * d * r, 1e-300), -1, 1))
    angle_q = np.arccos(np.clip((d * d + q * q - r * r) / np.maximum(2 * d * q, 1e-300), -1, 1))
    kite = np.sqrt(np.maximum((-d + r + q) * (d + r - q) * (d - r + q) * (d + r + q), 0))
    return np.where(inside, np.pi * smaller**2, r * r * angle_r + q * q * angle_q - kite / 2)


def blocked_share(
    points_m: FloatArray, lamp_m: FloatArray, lamp_radius_m: float, drop_m: FloatArray, drop_radius_m: float
) -> FloatArray:
    """Share 0..1 (...,) of a lamp that a drop hides from points (..., 3); drop_m may be (..., 3).

    Exact for small angles. A point behind the drop's back, or whose lamp is nearer than the drop, sees all of the lamp.
    """
    to_lamp, to_drop = np.asarray(lamp_m) - points_m, np.asarray(drop_m) - points_m
    lamp_squared = np.sum(to_lamp * to_lamp, axis=-1)
    place = np.sum(to_lamp * to_drop, axis=-1) / lamp_squared  # of the drop along the segment to the lamp
    miss = to_drop - place[..., None] * to_lamp
    miss_m = np.sqrt(np.sum(miss * miss, axis=-1))
    lamp_disc_m = lamp_radius_m * np.clip(place, 1e-9, 1)
    overlap = disc_overlap(lamp_disc_m, drop_radius_m, miss_m)
    return np.where((place > 0) & (place < 1), overlap / (np.pi * lamp_disc_m**2), 0.0)


@lru_cache(maxsize=1)
def swept_overlap_table() -> FloatArray:
    """Overlap integrated along the travel from -1, over its integral in the plane: float32 (SHARES * OFFSETS, TRAVELS).

    Row share * OFFSETS + offset; column for travel -1 .. 1. The overlap of radii s and 1 - s integrates over the plane
    to pi s^2 pi (1 - s)^2, so the table's sum over offsets -1 .. 1 is 1.
    """
    share = np.linspace(0, 0.5, SHARES)[:, None, None]
    offset = np.linspace(0, 1, OFFSETS)[None, :, None]
    half = np.linspace(-1, 0, 2 * (TRAVELS - 1) + 1)[None, None, :]
    separation = np.hypot(offset, half)
    small = np.maximum(share, 1e-4)  # a point's share: the larger disc alone
    density = disc_overlap(small, 1 - small, separation) / (np.pi**2 * small**2 * (1 - small) ** 2)
    step = 1 / (half.size - 1)
    before = np.zeros_like(density)
    before[..., 1:] = np.cumsum((density[..., 1:] + density[..., :-1]) / 2 * step, axis=-1)
    before = before[..., ::4]  # the drop comes as it goes: the second half mirrors the first
    swept = np.concatenate([before, 2 * before[..., -1:] - before[..., -2::-1]], axis=-1)
    return swept.reshape(SHARES * OFFSETS, TRAVELS).astype(np.float32)


def table_row(share: FloatArray, offset: FloatArray) -> FloatArray:
    """Row (n,) of `swept_overlap_table` for a ratio of discs and a miss."""
    nearest = np.rint(np.minimum(share, 1 - share) * (2 * (SHARES - 1)))
    return nearest * OFFSETS + np.clip(np.abs(offset), 0, 1) * (OFFSETS - 1)


def swept_overlap(row: FloatArray, travel: FloatArray) -> FloatArray:
    """Fast path: bilinear look-up of the integral of the normalised overlap over travel -1 .. 1 (..., n), row (n,).

    Slow definition: integral from -1 to `travel` of disc_overlap(s, 1 - s, hypot(offset, t)) / (pi s (1 - s))^2 dt.
    """
    column = (travel + np.float32(1)) * np.float32((TRAVELS - 1) / 2)
    rows = np.broadcast_to(row, column.shape)
    return read_map(swept_overlap_table(), column.ravel(), rows.ravel()).reshape(column.shape)
