"""Files that others wrote: opened only when they are regular and small, read as data, and never waited for.

A path may lead anywhere: a pipe hangs its reader, a device has no end, a sparse file is large for nothing, and JSON of
a few megabytes can be gigabytes of objects or nest deeper than Python recurses.
"""

from __future__ import annotations

import json
import math
import os
import stat
from pathlib import Path
from typing import Any

MAX_DEPTH = 32
"""Of tables and lists in one another; no format of ours comes near."""


def read_regular_file(path: Path, max_bytes: int) -> bytes:
    """The bytes of a regular file; a pipe or a device is refused, and never waited for.

    Raises ValueError with what is wrong, without the file's name.
    """
    try:
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
        try:
            status = os.fstat(handle)
            if not stat.S_ISREG(status.st_mode):
                raise ValueError("must be a regular file")
            with open(handle, "rb", closefd=False) as file:
                content = file.read(max_bytes + 1) if status.st_size <= max_bytes else b""
        finally:
            os.close(handle)
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror}") from None
    if max(len(content), status.st_size) > max_bytes:
        raise ValueError(f"must be at most {max_bytes} bytes")
    return content


def read_json(path: Path, max_bytes: int) -> Any:
    """The content of a JSON file: finite numbers, nested at most 32 deep.

    Raises ValueError as `read_regular_file` does.
    """
    content = read_regular_file(path, max_bytes)
    try:
        data = json.loads(content, parse_constant=_refuse, parse_float=_finite)
    except RecursionError:
        raise ValueError("not JSON: nested too deeply") from None
    except json.JSONDecodeError as error:
        raise ValueError(f"not JSON: {error}") from None
    except UnicodeDecodeError as error:
        raise ValueError(f"not JSON: must be UTF-8 text: byte {error.start} is not") from None
    check_depth(data)
    return data


def check_depth(data: Any) -> None:
    """Raise ValueError unless plain data nests so little that any function may walk through it by calling itself."""
    level = [data]
    for _ in range(MAX_DEPTH):
        level = [inner for outer in level if isinstance(outer, dict | list) for inner in _inside(outer)]
        if not level:
            return
    raise ValueError(f"nested too deeply: at most {MAX_DEPTH} tables and lists in one another")


def _inside(outer: dict[str, Any] | list[Any]) -> Any:
    return outer.values() if isinstance(outer, dict) else outer


def _refuse(literal: str) -> float:
    raise ValueError(f"numbers must be finite or null, got {literal:.40}")


def _finite(literal: str) -> float:
    return number if math.isfinite(number := float(literal)) else _refuse(literal)
