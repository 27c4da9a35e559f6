"""Lanes: one worker each, one scene at a time on it, so that a worker's death or a time-out has one scene to blame.

A lane works through the standard Executor interface: a process of this machine, or a worker of a Dask cluster.
"""

import multiprocessing
import signal
import time
from collections import deque
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from contextlib import contextmanager
from dataclasses import dataclass
from queue import SimpleQueue

from scenarios.scene_time import scene_s
from scenarios.scene_work import MethodOutcome, SceneOutcome, SceneWork, broken_scene, run_scene
from scenarios.versions import versions
from scenarios.workers import WorkerError, begin_worker, one_blas_thread

TRIES = 2
NewExecutor = Callable[[], Executor]
"""Makes the executor of a lane: one worker, and a new one after its death."""

Evaluate = Callable[[Sequence[SceneWork]], Iterable[MethodOutcome]]
"""Begins to render scenes and to run their one estimator on them, and gives what came out, in their order."""


@dataclass(frozen=True)
class Kind:
    """A kind of worker: the executors of its lanes, and the errors of a future whose worker died."""

    lanes: tuple[NewExecutor, ...]
    deaths: tuple[type[BaseException], ...]


def new_process() -> Executor:
    """Return an executor of one process of this machine; it lives no longer than this one."""
    spawn = multiprocessing.get_context("spawn")  # forking a process that runs threads can hang
    return ProcessPoolExecutor(1, mp_context=spawn, initializer=_begin_process)


def _begin_process() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the supervisor is told, and its workers end with it
    begin_worker()


