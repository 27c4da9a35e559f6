"""Generate a data set: many clips of one scenario with leaks drawn anew, in parallel, resumable after a kill."""

import json
import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import cv2

from scenarios.clip_folder import DamagedClipError, verify_clip, write_clip
from scenarios.draws import seed_of_clip
from scenarios.output_folder import OutputError, creating, made_by, replacing, was_made_by_us, write_json
from scenarios.scenario import Drip, LayoutTable, Scenario
from scenarios.scenario_toml import scenario_toml
from scenarios.simulate import simulate

INDEX = "dataset.json"


def scenario_of_clip(scenario: Scenario, clip: int) -> Scenario:
    """Scenario number `clip` of a data set: its own seed, its leaks at random places.

    A scenario with listed leaks lends their number and the drip of the first one.
    """
    layout = scenario.layout
    if layout is None:
        drip = {name: getattr(scenario.leak[0], name) for name in Drip.model_fields} if scenario.leak else {}
        layout = LayoutTable(n_leaks=len(scenario.leak), **drip)
    seed = seed_of_clip(scenario.seed, clip)
    return scenario.model_copy(update={"seed": seed, "layout": layout, "leak": ()})


def clip_name(clip: int) -> str:
    """Folder of a clip inside the data set."""
    return f"clip_{clip:05d}"


def generate(scenario: Scenario, n_clips: int, destination: Path, n_workers: int) -> Iterator[int]:
    """Write `n_clips` clips into `destination`, yielding the number of each as it is done.

    The same bytes whatever the number of workers. A run that was killed goes on where it stopped when it is started
    again with the same scenario; clips that are there are checked against their manifests, not believed.

    Raises OutputError when the destination holds something else.
    """
    plan: dict[str, object] = {
        "made_by": made_by(),
        "scenario": scenario_toml(scenario),
        "clips": [clip_name(i) for i in range(n_clips)],
    }
    _begin(destination, plan)
    work = partial(_write_one, scenario, destination)
    yield from _all_done(work, n_clips, n_workers)
    write_json(destination / INDEX, {**plan, "complete": True})


def _begin(destination: Path, plan: dict[str, object]) -> None:
    """Lay down the index; a folder that has one of the same scenario is gone on with."""
    if destination.is_dir() and any(destination.iterdir()):
        if not was_made_by_us(destination) or not _has_index_of(destination, str(plan["scenario"])):
            raise OutputError(f"{destination}: is not empty and is no data set of this scenario, seed and version")
        return
    with creating(destination) as folder:
        write_json(folder / INDEX, {**plan, "complete": False})


def _has_index_of(destination: Path, scenario: str) -> bool:
    try:
        index = json.loads((destination / INDEX).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(index, dict) and index.get("scenario") == scenario and index.get("made_by") == made_by()


def _all_done(work: Callable[[int], int], n_clips: int, n_workers: int) -> Iterator[int]:
    if n_workers == 1:
        yield from map(work, range(n_clips))
        return
    spawn = multiprocessing.get_context("spawn")  # forking a process that runs threads can hang
    with ProcessPoolExecutor(n_workers, mp_context=spawn, initializer=_one_thread) as workers:
        yield from workers.map(work, range(n_clips))


def _one_thread() -> None:
    """Clips are the parallel unit; threads inside a worker would only fight for the cores."""
    cv2.setNumThreads(1)


def _write_one(scenario: Scenario, destination: Path, clip: int) -> int:
    folder = destination / clip_name(clip)
    try:
        verify_clip(folder)
    except DamagedClipError:
        write_clip(simulate(scenario_of_clip(scenario, clip)), folder, replacing)
    return clip
