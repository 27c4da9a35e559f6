"""Anybody's estimator on the bench: it sees frames and rig alone, and whatever it does is an outcome."""

import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from leakloc import Estimate, LeakEstimate
from leakloc.paper import triangulate_columns
from scenarios.bench import Trial, check_same_scenes, metres_per_px, run_trial, summary, table, worse_than
from scenarios.bench import Work as BenchWork
from scenarios.cli_bench import BaselineError, read_baseline
from scenarios.estimators import Broken, EstimatorError, EstimatorSpec, _checked, run_estimator
from scenarios.junit import junit_xml
from scenarios.margins import margins
from scenarios.scenario_file import read_scenario
from scenarios.score import score
from scenarios.simulate import simulate
from scenarios.space import STRATA

NAMES = st.sampled_from(["lines", "threshold_sigmas", "left", "right", "sigmas", "profile_grey", "left_column_px"])
TINY = ["rig.width_px=96", "rig.height_px=54", "recording.n_frames=4"]


@pytest.fixture(scope="module")
def clip():
    return simulate(read_scenario("separated", TINY))


@pytest.fixture(autouse=True)
def foreign_code(monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parent)


def test_a_pixel_of_disparity_is_worth_depth_squared_over_focal_length_and_baseline(clip):
    # f = 48 / tan(35 deg) = 68.55: 2.4^2 / (68.55 * 0.5) at the axis, four times as much at twice the depth
    near, far = (clip.truth.leaks[0].model_copy(update={"x_m": x_m, "y_m": 0.3}) for x_m in (0.0, 2.4))
    assert metres_per_px(clip.truth, near) == pytest.approx(0.16805, abs=1e-4)
    assert metres_per_px(clip.truth, far) == pytest.approx(4 * 0.16805, abs=4e-4)


def run_callable(name, clip, timeout_s=30.0):
    return run_estimator(EstimatorSpec("callable", f"foreign_estimators:{name}", timeout_s), clip)


def run_script(tmp_path, clip, code, timeout_s=30.0):
    script = tmp_path / "tool.py"
    script.write_text(code)
    return run_estimator(EstimatorSpec("command", f"{sys.executable} {script} {{clip}} {{result}}", timeout_s), clip)


def test_a_callable_gets_frames_and_rig_and_gives_places(clip):
    estimate = run_callable("one_leak_on_the_axis", clip)
    assert [(leak.x_m, leak.y_m) for leak in estimate.leaks] == [(0.0, 0.0)]
    # a leak on the axis: (W - 1) / 2 + f * 0.25 / 2.4 with f = 48 / tan(35 deg)
    assert estimate.leaks[0].left_column_px == pytest.approx(47.5 + 68.55 * 0.25 / 2.4, abs=0.01)


@pytest.mark.parametrize(
    ("name", "code", "words"),
    [
        ("raises", "crash", "RuntimeError: no idea"),
        ("dies", "crash", "process died"),
        ("says_nan", "nan", "not finite"),
        ("says_nonsense", "malformed", "must return"),
    ],
)
def test_what_a_bad_callable_does_is_an_outcome_and_the_next_clip_goes_on(clip, name, code, words):
    answer = run_callable(name, clip)
    assert isinstance(answer, Broken)
    assert answer.code == code
    assert words in answer.detail
    assert run_callable("nothing", clip).leaks == ()


def test_a_callable_has_as_many_threads_as_its_caller(clip):
    before = cv2.getNumThreads()
    try:
        cv2.setNumThreads(3)
        estimate = run_callable("one_leak_as_far_as_there_are_threads", clip)
    finally:
        cv2.setNumThreads(before)
    assert estimate.leaks[0].x_m == 3.0


def test_a_callable_that_hangs_is_stopped(clip):
    assert run_callable("hangs", clip, timeout_s=3.0).code == "timeout"


def test_a_callable_finds_no_truth_in_its_process(clip):
    assert run_callable("looks_for_the_truth", clip).leaks == ()


RESULT = {"method": "m", "frame": "world", "diagnostics": {}}
LEAK = {"covariance_m2": None, "score": 1.0, "left_column_px": 1.0, "right_column_px": 2.0, "column_sigma_px": None}


NAN_RESULT = json.dumps({**RESULT, "leaks": [{"x_m": float("nan"), "y_m": 0.0, **LEAK}]})


