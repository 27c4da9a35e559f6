"""Damaged scenario and campaign files: refused in a few lines, or valid, complete and saying what the file says."""

import random
import tomllib
from functools import cache

import pytest
from damage import damaged_text
from hypothesis import given
from hypothesis import strategies as st
from verdicts import assert_bearable, assert_refused, leakloc

from leakloc.outside_file import MAX_DEPTH
from scenarios.campaign_file import CAMPAIGNS, read_campaign
from scenarios.leaks import resolved
from scenarios.rules import violations
from scenarios.scenario import Scenario
from scenarios.scenario_file import LIBRARY, read_scenario
from scenarios.scenario_toml import scenario_toml
from scenarios.toml_text import parse_toml

EVERYTHING = """seed = 7
name = "everything"
[rig]
roll_deg = 1.5
distortion = [0.01, 0.0, 0.0, 0.0, 0.0]
[believed_rig]
baseline_m = 0.51
lamps = "unknown"
[recording]
n_frames = 6
readout_s = 0.01
[sensor]
tone = "srgb"
[effects]
drop_shadows = false
[[lamp]]
position_m = [-2.0, 0.5, 0.4]
[[leak]]
x_m = 1.0
y_m = 0.25
drop_times_s = [-0.5, -0.25, 0.0, 0.25]
[[leak]]
x_m = 0.5
y_m = -0.5
drip_period_s = 0.3
[[structure]]
kind = "box"
centre_m = [0.5, 0.0, 1.0]
size_m = [0.2, 2.0, 0.1]
yaw_deg = 10.0
[[structure]]
kind = "pipe"
start_m = [1.0, -1.0, -1.0]
end_m = [1.0, 1.0, -1.0]
radius_m = 0.05
[[structure]]
kind = "grating"
centre_m = [0.0, 0.0, -2.0]
size_m = [1.0, 1.0]
"""


@cache
def scenario_texts():
    """Shipped scenarios, as people write them and with everything listed, and one that uses every table."""
    shipped = [LIBRARY.text_of(name)[1] for name in LIBRARY.names()]
    whole = [scenario_toml(resolved(read_scenario(name))) for name in ("separated", "behind_beam")]
    return (*shipped, *whole, *[EVERYTHING] * len(shipped))


def holds(said, kept):
    """Whether everything that a file says stands in what was read: no key is passed over."""
    if isinstance(said, dict):
        return isinstance(kept, dict) and all(key in kept and holds(said[key], kept[key]) for key in said)
    if isinstance(said, list):
        return len(said) == len(kept) and all(map(holds, said, kept))
    return said == kept


def assert_kept(path, text):
    """An accepted scenario breaks no rule, says what its file says, and reads back to itself."""
    scenario = read_scenario(path)
    assert not violations(scenario)
    said = tomllib.loads(text)
    for table in said.get("structure", []):
        table.pop("path", None)  # has come to start at the file
    assert holds(said, scenario.model_dump(mode="json"))
    whole = resolved(scenario)
    assert Scenario.model_validate(tomllib.loads(scenario_toml(whole))) == whole


def damaged_scenarios(folder, seed, numbers, tally):
    path, made = folder / "damaged.toml", folder / "clip"
    for number in numbers:
        rng = random.Random(f"scenario {seed} {number}")
        raw = damaged_text(rng.choice(scenario_texts()), rng)
        path.write_bytes(raw)
        verdict = leakloc("check", path)
        try:
            assert_bearable(verdict)
            if verdict.code == 0:
                assert_kept(path, raw.decode())
                tally["accepted and equal in meaning"] += 1
                continue
            assert str(path) in verdict.error or "structure." in verdict.error, verdict
            if number % 10 == 0:
                assert leakloc("simulate", path, "-o", made).error == verdict.error
            assert sorted(folder.iterdir()) == [path]
            tally["refused with exit code 2"] += 1
        except BaseException as error:
            error.add_note(f"scenario {number} of seed {seed}: {raw[:3000]!r}")
            raise


def test_a_damaged_scenario_is_refused_or_means_what_it_says(tmp_path, tally):
    damaged_scenarios(tmp_path, 0, range(300), tally)
    assert sum(tally.values()) == 300
    assert tally["refused with exit code 2"] > 0


@pytest.mark.deep
def test_ten_thousand_damaged_scenarios_are_refused_or_mean_what_they_say(tmp_path, harness_seed, tally):
    damaged_scenarios(tmp_path, harness_seed, range(10_000), tally)
    assert sum(tally.values()) == 10_000
    assert tally["refused with exit code 2"] > 0


