"""A drop and its shadow fall in step, some rows apart: that tells them apart where their columns lie on one another.

A lamp above the cameras throws a drop's shadow lower in the image than the drop itself, by as many rows as the lamp's
height and the distance from the wall say; a lamp below them, higher. Near the wall the drop is a tenth of its shadow
and two columns off, so that the shadow's profile would have to be known to a hundredth to take it away. Rows ask for no
profile: what a column does when the shadow passes is the shadow's, whatever its shape; what it does so many rows above,
and does not do as many rows below, is the drop's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from leakloc.levelled import LevelPair
from leakloc.lineshape import gaussian
from leakloc.pixels import Residual
from leakloc.prediction import LAMP_ERROR_M
from leakloc.rig import Array, Rig
from leakloc.shadows import ray_to_lamp
from leakloc.streaks import Streaks

BESIDE_PX, FARTHEST_PX = 8, 40  # columns that are looked at beyond shadow and drop, and most from one to the other
CLIP_DARK, CLIP_BRIGHT = 9.0, 4.0  # standard deviations of a pixel: hits only ever brighten
SHADOW_SIGMA_PX = 1.0  # of the weights of its columns, by which a row is asked whether the shadow passes,
PASSING_SIGMAS = 1.5  # and how much says so
DROP_SIGMAS_PX = (0.5, 0.7)  # of what glitters in a drop, across its column
SHIFTS_PX = np.arange(-1.6, 1.61, 0.2)  # of that from the drop's column, alike in both views,
SHIFT_SIGMA_PX = 1.0  # and how far is usual: a limb's, and the error of the shadow's column
NEAREST_M, STEP_M = 0.04, 0.01  # from the wall along the ray,
NEAR_WALL_M = 0.8  # nearer to it a drop's profile may be taken for its shadow's: all of it is searched;
SEARCHED_SIGMAS, MOST_STEPS = 4.0, 160  # else so much to both sides of what is believed
NEAREST_LAMP_M = 0.3
LEAST_ROWS, MOST_ROWS = 0.7, 40.0  # between drop and shadow
ZONES = 6  # of the image, each with its own rows between drop and shadow
LAG_ROWS = 6  # that one view may show the same shadow lower or higher than it should
LEAST_SIGMAS, LEAST_TOGETHER = 1.5, 5.0  # of the drop in either view, and in both
DISPARITY_SIGMA_PX = 0.15  # of what is bright on a drop in one view against the other
HEIGHT_M = 0.1  # of distance that a lamp twice as high as believed would cost: columns put right most of it
UNSURE_PX = 0.15  # standard deviation of the disparity: surer places have nothing to gain
AGREEING_SIGMAS = 4.0  # by which the columns' place and the rows' may differ


@dataclass(frozen=True, eq=False)
class AboveShadow:
    """A drop's distance from the wall on the ray from its shadow to the lamp, m, with its standard deviation.

    `sigmas` (2,): significance of the drop in either view.
    """

    distance_m: float
    distance_sigma_m: float
    sigmas: Array


def placed_by_rows(
    columns_px: Array, covariance_px2: Array, shadow_px: Array, views: Sequence[Streaks], stage: tuple[LevelPair, Rig]
) -> tuple[Array, Array]:
    """A drop's columns (2,) and their covariance (2, 2) once the rows between it and its shadow have been asked.

    The two are independent: one is of the profiles across the columns, the other is blind to what passes with the
    shadow. Nothing changes where the place is sure already, where the rows say nothing, and with several lamps, for
    then a shadow has several rays. Where the two contradict, rows are right.
    """
    level, rig = stage
    apart = np.array([1.0, -1.0])
    unsure = apart @ covariance_px2 @ apart > UNSURE_PX**2
    if not unsure or rig.lamps is None or rig.pedestal_radius is None or len(rig.lamps) != 1:
        return columns_px, covariance_px2
    ray = wall_m, towards = ray_to_lamp(shadow_px, rig.lamps[0], level, rig.pedestal_radius)
    place_m, slopes = level.places_of(columns_px[None])[0], level.place_slopes(columns_px)
    covariance_m2 = slopes @ covariance_px2 @ slopes.T
    believed_m, variance_m2 = float((place_m - wall_m) @ towards), float(towards @ covariance_m2 @ towards)
    whole_m = float(np.linalg.norm(rig.lamps[0, :2] - wall_m))
    if not np.isfinite([believed_m, variance_m2, whole_m]).all():
        return columns_px, covariance_px2
    searched_m = distances(believed_m, float(np.sqrt(variance_m2)), whole_m - NEAREST_LAMP_M)
    drop = drop_above_shadow(shadow_px, ray, searched_m, views, (level, rig.lamps[0]))
    if drop is None or drop.sigmas.min() < LEAST_SIGMAS or np.linalg.norm(drop.sigmas) < LEAST_TOGETHER:
        return columns_px, covariance_px2
    along_px = level.column_slopes(wall_m + drop.distance_m * towards) @ towards  # per metre of the ray
    lamp_error = LAMP_ERROR_M / max(abs(float(rig.lamps[0, 2] - level.centres_m[:, 2].mean())), LAMP_ERROR_M)
    own_m2 = (
        drop.distance_sigma_m**2
        + (DISPARITY_SIGMA_PX / max(float(np.abs(apart @ along_px)), 1e-9)) ** 2
        + (HEIGHT_M * lamp_error) ** 2
    )
    off_m = drop.distance_m - believed_m
    if off_m**2 > AGREEING_SIGMAS**2 * (variance_m2 + own_m2):  # the profile took the one for the other
        covariance_m2 = covariance_m2 + off_m**2 * np.outer(towards, towards)
        variance_m2 += off_m**2
    gain = covariance_m2 @ towards / (variance_m2 + own_m2)
    updated_m2 = covariance_m2 - (variance_m2 + own_m2) * np.outer(gain, gain)
    updated_px = level.columns_of((place_m + off_m * gain)[None])[0]
    back = level.column_slopes(place_m + off_m * gain)
    return updated_px, back @ updated_m2 @ back.T


def distances(believed_m: float, sigma_m: float, most_m: float) -> Array:
    """Distances (n,) m from the wall, `most_m` at most, at which a drop is looked for."""
    nearest_m, farthest_m = believed_m - SEARCHED_SIGMAS * sigma_m, believed_m + SEARCHED_SIGMAS * sigma_m
    if nearest_m < NEAR_WALL_M:
        nearest_m, farthest_m = NEAREST_M, max(NEAR_WALL_M, farthest_m)
    return np.arange(nearest_m, min(farthest_m, most_m) + STEP_M / 2, STEP_M)[:MOST_STEPS]


def drop_above_shadow(
    shadow_px: Array,
    ray: tuple[Array, Array],
    distances_m: Array,
    views: Sequence[Streaks],
    stage: tuple[LevelPair, Array],
) -> AboveShadow | None:
    """The drop that throws the shadow seen at columns (2,), at one of the distances (n,) from the wall along the ray.

    ray: the shadow's place on the wall and the direction to the lamp, (2,) each. Distances are weighed by their
    likelihood: that of the bright line which each of them implies, on its columns and so many rows off the shadow. None
    where the lamp stands between the cameras, where the view ends, and where the drop is far from its shadow.
    """
    (wall_m, towards), (level, lamp) = ray, stage
    places_m = wall_m + distances_m[:, None] * towards
    columns_px = level.columns_of(places_m)
    height = views[0].pixels.frames.shape[1]
    zones = np.array_split(np.arange(height), min(ZONES, height))
    middles_px = np.array([(zone[0] + zone[-1]) / 2 for zone in zones])
    rows_px = rows_above(places_m, wall_m, lamp, level, middles_px)
    near = (np.abs(columns_px - shadow_px) < FARTHEST_PX).all(axis=1)  # NaN is not
    inside = ((columns_px >= 0) & (columns_px < level.image_size[0])).all(axis=1)
    most = np.abs(rows_px).max(axis=(0, 2))
    usable = (most > LEAST_ROWS) & (most < MOST_ROWS) & near & inside
    if not usable.any():
        return None
    distances_m, columns_px, rows_px = distances_m[usable], columns_px[usable], rows_px[:, usable]
    reach_px = BESIDE_PX + int(np.ceil(np.abs(columns_px - shadow_px).max()))
    seen = [view.pixels.about(c, reach_px) for view, c in zip(views, shadow_px, strict=True)]
    clipped = [np.clip(residual, -CLIP_DARK, CLIP_BRIGHT) for residual, _ in seen]
    passing = [passes(one, at, c) for one, (_, at), c in zip(clipped, seen, shadow_px, strict=True)]
    lower_m = level.centres_m[0, 2] - level.centres_m[1, 2]  # the higher camera sees the same lower in its picture
    lag_px = level.focal_px * lower_m / float(level.depths_m(wall_m[None])[0])
    lag = rows_below(passing[0], passing[1], round(lag_px))
    other = moved(passing[1], lag), moved(passing[0], -lag)  # the other view's, for its noise is not this one's
    sigmas = np.stack(
        [
            bright_above(clipped[i], other[i], seen[i][1], (columns_px[:, i], rows_px[i]), zones)
            / _spread(clipped[i], other[i])
            for i in range(2)
        ]
    )
    both = np.where(sigmas.min(axis=0) > 0, (sigmas**2).sum(axis=0), 0.0)
    log_worth = 0.5 * (both - (SHIFTS_PX / SHIFT_SIGMA_PX) ** 2)
    best = int(log_worth.argmax())
    worth = np.exp(log_worth - log_worth.max()).sum(axis=(0, 2))
    worth /= worth.sum()
    mean_m = float(worth @ distances_m)
    variance_m2 = float(worth @ (distances_m - mean_m) ** 2) + STEP_M**2 / 12
    return AboveShadow(mean_m, float(np.sqrt(variance_m2)), sigmas.reshape(2, -1)[:, best])


def rows_above(places_m: Array, wall_m: Array, lamp: Array, level: LevelPair, shadow_rows_px: Array) -> Array:
    """Rows (2, n, m) in either view from a shadow on the rows (m,), on the wall at (2,), up to the drops that throw it

    at places (n, 2): positive where drops are seen above it. Alike on all rows if the lamp is above the cameras, ever
    more of them off the horizon if it stands ahead.
    """
    share = np.linalg.norm(places_m - wall_m, axis=1) / float(np.linalg.norm(wall_m - lamp[:2]))
    depths_m, wall_depth_m = level.depths_m(places_m), float(level.depths_m(wall_m[None])[0])
    horizon_px = level.principal_px[:, 1]
    above_px = level.focal_px * (lamp[2] - level.centres_m[:, 2, None]) * share / depths_m
    stretch = (1 - share) * wall_depth_m / depths_m - 1
    return np.asarray(above_px[..., None] - stretch[:, None] * (shadow_rows_px - horizon_px[:, None])[:, None])


def passes(residual: Residual, columns_px: Array, shadow_px: float) -> Array:
    """How dark the shadow's columns are (frames, rows), standard deviations, 0 where nothing is said to pass."""
    weights = gaussian(columns_px, shadow_px, SHADOW_SIGMA_PX)
    dark = -(residual @ (weights / np.linalg.norm(weights)).astype(np.float32)).astype(np.float64)
    dark -= np.median(dark, axis=0)
    return np.where(dark > PASSING_SIGMAS, dark, 0.0)


