"""Is a line a leak's drops, or a shadow? Polarity, lamp and wall decide; every refusal has its reason."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from leakloc.beside import drop_beside_shadow, together
from leakloc.levelled import LevelPair
from leakloc.linefit import LineFit, Profile, fit_line, predict
from leakloc.nearwall import near_wall
from leakloc.rig import Array, Rig
from leakloc.shaded import COLUMN_SIGMA_PX, drop_of_shadow
from leakloc.signature import polarity, signature, signed_profile
from leakloc.streaks import Streaks
from leakloc.tracks import Track

LEAK, SHADOW, SHADOW_OF_LEAK = "leak", "shadow", "shadow of a leak"
OUTSIDE, NO_MEETING, NOT_BRIGHT, DOUBLE = (
    "outside the pedestal",
    "meets behind the cameras or beyond the wall",
    "no bright part in both views",
    "the same as a leak",
)
AT_EDGE, GHOST = "at the edge of a view", "one column of each of two leaks"
LEAST_DEPTH_M = 0.2
BEYOND_WALL = 1.15  # of the pedestal's radius: lines that far out are still shadows on the wall
WALL_PX = 1.5  # error of a line's disparity when it is asked whether it stands on the wall
DARK = -0.25  # polarity below which a line is dark for certain
LEAST_GLINT_SIGMAS = 4.0
LEAST_GLINT_SHARE = 0.04  # of what the shadow beside takes: walls of a reflectance of 0.5 leave that
SURE_GLINT_SIGMAS = 12.0  # a drop beside a shadow that also is where another leak throws one
SAME_PX = 3.0
EDGE_PX = 3.0  # from a view's edge a line is not seen whole
GHOST_SHARE = 0.6  # of the significance of the leaks whose columns a ghost has
SHADOW_PX, SHADOW_SPREADS = 2.0, 1.5  # how far a line may lie off the column predicted for a shadow


@dataclass(frozen=True, eq=False)
class Line:
    """A track as it is understood: polarity -1 (dark) to 1 (bright), its place (2,) m, whether on the wall."""

    track: Track
    columns_px: Array
    place_m: Array
    polarity: float
    on_wall: bool


@dataclass(frozen=True, eq=False)
class Verdict:
    """What became of a line: LEAK with its fit, or the reason why not."""

    line: Line
    reason: str
    fit: LineFit | None = None

    @property
    def columns_px(self) -> Array:
        """Of the drop where there is one, else of the line itself, (2,)."""
        return self.line.columns_px if self.fit is None else self.fit.columns_px


def explain_tracks(tracks: Sequence[Track], views: Sequence[Streaks], level: LevelPair, rig: Rig) -> list[Verdict]:
    """A verdict per track: bright lines first, then what they leave unexplained; strongest first within each."""
    lines = [understand(track, views, level, rig) for track in tracks]
    verdicts: list[Verdict] = []
    for line in sorted(lines, key=lambda one: (_shadowy(one), not one.track.bright, -one.track.sigmas)):
        found = [v for v in verdicts if v.reason == LEAK]
        verdict = judge(line, views, (level, rig), found)
        if verdict.reason in (OUTSIDE, NOT_BRIGHT) and line.track.bright and line.on_wall:
            line = replace(line, track=replace(line.track, bright=False), polarity=-1.0)
            verdict = judge(line, views, (level, rig), found)
        if verdict.reason == LEAK and any(_same(verdict, other) for other in found):
            verdict = replace(verdict, reason=SHADOW_OF_LEAK if _shadowy(line) else DOUBLE)
        if _faint(verdict) and any(_explains(leak, line.columns_px, level, rig) for leak in found):
            verdict = replace(verdict, reason=SHADOW_OF_LEAK)
        verdicts.append(verdict)
    return without_ghosts(with_shaded(verdicts, views, level, rig), level, rig)


def with_shaded(verdicts: Sequence[Verdict], views: Sequence[Streaks], level: LevelPair, rig: Rig) -> list[Verdict]:
    """The same, with the leaks that shadows betray which no leak explains."""
    if rig.world_from_left is None:
        return list(verdicts)
    told: list[Verdict] = []
    for verdict in verdicts:
        found = [v for v in [*verdicts, *told] if v.reason == LEAK]
        line = verdict.line
        unexplained = verdict.reason in (SHADOW, NOT_BRIGHT, OUTSIDE) and line.on_wall and not line.track.bright
        if not unexplained or any(_explains(leak, line.columns_px, level, rig) for leak in found):
            told.append(verdict)
            continue
        told.append(_betrayed(verdict, found, views, level, rig))
    return told


def _betrayed(
    verdict: Verdict, found: Sequence[Verdict], views: Sequence[Streaks], level: LevelPair, rig: Rig
) -> Verdict:
    """A shadow's verdict once its drop has been looked for in its rhythm, and then close to the wall."""
    line = verdict.line
    none, unknown = np.full(2, np.nan), float("nan")
    drop = drop_of_shadow(line.columns_px, views, level, rig)
    if drop is not None and np.hypot(*level.places_of(drop.columns_px[None])[0]) < (rig.pedestal_radius or np.inf):
        fit = LineFit(drop.columns_px, COLUMN_SIGMA_PX**2 * np.eye(2), none, none, unknown)
        known = any(_same(Verdict(line, LEAK, fit), leak) for leak in found)
        return Verdict(line, SHADOW_OF_LEAK if known else LEAK, fit)
    close = near_wall(signed_profiles(line, views, -1.0), line.columns_px, level, rig)
    if close is None:
        return verdict
    steps = 0.1 * np.eye(2)
    slopes = np.stack(
        [
            (level.columns_of((close.place_m + s)[None])[0] - level.columns_of((close.place_m - s)[None])[0]) / 0.2
            for s in steps
        ],
        axis=1,
    )
    return Verdict(line, LEAK, LineFit(close.columns_px, slopes @ close.covariance_m2 @ slopes.T, none, none, unknown))