class Shares:
    """Work dealt out so that items of one group run in a row on one lane, and no lane is idle while there is work."""

    def __init__(self, groups: Sequence[Sequence[SceneWork]], n_lanes: int) -> None:
        """Give every lane an empty hand."""
        self._groups = deque(deque(group) for group in groups)
        self._hands: list[deque[SceneWork]] = [deque() for _ in range(n_lanes)]

    def next_of(self, lane: int) -> SceneWork | None:
        """Take the next item of a lane: of its own group, else of a new one, else of half of the longest hand."""
        if not self._hands[lane]:
            self._hands[lane] = self._groups.popleft() if self._groups else self._half_of_the_longest()
        return self._hands[lane].popleft() if self._hands[lane] else None

    def _half_of_the_longest(self) -> deque[SceneWork]:
        longest = max(self._hands, key=len)
        taken = [longest.pop() for _ in range((len(longest) + 1) // 2)]
        return deque(reversed(taken))


class Lane:
    """One worker, what it does, since when, and how many workers died of it."""

    def __init__(self, new_executor: NewExecutor, deaths: tuple[type[BaseException], ...]) -> None:
        """Start no worker yet."""
        self._new_executor, self._death_errors = new_executor, deaths
        self._executor: Executor | None = None
        self._greeting: Future[str] | None = None
        self._work: SceneWork | None = None
        self._begun_s, self._deaths = 0.0, 0

    def begin(self, work: SceneWork) -> Future[SceneOutcome]:
        """Give the worker a scene; a worker that died before is replaced."""
        self._deaths = self._deaths if work is self._work else 0
        self._work = work
        executor = self._executor or self._started()
        self._begun_s = time.monotonic()
        try:
            return executor.submit(run_scene, work)
        except self._death_errors:  # it died between two scenes, for which neither is to blame
            self.stop()
            return self._started().submit(run_scene, work)

    def result(self, future: Future[SceneOutcome]) -> SceneOutcome | SceneWork:
        """Return the outcome of what was begun; or the work itself when its worker died and it is to be tried again."""
        assert self._work is not None
        try:
            outcome = future.result()
        except self._death_errors as error:
            return self._after_death(self._work, error)
        except (CancelledError, OSError) as error:
            raise WorkerError(f"the workers are gone: {error}; run it again to go on") from None
        if outcome.versions != versions():
            raise WorkerError(f"a worker has {outcome.versions}; here is {versions()}: results would not be the same")
        return outcome

    def done(self, work: SceneWork) -> SceneOutcome:
        """Wait for the outcome of a scene; it is tried again when its worker dies, once."""
        while True:
            result = self.result(self.begin(work))
            if not isinstance(result, SceneWork):
                return result

    def stop(self) -> None:
        """Let the worker go, without waiting for what it does."""
        if self._executor is not None:
            self._executor.shutdown(wait=False)
        self._executor = self._greeting = None

    def _started(self) -> Executor:
        """Start a worker. It says hello first: one that cannot do that much is no scene's fault."""
        self._executor = self._new_executor()
        with one_blas_thread():
            self._greeting = self._executor.submit(versions)
        self._greeting.add_done_callback(self._greeted)
        return self._executor

    def _greeted(self, _: Future[str]) -> None:
        self._begun_s = time.monotonic()  # starting Python is not the scene's time

    def _after_death(self, work: SceneWork, error: BaseException) -> SceneOutcome | SceneWork:
        took_s = time.monotonic() - self._begun_s
        if self._greeting is not None and self._greeting.exception() is not None:
            raise WorkerError(f"a worker died before it did anything: {error}") from None
        self.stop()
        self._deaths += 1
        if took_s >= work.limit_s:
            return broken_scene(work, "timeout", f"no result within {work.limit_s:g} s")
        if self._deaths == TRIES:
            return broken_scene(work, "crash", "its worker process died twice")
        return work


class Lanes:
    """The lanes of a kind of workers, which start when they are first needed and stay until they are stopped."""

    def __init__(self, kind: Kind) -> None:
        """Start no worker yet."""
        self._lanes = [Lane(new_executor, kind.deaths) for new_executor in kind.lanes]
        self._free: SimpleQueue[Lane] = SimpleQueue()
        for lane in self._lanes:
            self._free.put(lane)

    @property
    def n(self) -> int:
        """Number of lanes."""
        return len(self._lanes)

    def done(self, groups: Sequence[Sequence[SceneWork]]) -> Iterator[SceneOutcome]:
        """Yield the outcome of every scene as it is done. A scene is tried again when its worker dies, once.

        Raises WorkerError when workers cannot work at all.
        """
        shares = Shares(groups, len(self._lanes))
        running: dict[Future[SceneOutcome], int] = {}

        def go_on(number: int, work: SceneWork | None) -> None:
            if work is not None:
                running[self._lanes[number].begin(work)] = number

        for number in range(len(self._lanes)):
            go_on(number, shares.next_of(number))
        while running:
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                number = running.pop(future)
                result = self._lanes[number].result(future)
                if isinstance(result, SceneWork):
                    go_on(number, result)
                else:
                    go_on(number, shares.next_of(number))  # before the result is written, which takes a while
                    yield result

    def done_by_a_free_one(self, work: SceneWork) -> SceneOutcome:
        """Wait for a lane that is free, and for the outcome of a scene on it. For threads, and not beside `done`."""
        lane = self._free.get()
        try:
            return lane.done(work)
        finally:
            self._free.put(lane)

    def stop(self) -> None:
        """Let all workers go."""
        for lane in self._lanes:
            lane.stop()


@contextmanager
def lanes_of(kind: Kind) -> Iterator[Lanes]:
    """Yield lanes for several lots of work, one after the other; they are stopped when the block ends."""
    lanes = Lanes(kind)
    try:
        yield lanes
    finally:
        lanes.stop()


@contextmanager
def on_lanes(lanes: Lanes) -> Iterator[Evaluate]:
    """Yield the evaluation of scenes on lanes, that goes on while its caller does other things.

    What is begun meanwhile follows at once, so that no lane is idle. What was not begun when the block ends never is.
    """
    threads = ThreadPoolExecutor(lanes.n)

    def evaluate(works: Sequence[SceneWork]) -> Iterator[MethodOutcome]:
        longest_first = sorted(works, key=lambda work: -scene_s(work.scenario))  # no lane is idle for long at the end
        begun = {work.number: threads.submit(lanes.done_by_a_free_one, work) for work in longest_first}
        return (begun[work.number].result().runs[0] for work in works)

    try:
        yield evaluate
    finally:
        threads.shutdown(wait=False, cancel_futures=True)


def scenes_done(kind: Kind, groups: Sequence[Sequence[SceneWork]]) -> Iterator[SceneOutcome]:
    """Yield the outcome of every scene as it is done, on lanes of its own; raises WorkerError like `Lanes.done`."""
    with lanes_of(kind) as lanes:
        yield from lanes.done(groups)


def grouped(works: Sequence[SceneWork], static_part: Callable[[SceneWork], Hashable]) -> list[list[SceneWork]]:
    """Return works in groups of one static part, in order of first appearance."""
    groups: dict[Hashable, list[SceneWork]] = {}
    for work in works:
        groups.setdefault(static_part(work), []).append(work)
    return list(groups.values())
