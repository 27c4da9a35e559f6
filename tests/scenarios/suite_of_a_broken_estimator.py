"""What an estimator's author writes, for an estimator broken on purpose: run by tests/test_properties_shrinking.py."""

from dataclasses import replace

from foreign_estimators import blind_below_20_cm
from hypothesis import given, settings

from scenarios.replay import replay_command
from scenarios.score import score
from scenarios.simulate import simulate
from scenarios.space import FULL, scenarios

CALM = FULL.within(
    "calm",
    2,
    {
        "rig.baseline_m": (0.1, 0.5),
        "gamma.dose_rate_gy_h": (0.0, 5.0),
        "rig.hfov_deg": (60.0, 80.0),
        "recording.n_frames": (12, 36),
    },
)


@settings(max_examples=100, database=None)
@given(scenarios(replace(CALM, width_px=480, height_px=270)))
def test_the_observable_leaks_are_found(scenario):
    clip = simulate(scenario)
    answer = blind_below_20_cm(clip.left, clip.right, clip.believed_rig)
    places = [(leak.x_m, leak.y_m) for leak in getattr(answer, "leaks", ())]
    seen = score(places, clip.truth).gated.observable
    command = replay_command(scenario, "--estimator foreign_estimators:blind_below_20_cm")
    assert seen.found == seen.of, f"replay: {command}"
