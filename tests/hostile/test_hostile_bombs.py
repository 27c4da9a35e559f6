"""Small files that would be large, deep or endless: each refused by a process of its own, in time and memory.

Measured beyond what importing takes, with a limit on the process's addresses: a crash of a native library would show
as a signal, a bomb as a MemoryError's traceback, a hang as a time-out.
"""

import hashlib
import json
import os
import shutil
import struct
import zlib

import cv2
import numpy as np
import pytest
from test_hostile_files import KALIBR
from verdicts import LIMIT_MB, LIMIT_S, SLACK, leakloc_alone, tree


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(width_px, height_px, packed, bits=8, colour=0):
    header = struct.pack(">IIBBBBB", width_px, height_px, bits, colour, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", packed) + chunk(b"IEND", b"")


def black(n_bytes):
    packer = zlib.compressobj(9)
    return b"".join(packer.compress(bytes(1 << 20)) for _ in range(n_bytes >> 20)) + packer.flush()


def tiff(width_px, height_px):
    tags = [(256, 4, width_px), (257, 4, height_px), (258, 3, 8), (259, 3, 5), (262, 3, 1), (273, 4, 8), (279, 4, 4)]
    entries = b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in tags)
    return b"II*\0" + struct.pack("<I", 12) + bytes(4) + struct.pack("<H", len(tags)) + entries + bytes(4)


def written(folder, name, content):
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content if isinstance(content, bytes) else content.encode())


def frames(name, content):
    """A folder of a user's images, one of them a bomb, beside a whole one."""

    def lay(folder):
        for number in range(4):
            written(folder, f"left/{number}.{name}", content)
        shutil.copytree(folder / "clip" / "right", folder / "right")
        return "locate", "left", "right", "--rig", "clip/rig.yaml", "-o", "made.json"

    return lay


def in_clip(name, content):
    """A file of an estimator's copy of a clip, which no manifest guards."""

    def lay(folder):
        (folder / "clip" / "clip.json").unlink()
        written(folder, f"clip/{name}", content)
        return "locate", "clip", "-o", "made.json"

    return lay


def truth(content):
    """A truth that the manifest vouches for."""

    def lay(folder):
        written(folder, "clip/truth.json", content)
        manifest = json.loads((folder / "clip" / "clip.json").read_text())
        manifest["files"]["truth.json"] = hashlib.sha256(content.encode()).hexdigest()
        written(folder, "clip/clip.json", json.dumps(manifest))
        return "score", "result.json", "clip"

    return lay


def file(content, *command):
    """A file by itself, X in the command."""

    def lay(folder):
        written(folder, "X", content)
        return command

    return lay


def sparse(*command):
    def lay(folder):
        with (folder / "X").open("wb") as stream:
            stream.truncate(10**11)
        return command

    return lay


def pipe(name, *command):
    def lay(folder):
        (folder / name).unlink(missing_ok=True)
        os.mkfifo(folder / name)
        return command

    return lay


def mesh(kind, content):
    def lay(folder):
        written(folder, f"mesh.{kind}", content)
        written(folder, "scenario.toml", f'[[structure]]\nkind = "mesh"\npath = "mesh.{kind}"\n')
        return "simulate", "scenario.toml", "-o", "made"

    return lay


def claimed_video(folder):
    """An AVI whose header claims 60 000 x 60 000 pixels."""
    path = folder / "left.avi"
    video = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"FFV1"), 12.0, (96, 64), isColor=False)
    for _ in range(4):
        video.write(np.zeros((64, 96), np.uint8))
    video.release()
    raw = path.read_bytes().replace(struct.pack("<II", 96, 64), struct.pack("<II", 60_000, 60_000))
    path.write_bytes(raw)
    shutil.copy(path, folder / "right.avi")
    return "locate", "left.avi", "right.avi", "--rig", "clip/rig.yaml", "-o", "made.json"


