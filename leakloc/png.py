"""What a PNG file says of itself: size and kind from its header, and whether every byte is as it was written.

OpenCV's decoder complains on the terminal and does not say what is wrong, so a file is checked before it sees it.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

SIGNATURE = b"\x89PNG\r\n\x1a\n"
MAX_UNPACKING = 1032
"""Most bytes that deflate makes of one (RFC 1951: 258 by two bits)."""

SAMPLES = {"grey": 1, "colour": 3, "palette": 1, "grey with alpha": 2, "colour with alpha": 4}
COLOUR_TYPES = {0: "grey", 2: "colour", 3: "palette", 4: "grey with alpha", 6: "colour with alpha"}


@dataclass(frozen=True)
class PngHeader:
    """Size in px, bits per sample and colour type ("grey", "colour", ...) of a PNG file."""

    width_px: int
    height_px: int
    bits: int
    colour: str

    @property
    def pixel_bytes(self) -> int:
        """Bytes of all rows before they are packed, without what marks each row's filter."""
        return (self.width_px * self.bits * SAMPLES.get(self.colour, 1) + 7) // 8 * self.height_px


def check_png(content: bytes) -> PngHeader:
    """The header of a PNG whose chunks are all there and whose checksums all fit (PNG specification, 5.3 and 11.2.2).

    Raises ValueError with what is wrong.
    """
    if content[:8] != SIGNATURE:
        raise ValueError("not a PNG file")
    header, place, kind, packed_bytes = None, 8, b"", 0
    while kind != b"IEND":
        size, kind = struct.unpack(">I4s", content[place : place + 8].ljust(8, b"\0"))
        end = place + 12 + size
        if end > len(content):
            raise ValueError(f"truncated PNG: {len(content)} bytes, at least {max(end, place + 12)} needed")
        if zlib.crc32(content[place + 4 : end - 4]) != int.from_bytes(content[end - 4 : end]):
            raise ValueError(f"damaged PNG: wrong checksum in chunk {kind.decode('latin-1')!r}")
        if header is None:
            header = _header(kind, content[place + 8 : end - 4])
        packed_bytes += size if kind == b"IDAT" else 0
        place = end
    assert header is not None  # the first chunk set it or raised
    if header.pixel_bytes > MAX_UNPACKING * packed_bytes:  # before a decoder makes room for what cannot be there
        raise ValueError(f"damaged PNG: {packed_bytes} bytes cannot hold {header.width_px} x {header.height_px} px")
    return header


def _header(kind: bytes, data: bytes) -> PngHeader:
    if kind != b"IHDR" or len(data) != 13:
        raise ValueError("damaged PNG: no header first")
    width_px, height_px, bits, colour = struct.unpack(">IIBB", data[:10])
    return PngHeader(width_px, height_px, bits, COLOUR_TYPES.get(colour, f"type {colour}"))
