"""The robust method: what both views saw fall on the same rows at the same instants, drops told from their shadows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from leakloc.background import Frames
from leakloc.beside import drop_beside_shadow
from leakloc.correlate import agreement, threshold_sigmas
from leakloc.estimate import Estimate, LeakEstimate
from leakloc.levelled import LevelPair, level_pair, levelled_frames
from leakloc.linefit import Profile, fit_line
from leakloc.rig import Array, Rig
from leakloc.signature import polarity, signature, signed_profile
from leakloc.streaks import Streaks, streaks
from leakloc.tracks import Track, match_tracks

EDGE_PX = 3
LEAST_DEPTH_M = 0.2
BEYOND_WALL = 1.15  # of the pedestal's radius: lines that far out are still shadows on the wall
FAR_PX = 2.0  # least disparity without a wall
WALL_PX = 1.5  # error of a line's disparity when it is asked whether it stands on the wall
LEAST_GLINT_SIGMAS = 4.0
SAME_PX = 3.0
SYSTEMATIC_PX = 0.2  # of a drop's column: where in the drop its glints stand depends on what it mirrors


@dataclass(frozen=True, eq=False)
class Verdict:
    """What became of a track: a leak, or the reason why not."""

    track: Track
    columns_px: Array
    place_m: Array
    polarity: float
    reason: str
    leak: LeakEstimate | None = None


def locate_robustly(left: Frames, right: Frames, rig: Rig, expected_false_leaks: float) -> Estimate:
    """Leaks, with every rejected line and its reason in the diagnostics."""
    level = level_pair(rig)
    views = [streaks(levelled_frames(frames, level, view)) for view, frames in enumerate((left, right))]
    allowed = allowed_pairs(level, rig)
    least = threshold_sigmas(int(allowed.sum()), expected_false_leaks)
    sigmas = agreement(views[0].activity, views[1].activity).sigmas
    tracks = match_tracks(sigmas, allowed, least)
    verdicts = without_doubles([explain(track, views, level, rig) for track in tracks])
    leaks = tuple(v.leak for v in verdicts if v.leak is not None)
    return Estimate("robust", rig.frame, leaks, _describe(views, verdicts, least))


def allowed_pairs(level: LevelPair, rig: Rig) -> NDArray[np.bool_]:
    """Pairs of columns (width, width) that meet ahead of the cameras and not far beyond the wall."""
    width = level.image_size[0]
    columns = np.arange(width, dtype=np.float64)
    pairs = np.stack(np.meshgrid(columns, columns, indexing="ij"), axis=-1)
    places_m = level.places_of(pairs)
    allowed = level.depths_m(places_m) > LEAST_DEPTH_M
    if rig.pedestal_radius is not None and rig.world_from_left is not None:
        allowed &= np.hypot(places_m[..., 0], places_m[..., 1]) < BEYOND_WALL * rig.pedestal_radius
    else:
        allowed &= np.abs(pairs[..., 0] - pairs[..., 1]) > FAR_PX
    inside = (columns >= EDGE_PX) & (columns < width - EDGE_PX)
    return np.asarray(allowed & inside[:, None] & inside[None, :])


def explain(track: Track, views: Sequence[Streaks], level: LevelPair, rig: Rig) -> Verdict:
    """Is this line a leak's, or a shadow?"""
    columns_px = np.array([track.left_px, track.right_px], dtype=np.float64)
    place_m = level.places_of(columns_px[None])[0]
    sides = [polarity(view.activity, int(c)) for view, c in zip(views, columns_px, strict=True)]
    bright = float(np.mean(sides))
    on_wall = stands_on_wall(columns_px, level, rig)
    if not on_wall and (bright > 0 or rig.pedestal_radius is not None):
        bright = abs(bright)
    profiles = _profiles(columns_px, views, bright)
    if bright < 0 or on_wall:
        start_px, height = drop_beside_shadow(profiles, columns_px, level, rig)
        if height < LEAST_GLINT_SIGMAS:
            return Verdict(track, columns_px, place_m, bright, "shadow")
    else:
        start_px = columns_px
    fit = fit_line(profiles, start_px, level, rig)
    place_m = level.places_of(fit.columns_px[None])[0]
    if not np.isfinite(place_m).all():
        return Verdict(track, columns_px, place_m, bright, "does not meet ahead")
    if rig.pedestal_radius is not None and np.hypot(*place_m) > rig.pedestal_radius:
        return Verdict(track, columns_px, place_m, bright, "outside the pedestal")
    if fit.glint_sigmas.min() < LEAST_GLINT_SIGMAS:
        return Verdict(track, columns_px, place_m, bright, "no bright part in both views")
    return Verdict(track, columns_px, place_m, bright, "", _leak(track, fit.columns_px, fit.covariance_px2, level))


