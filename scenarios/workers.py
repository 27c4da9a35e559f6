"""Work spread over processes that may die: the same results whatever their number, and a dead one costs one try."""

import multiprocessing
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import TypeVar

import cv2

Item = TypeVar("Item")
Result = TypeVar("Result")
BLAS_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Where the library behind numpy's matrix products reads its number of threads, as it is loaded."""

_environment = threading.Lock()  # lanes start their workers from threads


class WorkerError(ValueError):
    """Work that kills the processes that do it; the message names the first item left."""


def all_done(work: Callable[[Item], Result], items: Sequence[Item], n_workers: int) -> Iterator[tuple[int, Result]]:
    """Yield (number, result) of every item as it is done, on `n_workers` processes; in this one when that is 1.

    When a process dies, the pool is made anew and what was not done is done again, its first item alone: WorkerError if
    that item kills its process too.
    """
    if n_workers == 1:
        yield from enumerate(map(work, items))
        return
    left, alone = set(range(len(items))), False
    while left:
        numbers = sorted(left)[:1] if alone else sorted(left)
        try:
            for number, result in _done_by_one_pool(work, items, numbers, n_workers):
                left.discard(number)
                yield number, result
            alone = False
        except BrokenProcessPool:
            if alone:
                raise WorkerError(f"a worker process died twice; the first item left is {items[min(left)]}") from None
            alone = True


def in_order(numbered: Iterator[tuple[int, Result]]) -> Iterator[Result]:
    """Yield results by their number, each as soon as all before it are there."""
    waiting: dict[int, Result] = {}
    following = 0
    for number, result in numbered:
        waiting[number] = result
        while following in waiting:
            yield waiting.pop(following)
            following += 1


def _done_by_one_pool(
    work: Callable[[Item], Result], items: Sequence[Item], numbers: Sequence[int], n_workers: int
) -> Iterator[tuple[int, Result]]:
    spawn = multiprocessing.get_context("spawn")  # forking a process that runs threads can hang
    with ProcessPoolExecutor(n_workers, mp_context=spawn, initializer=begin_worker) as pool:
        with one_blas_thread():
            number_of = {pool.submit(work, items[number]): number for number in numbers}
        for future in as_completed(number_of):
            yield number_of[future], future.result()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let processes that are started meanwhile have one thread of matrix products each, unless the user has said more.

    Two workers of two such threads on two cores take 1.4 times as long.
    """
    with _environment:
        unset = [name for name in BLAS_VARIABLES if name not in os.environ]
        os.environ.update(dict.fromkeys(unset, "1"))
        try:
            yield
        finally:
            for name in unset:
                del os.environ[name]


def begin_worker() -> None:
    """One thread of OpenCV, for items are the parallel unit; and no life after the parent's."""
    cv2.setNumThreads(1)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_die_with, args=(parent,), daemon=True).start()


def _die_with(parent: multiprocessing.process.BaseProcess) -> None:
    parent.join()
    os._exit(1)
