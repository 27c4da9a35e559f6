"""A drop as lines across the image's rows: the strips of its disc and its glints, ready to be swept.

A line has a place down the disc, a centre and a half width along the row (all in drop radii), an area (of the unit
disc; 0 for a glint, which covers nothing) and its light, cumulated from left to right.
"""

from dataclasses import dataclass

import numpy as np

from simcam.dropview import SAMPLES_ACROSS, Disc, Glints
from simcam.lens import FloatArray

MIN_HALF_WIDTH = 1e-3  # radii: narrower than any glint, so that a division is defined


@dataclass(frozen=True)
class Lines:
    """Per place on the path and line (places, lines): down, centre, half_width in radii, area; and

    cumulated (places, lines, SAMPLES_ACROSS + 1): radiance times area of the unit disc, W m^-2 sr^-1, from the left.
    """

    down: FloatArray
    centre: FloatArray
    half_width: FloatArray
    area: FloatArray
    cumulated: FloatArray


def drop_lines(disc: Disc, radiance: FloatArray, glints: Glints) -> Lines:
    """Strips with their sampled radiance (places, strips, across), then the glints."""
    places, strips, _ = radiance.shape
    area = 2 * disc.half_width * disc.height
    strip_light = _cumulated(radiance * (area / SAMPLES_ACROSS)[:, None])
    even = np.linspace(0, 1, SAMPLES_ACROSS + 1)

    def beside(strip_values: FloatArray, glint_values: FloatArray) -> FloatArray:
        return np.concatenate([np.broadcast_to(strip_values, (places, strips)), glint_values], axis=1)

    return Lines(
        beside(disc.middle, glints.down),
        beside(np.zeros(strips), glints.right),
        beside(disc.half_width, np.maximum(glints.half_width, MIN_HALF_WIDTH)),
        beside(area, np.zeros_like(glints.right)),
        np.concatenate([strip_light, glints.strength[:, :, None] * even], axis=1).astype(np.float32),
    )


def _cumulated(values: FloatArray) -> FloatArray:
    total = np.zeros((*values.shape[:-1], values.shape[-1] + 1))
    np.cumsum(values, axis=-1, out=total[..., 1:])
    return total
