"""Exports of a clip: what is read back is what the clip holds, and what cannot be read back is refused."""

import csv
import json
import shutil
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from leakloc import read_clip
from scenarios.build import build_recording, build_scene, true_rig
from scenarios.cli import main
from scenarios.export_coco import CATEGORIES, coco_annotations, instances, parts
from scenarios.export_csv import read_truth_csv, truth_csv
from scenarios.export_video import check_video, write_video
from scenarios.output_folder import OutputError
from scenarios.run_length import decoded, encoded
from scenarios.scenario import Scenario
from scenarios.truth import read_truth

SMALL = ["rig.width_px=160", "rig.height_px=90", "recording.n_frames=3", "layout.n_leaks=2"]


def run(*arguments):
    return CliRunner().invoke(main, [str(a) for a in arguments])


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    folder = tmp_path_factory.mktemp("exports") / "clip"
    words = [word for value in SMALL for word in ("--set", value)]
    assert run("simulate", "two_lamps", "-o", folder, *words).exit_code == 0
    return folder


@pytest.fixture(scope="module")
def exported(clip):
    result = run("export", clip, "--video", "--coco", "--csv", "-o", clip.parent / "out")
    assert result.exit_code == 0, result.output
    return clip.parent / "out"


def scenario_of(clip):
    return Scenario.model_validate(tomllib.loads((clip / "scenario.toml").read_text()))


def test_the_videos_hold_every_pixel_of_the_clip(clip, exported):
    frames = read_clip(clip)
    for side in ("left", "right"):
        video, seen = cv2.VideoCapture(str(exported / f"{side}.avi")), []
        while (read := video.read())[0]:
            seen.append(read[1][:, :, 0])
        assert np.array_equal(np.stack(seen), getattr(frames, side))
        assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(12.0)


def test_the_videos_are_footage_that_locate_reads(clip, exported, tmp_path):
    result = run("locate", exported / "left.avi", exported / "right.avi", "--rig", clip / "rig.yaml")
    assert result.exit_code == 0, result.output


def test_a_video_that_reads_back_differently_is_refused_by_frame(tmp_path):
    frames = np.random.default_rng(0).integers(0, 256, (4, 20, 30), dtype=np.uint8)
    write_video(frames, 12.0, tmp_path / "a.avi")
    meant = frames.copy()
    meant[2, 5, 5] ^= 1
    with pytest.raises(OutputError, match="frame 2 reads back differently"):
        check_video(meant, tmp_path / "a.avi")
    with pytest.raises(OutputError, match="reads back as"):
        check_video(frames[:3], tmp_path / "a.avi")
    (tmp_path / "a.avi").write_bytes((tmp_path / "a.avi").read_bytes()[:3000])
    with pytest.raises(OutputError, match=r"a\.avi: "):
        check_video(frames, tmp_path / "a.avi")


def test_a_video_on_a_full_disk_is_refused():
    frames = np.random.default_rng(0).integers(0, 256, (4, 20, 30), dtype=np.uint8)
    with pytest.raises(OutputError, match="/dev/full"):
        write_video(frames, 12.0, Path("/dev/full"))


def test_every_leak_has_drops_and_shadows_where_its_columns_are(clip, exported):
    coco, truth = json.loads((exported / "annotations.json").read_text()), read_truth(clip / "truth.json")
    names = {image["file_name"] for image in coco["images"]}
    assert names == {f"{side}/{n:04d}.png" for side in ("left", "right") for n in range(3)}
    sides = {image["id"]: image["camera"] for image in coco["images"]}
    for leak in truth.leaks:
        for side in ("left", "right"):
            mine = [a for a in coco["annotations"] if a["leak_id"] == leak.id and sides[a["image_id"]] == side]
            drops = [a for a in mine if a["category_id"] == CATEGORIES["drop"]]
            assert drops
            column_px = getattr(leak, f"{side}_column_px")
            for drop in drops:
                left_px, _, width_px, _ = drop["bbox"]
                assert left_px - 2 <= column_px <= left_px + width_px + 1  # the rig is level: columns are plumb
    assert {a["category_id"] for a in coco["annotations"]} == set(CATEGORIES.values())
    assert [a["id"] for a in coco["annotations"]] == list(range(1, len(coco["annotations"]) + 1))


