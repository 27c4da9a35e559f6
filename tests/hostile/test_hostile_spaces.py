"""Hostile spaces, and options of hunt, shrink and envelope: refused in a few lines, or a space that can be hunted."""

import os
import random
import time
import tomllib
from functools import cache
from itertools import islice

import numpy as np
import pytest
from damage import damaged_text
from hypothesis import given
from hypothesis import strategies as st
from verdicts import LIMIT_S, assert_refused, leakloc, tree

from scenarios import envelope
from scenarios.estimators import EstimatorSpec
from scenarios.hunt import Quarry, hunt
from scenarios.margins import Margins
from scenarios.rules import violations
from scenarios.scenario import Scenario
from scenarios.scenario_toml import scenario_toml
from scenarios.scene_work import OK, LeakOutcome, MethodOutcome
from scenarios.space import samples
from scenarios.space_file import SPACES, SpaceError, read_space

NAIVE = EstimatorSpec("method", "naive")
EVERYTHING = """name = "everything"
description = "every key of a space"
scenario = "separated"
set = ["rig.width_px=480", "gamma.dose_rate_gy_h=3.3"]
[leaks]
most = 4
min_separation_m = 0.5
wall_margin_m = 0.3
[[axis]]
key = "rig.baseline_m"
low = 0.2
high = 0.6
step = 0.05
plain = 0.5
unit = "m"
label = "baseline"
[[axis]]
key = "recording.n_frames"
low = 4
high = 24
step = 2
[[axis]]
key = "layout.drip_jitter"
low = 0.0
high = 0.5
step = 0.1
plain = 0.0
"""
FIXED = 'scenario = "crowded_1"\n[[axis]]\nkey = "rig.baseline_m"\nlow = {0}\nhigh = {0}\nstep = 0.1\nplain = {0}\n'
AXIS = '[[axis]]\nkey = "rig.baseline_m"\nlow = 0.2\nhigh = 0.6\nstep = 0.1\n'


@cache
def space_texts():
    """Shipped spaces, one that uses every key, and one of a single point."""
    shipped = [SPACES.text_of(name)[1] for name in SPACES.names()]
    return (*shipped, *[EVERYTHING] * len(shipped), FIXED.format(0.5))


@pytest.fixture
def taken(tmp_path):
    """A folder of the user, which no command may write to: what is refused because of it has passed as input."""
    folder = tmp_path / "taken"
    folder.mkdir()
    (folder / "notes.txt").write_text("of the user")
    return folder


def barely_right(works):
    """Stand in for the runs of an estimator: every leak is found, by a small margin, so that the hunt goes downhill."""
    outcomes = []
    for work in works:
        leaks = tuple(found_leak(number) for number in range(max(len(work.scenario.leak), 1)))
        outcomes.append(MethodOutcome("naive", OK, leaks=leaks, margins=Margins(0.1, 0.1, 0.1)))
    return outcomes


def found_leak(number):
    return LeakOutcome(
        number, 1.0, 0.0, in_view=True, observable=True, near_wall=False, code="found", error_m=0.01, error_px=0.1
    )


def assert_huntable(path, text):
    """An accepted space says what its file says; what is drawn from it are scenes that can be written and read back."""
    space, said = read_space(path), tomllib.loads(text)
    assert [axis.key for axis in space.axes] == [axis["key"] for axis in said["axis"]]
    for axis, row in zip(space.axes, said["axis"], strict=True):
        values = (axis.at(0.0), axis.at(0.5), axis.at(0.999999))
        assert all(row["low"] - 1e-6 <= value <= row["high"] + 1e-6 for value in values), (row, values)
    list(samples(space, 4, 0))
    scenes = [one.scenario for tried in islice(hunt(Quarry(space, NAIVE, 0), barely_right), 2) for one in tried]
    assert len(scenes) > 12
    for scene in scenes[::20]:
        assert not violations(scene)
        assert Scenario.model_validate(tomllib.loads(scenario_toml(scene))) == scene


