"""The robust method on simulated clips: a few scenes with fixed seeds; the tables are in the deep tests."""

from dataclasses import replace
from functools import cache, lru_cache

import numpy as np
import pytest

from leakloc import locate
from scenarios.scenario_file import read_scenario
from scenarios.score import score
from scenarios.simulate import simulate

pytestmark = pytest.mark.xdist_group("robust clips")  # they share clips


@lru_cache(maxsize=1)
def clip_of(preset, seed, *changes):
    return simulate(read_scenario(preset, list(changes), seed=seed))


@cache
def scored(preset, seed, *changes, **options):
    clip = clip_of(preset, seed, *changes)
    estimate = locate(clip.left, clip.right, clip.believed_rig, method="robust", **options)
    return score([(leak.x_m, leak.y_m) for leak in estimate.leaks], clip.truth).gated, estimate


@pytest.mark.parametrize("preset", ["separated", "crowded_1"])
def test_every_observable_leak_is_found_within_centimetres_and_none_is_invented(preset):
    result, _ = scored(preset, 7)
    assert result.observable.found == result.observable.of > 0
    assert result.false == ()
    assert result.worst_error_m < 0.06


def test_the_covariance_is_long_along_the_line_of_sight_and_short_across_it():
    _, estimate = scored("crowded_1", 7)
    assert len(estimate.leaks) == 3
    for leak in estimate.leaks:
        variances_m2, axes = np.linalg.eigh(leak.covariance_m2)
        sight = np.array([leak.x_m + 2.4, leak.y_m])
        # both cameras stand 0.25 m beside the middle of the baseline: 6 deg at 2.4 m
        assert abs(axes[:, 1] @ sight) > np.cos(np.radians(6.0)) * np.linalg.norm(sight)
        assert variances_m2[1] > 9 * variances_m2[0]


@pytest.mark.parametrize("seed", [7, 15, 1004])
def test_near_the_wall_every_leak_is_found_beside_its_shadow(seed):
    result, _ = scored("near_wall", seed)
    assert result.observable.found == result.observable.of == 3
    assert result.false == ()
    assert result.worst_error_m < 0.04


@pytest.mark.parametrize("seed", [1000, 1020])  # a near drop of the second shows four glints, paired crosswise
def test_two_lamps_glints_are_told_apart_and_their_shadows_are_no_leaks(seed):
    result, _ = scored("two_lamps", seed)
    assert result.observable.found == result.observable.of == 3
    assert result.false == ()
    assert result.worst_error_m < 0.02


CRISP = (
    *("layout.z_m=1.0", "lamp.0.radius_m=0.06", "layout.wall_margin_m=0.05"),
    *("pedestal.steel_reflectance=0.04", "pedestal.rust_reflectance=0.09"),
)


@pytest.mark.parametrize("dose_rate_gy_h", [1.7, 10.0])
def test_the_pauses_of_busy_shadows_brighten_in_step_and_are_no_leaks(dose_rate_gy_h):
    result, estimate = scored("separated", 1908161254856616120, *CRISP, f"gamma.dose_rate_gy_h={dose_rate_gy_h}")
    assert result.observable.found == result.observable.of == 3
    assert result.false == ()
    assert "shadow of a leak" in {line["verdict"] for line in estimate.diagnostics["lines"] if line["polarity"] < 0}


def test_the_shadows_of_seven_leaks_are_no_leaks():
    result, estimate = scored("seven", 1000)
    assert result.observable.found == result.observable.of == 4
    assert result.false == ()
    assert "shadow of a leak" in {line["verdict"] for line in estimate.diagnostics["lines"]}


@pytest.mark.parametrize("dose_rate_gy_h", [0.0, 10.0, 200.0])
def test_a_clip_without_leaks_has_none(dose_rate_gy_h):
    _, estimate = scored("separated", 3, "layout.n_leaks=0", f"gamma.dose_rate_gy_h={dose_rate_gy_h}")
    assert estimate.leaks == ()


def test_a_tilted_rig_is_levelled_by_its_streaks():
    result, estimate = scored("separated", 8, "rig.roll_deg=-2.0", "rig.pitch_deg=1.5")
    told = estimate.diagnostics["levelling"]
    assert told["roll_deg"] == pytest.approx(-2.0, abs=0.15)
    assert told["pitch_deg"] == pytest.approx(1.5, abs=0.15)
    assert result.all.found == result.all.of == 3
    assert result.worst_error_m < 0.03


def test_a_pair_out_of_step_by_a_frame_is_told():
    clip = clip_of("separated", 8)
    estimate = locate(clip.left[:-1], clip.right[1:], clip.believed_rig)
    assert estimate.diagnostics["step"]["frames"] == -1


def test_leaks_are_found_without_knowledge_of_lamp_and_wall():
    clip = clip_of("separated", 8)
    blind = replace(clip.believed_rig, lamps=None, pedestal_radius=None)
    estimate = locate(clip.left, clip.right, blind)
    result = score([(leak.x_m, leak.y_m) for leak in estimate.leaks], clip.truth).gated
    assert result.observable.found == result.observable.of == 3
    assert result.false == ()


def test_falling_drops_tell_the_frame_rate_within_its_stated_error():
    _, estimate = scored("separated", 1000)
    fall = estimate.diagnostics["free_fall"]
    assert abs(fall["frames_per_s"] - 12.0) < 3 * fall["sigma"]
    assert fall["sigma"] < 2.0
    _, halved = scored("separated", 1000, "recording.fps=24.0", "recording.exposure_s=0.0416666")
    assert halved.diagnostics["free_fall"]["frames_per_s"] > 1.5 * fall["frames_per_s"]


def test_a_baseline_believed_too_short_shows_in_the_fall():
    # all lengths shrink with it, and drops seem to fall as if there were less gravity: at a higher frame rate
    _, true = scored("separated", 1000)
    _, wrong = scored("separated", 1000, "believed_rig.baseline_m=0.3")
    told, mistold = (one.diagnostics["free_fall"]["frames_per_s"] for one in (true, wrong))
    assert mistold > 1.15 * told
