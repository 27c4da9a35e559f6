"""Figures 6, 7 and 8 of the paper from the evaluation's own runs, as SVG; only figure 6 renders a clip again."""

import math
from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

import leakloc
from leakloc.background import temporal_median
from scenarios.build import true_rig
from scenarios.evaluation import Evaluation, scenario_of
from scenarios.figures import (
    ESTIMATE_COLOUR,
    PROFILE_COLOUR,
    QUIET_COLOUR,
    STYLE,
    TRUTH_COLOUR,
    brightened,
    display_gain,
    draw_columns,
    draw_view,
    profile_pictures,
    svg,
)
from scenarios.scenario import Scenario
from scenarios.simulate import simulate
from scenarios.stored_run import Run

MAX_SCENES = 10
RESIDUAL_GAIN = 6.0
METHODS = ("paper", "robust")
IMAGE_DPI = 120
MAX_RANGE_M = 5.0
"""Estimates farther from the axis are not drawn."""


def figures_of(evaluation: Evaluation) -> dict[str, str]:
    """Return all figures as SVG by the names of their files; the same results give the same bytes."""
    figures = {"figure_6": figure_6(scenario_of(evaluation))}
    for setting in evaluation.settings("separated"):
        runs = [evaluation.runs("separated", setting, method)[:MAX_SCENES] for method in METHODS]
        figures[f"figure_7_{_slug(setting)}"] = figure_7(runs, scenario_of(evaluation))
    for setting in evaluation.settings("multiple"):
        runs = [evaluation.runs("multiple", setting, method)[:MAX_SCENES] for method in METHODS]
        figures[f"figure_8_{_slug(setting)}"] = figure_8(runs, scenario_of(evaluation))
    return figures


def figure_6(scenario: Scenario) -> str:
    """Input pair, residual after background subtraction, and column profiles with the columns that the paper finds."""
    clip = simulate(scenario)
    frames = (clip.left, clip.right)
    estimate = leakloc.locate(clip.left, clip.right, clip.believed_rig, method="paper")
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.4, 8.6), layout="constrained", dpi=IMAGE_DPI)
        panels = figure.subplots(3, 2)
        for i, (side, view) in enumerate(zip(("left", "right"), frames, strict=True)):
            _draw_frames(panels[:2, i], side, view)
        for panel, picture in zip(panels[2], profile_pictures(frames, estimate, clip.truth), strict=True):
            draw_columns(panel, "true leak", picture.leaks_px, TRUTH_COLOUR, "-")
            draw_columns(panel, "its shadow", picture.shadows_px, QUIET_COLOUR, ":")
            panel.plot(picture.profile_grey, color=PROFILE_COLOUR, lw=0.8, label="column aggregate g")
            panel.axhline(picture.threshold_grey, color=ESTIMATE_COLOUR, lw=0.8, ls="--", label="threshold")
            found = [column for column in picture.found_px if 0 <= round(column) < len(picture.profile_grey)]
            heights = [picture.profile_grey[round(column)] for column in found]
            panel.plot(found, heights, "v", color=ESTIMATE_COLOUR, ms=6, label="found by the paper's method")
            panel.set_xlim(0, len(picture.profile_grey) - 1)
            panel.set_xlabel("column (px)")
        panels[2, 0].set_ylabel("grey")
        figure.legend(*panels[2, 0].get_legend_handles_labels(), loc="outside lower center", ncols=5, frameon=False)
        return svg(figure)


