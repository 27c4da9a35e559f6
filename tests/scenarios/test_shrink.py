"""shrink: the plainest scene that fails with the same code, as a file of at most 20 lines that replays."""

import json
import math
import shlex
import tomllib
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from scenarios.cli import main
from scenarios.estimators import EstimatorSpec
from scenarios.leaks import resolved
from scenarios.reductions import TABLES_FIRST
from scenarios.rules import violations
from scenarios.scenario import BelievedRigTable, LampTable, Scenario
from scenarios.scenario_file import read_scenario, validated
from scenarios.scene_file import conditions, scene_toml
from scenarios.shrink import NothingFailsError, codes_of, complexity, least_distance_m, plainer_scenes, shrink
from scenarios.shrunk_folder import explain_command
from scenarios.space import scene_of

MISSED = "missed.unexplained"


def last(scenario, codes, code=None):
    *_, shrunk = shrink(scenario, code, codes)
    return shrunk


def blind_below_20_cm(scenario):
    return {MISSED} if scenario.rig.baseline_m < 0.2 else set()


def blind_between_4_and_6_gy_h_with_two_leaks(scenario):
    return {MISSED} if 4.0 <= scenario.gamma.dose_rate_gy_h <= 6.0 and len(resolved(scenario).leak) >= 2 else set()


def at(scenario, **tables):
    return scenario.model_copy(
        update={name: getattr(scenario, name).model_copy(update=values) for name, values in tables.items()}
    )


def test_a_failure_of_one_parameter_shrinks_to_that_parameter_alone():
    busy = at(scene_of("hard", 3, 0), rig={"baseline_m": 0.1734})
    shrunk = last(busy, blind_below_20_cm)
    assert shrunk.code == MISSED
    assert conditions(shrunk.scenario) == ["rig.baseline_m=0.17"]
    assert len(shrunk.scenario.leak) == 1
    assert shrunk.scenario.rig.width_px == 320
    assert shrunk.scenario.recording.n_frames == 6


def test_a_failure_that_takes_two_leaks_keeps_two_as_far_apart_as_they_were():
    busy = at(scene_of("nominal", 6, 0), gamma={"dose_rate_gy_h": 5.37})
    assert len(resolved(busy).leak) >= 2
    shrunk = last(busy, blind_between_4_and_6_gy_h_with_two_leaks).scenario
    assert shrunk.gamma.dose_rate_gy_h == 5.0
    assert len(shrunk.leak) == 2
    assert least_distance_m(shrunk) >= min(0.4, least_distance_m(resolved(busy)))


def test_the_leak_that_a_failure_befell_is_not_replaced_by_another_with_the_same_code():
    both = resolved(scene_of("nominal", 6, 0))
    codes = {leak.x_m: {MISSED} for leak in both.leak}

    def fails(scenario):
        return {MISSED} if any(leak.x_m in codes for leak in scenario.leak) else set()

    for leak in range(len(both.leak)):
        *_, shrunk = shrink(both, MISSED, fails, leak)
        assert [one.x_m for one in shrunk.scenario.leak] == [both.leak[leak].x_m]


def in_a_ring(scenario):
    """Blind for one ring, whose edge the rig's field of view moves."""
    edge_m = 1.80 + 0.002 * (scenario.rig.hfov_deg - 70.0)
    ranges_m = [math.hypot(leak.x_m, leak.y_m) for leak in scenario.leak]
    wide = scenario.gamma.dose_rate_gy_h > 3.0 and scenario.rig.hfov_deg > 80.0 and scenario.rig.baseline_m > 0.55
    return {MISSED} if any(edge_m - 0.03 < r < edge_m + 0.03 for r in ranges_m) or wide else set()


def test_a_failure_at_a_place_is_found_again_when_all_else_was_changed_first():
    leak = read_scenario("plain").leak[0].model_copy(update={"x_m": 1.4972, "y_m": 1.0471})
    busy = at(
        read_scenario("plain"),
        rig={"hfov_deg": 85.0, "baseline_m": 0.57, "roll_deg": 1.0},
        gamma={"dose_rate_gy_h": 8.0},
    )
    shrunk = last(busy.model_copy(update={"leak": (leak,), "seed": 11}), in_a_ring, MISSED)
    assert len(conditions(shrunk.scenario)) <= 3


