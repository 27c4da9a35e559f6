"""The robust method on 24 stereo frames of 960 x 540, stage by stage beside straightforward numpy of the same stages.

One line per stage: milliseconds of both (least of the repetitions) and their ratio, each result compared first; then
the whole method and the memory it takes.
"""

import resource
import time

import numpy as np

from leakloc import Rig, locate
from leakloc.background import temporal_median
from leakloc.correlate import agreement
from leakloc.streaks import band_sums, clip_limits, pixel_noise, streaks

SHAPE = (24, 540, 960)
LEAKS_PX = ((426, 345), (519, 413), (769, 662))
BUDGET_MS, BUDGET_MB = 300.0, 600.0


def paper_rig():
    f = 480 / np.tan(np.radians(35))
    K = np.array([[f, 0, 479.5], [0, f, 269.5], [0, 0, 1]])
    pose = [[0, 0, 1, -2.4], [-1, 0, 0, 0.25], [0, -1, 0, 0], [0, 0, 0, 1]]
    return Rig(K, np.zeros(5), K, np.zeros(5), np.eye(3), [-0.5, 0, 0], SHAPE[:0:-1], pose, pedestal_radius=2.5)


def noisy_view(columns_px, rng):
    """Textured wall, 2 grey of noise, 1.6 % of pixels hit, and a streak of 90 rows a drop for every leak."""
    frames = rng.integers(90, 180, SHAPE[1:]) + rng.normal(0, 2, SHAPE)
    frames += (rng.random(SHAPE) < 0.016) * rng.integers(16, 120, SHAPE)
    for leak, column in enumerate(columns_px):
        for frame in range(SHAPE[0]):
            top = (frame * 90 + leak * 131) % 300 * 3 - 90
            frames[frame, max(0, top) : max(0, top + 90), column - 1 : column + 2] += 12
    return np.clip(np.rint(frames), 0, 255).astype(np.uint8)


def straightforward_sums(frames, low, high, rows):
    bands = frames.shape[1] // rows
    clipped = np.clip(frames.astype(np.float64), low, high)[:, : bands * rows]
    return clipped.reshape(len(frames), bands, rows, -1).sum(axis=2)


def straightforward_median(frames):
    return np.median(frames, axis=0)


def least_ms(function, repetitions):
    times, result = [], None
    for _ in range(repetitions):
        start = time.perf_counter()
        result = function()
        times.append(time.perf_counter() - start)
    return min(times) * 1e3, result


def report(stage, fast, slow, same):
    fast_ms, ours = least_ms(fast, 7)
    slow_ms, theirs = least_ms(slow, 2)
    verdict = "equal" if same(ours, theirs) else "DIFFERENT"
    print(f"{stage:34s} {fast_ms:9.2f} ms {slow_ms:10.2f} ms {slow_ms / fast_ms:8.1f} x  {verdict}", flush=True)


def main():
    rng = np.random.default_rng(0)
    left, right = (noisy_view([pair[view] for pair in LEAKS_PX], rng) for view in (0, 1))
    rig = paper_rig()
    median = temporal_median(left)
    limits = clip_limits(median, *pixel_noise(left, median))
    rows = round(2 * band_sums(left, *limits)[1][0] + 1)

    print(f"{'stage':34s} {'leakloc':>12s} {'plain numpy':>13s} {'ratio':>10s}")
    report(
        "background, one view", lambda: temporal_median(left).grey, lambda: straightforward_median(left), np.array_equal
    )
    report(
        "clipped band sums, one view",
        lambda: band_sums(left, *limits)[0],
        lambda: straightforward_sums(left, *limits, rows),
        np.array_equal,
    )
    sides = [streaks(view) for view in (left, right)]
    print(f"{'streak activity, one view':34s} {least_ms(lambda: streaks(left), 5)[0]:9.2f} ms")
    print(f"{'agreement of all column pairs':34s} {least_ms(lambda: agreement(*sides), 5)[0]:9.2f} ms")
    total_ms, estimate = least_ms(lambda: locate(left, right, rig, method="robust"), 9)
    memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    places = ", ".join(f"({leak.x_m:.2f}, {leak.y_m:.2f})" for leak in estimate.leaks)
    kept = "kept" if total_ms <= BUDGET_MS else "MISSED"
    print(f"total, both views: {total_ms:.0f} ms, budget {BUDGET_MS:.0f} ms: {kept}; leaks at {places} m")
    print(f"memory of the whole script, drawing included: {memory_mb:.0f} MB")


if __name__ == "__main__":
    main()
