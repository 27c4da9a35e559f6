"""Each format is written here by hand, from its documentation, for one rig that a reader can check."""

import os

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from leakloc import Rig, RigError, read_rig, write_rig
from leakloc.calibration import read_calibration

# Both cameras look along z; the right one stands 0.5 m to the right: a point 2 m ahead of the left camera,
# (0, 0, 2), is at (-0.5, 0, 2) for the right one, so T = (-0.5, 0, 0).
OPENCV = """%YAML:1.0
---
{K1}: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 700., 0., 320., 0., 710., 240., 0., 0., 1. ]
{D1}: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.1, 0.02, 0.001, 0.002, 0. ]
{K2}: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 690., 0., 330., 0., 700., 250., 0., 0., 1. ]
{D2}: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.2, 0.03, 0.003, 0.004, 0. ]
"""
OPENCV_POSE = """R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1., 0., 0., 0., 1., 0., 0., 0., 1. ]
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ -0.5, 0., 0. ]
"""
NAMES = (
    ("K1", "D1", "K2", "D2"),
    ("M1", "D1", "M2", "D2"),
    ("cameraMatrix1", "distCoeffs1", "cameraMatrix2", "distCoeffs2"),
    ("camera_matrix_1", "dist_coeffs_1", "camera_matrix_2", "dist_coeffs_2"),
)

KALIBR = """cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.1, 0.02, 0.001, 0.002]
  distortion_model: radtan
  intrinsics: [700.0, 710.0, 320.0, 240.0]
  resolution: [640, 480]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.5]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [0]
  camera_model: pinhole
  distortion_coeffs: [-0.2, 0.03, 3e-3, 0.004]
  distortion_model: radtan
  intrinsics: [690.0, 700.0, 330.0, 250.0]
  resolution: [640, 480]
  rostopic: /cam1/image_raw
"""

ROS = """image_width: 640
image_height: 480
camera_name: narrow_stereo/{name}
camera_matrix:
  rows: 3
  cols: 3
  data: [{fx}, 0.0, {cx}, 0.0, {fy}, {cy}, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [{D}, 0.0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [{R}]
projection_matrix:
  rows: 3
  cols: 4
  data: [680.0, 0.0, 315.0, {shift}, 0.0, 680.0, 245.0, 0.0, 0.0, 0.0, 1.0, 0.0]
"""
STRAIGHT = "1, 0, 0, 0, 1, 0, 0, 0, 1"
LEFT = {"name": "left", "fx": 700, "fy": 710, "cx": 320, "cy": 240, "D": "-0.1, 0.02, 0.001, 0.002", "shift": 0}
# -fx' B = -680 * 0.5; "3e-3" without a point is a word in YAML 1.1
RIGHT = {"name": "right", "fx": 690, "fy": 700, "cx": 330, "cy": 250, "D": "-0.2, 0.03, 3e-3, 0.004", "shift": -340.0}


def ros(camera, R=STRAIGHT, **changes):
    return ROS.format(**(camera | changes), R=R)


def written(folder, **files):
    paths = []
    for name, text in files.items():
        path = folder / f"{name}.yaml"
        path.write_text(text)
        paths.append(path)
    return paths[0] if len(paths) == 1 else tuple(paths)


def check_the_rig(rig, n_coefficients):
    assert rig.K1.tolist() == [[700, 0, 320], [0, 710, 240], [0, 0, 1]]
    assert rig.K2.tolist() == [[690, 0, 330], [0, 700, 250], [0, 0, 1]]
    assert rig.D1.tolist() == [-0.1, 0.02, 0.001, 0.002, 0][:n_coefficients]
    assert rig.D2.tolist() == [-0.2, 0.03, 0.003, 0.004, 0][:n_coefficients]
    assert rig.R.tolist() == np.eye(3).tolist()
    assert rig.T.tolist() == [-0.5, 0, 0]
    assert rig.image_size == (640, 480)
    assert rig.frame == "left camera"
    # 2 m ahead and level with the left camera: x forward, y left; the right camera is 0.5 m to the right of it
    np.testing.assert_allclose(rig.right_from_frame @ [2, 0, 0, 1], [-0.5, 0, 2, 1], atol=1e-15)
    np.testing.assert_allclose(rig.right_from_frame @ [0, -0.5, 0, 1], [0, 0, 0, 1], atol=1e-15)


@pytest.mark.parametrize("names", NAMES, ids=lambda names: names[0])
def test_stereo_calibrates_matrices_are_read_under_the_names_that_people_give_them(tmp_path, names):
    text = OPENCV.format(**dict(zip(("K1", "D1", "K2", "D2"), names, strict=True))) + OPENCV_POSE
    check_the_rig(read_calibration(written(tmp_path, stereo=text), image_size=(640, 480)), 5)
    for size in ("image_size: [ 640, 480 ]\n", "imageSize: [ 640, 480 ]\n", "image_width: 640\nimage_height: 480\n"):
        check_the_rig(read_calibration(written(tmp_path, stereo=text + size), image_size=(1, 1)), 5)


