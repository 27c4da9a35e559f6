"""Scenario files: good ones read back to themselves, bad ones give every mistake with file, key, value and rule."""

import tomllib

import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from scenarios.cli import main
from scenarios.leaks import resolved
from scenarios.rules import violations
from scenarios.scenario import Scenario
from scenarios.scenario_file import ScenarioError, library_names, read_scenario, validated
from scenarios.scenario_toml import inline_toml, scenario_toml
from scenarios.toml_text import parse_toml

LAMP = "[[lamp]]\nposition_m = [-2.3, 0.0, 0.4]\n"
LEAK = "[[leak]]\nx_m = 0.5\ny_m = 0.1\n"

# what is wrong, the text, and words that the message must hold (key, value, rule)
BAD = [
    ("syntax", "[rig\n", ("not valid TOML", "line 1")),
    ("unknown section", "[gama]\ndose_rate_gy_h = 1.0\n", ("gama", "not a known key", 'did you mean "gamma"')),
    ("unknown key", "[rig]\nbase_line_m = 0.5\n", ("rig.base_line_m", 'did you mean "baseline_m"', "0.5")),
    ("unknown key in a list", f"{LEAK}z = 1.0\n", ("leak.0.z", "not a known key")),
    ("negative baseline", "[rig]\nbaseline_m = -1.0\n", ("rig.baseline_m", "> 0", "-1.0")),
    ("text for a number", '[rig]\nbaseline_m = "0.5"\n', ("rig.baseline_m", "must be a number", "'0.5'")),
    ("true for a number", "[gamma]\ndose_rate_gy_h = true\n", ("gamma.dose_rate_gy_h", "must be a number", "True")),
    ("fraction of a pixel", "[rig]\nwidth_px = 960.5\n", ("rig.width_px", "whole number", "960.5")),
    ("not a number", "[rig]\nhfov_deg = nan\n", ("rig.hfov_deg", "finite", "nan")),
    ("infinite", "[recording]\nfps = inf\n", ("recording.fps", "inf")),
    ("too wide", "[rig]\nhfov_deg = 179.0\n", ("rig.hfov_deg", "<= 150", "179.0")),
    ("too many frames", "[recording]\nn_frames = 100000\n", ("recording.n_frames", "<= 1000", "100000")),
    ("unknown tone", '[sensor]\ntone = "log"\n', ("sensor.tone", "'linear' or 'srgb'", "'log'")),
    ("two coordinates", "[[lamp]]\nposition_m = [1.0, 0.0]\n", ("lamp.0.position_m", "required")),
    ("lamp with a point for a radius", "[[lamp]]\nradius_m = 0.0\n", ("lamp.0.radius_m", "> 0", "0.0")),
    ("number for a table", "gamma = 10\n", ("gamma", "must be a table", "10")),
    ("table for a list", "[leak]\nx_m = 1.0\ny_m = 0.0\n", ("leak", "must be a list")),
    ("leak without y", "[[leak]]\nx_m = 1.0\n", ("leak.0.y_m", "required")),
    ("leak outside", "[[leak]]\nx_m = 2.4\ny_m = 1.0\n", ("leak.0.x_m", "inside the pedestal", "2.4")),
    ("leak below the floor", f"{LEAK}z_m = -4.0\n", ("leak.0.z_m", "floor", "-4.0")),
    ("lamp in the wall", "[[lamp]]\nposition_m = [2.45, 0.0, 0.0]\n", ("lamp.0.position_m", "inside", "2.45")),
    ("camera outside", "[rig]\nbaseline_m = 3.0\n", ("rig.position_m", "left camera", "inside")),
    ("exposure longer than a frame", "[recording]\nfps = 30.0\n", ("recording.exposure_s", "1 / fps", "0.0333333")),
    ("layout and leaks", f"[layout]\n{LEAK}", ("layout", "beside [[leak]]")),
    ("crowded layout", "[layout]\nn_leaks = 90\n", ("layout.min_separation_m", "do not fit", "0.5")),
    (
        "huge clip",
        "gamma.dose_rate_gy_h = 0.0\n[rig]\nwidth_px = 4096\nheight_px = 4096\n[recording]\nn_frames = 900\n",
        ("n_frames", "900"),
    ),
    ("too frequent drops", f"{LEAK}drip_period_s = 0.001\n", ("leak.0.drip_period_s", "drops", "0.001")),
    ("negative seed", "seed = -1\n", ("seed", ">= 0", "-1")),
]


