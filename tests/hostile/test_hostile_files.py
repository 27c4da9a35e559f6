"""Damaged calibrations, results, baselines and meshes: refused in a line, or read without a word and a crash."""

import json
import random
import shutil

import numpy as np
import pytest
import trimesh
from damage import damaged_bytes, damaged_text
from verdicts import assert_bearable, assert_refused, leakloc

import leakloc as estimators
from scenarios import bench
from scenarios.cli_bench import read_baseline

KALIBR = """cam0:
  camera_model: pinhole
  distortion_coeffs: [-0.1, 0.02, 0.001, 0.002]
  distortion_model: radtan
  intrinsics: [68.5, 68.5, 47.5, 31.5]
  resolution: [96, 64]
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.5]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_coeffs: [-0.2, 0.03, 3e-3, 0.004]
  distortion_model: radtan
  intrinsics: [68.5, 68.5, 47.5, 31.5]
  resolution: [96, 64]
"""
ROS = """image_width: 96
image_height: 64
camera_matrix: {{rows: 3, cols: 3, data: [68.5, 0.0, 47.5, 0.0, 68.5, 31.5, 0.0, 0.0, 1.0]}}
distortion_model: plumb_bob
distortion_coefficients: {{rows: 1, cols: 5, data: [-0.1, 0.02, 0.001, 0.002, 0.0]}}
rectification_matrix: {{rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}}
projection_matrix: {{rows: 3, cols: 4, data: [68.5, 0.0, 47.5, {shift}, 0.0, 68.5, 31.5, 0.0, 0.0, 0.0, 1.0, 0.0]}}
"""
XML = """<?xml version="1.0"?>
<opencv_storage>
<K1 type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt><data>68.5 0. 47.5 0. 68.5 31.5 0. 0. 1.</data></K1>
<D1 type_id="opencv-matrix"><rows>1</rows><cols>4</cols><dt>d</dt><data>0. 0. 0. 0.</data></D1>
<K2 type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt><data>68.5 0. 47.5 0. 68.5 31.5 0. 0. 1.</data></K2>
<D2 type_id="opencv-matrix"><rows>1</rows><cols>4</cols><dt>d</dt><data>0. 0. 0. 0.</data></D2>
<R type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt><data>1. 0. 0. 0. 1. 0. 0. 0. 1.</data></R>
<T type_id="opencv-matrix"><rows>3</rows><cols>1</cols><dt>d</dt><data>-0.5 0. 0.</data></T>
<image_size>96 64</image_size>
</opencv_storage>
"""


def damaged(texts, kind, seed, numbers, tally, judge):
    """Damage one of several texts a time and let `judge` say what became of it."""
    for number in numbers:
        rng = random.Random(f"{kind} {seed} {number}")
        text = rng.choice(texts)
        raw = damaged_text(text, rng) if isinstance(text, str) else damaged_bytes(text, rng)
        try:
            tally[judge(text, raw)] += 1
        except BaseException as error:
            error.add_note(f"{kind} {number} of seed {seed}: {raw[:3000]!r}")
            raise


@pytest.fixture
def calibrations(tmp_path, small_clip):
    """Texts of every format, and a judge of their damage: the clip is located with it, raw and rectified."""
    shutil.copytree(small_clip, tmp_path / "clip")
    path, result, ros_right = tmp_path / "calibration", tmp_path / "result.json", tmp_path / "right.yaml"
    ros_right.write_text(ROS.format(shift=-34.25))
    rig = (small_clip / "rig.yaml").read_text()

    def judge(text, raw):
        path.write_bytes(raw)
        rigs = ("--rig", path) if "image_width" not in text else ("--rig", path, "--rig", ros_right)
        method = ("paper", "robust")[len(raw) % 2]
        views = (tmp_path / "clip" / "left", tmp_path / "clip" / "right")
        verdict = leakloc("locate", *views, *rigs, "--method", method, "-o", result, inside=tmp_path)
        assert_bearable(verdict)
        if verdict.code == 2:
            assert not result.exists()
            assert str(path) in verdict.error or "image_size" in verdict.error, verdict
            return "refused with exit code 2"
        found = estimators.read_result(result)
        assert np.isfinite([(leak.x_m, leak.y_m) for leak in found.leaks]).all()
        result.unlink()
        return "read as a rig that can be"

    return [rig, rig, KALIBR, ROS.format(shift=0.0), XML], judge


