"""The inverse: the dose rate that a clip tells of, by the share of its pixels that are brighter than they should be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from noise.arrays import Array, Frames
from noise.bright import BrightModel
from noise.clip import NoisyClip
from noise.exposure import electrons_table
from noise.gamma import SECONDS_PER_HOUR, GammaField, tracks_per_cm2_gy
from noise.irradiation import Irradiation
from noise.sensor import Sensor

SIGMAS = 6.0
"""The threshold is so many standard deviations of the background's own noise above it."""

MODEL_ALLOWANCE = 0.05
"""Relative standard error of the model: its charges per track against dose conservation."""

BLOCKS = 4  # parts of each frame's height and width whose counts are compared for the interval
Z_95 = 1.96
FEWEST_TRACKS = 3.0  # upper 95 % limit of a Poisson mean where nothing was counted
USABLE_WELL = 0.98  # of the full well: a pixel that a threshold step would fill cannot show a hit


@dataclass(frozen=True)
class DoseEstimate:
    """Dose rate (Gy/h of air kerma) and its 95 % interval `low_gy_h` to `high_gy_h`, and what it rests on.

    `threshold_grey` above the temporal median (8-bit grey at mid-scale), `bright_share` of the pixels above it, and
    `visible_share`, the share of tracks that have any pixel above it.
    """

    dose_rate_gy_h: float
    low_gy_h: float
    high_gy_h: float
    threshold_grey: float
    bright_share: float
    visible_share: float

    @property
    def warning(self) -> str:
        """What a reader must know about thresholds before comparing counts."""
        return (
            f"Only {self.visible_share:.0%} of the tracks have a pixel above the threshold, {self.threshold_grey:.1f} "
            "grey. The rate is right for counts above this threshold alone: counting fainter or dark specks as hits, "
            "or taking the visible tracks for all of them, is wrong by a factor of several. Moving things (drops) "
            "count as hits."
        )


def estimate_dose_rate(
    clip: NoisyClip | Frames, sensor: Sensor, *, exposure_s: float | None = None, field: GammaField | None = None
) -> DoseEstimate:
    """Dose rate from a clip of a static scene, given its sensor; at least 3 frames (n, height, width).

    A pixel's charge is a compound Poisson sum over the bank's footprints (Campbell's theorem), so the share above a
    threshold is an increasing function of the dose rate, which is inverted. `exposure_s` is needed for bare frames;
    `field` gives photon energy and direction (default: 662 keV, isotropic). The interval has the counts' scatter
    between parts of the frames and an allowance for the model. ValueError for less than 3 frames, no exposure, a scene
    that is too bright, or so many hits that their rate cannot be told.
    """
    frames = clip.frames if isinstance(clip, NoisyClip) else np.asarray(clip)
    exposure_s = clip.exposure_s if isinstance(clip, NoisyClip) else exposure_s
    if exposure_s is None or not exposure_s > 0:
        raise ValueError(f"estimate_dose_rate: exposure_s must be > 0 for bare frames, got {exposure_s}")
    if frames.ndim != 3 or len(frames) < 3:
        raise ValueError(f"estimate_dose_rate: at least 3 frames (n, height, width) are needed, got {frames.shape}")
    field = field or GammaField()
    shape = (frames.shape[1], frames.shape[2])
    prints = Irradiation(field, sensor, shape, exposure_s, 1 / exposure_s).prints()
    background_e = background_electrons(frames, sensor)
    noise_e, threshold_e = threshold_of(background_e, sensor)
    share, error = bright_share(frames, background_e, threshold_e, sensor)
    tracks_per_gy_h = tracks_per_cm2_gy(field) * (sensor.pitch_um * 1e-4) ** 2 * exposure_s / SECONDS_PER_HOUR
    model = BrightModel(prints, threshold_e, noise_e, len(frames))

    def dose(wanted: float) -> float:
        return model.tracks_per_pixel(wanted) / tracks_per_gy_h

    # On the scale of logarithms, for where few were counted the error was counted small as well. Where nothing was
    # counted, three visible tracks are the upper limit.
    factor = float(np.exp(Z_95 * error / share)) if share > 0 else 1.0
    nothing_seen = FEWEST_TRACKS * model.bright_pixels_per_track() / model.visible_share() / frames.size
    high = dose(min(max(share * factor, nothing_seen), 0.95))
    value, low = dose(share), dose(share / factor)
    if not np.isfinite(high):
        raise ValueError(f"estimate_dose_rate: {share:.0%} of the pixels are bright: too many to tell the rate")
    allowance = Z_95 * MODEL_ALLOWANCE * value
    return DoseEstimate(
        dose_rate_gy_h=value,
        low_gy_h=max(value - float(np.hypot(value - low, allowance)), 0.0),
        high_gy_h=value + float(np.hypot(high - value, allowance)),
        threshold_grey=threshold_e / sensor.electrons_per_grey,
        bright_share=share,
        visible_share=model.visible_share(),
    )


def background_electrons(frames: Frames, sensor: Sensor) -> Array:
    """Electrons of the temporal median of frames (height, width), on the sensor's own scale."""
    table = electrons_table(sensor)
    return np.interp(np.median(frames, axis=0), np.arange(len(table)), table)


def threshold_of(background_e: Array, sensor: Sensor) -> tuple[float, float]:
    """Noise of a usual pixel and the threshold above the median, electrons; half-way between two levels if linear."""
    step = sensor.electrons_per_level
    usual, bright = np.percentile(background_e, [50, 95])
    floor = sensor.read_noise_e**2 + step**2 / 12 * 2
    threshold_e = SIGMAS * np.sqrt(bright + floor)
    if sensor.tone == "linear":
        threshold_e = (np.ceil(threshold_e / step) + 0.5) * step
    return float(np.sqrt(usual + floor)), float(threshold_e)


def bright_share(frames: Frames, background_e: Array, threshold_e: float, sensor: Sensor) -> tuple[float, float]:
    """Share of the usable pixels above the threshold, and its standard error from the scatter between blocks."""
    usable = background_e + threshold_e < USABLE_WELL * sensor.full_well_e
    if not usable.any():
        raise ValueError("estimate_dose_rate: the scene is too bright: no pixel could show a hit")
    table = electrons_table(sensor)
    limit = np.where(usable, np.interp(background_e + threshold_e, table, np.arange(len(table))), np.inf)
    bright = frames > limit
    n = BLOCKS if min(frames.shape[1:]) >= BLOCKS else 1
    counts, sizes = (
        np.array([block.sum() for rows in np.array_split(image, n, 1) for block in np.array_split(rows, n, 2)])
        for image in (bright, np.broadcast_to(usable, (1, *usable.shape)))
    )
    per_frame = np.array(
        [[block.sum() for rows in np.array_split(f, n, 0) for block in np.array_split(rows, n, 1)] for f in bright]
    )
    n_pixels = sizes.sum() * len(frames)
    scatter = per_frame - counts / len(frames)
    # Blocks are independent: the variance of the total is the sum of theirs.
    error = np.sqrt((scatter**2).sum() * len(frames) / (len(frames) - 1)) / n_pixels
    return float(counts.sum() / n_pixels), float(error)
