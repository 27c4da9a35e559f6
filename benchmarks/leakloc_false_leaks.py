"""False leaks of the robust method on clips without leaks, beside the number that it was told to expect.

One run prints every number: `python benchmarks/leakloc_false_leaks.py` (some six minutes), or with the clips per row.
"""

import sys
from pathlib import Path

import numpy as np
from scipy.stats import chi2

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "leakloc"))

from robust_table import false_leaks

EXPECTED = (0.02, 0.05, 0.2)
SETTINGS = {"H": (), "H, 3 frames": ("recording.n_frames=3",), "20 x H": ("gamma.dose_rate_gy_h=200.0",)}


def interval(count, clips):
    """Exact 95 % interval of a Poisson rate per clip (Garwood 1936)."""
    low = chi2.ppf(0.025, 2 * count) / 2 if count else 0.0
    return low / clips, chi2.ppf(0.975, 2 * count + 2) / 2 / clips


def main():
    clips = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    print(f"{'setting':<14}{'expected':>9}{'measured':>10}   95 % interval, {clips} clips (bar: twice the expected)")
    for name, changes in SETTINGS.items():
        for rate, count in zip(EXPECTED, np.sum(false_leaks(clips, changes, EXPECTED), axis=1), strict=True):
            low, high = interval(count, clips)
            print(f"{name:<14}{rate:>9}{count / clips:>10.3f}   {low:.3f}-{high:.3f}", flush=True)


if __name__ == "__main__":
    main()