def test_a_damaged_calibration_is_refused_or_is_a_rig_that_can_be(calibrations, tally):
    damaged(calibrations[0], "calibration", 0, range(60), tally, calibrations[1])
    assert sum(tally.values()) == 60
    assert tally["refused with exit code 2"] > 0


@pytest.mark.deep
def test_two_thousand_damaged_calibrations_are_refused_or_are_rigs_that_can_be(calibrations, harness_seed, tally):
    damaged(calibrations[0], "calibration", harness_seed, range(2000), tally, calibrations[1])
    assert sum(tally.values()) == 2000
    assert tally["refused with exit code 2"] > 0


@pytest.fixture
def results(tmp_path, small_clip):
    shutil.copytree(small_clip, tmp_path / "clip")
    path = tmp_path / "result.json"
    for method in ("paper", "robust"):
        assert leakloc("locate", tmp_path / "clip", "-o", tmp_path / f"{method}.json", "--method", method).code == 0

    def judge(text, raw):
        path.write_bytes(raw)
        verdict = leakloc("score", path, tmp_path / "clip", "--json")
        assert_bearable(verdict)
        if verdict.code == 2:
            assert str(path) in verdict.error, verdict
            return "refused with exit code 2"
        said, found = json.loads(raw), estimators.read_result(path)
        assert [(leak["x_m"], leak["y_m"]) for leak in said["leaks"]] == [(leak.x_m, leak.y_m) for leak in found.leaks]
        json.loads(verdict.out)
        return "scored as it says"

    return [(tmp_path / f"{method}.json").read_text() for method in ("paper", "paper", "robust")], judge


def test_a_damaged_result_is_refused_or_scored_as_it_says(results, tally):
    damaged(results[0], "result", 0, range(100), tally, results[1])
    assert sum(tally.values()) == 100
    assert tally["refused with exit code 2"] > 0


@pytest.mark.deep
def test_two_thousand_damaged_results_are_refused_or_scored_as_they_say(results, harness_seed, tally):
    damaged(results[0], "result", harness_seed, range(2000), tally, results[1])
    assert sum(tally.values()) == 2000
    assert tally["refused with exit code 2"] > 0


@pytest.fixture
def baselines(tmp_path, monkeypatch):
    """Baselines of a bench whose trials are made up, for what is compared does not matter here."""
    path = tmp_path / "baseline.json"
    trials = [
        bench.Trial(stratum, number, number != 1, {"all": 1}, {"all": 1}, 0, ("found",), (0.1,))
        for stratum in ("easy", "nominal", "hard")
        for number in range(3)
    ]
    full = [
        bench.Trial(**{**vars(t), "found": dict.fromkeys(bench.COUNTED, 1), "of": dict.fromkeys(bench.COUNTED, 1)})
        for t in trials
    ]
    monkeypatch.setattr(bench, "run_bench", lambda *_: iter(full))
    text = json.dumps({"trials": [{**vars(t)} for t in full]}, indent=1)

    def judge(_, raw):
        path.write_bytes(raw)
        verdict = leakloc("bench", "--method", "naive", "--baseline", path, "--scenes", "3")
        if verdict.code == 1:  # not good enough
            assert "worse than" in verdict.error, verdict
        elif verdict.code == 2 and verdict.out:  # only the run can tell that its scenes are others
            assert "other scenes" in verdict.error, verdict
        else:
            assert_bearable(verdict)
        if verdict.code == 2:
            return "refused with exit code 2"
        right = {(row["stratum"], row["number"]): row["right"] for row in json.loads(raw)["trials"]}
        assert right == {(row["stratum"], row["number"]): row["right"] for row in read_baseline(path)["trials"]}
        return "compared"

    return [text], judge


