import math
import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matroska import write_matroska

from leakloc import ClipError, video_decoder
from leakloc.footage import footage_size, image_paths, read_footage
from leakloc.image_file import image_size_of
from leakloc.video_file import video_frames

N, H, W = 5, 48, 64
LOSSLESS = ("png", "tif", "bmp", "pgm")


def grey(dtype=np.uint8, seed=0, n=N):
    rng = np.random.default_rng(seed)
    return rng.integers(0, np.iinfo(dtype).max, (2, n, H, W), endpoint=True).astype(dtype)


def write_images(folder, frames, suffix="png", name="{}"):
    folder.mkdir(parents=True)
    for number, frame in enumerate(frames):
        assert cv2.imwrite(str(folder / f"{name.format(number)}.{suffix}"), frame)
    return folder


def write_video(path, frames, codec="FFV1", fps=12.0):
    colour, deep = frames.ndim == 4, frames.dtype == np.uint16
    settings = [cv2.VIDEOWRITER_PROP_IS_COLOR, int(colour)] + [cv2.VIDEOWRITER_PROP_DEPTH, cv2.CV_16U] * deep
    fourcc = cv2.VideoWriter_fourcc(*codec)
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, fourcc, fps, (frames.shape[2], frames.shape[1]), settings)
    assert writer.isOpened()
    for frame in frames:
        writer.write(frame)
    writer.release()
    return path


def footage_or_error(left, right, rig):
    try:
        return read_footage(left, right, rig)
    except ClipError as error:
        return str(error)


def cut(path, share=0.6):
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    return path


@pytest.fixture
def rig(make_rig):
    return make_rig(W, H)


@pytest.mark.parametrize(
    ("suffix", "dtype"), [(s, d) for s in LOSSLESS for d in (np.uint8, np.uint16) if (s, d) != ("bmp", np.uint16)]
)
def test_folders_of_lossless_images_are_read_to_the_bit(tmp_path, rig, suffix, dtype):
    views = grey(dtype)
    clip = read_footage(*(write_images(tmp_path / str(k), views[k], suffix) for k in range(2)), rig)
    assert np.array_equal(clip.left, views[0])
    assert np.array_equal(clip.right, views[1])
    assert clip.left.dtype == clip.right.dtype == dtype
    assert math.isnan(clip.fps)
    assert math.isnan(clip.exposure_s)
    assert (clip.tone, clip.rig) == ("unknown", rig)


@pytest.mark.parametrize(("container", "dtype"), [("mkv", np.uint8), ("mkv", np.uint16), ("avi", np.uint8)])
def test_grey_videos_without_loss_are_read_to_the_bit_with_their_frame_rate(tmp_path, rig, container, dtype):
    views = grey(dtype)
    clip = read_footage(*(write_video(tmp_path / f"{k}.{container}", views[k]) for k in range(2)), rig)
    assert np.array_equal(clip.left, views[0])
    assert np.array_equal(clip.right, views[1])
    assert clip.left.dtype == dtype
    assert clip.fps == 12.0


@pytest.mark.parametrize("suffix", ["png", "tif", "bmp"])
def test_colour_is_turned_to_grey_by_the_luma_weights(tmp_path, rig, suffix):
    bgr = np.zeros((3, H, W, 3), np.uint8)
    bgr[0] = (200, 0, 0)
    bgr[1] = (0, 200, 0)
    bgr[2] = (0, 0, 200)
    clip = read_footage(*(write_images(tmp_path / str(k), bgr, suffix) for k in range(2)), rig)
    for frame, weight in zip(clip.left, (0.114, 0.587, 0.299), strict=True):
        assert np.unique(frame) == pytest.approx(200 * weight, abs=0.51)


def test_lossy_colour_of_a_smooth_scene_is_within_a_few_grey(tmp_path, rig):
    ramp = np.broadcast_to(np.linspace(40, 200, W).astype(np.uint8), (N, H, W))
    colour = np.repeat(ramp[..., None], 3, axis=-1)
    for left, right in (
        [write_images(tmp_path / f"jpg{k}", ramp, "jpg") for k in range(2)],
        [write_video(tmp_path / f"{k}.avi", colour, "MJPG") for k in range(2)],
    ):
        assert np.abs(read_footage(left, right, rig).left.astype(int) - ramp).max() <= 5