def damaged_spaces(folder, taken, seed, numbers, tally):
    path = folder / "damaged.toml"
    for number in numbers:
        rng = random.Random(f"space {seed} {number}")
        raw = damaged_text(rng.choice(space_texts()), rng)
        path.write_bytes(raw)
        command, before = ("hunt", "envelope")[number % 2], tree(folder)
        try:
            verdict = leakloc(command, path, "--method", "naive", "-o", taken)
            assert_refused(verdict)
            if f"{taken}: already exists" in verdict.error:
                assert_huntable(path, raw.decode())
                tally["accepted and huntable"] += 1
            else:
                assert all(line.startswith(f"Error: {path}: ") for line in verdict.error.splitlines()), verdict
                if number % 10 == 0:
                    assert leakloc(command, path, "--method", "naive", "-o", folder / "made").error == verdict.error
                tally["refused with exit code 2"] += 1
            assert tree(folder) == before
        except BaseException as error:
            error.add_note(f"space {number} of seed {seed}: {raw[:3000]!r}")
            raise


def test_a_damaged_space_is_refused_or_can_be_hunted(tmp_path, taken, tally):
    damaged_spaces(tmp_path, taken, 0, range(50), tally)
    assert sum(tally.values()) == 50
    assert tally["refused with exit code 2"] > 0
    assert tally["accepted and huntable"] > 0


@pytest.mark.deep
def test_two_thousand_damaged_spaces_are_refused_or_can_be_hunted(tmp_path, taken, harness_seed, tally):
    damaged_spaces(tmp_path, taken, harness_seed, range(2000), tally)
    assert sum(tally.values()) == 2000
    assert tally["accepted and huntable"] > 0