def test_a_command_gets_a_clip_folder_without_the_truth_and_writes_a_result(tmp_path, clip):
    code = f"""
import json, pathlib, sys
clip = pathlib.Path(sys.argv[1])
names = sorted(str(p.relative_to(clip)) for p in clip.rglob("*") if p.is_file())
expected = ["input.json"] + [f"left/{{n:04d}}.png" for n in range(4)] + ["rig.yaml"]
expected = sorted(expected + [f"right/{{n:04d}}.png" for n in range(4)])
assert names == expected, names
assert not list(clip.parent.glob("*truth*"))
leak = {{"x_m": 0.5, "y_m": -0.25, **{LEAK!r}}}
json.dump({{**{RESULT!r}, "leaks": [leak]}}, open(sys.argv[2], "w"))
"""
    estimate = run_script(tmp_path, clip, code)
    assert not isinstance(estimate, Broken), estimate
    assert [(leak.x_m, leak.y_m) for leak in estimate.leaks] == [(0.5, -0.25)]


@pytest.mark.parametrize(
    ("code", "outcome"),
    [
        ("raise SystemExit(3)", "crash"),
        ("import time; time.sleep(60)", "timeout"),
        ("import sys; open(sys.argv[2], 'w').write('{')", "malformed"),
        ("pass", "malformed"),
        (f"open(__import__('sys').argv[2], 'w').write({NAN_RESULT!r})", "malformed"),
    ],
)
def test_what_a_bad_command_does_is_an_outcome(tmp_path, clip, code, outcome):
    answer = run_script(tmp_path, clip, code, timeout_s=5.0)
    assert isinstance(answer, Broken)
    assert answer.code == outcome


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("method", "magic"),
        ("callable", "no_colon"),
        ("callable", "no.such:thing"),
        ("command", "tool {clip}"),
        ("command", "/no/such/tool {clip} {result}"),
    ],
)
def test_an_estimator_that_cannot_be_started_is_refused(clip, kind, text):
    with pytest.raises(EstimatorError, match=text.split()[0].split(":")[0]):
        run_estimator(EstimatorSpec(kind, text), clip)


@pytest.mark.parametrize(
    "text", ["tool\x1b {clip} {result}", "tool {clip} {result}\n# more", "t\udce4 {clip} {result}"]
)
def test_an_estimator_whose_name_is_no_line_of_text_is_refused(text):
    with pytest.raises(EstimatorError, match="printable characters on one line"):
        EstimatorSpec("command", text)


def trials(rights, stratum="easy"):
    of = {"all": 1, "in_view": 1, "observable": 1}
    return [
        Trial(
            stratum, i, right, {key: int(right) for key in of}, of, 0, ("found" if right else "missed.unexplained",), ()
        )
        for i, right in enumerate(rights)
    ]


def baseline_of(rows):
    return {"trials": [{"stratum": t.stratum, "number": t.number, "right": t.right} for t in rows]}


def test_a_run_is_worse_when_more_clips_were_lost_than_chance_allows():
    good = trials([True] * 20)
    assert worse_than(good, baseline_of(good)) == []
    assert worse_than(trials([False] * 2 + [True] * 18), baseline_of(good)) == []  # 2 of 2 lost: p = 0.25
    (line,) = worse_than(trials([False] * 6 + [True] * 14), baseline_of(good))  # 6 of 6: p = 0.016
    assert line.startswith("easy: 6 clips lost (0, 1, 2, 3, 4, 5), 0 won")
    assert worse_than(good, baseline_of(trials([False] * 20))) == []


def test_the_summary_gives_no_rate_without_the_others():
    rows = trials([True, False, True])
    easy = summary(rows)["easy"]
    assert set(easy["leaks"]) == {"all", "in_view", "observable"}
    assert easy["codes"] == {"found": 2, "missed.unexplained": 1}
    assert "missed.unexplained" in table(rows)


def test_junit_counts_failures_and_errors_apart():
    rows = [*trials([True, False]), replace(trials([False])[0], number=2, codes=("crash",), detail="bad \x00 byte")]
    (suite,) = ElementTree.fromstring(junit_xml(rows, "mine")).findall("testsuite")
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("3", "1", "1")


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"trials": [{}]}', '{"trials": 3}', "[" * 100_000])
def test_a_baseline_that_is_none_is_refused_by_name(tmp_path, content):
    (tmp_path / "old.json").write_text(content)
    with pytest.raises(BaselineError, match=r"old\.json"):
        read_baseline(tmp_path / "old.json")


