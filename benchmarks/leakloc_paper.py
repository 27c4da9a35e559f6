"""The paper's method, stage by stage, beside its straightforward numpy version: 24 stereo frames of 960 x 540.

One line per stage: milliseconds of both (least of the repetitions) and their ratio; stages are of one view,
the total is of both. Every result is compared before its time is printed.
"""

import importlib.util
import time
from pathlib import Path

import numpy as np

from leakloc import PaperOptions, Rig, locate
from leakloc.background import column_vectors, temporal_median
from leakloc.columns import column_profile
from leakloc.detect import detect_columns
from leakloc.match import match_columns
from leakloc.paper import triangulate_columns

SHAPE = (24, 540, 960)
LEAK_COLUMNS_PX = ((426, 519, 769), (355, 413, 662))
BUDGET_MS = 80.0


def load_straightforward():
    path = Path(__file__).parents[1] / "tests/leakloc/straightforward.py"
    spec = importlib.util.spec_from_file_location("leakloc_straightforward", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def paper_rig():
    f = 480 / np.tan(np.radians(35))
    K = np.array([[f, 0, 479.5], [0, f, 269.5], [0, 0, 1]])
    pose = [[0, 0, 1, -2.4], [-1, 0, 0, 0.25], [0, -1, 0, 0], [0, 0, 0, 1]]
    return Rig(K, np.zeros(5), K, np.zeros(5), np.eye(3), [-0.5, 0, 0], (960, 540), pose)


def noisy_view(columns_px, rng):
    """Textured wall, read noise, 1.6 % of pixels hit, and three leaks of ten streaks each."""
    wall = rng.integers(20, 60, SHAPE[1:])
    frames = wall + rng.normal(0, 1, SHAPE)
    frames += (rng.random(SHAPE) < 0.016) * rng.integers(16, 120, SHAPE)
    for leak, column in enumerate(columns_px):
        for frame in range(SHAPE[0]):
            top = (frame * 61 + leak * 160) % 480
            frames[frame, top : top + 60, column - 1 : column + 2] += 25
    return np.clip(np.round(frames), 0, 255).astype(np.uint8)


def least_ms(function, repetitions):
    times, result = [], None
    for _ in range(repetitions):
        start = time.perf_counter()
        result = function()
        times.append(time.perf_counter() - start)
    return min(times) * 1e3, result


def report(stage, fast, slow, same, repetitions=(15, 3)):
    fast_ms, ours = least_ms(fast, repetitions[0])
    slow_ms, theirs = least_ms(slow, repetitions[1])
    verdict = "equal" if same(ours, theirs) else "DIFFERENT"
    print(f"{stage:34s} {fast_ms:9.2f} ms {slow_ms:10.2f} ms {slow_ms / fast_ms:8.1f} x  {verdict}", flush=True)
    return fast_ms, ours


def pairs_of(estimate):
    return [(pair["left_column_px"], pair["right_column_px"]) for pair in estimate.diagnostics["pairs"]]


def places_of(estimate):
    return np.array([(pair["x_m"], pair["y_m"]) for pair in estimate.diagnostics["pairs"]])


def main():
    rng = np.random.default_rng(0)
    left, right = (noisy_view(columns, rng) for columns in LEAK_COLUMNS_PX)
    rig, options, slow = paper_rig(), PaperOptions(), load_straightforward()
    medians = [temporal_median(view) for view in (left, right)]
    moved = [slow.foreground(view, slow.background(view)) for view in (left, right)]
    profile = column_profile(left, medians[0])
    columns = [np.array(view) for view in LEAK_COLUMNS_PX]
    listed = [list(view) for view in LEAK_COLUMNS_PX]

    print(f"{'stage':34s} {'leakloc':>12s} {'plain numpy':>13s} {'ratio':>10s}")
    report(
        "background (eq. 1), one view",
        lambda: temporal_median(left),
        lambda: slow.background(left),
        lambda a, b: np.array_equal(a.grey, b),
    )
    report(
        "foreground, profile (eq. 2-3)",
        lambda: column_profile(left, medians[0]),
        lambda: slow.aggregate(slow.foreground(left, medians[0].grey)),
        np.array_equal,
    )
    report(
        "detection (Algorithm 1)",
        lambda: detect_columns(profile, k_sigma=2.0, g_win_px=10),
        lambda: slow.detect(profile, 2.0, 10),
        lambda a, b: a.tolist() == b,
    )
    report(
        "matching (Algorithm 2), 3 leaks",
        lambda: match_columns(
            column_vectors(left, medians[0], columns[0]), column_vectors(right, medians[1], columns[1])
        ),
        lambda: slow.match(*moved, *listed),
        lambda a, b: [(listed[0][i], listed[1][j]) for i, j in a] == b,
    )
    report(
        "triangulation (eq. 5-8)",
        lambda: triangulate_columns(np.array(LEAK_COLUMNS_PX).T, rig),
        lambda: slow.triangulate(list(zip(*LEAK_COLUMNS_PX, strict=True)), rig.P1, rig.P2, 540),
        lambda a, b: np.allclose(a, b, rtol=1e-12, atol=1e-12),
    )
    total_ms, estimate = report(
        "total, both views",
        lambda: locate(left, right, rig, method="paper", options=options),
        lambda: slow.locate(left, right, rig.P1, rig.P2),
        lambda a, b: pairs_of(a) == b[2] and np.allclose(places_of(a), b[3], rtol=1e-9),
    )
    places = ", ".join(f"({leak.x_m:.2f}, {leak.y_m:.2f})" for leak in estimate.leaks)
    print(f"budget {BUDGET_MS:.0f} ms: {'kept' if total_ms <= BUDGET_MS else 'MISSED'}; leaks at {places} m")


if __name__ == "__main__":
    main()