def test_intrinsics_and_extrinsics_in_two_files_make_one_rig_in_either_order(tmp_path):
    intrinsics, extrinsics = written(
        tmp_path, i=OPENCV.format(K1="M1", D1="D1", K2="M2", D2="D2"), e="%YAML:1.0\n---\n" + OPENCV_POSE
    )
    for pair in ((intrinsics, extrinsics), (extrinsics, intrinsics)):
        check_the_rig(read_calibration(pair, image_size=(640, 480)), 5)


def test_xml_is_read_and_a_full_rig_file_keeps_its_pose_and_lamps(tmp_path, make_rig):
    storage = cv2.FileStorage(str(tmp_path / "stereo.xml"), cv2.FILE_STORAGE_WRITE)
    for key in ("K1", "D1", "K2", "D2", "R", "T"):
        storage.write(key, np.array(getattr(make_rig(), key)))
    storage.release()
    assert read_calibration(tmp_path / "stereo.xml", image_size=(960, 540)).K1.tolist() == make_rig().K1.tolist()
    write_rig(make_rig(lamps=[[-2.4, 0, 0.3, 0.1]], pedestal_radius=2.5), tmp_path / "rig.yaml")
    ours, theirs = read_calibration(tmp_path / "rig.yaml"), read_rig(tmp_path / "rig.yaml")
    for key in ("world_from_left", "lamps", "T", "D2"):
        assert np.array_equal(getattr(ours, key), getattr(theirs, key))
    assert (ours.frame, ours.pedestal_radius) == ("world", 2.5)


def test_a_kalibr_camchain_gives_the_rig(tmp_path):
    check_the_rig(read_calibration(written(tmp_path, camchain=KALIBR)), 4)


def test_a_pair_of_ros_camera_infos_gives_the_rig(tmp_path):
    check_the_rig(read_calibration(written(tmp_path, left=ros(LEFT), right=ros(RIGHT))), 5)


@pytest.mark.parametrize("end", ["", "---\n", "---", "...\n"])
@pytest.mark.parametrize("keys", [("K", "D", "R", "P"), ("k", "d", "r", "p")])
def test_dumped_camera_info_messages_give_the_rig(tmp_path, keys, end):
    def message(camera):
        K, D, R, P = keys
        return (
            f"height: 480\nwidth: 640\ndistortion_model: plumb_bob\n{D}: [{camera['D']}, 0.0]\n"
            f"{K}: [{camera['fx']}, 0, {camera['cx']}, 0, {camera['fy']}, {camera['cy']}, 0, 0, 1]\n{R}: [{STRAIGHT}]\n"
            f"{P}: [680, 0, 315, {camera['shift']}, 0, 680, 245, 0, 0, 0, 1, 0]\n{end}"
        )

    check_the_rig(read_calibration(written(tmp_path, left=message(LEFT), right=message(RIGHT))), 5)


def test_a_right_camera_turned_outwards_by_hand_keeps_its_sense_in_every_format(tmp_path):
    """The right camera turned 90 deg to the right (its z is the left one's x): R = [[0, 0, -1], [0, 1, 0], [1, 0, 0]].

    A point 3 m to the right of the left camera, (3, 0, 0), lies 2.5 m straight ahead of the right one.
    """
    R, T = [[0, 0, -1], [0, 1, 0], [1, 0, 0]], [0.0, 0.0, -0.5]
    point = Rig(np.eye(3), np.zeros(5), np.eye(3), np.zeros(5), R, T, (9, 9)).right_from_frame @ [0, -3, 0, 1]
    np.testing.assert_allclose(point, [0, 0, 2.5, 1], atol=1e-15)
    small = Rotation.from_rotvec(
        [0, np.radians(-2), 0]
    ).as_matrix()  # a little of the same, so that T.x stays the largest
    assert small[2, 0] > 0
    small_T = -small @ [0.5, 0, 0]
    rows = "".join(f"  - [{a}, {b}, {c}, {t}]\n" for (a, b, c), t in zip(small.tolist(), small_T.tolist(), strict=True))
    head, tail = KALIBR.split("  - [1.0, 0.0, 0.0, -0.5]\n")
    kalibr = head + rows + tail.split("  - [0.0, 0.0, 1.0, 0.0]\n")[1]
    # ROS: rectified axes are the left camera's, so R_left = 1 and R_right = small^T, which turns camera 2 back
    right = ros(RIGHT, R=", ".join(map(str, small.T.ravel().tolist())))
    for rig in (
        read_calibration(written(tmp_path, camchain=kalibr)),
        read_calibration(written(tmp_path, left=ros(LEFT), right=right)),
    ):
        np.testing.assert_allclose(rig.R, small, atol=1e-12)
        np.testing.assert_allclose(rig.T, small_T, atol=1e-12)


