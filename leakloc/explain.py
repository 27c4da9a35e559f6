"""Is a line a leak's drops, or a shadow? Polarity, lamp and wall decide; every refusal has its reason."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from leakloc.above import placed_by_rows
from leakloc.beside import drop_beside_shadow, together
from leakloc.betrayed import with_betrayed
from leakloc.levelled import LevelPair
from leakloc.linefit import Profile, fit_bright_line, fit_line
from leakloc.rig import Array, Rig
from leakloc.shadows import WALL_PX, stands_on_wall
from leakloc.signature import bright_sigmas, polarity, signed_profiles
from leakloc.streaks import Streaks
from leakloc.tracks import Track
from leakloc.verdict import (
    AT_EDGE,
    DARK,
    DOUBLE,
    GHOST,
    LEAK,
    LEAST_GLINT_SIGMAS,
    NO_MEETING,
    NOT_BRIGHT,
    OUTSIDE,
    SAME_PX,
    SHADOW,
    SHADOW_OF_LEAK,
    Line,
    Verdict,
)

LEAST_DEPTH_M = 0.2
BEYOND_WALL = 1.15  # of the pedestal's radius: lines that far out are still shadows on the wall
LEAST_GLINT_SHARE = 0.04  # of what the shadow beside takes: walls of a reflectance of 0.5 leave that
SURE_GLINT_SIGMAS = 12.0  # a drop beside a shadow that also is where another leak throws one
EDGE_PX = 3.0  # from a view's edge a line is not seen whole
WHOLE_SIGMAS = 10.0  # of what is bright: then its whole shape is worth fitting
SURE_RELIEF = 3.5  # standard deviations of the median's columns, of both views together
GHOST_SHARE = 0.6  # of the significance of the leaks whose columns a ghost has


def explain_tracks(tracks: Sequence[Track], views: Sequence[Streaks], level: LevelPair, rig: Rig) -> list[Verdict]:
    """A verdict per track: bright lines first, then what they leave unexplained; strongest first within each."""
    lines = [understand(track, views, level, rig) for track in tracks]
    lines.sort(key=lambda one: (one.is_shadowy, not one.track.bright, -one.track.sigmas))
    verdicts: list[Verdict] = []
    for line in lines:
        found = [v for v in verdicts if v.reason == LEAK]
        verdict = judge(line, views, (level, rig), found)
        if verdict.reason in (OUTSIDE, NOT_BRIGHT) and line.track.bright and line.on_wall:
            line = replace(line, track=replace(line.track, bright=False), polarity=-1.0)
            verdict = judge(line, views, (level, rig), found)
        if verdict.reason == LEAK and any(verdict.is_same(other) for other in found):
            verdict = replace(verdict, reason=SHADOW_OF_LEAK if line.is_shadowy else DOUBLE)
        if _faint(verdict) and any(leak.explains(line.columns_px, level, rig) for leak in found):
            verdict = replace(verdict, reason=SHADOW_OF_LEAK)
        verdicts.append(verdict)
    return without_ghosts(with_betrayed(verdicts, views, level, rig), level, rig)


def understand(track: Track, views: Sequence[Streaks], level: LevelPair, rig: Rig) -> Line:
    """Polarity and place of a track."""
    columns_px = np.array([track.left_px, track.right_px], dtype=np.float64)
    side = float(np.mean([polarity(view.activity, int(c)) for view, c in zip(views, columns_px, strict=True)]))
    on_wall = stands_on_wall(columns_px, level, rig)
    held = median_side(columns_px, views)
    if held == (-1.0 if on_wall else 1.0):
        side = held
    if on_wall and side < 0:  # the background of a busy shadow is dark: its pauses look bright
        track = replace(track, bright=False)
    return Line(track, columns_px, level.places_of(columns_px[None])[0], side, on_wall)


def median_side(columns_px: Array, views: Sequence[Streaks]) -> float:
    """1 if the median shows a bright line on the columns (2,), -1 a dark one, 0 none for certain.

    What falls most of the time is part of the background, and its pauses look like something of the other side.
    """
    reliefs = [view.relief[max(0, int(c) - 1) : int(c) + 2] for view, c in zip(views, columns_px, strict=True)]
    for side in (1.0, -1.0):
        left, right = (np.asarray((side * one).max()) for one in reliefs)
        if together(left, right) > SURE_RELIEF:
            return side
    return 0.0


def may_meet(place_m: Array, level: LevelPair, rig: Rig) -> bool:
    """Whether a line's place may be ahead of the cameras and not far beyond the wall."""
    if not (np.isfinite(place_m).all() and level.depths_m(place_m[None])[0] > LEAST_DEPTH_M):
        return False
    if rig.pedestal_radius is None or rig.world_from_left is None:
        return True
    return bool(np.hypot(*place_m) < BEYOND_WALL * rig.pedestal_radius)


