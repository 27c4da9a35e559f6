"""Run campaigns into their stores: what is there already is kept, the rest is done, in any order and on any workers."""

from collections.abc import Hashable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from scenarios.arms import Scene
from scenarios.campaign_file import CampaignError, CampaignFile
from scenarios.estimators import EstimatorSpec
from scenarios.lanes import Kind, grouped, new_process, scenes_done
from scenarios.scene_work import SceneOutcome, SceneWork
from scenarios.store import Writer, writing
from scenarios.store_identity import Identity
from scenarios.stored_run import runs_of
from scenarios.versions import versions


@dataclass(frozen=True)
class Study:
    """A campaign, the foreign estimators that come along, and the store that its results go into."""

    file: CampaignFile
    foreign: Sequence[EstimatorSpec]
    store: Path

    def identity(self) -> Identity:
        """Return what the store holds results of; raises CampaignError without any estimator, or with one twice."""
        estimators = (*(EstimatorSpec("method", name) for name in self.file.campaign.methods), *self.foreign)
        if not estimators:
            raise CampaignError(
                f"{self.file.source}: methods: must name one at least, or the command line an estimator"
            )
        texts = [spec.text for spec in estimators]
        if twice := next((text for text in texts if texts.count(text) > 1), None):
            raise CampaignError(f"{self.file.source}: methods: {twice!r} is named twice: a clip would count as two")
        return Identity(self.file.campaign, self.file.fingerprint(), estimators, versions())


@dataclass(frozen=True)
class Running:
    """Campaigns under way: how many scenes they have, how many were there already, and the others as they are done."""

    n_scenes: int
    n_there: int
    left: Iterator[SceneOutcome]


@dataclass(frozen=True)
class Task:
    """A scene that is left to do, and the writer of its outcome."""

    scene: Scene
    identity: Identity
    writer: Writer

    def work(self, number: int) -> SceneWork:
        """Return the scene as work for a worker, under a number that no other task has."""
        return SceneWork(number, self.scene.scenario, self.identity.estimators, self.identity.campaign.scene_limit_s)


def local_workers(n_workers: int) -> Kind:
    """Return lanes of processes on this machine."""
    return Kind((new_process,) * n_workers, (BrokenExecutor,))


@contextmanager
def running(file: CampaignFile, foreign: Sequence[EstimatorSpec], store: Path, kind: Kind) -> Iterator[Running]:
    """Open the store and yield the campaign; each outcome is in the store before it is yielded.

    Raises CampaignError without any estimator, StoreError, WorkerError, EstimatorError.
    """
    with running_together([Study(file, foreign, store)], kind) as under_way:
        yield under_way


@contextmanager
def running_together(studies: Sequence[Study], kind: Kind) -> Iterator[Running]:
    """Like `running` for several campaigns, which share the workers: they start once and cast common rays once."""
    n_scenes, tasks = 0, []
    with ExitStack() as stores:
        for study in studies:
            identity, scenes = study.identity(), study.file.scenes()
            writer = stores.enter_context(writing(study.store, identity))
            there = writer.scenes()
            tasks += [Task(scene, identity, writer) for scene in scenes if scene.number not in there]
            n_scenes += len(scenes)
        yield Running(n_scenes, n_scenes - len(tasks), _run(tasks, kind))


def _run(tasks: Sequence[Task], kind: Kind) -> Iterator[SceneOutcome]:
    works = [task.work(number) for number, task in enumerate(tasks)]
    for outcome in scenes_done(kind, grouped(works, static_part)):
        task = tasks[outcome.number]
        own = replace(outcome, number=task.scene.number)
        task.writer.add(runs_of(task.scene, own), own)
        yield own


def static_part(work: SceneWork) -> Hashable:
    """What the static layer of a scene depends on: scenes that share it, run in a row, cast its rays once."""
    scenario = work.scenario
    return scenario.rig, scenario.pedestal, scenario.lamp, scenario.structure
