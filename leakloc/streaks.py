"""What falls: the clip as streak activity in bands of rows, with gamma hits clipped off and the noise measured.

A falling drop paints a streak down its column, so rows are summed in bands of about a thirty-sixth of the image before
anything non-linear is done, and one band of one frame is one sample of a column's activity over time.

The limits that keep hits out also cut strong streaks flat, and with them the shape that tells a drop's column to a
hundredth of a pixel. But streaks are long and hits are short: where the pixels above and below are bright as well, a
pixel may be so too; and no hit darkens. That is a second activity, the glitter: noisier, and true to what is strong.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from leakloc.background import Frames, TemporalMedian, temporal_median
from leakloc.pixels import Pixels

Activity = NDArray[np.float32]  # (frames, bands, width), in standard deviations of the band's noise

BANDS = 36  # bands per image height: at the paper's fall speeds a streak of 10 ms still fills one
MIN_BAND_ROWS = 4
CLIP_DARK = 5.0  # standard deviations of a pixel: nothing darkens but drops and shadows
CLIPS_BRIGHT = np.array([0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 10.0, 100.0])  # standard deviations: hits only ever brighten
AS_GOOD = 0.995  # of the best efficacy: the widest limit that has it keeps strong signals whole
NOISE_FLOOR_GREY = 0.3  # what rounding to whole grey leaves of a noise-free pixel
ROUNDING_GREY = 12**-0.5  # standard deviation of rounding to whole grey
BRIGHTNESS_BINS = 8
NOISE_STEP_PX = 7  # every seventh row and column is enough to measure the noise
FLICKER_STEP_PX = 5
DEAD = 0.01  # energy of a band without noise, so that in a clip without any all bands are alike
RELIEF_PX = 5  # a drop's columns are nearer to its middle, a wall's stains farther
TILE_PX = 32  # columns that share one noise scale,
TILE_STEP_PX = 3  # and every how many of them are asked


@dataclass(frozen=True, eq=False)
class Streaks:
    """Activity of one view.

    `activity` (n, bands, width): band sums minus their temporal median, over their noise, which is at least that of
    rounding. `glitter` (n, bands, width): the same in the same units, what is bright or dark along a streak whole.
    `scale_grey` (bands, width): noise of a band's mean, grey. `rows_px` (bands,): middle rows. `noise_grey`: a pixel's
    noise, median over the image. `alive` (width,): share of a column's bands that its noise comes from, 1 where all are
    alike: black or white bands say nothing, and the few others speak for all. `relief` (width,): how much a column of
    the median stands out from those beside it, in standard deviations: what falls most of the time stays in the median.
    `pixels`: what all of it is of.
    """

    activity: Activity
    glitter: Activity
    scale_grey: NDArray[np.float32]
    rows_px: NDArray[np.float64]
    noise_grey: float
    alive: NDArray[np.float64]
    relief: NDArray[np.float64]
    pixels: Pixels


def streaks(frames: Frames) -> Streaks:
    """Streak activity of levelled frames (n, height, width), uint8 or uint16, n >= 3, contiguous."""
    median = temporal_median(frames)
    noise_grey, clip_bright = pixel_noise(frames, median)
    darkest, brightest = clip_limits(median, noise_grey, clip_bright)
    sums, rows_px = band_sums(frames, darkest, brightest)
    glitter, _ = band_sums(frames, np.zeros_like(darkest), brightest, cv2.subtract(brightest, median.lower))
    band_rows = rows_px[1] - rows_px[0] if len(rows_px) > 1 else 2 * rows_px[0] + 1
    sums -= temporal_median(sums).grey.astype(np.float32)
    glitter -= temporal_median(glitter).grey.astype(np.float32)
    noise = band_noise(sums)
    scale = np.maximum(noise, ROUNDING_GREY * np.sqrt(band_rows))
    energy = np.maximum((noise / scale).astype(np.float64) ** 2, DEAD)
    alive = energy.sum(axis=0) ** 2 / (len(energy) * (energy**2).sum(axis=0))
    activity, glitter = (_steady(one / scale) for one in (sums, glitter))
    usual_grey = float(np.median(noise_grey[_level(median, NOISE_STEP_PX)]))
    return Streaks(
        activity,
        glitter,
        (scale / band_rows).astype(np.float32),
        rows_px,
        usual_grey,
        alive,
        relief(median),
        Pixels(frames, median, noise_grey),
    )


def _steady(activity: Activity) -> Activity:
    """Without what happens to a whole row at once: lamps flicker and exposures drift."""
    some = np.ascontiguousarray(activity[:, :, ::FLICKER_STEP_PX])  # sorted four times as fast as the strided view
    activity -= np.median(some, axis=2, keepdims=True)
    return activity


def _level(median: TemporalMedian, step: int = 1) -> NDArray[np.intp]:
    """Brightness of every step-th row and column in half grey levels, which a median of whole ones keeps."""
    return median.lower[::step, ::step].astype(np.intp) + median.upper[::step, ::step]


def relief(median: TemporalMedian) -> NDArray[np.float64]:
    """Mean of every column over those RELIEF_PX to both sides, in robust standard deviations, (width,)."""
    column = (median.lower.mean(axis=0) + median.upper.mean(axis=0)) / 2
    beside = np.pad(column, RELIEF_PX, mode="edge")
    over = column - (beside[: -2 * RELIEF_PX] + beside[2 * RELIEF_PX :]) / 2
    spread = 1.4826 * float(np.median(np.abs(over - np.median(over))))
    return over / max(spread, NOISE_FLOOR_GREY)


def pixel_noise(frames: Frames, median: TemporalMedian) -> tuple[NDArray[np.float64], float]:
    """Standard deviation of a pixel over time, grey, for every half grey level of its brightness from 0 to full scale

    (2 top + 1,), and where to clip its bright side, in those.

    The noise is a function of brightness, which stands for everything that photon noise, gain and tone do; it is taken
    from the dark side of the residual alone, which gamma hits do not reach.
    """
    step = NOISE_STEP_PX
    level = _level(median, step) / 2
    residual = frames[:, ::step, ::step] - level
    edges = np.unique(np.quantile(level, np.linspace(0, 1, BRIGHTNESS_BINS + 1)))
    place = np.clip(np.searchsorted(edges, level, side="right") - 1, 0, max(len(edges) - 2, 0))
    known = [place == b for b in range(max(len(edges) - 1, 1))]
    brightness = [float(level[here].mean()) for here in known if here.any()]
    spread = [_dark_spread(residual[:, here]) for here in known if here.any()]
    levels = np.arange(2 * np.iinfo(frames.dtype).max + 1)
    noise_grey = np.maximum(np.interp(levels / 2, brightness, spread), NOISE_FLOOR_GREY)
    return noise_grey, best_bright_clip(residual / noise_grey[_level(median, step)])


def best_bright_clip(residual: NDArray[np.float64]) -> float:
    """The bright limit that keeps most of a faint signal per noise; residual in standard deviations.

    A small shift of a clipped sample moves its mean by the share of samples within the limits: maximise that share over
    the standard deviation of the clipped samples (the efficacy of an M-estimator; Huber and Ronchetti, Robust
    Statistics, 3.2).
    """
    whole = np.maximum(residual.ravel(), -CLIP_DARK)
    within = np.array([((whole > -CLIP_DARK) & (whole < limit)).mean() for limit in CLIPS_BRIGHT])
    spread = np.array([np.minimum(whole, limit).std() for limit in CLIPS_BRIGHT])
    gaussian = np.minimum(np.linspace(-CLIP_DARK, CLIP_DARK, 1001)[:, None], CLIPS_BRIGHT)
    weights = np.exp(-0.5 * np.linspace(-CLIP_DARK, CLIP_DARK, 1001) ** 2)
    weights /= weights.sum()
    least = np.sqrt(weights @ gaussian**2 - (weights @ gaussian) ** 2)  # where rounding is all the noise there is
    efficacy = np.minimum(within, ndtr(CLIPS_BRIGHT)) / np.maximum(spread, least)
    return float(CLIPS_BRIGHT[np.flatnonzero(efficacy >= AS_GOOD * efficacy.max())[-1]])


def _dark_spread(residual_grey: NDArray[np.float64]) -> float:
    """Standard deviation of a Gaussian that has this median and dark side: its 16 % quantile against its middle."""
    return float(-np.quantile(residual_grey, 0.1587))


def clip_limits(median: TemporalMedian, noise_grey: NDArray[np.float64], clip_bright: float) -> tuple[Frames, Frames]:
    """Darkest and brightest grey that a pixel is believed to show, (height, width) each, in the frames' dtype."""
    dtype, level = median.lower.dtype, _level(median)
    grey, top = np.arange(len(noise_grey)) / 2, np.iinfo(dtype).max
    darkest = np.clip(np.rint(grey - CLIP_DARK * noise_grey), 0, top).astype(dtype)
    brightest = np.clip(np.rint(grey + clip_bright * noise_grey), 0, top).astype(dtype)
    return darkest[level], brightest[level]


