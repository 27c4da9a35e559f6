import os
import re

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from leakloc import Rig, RigError, read_rig, write_rig
from leakloc.rig import depths_m

# What CONVENTIONS say of the paper's rig, typed by hand as a user would.
PAPER_RIG = """%YAML:1.0
---
K1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 685.51, 0., 479.5, 0., 685.51, 269.5, 0., 0., 1. ]
D1: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ 0., 0., 0., 0., 0. ]
K2: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 685.51, 0., 479.5, 0., 685.51, 269.5, 0., 0., 1. ]
D2: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ 0., 0., 0., 0., 0. ]
R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ -0.5, 0., 0. ]
image_size: [ 960, 540 ]
world_from_left: !!opencv-matrix
   rows: 4
   cols: 4
   dt: d
   data: [ 0., 0., 1., -2.4, -1., 0., 0., 0.25, 0., -1., 0., 0., 0., 0., 0., 1. ]
lamps: !!opencv-matrix
   rows: 1
   cols: 4
   dt: d
   data: [ -2.4, 0., 0.3, 0.1 ]
pedestal_radius: 2.5
"""


def changed(pattern, replacement):
    text, count = re.subn(pattern, replacement, PAPER_RIG, count=1, flags=re.DOTALL)
    assert count == 1, pattern
    return text


def matrix_changed(key, data):
    return changed(rf"({key}: .*?data: )\[.*?\]", rf"\1[ {data} ]")


def without(key):
    return changed(rf"\n{key}:.*?\n(?=[A-Za-z]|$)", "\n")


def test_the_papers_rig_is_read_as_it_was_written_by_hand(tmp_path):
    (tmp_path / "rig.yaml").write_text(PAPER_RIG)
    rig = read_rig(tmp_path / "rig.yaml")
    assert rig.image_size == (960, 540)
    assert rig.frame == "world"
    assert rig.T.tolist() == [-0.5, 0, 0]
    assert rig.lamps.tolist() == [[-2.4, 0, 0.3, 0.1]]
    assert rig.pedestal_radius == 2.5
    middle = rig.P1 @ [0, 0, 0, 1]
    assert (middle / middle[2])[0] == pytest.approx(550.91, abs=0.005)
    middle = rig.P2 @ [0, 0, 0, 1]
    assert (middle / middle[2])[0] == pytest.approx(408.09, abs=0.005)


def test_the_right_camera_stands_at_minus_half_a_baseline(make_rig):
    right_from_world = make_rig().right_from_frame
    np.testing.assert_allclose(right_from_world @ [-2.4, -0.25, 0, 1], [0, 0, 0, 1], atol=1e-15)
    assert depths_m([[0, 0, 0], [-3, 0, 0]], right_from_world) == pytest.approx([2.4, -0.6])


@pytest.mark.parametrize("key", ["world_from_left", "lamps", "pedestal_radius"])
def test_what_may_be_missing_is_none(tmp_path, key):
    (tmp_path / "rig.yaml").write_text(without(key))
    rig = read_rig(tmp_path / "rig.yaml")
    assert getattr(rig, key) is None
    assert rig.frame == ("left camera" if key == "world_from_left" else "world")


def test_a_stereo_calibrate_file_in_xml_or_of_opencvs_own_writing_is_read(tmp_path, make_rig):
    for name in ("rig.xml", "rig.yml"):
        storage = cv2.FileStorage(str(tmp_path / name), cv2.FILE_STORAGE_WRITE)
        for key in ("K1", "K2", "R"):
            storage.write(key, np.array(getattr(make_rig(), key)))
        storage.write("D1", np.array([0.1, -0.2, 0.0, 0.0]))  # a vector: OpenCV 5 writes it as an nd-matrix
        storage.write("D2", np.zeros((5, 1)))
        storage.write("T", np.array([[-0.5], [0], [0]], np.float32))
        storage.write("image_size", np.array([960, 540]))  # a list cannot be written from Python
        storage.write("rms", 0.2)
        storage.release()
        rig = read_rig(tmp_path / name)
        assert rig.D1.tolist() == [0.1, -0.2, 0, 0]
        assert rig.T.tolist() == [-0.5, 0, 0]
        assert rig.frame == "left camera"