def understand(track: Track, views: Sequence[Streaks], level: LevelPair, rig: Rig) -> Line:
    """Polarity and place of a track."""
    columns_px = np.array([track.left_px, track.right_px], dtype=np.float64)
    side = float(np.mean([polarity(view.activity, int(c)) for view, c in zip(views, columns_px, strict=True)]))
    on_wall = stands_on_wall(columns_px, level, rig)
    if on_wall and side < 0:  # the background of a busy shadow is dark: its pauses look bright
        track = replace(track, bright=False)
    return Line(track, columns_px, level.places_of(columns_px[None])[0], 1.0 if track.bright else side, on_wall)


def may_meet(place_m: Array, level: LevelPair, rig: Rig) -> bool:
    """Whether the columns meet ahead of the cameras and not far beyond the wall."""
    if not (np.isfinite(place_m).all() and level.depths_m(place_m[None])[0] > LEAST_DEPTH_M):
        return False
    if rig.pedestal_radius is None or rig.world_from_left is None:
        return True
    return bool(np.hypot(*place_m) < BEYOND_WALL * rig.pedestal_radius)


def stands_on_wall(columns_px: Array, level: LevelPair, rig: Rig) -> bool:
    """Whether a line may lie on the pedestal's wall or beyond, within the error of its disparity."""
    if rig.pedestal_radius is None or rig.world_from_left is None:
        return False
    error_px = np.array([0.0, WALL_PX])
    nearer, farther = (level.places_of((columns_px + off_px)[None])[0] for off_px in (-error_px, error_px))
    return not (np.hypot(*farther) < rig.pedestal_radius and np.hypot(*nearer) < rig.pedestal_radius)


def judge(line: Line, views: Sequence[Streaks], stage: tuple[LevelPair, Rig], found: Sequence[Verdict]) -> Verdict:
    """Fit the drop that a line shows, or the drop that its shadow implies and none of the leaks found before is."""
    level, rig = stage
    if not may_meet(line.place_m, level, rig):
        return Verdict(line, NO_MEETING)
    shadowy = _shadowy(line)
    profiles = signed_profiles(line, views, -1.0 if line.polarity < 0 and shadowy else 1.0)
    start_px = line.columns_px
    if shadowy:
        start_px, height = drop_beside_shadow(profiles, line.columns_px, level, rig)
        if height < LEAST_GLINT_SIGMAS:
            return Verdict(line, SHADOW)
        known = any((np.abs(leak.columns_px - start_px) < SAME_PX).all() for leak in found)
        explained = any(_explains(leak, line.columns_px, level, rig) for leak in found)
        if known or (explained and height < SURE_GLINT_SIGMAS):
            return Verdict(line, SHADOW_OF_LEAK)
    if not np.isfinite(level.places_of(start_px[None])).all():
        return Verdict(line, NO_MEETING)
    fit = fit_line(profiles, start_px, level, rig, line.columns_px if shadowy else None)
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


def signed_profiles(line: Line, views: Sequence[Streaks], sign: float) -> list[Profile]:
    """Both views' profiles of a line, each by the other view's signature."""
    signatures = [signature(view.activity, int(c), sign) for view, c in zip(views, line.columns_px, strict=True)]
    return [signed_profile(views[0].activity, signatures[1]), signed_profile(views[1].activity, signatures[0])]


def _faint(verdict: Verdict) -> bool:
    """Whether a line that is not bright for certain shows no drop of its own, or hardly."""
    if verdict.line.track.bright or (verdict.line.polarity > -DARK and not verdict.line.on_wall):
        return False
    if verdict.reason != LEAK or verdict.fit is None:
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
        if strong is not weak and _faint(weak) and _explains(strong, weak.line.columns_px, level, rig)
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


def _explains(leak: Verdict, columns_px: Array, level: LevelPair, rig: Rig) -> bool:
    """Whether each of the columns is one of the leak's lines in that view, and at least one of its shadows."""
    expected = predict(level.places_of(leak.columns_px[None])[0], level, rig)
    tolerance = SHADOW_PX + SHADOW_SPREADS * expected.spread_px + 0.25 * expected.blur_px
    on_shadow = (np.abs(expected.shadows_px - columns_px) < tolerance).any(axis=0)
    on_drop = np.abs(leak.columns_px - columns_px) < SAME_PX
    return bool((on_shadow | on_drop).all() and on_shadow.any())


def _shadowy(line: Line) -> bool:
    return not line.track.bright and (line.on_wall or line.polarity < DARK)


def _same(one: Verdict, known: Verdict) -> bool:
    """Whether a leak is one that is known: both columns, or one if it was only guessed beside a shadow."""
    near = np.abs(one.columns_px - known.columns_px) < SAME_PX
    return bool(near.any() if _shadowy(one.line) else near.all())