def band_sums(
    frames: Frames, darkest: Frames, brightest: Frames, over_streak: Frames | None = None
) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Sums of the clipped frames over bands of rows, (n, bands, width) grey, and the bands' middle rows.

    over_streak (height, width), grey: a pixel may also be that much brighter than the median of its column about it.
    Slow definition: `np.clip(frames, darkest, brightest)` summed over whole bands; rows left over at the bottom are
    not used.
    """
    n, height, width = frames.shape
    rows = min(height, max(MIN_BAND_ROWS, round(height / BANDS)))
    bands = height // rows
    sums = np.empty((n, bands, width), np.float32)
    clipped = np.empty((height, width), frames.dtype)
    for frame, out in zip(frames, sums, strict=True):
        limit = brightest if over_streak is None else cv2.max(brightest, cv2.add(streak_median(frame), over_streak))
        cv2.min(cv2.max(frame, darkest), limit, dst=clipped)
        out[:] = clipped[: bands * rows].reshape(bands, rows, width).sum(axis=1, dtype=np.uint32)
    return sums, np.arange(bands) * rows + (rows - 1) / 2


def streak_median(frame: Frames) -> Frames:
    """Median of every pixel and the two above and below it, (height, width), border rows repeated.

    The greater of the lesser pairs, the lesser of the greater pairs and the pixel itself: their median is that of all
    five (a selection network; Knuth, The Art of Computer Programming 3, 5.3.3).
    """
    height = len(frame)
    rows = cv2.copyMakeBorder(frame, 2, 2, 0, 0, cv2.BORDER_REPLICATE)
    above2, above, middle, below, below2 = (rows[i : i + height] for i in range(5))
    low = cv2.max(cv2.min(above2, above), cv2.min(below, below2))
    high = cv2.min(cv2.max(above2, above), cv2.max(below, below2))
    return np.asarray(cv2.max(cv2.min(low, high), cv2.min(cv2.max(low, high), middle)))


def band_noise(sums: NDArray[np.float32]) -> NDArray[np.float32]:
    """Noise of band sums (n, bands, width) around their temporal median, (bands, width), smooth along the row.

    Robust to the frames and columns that streaks fill: the median of |sum| in tiles, interpolated between their
    middles. Up to a factor that depends on n alone (a few frames hug their own median).
    """
    n, bands, width = sums.shape
    tiles = max(1, width // TILE_PX)
    used = tiles * (width // tiles)
    tiled = np.abs(sums[:, :, :used]).reshape(n, bands, tiles, width // tiles)[..., ::TILE_STEP_PX]
    scale = 1.4826 * np.median(tiled.transpose(1, 2, 0, 3).reshape(bands, tiles, -1), axis=2)
    middles = (np.arange(tiles) + 0.5) * (width // tiles) - 0.5
    return np.stack([np.interp(np.arange(width), middles, row) for row in scale]).astype(np.float32)
