"""Tables and bars of the paper's evaluation on made-up runs: arithmetic, and the published numbers beside them."""

import csv
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from scenarios.evaluation import AS_IT_IS, EXPERIMENTS, QUICK, Evaluation, campaign_files
from scenarios.evaluation_bars import bars_of
from scenarios.evaluation_report import Findings, report_html
from scenarios.evaluation_tables import RULES, as_data, experiment_rows, flattened, tables_csv, tally
from scenarios.evaluation_why import cures, differences, means_of_sets_m
from scenarios.evaluation_worst import in_words, worst_scenes
from scenarios.published import LEVELS_GY_H, PUBLISHED, published
from scenarios.scene_work import LeakOutcome
from scenarios.statistics import clopper_pearson, mean_interval
from scenarios.stored_run import Run

SEPARATED, _, CROWDED, *_ = EXPERIMENTS


def leak(number, x_m, y_m, code, *, estimate=None, error_m=None, in_view=True, near_wall=False):
    return LeakOutcome(number, x_m, y_m, in_view, in_view, near_wall, code, error_m, None, estimate)


def clip(number, leaks, estimates_m, *, method="paper", false=(), dose=10.0):
    return Run(
        *(number, number, 0, number, {"gamma.dose_rate_gy_h": dose}, "separated", (), 7, "leakloc 0", method, "ok", ""),
        *(tuple(leaks), tuple(false), tuple(estimates_m)),
    )


FOUND = leak(0, 1.0, 0.0, "found", estimate=0, error_m=0.1)
PULLED = leak(1, 2.2, 0.0, "bad.depth", estimate=1, near_wall=True)  # 0.5 m off: beyond the gate, found for the paper
OUTSIDE = leak(2, 0.0, 2.2, "missed.out_of_view", in_view=False, near_wall=True)
ONE = clip(0, [FOUND, PULLED, OUTSIDE], [(1.1, 0.0), (2.2, 0.5), (0.0, 0.0)], false=("false.shadow", "false.gamma"))
OTHER = clip(1, [FOUND], [(1.1, 0.0)])


def test_the_published_tables_are_the_papers():
    # Tables 2 and 3, 4 and 5: found, of, mean and standard deviation (m)
    said = {(row.experiment, row.setting): (row.found, row.of, row.mean_error_m, row.sd_error_m) for row in PUBLISHED}
    assert said == {
        ("separated", "L"): (26, 30, 0.22, 0.25),
        ("separated", "M"): (26, 30, 0.22, 0.24),
        ("separated", "H"): (26, 30, 0.22, 0.23),
        ("frames", "3 frames"): (27, 30, 0.37, 0.78),
        ("frames", "6 frames"): (27, 30, 0.36, 0.84),
        ("frames", "12 frames"): (27, 30, 0.34, 0.67),
        ("frames", "18 frames"): (26, 30, 0.22, 0.24),
        ("frames", "24 frames"): (26, 30, 0.22, 0.23),
        ("crowded", "L"): (22, 24, 0.05, 0.05),
        ("crowded", "M"): (22, 24, 0.05, 0.06),
        ("crowded", "H"): (22, 24, 0.06, 0.07),
    }
    assert published("multiple", "5 leaks") is None
    assert LEVELS_GY_H == {"L": 1.7, "M": 3.3, "H": 10.0}


def test_the_papers_rule_finds_what_is_far_off_and_the_gate_does_not():
    whole, gated = tally([ONE, OTHER], RULES["paper_rule"]), tally([ONE, OTHER], RULES["gated"])
    assert [(f.leaks, f.of_leaks, f.clips, f.of_clips) for f in whole.found.values()] == [
        *((3, 4, 1, 2), (3, 3, 2, 2), (3, 3, 2, 2))
    ]
    assert [(f.leaks, f.of_leaks, f.clips, f.of_clips) for f in gated.found.values()] == [
        *((2, 4, 1, 2), (2, 3, 1, 2), (2, 3, 1, 2))
    ]
    assert (whole.missed_in_view, whole.missed_out_of_view, whole.false_per_clip) == (0, 1, 0.5)
    assert (gated.missed_in_view, gated.missed_out_of_view, gated.false_per_clip) == (1, 1, 1.0)


