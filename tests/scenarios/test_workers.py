"""Work on processes that may die: every item once, in any order of dying."""

import os
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import pytest

from scenarios.workers import WorkerError, all_done, in_order, one_blas_thread


def squared(number):
    return number * number


def dies_once(folder, number):
    """Kill the process that works on item 2 the first time."""
    mark = folder / "died"
    if number == 2 and not mark.exists():
        mark.write_text("")
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def dies_always(number):
    if number == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def threads_said(_):
    return os.environ.get("OPENBLAS_NUM_THREADS")


@pytest.mark.parametrize("n_workers", [1, 2])
def test_results_come_in_order_whatever_the_number_of_workers(n_workers):
    assert list(in_order(all_done(squared, range(7), n_workers))) == [0, 1, 4, 9, 16, 25, 36]


def test_what_a_dead_worker_left_is_done_by_another(tmp_path):
    assert dict(all_done(partial(dies_once, tmp_path), range(5), 2)) == {0: 0, 1: 1, 2: 4, 3: 9, 4: 16}


def test_an_item_that_kills_every_worker_is_named():
    with pytest.raises(WorkerError, match="the first item left is 2"):
        list(all_done(dies_always, range(3), 2))


def test_every_worker_has_one_thread_of_matrix_products(monkeypatch):
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    assert dict(all_done(threads_said, range(2), 2)) == {0: "1", 1: "1"}
    assert threads_said(0) is None


def test_threads_that_start_workers_at_once_leave_the_environment_as_it_was(monkeypatch):
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)

    def started(_):
        with one_blas_thread():
            time.sleep(0.001)
            return threads_said(0)

    with ThreadPoolExecutor(8) as threads:
        assert list(threads.map(started, range(40))) == ["1"] * 40
    assert threads_said(0) is None
