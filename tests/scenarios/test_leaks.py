"""What a scenario leaves to chance: places of leaks and times of drops, with the laws that they must follow."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import kstest

from scenarios.leaks import draw_drop_times, draw_layout, resolved
from scenarios.scenario import Drip, LayoutTable, LeakTable, PedestalTable, RecordingTable, Scenario

PEDESTAL = PedestalTable()


def layouts(n_clips, **layout):
    table = LayoutTable(**layout)
    return np.array([[(k.x_m, k.y_m) for k in draw_layout(table, PEDESTAL, seed)] for seed in range(n_clips)])


def test_single_leaks_are_uniform_over_the_half_disc():
    # planted: without the square root the ranges crowd towards the axis (see tests/defects)
    places = layouts(3000, n_leaks=1, wall_margin_m=0.1)[:, 0]
    range_m, azimuth = np.linalg.norm(places, axis=1), np.arctan2(places[:, 1], places[:, 0])
    assert kstest((range_m / 2.4) ** 2, "uniform").pvalue > 1e-6
    assert kstest(azimuth / math.pi + 0.5, "uniform").pvalue > 1e-6


@given(st.integers(0, 2**32), st.integers(1, 7), st.floats(0.0, 0.5))
def test_every_layout_keeps_its_distances(seed, n_leaks, separation_m):
    layout = LayoutTable(n_leaks=n_leaks, min_separation_m=separation_m, wall_margin_m=0.2)
    places = np.array([(leak.x_m, leak.y_m) for leak in draw_layout(layout, PEDESTAL, seed)])
    assert len(places) == n_leaks
    assert (np.linalg.norm(places, axis=1) <= 2.3 + 1e-4).all()
    assert (places[:, 0] >= -1e-4).all()
    gaps = np.linalg.norm(places[:, None] - places[None], axis=-1)[np.triu_indices(n_leaks, 1)]
    assert (gaps >= separation_m - 2e-4).all()  # places are rounded to 0.1 mm


@given(st.integers(0, 2**32), st.floats(0.05, 1.0), st.floats(0.0, 0.9), st.floats(0.1, 4.0))
def test_intervals_between_drops_are_the_period_within_its_jitter(seed, period_s, jitter, end_s):
    drip = Drip(drip_period_s=period_s, drip_jitter=jitter)
    times_s = draw_drop_times(drip, -3.5, end_s, rng=np.random.default_rng(seed))
    gaps_s = np.diff(times_s)
    assert (np.abs(gaps_s - period_s) <= jitter * period_s + 2e-6).all()
    # whatever is in the air when the first frame opens was released: the fall to the floor takes sqrt(2 * 5.5 / 9.81) s
    assert times_s[0] <= -math.sqrt(2 * 5.5 / 9.81) + 2 * period_s
    assert times_s[-1] < end_s


def test_the_phase_of_a_drip_is_uniform():
    drip = Drip(drip_period_s=0.5, drip_jitter=0.0)
    phases = [draw_drop_times(drip, -3.5, 1.0, rng=np.random.default_rng(i))[0] % 0.5 for i in range(2000)]
    assert kstest(np.array(phases) / 0.5, "uniform").pvalue > 1e-6


def clip_of(n_leaks, n_frames):
    leaks = tuple(LeakTable(x_m=0.1 * i, y_m=0.0) for i in range(n_leaks))
    return resolved(Scenario(seed=3, leak=leaks, recording=RecordingTable(n_frames=n_frames)))


def test_a_leak_drips_the_same_whatever_stands_beside_it_and_unlike_its_neighbours():
    one, three = clip_of(1, 24), clip_of(3, 24)
    assert one.leak[0] == three.leak[0]
    assert len({leak.drop_times_s[:3] for leak in three.leak}) == 3


def test_a_longer_clip_begins_like_a_shorter_one():
    short, long = clip_of(1, 12), clip_of(1, 48)
    times = short.leak[0].drop_times_s
    assert long.leak[0].drop_times_s[: len(times)] == times


@given(seed=st.integers(0, 2**63 - 1), exposure_s=st.floats(0.1, 10.0), readout_s=st.floats(0.0, 1.0))
def test_drops_are_in_the_air_when_the_first_frame_opens_however_long_it_is(seed, exposure_s, readout_s):
    recording = RecordingTable(fps=0.04, exposure_s=exposure_s, readout_s=readout_s, n_frames=3)
    leak = LeakTable(x_m=0.0, y_m=0.0, drip_period_s=0.3, drip_jitter=0.0)
    times_s = resolved(Scenario(seed=seed, recording=recording, leak=(leak,))).leak[0].drop_times_s
    fall_s = math.sqrt(2 * (leak.z_m + 3.5) / 9.81)
    opens_s = -(exposure_s + readout_s) / 2
    assert min(times_s) <= opens_s - fall_s + leak.drip_period_s
    assert min(times_s) >= min(opens_s, -1.0) - fall_s - 2 * leak.drip_period_s


@given(st.integers(0, 2**63 - 1), st.floats(0.0, 0.05), st.floats(0.001, 0.05))
def test_a_drawn_leaks_drops_touch_no_wall_even_without_a_margin(seed, margin_m, drop_radius_m):
    layout = LayoutTable(n_leaks=5, wall_margin_m=margin_m, drop_radius_m=drop_radius_m, min_separation_m=0.1)
    for leak in draw_layout(layout, PedestalTable(), seed):
        assert math.hypot(leak.x_m, leak.y_m) + drop_radius_m < 2.5
