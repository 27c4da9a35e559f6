"""One frame through the sensor chain: shot, dark, hits, full well, read noise, defects, converter."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from scipy.special import ndtri

from noise.arrays import Array, Frames
from noise.sensor import Sensor
from noise.streams import CLIP, Stream, rng_for

NORMAL_FROM_E = 20.0
"""Above this mean a Poisson number is drawn as a normal one with its skewness (error of the law below 1 %)."""

VARIANCE_OF_SKEW = np.float32(1 / 18)
"""Variance of (z^2 - 1) / 6, the term that gives a normal number z the skewness of a Poisson number."""

SRGB_TABLE_BITS = 12
"""Of more bits a level of the dark is less than a step of the table of tones, which has 65 536."""

BLOCK_ROWS = 48
"""Rows that are worked on at a time: four such blocks of 960 columns stay in the second-level cache."""


@dataclass(frozen=True)
class Key:
    """Where a draw belongs: `seed`, `camera`, `frame`."""

    seed: int
    camera: int
    frame: int

    def rng(self, stream: Stream) -> np.random.Generator:
        """Generator of a purpose in this frame."""
        return rng_for(self.seed, stream, self.camera, self.frame)

    def clip_rng(self, stream: Stream) -> np.random.Generator:
        """Generator of a purpose that the whole clip shares."""
        return rng_for(self.seed, stream, self.camera, CLIP)


def expose(mean_e: Array, hits_e: Array | None, sensor: Sensor, exposure_s: float, key: Key) -> Frames:
    """Grey frame (height, width) of expected photo-electrons and the electrons of hits (None: no hits)."""
    signal: Array = mean_e.astype(np.float32)
    if sensor.shot_noise:
        add_shot_noise(signal, mean_e, key)
    add_dark_current(signal, sensor, exposure_s, key)
    if hits_e is not None:
        add = np.add if sensor.combination == "sum" else np.maximum
        add(signal, hits_e, out=signal)
    if sensor.blur_px > 0:
        signal = cv2.GaussianBlur(signal, (0, 0), sensor.blur_px)
    np.clip(signal, 0, sensor.full_well_e, out=signal)
    add_line_noise(signal, sensor, key)
    if sensor.read_noise_e > 0:
        add_read_noise(signal, sensor.read_noise_e, key)
    if sensor.defect_threshold_grey is not None:
        signal = without_single_bright_pixels(signal, sensor.defect_threshold_grey * sensor.electrons_per_grey)
    return convert(signal, sensor)


def add_shot_noise(signal: Array, mean_e: Array, key: Key) -> None:
    """Poisson fluctuation of photo-electrons, in place: mean and variance are the expected number.

    Slow definition: `rng.poisson(mean_e)`. Where the mean is above NORMAL_FROM_E a normal number with the Poisson's
    skewness (Cornish-Fisher, Abramowitz and Stegun 26.2.49, variance restored), below it a true Poisson number.
    """
    rng = key.rng(Stream.SHOT)
    for rows in row_blocks(len(signal)):
        z = draw_normal(1.0, signal[rows].shape, rng=rng)
        work = np.maximum(mean_e[rows], np.float32(1))
        work -= VARIANCE_OF_SKEW
        np.sqrt(work, out=work)
        work += z * np.float32(1 / 6)
        work *= z
        work -= np.float32(1 / 6)
        signal[rows] += work
    dim = np.flatnonzero(mean_e.reshape(-1) < NORMAL_FROM_E)
    if len(dim):
        signal.reshape(-1)[dim] = key.rng(Stream.SHOT_DIM).poisson(mean_e.reshape(-1)[dim])


def add_read_noise(signal: Array, read_noise_e: float, key: Key) -> None:
    """Normal noise of the read-out, in place. Slow definition: `signal += rng.normal(0, read_noise_e, shape)`."""
    rng = key.rng(Stream.READ)
    for rows in row_blocks(len(signal)):
        signal[rows] += draw_normal(read_noise_e, signal[rows].shape, rng=rng)


def row_blocks(height: int) -> list[slice]:
    """The rows of an image in blocks."""
    return [slice(top, min(top + BLOCK_ROWS, height)) for top in range(0, height, BLOCK_ROWS)]


def draw_normal(sigma: float, shape: tuple[int, ...], *, rng: np.random.Generator) -> Array:
    """Normal numbers (float32) by 16 random bits each: ten times as fast as, and the definition is, `rng.normal`.

    The 65 536 values are the quantiles of the normal law, to 4.2 sigma on either side: the 3 numbers in 100 000 that
    should lie farther out lie there.
    """
    count = math.prod(shape)
    words = rng.bit_generator.random_raw(-(-count // 4)).astype("<u8", copy=False)
    places = words.view("<u2")[:count].reshape(shape)
    return np.take(normal_table(sigma), places, mode="wrap")  # the mode that checks no place: each is in the table


@lru_cache(maxsize=8)
def normal_table(sigma: float) -> Array:
    """The 65 536 equally likely values of a quantised normal number, scaled to exactly its variance (float32)."""
    values = ndtri((np.arange(2**16) + 0.5) / 2**16)
    return (sigma * values / values.std()).astype(np.float32)


def add_dark_current(signal: Array, sensor: Sensor, exposure_s: float, key: Key) -> None:
    """Thermal electrons of all pixels and of the hot ones, in place."""
    if sensor.dark_e_s > 0:
        signal += key.rng(Stream.DARK).poisson(sensor.dark_e_s * exposure_s, signal.shape)
    if sensor.hot_pixel_share > 0:
        place, rate_e_s = hot_pixels(signal.shape, sensor, key)
        signal.reshape(-1)[place] += key.rng(Stream.HOT_PIXEL).poisson(rate_e_s * exposure_s)


def hot_pixels(shape: tuple[int, ...], sensor: Sensor, key: Key) -> tuple[np.ndarray, Array]:
    """Flat places and dark currents (e-/s) of a camera's hot pixels: the same in every frame of the clip."""
    rng = key.clip_rng(Stream.HOT_PIXEL)
    n_pixels = int(np.prod(shape))
    place = rng.choice(n_pixels, rng.binomial(n_pixels, sensor.hot_pixel_share), replace=False)
    return place, rng.exponential(sensor.hot_pixel_e_s, len(place))


