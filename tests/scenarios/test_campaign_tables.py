"""What is said of a campaign: rates with clips as trials, never one without the others; tables, report and replays."""

import csv
import math
import re
import shlex
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from small_campaigns import inline, run, small_campaign

from scenarios.campaign import Campaign
from scenarios.campaign_csv import campaign_csv
from scenarios.campaign_figures import main_axis
from scenarios.campaign_report import report_html
from scenarios.campaign_summary import cells, table, worst, wrong_codes
from scenarios.cli import main
from scenarios.estimators import EstimatorSpec
from scenarios.progress import progress
from scenarios.scene_work import LeakOutcome
from scenarios.statistics import clopper_pearson, median_interval
from scenarios.store import Stored, read_store
from scenarios.store_identity import Identity
from scenarios.stored_run import Run, replay_command

FOUND = LeakOutcome(0, 1.0, 0.0, True, True, False, "found", 0.1, 0.5)
MISSED = LeakOutcome(1, 1.0, 0.5, True, True, False, "missed.unexplained", None, None)
HIDDEN = LeakOutcome(2, 0.0, 2.2, False, False, True, "missed.out_of_view", None, None)


def made_up(number, leaks, *, outcome="ok", false=(), values=None):
    values = values or {}
    return Run(
        number, number, 0, number, values, "plain", (), 7, "leakloc 0", "paper", outcome, "why", tuple(leaks), false
    )


def stored(runs):
    return Stored(
        Identity(Campaign(name="made up"), "0", (EstimatorSpec("method", "paper"),), "leakloc 0"), tuple(runs)
    )


def test_clips_are_the_trials_and_those_without_a_leak_that_counts_are_none():
    runs = [made_up(0, [FOUND]), made_up(1, [FOUND, MISSED]), made_up(2, [HIDDEN]), made_up(3, [FOUND, HIDDEN])]
    (cell,) = cells(runs)
    said = {which: (f.leaks, f.of_leaks, f.clips, f.of_clips) for which, f in cell.found.items()}
    assert said == {"all": (3, 6, 1, 4), "in_view": (3, 4, 2, 3), "observable": (3, 4, 2, 3)}
    assert cell.found["observable"].interval == clopper_pearson(2, 3)
    assert (cell.n_clips, cell.mean_error_m, cell.mean_error_px) == (4, pytest.approx(0.1), pytest.approx(0.5))


def test_a_method_that_broke_down_found_nothing_and_a_scene_that_died_has_no_leaks():
    lost = replace(FOUND, code="crash", error_m=None, error_px=None)
    (cell,) = cells([made_up(0, [FOUND]), made_up(1, [lost], outcome="crash"), made_up(2, [], outcome="timeout")])
    assert (cell.found["all"].leaks, cell.found["all"].of_leaks, cell.found["all"].of_clips) == (1, 2, 2)
    assert wrong_codes(cell) == "1 crash, 1 timeout"


def test_the_table_gives_no_rate_without_the_others():
    head, row = table([made_up(0, [FOUND, MISSED, HIDDEN], false=("false.ghost",))]).splitlines()
    assert re.split(" {2,}", head)[2:8] == [
        *("all: leaks", "clips [95 %]", "in view: leaks", "clips [95 %]", "observable: leaks", "clips [95 %]")
    ]
    assert re.split(" {2,}", row)[:4] == ["paper", "1", "1/3", "0/1 [0.00, 0.97]"]
    assert row.endswith("1.00         0.100  0.50")


def test_what_is_not_right_is_worst_first():
    crash, missed = made_up(0, [], outcome="crash"), made_up(1, [MISSED])
    far, near = made_up(2, [replace(FOUND, error_px=2.0)]), made_up(3, [FOUND])
    assert worst([near, far, missed, crash], 3) == [crash, missed, far]
    assert worst([made_up(4, [HIDDEN])], 3) == []


def test_the_main_axis_is_the_one_with_most_places():
    runs = [made_up(i, [FOUND], values={"a": i % 2, "b": i % 3}) for i in range(6)]
    runs = [replace(run_, arm=run_.run) for run_ in runs]
    assert main_axis(cells(runs)) == "b"
    assert main_axis(cells([made_up(0, [FOUND])])) is None


def test_the_interval_of_a_median_holds_it_in_95_percent_of_samples():
    rng = np.random.default_rng(0)
    for n in (6, 15, 40):
        held = 0
        for _ in range(2000):
            _, low, high = median_interval(rng.exponential(size=n))
            held += low <= math.log(2.0) <= high
        assert held / 2000 > 0.94
        assert held / 2000 < 0.99


def test_a_median_of_few_values_has_no_interval_and_of_none_is_undefined():
    assert median_interval([1.0, 2.0, 3.0, 4.0, 6.0])[0] == 3.0
    assert np.isnan(median_interval([1.0, 2.0, 3.0, 4.0, 6.0])[1:]).all()
    assert median_interval([5.0, 3.0, 1.0, 2.0, 4.0, 6.0]) == (3.5, 1.0, 6.0)
    assert np.isnan(median_interval([])).all()


@pytest.fixture
def small(whole_campaign):
    return whole_campaign[1]


