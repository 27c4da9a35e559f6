"""What became of a line that both views share: a leak, or the reason why not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from leakloc.levelled import LevelPair
from leakloc.linefit import LineFit
from leakloc.prediction import predict
from leakloc.rig import Array, Rig
from leakloc.tracks import Track

LEAK, SHADOW, SHADOW_OF_LEAK = "leak", "shadow", "shadow of a leak"
OUTSIDE, NO_MEETING, NOT_BRIGHT, DOUBLE = (
    "outside the pedestal",
    "meets behind the cameras or beyond the wall",
    "no bright part in both views",
    "the same as a leak",
)
AT_EDGE, GHOST = "at the edge of a view", "one column of each of two leaks"
LEAST_GLINT_SIGMAS = 4.0
DARK = -0.25  # polarity below which a line is dark for certain
SAME_PX = 3.0
SHADOW_PX, SHADOW_SPREADS = 2.0, 1.5  # how far a line may lie off the column predicted for a shadow


@dataclass(frozen=True, eq=False)
class Line:
    """A track as it is understood: polarity -1 (dark) to 1 (bright), its place (2,) m, whether on the wall."""

    track: Track
    columns_px: Array
    place_m: Array
    polarity: float
    on_wall: bool

    @property
    def is_shadowy(self) -> bool:
        """Whether it may be a shadow."""
        return not self.track.bright and (self.on_wall or self.polarity < DARK)


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

    def is_same(self, known: Verdict) -> bool:
        """Whether a leak is one that is known: both columns, or one if it was only guessed beside a shadow.

        Of a bright line also the columns where it was seen: they may be glints of that drop which its fit runs from.
        """
        near, seen = (np.abs(px - known.columns_px) < SAME_PX for px in (self.columns_px, self.line.columns_px))
        return bool(near.any()) if self.line.is_shadowy else bool(near.all() or seen.all())

    def explains(self, columns_px: Array, level: LevelPair, rig: Rig) -> bool:
        """Whether each of the columns is one of this leak's lines in that view, and at least one of its shadows."""
        expected = predict(level.places_of(self.columns_px[None])[0], level, rig)
        tolerance = SHADOW_PX + SHADOW_SPREADS * expected.spread_px + 0.25 * expected.blur_px
        on_shadow = (np.abs(expected.shadows_px - columns_px) < tolerance).any(axis=0)
        on_drop = np.abs(self.columns_px - columns_px) < SAME_PX
        return bool((on_shadow | on_drop).all() and on_shadow.any())