def rows_below(one: Array, other: Array, expected: int) -> float:
    """Rows that `one` lies lower than `other`, (frames, rows) each, near what is expected: the top of a parabola

    through their agreement.
    """
    lags = range(expected - LAG_ROWS, expected + LAG_ROWS + 1)
    agreement = np.array([np.vdot(one, rolled(other, lag)) for lag in lags])
    best = int(np.clip(agreement.argmax(), 1, len(lags) - 2))
    before, top, after = agreement[best - 1 : best + 2]
    bend = before - 2 * top + after
    return float(lags[best]) + (float(np.clip(0.5 * (before - after) / bend, -1, 1)) if bend < 0 else 0.0)


def rolled(passing: Array, rows: int) -> Array:
    """The same (frames, rows) so many rows lower; nothing comes in at the end."""
    out = np.zeros_like(passing)
    height = passing.shape[1]
    if abs(rows) >= height:
        return out
    out[:, max(0, rows) : height + min(0, rows)] = passing[:, max(0, -rows) : height - max(0, rows)]
    return out


def moved(passing: Array, rows: float) -> Array:
    """The same as `rolled` by a share of rows."""
    whole = int(np.floor(rows))
    return np.asarray((1 - (rows - whole)) * rolled(passing, whole) + (rows - whole) * rolled(passing, whole + 1))