@given(
    st.tuples(*[st.floats(-10, 10)] * 3),
    st.tuples(st.floats(-0.5, -0.1), st.floats(-0.05, 0.05), st.floats(-0.05, 0.05)),
)
def test_ros_files_that_stereo_rectify_fills_give_back_r_and_t(tmp_path_factory, make_rig, angles_deg, T):
    folder = tmp_path_factory.getbasetemp()
    R = Rotation.from_euler("xyz", angles_deg, degrees=True).as_matrix()
    raw = make_rig(R=R, T=T)
    R1, R2, P1, P2, *_ = cv2.stereoRectify(raw.K1, raw.D1, raw.K2, raw.D2, raw.image_size, R, raw.T[:, None])
    for name, K, turn, P in (("left", raw.K1, R1, P1), ("right", raw.K2, R2, P2)):
        (folder / f"{name}.yaml").write_text(
            f"image_width: 960\nimage_height: 540\ndistortion_model: plumb_bob\nD: [0, 0, 0, 0, 0]\n"
            f"K: {K.ravel().tolist()}\nR: {turn.ravel().tolist()}\nP: {P.ravel().tolist()}\n"
        )
    rig = read_calibration((folder / "left.yaml", folder / "right.yaml"))
    np.testing.assert_allclose(rig.R, R, atol=2e-5)  # stereoRectify takes 1e-5 rad for none
    np.testing.assert_allclose(rig.T, T, atol=1e-5)


def test_a_rational_polynomial_lens_keeps_its_eight_coefficients(tmp_path):
    rational = ros(LEFT, D="1, 2, 3, 4, 5, 6, 7").replace("plumb_bob", "rational_polynomial")
    rig = read_calibration(written(tmp_path, left=rational, right=ros(RIGHT)))
    assert rig.D1.tolist() == [1, 2, 3, 4, 5, 6, 7, 0]


