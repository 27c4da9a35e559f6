"""The verdict *observable* follows from geometry and photometry, one rule after the other."""

import numpy as np
import pytest

from scenarios.scenario_file import read_scenario
from scenarios.simulate import simulate

SMALL = ["rig.width_px=480", "rig.height_px=270", "recording.n_frames=8"]


def leaks(name, *overrides):
    return simulate(read_scenario(name, [*SMALL, *overrides])).truth.leaks


def test_a_leak_behind_a_beam_is_occluded_and_its_neighbours_are_not():
    reasons = [leak.reason for leak in leaks("behind_beam")]
    assert reasons[1].startswith("occluded")
    assert [reasons[0], reasons[2]] == [None, None]


def test_a_leak_beside_the_field_of_view_is_out_of_view():
    (leak,) = leaks("separated", "layout.n_leaks=1", "rig.yaw_deg=60", "rig.position_m=[-1.8, 0.0, 0.0]")
    assert leak.reason.startswith("out of view")
    assert leak.column_snr is None or not leak.in_view


def test_two_leaks_on_one_ray_are_merged():
    listed = "leak=[{x_m=0.5,y_m=0.3,drop_radius_m=0.0115},{x_m=0.52,y_m=0.31,drop_radius_m=0.0115}]"
    reasons = [leak.reason for leak in leaks("crowded_1", listed)]
    assert reasons == ["merged with leak 1", "merged with leak 0"]


@pytest.mark.parametrize("dose_rate", [0.0, 10.0])
def test_physical_drops_drown_in_noise_and_are_seen_without(dose_rate):
    listed = "leak=[{x_m=0.3,y_m=0.2,drop_radius_m=0.0035,drip_period_s=0.27}]"
    (leak,) = leaks("crowded_1", listed, f"gamma.dose_rate_gy_h={dose_rate}")
    assert leak.observable is (dose_rate == 0.0)
    assert dose_rate == 0.0 or leak.reason.startswith("low signal")


def test_the_signal_to_noise_ratio_falls_with_the_dose():
    ratios = [leaks("separated", f"gamma.dose_rate_gy_h={dose}")[0].column_snr for dose in (0.0, 1.7, 10.0, 50.0)]
    assert np.all(np.diff(ratios) < 0)
