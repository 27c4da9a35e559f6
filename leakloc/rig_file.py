"""rig.yaml: the believed rig in OpenCV's FileStorage (YAML or XML), as stereoCalibrate users write it.

OpenCV's parser is recursive and crashes the process on deeply nested text, and believes any matrix size that a file
claims. So the text is measured before the parser sees it, and matrices are read entry by entry.
"""

from __future__ import annotations

import math
import os
import re
from pathlib import Path

import cv2
import numpy as np

from leakloc.outside_file import read_regular_file
from leakloc.rig import MAX_LAMPS, Array, Rig, RigError

MAX_RIG_BYTES = 1 << 20
MAX_OPENINGS = 500  # of brackets or tags; OpenCV's parser survives 1000 levels on a stack of 512 KiB
MAX_LINE_CHARACTERS = 2000  # "- - - ..." nests once every two characters
MAX_MATRIX_ENTRIES = 4 * MAX_LAMPS

REQUIRED_KEYS = ("K1", "D1", "K2", "D2", "R", "T", "image_size")


def read_rig(path: str | os.PathLike[str]) -> Rig:
    """Read a believed rig from OpenCV FileStorage YAML or XML (`Rig` says what its keys mean).

    `world_from_left`, `lamps` and `pedestal_radius` may be missing. Raises RigError naming the file, the key, the
    value and the rule: not a regular file, over 1 MiB, not YAML or XML, missing keys, and whatever `Rig` refuses.
    """
    text = _text_of(Path(path))
    try:
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    except (cv2.error, SystemError) as error:  # the bindings wrap a parser's cv2.error in a SystemError
        raise RigError(f"{path}: not OpenCV FileStorage YAML or XML{_reason(error)}") from None
    try:
        return _rig_from(storage)
    except RigError as error:
        raise RigError(f"{path}: {error}") from None
    finally:
        storage.release()


def write_rig(rig: Rig, path: str | os.PathLike[str]) -> None:
    """Write a rig as OpenCV FileStorage YAML that `read_rig` reads back to the bit. Raises OSError."""
    storage = cv2.FileStorage("", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY | cv2.FILE_STORAGE_FORMAT_YAML)
    for key in ("K1", "D1", "K2", "D2", "R"):
        storage.write(key, np.atleast_2d(getattr(rig, key)))
    storage.write("T", rig.T.reshape(3, 1))  # a column as stereoCalibrate writes it; older readers know no vectors
    storage.startWriteStruct("image_size", cv2.FileNode_SEQ | cv2.FileNode_FLOW)
    for side_px in rig.image_size:
        storage.write("", side_px)
    storage.endWriteStruct()
    if rig.world_from_left is not None:
        storage.write("world_from_left", np.array(rig.world_from_left))
    if rig.lamps is not None:
        storage.write("lamps", np.array(rig.lamps))
    if rig.pedestal_radius is not None:
        storage.write("pedestal_radius", rig.pedestal_radius)
    Path(path).write_text(storage.releaseAndGetString(), encoding="utf-8")


def _text_of(path: Path) -> str:
    """The text of a regular file that is small and flat enough for OpenCV's parser."""
    try:
        text = read_regular_file(path, MAX_RIG_BYTES).decode("utf-8")
    except UnicodeDecodeError:
        raise RigError(f"{path}: not OpenCV FileStorage YAML or XML: not UTF-8 text") from None
    except ValueError as error:
        raise RigError(f"{path}: {error}") from None
    if "\x00" in text:
        raise RigError(f"{path}: not OpenCV FileStorage YAML or XML: holds a NUL byte")
    if not text.strip() or text.lstrip()[0] == "{":
        raise RigError(f"{path}: not OpenCV FileStorage YAML or XML: {'JSON' if text.strip() else 'empty'}")
    openings = len(re.findall(r"[\[{]|<[^/]", text))
    if openings > MAX_OPENINGS or max(map(len, re.split(r"[\r\n]", text))) > MAX_LINE_CHARACTERS:
        raise RigError(
            f"{path}: must have at most {MAX_OPENINGS} brackets and tags and lines of {MAX_LINE_CHARACTERS} characters"
        )
    return text


def _reason(error: BaseException) -> str:
    """The parser's own words, without OpenCV's file and line."""
    found = re.search(r"error: \(-?\d+:[^)]*\)\s*(.+?)(?: in function|$)", str(error.__cause__ or error))
    return f": {found[1].strip()}" if found else ""


def _rig_from(storage: cv2.FileStorage) -> Rig:
    if not storage.isOpened() or not storage.root().isMap():
        raise RigError("not OpenCV FileStorage YAML or XML: no keys at the top")
    present = set(storage.root().keys())
    missing = [key for key in REQUIRED_KEYS if key not in present]
    if missing:
        raise RigError(f"{', '.join(missing)} must be given, got only {', '.join(sorted(present)) or 'nothing'}")

    def matrix(key: str) -> Array:
        return _matrix(key, storage.getNode(key))

    size = storage.getNode("image_size")
    image_size = matrix("image_size").ravel().tolist() if size.isMap() else _sequence("image_size", size, 2)
    return Rig(
        K1=matrix("K1"),
        D1=matrix("D1"),
        K2=matrix("K2"),
        D2=matrix("D2"),
        R=matrix("R"),
        T=matrix("T"),
        image_size=tuple(image_size),  # type: ignore[arg-type]  # Rig refuses fractions
        world_from_left=matrix("world_from_left") if "world_from_left" in present else None,
        lamps=matrix("lamps") if "lamps" in present else None,
        pedestal_radius=_number("pedestal_radius", storage.getNode("pedestal_radius"))
        if "pedestal_radius" in present
        else None,
    )


def _matrix(key: str, node: cv2.FileNode) -> Array:
    """A `!!opencv-matrix`, read by its size and data so that a lie about its size costs nothing."""
    parts = set(node.keys()) if node.isMap() else set()
    if {"rows", "cols", "data"} <= parts:
        shape = [_number(f"{key} {side}", node.getNode(side)) for side in ("rows", "cols")]
    elif {"sizes", "data"} <= parts:  # how OpenCV 5 writes vectors
        shape = _sequence(f"{key} sizes", node.getNode("sizes"), node.getNode("sizes").size())
    else:
        raise RigError(f"{key} must be an opencv-matrix with rows, cols and data")
    data = node.getNode("data")
    whole = 1 <= len(shape) <= 2 and all(side >= 1 and side.is_integer() for side in shape)
    if not (whole and data.isSeq() and data.size() <= MAX_MATRIX_ENTRIES and math.prod(shape) == data.size()):
        raise RigError(
            f"{key} must have rows x cols entries, at most {MAX_MATRIX_ENTRIES}, got {data.size()} for the size {shape}"
        )
    return np.array(_sequence(key, data, data.size())).reshape([int(side) for side in shape])


def _sequence(key: str, node: cv2.FileNode, count: int) -> list[float]:
    if count == 1 and not node.isSeq():  # XML knows no sequence of one
        return [_number(key, node)]
    if not node.isSeq() or node.size() != count:
        raise RigError(f"{key} must be a sequence of {count} numbers")
    return [_number(key, node.at(index)) for index in range(count)]


def _number(key: str, node: cv2.FileNode) -> float:
    if not (node.isInt() or node.isReal()):
        got = repr(node.string()[:40]) if node.isString() else "something else"
        raise RigError(f"{key} must be a number, got {got}")
    return float(node.real())
