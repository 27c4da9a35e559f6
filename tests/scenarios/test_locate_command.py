"""`leakloc locate` in its three forms: a clip, footage with a calibration, several views."""

import base64
import json
import math
import re
import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from leakloc import Estimate, read_clip
from leakloc.rig_file import read_rig, write_rig
from scenarios.cli import main
from scenarios.report import estimate_html

SIDES = ("left", "right")
SMALL = ["--set", "rig.width_px=480", "--set", "rig.height_px=270", "--set", "gamma.dose_rate_gy_h=1.0"]


def run(*arguments):
    return CliRunner().invoke(main, [str(a) for a in arguments], prog_name="leakloc")


def places(path):
    return sorted((leak["x_m"], leak["y_m"]) for leak in json.loads(path.read_text())["leaks"])


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    folder = tmp_path_factory.mktemp("locate") / "clip"
    result = run("simulate", "crowded_4", "-o", folder, *SMALL)
    assert result.exit_code == 0, result.output
    return folder


@pytest.mark.parametrize("method", ["paper", "robust"])
def test_footage_with_its_calibration_gives_what_its_clip_folder_gives(clip, tmp_path, method):
    assert run("locate", clip, "--method", method, "-o", tmp_path / "a.json").exit_code == 0
    footage = [clip / "left", clip / "right", "--rig", clip / "rig.yaml"]
    result = run("locate", *footage, "--method", method, "-o", tmp_path / "b.json")
    assert result.exit_code == 0, result.output
    assert places(tmp_path / "a.json") == places(tmp_path / "b.json")
    assert len(places(tmp_path / "a.json")) >= 2


def test_views_of_a_rig_that_turned_are_fused_into_one_map(tmp_path):
    # one leak seen by both views, one by the left view alone; the rig stands so that no camera turns into the wall
    drip = "drop_radius_m=0.0115,drip_period_s=0.27"
    leaks = f"leak=[{{x_m=0.6,y_m=0.7,{drip}}},{{x_m=0.0,y_m=2.1,{drip}}}]"
    inside = ["--set", "rig.position_m=[-2.2,0.0,0.0]"]
    views = []
    for pan in (0, 30):
        views.append(tmp_path / f"pan{pan}")
        made = run("simulate", "plain", "-o", views[-1], *SMALL, *inside, "--set", leaks, "--set", f"rig.yaw_deg={pan}")
        assert made.exit_code == 0, made.output
    fused = run("locate", *views, "--pan", "0", "30", "-o", tmp_path / "map.json", "--method", "robust")
    assert fused.exit_code == 0, fused.output
    found = places(tmp_path / "map.json")
    for true in ((0.6, 0.7), (0.0, 2.1)):
        assert min(math.dist(true, place) for place in found) < 0.1
    assert len(found) < 2 * 2  # merged: each view alone gives one or both


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["{clip}", "--pan", "-40", "0"], "an angle for each of the 1 views, got 2"),
        (["{clip}", "{clip}", "{clip}", "--rig", "{clip}/rig.yaml"], "two paths"),
        (["{clip}", "--k-sigma", "3", "--method", "robust"], "belong to --method paper"),
        (["{clip}/left", "{clip}/left", "--rig", "{clip}/rig.yaml"], "two cameras"),
        (["{clip}/left", "{clip}/right", "--rig", "{clip}/input.json"], "input.json"),
        (["{clip}/left", "{clip}/nowhere", "--rig", "{clip}/rig.yaml"], "nowhere"),
        (["{clip}/left"], "left"),
        (["{clip}", "{clip}"], "--pan must say how they turned"),
        (["{clip}", "{clip}", "--pan"], "an angle for each of the 2 views, got 0"),
        (["{clip}", "--expected-false-leaks", "0.1", "--method", "paper"], "belongs to --method robust"),
    ],
)
def test_a_call_that_cannot_be_meant_is_refused(clip, arguments, words):
    result = run("locate", *(word.format(clip=clip) for word in arguments))
    assert result.exit_code == 2, result.output
    assert words in result.output
    assert "Traceback" not in result.output


def test_inspect_says_how_the_rig_stands_and_what_was_seen(tmp_path):
    tilted = [*SMALL, "--set", "rig.roll_deg=1.5", "--set", "rig.pitch_deg=1.0"]
    assert run("simulate", "crowded_4", "-o", tmp_path / "clip", *tilted).exit_code == 0
    said = run("inspect", tmp_path / "clip")
    assert said.exit_code == 0, said.output
    assert "the views are in step" in said.output
    levelling = json.loads(run("inspect", tmp_path / "clip", "--json").output)["levelling"]
    assert levelling["roll_deg"] == pytest.approx(1.5, abs=0.3)
    assert levelling["pitch_deg"] == pytest.approx(1.0, abs=0.5)


def test_a_page_of_pictures_is_written(clip, tmp_path):
    assert run("locate", clip, "--figure", tmp_path / "found.html").exit_code == 0
    page = (tmp_path / "found.html").read_text()
    assert page.count("<svg") == 2
    assert page.count("<img") == 4


def test_the_papers_other_subtractors_can_be_chosen(clip, tmp_path):
    for subtractor in ("median", "mean", "mog2"):
        result = run(
            "locate", clip, "--method", "paper", "--subtractor", subtractor, "-o", tmp_path / f"{subtractor}.json"
        )
        assert result.exit_code == 0, result.output
    profiles = {
        name: json.loads((tmp_path / f"{name}.json").read_text())["diagnostics"]["left"]["profile_grey"]
        for name in ("median", "mean", "mog2")
    }
    assert profiles["median"] != profiles["mean"]
    assert profiles["median"] != profiles["mog2"]


def test_a_view_that_knows_where_it_stands_and_one_that_does_not_make_no_map(clip, tmp_path):
    lost = tmp_path / "lost"
    for name in ("left", "right"):
        shutil.copytree(clip / name, lost / name)
    shutil.copy(clip / "input.json", lost)
    write_rig(replace(read_rig(clip / "rig.yaml"), world_from_left=None), lost / "rig.yaml")
    result = run("locate", clip, lost)
    assert result.exit_code == 2, result.output
    assert "all must state world_from_left, or none" in result.output


@pytest.mark.parametrize("bits", [10, 12, 16])
def test_pictures_of_deeper_frames_are_shown_as_those_of_8_bit(clip, bits):
    footage = read_clip(clip)
    deeper = replace(footage, **{side: getattr(footage, side).astype(np.uint16) << (bits - 8) for side in SIDES})
    shown, expected = (pictures_of(estimate_html("a", one, Estimate("m", "world", ()))) for one in (deeper, footage))
    for picture, same in zip(shown[:4], expected[:4], strict=True):
        assert picture.mean() == pytest.approx(same.mean(), rel=0.02, abs=0.5)
    assert shown[0].mean() < 200


def pictures_of(page):
    pngs = re.findall(r"data:image/png;base64,([A-Za-z0-9+/=]+)", page)
    return [cv2.imdecode(np.frombuffer(base64.b64decode(png), np.uint8), cv2.IMREAD_GRAYSCALE) for png in pngs]
