"""Shadows of falling drops on wall, floor and structure, with the penumbra of a lamp of finite size.

A pixel's point loses light while a drop passes between it and a source: a lamp, or a lamp's foot (`foot`). Along a
leak's line that depends on the drop's height alone, so per leak, source and view a pixel has four numbers: the height
at which the drop crosses its line to the source, how fast it crosses, by how much it misses, and the ratio of the
discs. A frame looks up the swept overlap (penumbra) between the heights at which its exposure opens and closes.
Slow definition: the integral over the exposure of penumbra.blocked_share (tests/simcam/brute_force.py).
"""

from dataclasses import dataclass

import numpy as np

from simcam.exposure import Exposures
from simcam.fall import GRAVITY_M_S2, fall_depth, fall_time
from simcam.lens import FloatArray
from simcam.light import ShadowSource
from simcam.path import landing_m
from simcam.penumbra import swept_overlap, table_row
from simcam.scene import Leak
from simcam.static import LitScene, StaticView
from simcam.structures import IndexArray

PLACES_PER_RADIUS = 3.0  # of the shadow, in a pixel's square
MAX_PLACES = 6  # along a side
BATCH = 50_000  # pixels swept at a time: their arrays stay in the cache
SLOW_STEPS = 12  # of the exposure in which a drop is released
SOME_PIXELS = 500  # tell how far apart pixels are on the surface
JUMP = 8.0  # times the median step from pixel to pixel: the edge of structure


@dataclass(frozen=True)
class ShadowTable:
    """Pixels that a leak's drops can shade from one source, by the depth of fall at which they do (all (n,), sorted).

    pixel flat index and its row; depth_m below the leak at the darkest moment; reach_m half the depth over which it is
    shaded, widest_m its maximum; overlap_row in the table of `penumbra`; light: radiance lost per metre of fall at
    normalised overlap 1, W m^-2 sr^-1.
    """

    pixel: IndexArray
    row: IndexArray
    depth_m: FloatArray
    reach_m: FloatArray
    overlap_row: FloatArray
    light: FloatArray
    landing_m: float
    widest_m: float


def shadow_tables(lit: LitScene, view: StaticView, leak: Leak) -> list[ShadowTable]:
    """Tables of one leak and view, of every source of the view whose light the drops can take."""
    tables = [shadow_table(lit, view, leak, index) for index in range(len(view.by_source))]
    return [table for table in tables if table is not None]


def shadow_table(lit: LitScene, view: StaticView, leak: Leak, source_index: int) -> ShadowTable | None:
    """Table of one leak, source and view; None when no pixel can be shaded.

    A soft shadow is taken at the pixels' centres; one only a few pixels wide at several places, whose mean it is.
    """
    source = lit.sources[source_index]
    pixel = _between_leak_and_lamp(view, leak, source)
    pixel = pixel[view.by_source[source_index, pixel] > 0]
    if pixel.size == 0:
        return None
    centre_m = view.points_m[:, pixel].astype(float)
    places = _places_in_pixel(view, pixel, leak, source)
    if len(places) == 1:
        points_m = [centre_m]
    else:
        across_m, down_m = _pixel_steps(view, pixel)
        points_m = [centre_m + right * across_m + below * down_m for right in places for below in places]
    radiance = view.by_source[source_index, pixel] / np.float32(len(points_m))
    spread = np.tile(pixel, len(points_m)), np.tile(radiance, len(points_m))
    return _table(
        np.concatenate(points_m, axis=1), spread, leak, source, (view.radiance.shape[1], landing_m(lit, leak))
    )