def test_errors_are_split_at_the_wall():
    part = tally([ONE, OTHER], RULES["paper_rule"])
    assert (part.error.n, part.near_wall.n, part.elsewhere.n) == (3, 1, 2)
    assert part.error.mean_m == pytest.approx((0.1 + 0.5 + 0.1) / 3)
    assert part.error.median_m == pytest.approx(0.1)
    assert part.error.sd_m == pytest.approx(np.std([0.1, 0.5, 0.1]))
    assert (part.near_wall.mean_m, part.elsewhere.mean_m) == (pytest.approx(0.5), pytest.approx(0.1))
    assert part.near_wall_share == pytest.approx(0.5 / 0.7)
    assert math.isnan(part.error.low_m)  # two clips
    assert math.isnan(tally([clip(0, [OUTSIDE], [])], RULES["paper_rule"]).near_wall_share)


def test_clips_are_drawn_for_the_interval_of_a_mean_and_five_are_needed():
    rng = np.random.default_rng(1)
    shared = rng.normal(0.0, 1.0, 40)
    low, high = mean_interval([[x, x, x, x] for x in shared])  # four leaks that tell the same are one
    assert high - low == pytest.approx(2 * 1.96 * shared.std() / math.sqrt(40), rel=0.1)
    assert low < shared.mean() < high
    assert np.isnan(mean_interval([[1.0]] * 4 + [[]])).all()
    assert mean_interval([[1.0, 1.0]] * 5) == (1.0, 1.0)


def test_the_interval_of_a_mean_holds_it_in_about_95_percent_of_samples():
    rng = np.random.default_rng(0)
    held = sum(low <= 1.0 <= high for low, high in (mean_interval(rng.exponential(size=(30, 3))) for _ in range(150)))
    assert 0.88 < held / 150 < 0.99


def test_settings_are_rows_and_stand_beside_what_is_published():
    runs = [ONE, OTHER, clip(2, [FOUND], [(1.1, 0.0)], method="robust"), clip(3, [FOUND], [(1.1, 0.0)], dose=1.7)]
    rows = experiment_rows(SEPARATED, runs)
    assert [(row.setting, row.method, row.n_clips) for row in rows] == [
        *(("H", "paper", 2), ("H", "robust", 1), ("L", "paper", 1))
    ]
    assert rows[0].published == published("separated", "H")
    assert differences(rows)[0] == (
        "Tables 2, 3, H: found 3/4 against 26/30 (-11.7 points); mean error 0.233 m against 0.22 m "
        "(+0.013 m; too few clips for an interval)"
    )


def test_a_row_is_data_and_a_line_of_numbers_with_the_same_content():
    (row,) = experiment_rows(SEPARATED, [ONE, OTHER])
    data = as_data(row)
    assert data["paper_rule"]["found"]["in_view"]["rate"] == 1.0
    assert data["paper_rule"]["found"]["all"]["clips_low"] == clopper_pearson(1, 2)[0]
    assert data["paper_rule"]["error"]["low_m"] is None
    (line,) = csv.DictReader(tables_csv([data]).splitlines())
    assert line == {key: str(value) for key, value in flattened(data).items()}


def test_the_bars_of_the_papers_method_go_by_its_own_rule():
    bars = bars_of(None, experiment_rows(SEPARATED, [ONE, OTHER]))
    assert [(bar.got, bar.is_met) for bar in bars] == [
        ("3/4 = 0.75", True),  # 26/30: 0.69 to 0.96
        ("1 out of view, 0 in view", True),
        ("0.233 m", True),
        ("71% of it", True),
    ]
    missed = leak(1, 2.2, 0.0, "missed.unexplained")
    bars = bars_of(None, experiment_rows(SEPARATED, [clip(0, [FOUND, missed], [(1.1, 0.0)])]))
    assert [bar.is_met for bar in bars] == [False, False, True, False]


