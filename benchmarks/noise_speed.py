"""Noise and sensor of a stereo clip at H, beside the plain version: one track after the other, numpy's own draws.

Run: python benchmarks/noise_speed.py. One line per case: best of several runs; the plain version does one frame and
is scaled to the clip.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable

import numpy as np

from noise import GammaField, Sensor, add_noise, expected_column_sd
from noise.bank import BankKey, make_bank
from noise.beam import crossing
from noise.footprints import PHASES, Footprints, footprints_for
from noise.streams import Stream, rng_for
from noise.transport import transport

SHAPE = (540, 960)
N_FRAMES = 24
EXPOSURE_S = 1 / 12
H = GammaField(10.0)


def best_s(call: Callable[[], object], repeats: int) -> float:
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


def scene() -> np.ndarray:
    rng = np.random.default_rng(0)
    frame = (33 * (10 + 60 * rng.random(SHAPE))).astype(np.float32)
    return np.repeat(frame[None], N_FRAMES, axis=0)


def stereo(frames: np.ndarray, workers: int | None) -> None:
    for camera in (0, 1):
        add_noise(frames, H, Sensor(), exposure_s=EXPOSURE_S, seed=1, camera=camera, workers=workers)


def plain_frame(mean_e: np.ndarray, prints: Footprints, rng: np.random.Generator) -> np.ndarray:
    """The same frame as one would write it down: a loop over tracks, a Poisson and a normal number per pixel."""
    height, width = mean_e.shape
    charge_e = np.zeros(mean_e.shape)
    for _ in range(rng.poisson(12193)):
        x_px, y_px = rng.random() * width - 0.5, rng.random() * height - 0.5
        column, row = int(np.floor(x_px + 0.5)), int(np.floor(y_px + 0.5))
        phase_x, phase_y = int((x_px - column + 0.5) * PHASES), int((y_px - row + 0.5) * PHASES)
        label = (rng.integers(prints.n_tracks) * PHASES + phase_y) * PHASES + phase_x
        pixels = prints.pixels[prints.start[label] : prints.start[label] + prints.count[label]]
        x, y = column + pixels["dx_px"].astype(int), row + pixels["dy_px"].astype(int)
        inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        charge_e[y[inside], x[inside]] += pixels["charge_e"][inside]
    electrons = np.clip(rng.poisson(mean_e) + charge_e, 0, 33 * 255) + rng.normal(0, 3, mean_e.shape)
    return np.clip(np.rint(electrons / 33), 0, 255).astype(np.uint8)


def transported_frame(rng: np.random.Generator) -> None:
    """Electrons of one frame through the layer, without collecting their charge: what a bank saves."""
    kinetic_kev, heading = crossing(661.7, None, 12193, rng=rng)
    transport(kinetic_kev, heading, 5.0, rng=rng)


def main() -> None:
    frames, cores = scene(), os.cpu_count()
    first = best_s(lambda: add_noise(frames[:1], H, Sensor(), exposure_s=EXPOSURE_S, seed=1, camera=0), 1)
    prints = footprints_for(BankKey(), 3.0, 1.2)
    all_cores = best_s(lambda: stereo(frames, None), 7)
    one = best_s(lambda: stereo(frames, 1), 4)
    busy = time.process_time()
    stereo(frames, None)
    busy = time.process_time() - busy
    no_dose = best_s(
        lambda: [add_noise(frames, GammaField(0.0), Sensor(), exposure_s=EXPOSURE_S, seed=1, camera=c) for c in (0, 1)],
        4,
    )
    plain = best_s(lambda: plain_frame(frames[0], prints, rng_for(1, Stream.EXPECTATION)), 3) * 2 * N_FRAMES
    slow = best_s(lambda: transported_frame(rng_for(1, Stream.EXPECTATION)), 1) * 2 * N_FRAMES
    bank = best_s(lambda: make_bank(BankKey(n_tracks=16384 - 1)), 1)
    spread = best_s(
        lambda: expected_column_sd(1000.0, H, Sensor(), exposure_s=EXPOSURE_S, n_rows=540, n_frames=N_FRAMES), 1
    )
    print(f"2 x 24 frames of 960 x 540 at H, noise and sensor, {cores} cores   {all_cores:8.3f} s   (budget 0.4 s)")
    print(f"  the same on one thread                                   {one:8.3f} s")
    print(
        f"  processor time of all cores together                     {busy:8.3f} s   (whatever else the machine does)"
    )
    print(f"  sensor alone (dose 0)                                    {no_dose:8.3f} s")
    print(f"  plain numpy, track by track, one thread                  {plain:8.3f} s   {plain / one:.0f} x one thread")
    print(
        f"                                                                        {plain / all_cores:.0f} x all cores"
    )
    print(f"  transport of every electron (charge not collected)       {slow:8.3f} s   {slow / one:.0f} x one thread")
    print(f"first frame of a process (footprints of the default sensor) {first:7.3f} s")
    print(f"bank of another field or thickness, once                   {bank:8.3f} s")
    print(f"spread of the column aggregate, first level of light       {spread:8.3f} s")


if __name__ == "__main__":
    main()
