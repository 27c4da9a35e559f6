"""Run a campaign into its store: what is there already is kept, the rest is done, in any order and on any workers."""

from collections.abc import Hashable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from scenarios.arms import Scene
from scenarios.campaign_file import CampaignError, CampaignFile
from scenarios.estimators import EstimatorSpec
from scenarios.lanes import Kind, grouped, new_process, scenes_done
from scenarios.scene_work import SceneOutcome, SceneWork
from scenarios.store import Identity, Writer, writing
from scenarios.stored_run import runs_of
from scenarios.versions import versions


@dataclass(frozen=True)
class Running:
    """A campaign under way: how many scenes it has, how many were there already, and the others as they are done."""

    n_scenes: int
    n_there: int
    left: Iterator[SceneOutcome]


def local_workers(n_workers: int) -> Kind:
    """Return lanes of processes on this machine."""
    return Kind((new_process,) * n_workers, (BrokenExecutor,))


@contextmanager
def running(file: CampaignFile, foreign: Sequence[EstimatorSpec], store: Path, kind: Kind) -> Iterator[Running]:
    """Open the store and yield the campaign; each outcome is in the store before it is yielded.

    Raises CampaignError without any estimator, StoreError, WorkerError, EstimatorError.
    """
    estimators = (*(EstimatorSpec("method", name) for name in file.campaign.methods), *foreign)
    if not estimators:
        raise CampaignError(f"{file.source}: methods: must name one at least, or the command line an estimator")
    scenes = file.scenes()
    identity = Identity(file.campaign, file.fingerprint(), estimators, versions())
    with writing(store, identity) as writer:
        there = writer.scenes()
        left = [scene for scene in scenes if scene.number not in there]
        yield Running(len(scenes), len(scenes) - len(left), _run(left, identity, writer, kind))


def _run(scenes: Sequence[Scene], identity: Identity, writer: Writer, kind: Kind) -> Iterator[SceneOutcome]:
    limit_s = identity.campaign.scene_limit_s
    scene_of = {scene.number: scene for scene in scenes}
    works = [SceneWork(scene.number, scene.scenario, identity.estimators, limit_s) for scene in scenes]
    for outcome in scenes_done(kind, grouped(works, static_part)):
        writer.add(runs_of(scene_of[outcome.number], outcome), outcome)
        yield outcome


def static_part(work: SceneWork) -> Hashable:
    """What the static layer of a scene depends on: scenes that share it, run in a row, cast its rays once."""
    scenario = work.scenario
    return scenario.rig, scenario.pedestal, scenario.lamp, scenario.structure
