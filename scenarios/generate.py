"""Generate a data set: many clips of one scenario with leaks drawn anew, in parallel, resumable after a kill."""

import shutil
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from leakloc.outside_file import read_json
from scenarios.clip_folder import DamagedClipError, read_manifest, verify_clip, write_clip
from scenarios.draws import seed_of_clip
from scenarios.meshes import mesh_hashes
from scenarios.output_folder import MAX_MARKER_BYTES, OutputError, creating, made_by, write_json
from scenarios.rules import violations
from scenarios.scenario import Drip, LayoutTable, Scenario
from scenarios.scenario_file import ScenarioError
from scenarios.scenario_toml import scenario_toml
from scenarios.simulate import simulate
from scenarios.workers import all_done

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
    again with the same scenario, and a data set grows when it is started again with more clips; clips that are there
    are checked against their manifests, not believed.

    Raises ScenarioError when its leaks find no room, OutputError when the destination holds something else or more
    clips, WorkerError when workers keep dying.
    """
    meshes = mesh_hashes(scenario)
    plan: dict[str, object] = {
        "made_by": made_by(),
        "scenario": scenario_toml(scenario),
        **({"meshes": meshes} if meshes else {}),
        "clips": [clip_name(i) for i in range(n_clips)],
    }
    if broken := violations(scenario_of_clip(scenario, 0)):
        raise ScenarioError("\n".join(f"random places: {one.key}: {one.rule}, got {one.value}" for one in broken))
    _begin(destination, plan)
    for number, _ in all_done(partial(_write_one, scenario, destination), range(n_clips), n_workers):
        yield number
    write_json(destination / INDEX, {**plan, "complete": True})


def _begin(destination: Path, plan: dict[str, object]) -> None:
    """Lay down the index; a folder that has one of the same scenario is gone on with."""
    if destination.is_dir() and any(destination.iterdir()):
        listed = _clips_listed(destination, plan)
        if listed is None:
            raise OutputError(f"{destination}: is not empty and is no data set of this scenario, seed and version")
        if not set(listed) <= set(_strings(plan["clips"])):
            raise OutputError(f"{destination}: holds {len(listed)} clips already; ask for as many or more")
        write_json(destination / INDEX, {**plan, "complete": False})
        return
    with creating(destination) as folder:
        write_json(folder / INDEX, {**plan, "complete": False})


def _clips_listed(destination: Path, plan: dict[str, object]) -> list[str] | None:
    """Clips that the index of a data set of this plan lists; None where it is no such data set."""
    try:
        index = read_json(destination / INDEX, MAX_MARKER_BYTES)
    except ValueError:
        return None
    if not isinstance(index, dict) or any(index.get(key) != plan.get(key) for key in ("scenario", "meshes", "made_by")):
        return None
    return _strings(index.get("clips"))


def _strings(value: object) -> list[str]:
    return [str(item) for item in value] if isinstance(value, list) else []


def _write_one(scenario: Scenario, destination: Path, clip: int) -> int:
    folder, wanted = destination / clip_name(clip), scenario_of_clip(scenario, clip)
    try:
        verify_clip(folder)
        is_there = read_manifest(folder).get("seed") == wanted.seed
    except DamagedClipError:
        is_there = False
    if not is_there:
        shutil.rmtree(folder, ignore_errors=True)  # a folder of this name in a data set of ours is ours
        write_clip(simulate(wanted), folder, creating)
    return clip