@given(
    st.lists(st.floats(-1e3, 1e3), min_size=14, max_size=14),
    st.sampled_from([4, 5, 8, 12, 14]),
    st.tuples(*[st.floats(-180, 180)] * 3),
    st.one_of(st.none(), st.floats(1e-3, 100)),
)
def test_a_written_rig_is_read_back_to_the_bit(tmp_path_factory, make_rig, numbers, length, angles, radius):
    R = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = R.T, numbers[:3]
    lamps = None if radius is None else [[*numbers[3:6], radius], [0, 0, 0, 0]]
    rig = make_rig(D1=numbers[:length], R=R, T=[-0.1, *numbers[:2]], world_from_left=pose, lamps=lamps)
    path = tmp_path_factory.getbasetemp() / "round.yaml"
    write_rig(rig, path)
    back = read_rig(path)
    for key in ("K1", "D1", "K2", "D2", "R", "T", "world_from_left", "lamps"):
        assert np.array_equal(getattr(back, key), getattr(rig, key)), key
    assert (back.image_size, back.pedestal_radius) == (rig.image_size, rig.pedestal_radius)


def test_a_rig_copies_and_freezes_its_arrays(make_rig):
    K = make_rig().K1.copy()
    rig = make_rig(K1=K)
    K[0, 0] = 1
    assert rig.K1[0, 0] > 600
    with pytest.raises(ValueError, match="read-only"):
        rig.K1[0, 0] = 1
    with pytest.raises(AttributeError):
        rig.T = np.ones(3)


BAD_RIGS = {
    "empty": ("", "empty"),
    "text": ("hello world", "not OpenCV FileStorage YAML or XML"),
    "cut short": (PAPER_RIG[:200], "FileStorage|must be given"),
    "json": ('{"K1": 1}', "JSON"),
    "nul byte": (PAPER_RIG.replace("T:", "T\x00:"), "NUL"),
    "not utf-8": (b"%YAML:1.0\n---\n\xff\xfe: 1\n", "UTF-8"),
    "too large": (PAPER_RIG + "# pad\n" * 200_000, "at most 1048576 bytes"),
    "nested brackets": ("%YAML:1.0\n---\na: " + "[" * 500_000, "at most 500 brackets"),
    "nested dashes": ("%YAML:1.0\n---\na:\n  " + "- " * 400_000 + "1\n", "lines of 2000"),
    "nested tags": ('<?xml version="1.0"?>\n<opencv_storage>' + "<a>\n" * 200_000, "at most 500 brackets and tags"),
    "a list": ("%YAML:1.0\n---\n- 1\n- 2\n", "no keys|FileStorage"),
    "one key missing": (without("R"), "R must be given"),
    "two keys missing": (without("R").replace("K2:", "K3:"), "K2, R must be given, got only D1"),
    "K1 not a matrix": (changed("K1: !!opencv.*?(?=D1)", "K1: 685.51\n"), "K1 must be an opencv-matrix"),
    "K1 2 x 3": (changed(r"(K1: !!opencv-matrix\n   rows: )3(.*?), 0., 0., 1. ]", r"\g<1>2\2 ]"), r"K1 .*\(3, 3\)"),
    "K1 of a lying size": (changed("rows: 3", "rows: 1000000000"), "K1 must have rows x cols entries"),
    "K1 of negative size": (changed("rows: 3\n   cols: 3", "rows: -3\n   cols: -3"), "K1 must have rows x cols"),
    "K1 with a word": (matrix_changed("K1", "a, 0., 479.5, 0., 685.51, 269.5, 0., 0., 1."), "K1 must be a number"),
    "K1 NaN": (matrix_changed("K1", "685.51, 0., .Nan, 0., 685.51, 269.5, 0., 0., 1."), "K1 must be finite .*nan"),
    "K2 inf": (matrix_changed("K2", "685.51, 0., .Inf, 0., 685.51, 269.5, 0., 0., 1."), "K2 must be finite .*inf"),
    "focal length 0": (matrix_changed("K1", "685.51, 0., 479.5, 0., 0., 269.5, 0., 0., 1."), "K1 .*focal .*>= 1 px"),
    "focal length < 0": (matrix_changed("K2", "-1., 0., 479.5, 0., 685.51, 269.5, 0., 0., 1."), "K2 .*focal .*-1"),
    "K1 transposed": (matrix_changed("K1", "685.51, 0., 0., 0., 685.51, 0., 479.5, 269.5, 1."), "K1 must be .*fx"),
    "D1 of 3": (
        matrix_changed("D1", "0., 0., 0.").replace("cols: 5", "cols: 3", 1),
        "D1 must have 4, 5, 8, 12 or 14 coefficients, got 3",
    ),
    "R scaled": (matrix_changed("R", "1.01, 0., 0., 0., 1.01, 0., 0., 0., 1.01"), "R must be a rotation .*1.01"),
    "R mirrored": (matrix_changed("R", "-1., 0., 0., 0., 1., 0., 0., 0., 1."), "R must be a rotation"),
    "no baseline": (matrix_changed("T", "0., 0., 0."), "T must not be zero"),
    "image_size of 1": (changed(r"\[ 960, 540 \]", "[ 960 ]"), "image_size must be a sequence of 2"),
    "image_size 0": (changed(r"\[ 960, 540 \]", "[ 0, 540 ]"), "image_size must be .*0.0, 540"),
    "image_size -5": (changed(r"\[ 960, 540 \]", "[ 960, -5 ]"), "image_size must be"),
    "image_size huge": (changed(r"\[ 960, 540 \]", "[ 960, 10000 ]"), "image_size must be .*8192.*10000"),
    "image_size half": (changed(r"\[ 960, 540 \]", "[ 960.5, 540 ]"), "image_size must be .*whole px"),
    "pose without last row": (
        matrix_changed("world_from_left", "0., 0., 1., -2.4, -1., 0., 0., 0.25, 0., -1., 0., 0., 1., 0., 0., 1."),
        r"world_from_left must end in the row \[0, 0, 0, 1\]",
    ),
    "pose not a rotation": (
        matrix_changed("world_from_left", "0., 0., 1., -2.4, 1., 0., 0., 0.25, 0., -1., 0., 0., 0., 0., 0., 1."),
        "world_from_left .*must be a rotation",
    ),
    "lamp of 3 numbers": (
        matrix_changed("lamps", "0., 0., 0.").replace("rows: 1\n   cols: 4", "rows: 1\n   cols: 3"),
        r"lamps must have the shape \(1, 4\)",
    ),
    "lamp of negative radius": (matrix_changed("lamps", "0., 0., 0., -0.1"), "lamps must have radii >= 0"),
    "pedestal radius 0": (changed("radius: 2.5", "radius: 0."), "pedestal_radius must be > 0"),
    "pedestal radius a word": (changed("radius: 2.5", "radius: wide"), "pedestal_radius must be a number, got 'wide'"),
}


