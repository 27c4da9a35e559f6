"""Noise for a whole clip: `add_noise`, frame by frame with keyed draws, on as many threads as there are cores."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from noise.arrays import Array, Frames
from noise.codec import shown_frame, through_jpeg
from noise.exposure import Key, electrons_table, expose
from noise.gamma import GammaField
from noise.hits import GammaHits, joined_hits, no_hits
from noise.irradiation import FrameHits, Irradiation, in_clip
from noise.sensor import Sensor
from noise.streams import camera_key


@dataclass(frozen=True)
class NoisyClip:
    """Frames (n, height, width), uint8, or uint16 above 8 bits, and the truth of their tracks.

    `hits` has every track that entered the image; `border_hits` those that entered outside it, near enough to reach in.
    """

    frames: Frames
    hits: GammaHits
    border_hits: GammaHits
    irradiation: Irradiation
    seed: int
    camera: int

    @property
    def exposure_s(self) -> float:
        """Exposure of a frame, s."""
        return self.irradiation.exposure_s

    def hit_charge_e(self, frame: int) -> Array:
        """Electrons of the hits in each pixel of a frame (height, width), drawn again from the key."""
        key = shown(self.irradiation.sensor, Key(self.seed, self.camera, frame))
        charge_e = self.irradiation.draw(key).charge_e
        return np.zeros(self.irradiation.shape, dtype=np.float32) if charge_e is None else charge_e

    def hit_mask(self, frame: int, at_least_e: float = 1.0) -> np.ndarray:
        """Pixels of a frame (height, width) that hits gave at least so many electrons."""
        return self.hit_charge_e(frame) >= at_least_e


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
    ValueError for frames of another shape or type, electrons below 0 or undefined, times and workers that are not > 0.
    """
    frames = checked_frames(frames, sensor)
    for name, value in (("exposure_s", exposure_s), ("fps", fps), ("workers", workers)):
        if value is not None and not 0 < value < np.inf:
            raise ValueError(f"add_noise: {name} must be > 0 and finite, got {value}")
    shape = (frames.shape[1], frames.shape[2])
    irradiation = Irradiation(field, sensor, shape, exposure_s, fps or 1 / exposure_s)
    out = np.empty(frames.shape, dtype=np.uint8 if sensor.bits == 8 else np.uint16)

    def do(n: int) -> FrameHits:
        key = Key(seed, camera_key(camera), n)
        out[n], hits = noisy_frame(frames, irradiation, key)
        return replace(hits, charge_e=None)

    irradiation.prepare()
    n_threads = workers or os.cpu_count() or 1
    with ThreadPoolExecutor(n_threads) as pool:
        done = list((pool.map if n_threads > 1 else map)(do, range(len(frames))))
    hits = joined_hits([no_hits(), *(frame.hits for frame in done)])
    border = joined_hits([no_hits(), *(frame.border_hits for frame in done)])
    return NoisyClip(out, hits, border, irradiation, seed, camera_key(camera))


def noisy_frame(frames: Array | Frames, irradiation: Irradiation, key: Key) -> tuple[Frames, FrameHits]:
    """One frame of a clip, and its hits."""
    sensor = irradiation.sensor
    source = shown(sensor, key)
    hits = irradiation.draw(source)
    grey = expose(electrons_in(frames[source.frame], sensor), hits.charge_e, sensor, irradiation.exposure_s, source)
    if sensor.jpeg_quality is not None:
        grey = through_jpeg(grey, sensor.jpeg_quality)
    if source.frame != key.frame:
        hits = FrameHits(hits.charge_e, in_clip(hits.hits, key.frame), in_clip(hits.border_hits, key.frame))
    return grey, hits


def electrons_in(frame: Array | Frames, sensor: Sensor) -> Array:
    """Expected photo-electrons of a frame of electrons or grey."""
    lowest, highest = (frame.min(), frame.max()) if frame.size else (0, 0)
    if frame.dtype == np.float32:
        if not (lowest >= 0 and np.isfinite(highest)):
            raise ValueError(f"add_noise: electrons must be >= 0 and finite, got {lowest} to {highest}")
        return frame
    if highest > sensor.white_level:
        raise ValueError(f"add_noise: grey must be at most {sensor.white_level}, got {highest}")
    return electrons_table(sensor)[frame]


def shown(sensor: Sensor, key: Key) -> Key:
    """Key of the frame that is shown: an earlier one where the camera repeats itself."""
    return replace(key, frame=shown_frame(key, sensor.duplicate_share)) if sensor.duplicate_share > 0 else key


def checked_frames(frames: Array | Frames, sensor: Sensor) -> Array | Frames:
    """Frames as an array (n, height, width) of float32, uint8 or uint16."""
    frames = np.ascontiguousarray(frames)  # pixels are written by their number, which a view in another order has not
    if np.ndim(frames) != 3:
        raise ValueError(f"add_noise: frames must be (n, height, width), got shape {frames.shape}")
    if frames.dtype == np.float64:
        frames = frames.astype(np.float32)
    grey = np.dtype(np.uint8 if sensor.bits == 8 else np.uint16)
    if frames.dtype not in (np.dtype(np.float32), grey):
        raise ValueError(f"add_noise: frames must be float32 electrons or {grey} grey, got {frames.dtype}")
    return frames
