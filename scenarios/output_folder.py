"""Output folders that appear whole or not at all, and never take the place of something the tool did not make."""

import glob
import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

from leakloc.outside_file import read_json

MARKERS = (
    *("clip.json", "dataset.json", "demo.json", "noise.json", "export.json", "tables.json"),
    *("hunt.json", "shrunk.json", "envelope.json"),
)
"""A folder that the tool made holds one of these, with a key "made_by"."""

MAX_MARKER_BYTES = 6_000_000
"""Of a data set of 100 000 clips some 2 000 000."""

MAX_NAME_BYTES = 200
"""File systems bear 255; what is not whole yet has a longer name beside it."""


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
    check_new(destination)
    with _staged(destination) as folder:
        yield folder


@contextmanager
def replacing(destination: Path) -> Iterator[Path]:
    """Like `creating`, but a folder that the tool made before is replaced, by renaming, once the new one is whole."""
    check_replaceable(destination)
    with _staged(destination) as folder:
        yield folder


def was_made_by_us(folder: Path) -> bool:
    """Whether a folder holds a marker file of this tool."""
    return bool(_markers(folder))


def _markers(folder: Path) -> set[str]:
    """Names of the tool's marker files in a folder: they tell a clip from a data set, a demo or noisy frames."""
    return {name for name in MARKERS if str(_content_of(folder / name).get("made_by", "")).startswith("leakloc ")}


def _content_of(path: Path) -> dict[str, Any]:
    """Content of a JSON file, empty where there is none or it holds no table."""
    try:
        content = read_json(path, MAX_MARKER_BYTES)
    except ValueError:
        return {}
    return content if isinstance(content, dict) else {}


def write_file(path: Path, content: bytes | str) -> None:
    """Write a file whole or not at all: temporary name, fsync, rename."""
    check_target(path)
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


def check_target(path: Path) -> None:
    """Refuse a file to write whose folder is missing, that is no regular file, or that belongs to a clip."""
    _check_name(path)
    if not path.parent.is_dir():
        raise OutputError(f"{path}: its folder does not exist")
    # what is renamed to a link takes the link's place: as root, that of /dev/stdout
    if os.path.lexists(path) and (path.is_symlink() or not path.is_file()):
        raise OutputError(f"{path}: must be a regular file, not a folder, device or link")
    for clip, name in ((path.parent, path.name), (path.parent.parent, f"{path.parent.name}/{path.name}")):
        manifest = _content_of(clip / "clip.json")
        if manifest and name in {"clip.json", *_names(manifest.get("files"))}:
            raise OutputError(f"{path}: belongs to the clip {clip}; a clip is replaced as a whole or not at all")


def _names(files: Any) -> list[str]:
    return list(files) if isinstance(files, dict) else []


def check_new(destination: Path) -> None:
    """Refuse a folder to create that is taken: before the work, not after it."""
    if _is_taken(destination):
        raise OutputError(f"{destination}: already exists; use --force to replace what leakloc made there")


def check_replaceable(destination: Path) -> None:
    """Refuse a folder to replace that holds something the tool did not make."""
    if _is_taken(destination) and not was_made_by_us(destination):
        raise OutputError(f"{destination}: is not empty and was not made by leakloc; it is never replaced")


def check_destination(destination: Path, marker: str, *, force: bool) -> None:
    """Refuse a folder to make, before the work, that is taken; with `force` one that is not of the kind to come.

    `marker` is the marker file of that kind. Raises OutputError.
    """
    (check_replaceable if force else check_new)(destination)
    if (there := _markers(destination)) and there != {marker}:
        raise OutputError(f"{destination}: is something else that leakloc made; it is not replaced by this")


def check_apart(source: Path, destination: Path) -> None:
    """Refuse an output that is its own input, or inside it, or around it."""
    here, there = (Path(os.path.realpath(path)) for path in (source, destination))  # bears links in a circle
    if here == there or here in there.parents or there in here.parents:
        raise OutputError(f"{destination}: must be apart from {source}")


def write_json(path: Path, content: Any) -> None:
    """Write JSON (no NaN: undefined is null) whole or not at all."""
    write_file(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def _check_name(path: Path) -> None:
    if path.name in ("", "..") or len(os.fsencode(path.name)) > MAX_NAME_BYTES:
        raise OutputError(f"{path}: must end in a name of its own, of at most {MAX_NAME_BYTES} bytes")


def _is_taken(destination: Path) -> bool:
    _check_name(destination)
    around = next(folder for folder in destination.absolute().parents if folder.exists())
    if not (around.is_dir() and os.access(around, os.W_OK)):
        raise OutputError(f"{destination}: cannot be made: {around} is no folder that may be written to")
    _remove_leftovers(destination)
    if destination.is_symlink() or (destination.exists() and not destination.is_dir()):
        raise OutputError(f"{destination}: must be a folder, not a file or link")
    return destination.is_dir() and any(destination.iterdir())


@contextmanager
def _staged(destination: Path) -> Iterator[Path]:
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
    """Rename into place; what was there is put back when that fails.

    A kill between the two renames leaves `.NAME.old-PID`, which the next run puts back.
    """
    if destination.exists() and any(destination.iterdir()) and _markers(folder) != _markers(destination):
        raise OutputError(f"{destination}: is something else that leakloc made; it is not replaced by this")
    old = destination.with_name(f".{destination.name}.old-{os.getpid()}")
    if destination.exists():
        destination.rename(old)
    try:
        folder.rename(destination)
    except OSError:
        if old.exists():
            old.rename(destination)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _remove_leftovers(destination: Path) -> None:
    """Remove what a killed run staged, and put back what it had moved aside; a run that still lives keeps its own."""
    for kind in ("partial", "old"):
        for leftover in destination.parent.glob(f".{glob.escape(destination.name)}.{kind}-*"):
            pid = leftover.name.rpartition("-")[2]
            if not pid.isdecimal() or is_alive(int(pid)) or not leftover.is_dir():
                continue
            if kind == "old" and not destination.exists():
                leftover.rename(destination)
            else:
                shutil.rmtree(leftover, ignore_errors=True)


def is_alive(pid: int) -> bool:
    """Whether a process of this number runs on this machine."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
