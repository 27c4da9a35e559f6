"""What an image file says of its size, and whether its end is there, before a decoder sees it.

OpenCV's decoders allocate what a header claims and fill what is missing with grey, some with a remark on the terminal.
Damage inside a JPEG, BMP or PGM has no checksum and stays unseen; PNG has one per chunk.
"""

from __future__ import annotations

import re
import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from leakloc.outside_file import read_regular_file
from leakloc.png import check_png
from leakloc.rig import MAX_SIDE_PX

MAX_IMAGE_BYTES = 64 << 20
SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm")
MAX_TIFF_TAGS = 1000

# JPEG markers (ITU-T T.81, table B.1): start of frame, of a scan, end of image; some stand alone.
JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
JPEG_SCAN, JPEG_END = 0xDA, b"\xff\xd9"
JPEG_ALONE = frozenset({0x01, *range(0xD0, 0xD8)})

TIFF_TYPES = {1: "B", 3: "H", 4: "I"}
TIFF_WIDTH, TIFF_HEIGHT = 256, 257
TIFF_PLACES_AND_SIZES = ((273, 279), (324, 325))  # of strips, of tiles


def read_image_size(path: Path) -> tuple[int, int]:
    """(width, height) in px of an image file by its header. Raises ValueError as `read_grey_image` does."""
    return _bearable_size(read_regular_file(path, MAX_IMAGE_BYTES))


def read_grey_image(path: Path, size_px: tuple[int, int] | None = None) -> NDArray[Any]:
    """The grey of one image file, (height, width) uint8 or uint16; colours by the weights of ITU-R BT.601.

    The file may be PNG, JPEG, TIFF, BMP or PGM/PPM, by its content. Pixels come as they are stored: no turning by what
    EXIF says. `size_px` is the (width, height) that it must have: another is refused before a pixel is decoded. Raises
    ValueError with what is wrong, without the file's name.
    """
    content = read_regular_file(path, MAX_IMAGE_BYTES)
    width_px, height_px = _bearable_size(content)
    if size_px is not None and (width_px, height_px) != size_px:
        raise ValueError(f"must have the image_size {size_px}, got {(width_px, height_px)}")
    try:
        image = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        image = None
    if image is None or image.shape[:2] != (height_px, width_px):
        raise ValueError("damaged image: its pixels cannot be decoded")
    return grey_of(image)


def _bearable_size(content: bytes) -> tuple[int, int]:
    width_px, height_px = image_size_of(content)
    if not (0 < width_px <= MAX_SIDE_PX and 0 < height_px <= MAX_SIDE_PX):
        raise ValueError(f"image must be 1 to {MAX_SIDE_PX} px wide and high, got {(width_px, height_px)}")
    return width_px, height_px


def grey_of(image: NDArray[Any]) -> NDArray[Any]:
    """(height, width[, 1, 3 or 4 channels BGR(A)]) to (height, width), uint8 or uint16 as it was, else ValueError."""
    if image.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"image must have 8 or 16 bit, got {image.dtype}")
    channels = 1 if image.ndim == 2 else image.shape[2]
    if channels == 1:
        return image.reshape(image.shape[:2])
    if channels not in (3, 4):
        raise ValueError(f"image must be grey or colour, got {channels} channels")
    return cv2.cvtColor(image, cv2.COLOR_BGR2GRAY if channels == 3 else cv2.COLOR_BGRA2GRAY)


def image_size_of(content: bytes) -> tuple[int, int]:
    """(width, height) in px from the header of a whole image file. Raises ValueError with what is wrong."""
    if content[:4] == b"\x89PNG":
        header = check_png(content)
        return header.width_px, header.height_px
    try:
        if content[:3] == b"\xff\xd8\xff":
            return _jpeg_size(content)
        if content[:4] in (b"II*\0", b"MM\0*"):
            return _tiff_size(content)
        if content[:2] == b"BM":
            return _bmp_size(content)
        if re.match(rb"P[56]\s", content):
            return _pnm_size(content)
    except (struct.error, IndexError):
        raise ValueError(f"truncated image: ends within its header after {len(content)} bytes") from None
    raise ValueError("not a PNG, JPEG, TIFF, BMP or binary PGM file")


