"""The robust method on simulated clips: a few scenes with fixed seeds; the tables are in the deep tests."""

import pytest

from leakloc import locate
from scenarios.scenario_file import read_scenario
from scenarios.score import score
from scenarios.simulate import simulate


def scored(preset, seed, *changes, **options):
    clip = simulate(read_scenario(preset, list(changes), seed=seed))
    estimate = locate(clip.left, clip.right, clip.believed_rig, method="robust", **options)
    return score([(leak.x_m, leak.y_m) for leak in estimate.leaks], clip.truth).gated, estimate


@pytest.mark.parametrize("preset", ["separated", "near_wall", "crowded_1"])
def test_every_observable_leak_is_found_within_centimetres_and_none_is_invented(preset):
    result, _ = scored(preset, 7)
    assert result.observable.found == result.observable.of > 0
    assert result.false == ()
    assert result.worst_error_m < 0.06


@pytest.mark.parametrize("dose_rate_gy_h", [0.0, 10.0, 200.0])
def test_a_clip_without_leaks_has_none(dose_rate_gy_h):
    _, estimate = scored("separated", 3, "layout.n_leaks=0", f"gamma.dose_rate_gy_h={dose_rate_gy_h}")
    assert estimate.leaks == ()