def figure_7(runs_of_methods: Sequence[Sequence[Run]], scenario: Scenario) -> str:
    """Top view of all leaks of all scenes with estimates and error lines, a panel a method."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.4, 5.4), layout="constrained")
        for panel, runs in zip(figure.subplots(1, len(runs_of_methods), sharey=True), runs_of_methods, strict=True):
            _draw_pedestal(panel, scenario)
            for run in runs:
                _draw_run(panel, run)
            panel.set_title(_counted(runs), fontsize=9)
            panel.set_xlabel("y (m), left is +")
        figure.axes[0].set_ylabel("x (m), away from the cameras")
        _name_marks(figure)
        return svg(figure)


def figure_8(runs_of_methods: Sequence[Sequence[Run]], scenario: Scenario) -> str:
    """Top view of each scene, a row a method, with the leaks that are missed and the fields of view."""
    n_scenes = max(map(len, runs_of_methods))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.4, 10.4 / max(n_scenes, 3) * len(runs_of_methods) + 0.6), layout="constrained")
        grid = figure.subplots(len(runs_of_methods), n_scenes, sharex=True, sharey=True, squeeze=False)
        for row, runs in zip(grid, runs_of_methods, strict=True):
            for panel, run in zip(row, runs, strict=True):
                _draw_pedestal(panel, scenario)
                _draw_run(panel, run)
                panel.set_title(_counted([run]), fontsize=8)
        _name_marks(figure)
        return svg(figure)


def _draw_frames(panels: np.ndarray, side: str, view: np.ndarray) -> None:
    """Draw the middle frame of a view and what is left of it without the background."""
    number = len(view) // 2
    gain = display_gain(view[number])
    residual = np.abs(view[number] - temporal_median(view).grey)
    pictures = ((f"frame {number}", gain, view[number]), ("|I - median|", RESIDUAL_GAIN, residual))
    for panel, (title, brighter, grey) in zip(panels, pictures, strict=True):
        panel.imshow(brighter * grey, cmap="gray", vmin=0.0, vmax=255.0, aspect="equal")
        panel.set_title(f"{side}, {title}{brightened(brighter)}", fontsize=9)
        panel.set_axis_off()


def _draw_pedestal(panel: Axes, scenario: Scenario) -> None:
    """Draw wall, cameras and fields of view."""
    radius_m, rig = scenario.pedestal.radius_m, true_rig(scenario)
    panel.add_patch(Circle((0.0, 0.0), radius_m, facecolor="#f4f1ea", edgecolor="#6b6356", linewidth=1.2))
    for camera in (rig.left, rig.right):
        draw_view(panel, camera.world_from_camera, camera.camera_matrix, scenario.rig.width_px, radius_m)
    panel.set_xlim(1.08 * radius_m, -1.08 * radius_m)  # y grows to the left, as the cameras see it
    panel.set_ylim(-1.08 * radius_m, 1.08 * radius_m)
    panel.set_aspect("equal")


def _draw_run(panel: Axes, run: Run) -> None:
    """Draw leaks, estimates and the lines between those that the paper's rule assigns to each other."""
    for leak in run.leaks:
        if leak.paper_estimate is not None:
            x_m, y_m = run.estimates_m[leak.paper_estimate]
            style = "-" if leak.code == "found" else "--"
            panel.plot([leak.y_m, y_m], [leak.x_m, x_m], color=ESTIMATE_COLOUR, lw=1.0, ls=style)
    used = {leak.paper_estimate for leak in run.leaks}
    false = [place for i, place in enumerate(run.estimates_m) if i not in used]
    found = [leak for leak in run.leaks if leak.paper_estimate is not None]
    missed = [leak for leak in run.leaks if leak.paper_estimate is None]
    for label, leaks, colour in (("leak", found, TRUTH_COLOUR), ("leak, missed", missed, QUIET_COLOUR)):
        places = [leak.y_m for leak in leaks], [leak.x_m for leak in leaks]
        panel.plot(*places, "o" if leaks is found else "s", ms=7, mec=colour, mfc="none", mew=1.4, label=label)
    marks = [place for i, place in enumerate(run.estimates_m) if i in used]
    for label, places_m, mark in (("estimate", marks, "x"), ("estimate, false", false, "+")):
        inside = np.array([place for place in places_m if math.hypot(*place) < MAX_RANGE_M]).reshape(-1, 2)
        panel.plot(inside[:, 1], inside[:, 0], mark, color=ESTIMATE_COLOUR, ms=6, mew=1.3, label=label)


def _counted(runs: Sequence[Run]) -> str:
    leaks = [leak for run in runs for leak in run.leaks]
    in_view = [leak for leak in leaks if leak.in_view]
    found = sum(leak.paper_estimate is not None for leak in leaks)
    found_in_view = sum(leak.paper_estimate is not None for leak in in_view)
    method = runs[0].method if runs else ""
    return f"{method}: {found} of {len(leaks)}, in view {found_in_view} of {len(in_view)}"


def _name_marks(figure: Figure) -> None:
    handles, labels = figure.axes[0].get_legend_handles_labels()
    once = dict(zip(labels, handles, strict=True))
    figure.legend(list(once.values()), list(once), loc="outside lower center", ncols=4, frameon=False)


def _slug(setting: str) -> str:
    return setting.split(maxsplit=1)[0]
