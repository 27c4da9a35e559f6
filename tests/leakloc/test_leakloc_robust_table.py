"""The robust method's table held to its bars: many clips a row, run by `make deep`."""

import numpy as np
import pytest
from robust_table import FALSE_PER_CLIP, ROWS, crowded_counts, panned_counts, row_counts


@pytest.mark.deep
@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_a_row_holds_its_bars(row):
    counts = row_counts(row)
    assert counts.succeeded >= row.plan.k
    assert counts.rate >= row.rate
    assert counts.false_per_clip <= FALSE_PER_CLIP
    assert counts.errors_m.mean() <= row.mean_m
    assert np.quantile(counts.errors_m, 0.95) <= row.worst_of_95_m


@pytest.mark.deep
def test_the_papers_crowded_scenes_are_resolved():
    counts = crowded_counts()
    assert counts.all == (24, 24)
    assert counts.false <= 1
    assert counts.errors_m.mean() <= 0.01


@pytest.mark.deep
def test_three_pan_angles_miss_nothing_that_any_of_them_sees():
    found, seen, false, errors_m = panned_counts(25)
    assert found >= 0.99 * seen
    assert false <= 25 * len((-40, 0, 40)) * FALSE_PER_CLIP
    assert errors_m.mean() <= 0.02
