"""Plug-ins by name and by command line: what cannot be started is refused before the work, what misbehaves is told."""

import sys

import pytest
from verdicts import assert_refused, leakloc, tree

from scenarios.estimators import Broken, EstimatorError, EstimatorSpec, Host, run_command
from scenarios.scenario_file import read_scenario
from scenarios.simulate import simulate

SMALL = ["rig.width_px=96", "rig.height_px=64", "recording.n_frames=3"]

NO_FUNCTIONS = [
    *(
        ":",
        "a",
        "a:",
        ":a",
        "a:b:c",
        ".a:b",
        "..a:b",
        "a..b:c",
        "a.:b",
        "a b:c",
        "a:b c",
        "1a:b",
        "a:1b",
        "a-b:c",
        "a/b:c",
    ),
    *(
        "../a:b",
        "/etc/passwd:x",
        "a.py:b",
        "os:system('x')",
        "__import__('os'):system",
        "a:b()",
        "a\n:b",
        "a:b\n",
        "\x00:a",
    ),
    *(
        "nowhere:locate",
        "nowhere.at.all:locate",
        "nowhere:locate.more",
        "é漢:ö",
        "a" * 9000 + ":b",
        "a:" + "b" * 20_000,
    ),
    *("C:\\x.py", "http://127.0.0.1:1/x", "\udcff:x", "*:*", "~:x", "$HOME:x", "nowhere:__class__", "lambda:0", "-m:x"),
]
NO_COMMANDS = [
    *("x", "{clip}", "{result}", "{clip} {result}", "nowhere {clip} {result}", "/nowhere/x {clip} {result}"),
    *("/etc/passwd {clip} {result}", "/ {clip} {result}", "/dev/null {clip} {result}", "'unclosed {clip} {result}"),
    *('"" {clip} {result}', '"{clip} {result}', "{clip}x {result}", "\\", "| {clip} {result}", "; {clip} {result}"),
    *("$(x) {clip} {result}", "`x` {clip} {result}", "x" * 300 + " {clip} {result}", "y" * 20_000 + "{clip}{result}"),
]


@pytest.fixture
def estimators_refused(tmp_path, tally):
    def refused(option, texts):
        before = tree(tmp_path)
        for text in texts:
            for words in (("explain", "plain", "-o", tmp_path / "x.html"), ("bench", "--scenes", "1")):
                assert_refused(leakloc(*words, f"{option}={text}"))
                tally["refused with exit code 2"] += 1
            verdict = leakloc("campaign", "run", "noise", "-o", tmp_path / "x.db", f"{option}={text}")
            assert_refused(verdict)
            tally["refused with exit code 2"] += 1
        assert tree(tmp_path) == before

    return refused


def test_what_names_no_function_is_refused_before_a_scene_is_rendered(estimators_refused, tally):
    estimators_refused("--estimator", NO_FUNCTIONS)
    assert tally["refused with exit code 2"] == 3 * len(NO_FUNCTIONS) > 0


def test_what_names_no_program_is_refused_before_a_scene_is_rendered(estimators_refused, tally):
    estimators_refused("--command", NO_COMMANDS)
    assert tally["refused with exit code 2"] == 3 * len(NO_COMMANDS) > 0


@pytest.fixture(scope="module")
def clip():
    return simulate(read_scenario("plain", SMALL))


# a shell's view of an estimator: what it does, and how that is told
MISBEHAVING = {
    "exit 3": "crash",
    "kill -9 $$": "crash",
    r"printf '\377\376' >&2; exit 1": "crash",
    "true": "malformed",
    "mkfifo {result}": "malformed",
    "mkdir {result}": "malformed",
    "ln -s /etc/passwd {result}": "malformed",
    "ln -s /dev/zero {result}": "malformed",
    "ln -s {result} {result}": "malformed",
    "truncate -s 10G {result}": "malformed",
    "head -c 10000000 /dev/zero > {result}": "malformed",
    "printf '[[[[' > {result}": "malformed",
    "rm -r {clip}": "malformed",
    "while true; do echo x; done": "timeout",
    "sleep 3 & sleep 3": "timeout",
}


@pytest.mark.parametrize("script", MISBEHAVING)
def test_a_command_that_misbehaves_is_an_outcome_and_leaves_nothing(clip, tmp_path, monkeypatch, script):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    spec = EstimatorSpec("command", f"sh -c '{script.replace(chr(39), chr(34))}' {{clip}} {{result}}", timeout_s=1.0)
    answer = run_command(spec, clip)
    assert isinstance(answer, Broken)
    assert answer.code == MISBEHAVING[script], answer
    assert len(answer.detail) < 500
    assert list(tmp_path.iterdir()) == []


# what the modules do when they are imported or asked; each costs the start of a process
MODULES = {
    "1 / 0": EstimatorError,
    "raise SystemExit(0)": EstimatorError,
    "this is no Python": EstimatorError,
    "locate = 3": EstimatorError,
    "import os; os._exit(3)": "crash",
    "import time; time.sleep(60)": "timeout",
    "def locate(*_): raise SystemExit(0)": "crash",
    "def locate(*_): return lambda: 0": "malformed",
    "def locate(*_): return [('a', 'b')]": "malformed",
    "def locate(*_): return [(float('nan'), 0.0)]": "nan",
    "import itertools\ndef locate(*_): return itertools.repeat((0.0, 0.0))": "malformed",
}


def said_of(module, clip, folder, monkeypatch):
    (folder / "hostile_module.py").write_text(module)
    monkeypatch.syspath_prepend(str(folder))
    sys.modules.pop("hostile_module", None)
    host = Host(EstimatorSpec("callable", "hostile_module:locate", timeout_s=8.0))
    try:
        answer = host.run(clip)
    except EstimatorError as error:
        return type(error) if "hostile_module:locate" in str(error) else error
    finally:
        host.stop()
    return answer.code


def test_a_module_that_cannot_be_imported_is_refused_by_name(clip, tmp_path, monkeypatch):
    assert said_of("raise SystemExit(0)", clip, tmp_path, monkeypatch) is EstimatorError


@pytest.mark.deep
@pytest.mark.parametrize("module", MODULES)
def test_a_module_that_misbehaves_is_refused_or_an_outcome(clip, tmp_path, monkeypatch, module):
    assert said_of(module, clip, tmp_path, monkeypatch) == MODULES[module]
