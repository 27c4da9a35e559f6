"""Lanes: outcomes in the order of their scenes, while workers go on with what was begun after them."""

import os
import threading
import time
from concurrent.futures import BrokenExecutor, Executor, Future
from functools import partial

import pytest

from scenarios.estimators import EstimatorSpec
from scenarios.lanes import Kind, lanes_of, on_lanes
from scenarios.scenario import Scenario
from scenarios.scene_work import MethodOutcome, SceneOutcome, SceneWork, run_scene
from scenarios.versions import versions

PATIENCE_S = 10.0


def nothing(number):
    pass


class Told(Executor):
    """Runs no scene, but has it done at once, in this process: its outcome tells its number."""

    def __init__(self, before=nothing):
        self._before = before

    def submit(self, call, /, *arguments):
        future = Future()
        try:
            future.set_result(self._outcome(*arguments) if call is run_scene else call(*arguments))
        except BrokenExecutor as error:
            future.set_exception(error)
        return future

    def _outcome(self, work):
        self._before(work.number)
        return SceneOutcome(work.number, (MethodOutcome("m", "ok", str(work.number)),), versions())


def kind(before=nothing, n_lanes=2):
    return Kind((partial(Told, before),) * n_lanes, (BrokenExecutor,))


def works(numbers):
    """Each longer than the one before: lanes begin with the last."""
    scenes = [Scenario.model_validate({"recording": {"n_frames": 4 + number}}) for number in numbers]
    return [
        SceneWork(number, scene, (EstimatorSpec("method", "naive"),), PATIENCE_S)
        for number, scene in zip(numbers, scenes, strict=True)
    ]


def told(outcomes):
    return [int(run.detail) for run in outcomes]


def test_outcomes_come_in_the_order_of_their_scenes_whichever_is_done_first():
    rest_s = (0.05, 0.0, 0.02, 0.0, 0.03, 0.01)
    with lanes_of(kind(lambda number: time.sleep(rest_s[number]), 3)) as lanes, on_lanes(lanes) as evaluate:
        assert told(evaluate(works(range(6)))) == list(range(6))


def test_what_is_begun_next_follows_while_nothing_is_awaited():
    done, all_are = [], threading.Event()

    def before(number):
        done.append(number)
        if len(done) == 6:
            all_are.set()

    with lanes_of(kind(before)) as lanes, on_lanes(lanes) as evaluate:
        rounds = [evaluate(works(range(3))), evaluate(works(range(3, 6)))]
        assert all_are.wait(PATIENCE_S)
        assert [told(outcomes) for outcomes in rounds] == [[0, 1, 2], [3, 4, 5]]


def test_what_was_not_begun_when_the_block_ends_never_is():
    begun, may_end = [], threading.Event()

    def before(number):
        begun.append(number)
        may_end.wait(PATIENCE_S)

    with lanes_of(kind(before, 1)) as lanes:
        with on_lanes(lanes) as evaluate:
            evaluate(works(range(5)))
            while not begun:
                time.sleep(0.001)
        may_end.set()
        with on_lanes(lanes) as evaluate:
            assert told(evaluate(works([7]))) == [7]
    assert len(begun) == 2


@pytest.mark.parametrize(("n_deaths", "outcome"), [(1, "ok"), (2, "crash")])
def test_a_scene_whose_worker_dies_is_tried_again_once(n_deaths, outcome):
    deaths = []

    def before(number):
        if number == 1 and len(deaths) < n_deaths:
            deaths.append(number)
            raise BrokenExecutor("dead")

    with lanes_of(kind(before)) as lanes, on_lanes(lanes) as evaluate:
        assert [run.outcome for run in evaluate(works(range(4)))] == ["ok", outcome, "ok", "ok"]


def test_workers_are_started_with_one_thread_of_matrix_products_unless_more_is_asked_for(monkeypatch):
    seen = []

    class Started(Told):
        def submit(self, call, /, *arguments):
            seen.append(os.environ.get("OMP_NUM_THREADS"))
            return super().submit(call, *arguments)

    for said, first in ((None, "1"), ("3", "3")):
        monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
        if said is not None:
            monkeypatch.setenv("OMP_NUM_THREADS", said)
        with lanes_of(Kind((Started,), (BrokenExecutor,))) as lanes, on_lanes(lanes) as evaluate:
            assert told(evaluate(works([0]))) == [0]
        assert seen[0] == first
        assert os.environ.get("OMP_NUM_THREADS") == said
        seen.clear()