def test_the_masks_of_the_annotations_are_those_of_the_simulator(clip, exported):
    coco, scenario = json.loads((exported / "annotations.json").read_text()), scenario_of(clip)
    image = next(image for image in coco["images"] if image["file_name"] == "right/0001.png")
    written = [a for a in coco["annotations"] if a["image_id"] == image["id"]]
    meant = list(instances(build_scene(scenario), true_rig(scenario).right, build_recording(scenario), 1))
    assert len(written) == len(meant) > 4
    for annotation, instance in zip(written, meant, strict=True):
        mask = decoded(annotation["segmentation"])
        assert np.array_equal(mask, instance.pixels)
        left, top, width, height = annotation["bbox"]
        assert mask[top : top + height, left : left + width].sum() == mask.sum() == annotation["area"] > 0


def test_a_scene_without_drop_shadows_has_no_shadow_annotated(clip):
    dark = scenario_of(clip)
    dark = dark.model_copy(update={"effects": dark.effects.model_copy(update={"drop_shadows": False})})
    assert {a["category_id"] for a in coco_annotations(dark)["annotations"]} == {CATEGORIES["drop"]}


def test_a_slow_drop_does_not_hide_a_fast_one_beside_it():
    share = np.zeros((20, 10))
    share[2:4, 5], share[10:18, 5] = 0.8, 0.05
    share[18, 5] = 0.005  # the end of the streak, covered a tenth of the time
    assert [int(part.sum()) for part in parts(share)] == [2, 8]


@given(arrays(bool, st.tuples(st.integers(1, 7), st.integers(1, 7))))
def test_run_lengths_decode_to_the_mask_they_encode(mask):
    code = encoded(mask)
    assert np.array_equal(decoded(code), mask)
    assert all(count > 0 for count in code["counts"][1:])


def test_run_lengths_run_down_the_columns_and_begin_with_zeros():
    assert encoded(np.array([[1, 0], [1, 1]], bool)) == {"counts": [0, 2, 1, 1], "size": [2, 2]}
    assert encoded(np.zeros((2, 3), bool)) == {"counts": [6], "size": [2, 3]}
    with pytest.raises(ValueError, match="add up to 5"):
        decoded({"counts": [5], "size": [2, 3]})


def test_the_table_holds_the_truth(clip, exported):
    truth = read_truth(clip / "truth.json")
    text = (exported / "truth.csv").read_text()
    assert tuple(read_truth_csv(text)) == truth.leaks
    rows = list(csv.DictReader(text.splitlines()))
    assert [float(row["x_m"]) for row in rows] == [leak.x_m for leak in truth.leaks]
    assert [row["left_shadow_columns_px"].count(";") for row in rows] == [1, 1]  # two lamps


def test_undefined_is_empty_in_the_table_and_null_in_the_truth(clip):
    truth = read_truth(clip / "truth.json")
    hidden = truth.leaks[0].model_copy(update={"left_column_px": None, "column_snr": None, "reason": "a, b"})
    changed = truth.model_copy(update={"leaks": (hidden,)})
    assert tuple(read_truth_csv(truth_csv(changed))) == (hidden,)


def test_an_export_replaces_an_export_by_force_alone_and_nothing_else_ever(clip, exported, tmp_path):
    again = run("export", clip, "--csv", "-o", exported)
    assert (again.exit_code, "--force" in again.output) == (2, True)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("precious")
    refused = run("export", clip, "--csv", "-o", tmp_path / "mine", "--force")
    assert (refused.exit_code, "never replaced" in refused.output) == (2, True)
    assert run("export", clip, "--csv", "-o", tmp_path / "out").exit_code == 0
    assert run("export", clip, "--coco", "-o", tmp_path / "out", "--force").exit_code == 0
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["annotations.json", "export.json"]


@pytest.mark.parametrize("where", ["{clip}", "{clip}/left/out", "{clip}/.."])
def test_an_export_does_not_touch_its_clip(clip, where):
    result = run("export", clip, "--csv", "-o", where.format(clip=clip), "--force")
    assert (result.exit_code, "apart from" in result.output) == (2, True)


def test_a_clip_whose_truth_was_changed_is_not_exported(clip, tmp_path):
    own = shutil.copytree(clip, tmp_path / "clip")
    (own / "truth.json").write_text("{}")
    result = run("export", own, "--csv", "-o", tmp_path / "out")
    assert (result.exit_code, "truth.json" in result.output) == (2, True)
    assert not (tmp_path / "out").exists()
    assert run("export", own, "-o", tmp_path / "out").exit_code == 2