def stands_on_wall(columns_px: Array, level: LevelPair, rig: Rig) -> bool:
    """Whether a line may lie on the pedestal's wall or beyond, within the error of its disparity."""
    if rig.pedestal_radius is None or rig.world_from_left is None:
        return False
    error_px = np.array([0.0, WALL_PX])
    nearer, farther = (level.places_of((columns_px + off_px)[None])[0] for off_px in (-error_px, error_px))
    return not (np.hypot(*farther) < rig.pedestal_radius and np.hypot(*nearer) < rig.pedestal_radius)


def without_doubles(verdicts: Sequence[Verdict]) -> list[Verdict]:
    """A leak found through its drop and again through its shadow is one leak: the surer one stays."""
    kept: list[Verdict] = []
    for verdict in sorted(verdicts, key=lambda v: -v.track.sigmas):
        leak = verdict.leak
        if leak is not None and any(_same(leak, other.leak) for other in kept if other.leak is not None):
            verdict = Verdict(verdict.track, verdict.columns_px, verdict.place_m, verdict.polarity, "shadow of a leak")
        kept.append(verdict)
    return kept


def _same(one: LeakEstimate, other: LeakEstimate) -> bool:
    return (
        abs(one.left_column_px - other.left_column_px) < SAME_PX
        or abs(one.right_column_px - other.right_column_px) < SAME_PX
    )


def _profiles(columns_px: Array, views: Sequence[Streaks], bright: float) -> list[Profile]:
    signatures = [signature(view.activity, int(c), bright) for view, c in zip(views, columns_px, strict=True)]
    return [signed_profile(views[0].activity, signatures[1]), signed_profile(views[1].activity, signatures[0])]


def _leak(track: Track, columns_px: Array, covariance_px2: Array, level: LevelPair) -> LeakEstimate:
    covariance = covariance_px2 + SYSTEMATIC_PX**2 * np.eye(2)
    slopes = np.stack(
        [
            (level.places_of((columns_px + step)[None])[0] - level.places_of((columns_px - step)[None])[0]) / 0.2
            for step in 0.1 * np.eye(2)
        ],
        axis=1,
    )
    place_m = level.places_of(columns_px[None])[0]
    return LeakEstimate(
        x_m=float(place_m[0]),
        y_m=float(place_m[1]),
        covariance_m2=slopes @ covariance @ slopes.T,
        score=track.sigmas,
        left_column_px=float(columns_px[0]),
        right_column_px=float(columns_px[1]),
        column_sigma_px=float(np.sqrt(np.trace(covariance) / 2)),
    )


def _describe(views: Sequence[Streaks], verdicts: Sequence[Verdict], least: float) -> dict[str, Any]:
    return {
        "threshold_sigmas": least,
        "noise_grey": [view.noise_grey for view in views],
        "lines": [
            {
                "left_column_px": float(v.columns_px[0]),
                "right_column_px": float(v.columns_px[1]),
                "x_m": float(v.place_m[0]),
                "y_m": float(v.place_m[1]),
                "sigmas": v.track.sigmas,
                "runner_up_sigmas": v.track.runner_up_sigmas if np.isfinite(v.track.runner_up_sigmas) else float("nan"),
                "polarity": v.polarity,
                "verdict": v.reason or "leak",
            }
            for v in verdicts
        ],
    }