NONE_IN_RANGE = AXIS.replace("step = 0.1", "step = 1e308")
# files that once took seconds, gigabytes, a traceback or a page too many, and what names their mistake
REFUSED = {
    "rows without a key": (f"axis = [{'{},' * 100_000}]", "axis must have at most 12 entries"),
    "rows that are numbers": (f"axis = [{'1,' * 100_000}]", "axis must have at most 12 entries"),
    "thousands of rows": ("[[axis]]\n" * 20_000, "axis must have at most 12 entries"),
    "thousands of unknown keys": ("".join(f"k{i} = 1\n" for i in range(20_000)), "more mistakes"),
    "thousands of overrides": ("set = [" + '"seed=1",' * 50_000 + f"]\n{AXIS}", "set must have at most 100 entries"),
    "its own base, and mistaken": (
        "".join(f"k{i} = 1\n" for i in range(49)) + f'scenario = "refused.toml"\n{AXIS}',
        "more mistakes",
    ),
    "its own base": (f'scenario = "refused.toml"\n{AXIS}', "scenario: "),
    "a step that is almost nothing": (AXIS.replace("step = 0.1", "step = 1e-320"), "axis.0.step: must be >= 1e-09"),
    "a step that is less than rounding": (AXIS.replace("step = 0.1", "step = 1e-10"), "axis.0.step: must be >= 1e-09"),
    "a million values": (AXIS.replace("step = 0.1", "step = 1e-7"), "axis.0.step: makes more than a million values"),
    "a step beyond the range": (NONE_IN_RANGE.replace("0.2", "0.55"), "axis.0.step: from plain = 0.5 on, must reach"),
    "a range as wide as numbers go": (AXIS.replace("0.2", "-1e308").replace("0.6", "1e308"), "axis.0.low: baseline_m"),
    "an end that the grid rounds to nothing": (AXIS.replace("0.2", "1e-10"), "axis.0.low: on the grid, baseline_m"),
    "NaN": (AXIS.replace("0.2", "nan"), "axis.0.low must be finite, got nan"),
    "infinity": (AXIS.replace("0.1", "inf"), "axis.0.step must be finite, got inf"),
    "a range turned round": (AXIS.replace("0.2", "0.9"), "axis.0.low: must be at most high = 0.6, got 0.9"),
    "a text for a number": (AXIS.replace("0.2", '"0.2"'), "axis.0.low must be a number, got '0.2'"),
    "a key that stands there twice": (AXIS + "low = 0.3\n", "not valid TOML"),
    "an axis that stands there twice": (AXIS + AXIS, "axis: an axis must not stand there twice"),
    "a stratum as its base": (f'scenario = "nominal"\n{AXIS}', "scenario: nominal: no such file"),
    "a base with a name too long": ("scenario = '" + "n" * 300 + f"'\n{AXIS}", "scenario: nnn"),
    "a base with a zero in its name": (f'scenario = "a\\u0000b"\n{AXIS}', "scenario: a\\x00b: no such file"),
    "a base that never ends": (f'scenario = "/dev/zero"\n{AXIS}', "scenario: /dev/zero: must be a regular file"),
    "a base that is a folder": (f'scenario = "taken"\n{AXIS}', "scenario: taken: no such file"),
    "a base that is no scenario": (f'scenario = "taken/notes.txt"\n{AXIS}', "scenario: "),
    "leaks that no place is left for": (
        f"{AXIS}[leaks]\nwall_margin_m = 10.0\n",
        "axis: most points must be scenarios",
    ),
    "a terminal's commands in a key": ('"\\u001b[2J\\nError: no error" = 1\n' + AXIS, "is not a known key"),
    "a name that is too long": ("name = '" + "n" * 101 + f"'\n{AXIS}", "name must have at most 100 entries"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_a_space_that_cannot_be_hunted_is_refused_by_file_and_key(tmp_path, taken, kind):
    text, said = REFUSED[kind]
    path = tmp_path / "refused.toml"
    path.write_text(text)
    before = tree(tmp_path)
    for command in ("hunt", "envelope"):
        verdict = leakloc(command, path, "--method", "naive", "-o", tmp_path / "made")
        assert_refused(verdict, said)
        assert all(line.startswith(f"Error: {path}: ") for line in verdict.error.splitlines()), verdict
    assert tree(tmp_path) == before


@pytest.mark.parametrize(
    ("raw", "said"),
    [
        (AXIS.encode("utf-16"), "must be UTF-8 text"),
        (AXIS.encode() + b"# \xff", "must be UTF-8 text"),
        (AXIS.encode() + b"\x00", "not valid TOML"),
        (b"", "axis is required"),
        (b"#" * 2_000_000, "at most"),
        (b"axis = " + b"[" * 400_000, "not valid TOML"),
    ],
)
def test_bytes_that_are_no_space_are_refused(tmp_path, raw, said):
    path = tmp_path / "bytes.toml"
    path.write_bytes(raw)
    assert_refused(leakloc("hunt", path, "--method", "naive", "-o", tmp_path / "made"), f"{path}: ", said)
    assert list(tmp_path.iterdir()) == [path]


# in place of SPACE
NO_SPACES = [
    *("", ".", "..", "/", "nowhere", "Nominal", "nominal:7", "nominal ", "drops.toml", "../spaces/drops", "~", "*"),
    *("/dev/zero", "/dev/stdin", "/proc/self/mem", "pipe", "loop", "to_zero", "to_nowhere", "sparse.toml", "taken"),
    *("n" * 300, "n/" * 3000, "taken/notes.txt", "taken/notes.txt/x", "\udcff", "\x1b[2J", "a\nb", "/dev/fd/99"),
]


def test_a_path_that_leads_to_no_space_is_refused_and_nothing_changes(tmp_path, taken, monkeypatch, tally):
    monkeypatch.chdir(tmp_path)
    os.mkfifo("pipe")
    for name, target in (("loop", "loop"), ("to_zero", "/dev/zero"), ("to_nowhere", "elsewhere/new")):
        os.symlink(target, name)
    with open("sparse.toml", "wb") as file:
        file.truncate(10**11)
    before = tree(tmp_path)
    for trick in NO_SPACES:
        for command in ("hunt", "envelope"):
            assert_refused(leakloc(command, "--method", "naive", "-o", "made", "--", trick))
            tally["refused with exit code 2"] += 1
    assert tree(tmp_path) == before
    assert tally.total() == 2 * len(NO_SPACES)


@pytest.mark.parametrize("stem", ["é 漢", "\udcff", "n" * 240, "a\nb", "\x1b[2J", "nominal"])
def test_a_space_without_a_name_lends_its_scenes_one_that_can_be_written(tmp_path, stem):
    path = tmp_path / f"{stem}.toml"
    path.write_text(AXIS)
    assert_huntable(path, AXIS)
    assert 0 < len(read_space(path).name) <= 100


def test_a_link_to_a_space_is_read_as_the_space(tmp_path):
    (tmp_path / "space.toml").write_text(AXIS)
    (tmp_path / "link.toml").symlink_to("space.toml")
    assert read_space(tmp_path / "link.toml").axes == read_space(tmp_path / "space.toml").axes


def test_a_space_of_one_point_is_hunted_although_nothing_can_move(tmp_path):
    path = tmp_path / "point.toml"
    path.write_text(FIXED.format(0.5))
    rounds = list(hunt(Quarry(read_space(path), NAIVE, 0), barely_right, 60))
    assert [one.number for tried in rounds for one in tried] == list(range(60))


def test_a_box_none_of_whose_points_is_a_scene_ends_the_envelope(tmp_path):
    # a hunt leaves leaks out that are too near to others; an envelope needs all, and for ten of them there is no room
    path = tmp_path / "crowd.toml"
    path.write_text(f"{AXIS}[leaks]\nmost = 10\nmin_separation_m = 5.0\n")
    quest, ten_leaks = envelope.Quest(read_space(path), NAIVE, 0, 20, 59), envelope.Box((0, 9), (3, 9))
    with pytest.raises(envelope.NoTrialsError, match=r"only 0 of .* points of a box break no rule"):
        envelope.tested(quest, ten_leaks, 0, barely_right, lambda _: None)


def test_boxes_of_axes_with_a_million_values_are_chosen_at_once():
    rng = np.random.default_rng(0)
    sizes = [10**6 + 1] * 11 + [10]
    values, right = rng.integers(0, sizes, (128, len(sizes))), rng.random(128) < 0.8
    start_s = time.process_time()
    boxes = envelope.nested_boxes(sizes, values, right)
    assert time.process_time() - start_s < 5.0 * LIMIT_S
    assert boxes
    assert right[boxes[0].holds(values)].all()


numbers = st.floats() | st.integers(-(10**6), 10**6).map(float) | st.sampled_from([1e308, -1e308, 5e-324, -0.0, 0.5])


@given(low=numbers, high=numbers, step=numbers, plain=st.none() | numbers)
def test_any_four_numbers_are_an_axis_within_its_range_or_a_mistake(tmp_path_factory, low, high, step, plain):
    path = tmp_path_factory.getbasetemp() / "numbers.toml"
    rows = {"low": low, "high": high, "step": step} | ({} if plain is None else {"plain": plain})
    path.write_text("\n".join(['[[axis]]\nkey = "rig.roll_deg"', *(f"{k} = {v!r}" for k, v in rows.items())]))
    try:
        (axis,) = read_space(path).axes
    except SpaceError as error:
        lines = str(error).splitlines()
    else:
        lines = []
        assert low - 1e-6 <= axis.at(0.0) <= axis.at(0.5) <= axis.at(1.0) <= high + 1e-6
    assert all(line.startswith(f"{path}: axis") for line in lines)


# option, value: for hunt (h), envelope (e) and shrink (s)
IMPOSSIBLE = [
    *(
        ("h", "--budget", value)
        for value in (
            *("0", "0s", "-1s", "nan", "nans", "inf", "infh", "10 parsecs", "10", "s", "", "1e9h", "8760h", "1 s s"),
            *("9" * 400 + "s", "0.0000min", "1,5min", "5min\n5min", "0x10s", "--force"),
        )
    ),
    *(("he", "--scenes", value) for value in ("0", "-1", "nan", "1.5", "1e3", "9" * 400, "", "ten", "10000000")),
    *(("e", "--trials", value) for value in ("0", "58", "-59", "nan", "100001", "9" * 400, "59.5", "")),
    *(("h", "--shrink", value) for value in ("-1", "1001", "nan", "", "0.5")),
    *(("hes", "--seed", value) for value in ("-1", "nan", "0.5", str(2**63), "9" * 400, "", "seed")),
    *(("he", "--workers", value) for value in ("0", "-1", "257", str(2**31), "nan", "1.5", "", "all")),
    *(("hes", "--timeout", value) for value in ("0", "-1", "nan", "inf", "3601", "1e308", "", "1min")),
    *(("hes", "--estimator", value) for value in ("", "os", "os:", ":f", "no_such_module:f", "a b:c", "../x:f")),
    *(("hes", "--estimator", value) for value in ("n" * 20_000 + ":f", "os;x:y", "\x1b[2J:f", "os:system()")),
    *(("hes", "--command", value) for value in ("", " ", "'", "no_such_program {clip} {result}", "\x1b[2J", "{")),
    *(("hes", "--method", value) for value in ("", "Naive", "robust2", "naive,paper", "\x1b[2J")),
    *(("s", "--set", value) for value in ("", "=", "a", "a=1", "rig.width_px=nan", "rig.width_px=" + "9" * 5000)),
    *(("s", "--code", value) for value in ("", "found", "no_such_code", "missed", "\x1b[2J")),
    *(("hes", option, "1") for option in ("--no-such-option", "--budgets", "--out")),
]
INPUTS = {"h": ("hunt", "easy"), "e": ("envelope", "easy"), "s": ("shrink", "plain")}
CHOOSING = ("--estimator", "--command", "--method")


def test_an_impossible_option_is_refused_before_a_scene_is_rendered(tmp_path, tally, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for commands, option, value in IMPOSSIBLE:
        for command in commands:
            chosen = () if option in CHOOSING else ("--method", "naive")
            verdict = leakloc(*INPUTS[command], *chosen, f"{option}={value}", "-o", "made")
            try:
                assert_refused(verdict)
            except BaseException as error:
                error.add_note(f"{INPUTS[command]} {option}={value!r:.100}")
                raise
            assert list(tmp_path.iterdir()) == []
            tally["refused with exit code 2"] += 1
    assert tally.total() > 180


@pytest.mark.parametrize("command", INPUTS.values())
def test_more_or_fewer_than_one_estimator_is_refused(tmp_path, command):
    for chosen in ((), ("--method", "naive", "--command", "true"), ("--method", "naive", "--estimator", "os:f")):
        assert_refused(leakloc(*command, *chosen, "-o", tmp_path / "made"), "exactly one of --method")
    assert list(tmp_path.iterdir()) == []


NO_OUTPUTS = [
    *("", ".", "..", "file", "file/made", "file/x/y", "taken", "pipe", "loop", "to_taken", "clip"),
    *("n" * 300, "n/" * 3000, "n" * 240, "\udcff" * 240, "taken/notes.txt", "/dev/null", "/dev/null/x"),
]


@pytest.mark.parametrize("command", INPUTS.values())
def test_an_output_that_is_something_else_is_refused_and_nothing_changes(
    tmp_path, taken, small_clip, monkeypatch, command, tally
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("of the user")
    (tmp_path / "clip").mkdir()
    (tmp_path / "clip" / "clip.json").write_bytes((small_clip / "clip.json").read_bytes())
    os.mkfifo("pipe")
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "to_taken").symlink_to(taken)
    before = tree(tmp_path)
    for output in NO_OUTPUTS:
        for force in ((), ("--force",)):
            verdict = leakloc(*command, "--method", "naive", *force, "-o", output, inside=tmp_path)
            try:
                assert_refused(verdict)
                assert tree(tmp_path) == before
            except BaseException as error:
                error.add_note(f"{command} {force} -o {output!r:.100}")
                raise
            tally["refused with exit code 2"] += 1
    assert tally.total() == 2 * len(NO_OUTPUTS)


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is forbidden to the administrator")
@pytest.mark.parametrize("command", INPUTS.values())
def test_a_folder_that_may_not_be_written_to_is_refused(tmp_path, command):
    (tmp_path / "locked").mkdir(mode=0o555)
    assert_refused(leakloc(*command, "--method", "naive", "-o", tmp_path / "locked" / "made"), "may be written to")
    assert list((tmp_path / "locked").iterdir()) == []


@pytest.mark.parametrize(
    ("command", "kind", "content"),
    [("hunt", "hunt", AXIS), ("envelope", "envelope", AXIS), ("shrink", "shrunk", 'name = "small"')],
)
def test_what_was_given_is_never_replaced_by_what_is_made_from_it(tmp_path, command, kind, content):
    folder = tmp_path / "earlier"
    folder.mkdir()
    (folder / f"{kind}.json").write_text('{"made_by": "leakloc 1"}')
    (folder / "given.toml").write_text(content)
    before = tree(tmp_path)
    words = (command, folder / "given.toml", "--method", "naive", "--force", "-o", folder)
    assert_refused(leakloc(*words), f"{folder}: must be apart from ")
    assert tree(tmp_path) == before