def test_images_come_in_the_order_of_their_numbers(tmp_path, rig):
    views = grey(n=12)
    folders = [write_images(tmp_path / str(k), views[k], name="cam1_{}_x") for k in range(2)]
    clip = read_footage(*folders, rig)  # 2 before 10
    assert np.array_equal(clip.left, views[0])


@given(st.lists(st.integers(0, 10**6), min_size=1, max_size=12, unique=True), st.integers(1, 8))
def test_whatever_the_zeros_in_front_numbers_decide(tmp_path_factory, numbers, digits):
    folder = tmp_path_factory.mktemp("order")
    for number in numbers:
        (folder / f"a{number:0{digits}d}.png").touch()
    try:
        names = [path.name for path in image_paths(folder)]
    except ClipError as error:
        assert "without a gap" in str(error)  # noqa: PT017
        steps = np.diff(sorted(numbers))
        assert np.mean(steps == 1) > 0.5
        assert (steps != 1).any()
    else:
        assert names == [f"a{number:0{digits}d}.png" for number in sorted(numbers)]


def test_clock_times_and_every_tenth_frame_may_have_gaps(tmp_path):
    for folder, numbers in (("clock", [1699, 1781, 1866]), ("tenth", [0, 10, 30, 40])):
        (tmp_path / folder).mkdir()
        for number in numbers:
            (tmp_path / folder / f"{number}.png").touch()
        assert len(image_paths(tmp_path / folder)) == len(numbers)


def test_a_video_and_a_folder_go_together_and_litter_is_ignored(tmp_path, rig):
    views = grey()
    left = write_video(tmp_path / "left.mkv", views[0], fps=25.0)
    right = write_images(tmp_path / "right", views[1])
    (right / "Thumbs.db").write_text("litter")
    (right / ".hidden.jpg").write_text("litter")
    clip = read_footage(left, str(right), rig)
    assert np.array_equal(clip.left, views[0])
    assert np.array_equal(clip.right, views[1])
    assert clip.fps == 25.0
    assert footage_size(left) == footage_size(right) == (W, H)


@pytest.mark.parametrize("container", ["mkv", "avi", "mp4"])
def test_whole_videos_of_any_length_and_rate_hold_what_they_announce(tmp_path, rig, container):
    for n, fps in ((3, 12.0), (7, 29.97), (11, 60.0), (24, 23.976), (50, 7.0)):
        frames = np.broadcast_to(grey()[0, :1], (n, H, W))
        paths = [write_video(tmp_path / f"{n}-{k}.{container}", frames, "MJPG", fps) for k in range(2)]
        clip = read_footage(*paths, rig)
        assert len(clip.left) == n
        assert clip.fps == pytest.approx(fps, rel=1e-3)


@pytest.mark.parametrize("suffix", ["png", "jpg", "tif", "bmp", "pgm", "ppm"])
def test_the_header_of_an_image_gives_its_size(suffix):
    for image in (np.zeros((7, 13), np.uint8), np.zeros((5, 300, 3), np.uint8)):
        if (suffix, image.ndim) in (("pgm", 3), ("ppm", 2)):
            continue
        assert image_size_of(cv2.imencode(f".{suffix}", image)[1].tobytes()) == image.shape[1::-1]


@pytest.mark.parametrize("suffix", ["png", "jpg", "tif", "bmp", "pgm"])
@given(st.integers(0, 10**9))
def test_an_image_cut_anywhere_is_refused(suffix, place):
    content = cv2.imencode(f".{suffix}", grey()[0, 0])[1].tobytes()
    with pytest.raises(ValueError, match=r"truncated|damaged|not a PNG"):
        image_size_of(content[: place % (len(content) - 1)])


