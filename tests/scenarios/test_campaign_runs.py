"""Running campaigns: the same table whatever the workers, stops and kills; a scene that cannot be done is set aside."""

import itertools
import random
import signal
import time
from collections import Counter

import pytest
from small_campaigns import csv_of, inline, run, small_campaign, start

from scenarios.arms import arms_of
from scenarios.campaign_file import CampaignError, read_campaign
from scenarios.estimators import EstimatorError, EstimatorSpec
from scenarios.lanes import Shares, grouped
from scenarios.run_campaign import local_workers, static_part
from scenarios.scene_work import SceneWork, run_scene
from scenarios.store import StoreError, read_store
from scenarios.workers import WorkerError

pytestmark = pytest.mark.xdist_group("campaign runs")  # one worker: what they share is made once

N_SCENES = 12


def test_two_workers_give_the_same_table_as_one_and_there_is_nothing_left_to_do(whole_campaign, tmp_path):
    path, store = whole_campaign
    done = run(path, tmp_path / "two.db", local_workers(2))
    assert sorted(done) == list(range(N_SCENES))
    assert csv_of(tmp_path / "two.db") == csv_of(store)
    assert csv_of(store).count("\n") == 1 + 2 * N_SCENES  # both methods of every scene, and the header
    assert run(path, tmp_path / "two.db") == []


def test_a_stopped_run_goes_on_with_what_is_left_and_a_process_of_its_own_changes_nothing(whole_campaign, tmp_path):
    path, whole = whole_campaign
    store = tmp_path / "stopped.db"
    first = run(path, store, inline(), stop_after=5)
    assert len(read_store(store).runs) == 10
    second = run(path, store, inline(n_lanes=3))
    assert sorted(first + second) == list(range(N_SCENES))
    assert csv_of(store) == csv_of(whole)


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


def test_kills_at_random_moments_lose_nothing_and_double_nothing(whole_campaign, tmp_path):
    path, whole = whole_campaign
    counts = killed_and_resumed(path, tmp_path / "killed.db", 2, random.Random(1))
    assert counts == sorted(counts)
    assert csv_of(tmp_path / "killed.db") == csv_of(whole)
    assert [p.name for p in tmp_path.iterdir()] == ["killed.db"]


@pytest.mark.deep
def test_fifty_kills_of_a_campaign_of_two_hundred_scenes_lose_nothing_and_double_nothing(tmp_path):
    path = small_campaign(tmp_path, repeats=34)
    run(path, tmp_path / "whole.db", local_workers(2))
    counts = killed_and_resumed(path, tmp_path / "killed.db", 50, random.Random())
    assert counts == sorted(counts)
    assert csv_of(tmp_path / "killed.db") == csv_of(tmp_path / "whole.db")


def outcomes_by_frames(store):
    return Counter((run.values["recording.n_frames"], run.outcome) for run in read_store(store).runs)


def test_scenes_that_kill_or_hang_their_workers_are_set_aside_and_the_others_are_done(tmp_path):
    path, store = small_campaign(tmp_path, repeats=1, doses="[0.0]"), tmp_path / "results.db"
    path.write_text(path.read_text().replace("scene_limit_s = 30.0", "scene_limit_s = 5.0"))
    bad = EstimatorSpec("callable", "foreign_estimators:kills_its_caller_or_hangs")  # with 5 frames, or with 6
    assert len(run(path, store, foreign=[bad])) == 3
    assert outcomes_by_frames(store) == {(4, "ok"): 3, (5, "crash"): 3, (6, "timeout"): 3}
    assert {(run.outcome, run.detail) for run in read_store(store).runs if run.outcome != "ok"} == {
        ("crash", "its worker process died twice"),
        ("timeout", "no result within 5 s"),
    }
    assert run(path, store, foreign=[bad]) == []  # set aside: not tried again


def test_a_scene_is_tried_again_after_one_death_and_not_after_two(tmp_path):
    path, store = small_campaign(tmp_path, repeats=1, doses="[0.0]"), tmp_path / "results.db"
    deaths = Counter()

    def dies_of(call):
        name, *works = call
        frames = works[0].scenario.recording.n_frames if name == "run_scene" else 0
        deaths[frames] += 1
        return (frames == 4 and deaths[4] == 1) or frames == 5

    run(path, store, inline(dies_of))
    assert outcomes_by_frames(store) == {(4, "ok"): 2, (5, "crash"): 2, (6, "ok"): 2}
    assert [deaths[frames] for frames in (4, 5, 6)] == [2, 2, 1]


def test_what_a_foreign_estimator_does_is_an_outcome_of_its_own_run_alone(tmp_path):
    scene = read_campaign(small_campaign(tmp_path)).scenes()[0]
    specs = (EstimatorSpec("method", "paper"), EstimatorSpec("callable", "foreign_estimators:raises"))
    done = run_scene(SceneWork(0, scene.scenario, specs, 60.0))
    assert [(run.method, run.outcome) for run in done.runs] == [("paper", "ok"), (specs[1].text, "crash")]
    assert [len(run.leaks) for run in done.runs] == [3, 3]  # a clip that was rendered has its truth
    assert done.runs[1].detail == "RuntimeError: no idea"


def test_a_clip_that_cannot_be_made_is_a_crash_in_words(tmp_path, monkeypatch):
    scene = read_campaign(small_campaign(tmp_path)).scenes()[0]
    monkeypatch.setattr("scenarios.scene_work.simulate", lambda *_, **__: 1 / 0)
    (run_,) = run_scene(SceneWork(0, scene.scenario, (EstimatorSpec("method", "paper"),), 60.0)).runs
    assert (run_.outcome, run_.detail, run_.leaks) == ("crash", "ZeroDivisionError: division by zero", ())


def test_workers_that_cannot_even_say_hello_stop_the_campaign_and_blame_no_scene(tmp_path):
    path, store = small_campaign(tmp_path), tmp_path / "results.db"
    with pytest.raises(WorkerError, match="died before it did anything"):
        run(path, store, inline(lambda _: True))
    assert read_store(store).runs == ()


def test_a_worker_of_another_version_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("scenarios.lanes.versions", lambda: "leakloc 9")
    with pytest.raises(WorkerError, match="here is leakloc 9"):
        run(small_campaign(tmp_path, repeats=1), tmp_path / "results.db", inline())


def test_an_estimator_that_cannot_be_started_stops_the_campaign_and_nothing_is_recorded(tmp_path):
    path, store = small_campaign(tmp_path), tmp_path / "results.db"
    with pytest.raises(EstimatorError, match="no_such_module"):
        run(path, store, inline(), [EstimatorSpec("callable", "no_such_module:f")])
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