@pytest.mark.parametrize(("code", "told"), [("missed.unexplained", 0), ("missed.merged", 1)])
def test_of_the_missed_leaks_in_view_the_bar_says_how_many_nobody_could_tell_apart(code, told):
    missed = replace(leak(1, 2.2, 0.0, code), observable=code != "missed.merged")
    bars = bars_of(None, experiment_rows(SEPARATED, [clip(0, [FOUND, missed], [(1.1, 0.0)])]))
    assert bars[1].got == f"0 out of view, 1 in view ({told} not observable)"


def test_where_no_leak_is_found_the_report_says_so_and_prints_no_undefined_number():
    (row,) = experiment_rows(SEPARATED, [clip(0, [OUTSIDE], [])])
    (robust,) = experiment_rows(SEPARATED, [clip(0, [OUTSIDE], [], method="robust")])
    assert [bar.got for bar in bars_of(None, [row])] == [
        *("0/1 = 0.00", "1 out of view, 0 in view", "no leak found", "no leak found")
    ]
    assert [bar.got for bar in bars_of(None, [robust])] == ["0/0", "no leak found"]
    assert differences([row])[0] == (
        "Tables 2, 3, H: found 0/1 against 26/30 (-86.7 points); no leak found, so no mean error to put beside 0.22 m"
    )


@pytest.mark.parametrize(("n_clips", "told"), [(2, ""), (4, ""), (5, "<br>[0.100, 0.100]")])
def test_the_page_tells_the_interval_of_a_mean_where_there_are_five_clips_and_none_where_there_are_fewer(n_clips, told):
    runs = [clip(i, [FOUND], [(1.1, 0.0)]) for i in range(n_clips)]
    stored = SimpleNamespace(runs=runs, identity=SimpleNamespace(versions="leakloc 0"))
    caused = SimpleNamespace(runs=[without(AS_IT_IS, 0, [FOUND], [(1.1, 0.0)])])
    evaluation = Evaluation(QUICK, campaign_files(QUICK), {"separated": stored, "causes": caused})
    rows = experiment_rows(SEPARATED, runs)
    page = report_html(evaluation, Findings(rows, bars_of(None, rows), {}))
    assert page.count(f"<td>0.100 ± 0.000{told}</td>") == 2  # by the paper's rule and by the gate
    low, high = clopper_pearson(n_clips, n_clips)
    assert page.count(f"{n_clips}/{n_clips} [{low:.2f}, {high:.2f}]") == 2 * 3  # of a rate there always is one


def test_a_clip_without_leaks_that_count_is_no_trial():
    found = tally([ONE, clip(1, [OUTSIDE], [])], RULES["paper_rule"]).found
    assert [(which, one.clips, one.of_clips) for which, one in found.items()] == [
        *(("all", 0, 2), ("in_view", 1, 1), ("observable", 1, 1))
    ]


def test_the_worst_scene_is_pictured_at_the_strongest_noise_with_the_method_that_it_is_worst_for(monkeypatch):
    monkeypatch.setattr("scenarios.evaluation_worst.picture", lambda scenario, estimator: (scenario, estimator.text))
    files = campaign_files(QUICK)
    scenes = files["separated"].scenes()
    missed = leak(1, 2.2, 0.0, "missed.unexplained")
    runs = []
    for scene in scenes:
        for number, method in enumerate(("paper", "robust")):
            # Each method misses a leak in another repeat, and all leaks where noise is weaker.
            weak, bad = scene.scenario.gamma.dose_rate_gy_h < 10.0, scene.repeat == 1 + number
            leaks = [missed, missed] if weak else [FOUND, missed] if bad else [FOUND]
            run = clip(scene.number, leaks, [(1.1, 0.0)], method=method, dose=scene.scenario.gamma.dose_rate_gy_h)
            runs.append(replace(run, seed=scene.number, repeat=scene.repeat))
    worst = worst_scenes(Evaluation(QUICK, files, {"separated": SimpleNamespace(runs=runs)}))
    assert [one.method for one in worst] == ["paper", "robust"]
    for one, repeat in zip(worst, (1, 2), strict=True):
        (scene,) = (s for s in scenes if s.repeat == repeat and s.scenario.gamma.dose_rate_gy_h == 10.0)
        assert one.png == (scene.scenario, one.method)
        assert one.replay.endswith(f"--seed {scene.number} --method {one.method}")
        assert one.words.startswith("1 of 2 observable leaks missed")