def test_the_export_is_a_table_with_a_row_per_run(small, tmp_path):
    result = CliRunner().invoke(main, ["campaign", "export", "--csv", str(small), "-o", str(tmp_path / "r.csv")])
    assert result.exit_code == 0, result.output
    rows = list(csv.DictReader((tmp_path / "r.csv").read_text().splitlines()))
    assert [int(row["run"]) for row in rows] == list(range(24))
    for row, run_ in zip(rows, read_store(small).runs, strict=True):
        assert (row["recording.n_frames"], row["method"]) == (str(run_.values["recording.n_frames"]), run_.method)
        errors = [float(word) for word in row["leak_errors_m"].split(";") if word]
        assert errors == run_.errors_m
        assert (int(row["found_all"]), int(row["of_all"])) == (len(errors), 3)
        assert row["leak_codes"].count("found") == len(errors)


def test_an_export_does_not_overwrite_its_store(small):
    before = small.read_bytes()
    for command in (["export", "--csv"], ["report"]):
        result = CliRunner().invoke(main, ["campaign", *command, str(small), "-o", str(small)])
        assert (result.exit_code, "apart from" in result.output) == (2, True)
    assert small.read_bytes() == before


def test_show_prints_an_arm_and_method_a_row(small):
    result = CliRunner().invoke(main, ["campaign", "show", str(small)])
    assert result.exit_code == 0
    assert "small, 12 of 12 scenes" in result.output
    assert (
        len([line for line in result.output.splitlines() if re.match(r"[456] +(0.0|5.0) +(paper|naive)", line)]) == 12
    )
    assert "clips are the trials" in result.output


def test_the_report_is_one_offline_page_and_the_same_bytes_again(small, tmp_path):
    result = CliRunner().invoke(main, ["campaign", "report", str(small), "-o", str(tmp_path / "r.html")])
    assert result.exit_code == 0, result.output
    page = (tmp_path / "r.html").read_text()
    assert not re.search(r"(src|href)=.?(https?:|//)", page.replace('xlink:href="#', ""))
    assert page == report_html(read_store(small))
    for words in ("<svg", "Frames and dose, for tests.", "dose_rate_gy_h", "n_frames", "clips are the trials"):
        assert words in page


def test_the_figure_alone_is_the_reports(small, tmp_path):
    result = CliRunner().invoke(main, ["campaign", "figure", str(small), "-o", str(tmp_path / "f.svg")])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "f.svg").read_text() in report_html(read_store(small))


def test_there_is_no_figure_where_nothing_is_swept(tmp_path):
    path = small_campaign(tmp_path, repeats=1, frames="[4]", doses="[0.0]")
    run(path, tmp_path / "one.db", inline())
    result = CliRunner().invoke(main, ["campaign", "figure", str(tmp_path / "one.db"), "-o", str(tmp_path / "f.svg")])
    assert (result.exit_code, "nothing is swept" in result.output) == (2, True)
    assert not (tmp_path / "f.svg").exists()


def test_a_report_of_nothing_or_of_crashes_alone_is_a_page():
    assert "0 of 1 scenes" in report_html(stored([]))
    page = report_html(stored([made_up(0, [], outcome="crash")]))
    assert "crash: why" in page
    assert campaign_csv(stored([])).startswith("run,scene")


def test_a_space_is_a_campaign_of_one_arm(tmp_path):
    path, store = tmp_path / "space.toml", tmp_path / "space.db"
    path.write_text(
        'methods = ["paper"]\nset = ["rig.width_px=96", "rig.height_px=54", "pedestal.texture=uniform"]\n'
        '[space]\nstratum = "easy"\nscenes = 2\n'
    )
    assert run(path, store, inline()) == [0, 1]
    assert [(r.base, r.arm, r.repeat, r.values) for r in read_store(store).runs] == [
        ("easy:0:0", 0, 0, {}),
        ("easy:1:0", 0, 1, {}),
    ]
    assert len(table(read_store(store).runs).splitlines()) == 2
    page = report_html(read_store(store))
    assert ("<svg" in page, "2 of 2 scenes" in page) == (False, True)


def test_progress_without_a_terminal_is_lines_with_rate_and_time_left(capsys, monkeypatch):
    monkeypatch.setattr("scenarios.progress.SECONDS_BETWEEN_LINES", 0.0)
    assert list(progress(range(3), "scenes", 3)) == [0, 1, 2]
    lines = capsys.readouterr().err.splitlines()
    assert [re.sub(r"[\d.e+]+ / s", "R / s", re.sub(r"\d+ s left", "T s left", line)) for line in lines] == [
        "scenes: 1 of 3, R / s, T s left",
        "scenes: 2 of 3, R / s, T s left",
        "scenes: 3 of 3, R / s",
    ]


def test_a_replay_shows_the_run_again(small):
    run_ = worst(read_store(small).runs, 1)[0]
    program, *words = shlex.split(replay_command(run_, "--method"))
    result = CliRunner().invoke(main, words)
    assert (program, result.exit_code) == ("leakloc", 0)
    row = next(line for line in result.output.splitlines() if line.startswith("(as it is)"))
    assert row.split()[3:6] == [leak.code for leak in run_.leaks]
    assert row.endswith(", ".join(sorted(run_.false_codes)) or "-")
