"""Output folders that appear whole or not at all, and never take the place of something the tool did not make."""

import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

MARKERS = ("clip.json", "dataset.json", "demo.json", "noise.json")
"""A folder that the tool made holds one of these, with a key "made_by"."""


class OutputError(ValueError):
    """An output that must not or cannot be written; the message names the path and the rule."""


def made_by() -> str:
    """Name and version of this tool, as every marker file states it."""
    return f"leakloc {version('leakloc')}"


@contextmanager
def creating(destination: Path) -> Iterator[Path]:
    """Yield an empty folder that becomes `destination` when the block ends well, and vanishes when it does not.

    Raises OutputError when the destination exists and is not an empty folder.
    """
    if _is_taken(destination):
        raise OutputError(f"{destination}: already exists; use --force to replace what leakloc made there")
    with _staged(destination) as folder:
        yield folder


@contextmanager
def replacing(destination: Path) -> Iterator[Path]:
    """Like `creating`, but a folder that the tool made before is replaced, by renaming, once the new one is whole."""
    if _is_taken(destination) and not was_made_by_us(destination):
        raise OutputError(f"{destination}: is not empty and was not made by leakloc; it is never replaced")
    with _staged(destination) as folder:
        yield folder


def was_made_by_us(folder: Path) -> bool:
    """Whether a folder holds a marker file of this tool."""
    for marker in MARKERS:
        path = folder / marker
        if path.is_file() and path.stat().st_size < 100_000_000:
            try:
                content = json.loads(path.read_text(encoding="utf-8"))
            except (ValueError, OSError, RecursionError):
                continue
            if isinstance(content, dict) and str(content.get("made_by", "")).startswith("leakloc "):
                return True
    return False


def write_file(path: Path, content: bytes | str) -> None:
    """Write a file whole or not at all: temporary name, fsync, rename."""
    raw = content.encode() if isinstance(content, str) else content
    partial = path.with_name(f".{path.name}.partial-{os.getpid()}")
    try:
        with partial.open("wb") as stream:
            stream.write(raw)
            stream.flush()
            os.fsync(stream.fileno())
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise OutputError(f"{path}: cannot be written: {error.strerror}") from None


def write_json(path: Path, content: Any) -> None:
    """Write JSON (no NaN: undefined is null) whole or not at all."""
    write_file(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def _is_taken(destination: Path) -> bool:
    if destination.is_symlink() or (destination.exists() and not destination.is_dir()):
        raise OutputError(f"{destination}: must be a folder, not a file or link")
    return destination.is_dir() and any(destination.iterdir())


@contextmanager
def _staged(destination: Path) -> Iterator[Path]:
    _remove_leftovers(destination)
    folder = destination.with_name(f".{destination.name}.partial-{os.getpid()}")
    try:
        destination.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir()
    except OSError as error:
        raise OutputError(f"{destination}: cannot be made: {error.strerror}") from None
    try:
        yield folder
        _put_in_place(folder, destination)
    except OSError as error:
        raise OutputError(f"{error.filename or destination}: cannot be written: {error.strerror}") from None
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _put_in_place(folder: Path, destination: Path) -> None:
    old = destination.with_name(f".{destination.name}.old-{os.getpid()}")
    if destination.exists():
        destination.rename(old)
    folder.rename(destination)
    shutil.rmtree(old, ignore_errors=True)


def _remove_leftovers(destination: Path) -> None:
    """Remove what a killed run staged for the same destination; a run that still lives keeps its own."""
    for leftover in destination.parent.glob(f".{destination.name}.partial-*"):
        pid = leftover.name.rpartition("-")[2]
        if pid.isdecimal() and not _is_alive(int(pid)) and leftover.is_dir():
            shutil.rmtree(leftover, ignore_errors=True)


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
