"""The robust method: what both views saw fall on the same rows at the same instants, drops told from their shadows."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from leakloc.background import Frames
from leakloc.condition import alike_frames, describe_clip, row_offset
from leakloc.correlate import agreement, stereo_step, threshold_sigmas
from leakloc.estimate import Estimate, LeakEstimate
from leakloc.explain import BEYOND_WALL, LEAST_DEPTH_M, explain_tracks
from leakloc.fall import fall_paths
from leakloc.gravity import free_fall
from leakloc.levelled import VIEWS, LevelPair, level_pair, levelled_frames
from leakloc.levelling import Tilt, fit_tilt, no_tilt, search_tilt, track_slopes
from leakloc.prediction import DROP_RADIUS_M
from leakloc.rig import Array, Rig
from leakloc.streaks import Streaks, streaks
from leakloc.tilt import leaning_columns, level_under, tilted_rig, upright
from leakloc.tracks import Track, shared_tracks
from leakloc.verdict import LEAK, Verdict

EDGE_PX = 3
COUNT_STEP = 4  # columns that share a threshold
FARTHEST_M = 10.0  # ground beyond counts no more than there
SYSTEMATIC_RADII = 0.012  # of a drop's column: what it shows of the walls is not known, and lies off its middle
SYSTEMATIC_RADII_BESIDE = 0.03  # where a shadow stands beside it
SYSTEMATIC_RADII_UNTOLD = 0.1  # where the lamps are unknown, and with them where the glints lie
LEVEL_ROUNDS = 3
LINE_REACH, LINE_POINTS = 0.4, 81  # share of the distance that a plumb line is asked about mid-row, both ways
SETTLED_RAD = np.radians(0.03)  # half a pixel between the top and the bottom of an image of 1000 rows


@dataclass(frozen=True, eq=False)
class Upright:
    """Both views with plumb lines as columns, the level rig they belong to, its tilt, and the lines they share."""

    views: list[Streaks]
    level: LevelPair
    tilt: Tilt
    tracks: list[Track]


def locate_robustly(left: Frames, right: Frames, rig: Rig, expected_false_leaks: float) -> Estimate:
    """Leaks, with every rejected line and its reason in the diagnostics.

    Diagnostics: `condition` of each view (state, repeated_frames, exposure_jumps), `step` (frames that the right view
    lags, with its significance and that of none), `levelling` (roll and pitch against the believed pose, deg),
    `row_offset` (rows that the right view shows drops lower), `free_fall` (frame rate at which they obey gravity),
    `threshold_sigmas` (at the far wall, where it is least), `noise_grey`, and `lines`, each with its columns, place,
    significance, polarity and `verdict`: "leak" or the reason why not.
    """
    rig = rig.of_known_place()
    believed = level_pair(rig)
    condition = describe_clip(left, right)
    left, right = (alike_frames(frames, condition) for frames in (left, right))
    n_threads = min(len(VIEWS), cv2.getNumThreads())  # as many as OpenCV may have: one where others use the other cores
    with ThreadPoolExecutor(n_threads) as threads:  # OpenCV and the sorts let go of the interpreter
        leaning = list(
            threads.map(lambda view: streaks(levelled_frames((left, right)[view], believed, view)), range(len(VIEWS)))
        )
    least = pair_thresholds(believed, rig, expected_false_leaks)
    seen = shared_lines(leaning, believed, rig, least)
    verdicts = explain_tracks(seen.tracks, seen.views, seen.level, rig)
    standing = tilted_rig(rig, believed, seen.tilt.applied_rad)
    leaks = tuple(_leak(verdict, seen.level, standing) for verdict in verdicts if verdict.reason == LEAK)
    clip = {"condition": condition, "step": stereo_step(seen.views)}
    return Estimate("robust", rig.frame, leaks, clip | _describe(seen, verdicts, least))


def pair_thresholds(level: LevelPair, rig: Rig, expected_false_leaks: float) -> NDArray[np.float32]:
    """Significance that a pair of columns (width, width) must have; infinite at the images' edges.

    False leaks are spread evenly over the ground that both views see, not over the pairs of columns: most pairs meet
    close to the cameras, where a square metre holds hundreds of times as many of them as at the far wall. A pair at
    depth Z stands for Z^3 / (f^2 B) of ground per square pixel; pairs that meet nowhere share the mean.
    """
    width = level.image_size[0]
    columns = np.arange(0, width, COUNT_STEP, dtype=np.float64)
    places_m = level.places_of(np.stack(np.meshgrid(columns, columns, indexing="ij"), axis=-1))
    depth_m = level.depths_m(places_m)
    meeting = depth_m > LEAST_DEPTH_M
    if rig.pedestal_radius is not None and rig.world_from_left is not None:
        meeting &= np.hypot(places_m[..., 0], places_m[..., 1]) < BEYOND_WALL * rig.pedestal_radius
    depth_m = np.minimum(np.where(depth_m > LEAST_DEPTH_M, depth_m, np.inf), FARTHEST_M)
    ground_m2 = depth_m**3 / (level.focal_px**2 * abs(level.baseline_m))
    n_pairs = COUNT_STEP**2 * max(1, int(meeting.sum()))
    whole_m2 = COUNT_STEP**2 * float(ground_m2[meeting].sum())
    alike = np.where(meeting, whole_m2 / ground_m2, n_pairs)  # pairs, were all like this one
    coarse = threshold_sigmas(alike, expected_false_leaks)
    fine = np.repeat(np.repeat(coarse, COUNT_STEP, axis=0), COUNT_STEP, axis=1)[:width, :width]
    return np.where(inner_pairs(width), fine, np.inf).astype(np.float32)


def inner_pairs(width: int) -> NDArray[np.bool_]:
    """Pairs of columns (width, width) off the images' edges."""
    inside = np.zeros(width, np.bool_)
    inside[EDGE_PX : width - EDGE_PX] = True
    return inside[:, None] & inside[None, :]


