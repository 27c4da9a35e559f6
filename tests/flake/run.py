"""Does the suite flake? Three random orders of all of it, twenty fresh seeds of its statistical tests: `make flake`.

python tests/flake/run.py [--orders N] [--seeds N] [--first SEED] [--workers N] [pytest arguments ...]
"""

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]


def run(label: str, marks: str, variable: dict[str, str], arguments: list[str]) -> bool:
    """One run of pytest in this process's environment and `variable`; its last lines, and whether it passed."""
    start_s = time.monotonic()
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-m", marks, *arguments]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", **variable}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    told = done.stdout.strip().splitlines()
    failed = [line for line in told if line.startswith(("FAILED", "ERROR"))]
    passed = sum(line.split(" [")[0].count(".") for line in told if line.rstrip().endswith("%]"))
    word = "passed" if done.returncode == 0 else "FAILED"
    print(f"{word} {time.monotonic() - start_s:6.1f} s  {label}: {passed} tests passed", flush=True)
    if done.returncode != 0:
        print("\n".join(failed or told[-20:]), flush=True)
    return done.returncode == 0


def main() -> int:
    """Run the orders, then the seeds."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--orders", type=int, default=3)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    options, arguments = parser.parse_known_args()
    arguments = ["-n", str(options.workers), "--dist", "loadgroup", *arguments]
    first = options.first
    ran = [
        run(f"order {order}", "not deep", {"HARNESS_ORDER": str(order)}, arguments)
        for order in range(first, first + options.orders)
    ]
    ran += [
        run(f"seed {seed}", "statistical and not deep", {"HARNESS_SEED": str(seed)}, arguments)
        for seed in range(first, first + options.seeds)
    ]
    print(f"{sum(ran)} of {len(ran)} runs passed")
    return 0 if all(ran) else 1


if __name__ == "__main__":
    sys.exit(main())
