"""The robust method's table at the paper's settings, printed: found leaks, false ones, errors, and each row's bars.

One run prints every number: `python benchmarks/leakloc_table.py` (some twenty minutes), or with the clips per row.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "leakloc"))

from robust_table import (
    ALPHA,
    BETA,
    PRINTED_ONLY,
    ROWS,
    crowded_counts,
    line,
    misled_counts,
    panned_counts,
    row_counts,
)


def main():
    clips = int(sys.argv[1]) if len(sys.argv) > 1 else None
    print(f"{'row':<20}observable in view  all      (alpha {ALPHA:g}, beta {BETA:g} on clips)")
    for row in ROWS:
        bars = f"bars {row.rate:.0%}, {row.mean_m} m, {row.worst_of_95_m} m; p0 {row.p0}, p1 {row.p1}, n {row.plan.n}"
        print(line(row.name, row_counts(row, clips), bars), flush=True)
    for row in PRINTED_ONLY:
        print(line(row.name, row_counts(row, clips or 12), "no bar: where it breaks"), flush=True)
    print(line("lamp, wall wrong", misled_counts(clips or 25), "bars 95%, 0.03 m"), flush=True)
    print(line("crowded, Table 1", crowded_counts(), "bars 24/24, 0.01 m"), flush=True)
    found, seen, false, errors_m = panned_counts(clips or 12)
    print(f"{'three pan angles':<20}{found:>3}/{seen:<3} in view of any  false {false}  error {errors_m.mean():.4f}")


if __name__ == "__main__":
    main()
