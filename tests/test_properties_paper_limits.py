"""Limits of the paper's method, as laws: if the simulator stopped showing them, the harness would be lying."""

import math

import pytest

import leakloc
from leakloc.paper import PaperOptions
from scenarios.scenario_file import read_scenario
from scenarios.simulate import simulate

SMALL = ["rig.width_px=480", "rig.height_px=270", "gamma.dose_rate_gy_h=0.0"]
FOCAL_PX, WINDOW_PX = 342.75, PaperOptions().g_win_px
DRIP = "drop_radius_m=0.0115,drip_period_s=0.27"


def columns_near(clip, columns_px):
    """Candidate columns of the left view within a few px of where the leaks are."""
    estimate = leakloc.locate(clip.left, clip.right, clip.believed_rig, method="paper")
    candidates = estimate.diagnostics["left"]["candidate_columns_px"]
    return [c for c in candidates if min(columns_px) - 4 < c < max(columns_px) + 4], len(estimate.leaks)


def pair_apart(columns, seed):
    """Two leaks, 2.4 m ahead of the rig, this many columns apart in both views; without shadows."""
    apart_m = columns * 2.4 / FOCAL_PX
    leaks = ",".join(f"{{x_m=0.0,y_m={y},{DRIP}}}" for y in (-apart_m / 2, apart_m / 2))
    changes = [*SMALL, "recording.n_frames=12", "effects.drop_shadows=false", f"leak=[{leaks}]"]
    return simulate(read_scenario("crowded_1", changes, seed=seed))


@pytest.mark.parametrize("columns", [4, 7, WINDOW_PX - 1.5])
@pytest.mark.parametrize("seed", [1, 2])
def test_leaks_within_the_suppression_window_must_merge(columns, seed):
    clip = pair_apart(columns, seed)
    near, found = columns_near(clip, [leak.left_column_px for leak in clip.truth.leaks])
    assert len(near) == 1
    assert found == 1


@pytest.mark.parametrize("columns", [WINDOW_PX + 4, 2 * WINDOW_PX])
@pytest.mark.parametrize("seed", [1, 2])
def test_leaks_well_beyond_the_suppression_window_must_not(columns, seed):
    clip = pair_apart(columns, seed)
    near, found = columns_near(clip, [leak.left_column_px for leak in clip.truth.leaks])
    assert len(near) == 2
    assert found == 2


def error_m(changes, place):
    """Distance of the estimate nearest to a leak; infinite without one."""
    clip = simulate(read_scenario("near_wall", changes))
    estimate = leakloc.locate(clip.left, clip.right, clip.believed_rig, method="paper")
    return min((math.dist(place, (leak.x_m, leak.y_m)) for leak in estimate.leaks), default=math.inf)


@pytest.mark.parametrize("azimuth_deg", [-25, 0, 20])
def test_the_shadow_beside_a_near_wall_leak_must_pull_it_and_nothing_else_does(azimuth_deg):
    # 0.25 m from the wall: the shadow falls within the suppression window, and its column is the stronger one
    azimuth = math.radians(azimuth_deg)
    place = (round(2.25 * math.cos(azimuth), 3), round(2.25 * math.sin(azimuth), 3))
    leak = f"leak=[{{x_m={place[0]},y_m={place[1]},drop_radius_m=0.0115,drip_period_s=0.27}}]"
    changes = ["gamma.dose_rate_gy_h=0.0", leak]
    pulled, free = error_m(changes, place), error_m([*changes, "effects.drop_shadows=false"], place)
    pixel_m = (2.4 + place[0]) ** 2 / (2 * FOCAL_PX * 0.5)
    assert free < 1.5 * pixel_m
    assert pulled > 2 * free
    assert pulled > 1.5 * pixel_m