def shared_lines(leaning: list[Streaks], believed: LevelPair, rig: Rig, least_sigmas: NDArray[np.float32]) -> Upright:
    """Lines that both views share, with the rig levelled by them: search, match, measure how they lean, again."""
    paths = fall_paths(leaning[0].rows_px, float(believed.principal_px[0, 1]), believed.focal_px)
    applied_rad = search_tilt(leaning, believed)
    tilt = no_tilt()
    for _ in range(LEVEL_ROUNDS):
        views = turned(leaning, believed, applied_rad)
        agreed = agreement(views[0], views[1], paths)
        tracks = shared_tracks(agreed.signed, agreed.bright, least_sigmas)
        tilt = fit_tilt(track_slopes(tracks, views), believed, applied_rad, leaning[0].rows_px)
        wanted_rad = tilt.tilt_rad if tilt.significant else np.zeros(2)
        if np.abs(wanted_rad - applied_rad).max() < SETTLED_RAD:
            break
        applied_rad = wanted_rad
    level = level_under(rig, believed, applied_rad) if applied_rad.any() else believed
    return Upright(views, level, replace(tilt, applied_rad=applied_rad), tracks)


def turned(leaning: Sequence[Streaks], believed: LevelPair, tilt_rad: Array) -> list[Streaks]:
    """Both views with the plumb lines of a tilted rig made columns."""
    if not tilt_rad.any():
        return list(leaning)
    columns = np.arange(believed.image_size[0], dtype=np.float64)
    stood = []
    for i, view in enumerate(leaning):
        leaning_px = leaning_columns(believed, tilt_rad, i, view.rows_px, columns)
        stood.append(
            replace(
                view,
                activity=upright(view.activity, leaning_px),
                glitter=upright(view.glitter, leaning_px),
                pixels=replace(view.pixels, lean_px=partial(leaning_columns, believed, tilt_rad, i)),
            )
        )
    return stood


