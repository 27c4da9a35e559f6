"""The command line: help for each command, one clear error and exit code 2 for bad input, files by the contract."""

import json
import shutil
import subprocess
import sys

import cv2
import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

from scenarios.cli import main

SMALL = ["--set", "rig.width_px=240", "--set", "rig.height_px=136", "--set", "recording.n_frames=6"]


def run(*arguments):
    return CliRunner().invoke(main, [str(a) for a in arguments], prog_name="leakloc")


def assert_refused(result, *words):
    assert result.exit_code == 2, result.output
    assert "Traceback" not in result.output
    for word in words:
        assert word in result.output


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cli") / "clip"
    result = run("simulate", "separated", "-o", folder, *SMALL)
    assert result.exit_code == 0, result.output
    return folder


@pytest.fixture
def own_clip(clip, tmp_path):
    return shutil.copytree(clip, tmp_path / "clip")


@pytest.mark.parametrize("command", sorted(main.commands))
def test_every_command_has_help(command):
    result = run(command, "--help")
    assert result.exit_code == 0
    assert main.commands[command].help.splitlines()[0] in " ".join(result.output.split())


def test_the_module_is_the_program():
    done = subprocess.run([sys.executable, "-m", "scenarios", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("leakloc, version ")


def test_a_clip_folder_holds_the_files_of_the_contract(clip):
    names = {str(path.relative_to(clip)) for path in clip.rglob("*") if path.is_file()}
    frames = {f"{side}/{n:04d}.png" for side in ("left", "right") for n in range(6)}
    assert names == frames | {"rig.yaml", "input.json", "clip.json", "truth.json", "scenario.toml"}
    assert json.loads((clip / "input.json").read_text())["n_frames"] == 6
    assert cv2.imread(str(clip / "left" / "0000.png"), cv2.IMREAD_UNCHANGED).shape == (136, 240)


def test_simulate_locate_and_score_join_up(clip, tmp_path):
    located = run("locate", clip, "-o", tmp_path / "result.json")
    assert located.exit_code == 0, located.output
    scored = run("score", tmp_path / "result.json", clip, "--json")
    assert scored.exit_code == 0, scored.output
    assert set(json.loads(scored.output)) == {"gated", "paper_rule"}
    assert "in view" in run("score", tmp_path / "result.json", clip).output


def test_the_resolved_scenario_of_a_clip_makes_the_same_clip_again(clip, tmp_path):
    again = tmp_path / "again"
    assert run("simulate", clip / "scenario.toml", "-o", again).exit_code == 0
    sums = [json.loads((folder / "clip.json").read_text())["files"] for folder in (clip, again)]
    assert sums[0] == sums[1]


def test_another_seed_is_another_scene_and_other_noise(clip, tmp_path):
    other = tmp_path / "other"
    assert run("simulate", "separated", "-o", other, *SMALL, "--seed", "77").exit_code == 0
    places = [
        {(leak["x_m"], leak["y_m"]) for leak in json.loads((f / "truth.json").read_text())["leaks"]}
        for f in (clip, other)
    ]
    assert not places[0] & places[1]


def test_a_clip_is_not_overwritten_without_force(own_clip):
    before = (own_clip / "clip.json").read_bytes()
    assert_refused(run("simulate", "separated", "-o", own_clip, *SMALL, "--seed", "5"), "already exists", "--force")
    assert (own_clip / "clip.json").read_bytes() == before
    assert run("simulate", "separated", "-o", own_clip, *SMALL, "--seed", "5", "--force").exit_code == 0
    assert json.loads((own_clip / "clip.json").read_text())["seed"] == 5


def test_a_bad_scenario_writes_nothing(tmp_path):
    bad = tmp_path / "bad.toml"
    bad.write_text("[rig]\nbaseline_m = -1\nwidth = 3\n")
    result = run("simulate", bad, "-o", tmp_path / "out")
    assert_refused(result, "rig.baseline_m must be > 0, got -1", "rig.width is not a known key")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bad.toml"]
    assert_refused(run("check", bad), str(bad))


def damage_frame(folder):
    path = folder / "left" / "0003.png"
    raw = bytearray(path.read_bytes())
    raw[len(raw) // 2] ^= 1
    path.write_bytes(raw)
    return "left/0003.png"


def drop_frame(folder):
    (folder / "right" / "0005.png").unlink()
    return "right/0005.png"


def repaint_frame(folder):
    cv2.imwrite(str(folder / "right" / "0001.png"), np.zeros((136, 240), np.uint8))
    return "right/0001.png"


def add_frame(folder):
    shutil.copy(folder / "left" / "0000.png", folder / "left" / "0006.png")
    return "left/0006.png"


def change_truth(folder):
    (folder / "truth.json").write_text("{}")
    return "truth.json"


def cut_manifest(folder):
    path = folder / "clip.json"
    path.write_text(path.read_text()[:100])
    return "clip.json"


def test_the_truth_is_not_looked_at_by_locate_and_must_be_whole_for_score(own_clip, tmp_path):
    change_truth(own_clip)
    assert run("locate", own_clip, "-o", tmp_path / "result.json").exit_code == 0
    assert_refused(run("score", tmp_path / "result.json", own_clip), "truth.json")


def list_nothing(folder):
    manifest = json.loads((folder / "clip.json").read_text())
    (folder / "clip.json").write_text(json.dumps({**manifest, "files": {}}))
    return "clip.json"


@pytest.mark.parametrize("harm", [damage_frame, drop_frame, repaint_frame, add_frame, cut_manifest, list_nothing])
def test_a_damaged_clip_is_refused_by_the_name_of_the_file(own_clip, tmp_path, harm):
    named = harm(own_clip)
    assert_refused(run("locate", own_clip, "-o", tmp_path / "result.json"), named)
    assert not (tmp_path / "result.json").exists()
    assert_refused(run("score", tmp_path / "none.json", own_clip), named)


@pytest.mark.parametrize(
    ("content", "words"),
    [("", "result.json"), ("[]", "result.json"), ('{"leaks": 3}', "result.json"), ("nul\x00", "result.json")],
)
def test_a_bad_result_is_refused(clip, tmp_path, content, words):
    (tmp_path / "result.json").write_text(content)
    assert_refused(run("score", tmp_path / "result.json", clip), words)


def test_a_result_in_another_frame_is_not_scored(clip, tmp_path):
    located = tmp_path / "result.json"
    run("locate", clip, "-o", located)
    content = json.loads(located.read_text())
    located.write_text(json.dumps({**content, "frame": "left camera"}))
    assert_refused(run("score", located, clip), "frame must be 'world'")


@pytest.mark.parametrize("name", ["scenario", "result", "truth"])
def test_schemas_are_printed_as_json(name):
    assert "properties" in json.loads(run("schema", name).output)


def test_check_says_what_a_scenario_holds():
    result = run("check", "separated", "--set", "layout.n_leaks=2")
    assert result.exit_code == 0
    assert "leaks      2" in result.output


def test_a_data_set_is_the_same_whatever_the_number_of_workers_and_goes_on_after_a_stop(tmp_path):
    for workers, n_clips in ((1, 3), (2, 3)):
        result = run(
            "generate", "separated", "-n", n_clips, "-o", tmp_path / f"w{workers}", "--workers", workers, *SMALL
        )
        assert result.exit_code == 0, result.output
    sums = [contents(tmp_path / f"w{workers}") for workers in (1, 2)]
    assert sums[0] == sums[1]
    damage_frame(tmp_path / "w1" / "clip_00001")
    shutil.rmtree(tmp_path / "w1" / "clip_00002")
    untouched = (tmp_path / "w1" / "clip_00000" / "clip.json").stat().st_mtime_ns
    assert run("generate", "separated", "-n", 3, "-o", tmp_path / "w1", "--workers", 1, *SMALL).exit_code == 0
    assert contents(tmp_path / "w1") == sums[1]
    assert (tmp_path / "w1" / "clip_00000" / "clip.json").stat().st_mtime_ns == untouched


def contents(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.fixture
def data_set(tmp_path):
    folder = tmp_path / "data"
    assert run("generate", "separated", "-n", 3, "-o", folder, "--workers", 1, *SMALL).exit_code == 0
    return folder


def generated(folder, n_clips):
    return run("generate", "separated", "-n", n_clips, "-o", folder, "--workers", 1, *SMALL)


def test_a_data_set_grows_and_does_not_shrink(data_set):
    assert generated(data_set, 4).exit_code == 0
    assert len(json.loads((data_set / "dataset.json").read_text())["clips"]) == 4
    assert_refused(generated(data_set, 2), "holds 4 clips already")


def test_a_clip_of_another_seed_or_without_manifest_is_made_again(data_set):
    before = contents(data_set)
    shutil.rmtree(data_set / "clip_00002")
    shutil.copytree(data_set / "clip_00001", data_set / "clip_00002")
    (data_set / "clip_00000" / "clip.json").unlink()
    assert generated(data_set, 3).exit_code == 0
    assert contents(data_set) == before


@pytest.mark.parametrize(
    "arguments",
    [
        ["noise", "{clip}", "-o", "{out}", "--dose-rate", "nan"],
        ["noise", "{clip}", "-o", "{out}", "--dose-rate", "10000", "--exposure", "100"],
        ["noise", "{clip}", "-o", "{clip}", "--dose-rate", "10", "--force"],
        ["noise", "{clip}", "-o", "{clip}/more", "--dose-rate", "10"],
        ["noise", "{clip}/left", "-o", "{clip}", "--dose-rate", "10", "--exposure", "0.1", "--force"],
        ["locate", "{clip}", "--k-sigma", "inf", "--method", "paper"],
        ["locate", "{clip}", "--g-win", "2000000000", "--method", "paper"],
        ["locate", "{clip}", "-o", "{clip}/truth.json"],
        ["locate", "{clip}", "-o", "{clip}/left/0000.png"],
        ["locate", "{clip}", "-o", "/dev/null"],
        ["locate", "{clip}", "-o", "{out}/no/such/folder.json"],
        ["locate", "{clip}", "--pan", "abc"],
        ["explain", "plain", "--command", "tool '{{clip}} {{result}}"],
        ["explain", "plain", "--command", "tool {{clip}}"],
        ["explain", "plain", "--method", "paper", "-o", "{out}/no/such/page.html"],
        ["simulate", "plain", "--seed", "99999999999999999999999", "-o", "{out}"],
        ["simulate", "plain", "--set", "a=1\nb=2", "-o", "{out}"],
        ["check", "plain", "--set", 'structure=[{{kind="mesh", path="nosuch.stl"}}]'],
        ["demo", "-o", "{clip}", "--force"],
    ],
)
def test_bad_input_is_refused_and_the_clip_stays_as_it_is(own_clip, tmp_path, arguments):
    before = contents(own_clip)
    result = run(*(word.format(clip=own_clip, out=tmp_path / "out") for word in arguments))
    assert result.exit_code == 2, result.output
    assert "Traceback" not in result.output
    assert contents(own_clip) == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["clip"]


def test_a_folder_of_another_kind_is_refused_before_anything_is_rendered(own_clip, monkeypatch):
    monkeypatch.setattr("scenarios.demo.simulate", lambda _: pytest.fail("rendered"))
    assert_refused(run("demo", "-o", own_clip, "--force"), "is something else that leakloc made")


def test_an_estimator_that_never_answers_is_named_and_the_exit_code_says_so():
    result = run("explain", "plain", *SMALL, "--command", "true {clip} {result}")
    assert result.exit_code == 1
    assert "malformed: " in result.output


def test_a_data_set_does_not_mix_with_another(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("precious")
    assert_refused(run("generate", "separated", "-n", 1, "-o", tmp_path / "mine", *SMALL), "is not empty")
    assert sorted(p.name for p in (tmp_path / "mine").iterdir()) == ["notes.txt"]


def test_more_random_leaks_than_fit_are_refused_before_a_folder_is_made(tmp_path):
    leaks = ", ".join("{x_m=0.1,y_m=0.0}" for _ in range(30))
    result = run("generate", "plain", "--set", f"leak=[{leaks}]", "-n", 1, "-o", tmp_path / "data", "--workers", 1)
    assert_refused(result, "30 leaks do not fit that far apart")
    assert not list(tmp_path.iterdir())


def test_a_clip_and_a_data_set_with_a_mesh_are_read_back_and_not_mixed_with_another_mesh(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study").mkdir()
    with_mesh = '[[leak]]\nx_m = 1.0\ny_m = 0.0\n[[structure]]\nkind = "mesh"\npath = "m.stl"\n'
    (tmp_path / "study" / "s.toml").write_text(with_mesh)
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "study" / "m.stl")
    assert run("simulate", "study/s.toml", "-o", "clip", *SMALL).exit_code == 0
    exported = run("export", "clip", "--coco", "-o", "out")
    assert exported.exit_code == 0, exported.output
    assert run("generate", "study/s.toml", "-n", 1, "-o", "data", "--workers", 1, *SMALL).exit_code == 0
    trimesh.creation.box((0.2, 0.2, 0.2)).export(tmp_path / "study" / "m.stl")
    mixed = run("generate", "study/s.toml", "-n", 2, "-o", "data", "--workers", 1, *SMALL)
    assert_refused(mixed, "is no data set of this scenario")
