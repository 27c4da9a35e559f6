"""result.json: an estimate as a file, for other programs and for scoring. Undefined is null."""

from __future__ import annotations

import json
import math
import os
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from leakloc.estimate import FRAMES_OF_REFERENCE, Estimate, LeakEstimate
from leakloc.outside_file import read_json

MAX_RESULT_BYTES = 6 << 20  # of the most leaks; twenty times as much in memory at the worst
MAX_LEAKS = 10_000

UNDEFINED = float("nan")
PLACE_KEYS = ("x_m", "y_m")
OTHER_NUMBERS = ("score", "left_column_px", "right_column_px", "column_sigma_px")


class ResultError(ValueError):
    """A result file that cannot be used: names the file, the key, the rule and the value."""


def write_result(estimate: Estimate, path: str | os.PathLike[str]) -> None:
    """Write an estimate as result.json: under a temporary name beside it, flushed to the disk, then renamed.

    A killed run leaves the old file or the new one, never half of one. Raises OSError.
    """
    path = Path(path)
    text = json.dumps(_as_json(estimate), allow_nan=False, indent=1) + "\n"
    handle, temporary = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fchmod(file.fileno(), 0o644)  # mkstemp makes it private
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def read_result(path: str | os.PathLike[str]) -> Estimate:
    """Read result.json, from this program or another: null becomes NaN, keys that are not known are left out.

    Raises ResultError naming file, key, value and rule: not a regular file, over 6 MiB, not JSON, missing keys,
    numbers that are not finite, more than 10 000 leaks.
    """
    path = Path(path)
    try:
        return _estimate_from(read_json(path, MAX_RESULT_BYTES))
    except ValueError as error:
        raise ResultError(f"{path}: {error}") from None


def result_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of result.json."""
    number, undefined = {"type": "number"}, {"type": ["number", "null"]}
    row = {"type": "array", "items": undefined, "minItems": 2, "maxItems": 2}
    covariance = {"oneOf": [{"type": "null"}, {"type": "array", "items": row, "minItems": 2, "maxItems": 2}]}
    leak: dict[str, Any] = dict.fromkeys(PLACE_KEYS, number)
    leak |= {"covariance_m2": covariance} | dict.fromkeys(OTHER_NUMBERS, undefined)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Estimated leaks of one clip; undefined is null",
        "type": "object",
        "required": ["method", "frame", "leaks", "diagnostics"],
        "properties": {
            "method": {"type": "string"},
            "frame": {"enum": list(FRAMES_OF_REFERENCE)},
            "leaks": {
                "type": "array",
                "maxItems": MAX_LEAKS,
                "items": {"type": "object", "required": list(leak), "properties": leak},
            },
            "diagnostics": {"type": "object"},
        },
    }


def _as_json(estimate: Estimate) -> dict[str, Any]:
    leaks = []
    for leak in estimate.leaks:
        numbers = {key: _null_if_undefined(getattr(leak, key)) for key in (*PLACE_KEYS, *OTHER_NUMBERS)}
        unknown = np.isnan(leak.covariance_m2).all()
        numbers["covariance_m2"] = None if unknown else _null_if_undefined(leak.covariance_m2)
        leaks.append(numbers)
    return {
        "method": estimate.method,
        "frame": estimate.frame,
        "leaks": leaks,
        "diagnostics": _null_if_undefined(estimate.diagnostics),
    }


def _null_if_undefined(value: Any) -> Any:
    """Plain data as JSON has it: arrays to lists, NaN to null."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {key: _null_if_undefined(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_null_if_undefined(entry) for entry in value]
    return None if isinstance(value, float) and math.isnan(value) else value


def _nan_if_null(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _nan_if_null(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_nan_if_null(entry) for entry in value]
    return UNDEFINED if value is None else value


def _estimate_from(content: Any) -> Estimate:
    _need_keys("the file", content, result_schema()["required"])
    method, frame, leaks, diagnostics = (content[key] for key in ("method", "frame", "leaks", "diagnostics"))
    if not isinstance(method, str):
        raise ResultError(f"method must be a text, got {method!r:.80}")
    if frame not in FRAMES_OF_REFERENCE:
        raise ResultError(f"frame must be one of {', '.join(FRAMES_OF_REFERENCE)}, got {frame!r:.80}")
    if not isinstance(leaks, list) or len(leaks) > MAX_LEAKS:
        raise ResultError(f"leaks must be a list of at most {MAX_LEAKS}")
    if not isinstance(diagnostics, dict):
        raise ResultError(f"diagnostics must be an object, got {diagnostics!r:.80}")
    found = tuple(_leak_from(f"leaks[{index}]", leak) for index, leak in enumerate(leaks))
    return Estimate(method, frame, found, _nan_if_null(diagnostics))


def _leak_from(where: str, leak: Any) -> LeakEstimate:
    _need_keys(where, leak, [*PLACE_KEYS, "covariance_m2", *OTHER_NUMBERS])
    numbers = {key: _number_or_undefined(f"{where}.{key}", leak[key]) for key in (*PLACE_KEYS, *OTHER_NUMBERS)}
    for key in PLACE_KEYS:
        if math.isnan(numbers[key]):
            raise ResultError(f"{where}.{key} must be a number, got null")
    return LeakEstimate(covariance_m2=_covariance(f"{where}.covariance_m2", leak["covariance_m2"]), **numbers)


def _need_keys(where: str, value: Any, keys: list[str]) -> None:
    if not isinstance(value, dict):
        raise ResultError(f"{where} must be an object, got {value!r:.80}")
    missing = [key for key in keys if key not in value]
    if missing:
        raise ResultError(f"{where} must have the keys {', '.join(missing)}")


def _number_or_undefined(where: str, value: Any) -> float:
    if value is None:
        return UNDEFINED
    if isinstance(value, bool) or not isinstance(value, int | float) or abs(value) > sys.float_info.max:
        raise ResultError(f"{where} must be a finite number or null, got {value!r:.80}")
    return float(value)


def _covariance(where: str, value: Any) -> np.ndarray:
    if value is None:
        return np.full((2, 2), np.nan)
    if not (
        isinstance(value, list) and len(value) == 2 and all(isinstance(row, list) and len(row) == 2 for row in value)
    ):
        raise ResultError(f"{where} must be 2 x 2 numbers or null, got {value!r:.80}")
    return np.array([[_number_or_undefined(where, entry) for entry in row] for row in value])