def judge(line: Line, views: Sequence[Streaks], stage: tuple[LevelPair, Rig], found: Sequence[Verdict]) -> Verdict:
    """Fit the drop that a line shows, or the drop that its shadow implies and none of the leaks found before is."""
    level, rig = stage
    nearer_px = line.columns_px - np.array([0.0, WALL_PX])  # with a short baseline the wall is a pixel off the horizon
    if not any(may_meet(level.places_of(columns[None])[0], level, rig) for columns in (line.columns_px, nearer_px)):
        return Verdict(line, NO_MEETING)
    shadowy = line.is_shadowy
    profiles, start_px, height = _clearest(line, views, stage)
    if shadowy:
        if height < LEAST_GLINT_SIGMAS:
            return Verdict(line, SHADOW)
        known = any((np.abs(leak.columns_px - start_px) < SAME_PX).all() for leak in found)
        explained = any(leak.explains(line.columns_px, level, rig) for leak in found)
        if known or (explained and height < SURE_GLINT_SIGMAS):
            return Verdict(line, SHADOW_OF_LEAK)
    if not np.isfinite(level.places_of(start_px[None])).all():
        return Verdict(line, NO_MEETING)
    if line.track.bright and rig.lamps is not None:  # where the glints lie is known with the lamps alone
        fit = fit_bright_line(profiles, start_px, stage)
    else:
        fit = fit_line(profiles, start_px, stage, line.columns_px if shadowy else None)
        if shadowy:
            columns_px, covariance_px2 = placed_by_rows(
                fit.columns_px, fit.covariance_px2, line.columns_px, views, stage
            )
            fit = replace(fit, columns_px=columns_px, covariance_px2=covariance_px2)
    place_m = level.places_of(fit.columns_px[None])[0]
    if not np.isfinite(place_m).all():
        return Verdict(line, NO_MEETING)
    if rig.pedestal_radius is not None and rig.world_from_left is not None and np.hypot(*place_m) > rig.pedestal_radius:
        return Verdict(line, OUTSIDE, fit)
    if together(fit.glint_sigmas[0], fit.glint_sigmas[1]) < LEAST_GLINT_SIGMAS:
        return Verdict(line, NOT_BRIGHT, fit)
    if shadowy and fit.glint_shares.min() < LEAST_GLINT_SHARE:
        return Verdict(line, SHADOW, fit)
    if (np.minimum(fit.columns_px, level.image_size[0] - 1 - fit.columns_px) < EDGE_PX).any():
        return Verdict(line, AT_EDGE, fit)
    return Verdict(line, LEAK, fit)


def _clearest(
    line: Line, views: Sequence[Streaks], stage: tuple[LevelPair, Rig]
) -> tuple[Sequence[Profile], Array, float]:
    """Profiles to fit, of the activity without hits or of the glitter; columns (2,) of what is bright, significance.

    Where there is enough of what is bright, its whole shape is worth more than the significance that the noise costs.
    """
    level, rig = stage
    found = []
    for activities in zip(*((view.activity, view.glitter) for view in views), strict=True):
        profiles = signed_profiles(activities, line.columns_px, -1.0 if line.polarity < 0 and line.is_shadowy else 1.0)
        if line.is_shadowy:
            found.append((profiles, *drop_beside_shadow(profiles, line.columns_px, level, rig)))
        else:
            found.append((profiles, line.columns_px, bright_sigmas(profiles, line.columns_px)))
    clipped, whole = found
    return whole if whole[2] > min(clipped[2], WHOLE_SIGMAS) else clipped


def _faint(verdict: Verdict) -> bool:
    """Whether a line that is not bright for certain shows no drop of its own, or hardly.

    What brightens in step in both views, though what passes is dark there, are the pauses of a busy shadow.
    """
    if verdict.line.track.bright:
        return verdict.line.polarity < DARK
    if verdict.line.polarity > -DARK and not verdict.line.on_wall:
        return False
    if verdict.reason != LEAK or verdict.fit is None:
        return True
    if verdict.line.polarity < 0 and not verdict.line.is_shadowy:  # bright in its profile as any line not turned
        return True
    return bool(together(verdict.fit.glint_sigmas[0], verdict.fit.glint_sigmas[1]) < SURE_GLINT_SIGMAS)


def without_ghosts(verdicts: Sequence[Verdict], level: LevelPair, rig: Rig) -> list[Verdict]:
    """Leaks that others explain are none: faint ones on the shadows of one, and columns that belong to two.

    With several lamps shadows pair crosswise, and drops that fall in step agree crosswise.
    """
    leaks = [v for v in verdicts if v.reason == LEAK]
    shades = {
        id(weak)
        for weak in leaks
        for strong in leaks
        if strong is not weak and _faint(weak) and strong.explains(weak.line.columns_px, level, rig)
    }
    ghosts = {id(weak) for weak in leaks if _is_crosswise(weak, leaks)}
    return [
        replace(v, reason=SHADOW_OF_LEAK) if id(v) in shades else replace(v, reason=GHOST) if id(v) in ghosts else v
        for v in verdicts
    ]


def _is_crosswise(weak: Verdict, leaks: Sequence[Verdict]) -> bool:
    """Whether either column is that of a leak, another one on each side, both much surer."""
    sure = [v for v in leaks if weak.line.track.sigmas < GHOST_SHARE * v.line.track.sigmas]
    taken = np.array([np.abs(v.columns_px - weak.columns_px) < SAME_PX for v in sure]).reshape(-1, 2)
    return bool(taken.any(axis=0).all())
