"""Kept counterexamples: open failures fail with their code, fixed ones do not come back."""

from pathlib import Path

import pytest

from scenarios.margins import Margins
from scenarios.regressions import read_regression, regression_names, replayed, verdict
from scenarios.scenario import RegressionTable, Scenario
from scenarios.scenario_file import ScenarioError
from scenarios.scene_work import LeakOutcome, MethodOutcome


@pytest.mark.parametrize("name", regression_names())
def test_a_kept_counterexample_comes_out_as_expected(name):
    assert replayed(read_regression(name)) is None


def test_at_least_ten_are_kept_and_four_of_them_are_of_the_robust_method():
    methods = [read_regression(name).regression.method for name in regression_names()]
    assert len(methods) >= 10
    assert methods.count("robust") >= 4


@pytest.mark.parametrize("name", regression_names())
def test_a_kept_counterexample_is_understood_at_a_glance(name):
    text = (Path(__file__).parents[2] / "scenarios" / "regressions" / f"{name}.toml").read_text()
    assert text.startswith("# ")
    assert len(text.splitlines()) <= 26  # a scene of 20 lines, and what is expected of it
    assert read_regression(name).regression.note


def expecting(status):
    return Scenario(regression=RegressionTable(method="robust", code="missed.unexplained", status=status))


def run_with(code, false=()):
    leak = LeakOutcome(0, 1.0, 0.0, True, True, False, code, None, None)
    return MethodOutcome("robust", "ok", "", (leak,), false, margins=Margins(1.0, 1.0, 1.0))


@pytest.mark.parametrize(
    ("status", "run", "words"),
    [
        ("open", run_with("missed.unexplained"), None),
        ("accepted-limit", run_with("missed.unexplained"), None),
        ("open", run_with("found"), "is cured"),
        ("accepted-limit", run_with("found"), "is cured"),
        ("open", run_with("bad.depth"), "has changed: bad.depth in place of missed.unexplained"),
        ("fixed", run_with("found"), None),
        ("fixed", run_with("found", ("false.gamma",)), "fails again: false.gamma"),
    ],
)
def test_a_cure_a_change_and_a_relapse_are_told(status, run, words):
    told = verdict(expecting(status), run)
    assert told is None if words is None else words in told


def test_a_file_without_what_is_expected_is_no_kept_counterexample(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text("seed = 1\n")
    with pytest.raises(ScenarioError, match="regression is required"):
        read_regression(str(path))
    path.write_text('[regression]\nmethod = "robust"\ncode = "crash"\nstatus = "opne"\n')
    with pytest.raises(ScenarioError, match=r"regression\.status must be 'open'"):
        read_regression(str(path))