@pytest.mark.parametrize("kind", BAD_RIGS)
def test_a_bad_rig_file_gets_one_error_with_file_key_and_rule_and_a_quiet_terminal(tmp_path, capfd, kind):
    content, said = BAD_RIGS[kind]
    path = tmp_path / "rig.yaml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(RigError, match=said) as caught:
        read_rig(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert len(str(caught.value)) < len(str(path)) + 400
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_what_is_not_a_regular_file_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe.yaml")
    for path, said in ((tmp_path / "pipe.yaml", "regular"), (tmp_path, "regular"), (tmp_path / "none", "No such file")):
        with pytest.raises(RigError, match=said):
            read_rig(path)


@given(st.binary(max_size=300))
def test_no_bytes_crash_the_reader(tmp_path_factory, garbage):
    path = tmp_path_factory.getbasetemp() / "garbage.yaml"
    path.write_bytes(b"%YAML:1.0\n---\n" + garbage)
    with pytest.raises(RigError):
        read_rig(path)


@given(st.integers(0, len(PAPER_RIG) - 1), st.characters(codec="ascii"))
def test_one_wrong_character_gives_a_rig_or_a_rig_error(tmp_path_factory, place, character):
    path = tmp_path_factory.getbasetemp() / "typo.yaml"
    path.write_text(PAPER_RIG[:place] + character + PAPER_RIG[place + 1 :])
    try:
        assert isinstance(read_rig(path), Rig)
    except RigError as error:
        assert str(path) in str(error)  # noqa: PT017


def test_a_rig_built_in_a_program_is_held_to_the_same_rules(make_rig):
    with pytest.raises(RigError, match="T must not be zero"):
        make_rig(T=[0, 0, 0])
    with pytest.raises(RigError, match="K1 must be numbers"):
        make_rig(K1="eye")