def blind_at_a_place_that_moves_with_the_rig(scenario):
    """Within 3 cm of a place that lies elsewhere for each field of the rig that is not plain."""
    plain = read_scenario("plain").rig
    moved_m = sum(0.06 for name in ("hfov_deg", "roll_deg") if getattr(scenario.rig, name) == getattr(plain, name))
    is_there = any(math.hypot(leak.x_m - 0.88 - moved_m, leak.y_m + 1.0) < 0.03 for leak in scenario.leak)
    return {MISSED} if is_there and scenario.rig.baseline_m > 0.6 else set()


def test_a_place_that_fails_may_move_when_all_else_is_made_plain():
    leak = read_scenario("plain").leak[0].model_copy(update={"x_m": 0.8772, "y_m": -1.0131})
    busy = at(read_scenario("plain"), rig={"hfov_deg": 71.0, "baseline_m": 0.62, "roll_deg": 1.0})
    shrunk = last(busy.model_copy(update={"leak": (leak,)}), blind_at_a_place_that_moves_with_the_rig, MISSED)
    assert len(conditions(shrunk.scenario)) <= 3


def blind_in_a_ring_where_it_is_seen(scenario):
    """Blind at 1.80 m from the middle for one field of view; far to the side that is seen by few rigs."""
    (leak,) = scenario.leak
    ahead = abs(math.atan2(leak.y_m, leak.x_m)) < math.radians(65.0)
    is_seen = ahead or (scenario.rig.baseline_m < 0.35 and scenario.recording.n_frames > 18)
    is_there = abs(math.hypot(leak.x_m, leak.y_m) - 1.80) < 0.01 and abs(scenario.rig.hfov_deg - 76.0) < 1.0
    return {MISSED} if is_there and is_seen else set()


def test_a_leak_may_go_around_the_middle_when_all_else_is_made_plain():
    leak = read_scenario("plain").leak[0].model_copy(update={"x_m": 0.2031, "y_m": 1.7894})
    busy = at(read_scenario("plain"), rig={"hfov_deg": 76.4, "baseline_m": 0.31}, recording={"n_frames": 19})
    shrunk = last(busy.model_copy(update={"leak": (leak,)}), blind_in_a_ring_where_it_is_seen, MISSED)
    assert len(conditions(shrunk.scenario)) <= 3


def test_every_step_is_plainer_than_the_last_and_none_goes_in_circles():
    rng = np.random.default_rng(0)
    steps = [
        one.scenario
        for one in shrink(scene_of("hard", 5, 0), None, lambda _: {MISSED} if rng.random() < 0.7 else {"x"})
    ]
    sizes = [complexity(one) for one in steps]
    assert sizes == sorted(sizes, reverse=True)
    assert len(set(sizes)) == len(sizes)
    assert all(not violations(one) for one in steps)


def test_the_plain_scene_has_nothing_plainer():
    plain = at(read_scenario("plain", ["rig.width_px=320", "rig.height_px=180"]), recording={"n_frames": 6})
    assert not [one for one in plainer_scenes(plain, TABLES_FIRST) if complexity(one) < complexity(plain)]


def test_missed_leaks_come_before_false_ones_and_a_code_can_be_named():
    both = {"false.gamma", MISSED}
    assert last(scene_of("easy", 0, 0), lambda _: both).code == MISSED
    assert last(scene_of("easy", 0, 0), lambda _: both, "false.gamma").code == "false.gamma"


@pytest.mark.parametrize(("code", "words"), [(None, "must have a failure, has none"), ("crash", "must have crash")])
def test_a_scene_without_the_failure_cannot_be_shrunk(code, words):
    with pytest.raises(NothingFailsError, match=words):
        last(scene_of("easy", 0, 0), lambda _: set(), code)


@pytest.mark.parametrize("place", [("easy", 0), ("nominal", 3), ("hard", 2)])
def test_a_scene_file_reads_back_to_its_scene_in_at_most_20_lines(place):
    scenario = scene_of(*place, 0)
    for whole in (scenario, resolved(scenario).model_copy(update={"lamp": ()})):
        text = scene_toml(whole, ("a comment",))
        assert validated(tomllib.loads(text), "x") == whole
        assert len(text.splitlines()) <= 20
    assert scene_toml(scenario, ("why",)).startswith("# why\n")


def test_conditions_are_what_differs_from_the_plain_scene_but_for_its_size():
    plain = read_scenario("plain")
    assert conditions(at(plain, rig={"width_px": 320, "height_px": 180}, recording={"n_frames": 6})) == []
    assert conditions(at(plain, recording={"n_frames": 13})) == ["recording.n_frames=13"]
    moved = plain.model_copy(update={"leak": (plain.leak[0].model_copy(update={"x_m": 1.5}),)})
    assert conditions(moved) == ["leak.0.x_m=1.5"]
    told = plain.model_copy(update={"lamp": (LampTable(radius_m=0.2),), "believed_rig": BelievedRigTable(yaw_deg=1.0)})
    assert [one.partition("=")[0] for one in conditions(told)] == ["believed_rig.yaw_deg", "lamp"]


