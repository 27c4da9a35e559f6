import json
import os
import shutil
import struct
import zlib

import cv2
import numpy as np
import pytest

from leakloc import ClipError, read_clip, write_rig

N, H, W = 4, 12, 20
INPUT = {"fps": 12.0, "exposure_s": 1 / 12, "n_frames": N, "tone": "linear"}


def png(image):
    return cv2.imencode(".png", image)[1].tobytes()


def grey(dtype=np.uint8, seed=0):
    rng = np.random.default_rng(seed)
    return rng.integers(0, np.iinfo(dtype).max, (2, N, H, W), endpoint=True).astype(dtype)


def write_clip(folder, make_rig, views):
    for view, frames in zip(("left", "right"), views, strict=True):
        (folder / view).mkdir(parents=True)
        for number, frame in enumerate(frames):
            (folder / view / f"{number:04d}.png").write_bytes(png(frame))
    write_rig(make_rig(W, H), folder / "rig.yaml")
    (folder / "input.json").write_text(json.dumps(INPUT))
    return folder


@pytest.fixture
def folder(tmp_path, make_rig):
    return write_clip(tmp_path / "clip", make_rig, grey())


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_clip_is_read_as_it_was_written(tmp_path, make_rig, dtype):
    views = grey(dtype)
    clip = read_clip(write_clip(tmp_path / "clip", make_rig, views))
    assert np.array_equal(clip.left, views[0])
    assert np.array_equal(clip.right, views[1])
    assert clip.left.dtype == clip.right.dtype == dtype
    assert (clip.fps, clip.exposure_s, clip.tone) == (12.0, 1 / 12, "linear")
    assert clip.rig.image_size == (W, H)


def test_truth_and_other_files_are_neither_needed_nor_opened(folder):
    (folder / "truth.json").write_text("not even JSON")
    (folder / "left" / "Thumbs.db").write_text("litter")
    (folder / "scenario.toml").symlink_to("/nowhere")
    assert len(read_clip(folder).left) == N


def edited(**changes):
    def edit(folder):
        (folder / "input.json").write_text(json.dumps(INPUT | changes))

    return edit


def written(name, content):
    def write(folder):
        (folder / name).write_bytes(content(folder / name) if callable(content) else content)

    return write


def removed(name):
    def remove(folder):
        path = folder / name
        shutil.rmtree(path) if path.is_dir() else path.unlink()

    return remove


