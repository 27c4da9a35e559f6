"""Space files: a range for every axis, or every mistake at once with file, key, value and rule."""

import json

import pytest
from click.testing import CliRunner

from scenarios.cli import main
from scenarios.rules import violations
from scenarios.space import NOMINAL, STRATA, samples
from scenarios.space_file import SPACES, SpaceError, read_space
from scenarios.space_point import n_shares, places, scenario_of

AXIS = '[[axis]]\nkey = "rig.baseline_m"\nlow = 0.2\nhigh = 0.6\nstep = 0.1\n'

BAD = [
    ("unknown key", f"nam = 'x'\n{AXIS}", ("nam", 'did you mean "name"?', "'x'")),
    ("unknown axis", AXIS.replace("baseline_m", "baselin_m"), ("axis.0.key", 'did you mean "rig.baseline_m"?')),
    ("no number", AXIS.replace("rig.baseline_m", "sensor.tone"), ("axis.0.key", "must be a number", "'sensor.tone'")),
    ("ends swapped", AXIS.replace("low = 0.2", "low = 0.9"), ("axis.0.low", "at most high = 0.6", "0.9")),
    ("no step", AXIS.replace("step = 0.1", "step = 0.0"), ("axis.0.step", "> 0", "0.0")),
    ("twice", AXIS + AXIS, ("axis", "twice", "'rig.baseline_m'")),
    ("an end out of range", AXIS.replace("low = 0.2", "low = -0.2"), ("axis.0.low", "baseline_m must be > 0", "-0.2")),
    (
        "half a frame",
        AXIS.replace("rig.baseline_m", "recording.n_frames").replace("0.2", "2").replace("0.6", "9.5"),
        ("axis.0", "whole"),
    ),
    ("drips without leaks", AXIS.replace("rig.baseline_m", "layout.z_m"), ("axis.0.key", "[leaks]")),
    ("too many leaks", f"{AXIS}[leaks]\nmost = 99\n", ("leaks.most", "<= 10", "99")),
    ("no axes", "axis = []\n", ("axis", "at least one", "[]")),
    ("a bad base", f'scenario = "plan"\n{AXIS}', ("scenario", 'did you mean "plain"')),
]


@pytest.mark.parametrize(("text", "words"), [pytest.param(t, w, id=i) for i, t, w in BAD])
def test_a_bad_space_is_told_with_file_key_value_and_rule_and_nothing_is_written(tmp_path, text, words):
    path = tmp_path / "bad.toml"
    path.write_text(text)
    out = tmp_path / "out"
    result = CliRunner().invoke(main, ["hunt", str(path), "--method", "paper", "-o", str(out)])
    assert result.exit_code == 2
    assert all(line.startswith(f"Error: {path}: ") for line in result.output.splitlines())
    for word in words:
        assert word in result.output
    assert list(tmp_path.iterdir()) == [path]


def test_all_mistakes_of_a_space_are_reported_at_once(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(f'nam = "x"\nscenario = "plan"\n{AXIS.replace("0.2", "-0.2")}[leaks]\nmost = 0\n')
    with pytest.raises(SpaceError) as caught:
        read_space(path)
    keys = [line.split(": ")[1].split(" ")[0] for line in str(caught.value).splitlines()]
    assert keys == ["leaks.most", "nam", "scenario", "axis.0.low"]


def test_a_space_of_which_most_points_are_no_scenes_is_refused(tmp_path):
    path = tmp_path / "wide.toml"
    path.write_text('[[axis]]\nkey = "rig.baseline_m"\nlow = 1.0\nhigh = 9.0\nstep = 0.5\n')  # beyond the wall
    with pytest.raises(SpaceError, match="break no rule"):
        read_space(path)


def test_a_name_that_is_no_space_suggests_the_nearest():
    with pytest.raises(SpaceError, match='did you mean "hard"'):
        read_space("hart")


@pytest.mark.parametrize("name", [*(space.name for space in STRATA), *SPACES.names()])
def test_every_shipped_space_makes_scenes_that_break_no_rule(name):
    space = read_space(name)
    assert all(not violations(scenario) for scenario in samples(space, 20, 0))
    made = [scenario_of(space, [share] * n_shares(space), 3) for share in (0.0, 0.5, 0.999)]
    assert all(scenario is None or not violations(scenario) for scenario in made)
    assert made[1] is not None


def test_axes_of_drips_set_how_every_leak_drips(tmp_path):
    path = tmp_path / "drips.toml"
    text = AXIS.replace("rig.baseline_m", "layout.drop_radius_m").replace("0.2", "0.003").replace("0.6", "0.004")
    path.write_text(f"{text.replace('step = 0.1', 'step = 0.0005')}[leaks]\nmost = 3\n")
    scenario = scenario_of(read_space(path), [0.999] * 8, 0)
    assert {leak.drop_radius_m for leak in scenario.leak} == {0.004}
    assert next(samples(read_space(path), 1, 0)).layout.drop_radius_m in (0.003, 0.0035, 0.004)


def test_the_leaks_of_the_base_stand_where_none_are_asked_for(tmp_path):
    path = tmp_path / "fixed.toml"
    path.write_text(f'scenario = "crowded_1"\n{AXIS}')
    space = read_space(path)
    assert n_shares(space) == 1
    assert len(scenario_of(space, [0.5], 0).leak) == 3


def test_a_leak_too_near_to_an_earlier_one_is_left_out():
    shares = [0.5] * len(NOMINAL.axes) + [0.999] + [0.5, 0.5] * 2 + [0.2, 0.1] + [0.9, 0.9]
    assert [place.leak for place in places(NOMINAL, shares)] == [0, 2, 3]


def test_the_schema_of_a_space_is_printed():
    assert "axis" in json.loads(CliRunner().invoke(main, ["schema", "space"]).output)["properties"]