def test_a_trial_of_the_bench_is_the_same_again():
    work = BenchWork(EstimatorSpec("method", "paper"), "easy", 1, 0)
    assert run_trial(work) == run_trial(work)
    assert json.dumps(run_trial(work).codes)


@pytest.mark.skipif(shutil.which("perl") is None, reason="the worked example needs Perl")
def test_the_worked_example_that_is_not_python_keeps_the_contract(clip):
    example = Path(__file__).parents[2] / "docs" / "estimators" / "brightest.pl"
    estimate = run_estimator(EstimatorSpec("command", f"perl {example} {{clip}} {{result}}"), clip)
    assert not isinstance(estimate, Broken), estimate
    places = {(round(leak.x_m, 3), round(leak.y_m, 3)) for leak in estimate.leaks}
    for leak in estimate.leaks:  # the same columns by our own triangulation
        (x_m, y_m), *_ = triangulate_columns(np.array([[leak.left_column_px, leak.right_column_px]]), clip.believed_rig)
        assert (round(float(x_m), 3), round(float(y_m), 3)) in places


def answered(leaks=(), *, method="m", frame="world", diagnostics=None):
    return _checked(Estimate(method, frame, leaks, {} if diagnostics is None else diagnostics))


def one_leak(**changes):
    numbers = {"x_m": 1.0, "y_m": 0.0, "score": 1.0, "left_column_px": 1.0, "right_column_px": 2.0}
    return LeakEstimate(**{**numbers, "covariance_m2": np.eye(2), "column_sigma_px": np.nan, **changes})


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (lambda: answered(frame="left camera"), "frame must be 'world'"),
        (lambda: answered(None), "leaks must be LeakEstimates"),
        (lambda: answered(((0.0, 0.0),)), "leaks must be LeakEstimates"),
        (lambda: answered((one_leak(x_m="far"),)), "leaks must be LeakEstimates"),
        (lambda: answered((one_leak(left_column_px=None),)), "leaks must be LeakEstimates"),
        (lambda: answered((one_leak(score=10**400),)), "leaks must be LeakEstimates"),
        (lambda: answered((one_leak(covariance_m2=np.eye(3)),)), "2 x 2"),
        (lambda: answered(diagnostics=[]), "diagnostics a mapping"),
        (lambda: answered(method=3), "method must be a text"),
    ],
)
def test_an_estimate_that_is_not_of_numbers_in_the_world_is_malformed(answer, words):
    told = answer()
    assert isinstance(told, Broken)
    assert told.code == "malformed"
    assert words in told.detail


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**400), 10**400) | st.floats() | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(NAMES, inner, max_size=3),
    max_leaves=6,
)


@settings(max_examples=200)
@given(method=st.sampled_from(["m", "paper", "robust"]), diagnostics=st.dictionaries(NAMES, ANYTHING, max_size=4))
def test_whatever_a_foreign_estimator_says_beside_its_leaks_is_no_error(clip, method, diagnostics):
    leak = clip.truth.leaks[0].model_copy(update={"observable": True, "left_column_px": 40.0, "right_column_px": 30.0})
    truth = clip.truth.model_copy(update={"leaks": (leak,)})
    answer = answered((one_leak(x_m=-1.0, y_m=1.0),), method=method, diagnostics=diagnostics)
    assert not isinstance(answer, Broken)
    told = margins(answer, truth, score([(-1.0, 1.0)], truth))
    assert -1.0 <= told.least < 0.0  # a leak is missed, and one is false


def test_strengths_tell_of_each_leak_by_what_it_is_from_being_missed(clip):
    seen = clip.truth.leaks[0].model_copy(update={"observable": True})
    missed = seen.model_copy(update={"id": seen.id + 1, "x_m": seen.x_m + 1.0, "left_column_px": None})
    truth = clip.truth.model_copy(update={"leaks": (missed, seen)})
    place = (seen.x_m, seen.y_m)
    answer = answered((one_leak(x_m=place[0], y_m=place[1]),))
    told = dict(margins(answer, truth, score([place], truth)).strengths)
    assert told[seen.id] > 0.0 > told[missed.id]


def test_a_baseline_of_another_size_or_seed_is_refused():
    rows = [row for space in STRATA for row in trials([True] * 5, space.name)]
    check_same_scenes({**baseline_of(rows), "seed": 7}, 5, 7)
    for n_scenes, seed in ((4, 7), (5, 8)):
        with pytest.raises(ValueError, match="a run of other scenes"):
            check_same_scenes({**baseline_of(rows), "seed": 7}, n_scenes, seed)