def test_a_scene_that_is_right_is_not_told_as_a_failure():
    assert in_words(OTHER).startswith("right, ")
    assert in_words(ONE).startswith("1 of 2 observable leaks missed, 2 false; ")


class Runs:
    """An evaluation of nothing but these."""

    def __init__(self, runs):
        self._runs = runs

    def runs(self, *_):
        return self._runs


@pytest.mark.parametrize(("gap_m", "is_met"), [(0.05, True), (0.1, False)])
def test_crowded_leaks_may_be_missed_only_where_they_are_5_cm_apart(gap_m, is_met):
    leaks = [FOUND, leak(1, 1.0, gap_m, "missed.merged")]
    runs = [clip(0, leaks, [(1.1, 0.0)])] + [clip(i, [FOUND], [(1.1, 0.0)]) for i in range(1, 8)]
    found, gaps = bars_of(Runs(runs), experiment_rows(CROWDED, runs))
    assert (found.got, found.is_met) == ("8/9", True)  # 21/24 = 0.875
    assert (gaps.got, gaps.is_met) == (f"{gap_m:g} m", is_met)


def test_the_robust_method_is_held_to_the_gate_and_to_observable_leaks():
    perfect = leak(0, 1.0, 0.0, "found", estimate=0, error_m=0.005)
    bars = bars_of(None, experiment_rows(SEPARATED, [clip(0, [perfect, OUTSIDE], [(1.005, 0.0)], method="robust")]))
    assert [(bar.got, bar.is_met) for bar in bars] == [("1/1", True), ("0.0050 m", True)]
    bars = bars_of(None, experiment_rows(SEPARATED, [clip(0, [OUTSIDE], [], method="robust")]))
    assert [bar.is_met for bar in bars] == [False, False]  # nothing to find shows nothing


def without(cause, number, leaks, estimates_m):
    return replace(clip(number, leaks, estimates_m), values={"without": cause}, repeat=number)


def test_a_leak_is_cured_by_what_is_taken_away_when_it_is_well_placed_then():
    shadows = "drop shadows"
    runs = [
        without(AS_IT_IS, 0, [FOUND, PULLED, OUTSIDE], [(1.0, 0.05), (2.2, 0.5)]),
        without(AS_IT_IS, 1, [FOUND], [(1.0, 0.01)]),
        without(shadows, 0, [FOUND, PULLED, OUTSIDE], [(1.0, 0.05), (2.2, 0.02)]),
        without(shadows, 1, [FOUND], [(1.0, 0.5)]),
        without("gamma", 0, [FOUND, PULLED, OUTSIDE], [(1.0, 0.05), (2.2, 0.4)]),
        without("gamma", 1, [FOUND], [(1.0, 0.01)]),
    ]
    cured = cures(Evaluation(QUICK, campaign_files(QUICK), {"causes": SimpleNamespace(runs=runs)}))
    assert (cured.n_bad, cured.n_leaks) == (1, 3)  # what is out of view nobody could place
    assert cured.by_removal == {"without drop shadows": 1, "without gamma": 0}
    assert cured.wall_m == pytest.approx((0.3,))
    assert len(cured.replays) == 1


def test_means_of_ten_scenes_spread_as_much_as_one_wrong_match_makes_them():
    low_m, middle_m, high_m = means_of_sets_m([[0.02, 0.02]] * 19 + [[0.02, 8.02]])
    assert low_m == pytest.approx(0.02)  # 0.95^10 = 60 % of the sets are without it, 32 % have it once
    assert middle_m == pytest.approx(0.02)
    assert high_m == pytest.approx(0.02 + 2 * 8.0 / 20)
    assert means_of_sets_m([[0.1], [0.1, 0.1], []] * 10) == pytest.approx((0.1, 0.1, 0.1))


def test_a_clip_on_which_a_method_broke_down_counts_as_one_breakdown():
    crashed = replace(clip(0, [leak(i, 1.0, 0.0, "crash") for i in range(3)], []), outcome="crash", detail="no idea")
    (row,) = experiment_rows(SEPARATED, [crashed, OTHER])
    assert row.codes == {"crash": 1, "found": 1}
