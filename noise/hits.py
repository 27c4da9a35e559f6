"""The truth of a clip's radiation: one row per electron track."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from noise.arrays import Array


@dataclass(frozen=True)
class GammaHits:
    """Tracks, one row each: `frame`, entry point `x_px`, `y_px` (a pixel's centre is an integer), and what it left.

    `length_px` is the lateral length of the chord that the entry direction cuts from the layer: the quantity of the
    length law. An electron that stops or is scattered out leaves a shorter mark. `azimuth_rad` is the entry direction,
    from +u towards +v, in (-pi, pi]. `deposit_kev` and `charge_e` are what the whole track left in the layer, outside
    the image included. Rows are in order of frame.
    """

    frame: np.ndarray
    x_px: Array
    y_px: Array
    length_px: Array
    azimuth_rad: Array
    deposit_kev: Array
    charge_e: Array

    def __len__(self) -> int:
        """Number of tracks."""
        return len(self.frame)

    def where(self, rows: np.ndarray) -> GammaHits:
        """Some of the rows: numbers, or True and False for each."""
        return GammaHits(**{field.name: getattr(self, field.name)[rows] for field in fields(self)})

    def in_frame(self, frame: int) -> GammaHits:
        """The rows of one frame."""
        return self.where(self.frame == frame)


def joined_hits(parts: list[GammaHits]) -> GammaHits:
    """Tables one after the other."""
    return GammaHits(
        **{field.name: np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(GammaHits)}
    )


def no_hits() -> GammaHits:
    """A table without rows."""
    empty = np.zeros(0)
    return GammaHits(np.zeros(0, dtype=np.int32), empty, empty, empty, empty, empty, empty)