@pytest.mark.parametrize(("text", "words"), [pytest.param(t, w, id=i) for i, t, w in BAD])
def test_a_bad_scenario_gives_one_line_with_file_key_value_and_rule(tmp_path, text, words):
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(ScenarioError) as caught:
        read_scenario(path)
    lines = str(caught.value).splitlines()
    assert len(lines) == 1, lines
    assert lines[0].startswith(str(path))
    for word in words:
        assert word in lines[0]
    result = CliRunner().invoke(main, ["simulate", str(path), "-o", str(tmp_path / "clip")])
    assert (result.exit_code, result.output) == (2, f"Error: {lines[0]}\n")
    assert list(tmp_path.iterdir()) == [path]


def test_all_mistakes_are_reported_at_once_rules_between_values_included(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text('[rig]\nbaseline_m = -1\nhfov = 70\n[sensor]\ntone = "log"\n[[leak]]\nx_m = 9.0\ny_m = 0.0\n')
    with pytest.raises(ScenarioError) as caught:
        read_scenario(path)
    keys = [line.split(": ", 1)[1].split()[0].rstrip(":") for line in str(caught.value).splitlines()]
    assert sorted(keys) == ["leak.0.x_m", "rig.baseline_m", "rig.hfov", "sensor.tone"]


FAR_LEAK = "[[leak]]\nx_m = 9.0\ny_m = 0.0\nz_m = 50.0\n"


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        ("[recording]\nexposure_s = 3.0\n[[leak]]\nx_m = 1.0\n", ["leak.0.y_m", "recording.exposure_s"]),
        (
            "[[leak]]\nx_m = 1.0\n[[leak]]\nx_m = 9.0\ny_m = 0.0\nz_m = 50.0\n",
            ["leak.0.y_m", "leak.1.x_m", "leak.1.z_m"],
        ),
        ('[rig]\nbaseline_m = 9.0\n[[structure]]\nkind = "foo"\n', ["rig.position_m", "structure.0"]),
        ("[[lamp]]\nposition_m = [9.0, 0.0, 9.0]\n", ["lamp.0.position_m", "lamp.0.position_m"]),
        ("[gamma]\ndose_rate_gy_h = 10000.0\n[recording]\nfps = 0.1\nexposure_s = 10.0\n", ["gamma.dose_rate_gy_h"]),
    ],
)
def test_a_mistake_does_not_hide_those_beside_it(tmp_path, text, keys):
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(ScenarioError) as caught:
        read_scenario(path)
    blamed = [line.split(": ", 1)[1].split()[0].rstrip(":") for line in str(caught.value).splitlines()]
    assert sorted(blamed) == keys


def test_mistakes_of_one_file_leave_no_trace_in_what_is_said_of_the_next(tmp_path):
    path = tmp_path / "bad.toml"

    def said(text):
        path.write_text(text)
        with pytest.raises(ScenarioError) as caught:
            read_scenario(path)
        return str(caught.value)

    plain = f"[[leak]]\nx_m = 1.0\n{FAR_LEAK}"
    before = said(plain)
    said('[[leak]]\ny_m = "far"\nfoo = 1\n')  # x_m is missing and two more keys are bad, in one row
    assert said(plain) == before


def test_mistakes_of_overrides_come_with_those_of_the_file():
    with pytest.raises(ScenarioError) as caught:
        read_scenario("separated", ["foo", "rig.width_px=3", "gamma.dose_rate_gy_h=1\nx = 3"])
    assert len(str(caught.value).splitlines()) == 3


