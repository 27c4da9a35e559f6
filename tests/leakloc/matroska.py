"""Matroska files of raw grey frames at times of one's own, as recorders write them and OpenCV's writer does not.

Elements and their identifiers: RFC 9559.
"""

import struct


def element(identifier, content):
    """An element with a size of eight bytes; a text or number as its type is stored."""
    if isinstance(content, int):
        content = content.to_bytes(8, "big")
    elif isinstance(content, float):
        content = struct.pack(">d", content)
    return bytes.fromhex(identifier) + (len(content) | 1 << 56).to_bytes(8, "big") + content


def write_matroska(path, frames, times_ms, *, duration_ms, step_ms=None, fourcc=b"Y800"):
    """Frames (n, height, width) at times (n,); `step_ms` is the frame duration that the track states, if any."""
    _, height, width = frames.shape
    head = element("1A45DFA3", element("4282", b"matroska"))
    info = element("1549A966", element("2AD7B1", 1_000_000) + element("4489", float(duration_ms)))
    picture = element("E0", element("B0", width) + element("BA", height) + element("2EB524", fourcc))
    pace = b"" if step_ms is None else element("23E383", round(1e6 * step_ms))
    track = element("AE", element("D7", 1) + element("83", 1) + element("86", b"V_UNCOMPRESSED") + pace + picture)
    blocks = [
        element("A3", b"\x81" + struct.pack(">h", time_ms) + b"\x80" + frame.tobytes())
        for time_ms, frame in zip(times_ms, frames, strict=True)
    ]
    cluster = element("1F43B675", element("E7", 0) + b"".join(blocks))
    path.write_bytes(head + element("18538067", info + element("1654AE6B", track) + cluster))
    return path