def test_a_damaged_baseline_is_refused_or_compared_as_it_says(baselines, tally):
    damaged(baselines[0], "baseline", 0, range(50), tally, baselines[1])
    assert sum(tally.values()) == 50
    assert tally["refused with exit code 2"] > 0


@pytest.mark.deep
def test_a_thousand_damaged_baselines_are_refused_or_compared_as_they_say(baselines, harness_seed, tally):
    damaged(baselines[0], "baseline", harness_seed, range(1000), tally, baselines[1])
    assert sum(tally.values()) == 1000
    assert tally["refused with exit code 2"] > 0


@pytest.fixture
def meshes(tmp_path):
    """A small sphere in every kind of file that is read, and a judge of its damage."""
    scenario = tmp_path / "scenario.toml"
    contents = []
    for kind in ("stl", "ply", "obj", "off"):
        shape = trimesh.creation.icosphere(1, 0.2)
        raw = trimesh.exchange.export.export_mesh(shape, None, file_type=kind)
        contents += [raw if isinstance(raw, bytes) else raw.encode()]
    kind_of = dict(zip(contents, ("stl", "ply", "obj", "off"), strict=True))

    def judge(content, raw):
        path = tmp_path / f"mesh.{kind_of[content]}"
        path.write_bytes(raw)
        scenario.write_text(f'[[structure]]\nkind = "mesh"\npath = "{path.name}"\n')
        verdict = leakloc("check", scenario)
        assert_bearable(verdict)
        assert {p.name for p in tmp_path.iterdir()} == {path.name, scenario.name}
        path.unlink()
        assert verdict.code == 0 or f"structure.0.path: {path}: " in verdict.error, verdict
        return "read as a mesh that can be" if verdict.code == 0 else "refused with exit code 2"

    return contents, judge


def test_a_damaged_mesh_is_refused_or_is_a_mesh_that_can_be(meshes, tally):
    damaged(meshes[0], "mesh", 0, range(50), tally, meshes[1])
    assert sum(tally.values()) == 50
    assert tally["refused with exit code 2"] > 0


@pytest.mark.deep
def test_a_thousand_damaged_meshes_are_refused_or_are_meshes_that_can_be(meshes, harness_seed, tally):
    damaged(meshes[0], "mesh", harness_seed, range(1000), tally, meshes[1])
    assert sum(tally.values()) == 1000
    assert tally["refused with exit code 2"] > 0


@pytest.mark.parametrize(
    "text", ["!!int ''", "!!timestamp x", "!!bool x", "!!float ''", "!!binary x", "!!python/name:os.system ''"]
)
def test_a_value_of_a_calibration_that_says_what_it_is_is_refused(tmp_path, small_clip, text):
    # PyYAML believes the tag, and stumbles: AttributeError, IndexError, KeyError
    path = tmp_path / "camchain.yaml"
    path.write_text(KALIBR.replace("pinhole", text, 1))
    assert_refused(leakloc("inspect", small_clip / "left", small_clip / "right", "--rig", path), "tags are not read")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("plumb_bob", "[plumb_bob]", "distortion_model must be one of"),
        ("[68.5, 0.0, 47.5, 0.0, 0.0, 68.5", "[68.5, 68.5, 47.5, 0.0, 68.5, 68.5", "projection_matrix must be"),
        ("data: [1, 0, 0, 0, 1, 0, 0, 0, 1]", "data: [1e200, 0, 0, 0, 1, 0, 0, 0, 1]", "must be numbers up to 1e+06"),
    ],
)
def test_a_ros_calibration_that_cannot_be_is_refused_by_its_key(tmp_path, small_clip, old, new, said):
    path, other = tmp_path / "left.yaml", tmp_path / "right.yaml"
    path.write_text(ROS.format(shift=0.0).replace(old, new, 1))
    other.write_text(ROS.format(shift=-34.25))
    views = (small_clip / "left", small_clip / "right")
    assert_refused(leakloc("inspect", *views, "--rig", path, "--rig", other), said)
