"""What the robust method says of a clip's condition, as a text for people."""

import math
from collections.abc import Mapping
from typing import Any


def condition_table(diagnostics: Mapping[str, Any]) -> str:
    """Return cameras, step, tilt, row offset and every line seen with its verdict, from the method's diagnostics."""
    rows = [f"{view + ' camera':<15}{_camera(state)}" for view, state in diagnostics.get("condition", {}).items()]
    if step := diagnostics.get("step"):
        rows.append(f"{'step':<15}{_step(step)}")
    if level := diagnostics.get("levelling"):
        rows.append(f"{'rig':<15}{_tilt(level)}")
    if offset := diagnostics.get("row_offset"):
        size = f"{_signed(offset.get('rows'))} +- {_number(offset.get('sigma_rows'))} rows"
        rows.append(f"{'row offset':<15}{size} between the views (0: they are rectified)")
    if fall := diagnostics.get("free_fall"):
        rows.append(f"{'free fall':<15}{_fall(fall)}")
    lines = diagnostics.get("lines", [])
    rows.append(f"{'lines':<15}{len(lines)} seen in both views")
    for line in lines:
        place = f"{_number(line.get('x_m'), 8)} {_number(line.get('y_m'), 8)} m"
        columns = f"columns {_number(line.get('left_column_px'), 7)} {_number(line.get('right_column_px'), 7)}"
        rows.append(f"{'':<15}{place}  {columns}  {_number(line.get('sigmas'), 5)} sigma  {line.get('verdict', '')}")
    return "\n".join(rows)


def _camera(state: Mapping[str, Any]) -> str:
    words = [str(state.get("state", "unknown"))]
    if repeated := state.get("repeated_frames"):
        words.append(f"frames that repeat the one before: {', '.join(map(str, repeated))}")
    if jumps := state.get("exposure_jumps"):
        words.append(f"frames of another exposure: {', '.join(map(str, jumps))}")
    return "; ".join(words)


def _step(step: Mapping[str, Any]) -> str:
    frames = step.get("frames")
    if frames is None:
        return "unknown: too little falls"
    return "the views are in step" if not frames else f"the right view is {frames:+g} frames off"


def _tilt(level: Mapping[str, Any]) -> str:
    turns = [
        f"{name} {_signed(level.get(f'{name}_deg'))} +- {_number(level.get(f'{name}_sigma_deg'))} deg"
        for name in ("roll", "pitch")
    ]
    used = "taken into account" if level.get("applied") else "not taken into account"
    return f"{', '.join(turns)} against the believed rig, by {level.get('lines', 0)} lines; {used}"


def _fall(fall: Mapping[str, Any]) -> str:
    rate = fall.get("frames_per_s")
    if rate is None or not math.isfinite(rate):
        return "tells nothing: too little falls"
    error = f"{_number(rate)} +- {_number(fall.get('sigma'))}"
    height = _number(fall.get("leak_height_m"))
    return f"drops obey gravity at {error} frames/s, from {height} m above the cameras: compare the recording's rate"


def _number(value: float | None, width: int = 0) -> str:
    return f"{'-':>{width}}" if value is None else f"{value:{width}.2f}"


def _signed(value: float | None) -> str:
    return "-" if value is None else f"{value:+.2f}"