def damaged(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0x10
    return bytes(content)


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png_of(width, height, data):
    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def linked_out(name):
    def link(folder):
        outside = folder.parent / "outside"
        shutil.move(folder / name, outside)
        (folder / name).symlink_to(outside)

    return link


def piped(name):
    def pipe(folder):
        (folder / name).unlink()
        os.mkfifo(folder / name)

    return pipe


def circled(folder):
    (folder / "rig.yaml").unlink()
    (folder / "rig.yaml").symlink_to("rig.yaml")


def surplus_frame(folder):
    shutil.copy(folder / "right/0000.png", folder / "right/0004.png")


COLOUR = np.zeros((H, W, 3), np.uint8)
BAD_CLIPS = {
    "no input.json": (removed("input.json"), "input.json: is missing"),
    "input.json not JSON": (written("input.json", b"{"), "input.json: not JSON"),
    "input.json a list": (written("input.json", b"[1]"), "input.json: must be an object"),
    "input.json nested": (written("input.json", b"[" * 200_000), "input.json: not JSON"),
    "input.json huge": (written("input.json", b" " * (1 << 21)), "input.json: must be at most 1048576 bytes"),
    "fps 0": (edited(fps=0), "fps must be a number > 0 .* got 0"),
    "fps a text": (edited(fps="12"), "fps must be a number .* got '12'"),
    "fps infinite": (edited(fps=float("inf")), "numbers must be finite .* got Infinity"),
    "fps beyond floats": (edited(fps=10**400), "fps must be"),
    "exposure longer than a frame": (edited(exposure_s=0.1), r"exposure_s must be a number > 0 and <= 0.0833"),
    "exposure missing": (edited(exposure_s=None), "exposure_s must be"),
    "two frames": (edited(n_frames=2), "n_frames must be a whole number, at least 3, got 2"),
    "half a frame": (edited(n_frames=3.5), "n_frames must be a whole number"),
    "too many frames": (edited(n_frames=2001), "n_frames must be a number > 0 and <= 2000, got 2001"),
    "n_frames true": (edited(n_frames=True), "n_frames must be a number"),
    "unknown tone": (edited(tone="log"), "tone must be one of linear, srgb, got 'log'"),
    "no rig": (removed("rig.yaml"), "rig.yaml: is missing"),
    "bad rig": (written("rig.yaml", b"%YAML:1.0\n---\nK1: 3\n"), "rig.yaml: .*must be given"),
    "no right": (removed("right"), "right: must be a folder"),
    "frame missing": (removed("right/0002.png"), r"right/0002.png: frame is missing \(1 of 4 are\)"),
    "frames missing": (edited(n_frames=6), r"left/0004.png: frame is missing \(2 of 6 are\)"),
    "frame one too many": (surplus_frame, "right/0004.png: frame is one too many.*n_frames = 4"),
    "truncated": (written("left/0001.png", lambda p: p.read_bytes()[:-20]), "left/0001.png: truncated PNG"),
    "cut in its header": (written("left/0000.png", lambda p: p.read_bytes()[:20]), "left/0000.png: truncated PNG"),
    "empty frame": (written("left/0003.png", b""), "left/0003.png: not a PNG"),
    "one bit flipped": (written("right/0003.png", damaged), "right/0003.png: damaged PNG: wrong checksum"),
    "a bomb": (
        written("left/0001.png", png_of(60_000, 60_000, b"")),
        r"damaged PNG: 0 bytes .* 60000 x 60000",
    ),
    "not a PNG": (written("right/0000.png", b"GIF89a" + bytes(99)), "right/0000.png: not a PNG file"),
    "colour": (written("right/0001.png", png(COLOUR)), "right/0001.png: must be grey .*, got colour of 8 bit"),
    "alpha": (written("right/0001.png", png(np.zeros((H, W, 4), np.uint8))), "got colour with alpha"),
    "wrong size": (written("left/0002.png", png(COLOUR[1:, :, 0])), r"left/0002.png: .*\(20, 12\), got \(20, 11\)"),
    "mixed depth": (
        written("right/0002.png", png(COLOUR[:, :, 0].astype(np.uint16))),
        "right/0002.png: must have the bit depth of 0000.png, uint8",
    ),
    "frame leads out": (linked_out("left/0001.png"), "left/0001.png: leads out of the clip folder"),
    "folder leads out": (linked_out("right"), "right: must be a folder of frames in the clip folder"),
    "rig leads out": (linked_out("rig.yaml"), "rig.yaml: leads out of the clip folder"),
    "frame a pipe": (piped("left/0001.png"), "left/0001.png: must be a regular file"),
    "link in a circle": (circled, "rig.yaml: cannot be read"),
}


@pytest.mark.parametrize("kind", BAD_CLIPS)
def test_a_bad_clip_gets_one_error_naming_file_and_rule_and_a_quiet_terminal(folder, capfd, kind):
    spoil, said = BAD_CLIPS[kind]
    spoil(folder)
    with pytest.raises(ClipError, match=said) as caught:
        read_clip(folder)
    assert str(folder) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("stream", [b"nonsense", b"", zlib.compress(b"\0" * 9)])
def test_pixels_that_cannot_be_decoded_are_refused_though_every_checksum_fits(folder, stream):
    """Only a broken encoder writes these; libpng then says a line of its own, so the terminal is not looked at."""
    (folder / "left/0001.png").write_bytes(png_of(W, H, stream))
    with pytest.raises(ClipError, match=r"left/0001\.png: damaged PNG: (its pixels cannot|0 bytes cannot)"):
        read_clip(folder)


def test_of_many_bad_frames_the_first_is_named(folder):
    for name in ("left/0003.png", "right/0000.png", "right/0003.png", "left/0002.png"):
        (folder / name).write_bytes(b"")
    for _ in range(20):
        with pytest.raises(ClipError, match=r"left/0002\.png"):
            read_clip(folder)


def test_every_single_flipped_byte_of_a_frame_is_noticed(folder):
    path = folder / "left/0001.png"
    content = path.read_bytes()
    for place in range(len(content)):
        path.write_bytes(content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :])
        with pytest.raises(ClipError, match=r"left/0001\.png"):
            read_clip(folder)


def test_a_folder_that_is_none_is_refused(tmp_path):
    with pytest.raises(ClipError, match="none: is not a clip folder"):
        read_clip(tmp_path / "none")