STEREO = OPENCV.format(K1="K1", D1="D1", K2="K2", D2="D2") + OPENCV_POSE + "image_size: [ 640, 480 ]\n"
SWAPPED = "left and right seem to be swapped"
BAD = {
    "kalibr swapped": ([KALIBR.replace("-0.5]", "0.5]")], rf"T.x must be < 0 .* got 0.5: {SWAPPED}"),
    "opencv swapped": ([STEREO.replace("-0.5", "0.5")], rf"T.x must be < 0 .* got 0.5: {SWAPPED}"),
    "ros swapped": ([ros(RIGHT), ros(LEFT)], rf"0.yaml and .*1.yaml: T.x must be < 0 .* got 0.5: {SWAPPED}"),
    "one above the other": ([STEREO.replace("-0.5, 0., 0.", "0., -0.5, 0.")], "cameras side by side"),
    "millimetres": ([STEREO.replace("-0.5, 0., 0.", "-500., 0., 0.")], "at most 10 m long.*millimetres"),
    "no size": ([STEREO.replace("image_size", "rms")], "image_size must be given"),
    "no T": ([STEREO.replace("T:", "E:")], "T must be given, got only D1, D2, K1, K2, R, image_size"),
    "two names": ([STEREO.replace("image_size", "M1: 3\nimage_size")], "K1 must be given once, got K1 and M1"),
    "K1 a number": (
        [STEREO.replace("K1: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data:", "K1:")],
        "K1 must",
    ),
    "two that differ": ([STEREO, STEREO.replace("700.,", "701.,", 1)], "K1 must be given once, got two that differ"),
    "unlike pair": ([STEREO, KALIBR], "1.yaml: must be OpenCV FileStorage as .*0.yaml, got Kalibr camchain"),
    "no known format": (["fx: 700\nfy: 710\n"], "must be OpenCV FileStorage .* or a Kalibr camchain"),
    "not yaml": (["a: [1, 2"], "not YAML: "),
    "words": (["hello"], "must be YAML with keys at the top"),
    "empty": ([""], "empty"),
    "deep": (["\n".join(" " * n + "a:" for n in range(300))], "nested too deeply|must be OpenCV"),
    "many characters": (["a: 1\n" * 20_000], "at most 65536 characters"),
    "repeats of repeats": (["a: &a [1]\ncam0: [*a, *a]\n"], "aliases are not read"),
    "a tag": (["cam0: !!python/object/apply:os.system ['true']\n"], r"tags are not read"),
    "a number too long": (["cam0: " + "9" * 9000 + "\n"], "not YAML|at most|lines of 2000"),
    "kalibr pair": ([KALIBR, KALIBR], "must be one file that holds both cameras"),
    "kalibr of one": ([KALIBR.split("cam1:")[0]], "must have cam0 and cam1, got cam0"),
    "kalibr of three": ([KALIBR + "cam2: 1\n"], "must have cam0 and cam1, got cam0, cam1, cam2"),
    "fisheye": ([KALIBR.replace("radtan", "equidistant", 1)], "cam0.distortion_model must be radtan .* 'equidistant'"),
    "omni": ([KALIBR.replace("pinhole", "omni", 1)], "cam0.camera_model must be pinhole, got 'omni'"),
    "no pose": ([KALIBR.replace("T_cn_cnm1", "T_cam_imu")], "T_cn_cnm1 must be given"),
    "pose of 3 rows": (
        [KALIBR.replace("  - [0.0, 0.0, 0.0, 1.0]\n", "")],
        "cam1.T_cn_cnm1 must have 16 numbers, got 12",
    ),
    "ragged pose": ([KALIBR.replace("[0.0, 0.0, 0.0, 1.0]", "[1.0]")], "cam1.T_cn_cnm1 must be numbers"),
    "pose upside down": ([KALIBR.replace("0.0, 1.0]", "0.5, 1.0]")], r"must end in the row \[0, 0, 0, 1\]"),
    "three intrinsics": ([KALIBR.replace("320.0, 240.0", "320.0")], "cam0.intrinsics must have 4 numbers, got 3"),
    "two sizes": ([KALIBR.replace("480]", "481]", 1)], "cam1.resolution must be cam0's"),
    "cam0 a number": (["cam0: 1\ncam1: 2\n"], "cam0 must be a mapping"),
    "ros of one": ([ros(LEFT)], "must be a pair of files, left and right"),
    "ros fisheye": (
        [ros(LEFT), ros(RIGHT).replace("plumb_bob", "equidistant")],
        "1.yaml: distortion_model .*'equidistant'",
    ),
    "ros of 4 + 8": ([ros(LEFT).replace("plumb_bob", "rational_polynomial"), ros(RIGHT)], "8 or 12 or 14, got 5"),
    "ros without offset": ([ros(LEFT), ros(RIGHT, shift=0)], "T must not be zero"),
    "ros not calibrated": ([ros(LEFT), ros(RIGHT).replace("680.0", "0.0")], "1.yaml: projection_matrix must be"),
    "ros of words": ([ros(LEFT, fx="wide"), ros(RIGHT)], "0.yaml: camera_matrix must be numbers, got .*wide"),
    "ros not a number": ([ros(LEFT, fx=".nan"), ros(RIGHT)], "0.yaml: camera_matrix must be a list of finite numbers"),
    "ros mirrored": ([ros(LEFT), ros(RIGHT, R="1, 0, 0, 0, 1, 0, 0, 0, -1")], "R must be a rotation"),
    "ros of two sizes": ([ros(LEFT), ros(RIGHT).replace("640", "641")], "one image size"),
    "ros without a size": (
        [ros(LEFT).replace("image_width", "w"), ros(RIGHT)],
        "image_width and image_height must be given",
    ),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_calibration_gets_one_error_with_file_key_and_rule_and_a_quiet_terminal(tmp_path, capfd, kind):
    texts, said = BAD[kind]
    paths = tuple(tmp_path / f"{number}.yaml" for number in range(len(texts)))
    for path, text in zip(paths, texts, strict=True):
        path.write_text(text)
    with pytest.raises(RigError, match=said) as caught:
        read_calibration(paths)
    assert str(caught.value).startswith(f"{tmp_path}")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 2 * len(str(tmp_path)) + 500
    assert capfd.readouterr() == ("", "")


def test_three_files_are_no_calibration_and_pipes_are_not_waited_for(tmp_path):
    with pytest.raises(RigError, match="one file or a pair, got 3"):
        read_calibration(("a", "b", "c"))
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(RigError, match="pipe: must be a regular file"):
        read_calibration(tmp_path / "pipe")


@pytest.mark.parametrize("text", [KALIBR, ros(LEFT), STEREO], ids=["kalibr", "ros", "opencv"])
@given(data=st.data())
def test_one_wrong_character_gives_a_rig_or_a_rig_error(tmp_path_factory, text, data):
    place, character = data.draw(st.integers(0, len(text) - 1)), data.draw(st.characters(codec="ascii"))
    path, right = (tmp_path_factory.getbasetemp() / name for name in ("typo.yaml", "right.yaml"))
    path.write_text(text[:place] + character + text[place + 1 :])
    right.write_text(ros(RIGHT))
    try:
        assert isinstance(read_calibration((path, right) if text == ros(LEFT) else path), Rig)
    except RigError as error:
        assert "typo.yaml" in str(error)  # noqa: PT017