def raw_columns(place_m: Array, rig: Rig) -> tuple[float, float]:
    """Columns of the raw images where the plumb line through a place (2,) crosses row (H - 1) / 2; NaN if it does not.

    rig: as it stands, its tilt included.
    """
    wanted = (rig.image_size[1] - 1) / 2
    columns = []
    for motion, K, D in ((rig.left_from_frame, rig.K1, rig.D1), (rig.right_from_frame, rig.K2, rig.D2)):
        foot_m, up = motion[:3] @ np.append(place_m, [0.0, 1.0]), motion[:3, 2]  # of the line, in the camera's frame
        slope = (wanted - K[1, 2]) / K[1, 1]  # that the row has without distortion: there the line crosses it, nearly
        height_m = (slope * foot_m[2] - foot_m[1]) / (up[1] - slope * up[2])
        middle_m = foot_m + height_m * up
        line_m = middle_m + LINE_REACH * middle_m[2] * np.linspace(-1.0, 1.0, LINE_POINTS)[:, None] * up
        if not (np.isfinite(line_m).all() and line_m[:, 2].min() > 0.0):
            columns.append(float("nan"))
            continue
        seen = cv2.projectPoints(line_m[:, None], np.zeros(3), np.zeros(3), K, D)[0][:, 0]
        order = np.argsort(seen[:, 1])
        crosses = seen[order[0], 1] <= wanted <= seen[order[-1], 1]
        columns.append(float(np.interp(wanted, seen[order, 1], seen[order, 0])) if crosses else float("nan"))
    return columns[0], columns[1]


def _leak(verdict: Verdict, level: LevelPair, rig: Rig) -> LeakEstimate:
    assert verdict.fit is not None
    columns_px = verdict.fit.columns_px
    place_m = level.places_of(columns_px[None])[0]
    drop_px = DROP_RADIUS_M * level.focal_px / float(level.depths_m(place_m[None])[0])
    covariance = verdict.fit.covariance_px2 + (_systematic_radii(verdict, rig) * drop_px) ** 2 * np.eye(2)
    slopes = level.place_slopes(columns_px)
    left_px, right_px = raw_columns(place_m, rig)
    return LeakEstimate(
        x_m=float(place_m[0]),
        y_m=float(place_m[1]),
        covariance_m2=slopes @ covariance @ slopes.T,
        score=verdict.line.track.sigmas,
        left_column_px=left_px,
        right_column_px=right_px,
        column_sigma_px=float(np.sqrt(np.trace(covariance) / 2)),
    )


def _systematic_radii(verdict: Verdict, rig: Rig) -> float:
    if rig.lamps is None:
        return SYSTEMATIC_RADII_UNTOLD
    return SYSTEMATIC_RADII if verdict.line.track.bright else SYSTEMATIC_RADII_BESIDE


def _describe(seen: Upright, verdicts: Sequence[Verdict], least: NDArray[np.float32]) -> dict[str, Any]:
    return {
        "threshold_sigmas": float(least.min()),
        "noise_grey": [view.noise_grey for view in seen.views],
        "levelling": seen.tilt.describe(),
        "row_offset": row_offset(seen.tracks, seen.views),
        "free_fall": free_fall(_falling(verdicts, seen.level), seen.views, seen.level),
        "lines": [_describe_line(verdict, seen.level) for verdict in verdicts],
    }


def _falling(verdicts: Sequence[Verdict], level: LevelPair) -> list[tuple[Array, float]]:
    """Columns and depth of every leak."""
    columns = [verdict.columns_px for verdict in verdicts if verdict.reason == LEAK]
    return [(c, float(level.depths_m(level.places_of(c[None]))[0])) for c in columns]


def _describe_line(verdict: Verdict, level: LevelPair) -> dict[str, Any]:
    track = verdict.line.track
    columns_px = verdict.columns_px if verdict.reason == LEAK else verdict.line.columns_px
    place_m = level.places_of(columns_px[None])[0]
    return {
        "left_column_px": float(columns_px[0]),
        "right_column_px": float(columns_px[1]),
        "x_m": float(place_m[0]),
        "y_m": float(place_m[1]),
        "sigmas": track.sigmas,
        "runner_up_sigmas": track.runner_up_sigmas if np.isfinite(track.runner_up_sigmas) else float("nan"),
        "polarity": verdict.line.polarity,
        "verdict": verdict.reason,
    }
