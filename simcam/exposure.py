"""When a drop is seen: the exposures of a clip's rows in the time since the drop's release."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simcam.lens import FloatArray
from simcam.recording import Recording
from simcam.structures import IndexArray


@dataclass(frozen=True)
class Exposures:
    """Drops in frames, one row each.

    opens_s, closes_s (n, height): the rows' exposure in time since the drop's release, no longer than it falls;
    first_pixel (n,): where the frame begins in the flat clip that is painted on.
    """

    opens_s: FloatArray
    closes_s: FloatArray
    first_pixel: IndexArray

    def __getitem__(self, which: slice | FloatArray) -> "Exposures":
        """Some of them."""
        return Exposures(self.opens_s[which], self.closes_s[which], self.first_pixel[which])


def drop_exposures(
    recording: Recording, frames: Sequence[int], released_s: FloatArray, falling_s: float, shape: tuple[int, int]
) -> Exposures:
    """Exposures of drops released at `released_s` (drops,) in the given frames, images of (height, width) one by one.

    Frames in which a drop is not falling are left out; frame by frame, drops in their order.
    """
    height, width = shape
    delays_s, released, numbers = recording.row_delays_s(height), np.asarray(released_s), np.asarray(frames)
    first_s = recording.opens_s(numbers)[:, None] + delays_s.min() - released
    last_s = recording.closes_s(numbers)[:, None] + delays_s.max() - released
    frame, drop = np.nonzero((last_s > 0) & (first_s < falling_s))  # most drops are not falling in most frames
    rows_s = delays_s - released[drop, None]
    opens = np.clip(recording.opens_s(numbers[frame])[:, None] + rows_s, 0, falling_s)
    closes = np.clip(recording.closes_s(numbers[frame])[:, None] + rows_s, 0, falling_s)
    return Exposures(opens, closes, frame * height * width)[(closes > opens).any(axis=1)]
