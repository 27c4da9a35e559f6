"""What a wrong pan angle and a relative yaw do to an answer: closed forms of the geometry, each with its remainder.

No single view can reveal either; pan axes tilted against gravity, which streaks do reveal, are elsewhere.
"""

import numpy as np
import pytest

import leakloc
from scenarios.scenario_file import read_scenario
from scenarios.simulate import simulate

pytestmark = pytest.mark.xdist_group("misalignment")  # one worker: its clips are rendered once

DRIP = "drop_radius_m=0.0115,drip_period_s=0.27"
LEAKS_M = np.array([(0.3, 0.5), (0.9, -0.4)])
LEAKS = f"leak=[{', '.join(f'{{x_m={x},y_m={y},{DRIP}}}' for x, y in LEAKS_M)}]"
RIG_M, BASELINE_M, FOCAL_PX = np.array([-2.4, 0.0]), 0.5, 685.51
REMAINDER_PX = {"robust": 0.4, "paper": 1.0}
"""Of disparity: what the method's own columns may be off by. `paper` has whole ones in either view."""

method = pytest.mark.parametrize("method", REMAINDER_PX)


@pytest.fixture(scope="module")
def clips():
    """Rendered once per change of the true rig; what is believed stays as it is."""
    made = {}

    def clip(*changes):
        if changes not in made:
            made[changes] = simulate(read_scenario("crowded_1", [LEAKS, *changes], seed=3))
        return made[changes]

    return clip


def places(clip, method):
    """Estimates (2, 2), m, in the order of LEAKS_M."""
    estimate = leakloc.locate(clip.left, clip.right, clip.believed_rig, method=method)
    found = np.array(sorted((leak.x_m, leak.y_m) for leak in estimate.leaks))
    assert found.shape == LEAKS_M.shape
    return found


def remainder_m(method):
    """Z^2 / (f B) times the columns' own error, per leak."""
    return REMAINDER_PX[method] * (LEAKS_M - RIG_M)[:, 0] ** 2 / (FOCAL_PX * BASELINE_M)


@method
@pytest.mark.parametrize("error_deg", [3.0, -3.0])
def test_a_wrong_pan_angle_moves_every_estimate_by_range_times_2_sin_half_the_angle(clips, method, error_deg):
    found = places(clips(f"rig.yaw_deg={error_deg}"), method)
    d = np.radians(error_deg)
    ranges_m = np.linalg.norm(LEAKS_M - RIG_M, axis=1)
    moved_m = np.linalg.norm(found - LEAKS_M, axis=1)
    assert (np.abs(moved_m - ranges_m * 2 * np.sin(abs(d) / 2)) < remainder_m(method)).all()
    # the rig truly looks d to the left of where it is believed to look: all seems turned d to the right about it
    turned = (LEAKS_M - RIG_M) @ np.array([[np.cos(d), -np.sin(d)], [np.sin(d), np.cos(d)]]) + RIG_M
    assert (np.linalg.norm(found - turned, axis=1) < remainder_m(method)).all()
    # the law is told from "nothing happens" and from the other side
    other = (LEAKS_M - RIG_M) @ np.array([[np.cos(d), np.sin(d)], [-np.sin(d), np.cos(d)]]) + RIG_M
    assert (np.linalg.norm(other - turned, axis=1) > 3 * remainder_m(method)).all()


@method
@pytest.mark.parametrize("error_deg", [0.1, 0.5])
def test_a_relative_yaw_error_costs_depth_squared_over_baseline_times_the_angle(clips, method, error_deg):
    before, after = (places(clips(*changes), method) for changes in ((), (f"rig.right_yaw_deg={error_deg}",)))
    d, depth_m = np.radians(error_deg), (LEAKS_M - RIG_M)[:, 0]
    # a right camera turned left sees all farther right: less disparity, more depth
    first_order_m = depth_m**2 / BASELINE_M * d
    farther_m = (after - before)[:, 0]
    # what the first order leaves out: d moves a column by f d (1 + tan^2 of its bearing), and 1 / (1 - q) is not 1 + q
    tan2 = ((LEAKS_M[:, 1] + BASELINE_M / 2) / depth_m) ** 2
    q = depth_m * d * (1 + tan2) / BASELINE_M
    left_out_m = first_order_m * tan2 + depth_m * q**2 / (1 - q)
    columns_m = remainder_m(method) * (1 if method == "robust" else 2)  # whole columns before and after
    assert (np.abs(farther_m - first_order_m) < left_out_m + columns_m).all()
    if error_deg > 0.3 or method == "robust":  # large enough to be told from nothing
        assert (first_order_m > 2 * left_out_m + columns_m).all()
