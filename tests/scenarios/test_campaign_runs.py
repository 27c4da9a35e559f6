"""Running campaigns: the same table whatever the workers, stops and kills; a scene that cannot be done is set aside."""

import itertools
import random
import signal
import sqlite3
import time
from collections import Counter

import pytest
from small_campaigns import csv_of, run, small_campaign, start

from scenarios.arms import arms_of
from scenarios.campaign_file import CampaignError, read_campaign
from scenarios.estimators import EstimatorError, EstimatorSpec
from scenarios.lanes import Shares, grouped
from scenarios.run_campaign import static_part
from scenarios.scene_work import SceneWork
from scenarios.store import StoreError, read_store

N_SCENES = 12


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A campaign that ran without a stop on one worker: its file and its table."""
    folder = tmp_path_factory.mktemp("campaign")
    path = small_campaign(folder)
    run(path, folder / "whole.db")
    return path, csv_of(folder / "whole.db")


def test_two_workers_give_the_same_table_as_one(whole, tmp_path):
    path, csv = whole
    done = run(path, tmp_path / "two.db", n_workers=2)
    assert sorted(done) == list(range(N_SCENES))
    assert csv_of(tmp_path / "two.db") == csv
    assert csv.count("\n") == 1 + 2 * N_SCENES  # both methods of every scene, and the header


def test_a_stopped_run_goes_on_with_what_is_left(whole, tmp_path):
    path, csv = whole
    store = tmp_path / "stopped.db"
    first = run(path, store, stop_after=5)
    assert len(read_store(store).runs) == 10
    second = run(path, store)
    assert sorted(first + second) == list(range(N_SCENES))
    assert run(path, store) == []
    assert csv_of(store) == csv


def killed_and_resumed(path, store, n_kills, rng):
    """Kill the program at random moments, those of starting up included, then let it end; returns scenes per kill."""
    counts = []
    for _ in range(n_kills):
        program = start(path, store, n_workers=rng.choice([1, 2]))
        deadline_s, n_before = time.monotonic() + 60.0, n_there(store)
        while (
            n_there(store) <= n_before
            and program.poll() is None
            and time.monotonic() < deadline_s
            and rng.random() < 0.98
        ):
            time.sleep(0.05)
        time.sleep(rng.uniform(0.0, 0.2))
        program.send_signal(signal.SIGKILL)
        program.communicate()
        counts.append(n_there(store))
    program = start(path, store)
    said, _ = program.communicate(timeout=300)
    assert program.returncode == 0, said
    return counts


def n_there(store):
    """Scenes in a store, or 0 when there is none that can be read at this moment."""
    try:
        return len({run.scene for run in read_store(store).runs})
    except StoreError:
        return 0


def test_kills_at_random_moments_lose_nothing_and_double_nothing(whole, tmp_path):
    path, csv = whole
    counts = killed_and_resumed(path, tmp_path / "killed.db", 2, random.Random(1))
    assert counts == sorted(counts)
    assert csv_of(tmp_path / "killed.db") == csv
    assert [p.name for p in tmp_path.iterdir()] == ["killed.db"]


@pytest.mark.deep
def test_fifty_kills_of_a_campaign_of_two_hundred_scenes_lose_nothing_and_double_nothing(tmp_path):
    path = small_campaign(tmp_path, repeats=34)
    run(path, tmp_path / "whole.db", n_workers=2)
    counts = killed_and_resumed(path, tmp_path / "killed.db", 50, random.Random())
    assert counts == sorted(counts)
    assert csv_of(tmp_path / "killed.db") == csv_of(tmp_path / "whole.db")


def outcomes_by_frames(store):
    return Counter((run.values["recording.n_frames"], run.outcome) for run in read_store(store).runs)


def test_a_scene_that_kills_its_worker_twice_is_set_aside_and_the_others_are_done(tmp_path):
    path, store = small_campaign(tmp_path, repeats=1, doses="[0.0]"), tmp_path / "results.db"
    killer = EstimatorSpec("callable", "foreign_estimators:kills_its_caller_on_clips_of_five_frames")
    assert len(run(path, store, foreign=[killer])) == 3
    assert outcomes_by_frames(store) == {(4, "ok"): 3, (5, "crash"): 3, (6, "ok"): 3}
    assert {run.detail for run in read_store(store).runs if run.outcome == "crash"} == {"its worker process died twice"}
    assert run(path, store, foreign=[killer]) == []  # set aside: not tried again


def test_a_scene_whose_worker_dies_once_is_done_by_the_next(tmp_path, monkeypatch):
    monkeypatch.setenv("KILLED_ONCE", str(tmp_path / "killed"))
    path, store = small_campaign(tmp_path, repeats=1, frames="[4]", doses="[0.0]"), tmp_path / "results.db"
    run(path, store, foreign=[EstimatorSpec("callable", "foreign_estimators:kills_its_caller_once")])
    assert (tmp_path / "killed").exists()
    assert outcomes_by_frames(store) == {(4, "ok"): 3}


def test_a_scene_that_hangs_is_a_time_out_and_the_others_are_done(tmp_path):
    path, store = small_campaign(tmp_path, repeats=1, frames="[5, 4]", doses="[0.0]"), tmp_path / "results.db"
    path.write_text(path.read_text().replace("scene_limit_s = 30.0", "scene_limit_s = 5.0"))
    run(path, store, foreign=[EstimatorSpec("callable", "foreign_estimators:hangs_on_clips_of_five_frames")])
    assert outcomes_by_frames(store) == {(4, "ok"): 3, (5, "timeout"): 3}


def test_what_a_foreign_estimator_does_is_an_outcome_of_its_own_runs_alone(tmp_path):
    path, store = small_campaign(tmp_path, repeats=1, frames="[4]"), tmp_path / "results.db"
    run(path, store, foreign=[EstimatorSpec("callable", "foreign_estimators:raises")])
    runs = read_store(store).runs
    assert Counter((run.method, run.outcome) for run in runs) == {
        ("paper", "ok"): 2,
        ("naive", "ok"): 2,
        ("foreign_estimators:raises", "crash"): 2,
    }
    for run_ in runs:
        assert (run_.of["all"], len(run_.leaks)) == (3, 3)  # a clip that was rendered has its truth


def test_an_estimator_that_cannot_be_started_stops_the_campaign_and_nothing_is_recorded(tmp_path):
    path, store = small_campaign(tmp_path), tmp_path / "results.db"
    with pytest.raises(EstimatorError, match="no_such_module"):
        run(path, store, foreign=[EstimatorSpec("callable", "no_such_module:f")])
    assert read_store(store).runs == ()


def test_a_campaign_without_any_method_is_refused(tmp_path):
    path = small_campaign(tmp_path)
    path.write_text(path.read_text().replace('["paper", "naive"]', "[]"))
    with pytest.raises(CampaignError, match="methods"):
        run(path, tmp_path / "results.db")


def works(path):
    file = read_campaign(path)
    return [SceneWork(scene.number, scene.scenario, (), 1.0) for scene in file.scenes()]


def test_scenes_of_one_static_layer_run_in_a_row_on_one_lane(tmp_path):
    path = small_campaign(tmp_path, repeats=4)
    path.write_text(f'{path.read_text()}[[axis]]\nkey = "rig.baseline_m"\nvalues = [0.3, 0.4, 0.5, 0.6]\n')
    groups = grouped(works(path), static_part)
    assert [len(group) for group in groups] == [24, 24, 24, 24]
    shares = Shares(groups, 2)
    taken = {0: [], 1: []}
    for turn in range(96):
        work = shares.next_of(turn % 2)
        taken[turn % 2].append((work.scenario.rig.baseline_m, work.number))
    for lane in taken.values():
        changes = sum(one[0] != other[0] for one, other in itertools.pairwise(lane))
        assert (len(lane), changes) == (48, 1)
    assert sorted(number for lane in taken.values() for _, number in lane) == list(range(96))
    assert shares.next_of(0) is None


def test_no_lane_is_idle_while_another_has_work_to_give(tmp_path):
    shares = Shares([works(small_campaign(tmp_path))], 3)
    taken = [shares.next_of(turn % 3).number for turn in range(N_SCENES)]
    assert sorted(taken) == list(range(N_SCENES))
    assert len(arms_of(read_campaign(tmp_path / "small.toml").campaign)) == 6


def test_times_stand_in_a_table_of_their_own(whole, tmp_path):
    path, _ = whole
    run(path, tmp_path / "one.db", stop_after=1)
    with sqlite3.connect(tmp_path / "one.db") as connection:
        times = connection.execute("SELECT run, render_s, method_s FROM timing").fetchall()
        names = {name for (name,) in connection.execute("SELECT name FROM pragma_table_info('run')")}
    connection.close()
    assert len(times) == 2
    assert all(0.0 < cell < 60.0 for _, *cells in times for cell in cells)
    assert not {name for name in names if name.endswith("_s")}