def bright_above(
    residual: Residual, passing: Array, at_px: Array, drops: tuple[Array, Array], zones: Sequence[NDArray[np.intp]]
) -> Array:
    """How much brighter columns are above the shadow than below it, on each drop's columns and by its rows.

    residual (frames, rows, w) on columns at_px (w,); passing (frames, rows): the shadow; drops: columns (n,) and, for
    shadows in each of the zones of rows, rows above them (n, zones). Returns (widths, n, shifts): standard deviations,
    if the residual is in its own. The shadow agrees as much with itself moved up as moved down, so the difference holds
    nothing of it; what of it is left over, in the profile of the shadow itself, by an error of the lag, is taken out.
    """
    columns_px, rows_px = drops
    most = int(np.ceil(np.abs(rows_px).max())) + 1
    by_row = _padded(residual.transpose(1, 0, 2), most)
    shadow_by_row = np.ascontiguousarray(passing.T, np.float32)
    own_by_row = _padded(shadow_by_row, 2 * most)
    odd, norm2 = np.zeros((len(columns_px), len(at_px))), np.zeros(len(columns_px))
    together = np.zeros(len(at_px))
    for zone, rows in zip(zones, rows_px.T, strict=True):
        first, last = int(zone[0]), int(zone[-1]) + 1
        passed = shadow_by_row[first:last].ravel()
        agreement = np.stack(  # of the zone's shadows with everything so many rows lower
            [passed @ by_row[first + lag : last + lag].reshape(len(passed), -1) for lag in range(2 * most + 1)]
        ).astype(np.float64)
        own = np.array([float(passed @ own_by_row[first + lag : last + lag].ravel()) for lag in range(4 * most + 1)])
        odd += _read(agreement, most - rows) - _read(agreement, most + rows)
        norm2 += 2 * own[2 * most] - _read(own[:, None], 2 * (most - rows))[:, 0]
        norm2 -= _read(own[:, None], 2 * (most + rows))[:, 0]
        together += agreement[most]
    shadow = together / max(float(np.linalg.norm(together)), 1e-9)
    norm = np.sqrt(np.maximum(norm2, 1e-9))
    places = columns_px[:, None] + SHIFTS_PX
    found = []
    for sigma_px in DROP_SIGMAS_PX:
        drop = gaussian(at_px, places[..., None], sigma_px)
        drop -= (drop @ shadow)[..., None] * shadow
        size = np.maximum(np.linalg.norm(drop, axis=-1), 1e-9)
        found.append(np.einsum("ngw,nw->ng", drop, odd) / (size * norm[:, None]))
    return np.stack(found)


def _padded(by_row: Residual, rows: int) -> Residual:
    """The same (rows, ...) with so many rows of nothing before and after."""
    widths = [(rows, rows)] + [(0, 0)] * (by_row.ndim - 1)
    return np.pad(by_row, widths)


def _read(table: Array, at: Array) -> Array:
    """Rows of a table (m, w) at places (n,) between them, (n, w)."""
    whole = np.clip(at.astype(np.intp), 0, len(table) - 2)
    share = (at - whole)[:, None]
    return np.asarray((1 - share) * table[whole] + share * table[whole + 1])


def _spread(residual: Residual, passing: Array) -> float:
    """Standard deviation of what the residual is where nothing passes: clipped hits are part of it."""
    still = residual[passing == 0]
    return max(float(still.std()), 1e-6) if still.size else 1.0
