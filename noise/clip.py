"""Noise for a whole clip: `add_noise`, frame by frame with keyed draws, on as many threads as there are cores."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from noise.arrays import Array, Frames
from noise.bank import BankKey
from noise.codec import shown_frame, through_jpeg
from noise.exposure import Key, electrons_table, expose
from noise.footprints import Footprints, footprints_for
from noise.gamma import GammaField, expected_tracks
from noise.hits import GammaHits, joined_hits, no_hits
from noise.sensor import Sensor
from noise.streams import Stream, camera_key
from noise.tracks import draw_border_stamps, draw_stamps, hit_table, stamp_charge

N_SYMMETRIES = 8
"""Of the pixel grid: four turns, each mirrored or not. All are equally likely in an isotropic field."""


@dataclass(frozen=True)
class NoisyClip:
    """Frames (n, height, width), uint8, or uint16 above 8 bits, and the truth of their tracks.

    `hits` has every track that entered the image; `border_hits` those that entered outside it, near enough to reach in.
    """

    frames: Frames
    hits: GammaHits
    border_hits: GammaHits
    exposure_s: float


def add_noise(  # noqa: PLR0913 - frames, physics and the key of the draws: the package's one call
    frames: Array | Frames,
    field: GammaField,
    sensor: Sensor,
    *,
    exposure_s: float,
    seed: int,
    camera: int | str,
    fps: float | None = None,
    workers: int | None = None,
) -> NoisyClip:
    """What a sensor in a gamma field makes of frames (n, height, width).

    Frames are float32 expected photo-electrons, or uint8 (uint16 for more bits) grey on the sensor's own scale. Every
    draw is keyed by (seed, purpose, camera, frame): a frame is the same in any clip, order and number of `workers`
    (threads; None: one per core). Frame n is at n / fps (None: 1 / exposure_s), for a dose rate that depends on time.
    ValueError for frames of another shape or type, or an exposure that is not > 0.
    """
    frames = checked_frames(frames, sensor)
    if not 0 < exposure_s < np.inf:
        raise ValueError(f"add_noise: exposure_s must be > 0 and finite, got {exposure_s}")
    source = Recipe(field, sensor, exposure_s, seed, camera_key(camera), fps or 1 / exposure_s, frames)
    out = np.empty(frames.shape, dtype=np.uint8 if sensor.bits == 8 else np.uint16)

    def do(n: int) -> tuple[GammaHits, GammaHits]:
        out[n], hits, border = noisy_frame(source, n)
        return hits, border

    source.prepare()
    with ThreadPoolExecutor(workers or os.cpu_count() or 1) as pool:
        tables = list(pool.map(do, range(len(frames))))
    hits = joined_hits([table[0] for table in tables] or [no_hits()])
    border = joined_hits([table[1] for table in tables] or [no_hits()])
    return NoisyClip(out, hits, border, exposure_s)


@dataclass(frozen=True)
class Recipe:
    """All that the frames of a clip depend on."""

    field: GammaField
    sensor: Sensor
    exposure_s: float
    seed: int
    camera: int
    fps: float
    frames: Array | Frames

    def prepare(self) -> Footprints:
        """The footprints of field and sensor: made once, before the threads start."""
        key = BankKey(self.field.photon_energy_kev, self.sensor.thickness_um, self.field.direction)
        return footprints_for(key, self.sensor.pitch_um, self.sensor.charge_diffusion_um)

    def mean_e(self, n: int) -> Array:
        """Expected photo-electrons of a frame."""
        frame = self.frames[n]
        return frame if frame.dtype == np.float32 else electrons_table(self.sensor)[frame]


def checked_frames(frames: Array | Frames, sensor: Sensor) -> Array | Frames:
    """Frames as an array (n, height, width) of float32, uint8 or uint16."""
    frames = np.asarray(frames)
    if frames.ndim != 3:
        raise ValueError(f"add_noise: frames must be (n, height, width), got shape {frames.shape}")
    if frames.dtype == np.float64:
        frames = frames.astype(np.float32)
    allowed = (np.float32, np.uint8 if sensor.bits == 8 else np.uint16)
    if frames.dtype not in allowed:
        raise ValueError(f"add_noise: frames must be {' or '.join(a.__name__ for a in allowed)}, got {frames.dtype}")
    return frames


def noisy_frame(source: Recipe, n: int) -> tuple[Frames, GammaHits, GammaHits]:
    """Frame n of a clip, and its tracks in the image and around it."""
    key = Key(source.seed, source.camera, n)
    shown = Key(source.seed, source.camera, shown_frame(key, source.sensor.duplicate_share))
    charge_e, hits, border = gamma_charge(source, shown, n)
    grey = expose(source.mean_e(shown.frame), charge_e, source.sensor, source.exposure_s, shown)
    if source.sensor.jpeg_quality is not None:
        grey = through_jpeg(grey, source.sensor.jpeg_quality)
    return grey, hits, border


def gamma_charge(source: Recipe, key: Key, frame: int) -> tuple[Array | None, GammaHits, GammaHits]:
    """Electrons of the tracks of one exposure (None without dose), and their truth."""
    shape = (source.frames.shape[1], source.frames.shape[2])
    n_symmetries = N_SYMMETRIES if source.field.direction is None else 1
    prints = source.prepare()
    mean = expected_tracks(
        source.field, source.sensor.pitch_um, shape, exposure_s=source.exposure_s, t_s=key.frame / source.fps
    )
    if mean == 0:
        return None, no_hits(), no_hits()
    charge_e = np.zeros(shape, dtype=np.float32)
    stamps = draw_stamps(mean, shape, prints.n_tracks, n_symmetries, rng=key.rng(Stream.HIT_PLACE))
    per_pixel = mean / (shape[0] * shape[1])
    around = draw_border_stamps(per_pixel, shape, prints, n_symmetries, rng=key.rng(Stream.BORDER))
    stamp_charge(charge_e, stamps, prints)
    stamp_charge(charge_e, around, prints)
    pitch_um = source.sensor.pitch_um
    return charge_e, hit_table(stamps, prints, frame, pitch_um), hit_table(around, prints, frame, pitch_um)
