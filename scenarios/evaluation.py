"""The paper's evaluation: which campaigns it is made of, how large, and how it is run; a stopped run goes on.

All campaigns share the workers. A scene is rendered once for both methods, but anew for every level of noise: keeping
its clean frames would save a tenth of the time, for radiation and sensor take as long as the light.
"""

import hashlib
import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenarios.campaign import AxisTable, Value
from scenarios.campaign_file import CampaignFile, read_campaign
from scenarios.lanes import Kind
from scenarios.published import LEVELS_GY_H
from scenarios.run_campaign import Running, Study, running_together
from scenarios.scenario import Scenario
from scenarios.store import Stored, read_store
from scenarios.stored_run import Run

DOSE, FRAMES = "gamma.dose_rate_gy_h", "recording.n_frames"
AS_IT_IS = "(as it is)"


@dataclass(frozen=True)
class Experiment:
    """One part of the evaluation: a shipped campaign, and its axis that makes the rows of a table."""

    name: str
    title: str
    campaign: str
    axis: str

    def setting(self, value: Value) -> str:
        """Return what a place on the axis is called in tables."""
        if self.axis == DOSE:
            return next((level for level, dose in LEVELS_GY_H.items() if dose == value), f"{value} Gy/h")
        if self.axis == "without":
            return str(value) if value == AS_IT_IS else f"without {value}"
        return f"{value} {'frames' if self.axis == FRAMES else self.axis}"


EXPERIMENTS = (
    Experiment("separated", "Tables 2 and 3: three separated leaks", "paper_separated", DOSE),
    Experiment("frames", "Table 4: number of frames, noise H", "paper_frames", FRAMES),
    Experiment("crowded", "Table 5: three crowded leaks, the scenes of table 1", "paper_crowded", DOSE),
    Experiment("multiple", "Five and seven leaks, noise H", "paper_multiple", "leaks"),
    Experiment("causes", "Why: the separated scenes at noise H without one cause at a time", "paper_causes", "without"),
)


@dataclass(frozen=True)
class Size:
    """How much is run: random scenes of three leaks, of five and of seven, and places of the axes (all when empty)."""

    name: str
    separated: int
    multiple: int
    crowded_doses: tuple[float, ...] = ()
    frames: tuple[int, ...] = ()


FULL = Size("full", separated=30, multiple=4)
QUICK = Size("quick", separated=5, multiple=2, crowded_doses=(10.0,), frames=(3, 24))


@dataclass(frozen=True)
class Evaluation:
    """Results of all experiments by name, and the campaigns that they are of."""

    size: Size
    files: dict[str, CampaignFile]
    results: dict[str, Stored]

    def runs(self, experiment: str, setting: str, method: str) -> list[Run]:
        """Return the runs of an experiment at one setting by one method, by repeat."""
        (one,) = (one for one in EXPERIMENTS if one.name == experiment)
        runs = [run for run in self.results[experiment].runs if run.method == method]
        return [run for run in runs if one.setting(run.values[one.axis]) == setting]

    def settings(self, experiment: str) -> list[str]:
        """Return the settings of an experiment, in the order of its campaign."""
        (one,) = (one for one in EXPERIMENTS if one.name == experiment)
        return list(dict.fromkeys(one.setting(run.values[one.axis]) for run in self.results[experiment].runs))


def scenario_of(evaluation: Evaluation) -> Scenario:
    """Return the first separated scene at the strongest noise: figure 6 shows it, and all rigs and walls are its."""
    return max(
        (scene.scenario for scene in evaluation.files["separated"].scenes() if scene.repeat == 0),
        key=lambda scenario: scenario.gamma.dose_rate_gy_h,
    )


def campaign_files(size: Size, overrides: Sequence[str] = ()) -> dict[str, CampaignFile]:
    """Return the campaigns of a size by the names of their experiments; `overrides` change all of their scenarios."""
    changes: dict[str, dict[str, Any]] = {
        "separated": {"repeats": size.separated},
        "frames": {"repeats": size.separated, "values": size.frames},
        "crowded": {"values": size.crowded_doses},
        "multiple": {"repeats": size.multiple},
        "causes": {"repeats": size.separated},
    }
    return {
        experiment.name: _changed(read_campaign(experiment.campaign), overrides, **changes[experiment.name])
        for experiment in EXPERIMENTS
    }


def _changed(
    file: CampaignFile, overrides: Sequence[str], repeats: int | None = None, values: tuple[float, ...] = ()
) -> CampaignFile:
    campaign = file.campaign
    axes = tuple(AxisTable(key=axis.key, label=axis.label, values=values or axis.values) for axis in campaign.axis)
    update = {"axis": axes, "set": (*campaign.set, *overrides), "repeats": repeats or campaign.repeats}
    return CampaignFile(file.source, campaign.model_copy(update=update), file.base)


@contextmanager
def evaluating(files: dict[str, CampaignFile], folder: Path, kind: Kind) -> Iterator[Running]:
    """Run what is not in the folder's stores yet; each outcome is in its store before it is yielded."""
    for file in files.values():
        file.scenes()  # mistakes are told before anything is made
    folder.mkdir(parents=True, exist_ok=True)
    with running_together(list(_studies(files, folder).values()), kind) as under_way:
        yield under_way


def evaluation_of(size: Size, files: dict[str, CampaignFile], folder: Path) -> Evaluation:
    """Read what the folder's stores hold of these campaigns."""
    stores = store_paths(files, folder)
    return Evaluation(size, files, {name: read_store(path) for name, path in stores.items()})


def store_paths(files: dict[str, CampaignFile], folder: Path) -> dict[str, Path]:
    """Return the store of each campaign. Another size, another version: another store, and nothing is mixed up."""
    return {name: study.store for name, study in _studies(files, folder).items()}


def remove_stores(files: dict[str, CampaignFile], folder: Path) -> None:
    """Remove the stores of these campaigns, and their folder when nothing else is in it."""
    for path in store_paths(files, folder).values():
        path.unlink(missing_ok=True)
    with suppress(OSError):
        folder.rmdir()


def _studies(files: dict[str, CampaignFile], folder: Path) -> dict[str, Study]:
    studies = {}
    for name, file in files.items():
        said = json.dumps(Study(file, (), folder).identity().as_rows())
        studies[name] = Study(file, (), folder / f"{name}-{hashlib.sha256(said.encode()).hexdigest()[:12]}.db")
    return studies