def test_a_rule_that_reads_a_bad_value_is_not_blamed_on_a_good_one(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text("[pedestal]\nradius_m = -2.5\n[[leak]]\nx_m = 2.6\ny_m = 0.0\n")  # outside only of the default
    with pytest.raises(ScenarioError) as caught:
        read_scenario(path)
    assert str(caught.value).count("\n") == 0
    assert "pedestal.radius_m" in str(caught.value)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"\xff\xfe\x00", "UTF-8"),
        (b"a = " + b"[" * 100_000, "nested too deeply"),
        (b"#" * 1_000_001, "at most 1000000 bytes"),
    ],
)
def test_a_file_that_is_no_text_or_too_big_is_refused_by_name(tmp_path, content, words):
    path = tmp_path / "odd.toml"
    path.write_bytes(content)
    with pytest.raises(ScenarioError, match=words) as caught:
        read_scenario(path)
    assert str(path) in str(caught.value)


def test_a_name_that_is_neither_file_nor_shipped_suggests_the_nearest():
    with pytest.raises(ScenarioError, match='did you mean "separated"'):
        read_scenario("seperated")


@pytest.mark.parametrize("name", library_names())
def test_every_shipped_scenario_is_valid_and_reads_back_to_itself(name):
    scenario = resolved(read_scenario(name))
    assert Scenario.model_validate(tomllib.loads(scenario_toml(scenario))) == scenario
    assert resolved(scenario) == scenario


@pytest.mark.parametrize(
    ("override", "read"),
    [
        ("gamma.dose_rate_gy_h=3.3", lambda s: s.gamma.dose_rate_gy_h == 3.3),
        ("lamp.0.position_m=[-2.2, 0.1, 0.3]", lambda s: s.lamp[0].position_m == (-2.2, 0.1, 0.3)),
        ("sensor.tone=srgb", lambda s: s.sensor.tone == "srgb"),
        ('pedestal.texture="uniform"', lambda s: s.pedestal.texture == "uniform"),
        ("rig.baseline_m=1", lambda s: s.rig.baseline_m == 1.0),
    ],
)
def test_an_override_sets_the_value_it_names(override, read):
    assert read(read_scenario("separated", [override]))


def test_an_override_reaches_into_the_lamp_that_is_there_by_default():
    lamp = read_scenario("crowded_1", ["lamp.0.power_w=7.5"]).lamp[0]
    assert (lamp.power_w, lamp.position_m) == (7.5, Scenario().lamp[0].position_m)


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("gamma.dose_rate_gy_h", "key.path=value"),
        ("=3", "key.path=value"),
        ("lamp.7.radius_m=0.1", "index below 1"),
        ("seed.x=1", "must be a table"),
        ("gamma.dose=3.3", "gamma.dose"),
    ],
)
def test_a_bad_override_is_refused(override, words):
    with pytest.raises(ScenarioError, match=words):
        read_scenario("separated", [override])


@given(
    st.dictionaries(
        st.sampled_from(["rig", "lamp", "leak", "seed", "layout", "x"]),
        st.recursive(
            st.none() | st.booleans() | st.floats() | st.text() | st.integers(),
            lambda inner: (
                st.lists(inner, max_size=3)
                | st.dictionaries(
                    st.sampled_from(["x_m", "y_m", "position_m", "baseline_m", "n_leaks", "q"]), inner, max_size=4
                )
            ),
            max_leaves=10,
        ),
    )
)
def test_any_data_is_a_valid_scenario_or_a_clear_error(data):
    try:
        scenario = validated(data, "any.toml")
    except ScenarioError as error:
        message = str(error)
    else:
        message = "any.toml: "
        assert not violations(scenario)
    assert all(line.startswith("any.toml: ") for line in message.splitlines())


@given(st.text(alphabet=st.characters(codec="utf-8", exclude_categories=["Cs"])))
def test_a_description_survives_the_file(text):
    scenario = Scenario(description=text[:2000])
    assert Scenario.model_validate(parse_toml(scenario_toml(scenario))).description == text[:2000]


@given(st.text(st.characters(exclude_categories=["Cs"]), max_size=20))
def test_any_text_inline_reads_back_to_itself(text):
    assert tomllib.loads(f"key = {inline_toml(text)}")["key"] == text


def test_a_mesh_is_stated_by_a_path_that_holds_from_anywhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "s.toml").write_text('[[structure]]\nkind = "mesh"\npath = "m.stl"\n')
    (table,) = read_scenario("study/s.toml").structure
    assert table.path == str(tmp_path / "study" / "m.stl")