def _pixel_steps(view: StaticView, pixel: IndexArray) -> tuple[FloatArray, FloatArray]:
    """Metres (3, n) on the seen surface from a pixel to the next one right and below; 0 across a jump in depth."""
    height, width = view.radiance.shape
    points_m = view.points_m.reshape(3, height, width)
    row, column = np.divmod(pixel, width)
    left, right = np.maximum(column - 1, 0), np.minimum(column + 1, width - 1)
    above, below = np.maximum(row - 1, 0), np.minimum(row + 1, height - 1)
    steps = []
    for step, count in (
        (points_m[:, row, right] - points_m[:, row, left], right - left),
        (points_m[:, below, column] - points_m[:, above, column], below - above),
    ):
        length = np.sqrt(np.sum(step * step, axis=0))
        steps.append(step / count * (length < JUMP * np.median(length)))
    return steps[0], steps[1]


def _places_in_pixel(view: StaticView, pixel: IndexArray, leak: Leak, source: ShadowSource) -> FloatArray:
    """Offsets from the centre in px: so many that they lie closer than a third of the radius of the drop's shadow."""
    away_m = np.hypot(*(view.points_m[:2, pixel] - np.array(source.position_m[:2], np.float32)[:, None])).max()
    leak_m = max(float(np.hypot(leak.x_m - source.position_m[0], leak.y_m - source.position_m[1])), source.radius_m)
    shadow_m = leak.drop_radius_m * away_m / leak_m + source.radius_m * max(away_m / leak_m - 1, 0)
    across_m, _ = _pixel_steps(view, pixel[:: max(1, len(pixel) // SOME_PIXELS)])
    pixel_m = float(np.median(np.sqrt(np.sum(across_m * across_m, axis=0))))
    count = int(np.clip(np.ceil(PLACES_PER_RADIUS * pixel_m / shadow_m), 1, MAX_PLACES))
    return (np.arange(count) + 0.5) / count - 0.5


def _table(
    point_m: FloatArray,
    spread: tuple[IndexArray, FloatArray],
    leak: Leak,
    source: ShadowSource,
    landing: tuple[int, float],
) -> ShadowTable | None:
    """Table of points (3, n) with their pixels (n,) and shares of the pixels' radiance by the source (n,)."""
    (pixel, radiance), (width_px, landing_depth_m) = spread, landing
    to_lamp = np.asarray(source.position_m)[:, None] - point_m
    flat_m = np.maximum(np.hypot(to_lamp[0], to_lamp[1]), 1e-9)  # a point right below a lamp
    along = ((leak.x_m - point_m[0]) * to_lamp[0] + (leak.y_m - point_m[1]) * to_lamp[1]) / flat_m**2
    miss_m = ((leak.x_m - point_m[0]) * to_lamp[1] - (leak.y_m - point_m[1]) * to_lamp[0]) / flat_m
    cos_elevation = flat_m / np.sqrt(flat_m**2 + to_lamp[2] ** 2)
    both_m = source.radius_m * np.maximum(along, 0) + leak.drop_radius_m  # radii in the plane of the drop
    depth_m = leak.z_m - (point_m[2] + along * to_lamp[2])
    reach_m = both_m / cos_elevation
    between = (along > 0) & (along < 1) & (np.abs(miss_m) < both_m)
    kept = np.flatnonzero(between & (depth_m > -reach_m) & (depth_m < landing_depth_m + reach_m))
    if kept.size == 0:
        return None
    kept = kept[np.argsort(depth_m[kept], kind="stable")]
    # the overlap integrates to the drop's area: its share of the lamp's disc, spread over the plane in units of both_m
    light = radiance * reach_m * np.pi * leak.drop_radius_m**2 / both_m**2
    columns = (depth_m, reach_m, table_row(leak.drop_radius_m / both_m, miss_m / both_m), light)
    depth, reach, overlap_row, lost = (column[kept].astype(np.float32) for column in columns)
    row = pixel[kept] // width_px
    return ShadowTable(pixel[kept], row, depth, reach, overlap_row, lost, landing_depth_m, float(reach.max()))


def _between_leak_and_lamp(view: StaticView, leak: Leak, source: ShadowSource) -> IndexArray:
    """Pixels whose point lies near the vertical plane through lamp and leak, beyond the leak."""
    lamp_x, lamp_y, _ = source.position_m
    beyond = np.array([leak.x_m - lamp_x, leak.y_m - lamp_y])
    distance_m = float(np.hypot(*beyond))
    if distance_m <= source.radius_m:  # a leak inside or above the lamp: every point has to be asked
        return np.arange(view.points_m.shape[1])
    ahead_x, ahead_y = (beyond / distance_m).astype(np.float32)
    x, y = view.points_m[0] - np.float32(lamp_x), view.points_m[1] - np.float32(lamp_y)
    ahead = x * ahead_x + y * ahead_y
    beside = np.abs(y * ahead_x - x * ahead_y)
    # similar triangles, with the widest penumbra that a point at distance `ahead` can be in
    room = (leak.drop_radius_m * ahead + source.radius_m * (ahead - distance_m)) * 1.02 / distance_m
    room += np.float32(view.pixel_m)
    return np.flatnonzero((beside < room) & (ahead > distance_m * 0.98 - 0.02))


def expose_shadows(clip: FloatArray, table: ShadowTable, exposures: Exposures) -> None:
    """Take drops' shadows, radiance times seconds, from a flat clip (frames * height * width,) in place."""
    # a sweep counts every depth alike, but a drop just released dwells near its leak: it is swept in short steps
    near_leak_m = 4 * table.widest_m
    near = (table.depth_m[0] < near_leak_m) & (fall_depth(exposures.opens_s.min(axis=1)) < near_leak_m)
    _sweep(clip, table, exposures[~near])
    _sweep(clip, table, _in_steps(exposures[near]))


def _in_steps(exposures: Exposures) -> Exposures:
    """Every exposure cut into SLOW_STEPS."""
    edges_s = np.linspace(exposures.opens_s, exposures.closes_s, SLOW_STEPS + 1)
    height = edges_s.shape[2]
    first_pixel = np.tile(exposures.first_pixel, SLOW_STEPS)
    return Exposures(edges_s[:-1].reshape(-1, height), edges_s[1:].reshape(-1, height), first_pixel)


def _sweep(clip: FloatArray, table: ShadowTable, exposures: Exposures) -> None:
    """Take the shadows of drops while they fall, a batch at a time."""
    opens, closes = (
        np.minimum(fall_depth(edge_s), table.landing_m).astype(np.float32)
        for edge_s in (exposures.opens_s, exposures.closes_s)
    )
    first = np.searchsorted(table.depth_m, opens.min(axis=1) - table.widest_m)
    last = np.searchsorted(table.depth_m, closes.max(axis=1) + table.widest_m)
    batch = np.cumsum(last - first) // BATCH
    for number in np.unique(batch):
        drops = np.flatnonzero(batch == number)
        place = np.concatenate([np.arange(first[drop], last[drop]) for drop in drops])
        drop = np.concatenate([np.full(last[drop] - first[drop], drop) for drop in drops])
        row, middle, reach = table.row[place], table.depth_m[place], table.reach_m[place]
        travel = np.stack([opens[drop, row], closes[drop, row]])
        travel -= middle
        travel /= reach
        np.clip(travel, -1, 1, out=travel)
        enters, leaves = swept_overlap(table.overlap_row[place], travel)
        leaves -= enters
        leaves *= table.light[place]
        leaves /= _mean_speed(*(middle + travel * reach))
        np.subtract.at(clip, exposures.first_pixel[drop] + table.pixel[place], leaves)  # a pixel may be there twice


def _mean_speed(enters_m: FloatArray, leaves_m: FloatArray) -> FloatArray:
    """Mean speed (n,) of a drop between two depths of fall: the time spent is depth over this."""
    mean = (fall_time(enters_m) + fall_time(leaves_m)) * np.float32(GRAVITY_M_S2 / 2)
    return np.maximum(mean, np.float32(1e-6))