def add_line_noise(signal: Array, sensor: Sensor, key: Key) -> None:
    """Offsets of whole rows, fresh in every frame, and of whole columns, fixed for the clip; in place."""
    height, width = signal.shape
    if sensor.row_noise_e > 0:
        signal += (sensor.row_noise_e * key.rng(Stream.ROW).standard_normal((height, 1))).astype(np.float32)
    if sensor.column_noise_e > 0:
        signal += (sensor.column_noise_e * key.clip_rng(Stream.COLUMN).standard_normal((1, width))).astype(np.float32)


def without_single_bright_pixels(signal: Array, threshold_e: float) -> Array:
    """Defect correction of a camera: a pixel that exceeds its brightest neighbour by a threshold becomes that one."""
    ring = np.ones((3, 3), dtype=np.uint8)
    ring[1, 1] = 0
    brightest = cv2.dilate(signal, ring)
    return np.where(signal > brightest + np.float32(threshold_e), brightest, signal)


def convert(signal_e: Array, sensor: Sensor) -> Frames:
    """Grey values of electrons: full well, gain, tone, rounding to the nearest level."""
    per_level = 1 / sensor.electrons_per_level
    depth, kind = (cv2.CV_8U, np.uint8) if sensor.bits == 8 else (cv2.CV_16U, np.uint16)
    if sensor.tone == "linear":
        grey = cv2.addWeighted(signal_e, per_level, signal_e, 0.0, 0.0, dtype=depth)
        return np.minimum(grey, kind(sensor.white_level)) if 8 < sensor.bits < 16 else grey
    if sensor.bits > SRGB_TABLE_BITS:
        return np.rint(shown_grey(signal_e, sensor)).astype(kind)
    linear = cv2.addWeighted(signal_e, 65535 / sensor.full_well_e, signal_e, 0.0, 0.0, dtype=cv2.CV_16U)
    return srgb_table(sensor.white_level)[linear].astype(kind, copy=False)


def shown_grey(electrons: Array, sensor: Sensor) -> Array:
    """Grey values of a noise-free sensor before they are rounded, in its levels: full well, gain and tone."""
    share = np.clip(electrons / sensor.full_well_e, 0.0, 1.0)
    return sensor.white_level * (srgb_tone(share) if sensor.tone == "srgb" else share)


def srgb_tone(linear: Array) -> Array:
    """Share of white that linear light 0 to 1 is shown as (IEC 61966-2-1)."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055)


@lru_cache(maxsize=4)
def srgb_table(white_level: int) -> Frames:
    """Level of each of 65 536 steps of linear light."""
    return np.rint(srgb_tone(np.arange(2**16) / 65535) * white_level).astype(
        np.uint16 if white_level > 255 else np.uint8
    )


@lru_cache(maxsize=8)
def electrons_table(sensor: Sensor) -> Array:
    """Photo-electrons of each grey value (float32): the sensor's own scale backwards, no offset."""
    tone = np.arange(sensor.white_level + 1) / sensor.white_level
    if sensor.tone == "srgb":
        tone = np.where(tone <= 0.04045, tone / 12.92, ((tone + 0.055) / 1.055) ** 2.4)
    return (tone * sensor.full_well_e).astype(np.float32)