@pytest.mark.deep
def test_an_estimator_blind_below_20_cm_is_shown_with_that_baseline_alone():
    spec = EstimatorSpec("callable", "foreign_estimators:blind_below_20_cm")
    shrunk = last(at(scene_of("easy", 1, 0), rig={"baseline_m": 0.18}), codes_of(spec), MISSED)
    assert conditions(shrunk.scenario) == ["rig.baseline_m=0.18"]


def test_the_command_writes_a_file_a_picture_and_the_table_of_causes(tmp_path):
    out = tmp_path / "out"
    words = ["shrink", "easy:0", "--method", "paper", "--set", "rig.width_px=320", "--set", "rig.height_px=180"]
    done = CliRunner().invoke(main, [*words, "-o", str(out)])
    assert done.exit_code == 0, done.output
    assert {path.name for path in out.iterdir()} == {"scene.toml", "thumbnail.png", "explain.txt", "shrunk.json"}
    code = json.loads((out / "shrunk.json").read_text())["code"]
    text = (out / "scene.toml").read_text()
    assert len(text.splitlines()) <= 20
    assert text.splitlines()[:2] == [f"# {code} by paper", "# leakloc explain scene.toml --method paper"]
    assert code in codes_of(EstimatorSpec("method", "paper"))(read_scenario(out / "scene.toml"))
    assert (out / "thumbnail.png").read_bytes().startswith(b"\x89PNG")
    assert "(as it is)" in (out / "explain.txt").read_text()


def test_a_scene_in_which_nothing_fails_leaves_nothing_behind(tmp_path):
    small = ["--set", "rig.width_px=320", "--set", "rig.height_px=180", "--set", "recording.n_frames=12"]
    out = tmp_path / "out"
    done = CliRunner().invoke(main, ["shrink", "plain", *small, "--method", "robust", "-o", str(out)])
    assert done.exit_code == 2
    assert "must have a failure, has none" in done.output
    assert not list(Path(tmp_path).iterdir())


def test_a_default_scenario_says_nothing():
    assert scene_toml(Scenario(), ()) == "\n"


def fails_above(field, limit):
    def codes(scenario):
        return {MISSED} if getattr(scenario.pedestal, field) > limit else set()

    return codes


@pytest.mark.parametrize("value", [0.96, 0.9999])
def test_rounding_leaves_no_field_beyond_its_bound(value):
    scene = at(read_scenario("plain"), pedestal={"rust_reflectance": value})
    shrunk = last(scene, fails_above("rust_reflectance", 0.9)).scenario
    assert Scenario.model_validate(shrunk.model_dump()) == shrunk
    assert shrunk.pedestal.rust_reflectance < 1.0


def test_a_drip_that_rounding_would_make_impossible_is_left_as_it_is():
    plain = read_scenario("plain")
    scene = plain.model_copy(update={"leak": (plain.leak[0].model_copy(update={"drip_jitter": 0.97}),)})
    shrunk = last(scene, lambda s: {MISSED} if s.leak[0].drip_jitter > 0.9 else set())
    assert 0.9 < shrunk.scenario.leak[0].drip_jitter < 1.0


def test_leaks_that_are_drawn_nearer_than_40_cm_are_shrunk_like_others():
    near = read_scenario("plain", ["leak=[]", "layout.n_leaks=3", "layout.min_separation_m=0.1"], seed=4)
    assert least_distance_m(near) < 0.4
    shrunk = last(near, lambda _: {MISSED}).scenario
    assert shrunk.layout is None
    assert len(shrunk.leak) == 1


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        (EstimatorSpec("method", "paper"), ["--method", "paper"]),
        (EstimatorSpec("callable", "mine:locate", 90.0), ["--estimator", "mine:locate", "--timeout", "90"]),
        (
            EstimatorSpec("command", "sh -c 'tool \"a b\"' {clip} {result}"),
            ["--command", "sh -c 'tool \"a b\"' {clip} {result}"],
        ),
    ],
)
def test_the_command_that_explains_a_scene_can_be_pasted(spec, words):
    assert shlex.split(explain_command("scene file.toml", spec)) == ["leakloc", "explain", "scene file.toml", *words]