def _jpeg_size(content: bytes) -> tuple[int, int]:
    if JPEG_END not in content[-64:]:  # some cameras pad behind it
        raise ValueError("truncated JPEG: no end of image")
    place = 2
    while True:
        if content[place] != 0xFF:
            raise ValueError("damaged JPEG: no marker where one must be")
        marker = content[place + 1]
        if marker in JPEG_FRAMES:
            height_px, width_px = struct.unpack_from(">HH", content, place + 5)
            return width_px, height_px
        if marker == JPEG_SCAN:
            raise ValueError("damaged JPEG: pixels before their size")
        padding = marker == 0xFF  # any number of them may precede a marker
        alone = marker in JPEG_ALONE
        place += 1 if padding else 2 if alone else 2 + int(struct.unpack_from(">H", content, place + 2)[0])


def _bmp_size(content: bytes) -> tuple[int, int]:
    start, header_bytes = struct.unpack_from("<II", content, 10)
    if header_bytes == 12:  # of OS/2
        width_px, height_px, _, bits = struct.unpack_from("<HHHH", content, 18)
        packing = 0
    else:
        width_px, height_px, _, bits, packing = struct.unpack_from("<iiHHI", content, 18)
    needed = start + (width_px * bits + 31) // 32 * 4 * abs(height_px)
    if packing in (0, 3) and needed > len(content):  # rows are whole words; negative heights run downwards
        raise ValueError(f"truncated BMP: {len(content)} bytes, {needed} needed")
    return width_px, abs(height_px)


def _pnm_size(content: bytes) -> tuple[int, int]:
    gap = rb"(?:\s|#[^\n]*\n)+"
    found = re.match(rb"P([56])" + (gap + rb"(\d{1,9})") * 3 + rb"\s", content)
    if found is None:
        raise ValueError("damaged PGM: header must give width, height and largest value")
    width_px, height_px, largest = (int(number) for number in found.groups()[1:])
    needed = found.end() + width_px * height_px * (1 if found[1] == b"5" else 3) * (1 if largest < 256 else 2)
    if needed > len(content):
        raise ValueError(f"truncated PGM: {len(content)} bytes, {needed} needed")
    return width_px, height_px


def _tiff_size(content: bytes) -> tuple[int, int]:
    """The first image of a TIFF 6.0 file, whose strips or tiles all lie in the file."""
    order = "<" if content[:2] == b"II" else ">"
    (place,) = struct.unpack_from(order + "I", content, 4)
    (count,) = struct.unpack_from(order + "H", content, place)
    if count > MAX_TIFF_TAGS:
        raise ValueError(f"damaged TIFF: must have at most {MAX_TIFF_TAGS} tags, got {count}")
    tags = {}
    for entry in range(place + 2, place + 2 + 12 * count, 12):
        tag, kind, length = struct.unpack_from(order + "HHI", content, entry)
        if kind in TIFF_TYPES and length <= len(content):
            numbers = f"{order}{length}{TIFF_TYPES[kind]}"
            inline = struct.calcsize(numbers) <= 4
            at = entry + 8 if inline else struct.unpack_from(order + "I", content, entry + 8)[0]
            tags[tag] = struct.unpack_from(numbers, content, at)
    pieces = [
        place_and_size
        for places, sizes in TIFF_PLACES_AND_SIZES
        for place_and_size in zip(tags.get(places, ()), tags.get(sizes, ()), strict=False)
    ]
    if not pieces or not tags.get(TIFF_WIDTH) or not tags.get(TIFF_HEIGHT):
        raise ValueError("damaged TIFF: no size or no pixels")
    needed = max(place + size for place, size in pieces)
    if needed > len(content):
        raise ValueError(f"truncated TIFF: {len(content)} bytes, {needed} needed")
    return tags[TIFF_WIDTH][0], tags[TIFF_HEIGHT][0]
