"""Leaks that no line of their own shows, betrayed by a shadow: in its rhythm, or by how crisp it is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from leakloc.above import placed_by_rows
from leakloc.levelled import LevelPair
from leakloc.linefit import LineFit
from leakloc.nearwall import near_wall
from leakloc.rig import Rig
from leakloc.shaded import COLUMN_SIGMA_PX, drop_of_shadow
from leakloc.shadows import stands_on_wall
from leakloc.signature import signed_profiles
from leakloc.streaks import Streaks
from leakloc.verdict import DARK, LEAK, NOT_BRIGHT, OUTSIDE, SHADOW, SHADOW_OF_LEAK, Verdict

BROAD_WALL_PX = 3.0  # by which the disparity of a dark line may be off: shadows from afar are broad


def with_betrayed(verdicts: Sequence[Verdict], views: Sequence[Streaks], level: LevelPair, rig: Rig) -> list[Verdict]:
    """The same, with the leaks that shadows betray which no leak explains."""
    if rig.world_from_left is None:
        return list(verdicts)
    told: list[Verdict] = []
    for verdict in verdicts:
        found = [v for v in [*verdicts, *told] if v.reason == LEAK]
        line = verdict.line
        on_wall = line.on_wall or (line.polarity < DARK and stands_on_wall(line.columns_px, level, rig, BROAD_WALL_PX))
        unexplained = verdict.reason in (SHADOW, NOT_BRIGHT, OUTSIDE) and on_wall and not line.track.bright
        if not unexplained or any(leak.explains(line.columns_px, level, rig) for leak in found):
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
        by_rhythm = drop.columns_px, COLUMN_SIGMA_PX**2 * np.eye(2)
        placed = placed_by_rows(*by_rhythm, line.columns_px, views, (level, rig))
        fit = LineFit(*placed, none, none, unknown)
        known = any(Verdict(line, LEAK, fit).is_same(leak) for leak in found)
        return Verdict(line, SHADOW_OF_LEAK if known else LEAK, fit)
    close = near_wall(
        signed_profiles([view.activity for view in views], line.columns_px, -1.0), line.columns_px, level, rig
    )
    if close is None:
        return verdict
    slopes = level.column_slopes(close.place_m)
    by_profile = close.columns_px, slopes @ close.covariance_m2 @ slopes.T
    return Verdict(
        line,
        LEAK,
        LineFit(*placed_by_rows(*by_profile, line.columns_px, views, (level, rig)), none, none, unknown),
    )