@given(st.sampled_from([b"", b"\xff\xd8\xff", b"II*\0", b"MM\0*", b"BM", b"P5 ", b"\x89PNG\r\n\x1a\n"]), st.binary())
def test_no_bytes_crash_the_header_reader(start, garbage):
    try:
        size = image_size_of(start + garbage)
    except ValueError:
        return
    assert len(size) == 2


def replaced(name, content):
    def replace(folder):
        (folder / name).write_bytes(content)

    return replace


def image(suffix, frame):
    return cv2.imencode(f".{suffix}", frame)[1].tobytes()


def piped(folder):
    (folder / "right/2.png").unlink()
    os.mkfifo(folder / "right/2.png")


def removed(*names):
    def remove(folder):
        for name in names:
            (folder / name).unlink()

    return remove


def emptied(folder):
    for path in (folder / "left").iterdir():
        path.unlink()


FRAME = grey()[0, 0]
BAD_FOLDERS = {
    "no images": (emptied, "left: holds no image"),
    "two frames": (removed("left/2.png", "left/3.png", "left/4.png"), "left: must have 3 to 2000 frames, got 2"),
    "unequal lengths": (removed("right/4.png"), "must have the same number of frames, got 5 and 4"),
    "a gap": (removed("left/2.png"), "left/3.png: frames must be numbered without a gap, it follows 1.png"),
    "same number": (replaced("left/03.png", b""), "left/3.png: has the same number as 03.png"),
    "two kinds": (replaced("left/0.jpg", image("jpg", FRAME)), "images of a folder must be of one kind"),
    "wrong size": (
        replaced("left/1.png", image("png", FRAME[1:])),
        r"left/1.png: .*image_size \(64, 48\), got \(64, 47",
    ),
    "mixed depth": (
        replaced("right/3.png", image("png", FRAME.astype(np.uint16))),
        "right/3.png: must have the bit depth of 0.png, uint8",
    ),
    "truncated": (replaced("left/4.png", image("png", FRAME)[:-30]), "left/4.png: truncated PNG"),
    "not an image": (replaced("left/0.png", b"hello"), "left/0.png: not a PNG, JPEG"),
    "empty": (replaced("left/0.png", b""), "left/0.png: not a PNG, JPEG"),
    "a bomb": (replaced("left/2.png", b"P5 60000 60000 255 " + bytes(99)), r"left/2.png: truncated PGM"),
    "too wide": (replaced("left/2.png", b"P5 9000 1 255 " + bytes(9000)), r"left/2.png: image must be 1 to 8192 px"),
    "a bomb in TIFF": (
        replaced(
            "left/2.png",
            image("tif", FRAME).replace(
                b"\x00\x01\x03\x00\x01\x00\x00\x00\x40\x00", b"\x00\x01\x03\x00\x01\x00\x00\x00\xff\xff"
            ),
        ),
        r"left/2.png: image must be 1 to 8192 px",
    ),
    "floats": (
        replaced("left/0.png", image("tif", FRAME.astype(np.float32))),
        "left/0.png: .*8 or 16 bit, got float32",
    ),
    "frame a pipe": (piped, "right/2.png: must be a regular file"),
}