RIG = ("locate", "clip/left", "clip/right", "--rig", "X", "-o", "made.json")
GLTF = {
    "asset": {"version": "2.0"},
    "accessors": [{"componentType": 5126, "count": 400_000_000, "type": "VEC3"}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    "nodes": [{"mesh": 0}],
    "scenes": [{"nodes": [0]}],
}
PLY = "ply\nformat {}\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
XML_LAUGHS = '<!DOCTYPE x [<!ENTITY a "ha">' + "".join(f'<!ENTITY {c} "{"&a;" * 10}">' for c in "bcdefgh") + "]>"
LAUGHS = "a: &a [x]\n" + "".join(
    f"{c}: &{c} [{', '.join(['*' + p] * 9)}]\n" for p, c in zip("abcdefg", "bcdefgh", strict=True)
)

BOMBS = {
    "a PNG that claims 60 000 px": frames("png", png(60_000, 60_000, b"")),
    "a PNG of 64 million black px": frames("png", png(8192, 8192, black(8193 * 8192))),
    "a colour PNG of 64 million black px of 16 bit": frames("png", png(8192, 8192, black(6 * 8193 * 8192), 16, 2)),
    "a frame that claims 60 000 px": in_clip("left/0001.png", png(60_000, 60_000, b"")),
    "a frame of 64 million black px": in_clip("left/0001.png", png(8192, 8192, black(8193 * 8192))),
    "a frame whose pixels are not there": in_clip("left/0001.png", png(96, 64, b"")),
    "a TIFF that claims 4 000 million px": frames("tif", tiff(65_000, 65_000)),
    "a TIFF that claims 64 million px": frames("tif", tiff(8192, 8192)),
    "a PGM that claims 999 999 999 px": frames("pgm", "P5 999999999 999999999 255\n"),
    "a BMP that claims 2 000 million px": frames(
        "bmp",
        b"BM" + bytes(8) + struct.pack("<IIiiHHI", 54, 40, 2**31 - 1, 2**31 - 1, 1, 8, 1) + bytes(20),
    ),
    "a video that claims 60 000 px": claimed_video,
    "a sparse scenario of 100 GB": sparse("check", "X"),
    "a sparse calibration of 100 GB": sparse(*RIG),
    "a sparse result of 100 GB": sparse("score", "X", "clip"),
    "a sparse store of 100 GB": sparse("campaign", "show", "X"),
    "a sparse baseline of 100 GB": sparse("bench", "--method", "naive", "--scenes", "1", "--baseline", "X"),
    "a scenario of a million brackets": file("a = " + "[" * 990_000, "check", "X"),
    "a scenario with a key of 300 000 parts": file("a" + ".a" * 300_000 + " = 1", "check", "X"),
    "a scenario of 300 000 leaks": file("leak = [" + "{}," * 300_000 + "]", "check", "X"),
    "a campaign of 90 000 overrides": file(
        'scenario = "plain"\nset = [' + '"a=1",' * 90_000 + "]",
        "campaign",
        "check",
        "X",
    ),
    "a result of 2 million objects": file('{"leaks": [' + "{}," * 2_000_000 + "{}]}", "score", "X", "clip"),
    "a result of a million brackets": file("[" * 1_000_000, "score", "X", "clip"),
    "a truth of 300 000 leaks": truth('{"leaks": [' + "{}," * 300_000 + "{}]}"),
    "a truth of 100 000 unknown keys": truth("{" + ",".join(f'"{i}":1' for i in range(100_000)) + "}"),
    "a baseline of 2 million objects": file(
        '{"trials": [' + "{}," * 1_900_000 + "{}]}",
        "bench",
        "--method",
        "naive",
        "--baseline",
        "X",
    ),
    "an input.json of brackets": in_clip("input.json", "[" * 1_000_000),
    "a calibration of brackets": file("%YAML:1.0\n---\nK1: " + "[" * 400_000, *RIG),
    "a calibration of dashes": file("%YAML:1.0\n---\n" + "- " * 400_000, *RIG),
    "a calibration of indented keys": file("%YAML:1.0\n---\n" + "".join(f"{' ' * i}a:\n" for i in range(1200)), *RIG),
    "a calibration of tags": file('<?xml version="1.0"?>\n<opencv_storage>' + "<a>\n" * 100_000, *RIG),
    "a calibration that claims 4 000 million rows": file(
        "%YAML:1.0\n---\nK1: !!opencv-matrix\n   rows: 65536\n   cols: 65536\n   dt: d\n   data: [ 1. ]\n",
        *RIG,
    ),
    "a calibration of a billion laughs": file(LAUGHS, *RIG),
    "an XML calibration of a billion laughs": file(
        f'<?xml version="1.0"?>{XML_LAUGHS}<opencv_storage><K1>&h;</K1></opencv_storage>',
        *RIG,
    ),
    "a camchain of brackets": file(KALIBR + "x: " + "[" * 60_000, *RIG),
    "a camchain of nested keys": file(KALIBR + "".join(f"{' ' * i}a:\n" for i in range(340)), *RIG),
    "a mesh that claims 4 000 million triangles": mesh("stl", bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(50)),
    "a mesh that claims 4 000 million vertices": mesh("ply", PLY.format("ascii 1.0") + "0 0 0\n"),
    "a binary mesh that claims 4 000 million vertices": mesh("ply", PLY.format("binary_little_endian 1.0")),
    "a mesh of counts alone": mesh("off", "OFF\n4000000000 4000000000 0\n"),
    "a glTF that claims 5 GB": mesh("gltf", json.dumps(GLTF)),
    "an archive for a mesh": mesh("zip", b"PK\x03\x04" + bytes(100)),
    "a million gratings' bars": file(
        '[[structure]]\nkind = "grating"\ncentre_m = [0.0, 0.0, 0.0]\nsize_m = [100.0, 100.0]\npitch_m = 0.002\n' * 60,
        "simulate",
        "X",
        "-o",
        "made",
    ),
    "a pipe for a manifest": pipe("clip/clip.json", "score", "result.json", "clip"),
    "a pipe for a frame": pipe("clip/left/0001.png", "locate", "clip", "-o", "made.json"),
    "a pipe for a baseline": pipe("X", "bench", "--method", "naive", "--baseline", "X"),
    "a pipe for a calibration": pipe("X", *RIG),
    "a pipe for a video": pipe("X", "locate", "X", "clip/right", "--rig", "clip/rig.yaml"),
    "an endless device for a result": pipe("X", "score", "/dev/zero", "clip"),
    "an endless device for a scenario": pipe("X", "simulate", "/dev/zero", "-o", "made"),
    "an endless device for a mesh": file('[[structure]]\nkind = "mesh"\npath = "/dev/zero"\n', "check", "X"),
}

QUICK = ("a calibration of dashes", "a result of 2 million objects")


def refused_alone(folder, small_clip, bomb, tally):
    here = folder / "here"
    here.mkdir()
    shutil.copytree(small_clip, here / "clip")
    written(here, "result.json", '{"method": "x", "frame": "world", "leaks": [], "diagnostics": {}}')
    words = BOMBS[bomb](here)
    before = tree(folder)
    verdict = leakloc_alone(*words, cwd=here)
    assert "Traceback" not in verdict.error, verdict
    assert "Error: " in verdict.error, verdict
    assert len(verdict.error.splitlines()) <= 60, verdict
    assert verdict.seconds < LIMIT_S * SLACK, verdict
    assert verdict.megabytes < LIMIT_MB, verdict
    assert tree(folder) == before
    tally[f"refused in {verdict.seconds:.2f} s and {verdict.megabytes:.0f} MB"] += 1
    return verdict


@pytest.mark.parametrize("bomb", QUICK)
def test_a_bomb_is_refused_by_a_process_with_limits(tmp_path, small_clip, bomb, tally):
    assert refused_alone(tmp_path, small_clip, bomb, tally).code == 2


@pytest.mark.deep
@pytest.mark.parametrize("bomb", sorted(set(BOMBS) - set(QUICK)))
def test_every_bomb_is_refused_by_a_process_with_limits(tmp_path, small_clip, bomb, tally):
    assert refused_alone(tmp_path, small_clip, bomb, tally).code == 2
