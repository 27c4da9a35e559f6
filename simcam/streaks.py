"""Falling drops blurred by their motion: the moving layer's bright and dark streaks, without casting rays per frame.

All drops of a leak follow the same line, and the scene behind it does not move. So what a drop adds to a pixel while a
line of its disc crosses the pixel's row is a table of place alone, made once per leak and view (`streak_table`); a
frame then needs only the time that each line spends in each row, which is a difference of clipped crossing times.
Slow definition: the integral over the exposure, and over the pixel's square, of the radiance of drop minus background
(tests/simcam/brute_force.py); `expose_drops` is exact in time, and in columns to the width of a sample.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from simcam.camera import Camera
from simcam.dropview import SAMPLES_ACROSS, Disc, disc_radiance, disc_strips, drop_glints, no_glints
from simcam.exposure import Exposures
from simcam.lens import FloatArray
from simcam.lines import Lines, drop_lines
from simcam.path import DropPath, drop_path, landing_m
from simcam.scene import Leak
from simcam.static import LitScene, StaticView
from simcam.structures import IndexArray
from simcam.surface import read_map

MIN_STRIPS, MAX_STRIPS = 24, 96
STRIPS_PER_PX = 4.0  # a drop that hardly moves would show coarser strips as bands
PSF_REACH_SIGMAS = 3.0
BATCH = 16  # drops at a time: some megabytes
CELLS_PER_PX = 8  # a glint stands within 1/16 px of its place
NODES = 17  # places on the path where the optics are evaluated; linear in between: 0.1 % of a streak's light


@dataclass(frozen=True)
class StreakTable:
    """A leak in a view, rows from `first_row`: crossing_s (rows + 1, lines), time since release at which each line

    crosses the rows' upper borders (the last: the lower border of the last row); light (rows, lines, columns), what
    a line adds to a pixel while it is in its row, W m^-2 sr^-1; pixels (rows, columns) flat indices of the image;
    earliest_s, latest_s (rows,): when the first line enters a row and the last one leaves it.
    """

    first_row: int
    crossing_s: FloatArray
    light: FloatArray
    pixels: IndexArray
    earliest_s: FloatArray
    latest_s: FloatArray


@dataclass(frozen=True)
class _Swept:
    """Lines where they cross the rows (rows, lines): left end and width in px, node below, weight of the next node;

    node_px (places,): a drop's radius along the row.
    """

    left_px: FloatArray
    width_px: FloatArray
    node: IndexArray
    weight: FloatArray
    fall_s: FloatArray
    node_px: FloatArray


def streak_table(
    lit: LitScene, view: StaticView, camera: Camera, leak: Leak, psf_sigma_px: float = 0.0
) -> StreakTable | None:
    """Table of one leak in one view; None when its drops are never seen.

    The point-spread is that along the rows alone, and acts before light is collected by pixels, as a lens does: a glint
    much narrower than a pixel would else stand in the middle of its pixel wherever it is. Down the columns the motion
    has blurred it already, and the image may be blurred afterwards.
    """
    path = drop_path(camera, leak, landing_m(lit, leak))
    if path is None:
        return None
    nodes, disc = _nodes(path), _disc(path, leak)
    lines = drop_lines(disc, disc_radiance(lit, nodes, leak.drop_radius_m, disc), drop_glints(lit, nodes))
    return _table(view, camera, path, leak, (lines, psf_sigma_px))


def coverage_table(lit: LitScene, view: StaticView, camera: Camera, leak: Leak) -> StreakTable | None:
    """The same for a drop of radiance 1 before a black scene: what it covers."""
    path = drop_path(camera, leak, landing_m(lit, leak))
    if path is None:
        return None
    disc = _disc(path, leak)
    even = np.ones((NODES, len(disc.middle), SAMPLES_ACROSS))
    black = replace(view, radiance=np.zeros_like(view.radiance))
    return _table(black, camera, path, leak, (drop_lines(disc, even, no_glints(NODES)), 0.0))


def _nodes(path: DropPath) -> DropPath:
    return path.at(np.linspace(path.fall_s[0], path.fall_s[-1], NODES))


def _disc(path: DropPath, leak: Leak) -> Disc:
    height_px = 2 * leak.drop_radius_m * float(np.max(path.down_px[:, 1]))
    return disc_strips(int(np.clip(np.ceil(STRIPS_PER_PX * height_px), MIN_STRIPS, MAX_STRIPS)))


def _table(view: StaticView, camera: Camera, path: DropPath, leak: Leak, spread: tuple[Lines, float]) -> StreakTable:
    lines, psf_sigma_px = spread
    nodes = _nodes(path)
    first_row, crossing_s = _crossings(camera, path, leak.drop_radius_m, nodes.fall_s, lines)
    swept = _swept(path, leak.drop_radius_m, nodes, lines, crossing_s)
    timed = (first_row, crossing_s, swept)
    return _light_table(view, path.at(swept.fall_s.mean(axis=1)), leak, (lines, psf_sigma_px), timed)


def _crossings(
    camera: Camera, path: DropPath, radius_m: float, node_s: FloatArray, lines: Lines
) -> tuple[int, FloatArray]:
    """First row of the path, and when each line crosses the borders of the rows from there, (rows + 1, lines)."""
    scale = radius_m * path.down_px[:, 1]
    down = _between(node_s, lines.down, path.fall_s)
    line_row = np.maximum.accumulate(path.centre_px[:, 1:] + scale[:, None] * down, axis=0)
    first_row = int(np.clip(np.floor(line_row.min() + 0.5), 0, camera.height_px - 1))
    last_row = int(np.clip(np.ceil(line_row.max()), first_row, camera.height_px - 1))
    borders = np.arange(first_row, last_row + 2) - 0.5
    return first_row, np.stack([np.interp(borders, rows, path.fall_s) for rows in line_row.T], axis=1)


def _swept(path: DropPath, radius_m: float, nodes: DropPath, lines: Lines, crossing_s: FloatArray) -> _Swept:
    """Where the lines lie along the row, and between which nodes of the path, while they cross each row."""
    fall_s, node_s = (crossing_s[1:] + crossing_s[:-1]) / 2, nodes.fall_s
    place = (fall_s - node_s[0]) / (node_s[1] - node_s[0])
    node = np.clip(place.astype(int), 0, len(node_s) - 2)
    weight = place - node
    line = np.arange(fall_s.shape[1])

    def pick(values: FloatArray) -> FloatArray:
        return values[node, line] * (1 - weight) + values[node + 1, line] * weight

    def along(values: FloatArray) -> FloatArray:
        return np.interp(fall_s, path.fall_s, values)

    centre = along(path.centre_px[:, 0]) + radius_m * (
        along(path.right_px) * pick(lines.centre) + along(path.down_px[:, 0]) * pick(lines.down)
    )
    half_px = radius_m * along(path.right_px) * pick(lines.half_width)
    return _Swept(centre - half_px, 2 * half_px, node, weight, fall_s, radius_m * nodes.right_px)


def _light_table(
    view: StaticView,
    rows_path: DropPath,
    leak: Leak,
    spread: tuple[Lines, float],
    timed: tuple[int, FloatArray, _Swept],
) -> StreakTable:
    (lines, psf_sigma_px), (first_row, crossing_s, swept) = spread, timed
    height, width = view.radiance.shape
    reach = int(np.ceil(PSF_REACH_SIGMAS * psf_sigma_px))
    first_column = np.floor(swept.left_px.min(axis=1) + 0.5).astype(int) - reach
    columns = int((np.ceil(swept.left_px + swept.width_px).max(axis=1) - first_column).max()) + 2 + reach
    column = first_column[:, None] + np.arange(columns)
    row = first_row + np.arange(len(first_column))[:, None]
    pixels = np.clip(row, 0, height - 1) * width + np.clip(column, 0, width - 1)
    borders = first_column[:, None] + np.arange(columns + 1) - 0.5
    if psf_sigma_px > 0:
        covered, light = _per_blurred_column(lines, swept, borders, psf_sigma_px)
    else:
        covered, light = _per_column(lines, swept, borders)
    square_px = leak.drop_radius_m**2 * rows_path.right_px * rows_path.down_px[:, 1]
    light -= covered * view.radiance.reshape(-1)[pixels][:, None, :]
    in_front = rows_path.range_m[:, None] < view.range_m.reshape(-1)[pixels] + leak.drop_radius_m
    shown = in_front & (column >= 0) & (column < width)
    light *= (square_px[:, None] * shown)[:, None, :]
    earliest_s, latest_s = crossing_s[:-1].min(axis=1), crossing_s[1:].max(axis=1)
    return StreakTable(first_row, crossing_s, light.astype(np.float32), pixels, earliest_s, latest_s)


def _per_blurred_column(
    lines: Lines, swept: _Swept, borders: FloatArray, sigma_px: float
) -> tuple[FloatArray, FloatArray]:
    """`_per_column` after a Gaussian point-spread along the row.

    It is applied where the optics are, at few places on the path, on a grid of an eighth of a pixel about each line's
    centre; rows read what lies between their pixels' borders from there.
    """
    half_px = lines.half_width * swept.node_px[:, None]
    reach_px = float(np.max(half_px)) + PSF_REACH_SIGMAS * sigma_px
    cells = int(np.ceil(reach_px * CELLS_PER_PX))
    grid_px = np.arange(-cells, cells + 1) / CELLS_PER_PX
    middles_px = (grid_px[1:] + grid_px[:-1]) / 2
    shares = ndtr((grid_px[None, :] - middles_px[:, None]) / sigma_px).astype(np.float32)
    centre_px = swept.left_px + swept.width_px / 2
    column = (borders[:, None, :] - centre_px[:, :, None]) * CELLS_PER_PX + cells
    line = np.arange(centre_px.shape[1]) * NODES
    row = np.broadcast_to((swept.node + swept.weight + line)[:, :, None], column.shape)
    even = np.linspace(0, 1, SAMPLES_ACROSS + 1, dtype=np.float32)
    whole = np.broadcast_to(lines.area[:, :, None] * even, lines.cumulated.shape)
    read = []
    for cumulated in (whole, lines.cumulated):
        light = np.diff(_from_left(cumulated, half_px, grid_px), axis=2) @ shares
        table = np.ascontiguousarray(light.transpose(1, 0, 2)).reshape(-1, light.shape[2])  # a line's places in a row
        read.append(np.diff(read_map(table, column.ravel(), row.ravel()).reshape(column.shape), axis=2))
    return read[0], read[1]


def _from_left(cumulated: FloatArray, half_px: FloatArray, grid_px: FloatArray) -> FloatArray:
    """Cumulated values (places, lines, samples + 1) of lines of a half width (places, lines), at a grid of offsets."""
    last = cumulated.shape[2] - 1
    part = np.clip((grid_px / half_px[:, :, None] + 1) / 2, 0, 1) * last
    sample = np.minimum(part.astype(int), last - 1)
    here, there = (np.take_along_axis(cumulated, sample + step, axis=2) for step in (0, 1))
    return (here + (part - sample) * (there - here)).astype(np.float32)


def _per_column(lines: Lines, swept: _Swept, borders: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Area and light of each line (rows, lines, columns) between borders (rows, columns + 1), px; unit disc."""
    part = (borders[:, None, :] - swept.left_px[:, :, None]).astype(np.float32)
    part *= (1 / swept.width_px[:, :, None]).astype(np.float32)
    np.clip(part, 0, 1, out=part)
    sample = np.minimum((part * SAMPLES_ACROSS).astype(np.int32), SAMPLES_ACROSS - 1)
    rest = part * SAMPLES_ACROSS - sample
    line = np.arange(part.shape[1])[None, :, None]
    cumulated = np.zeros_like(part)
    table = lines.cumulated.astype(np.float32).reshape(-1)
    samples, n_lines = lines.cumulated.shape[2], lines.cumulated.shape[1]
    for step, share in ((0, 1 - swept.weight), (1, swept.weight)):
        place = ((swept.node[:, :, None] + step) * n_lines + line) * samples + sample
        here = table[place]
        cumulated += share[:, :, None].astype(np.float32) * (here + rest * (table[place + 1] - here))
    area = lines.area[0].astype(np.float32)[None, :, None]  # the same at every place
    return area * np.diff(part, axis=2), np.diff(cumulated, axis=2)


def expose_drops(clip: FloatArray, table: StreakTable, exposures: Exposures) -> None:
    """Add drops' streaks, radiance times seconds, to a flat clip (frames * height * width,) in place."""
    rows = slice(table.first_row, table.first_row + len(table.light))
    for first in range(0, len(exposures.first_pixel), BATCH):
        some = exposures[first : first + BATCH]
        opens, closes = some.opens_s[:, rows], some.closes_s[:, rows]
        drop, row = np.nonzero((table.latest_s > opens) & (table.earliest_s < closes))
        begin, end = opens[drop, row][:, None], closes[drop, row][:, None]
        spent_s = np.clip(table.crossing_s[row + 1], begin, end) - np.clip(table.crossing_s[row], begin, end)
        light = np.matmul(spent_s.astype(np.float32)[:, None, :], table.light[row])[:, 0]
        np.add.at(clip, some.first_pixel[drop, None] + table.pixels[row], light)  # two drops may cross one row


def _between(node_s: FloatArray, values: FloatArray, fall_s: FloatArray) -> FloatArray:
    return np.stack([np.interp(fall_s, node_s, column) for column in values.T], axis=1)
