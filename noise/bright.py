"""How many pixels are bright at a rate of tracks: the law of a pixel's charge under a Poisson rain of tracks."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq
from scipy.special import betainc

from noise.arrays import Array
from noise.footprints import PHASES, Footprints

STEPS_PER_THRESHOLD = 64
GRID = 2**12
"""Charges from 0 to 64 thresholds; the last quarter of the grid holds negative noise."""

SURELY_BRIGHT = 32.0
"""A single pixel of a track with so many thresholds of charge is bright whatever else is there."""

MOST_OF_GRID = 0.5
"""Of the grid that the mean charge may reach."""

FIRST_GUESS = 1e-4  # tracks per pixel


class BrightModel:
    """Share of pixels whose charge exceeds the temporal median by a threshold, as a function of tracks per pixel.

    The charge is a compound Poisson sum over pixels of the bank's footprints (Campbell's theorem: Kingman, Poisson
    Processes (1993), section 3.2) plus normal noise; its law is found from its characteristic function.
    """

    def __init__(self, prints: Footprints, threshold_e: float, noise_e: float, n_frames: int) -> None:
        """Footprints of field and sensor, threshold and noise of a pixel (electrons), frames behind the median."""
        charge = prints.pixels["charge_e"]
        self.per_track = 1 / (prints.n_tracks * PHASES**2)
        self.prints = prints
        self.threshold_e = threshold_e
        self.n_frames = n_frames
        step = threshold_e / STEPS_PER_THRESHOLD
        cells = np.rint(charge / step).astype(np.int64)
        small = cells < SURELY_BRIGHT * STEPS_PER_THRESHOLD
        spectrum = np.bincount(cells[small], minlength=GRID) * self.per_track
        self.surely = float(np.sum(~small) * self.per_track)
        self.mean_cells = float(spectrum @ np.arange(GRID))
        self.exponent = np.fft.rfft(spectrum) - spectrum.sum()
        frequency = 2 * np.pi * np.fft.rfftfreq(GRID)
        self.noise_factor = np.exp(-((frequency * noise_e / step) ** 2) / 2)

    def bright_pixels_per_track(self) -> float:
        """Mean number of pixels that one track alone lifts above the threshold."""
        return float(np.sum(self.prints.pixels["charge_e"] > self.threshold_e) * self.per_track)

    def visible_share(self) -> float:
        """Share of the tracks that lift any pixel above the threshold."""
        largest = np.maximum.reduceat(self.prints.pixels["charge_e"], self.prints.start[self.prints.count > 0])
        return float(np.sum(largest > self.threshold_e) * self.per_track)

    def share(self, tracks_per_pixel: float) -> float:
        """Share of bright pixels."""
        law = np.fft.irfft(np.exp(tracks_per_pixel * self.exponent) * self.noise_factor, GRID)
        law *= np.exp(-tracks_per_pixel * self.surely)
        below: Array = np.clip(np.cumsum(np.roll(law, GRID // 4)), 0, 1)
        brighter = np.ones(GRID)
        shifted = below[STEPS_PER_THRESHOLD:]
        # The boundary cuts its own cell in half.
        brighter[: len(shifted)] = 1 - (shifted + below[STEPS_PER_THRESHOLD - 1 : -1]) / 2
        brighter[len(shifted) :] = brighter[len(shifted) - 1]
        return float(
            np.mean([np.diff(cdf, prepend=0.0, append=1.0)[:-1] @ brighter for cdf in self.median_laws(below)])
        )

    def median_laws(self, below: Array) -> list[Array]:
        """Cumulative laws of the two middle values of the frames when the one in question is above them.

        They are order statistics of the n - 1 others (David and Nagaraja, Order Statistics (2003), eq. 2.1.3).
        """
        others = self.n_frames - 1
        half = self.n_frames // 2
        ranks = [half, half + 1] if self.n_frames % 2 == 0 else [half + 1]
        return [betainc(rank, others - rank + 1, below) for rank in ranks]

    def tracks_per_pixel(self, share: float) -> float:
        """The inverse of `share`: 0 where the noise alone gives it, infinite where no rate does that fits the grid."""
        low, high = 0.0, FIRST_GUESS
        if share <= self.share(low):
            return 0.0
        most = MOST_OF_GRID * GRID / max(self.mean_cells, 1e-30)
        while self.share(high) < share:
            low, high = high, 2 * high
            if high > most:
                return np.inf
        return float(brentq(lambda rate: self.share(rate) - share, low, high, rtol=1e-6))
