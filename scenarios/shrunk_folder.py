"""A failing scene made plain, as a folder: the scene file, what it looks like, and what cures it."""

import shlex
from dataclasses import dataclass
from pathlib import Path

from scenarios.estimators import Broken, EstimatorSpec, run_estimator
from scenarios.explain import explain, table
from scenarios.output_folder import made_by, write_file, write_json
from scenarios.scenario import Scenario
from scenarios.scene_file import conditions, scene_toml
from scenarios.shrink import Shrunk
from scenarios.simulate import simulate
from scenarios.thumbnail import thumbnail_png

OPTIONS = {"method": "--method", "callable": "--estimator", "command": "--command"}
SCENE = "scene.toml"


@dataclass(frozen=True)
class Exhibit:
    """A scene with its code as people see it: its file, its picture and the table of its causes."""

    toml: str
    png: bytes
    why: str


def exhibit(scenario: Scenario, code: str, estimator: EstimatorSpec, file: str = SCENE) -> Exhibit:
    """Render a scene as it is and without one cause at a time, and show it."""
    return Exhibit(
        told(scenario, code, estimator, file), picture(scenario, estimator), table(list(explain(scenario, estimator)))
    )


def told(scenario: Scenario, code: str, estimator: EstimatorSpec, file: str = SCENE) -> str:
    """Return the scene file: at most 20 lines where the scene allows, its code and how to see it on top."""
    return scene_toml(scenario, (f"{code} by {estimator.text}", explain_command(file, estimator)))


def explain_command(file: str, estimator: EstimatorSpec) -> str:
    """Return the command that shows the failure of a scene file."""
    words = ["leakloc", "explain", file, OPTIONS[estimator.kind], estimator.text]
    if estimator.kind != "method" and estimator.timeout_s != EstimatorSpec.timeout_s:
        words += ["--timeout", f"{estimator.timeout_s:g}"]
    return shlex.join(words)


def picture(scenario: Scenario, estimator: EstimatorSpec) -> bytes:
    """Return the thumbnail of a scene and of what an estimator makes of it."""
    clip = simulate(scenario)
    answer = run_estimator(estimator, clip)
    return thumbnail_png(clip, None if isinstance(answer, Broken) else answer)


def write_shrunk(folder: Path, shrunk: Shrunk, estimator: EstimatorSpec) -> Exhibit:
    """Write scene.toml, thumbnail.png, explain.txt and shrunk.json into an empty folder."""
    shown = exhibit(shrunk.scenario, shrunk.code, estimator)
    write_file(folder / SCENE, shown.toml)
    write_file(folder / "thumbnail.png", shown.png)
    write_file(folder / "explain.txt", f"{shown.why}\n")
    summary = {"made_by": made_by(), "code": shrunk.code, "estimator": estimator.text, "scenes_tried": shrunk.n_tried}
    write_json(folder / "shrunk.json", {**summary, "conditions": conditions(shrunk.scenario)})
    return shown
