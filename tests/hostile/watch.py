"""Every file that a piece of code writes, makes, moves or removes, by Python's own audit of itself."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
# events and, of each path among their arguments, where it stands and where the folder that it starts from does
PATHS = {
    "os.mkdir": ((0, 2),),
    "os.rename": ((0, 2), (1, 3)),
    "os.remove": ((0, 1),),
    "os.rmdir": ((0, 1),),
    "os.link": ((1, 3),),
    "os.symlink": ((1, 2),),
}

_touched: list[str] | None = None


def _note(event, arguments):
    if _touched is None:
        return
    if event == "open" and isinstance(arguments[0], str | bytes) and (arguments[2] or 0) & WRITING:
        _touched.append(os.path.abspath(os.fsdecode(arguments[0])))
    for path, start in PATHS.get(event, ()):
        folder = os.getcwd() if arguments[start] < 0 else os.readlink(f"/proc/self/fd/{arguments[start]}")
        _touched.append(os.path.normpath(os.path.join(folder, os.fsdecode(arguments[path]))))


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
        found += map(Path, _touched)
        _touched, sys.dont_write_bytecode = None, before
