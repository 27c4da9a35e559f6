"""Detection and error against the swept axis, an SVG a campaign: a row of panels for each setting of the other axes."""

from collections.abc import Sequence
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scenarios.campaign import Campaign, Value
from scenarios.campaign_summary import Cell, Found
from scenarios.figures import ESTIMATE_COLOUR, PROFILE_COLOUR, QUIET_COLOUR, STYLE, svg
from scenarios.stored_run import COUNTED

MAX_ROWS = 12
COLOURS = (PROFILE_COLOUR, ESTIMATE_COLOUR, QUIET_COLOUR, "#8a5a00", "#5b2a86", "#0b6e4f")
DODGE = 0.012
"""Shift between methods, as a share of the axis: bars that coincide hide each other."""


def main_axis(cells: Sequence[Cell]) -> str | None:
    """Name of the axis with the most places; None when nothing is swept."""
    places: dict[str, set[Value]] = {axis: set() for cell in cells for axis in cell.values}
    for cell in cells:
        for axis, value in cell.values.items():
            places[axis].add(value)
    swept = {axis: len(values) for axis, values in places.items() if len(values) > 1}
    return max(swept, key=lambda axis: swept[axis]) if swept else None


@dataclass(frozen=True)
class Look:
    """How a method is drawn: its name, its colour, and the line style between places, none where they have no order."""

    label: str
    colour: str
    line: str


def sweep_figure(campaign: Campaign, cells: Sequence[Cell], axis: str) -> str:
    """Return the panels of a campaign against one axis, as SVG; what the other axes are is beside each row."""
    rows = dict(list(_rows(cells, axis).items())[:MAX_ROWS])
    methods = list(dict.fromkeys(cell.method for cell in cells))
    line = "-" if _is_numeric(_values(cells, axis)) else ""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.4, (0.5 if line else 1.5) + 2.3 * len(rows)), layout="constrained")
        panels = figure.subplots(len(rows), len(COUNTED) + 1, squeeze=False, sharex=True, sharey="col")
        for (others, row_cells), row in zip(rows.items(), panels, strict=True):
            for i, method in enumerate(methods):
                mine = [cell for cell in row_cells if cell.method == method]
                places = _places(cells, axis, mine) + _shift(cells, axis, i - (len(methods) - 1) / 2.0)
                _draw_row(row, places, mine, Look(method, COLOURS[i % len(COLOURS)], line))
            row[0].set_ylabel(f"{others}\nshare" if others else "share")
        for panel, title in zip(panels[0], (*map(_title, COUNTED), "error (m)"), strict=True):
            panel.set_title(title, fontsize=9)
        panels[0][-1].set_ylim(bottom=0.0)
        for panel in panels[-1]:
            _name_places(panel, campaign, cells, axis)
        figure.legend(*panels[0][0].get_legend_handles_labels(), loc="outside upper right", ncols=6, frameon=False)
        return svg(figure)


def short(axis: str) -> str:
    """Name of an axis without the table that its key is in."""
    return axis.rpartition(".")[2]


def caption(cells: Sequence[Cell], axis: str) -> str:
    """Say what is drawn, and what is not."""
    n_rows = len(_rows(cells, axis))
    left_out = f" Drawn are the first {MAX_ROWS} of {n_rows} settings of the other axes." if n_rows > MAX_ROWS else ""
    return (
        "Dots, with 95 % intervals (Clopper-Pearson): share of the clips in which every leak that counts is found. "
        "Dotted lines or dashes: share of those leaks. Error: median over clips of the mean error of the leaks found, "
        f"with the distribution-free 95 % interval of the median (none with fewer than 6 clips).{left_out}"
    )


def _rows(cells: Sequence[Cell], axis: str) -> dict[str, list[Cell]]:
    """Cells by what the other axes are."""
    rows: dict[str, list[Cell]] = {}
    for cell in cells:
        others = "\n".join(f"{short(name)} {value}" for name, value in cell.values.items() if name != axis)
        rows.setdefault(others, []).append(cell)
    return rows


def _values(cells: Sequence[Cell], axis: str) -> list[Value]:
    return list(dict.fromkeys(cell.values[axis] for cell in cells))


def _is_numeric(values: Sequence[Value]) -> bool:
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)


def _places(cells: Sequence[Cell], axis: str, mine: Sequence[Cell]) -> np.ndarray:
    """Places along the axis: values where they are numbers, else one step apart."""
    values = _values(cells, axis)
    if _is_numeric(values):
        return np.array([float(cell.values[axis]) for cell in mine])
    return np.array([float(values.index(cell.values[axis])) for cell in mine])


def _shift(cells: Sequence[Cell], axis: str, steps: float) -> float:
    return DODGE * steps * float(np.ptp(_places(cells, axis, cells)))


def _title(which: str) -> str:
    return {"all": "all leaks", "in_view": "leaks in view", "observable": "observable leaks"}[which]


def _draw_row(row: np.ndarray, places: np.ndarray, cells: Sequence[Cell], look: Look) -> None:
    """Draw one method into the panels of one row, along the axis from its lowest place on."""
    order = np.argsort(places)
    places, ordered = places[order], [cells[i] for i in order]
    for which, panel in zip(COUNTED, row, strict=False):
        _draw_rate(panel, places, [cell.found[which] for cell in ordered], look)
    median, low, high = np.array([cell.median_error_m for cell in ordered]).reshape(-1, 3).T
    row[-1].plot(places, median, f"o{look.line}", color=look.colour, ms=3, lw=1.2)
    row[-1].vlines(places, low, high, color=look.colour, linewidth=0.8)


def _draw_rate(panel: Axes, places: np.ndarray, found: Sequence[Found], look: Look) -> None:
    leaks = [part.leaks / part.of_leaks if part.of_leaks else np.nan for part in found]
    clips = np.array([part.clips / part.of_clips if part.of_clips else np.nan for part in found])
    panel.plot(places, leaks, ":" if look.line else "_", color=look.colour, lw=1.0, ms=7)
    low, high = np.array([part.interval for part in found]).reshape(-1, 2).T
    bars = np.abs(np.array([clips - low, high - clips]))  # a rate of 0 or 1 may lie outside by rounding
    panel.errorbar(
        *(places, clips, bars), color=look.colour, fmt=f"o{look.line}", ms=3, lw=1.2, elinewidth=0.8, label=look.label
    )
    panel.set_ylim(-0.03, 1.03)


def _name_places(panel: Axes, campaign: Campaign, cells: Sequence[Cell], axis: str) -> None:
    label = next((table.label for table in campaign.axis if table.key == axis and table.label), axis)
    panel.set_xlabel(label)
    values = _values(cells, axis)
    if not _is_numeric(values):
        panel.set_xticks(range(len(values)), [str(value) for value in values], rotation=90, fontsize=7)
