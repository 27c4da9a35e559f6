"""The worst separated scene of each method at the strongest noise: its picture, what went wrong, and its command."""

import math
from dataclasses import dataclass

from scenarios.campaign_summary import worst
from scenarios.estimators import EstimatorSpec
from scenarios.evaluation import Evaluation
from scenarios.evaluation_figures import METHODS
from scenarios.scene_work import OK
from scenarios.shrunk_folder import picture
from scenarios.stored_run import Run, replay_command


@dataclass(frozen=True)
class WorstScene:
    """A scene that most is wrong with: in words, as a PNG of 480 x 200 px, and the command that explains it."""

    method: str
    words: str
    png: bytes
    replay: str


def worst_scenes(evaluation: Evaluation) -> list[WorstScene]:
    """Return the worst scene of each method, rendered again; none of a method that did nothing wrong at all."""
    scenes = {scene.number: scene.scenario for scene in evaluation.files["separated"].scenes()}
    setting = evaluation.settings("separated")[-1]
    runs = [run for method in METHODS for run in worst(evaluation.runs("separated", setting, method), 1)]
    return [
        WorstScene(
            run.method,
            in_words(run),
            picture(scenes[run.scene], EstimatorSpec("method", run.method)),
            replay_command(run, "--method"),
        )
        for run in runs
    ]


def in_words(run: Run) -> str:
    """Say what is wrong in a run: a breakdown, or missed and false leaks and the largest error by either rule."""
    if run.outcome != OK:
        return f"{run.outcome}: {run.detail}"
    missed = run.of["observable"] - run.found["observable"]
    counts = f"{missed} of {run.of['observable']} observable leaks missed, {len(run.false_codes)} false"
    parts = ["right, and yet the farthest off of all" if run.is_right else counts]
    largest_m = {
        "by the gate": max(run.errors_m, default=math.nan),
        "by the paper's rule": max(filter(None, map(run.paper_error_m, run.leaks)), default=math.nan),
    }
    parts += [f"largest error {rule} {error_m:.3f} m" for rule, error_m in largest_m.items() if not math.isnan(error_m)]
    return "; ".join(parts)
