"""explain: the same scene without one cause at a time, and what each removal cures."""

import pytest

from scenarios.estimators import EstimatorSpec
from scenarios.explain import NOTHING, Arm, causes, cures, explain, explain_html, table
from scenarios.leaks import resolved
from scenarios.outcome import Outcomes
from scenarios.scenario_file import read_scenario

pytestmark = pytest.mark.xdist_group("explain")  # one worker: what they share is made once

SMALL = ["rig.width_px=480", "rig.height_px=270", "recording.n_frames=12", "gamma.dose_rate_gy_h=1.0"]
PAPER = EstimatorSpec("method", "paper")


def names(name, *overrides):
    return [cause.name for cause in causes(resolved(read_scenario(name, overrides)))]


def test_only_causes_that_a_scene_has_are_removed():
    assert names("plain") == ["drop shadows", "sensor noise", "motion blur"]
    assert "gamma" in names("plain", "gamma.dose_rate_gy_h=1")
    assert "structures" in names("behind_beam")
    assert "misalignment" in names("tilted_rig")
    assert "misalignment" not in names("tilted_rig", "believed_rig.roll_deg=1.5", "believed_rig.pitch_deg=1.0")
    assert [name for name in names("crowded_1") if name.startswith("leaks other")] == [
        f"leaks other than {i}" for i in range(3)
    ]


def test_removing_a_cause_keeps_the_leaks_and_their_drops():
    scenario = resolved(read_scenario("separated", SMALL))
    for cause in causes(scenario):
        if not cause.name.startswith("leaks other"):
            assert cause.without(scenario).leak == scenario.leak


@pytest.fixture(scope="module")
def arms():
    return list(explain(read_scenario("behind_beam", SMALL), PAPER))


def test_taking_the_beam_away_cures_the_leak_behind_it(arms):
    assert arms[0].removed == NOTHING
    assert arms[0].codes.leaks[1] == "missed.occluded"
    assert "structures" in cures(arms)[1]
    assert "leak 1 is found without: " in table(arms)


def test_without_its_shadow_a_leak_near_the_wall_is_not_pulled_by_it():
    near = ["leak.0.x_m=2.05", "leak.0.y_m=-0.04"]
    as_it_is, without, *_ = explain(read_scenario("plain", near), PAPER)
    assert without.removed == "drop shadows"
    assert as_it_is.codes.leaks[0] != "found"
    (pair,) = without.scored.gated.pairs
    assert pair.error_m < 0.1


def test_the_page_shows_every_arm(arms):
    page = explain_html(arms)
    assert page.count("<figure>") == len(arms)
    for fetched in ('src="http', 'href="http', "@import", "url(http"):  # opens offline
        assert fetched not in page.replace("'", '"')


def test_without_misalignment_the_paper_finds_what_it_missed_on_a_tilted_rig():
    tilted = read_scenario("plain", [*SMALL[:2], "rig.roll_deg=3.0", "rig.pitch_deg=1.0"])
    arms = list(explain(tilted, PAPER))
    assert "misalignment" in cures(arms)[0]


def test_a_breakdown_on_a_scene_without_leaks_is_not_told_as_a_success():
    arm = Arm(NOTHING, None, None, None, Outcomes({}, {}), "crash", "no idea")
    assert "found as it is" not in table([arm])
    assert "crash" in table([arm])
