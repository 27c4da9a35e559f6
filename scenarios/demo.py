"""The demonstration: one scene from simulation to score, with a report to look at."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import leakloc
from scenarios.clip_folder import write_clip
from scenarios.output_folder import creating, made_by, write_file, write_json
from scenarios.progress import stages
from scenarios.report import Located, positions, report_html
from scenarios.scenario_file import read_scenario
from scenarios.score import score, table
from scenarios.simulate import SimulatedClip, simulate

SCENARIO = "separated"


def run_demo(
    destination: Path, new_folder: Callable[[Path], AbstractContextManager[Path]], seed: int | None = None
) -> str:
    """Simulate, locate, score and report; returns the table and where the report is."""
    with new_folder(destination) as folder, stages("demo", 5) as stage:
        stage("simulate the clip")
        clip = simulate(read_scenario(SCENARIO, seed=seed))
        stage("locate the leaks")
        methods = [_located(clip, method) for method in leakloc.METHODS]
        stage("write the report")
        write_file(folder / "report.html", report_html(methods))
        leakloc.write_result(methods[0].estimate, folder / "result.json")
        stage("write the clip")
        write_clip(clip, folder / "clip", creating)
        stage("done")
        write_json(folder / "demo.json", {"made_by": made_by(), "seed": clip.scenario.seed})
    tables = [f"method {one.estimate.method}\n{table(one.scored, clip.truth)}\n" for one in methods]
    return "\n".join([*tables, f"report: {destination / 'report.html'}"])


def _located(clip: SimulatedClip, method: str) -> Located:
    estimate = leakloc.locate(clip.left, clip.right, clip.believed_rig, method=method)
    return Located(clip, estimate, score(positions(estimate), clip.truth))