def damaged_campaigns(folder, seed, numbers, tally):
    path = folder / "damaged.toml"
    for number in numbers:
        rng = random.Random(f"campaign {seed} {number}")
        raw = damaged_text(CAMPAIGNS.text_of(rng.choice(CAMPAIGNS.names()))[1], rng)
        path.write_bytes(raw)
        verdict = leakloc("campaign", "check", path)
        try:
            assert_bearable(verdict)
            if verdict.code == 0:
                assert holds(tomllib.loads(raw.decode()), read_campaign(path).campaign.model_dump(mode="json"))
            assert sorted(folder.iterdir()) == [path]
        except BaseException as error:
            error.add_note(f"campaign {number} of seed {seed}: {raw[:3000]!r}")
            raise
        tally["accepted and equal in meaning" if verdict.code == 0 else "refused with exit code 2"] += 1


def test_a_damaged_campaign_is_refused_or_means_what_it_says(tmp_path, tally):
    damaged_campaigns(tmp_path, 0, range(60), tally)
    assert sum(tally.values()) == 60
    assert tally["refused with exit code 2"] > 0


@pytest.mark.deep
def test_a_thousand_damaged_campaigns_are_refused_or_mean_what_they_say(tmp_path, harness_seed, tally):
    damaged_campaigns(tmp_path, harness_seed, range(1000), tally)
    assert sum(tally.values()) == 1000
    assert tally["refused with exit code 2"] > 0


@given(st.text(alphabet='ab.="[]{}\n 019#'))
def test_any_toml_is_what_the_standard_library_says_or_refused(text):
    try:
        data = parse_toml(text)
    except ValueError:
        return
    assert data == tomllib.loads(text)


@pytest.mark.parametrize("depth", [MAX_DEPTH // 2, MAX_DEPTH, 10 * MAX_DEPTH, 100_000])
@pytest.mark.parametrize("form", ["a.{}a = 1", "[a.{}a]", "b = {{a.{}a = 1}}", '"a".{}"a" = 1'])
def test_keys_of_many_parts_are_refused_before_they_take_quadratic_time(tmp_path, depth, form):
    path = tmp_path / "deep.toml"
    path.write_text(form.format("a." * depth))
    too_many = "deep.toml: not valid TOML: a key must have at most"
    assert_refused(leakloc("check", path), too_many if depth >= MAX_DEPTH else "not a known key")


# files of a megabyte that once took seconds, gigabytes or a traceback
MANY = {
    "unknown keys": "".join(f"k{i} = 1\n" for i in range(29_000)),
    "more keys than anybody has": "".join(f"k{i} = 1\n" for i in range(90_000)),
    "leaks without a place": f"leak = [{'{},' * 300_000}]",
    "leaks that are numbers": f"leak = [{'1,' * 400_000}]",
    "wrong drop times": "[[leak]]\nx_m = 0.0\ny_m = 0.0\ndrop_times_s = [" + '"",' * 1990 + "]\n",
    "structures without a kind": "[[structure]]\n" * 60_000,
    "a number of 5000 digits": "seed = " + "9" * 5000,
    "a hexadecimal number of 5000 digits": "rig.baseline_m = 0x" + "f" * 5000,
    "a key of 200 000 letters": f"{'k' * 200_000} = 1",
    "a list as deep as the parser goes": f"a = {'[' * 400}{']' * 400}",
    "a million open brackets": "a = " + "[" * 900_000,
    "a terminal's commands in a key": '"\\u001b[2J\\nError: no error" = 1',
}


@pytest.mark.parametrize("kind", MANY)
def test_many_mistakes_are_refused_in_a_second_and_a_page(tmp_path, kind):
    path = tmp_path / "many.toml"
    path.write_text(MANY[kind])
    assert_refused(leakloc("check", path), "many.toml: ")


@pytest.mark.parametrize(
    ("structure", "said"),
    [
        (
            'kind = "box"\ncentre_m = [0.0, 0.0, 0.0]\nsize_m = [0.0, 1.0, 1.0]',
            "structure.0.size_m.0 must be >= 0.0001",
        ),
        ('kind = "pipe"\nstart_m = [0.0, 0.0, 0.0]\nend_m = [0.0, 0.0, 0.0]', "structure.0.end_m: must be at least"),
        (
            'kind = "grating"\ncentre_m = [0.0, 0.0, 0.0]\nsize_m = [1.0, 1.0]\nbar_m = 2.0',
            "structure.0.bar_m: must be less",
        ),
        (
            'kind = "grating"\ncentre_m = [0.0, 0.0, 0.0]\nsize_m = [100.0, 100.0]\npitch_m = 0.0011\nbar_m = 0.001',
            "at most 10000 bars",
        ),
    ],
)
def test_a_structure_that_cannot_be_is_refused_by_its_key(tmp_path, structure, said):
    path = tmp_path / "structure.toml"
    path.write_text(f"[[structure]]\n{structure}\n")
    assert_refused(leakloc("check", path), said)


def test_thousands_of_overrides_are_refused_before_they_are_applied(tmp_path):
    path = tmp_path / "campaign.toml"
    path.write_text('scenario = "plain"\nset = [' + '"seed=1",' * 90_000 + "]\n")
    assert_refused(leakloc("campaign", "check", path), "set must have at most 100 entries")
