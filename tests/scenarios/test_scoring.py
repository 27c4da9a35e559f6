"""Scoring: one-to-one, gated, never one rate without the others; worked by hand."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.score import as_json, gate_m, score, table
from scenarios.truth import LeakTruth, ShadowColumns, TrueCamera, TrueRig, Truth

FOCAL_PX = 685.511
LEFT_POSE = ((0.0, 0.0, 1.0, -2.4), (-1.0, 0.0, 0.0, 0.25), (0.0, -1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


def camera(pose=LEFT_POSE):
    matrix = ((FOCAL_PX, 0.0, 479.5), (0.0, FOCAL_PX, 269.5), (0.0, 0.0, 1.0))
    return TrueCamera(width_px=960, height_px=540, camera_matrix=matrix, distortion=(0.0,) * 5, world_from_camera=pose)


def leak(number, x_m, y_m, *, in_view=True, observable=True):
    return LeakTruth(
        id=number,
        x_m=x_m,
        y_m=y_m,
        z_m=2.0,
        left_column_px=500.0,
        right_column_px=400.0,
        shadow_columns_px=ShadowColumns(left=(None,), right=(None,)),
        in_view=in_view,
        visible_fraction=1.0,
        observable=observable,
        reason=None if observable else "out of view",
        column_snr=10.0,
    )


def truth(*leaks):
    rig = TrueRig(left=camera(), right=camera(), baseline_m=0.5, pedestal_radius_m=2.5)
    return Truth(leaks=leaks, rig=rig)


def test_the_gate_is_0_3_m_near_and_three_pixels_of_disparity_beyond():
    # 3 Z^2 / (f B) with Z = 4.9 m: 3 * 24.01 / (685.511 * 0.5) = 0.2101, under 0.3
    assert gate_m(truth(), 2.5, 0.0) == 0.3
    narrow = truth().model_copy(update={"rig": truth().rig.model_copy(update={"baseline_m": 0.1})})
    assert gate_m(narrow, 2.5, 0.0) == pytest.approx(3 * 4.9**2 / (FOCAL_PX * 0.1))  # 1.05 m


def test_each_estimate_serves_one_leak_at_minimum_total_distance():
    result = score([(0.1, 0.0), (0.0, 0.0)], truth(leak(1, 0.0, 0.0), leak(2, 0.25, 0.0))).gated
    assert [(pair.leak_id, pair.estimate) for pair in result.pairs] == [(1, 1), (2, 0)]
    assert result.mean_error_m == pytest.approx(0.075)
    assert result.mean_error_percent_of_diameter == pytest.approx(1.5)
    assert result.worst_error_m == pytest.approx(0.15)


def test_an_estimate_beyond_the_gate_is_false_and_its_leak_missed_though_the_paper_pairs_them():
    result = score([(1.0, 0.0)], truth(leak(1, 0.0, 0.0)))
    assert (result.gated.missed, result.gated.false, len(result.gated.pairs)) == ((1,), (0,), 0)
    assert math.isnan(result.gated.mean_error_m)
    assert result.paper_rule.mean_error_m == pytest.approx(1.0)
    assert result.paper_rule.false == ()


def test_a_stray_estimate_does_not_take_a_leak_from_a_good_one():
    result = score([(9.0, 9.0), (0.0, 0.01)], truth(leak(1, 0.0, 0.0))).gated
    assert [pair.estimate for pair in result.pairs] == [1]
    assert result.false == (0,)


def test_rates_are_over_all_in_view_and_observable_leaks():
    leaks = (leak(1, 0.0, 0.0), leak(2, 1.0, 0.0, observable=False), leak(3, 0.0, 1.0, in_view=False, observable=False))
    result = score([(0.0, 0.0), (0.0, 1.0)], truth(*leaks)).gated
    assert (result.all.found, result.all.of) == (2, 3)
    assert (result.in_view.found, result.in_view.of) == (1, 2)
    assert (result.observable.found, result.observable.of) == (1, 1)


@pytest.mark.parametrize("estimates", [[], [(math.nan, 0.0)], [(math.inf, math.nan), (0.0, 0.0)]])
@pytest.mark.parametrize("leaks", [(), (leak(1, 0.0, 0.0),)])
def test_empty_and_undefined_estimates_are_scored_without_nan_in_the_json(estimates, leaks):
    result = score(estimates, truth(*leaks))
    assert len(result.gated.pairs) + len(result.gated.false) == len(estimates)
    assert "NaN" not in repr(as_json(result))
    assert "nan" not in table(result, truth(*leaks))


places = st.tuples(st.floats(-2, 2), st.floats(-2, 2))


@given(st.lists(places, max_size=5), st.lists(places, max_size=5), st.randoms())
def test_the_order_of_estimates_does_not_matter(leaks_m, estimates_m, random):
    known = truth(*(leak(i, x, y) for i, (x, y) in enumerate(leaks_m)))
    shuffled = random.sample(estimates_m, len(estimates_m))
    one, other = score(estimates_m, known).gated, score(shuffled, known).gated
    assert len(one.pairs) == len(other.pairs)
    assert sum(p.error_m for p in one.pairs) == pytest.approx(sum(p.error_m for p in other.pairs), abs=1e-9)
    assert len(one.pairs) + len(one.missed) == len(leaks_m)
    assert len(one.pairs) + len(one.false) == len(estimates_m)
