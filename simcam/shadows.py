"""Shadows of falling drops on wall, floor and structure, with the penumbra of a lamp of finite size.

A pixel's point loses light while a drop passes between it and the lamp. Along a leak's line that depends on the drop's
height alone, so per leak, lamp and view a pixel has four numbers: the height at which the drop crosses its line to the
lamp, how fast it crosses, by how much it misses, and the ratio of the discs. A frame looks up the swept overlap
(penumbra) between the heights at which its exposure opens and closes.
Slow definition: the integral over the exposure of penumbra.blocked_share (tests/simcam/brute_force.py).
"""

from dataclasses import dataclass

import numpy as np

from simcam.fall import GRAVITY_M_S2, fall_depth, fall_time
from simcam.lens import FloatArray
from simcam.path import landing_m
from simcam.penumbra import swept_overlap
from simcam.scene import Lamp, Leak
from simcam.static import LitScene, StaticView
from simcam.structures import IndexArray


@dataclass(frozen=True)
class ShadowTable:
    """Pixels that a leak's drops can shade from one lamp, by the depth of fall at which they do (all (n,), sorted).

    pixel flat index; depth_m below the leak at the darkest moment; reach_m half the depth over which it is shaded;
    offset and share of `penumbra`; light: radiance lost per metre of fall at normalised overlap 1, W m^-2 sr^-1.
    """

    pixel: IndexArray
    depth_m: FloatArray
    reach_m: FloatArray
    offset: FloatArray
    share: FloatArray
    light: FloatArray
    landing_m: float


def shadow_table(lit: LitScene, view: StaticView, leak: Leak, lamp_index: int) -> ShadowTable | None:
    """Table of one leak, lamp and view; None when no pixel can be shaded."""
    lamp = lit.lamps[lamp_index]
    pixel = _between_leak_and_lamp(view, leak, lamp)
    pixel = pixel[view.direct[lamp_index, pixel] > 0]
    if pixel.size == 0:
        return None
    point_m = view.points_m[:, pixel].astype(float)
    to_lamp = np.asarray(lamp.position_m)[:, None] - point_m
    flat_m = np.hypot(to_lamp[0], to_lamp[1])
    along = ((leak.x_m - point_m[0]) * to_lamp[0] + (leak.y_m - point_m[1]) * to_lamp[1]) / flat_m**2
    miss_m = ((leak.x_m - point_m[0]) * to_lamp[1] - (leak.y_m - point_m[1]) * to_lamp[0]) / flat_m
    cos_elevation = flat_m / np.sqrt(flat_m**2 + to_lamp[2] ** 2)
    disc_m = lamp.radius_m * along  # the lamp's, in the plane of the drop
    both_m = disc_m + leak.drop_radius_m
    depth_m = leak.z_m - (point_m[2] + along * to_lamp[2])
    reach_m = both_m / cos_elevation
    landing = landing_m(lit, leak)
    kept = np.flatnonzero((np.abs(miss_m) < both_m) & (depth_m > -reach_m) & (depth_m < landing + reach_m))
    if kept.size == 0:
        return None
    kept = kept[np.argsort(depth_m[kept], kind="stable")]
    # the overlap integrates to the drop's area: its share of the lamp's disc, spread over the plane in units of both_m
    strength = np.pi * leak.drop_radius_m**2 / both_m**2
    light = view.direct[lamp_index, pixel] * strength * reach_m
    columns = (depth_m, reach_m, miss_m / both_m, leak.drop_radius_m / both_m, light)
    depth, reach, offset, share, lost = (column[kept].astype(np.float32) for column in columns)
    return ShadowTable(pixel[kept], depth, reach, offset, share, lost, landing)


def _between_leak_and_lamp(view: StaticView, leak: Leak, lamp: Lamp) -> IndexArray:
    """Pixels whose point lies near the vertical plane through lamp and leak, beyond the leak."""
    lamp_x, lamp_y, _ = lamp.position_m
    beyond = np.array([leak.x_m - lamp_x, leak.y_m - lamp_y])
    distance_m = float(np.hypot(*beyond))
    if distance_m <= lamp.radius_m:  # a leak inside or above the lamp: every point has to be asked
        return np.arange(view.points_m.shape[1])
    ahead_x, ahead_y = (beyond / distance_m).astype(np.float32)
    x, y = view.points_m[0] - np.float32(lamp_x), view.points_m[1] - np.float32(lamp_y)
    ahead = x * ahead_x + y * ahead_y
    beside = np.abs(y * ahead_x - x * ahead_y)
    # similar triangles, with the widest penumbra that a point at distance `ahead` can be in
    room = (leak.drop_radius_m * ahead + lamp.radius_m * (ahead - distance_m)) * 1.02 / distance_m + 0.01
    return np.flatnonzero((beside < room) & (ahead > distance_m * 0.98 - 0.02))


def expose_shadow(image: FloatArray, table: ShadowTable, opens_s: FloatArray, closes_s: FloatArray) -> None:
    """Take one drop's shadow, radiance times seconds, from a flat image (height * width,) in place.

    `opens_s`, `closes_s` (height,): the rows' exposure in time since the drop's release.
    """
    width = image.size // len(opens_s)
    depth_open = np.minimum(fall_depth(opens_s), table.landing_m)
    depth_close = np.minimum(fall_depth(closes_s), table.landing_m)
    widest = float(table.reach_m.max())
    first = np.searchsorted(table.depth_m, depth_open.min() - widest)
    last = np.searchsorted(table.depth_m, depth_close.max() + widest)
    if last <= first or depth_close.max() <= 0:
        return
    part = slice(first, last)
    pixel, middle, reach = table.pixel[part], table.depth_m[part], table.reach_m[part]
    row = pixel // width
    opened, closed = depth_open[row].astype(np.float32), depth_close[row].astype(np.float32)
    enters = np.clip(opened, middle - reach, middle + reach)
    leaves = np.clip(closed, middle - reach, middle + reach)
    share, offset = table.share[part], table.offset[part]
    overlap = swept_overlap(share, offset, (leaves - middle) / reach)
    overlap -= swept_overlap(share, offset, (enters - middle) / reach)
    image[pixel] -= table.light[part] * overlap / _mean_speed(enters, leaves)


def _mean_speed(enters_m: FloatArray, leaves_m: FloatArray) -> FloatArray:
    """Mean speed (n,) of a drop between two depths of fall: the time spent is depth over this."""
    mean = (fall_time(enters_m) + fall_time(leaves_m)) * np.float32(GRAVITY_M_S2 / 2)
    return np.maximum(mean, np.float32(1e-6))
