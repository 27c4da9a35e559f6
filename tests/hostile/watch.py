"""Every file that a piece of code writes, makes, moves or removes, by Python's own audit of itself."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
PATHS = {"os.mkdir": 1, "os.rename": 2, "os.remove": 1, "os.rmdir": 1, "os.link": 2, "os.symlink": 2, "os.truncate": 1}

_touched: list[str] | None = None


def _note(event, arguments):
    if _touched is None:
        return
    if event == "open" and isinstance(arguments[0], str | bytes) and (arguments[2] or 0) & WRITING:
        _touched.append(os.fsdecode(arguments[0]))
    elif event in PATHS:
        paths = arguments[: PATHS[event]]
        _touched.extend(os.fsdecode(path) for path in paths if isinstance(path, str | bytes | os.PathLike))


sys.addaudithook(_note)  # there is no taking it back, so it looks away unless it is asked


@contextmanager
def watching() -> Iterator[list[Path]]:
    """Yield a list that holds, when the block has ended, what was touched."""
    global _touched
    found: list[Path] = []
    _touched, before = [], sys.dont_write_bytecode
    sys.dont_write_bytecode = True
    try:
        yield found
    finally:
        found += [Path(os.path.abspath(path)) for path in _touched]
        _touched, sys.dont_write_bytecode = None, before