@pytest.mark.parametrize("kind", BAD_FOLDERS)
def test_bad_folders_get_one_error_naming_file_and_rule_and_a_quiet_terminal(tmp_path, rig, capfd, kind):
    spoil, said = BAD_FOLDERS[kind]
    folders = [write_images(tmp_path / side, grey()[0]) for side in ("left", "right")]
    spoil(tmp_path)
    with pytest.raises(ClipError, match=said) as caught:
        read_footage(*folders, rig)
    assert str(tmp_path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_views_of_two_depths_are_refused(tmp_path, rig):
    folders = [write_images(tmp_path / str(k), grey(dtype)[0]) for k, dtype in enumerate((np.uint8, np.uint16))]
    with pytest.raises(ClipError, match="must have one bit depth, got uint8 and uint16"):
        read_footage(*folders, rig)


def test_one_camera_given_twice_is_refused(tmp_path, rig):
    folder = write_images(tmp_path / "left", grey()[0])
    (tmp_path / "right").symlink_to(folder)
    with pytest.raises(ClipError, match="right: left and right must be two cameras"):
        read_footage(folder, tmp_path / "right", rig)


@pytest.mark.parametrize(("name", "codec"), [("left.mkv", "FFV1"), ("left.avi", "FFV1"), ("left.avi", "MJPG")])
def test_a_truncated_video_is_refused_with_both_counts(tmp_path, rig, name, codec):
    path = cut(write_video(tmp_path / name, grey(n=24)[0], codec))
    with pytest.raises(ClipError, match=rf"{name}: truncated .*: announces 24 frames, 1[345] can be decoded"):
        read_footage(path, write_video(tmp_path / "right.mkv", grey()[1]), rig)


def list_of_files(folder):
    write_video(folder / "secret.avi", grey()[0])
    (folder / "left.mkv").write_text("ffconcat version 1.0\nfile secret.avi\n")


def playlist(folder):
    write_video(folder / "secret.avi", grey()[0])
    (folder / "left.mkv").write_text("#EXTM3U\n#EXT-X-TARGETDURATION:2\n#EXTINF:2,\nsecret.avi\n#EXT-X-ENDLIST\n")


BAD_VIDEOS = {
    "missing": (lambda _: None, "left.mkv: cannot be read: No such file"),
    "a pipe": (lambda folder: os.mkfifo(folder / "left.mkv"), "left.mkv: must be a regular file"),
    "a list of other files": (list_of_files, "left.mkv: not a video"),
    "a playlist": (playlist, "left.mkv: not a video"),
    "text": (lambda folder: (folder / "left.mkv").write_text("hello"), "left.mkv: not a video"),
    "empty": (lambda folder: (folder / "left.mkv").touch(), "left.mkv: not a video"),
    "an image": (lambda folder: (folder / "left.mkv").write_bytes(image("png", FRAME)), "left.mkv: not a video"),
    "two frames": (
        lambda folder: write_video(folder / "left.mkv", grey()[0, :2]),
        "left.mkv: must have 3 to 2000 .* 2",
    ),
    "wrong size": (
        lambda folder: write_video(folder / "left.mkv", grey()[0, :, :40]),
        r"left.mkv: must have the rig's image_size \(64, 48\), got \(64, 40\)",
    ),
    "other frame rate": (
        lambda folder: write_video(folder / "left.mkv", grey()[0], fps=25),
        "one frame rate, got 25 and 12",
    ),
    "unequal lengths": (
        lambda folder: write_video(folder / "left.mkv", grey(n=6)[0]),
        "same number of frames, got 6 and 5",
    ),
    "other depth": (
        lambda folder: write_video(folder / "left.mkv", grey(np.uint16)[0]),
        "one bit depth, got uint16 and uint8",
    ),
}


@pytest.mark.parametrize("kind", BAD_VIDEOS)
def test_bad_videos_get_one_error_naming_file_and_rule(tmp_path, rig, kind):
    spoil, said = BAD_VIDEOS[kind]
    right = write_video(tmp_path / "right.mkv", grey()[1])
    spoil(tmp_path)
    with pytest.raises(ClipError, match=said) as caught:
        read_footage(tmp_path / "left.mkv", right, rig)
    assert "left.mkv" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("address", ["concat:left.mkv|right.mkv", "http://127.0.0.1:9/left.mkv", "file:left.mkv"])
def test_an_address_is_the_name_of_a_file_that_is_not_there(tmp_path, monkeypatch, rig, address):
    monkeypatch.chdir(tmp_path)
    write_video(tmp_path / "left.mkv", grey()[0])
    right = write_video(tmp_path / "right.mkv", grey()[1])
    with pytest.raises(ClipError, match="No such file"):
        read_footage(address, right, rig)


def test_limits_stop_the_decoding(tmp_path, monkeypatch, rig):
    paths = [write_video(tmp_path / f"{k}.mkv", grey(n=9)[k]) for k in range(2)]
    folders = [write_images(tmp_path / str(k), grey(n=9)[k]) for k in range(2)]
    monkeypatch.setattr("leakloc.footage.MAX_FRAMES", 8)
    with pytest.raises(ClipError, match=r"0\.mkv: video must have at most 8 frames"):
        read_footage(*paths, rig)
    with pytest.raises(ClipError, match="0: must have 3 to 8 frames, got 9"):
        read_footage(*folders, rig)
    monkeypatch.setattr("leakloc.footage.MAX_FRAMES", 100)
    monkeypatch.setattr("leakloc.footage.MAX_VIEW_BYTES", 8 * H * W)
    with pytest.raises(ClipError, match=rf"0\.mkv: video .* {8 * H * W} bytes decoded"):
        read_footage(*paths, rig)
    with pytest.raises(ClipError, match=rf"0: must be at most {8 * H * W} bytes decoded, got {9 * H * W}"):
        read_footage(*folders, rig)


def test_the_environment_and_opencvs_log_level_are_left_as_they_were(tmp_path, monkeypatch, rig):
    monkeypatch.setenv("OPENCV_FFMPEG_CAPTURE_OPTIONS", "mine;1")
    monkeypatch.delenv("OPENCV_FFMPEG_LOGLEVEL", raising=False)
    level = cv2.utils.logging.getLogLevel()
    read_footage(*(write_video(tmp_path / f"{k}.mkv", grey()[k]) for k in range(2)), rig)
    assert os.environ["OPENCV_FFMPEG_CAPTURE_OPTIONS"] == "mine;1"
    assert "OPENCV_FFMPEG_LOGLEVEL" not in os.environ
    assert cv2.utils.logging.getLogLevel() == level


@settings(max_examples=12)
@given(st.floats(0.15, 0.85), st.integers(1, 255))
def test_a_changed_byte_of_a_lossless_video_is_refused_or_changes_no_pixel(tmp_path_factory, make_rig, place, mask):
    folder = tmp_path_factory.mktemp("damaged")
    views = grey(n=6)
    left, right = (write_video(folder / f"{name}.mkv", views[k]) for k, name in enumerate(("left", "right")))
    content = bytearray(left.read_bytes())
    content[int(place * len(content))] ^= mask
    left.write_bytes(content)
    read = footage_or_error(left, right, make_rig(W, H))
    assert "left.mkv: " in read if isinstance(read, str) else np.array_equal(read.left, views[0])


def test_damage_is_told_by_ffmpeg_whatever_the_process_has_asked_it_to_say_before(tmp_path, rig, monkeypatch):
    left, right = (write_video(tmp_path / f"{k}.mkv", grey(n=6)[k]) for k in range(2))
    monkeypatch.setenv("OPENCV_FFMPEG_LOGLEVEL", "-8")
    assert cv2.VideoCapture(str(right)).isOpened()
    content = bytearray(left.read_bytes())
    content[len(content) // 2] ^= 0x55
    left.write_bytes(content)
    with pytest.raises(ClipError, match=r"0\.mkv: damaged video, FFmpeg says: .*CRC mismatch.* give them as PNG"):
        read_footage(left, right, rig)


def test_a_decoder_that_a_video_takes_down_is_a_damaged_video(tmp_path, rig, monkeypatch):
    paths = [write_video(tmp_path / f"{k}.mkv", grey()[k]) for k in range(2)]
    program = Path(video_decoder.__file__).read_text()
    breaking = tmp_path / "breaking.py"
    breaking.write_text(program.replace("    frames.close()\n", "    os.abort()\n"))
    monkeypatch.setattr(video_decoder, "__file__", str(breaking))
    with pytest.raises(ClipError, match=r"0\.mkv: damaged video: its decoder broke down"):
        read_footage(*paths, rig)


def test_damaged_and_truncated_videos_leave_the_terminal_quiet(tmp_path, make_rig):
    cut(write_video(tmp_path / "cut.mkv", grey(n=24)[0]))
    cut(write_video(tmp_path / "cut.mp4", grey(n=24)[0], "mp4v"))
    damaged = write_video(tmp_path / "damaged.mkv", grey(n=24)[0])
    content = bytearray(damaged.read_bytes())
    content[len(content) // 2] ^= 0x55
    damaged.write_bytes(content)
    program = (
        "import sys; from leakloc.footage import *; import numpy as np; from leakloc import Rig, ClipError\n"
        "K, D = [[50, 0, 31], [0, 50, 23], [0, 0, 1]], np.zeros(5)\n"
        f"rig = Rig(K, D, K, D, np.eye(3), [-1, 0, 0], ({W}, {H}))\n"
        "for path in sys.argv[1:]:\n"
        "    try: read_footage(path, sys.argv[-1], rig)\n"
        "    except ClipError as error: print(error)\n"
    )
    names = ["cut.mkv", "cut.mp4", "none.mkv", "damaged.mkv"]
    done = subprocess.run(
        [sys.executable, "-c", program, *(str(tmp_path / name) for name in names)], capture_output=True, text=True
    )
    assert done.stderr == ""
    said = done.stdout.splitlines()
    assert len(said) == 4
    for name, line in zip(names, said, strict=True):
        assert name in line


EVEN_MS = [round(k * 1000 / 12) for k in range(24)]
UNEVEN_MS = [round(k * 1000 / 12 + 25 * np.sin(k)) for k in range(24)]
SLOWER_MS = EVEN_MS[:12] + [917 + 125 * k for k in range(1, 13)]


@pytest.mark.parametrize(
    ("times_ms", "step_ms"),
    [(EVEN_MS[:10] + EVEN_MS[11:], 1000 / 12), (UNEVEN_MS, None), (SLOWER_MS, 1000 / 12)],
    ids=["a frame was dropped", "no pace", "slows down"],
)
def test_a_video_whose_frames_are_no_multiple_of_its_pace_is_whole_and_states_no_rate(tmp_path, times_ms, step_ms):
    frames = grey(n=len(times_ms))[0]
    path = tmp_path / "recorded.mkv"
    write_matroska(path, frames, times_ms, duration_ms=times_ms[-1] + 83, step_ms=step_ms)
    decoded, fps = video_frames(path, 100, 1 << 30)
    assert np.array_equal(decoded, frames)
    assert np.isnan(fps)


@pytest.mark.parametrize("missing", [1, 2, 12])
def test_a_video_that_ends_before_its_duration_is_truncated(tmp_path, missing):
    frames, times_ms = grey(n=24)[0][:-missing], EVEN_MS[:-missing]
    path = write_matroska(tmp_path / "cut.mkv", frames, times_ms, duration_ms=2000, step_ms=1000 / 12)
    with pytest.raises(ValueError, match=f"announces 24 frames, {24 - missing} can be decoded; .* PNG images"):
        video_frames(path, 100, 1 << 30)


@pytest.mark.parametrize("bits", [10, 12, 14])
def test_grey_that_would_lose_its_lower_bits_is_refused(tmp_path, bits):
    frames = grey(np.uint16, n=5)[0] >> (16 - bits)
    fourcc = b"Y1\0" + bytes([bits])
    path = write_matroska(tmp_path / "deep.mkv", frames, EVEN_MS[:5], duration_ms=417, step_ms=1000 / 12, fourcc=fourcc)
    with pytest.raises(ValueError, match=f"grey of {bits} bits would be decoded to 8"):
        video_frames(path, 100, 1 << 30)


def test_an_image_without_a_number_among_numbered_ones_is_refused_and_hides_no_gap(tmp_path):
    for name in ("0", "1", "2", "5", "6", "background"):
        (tmp_path / f"{name}.png").touch()
    with pytest.raises(ClipError, match=r"background\.png: must have a number in its name"):
        image_paths(tmp_path)


@given(st.lists(st.floats(1.6e9, 2e9), min_size=2, max_size=8, unique=True), st.sampled_from(["", "left_"]))
def test_decimal_clock_times_come_in_the_order_of_time(tmp_path_factory, times_s, prefix):
    folder = tmp_path_factory.mktemp("clock")
    for time_s in times_s:
        (folder / f"{prefix}{time_s}.png").touch()
    assert [path.name for path in image_paths(folder)] == [f"{prefix}{time_s}.png" for time_s in sorted(times_s)]
