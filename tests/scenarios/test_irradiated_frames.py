"""Gamma hits for a user's own frames: only hits are added, their truth is written, bad frames are refused by name."""

import csv
import json

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from scenarios.cli import main


def run(*arguments):
    return CliRunner().invoke(main, ["noise", *(str(a) for a in arguments)], prog_name="leakloc")


@pytest.fixture
def footage(tmp_path):
    folder = tmp_path / "mine"
    folder.mkdir()
    rng = np.random.default_rng(0)
    for number in (2, 10, 1):  # by number, not by name
        frame = np.full((60, 80), 20 * number, np.uint8) if number < 10 else rng.integers(0, 99, (60, 80), np.uint8)
        cv2.imwrite(str(folder / f"shot{number}.png"), frame)
    return folder


def read(path):
    return cv2.imread(str(path), cv2.IMREAD_UNCHANGED)


def test_hits_only_brighten_and_their_table_counts_them(footage, tmp_path):
    result = run(footage, "-o", tmp_path / "out", "--dose-rate", 200, "--exposure", 0.1)
    assert result.exit_code == 0, result.output
    for number in (1, 2, 10):
        before, after = read(footage / f"shot{number}.png"), read(tmp_path / "out" / f"shot{number}.png")
        assert (after >= before).all()
        assert (after > before).any()
    rows = list(csv.DictReader((tmp_path / "out" / "hits.csv").read_text().splitlines()))
    assert f"{len(rows)} hits" in result.output
    # tracks per cm2 per Gy (1.129e9) times area, dose and three frames, within 5 standard errors
    expected = 1.129e9 * (80 * 3e-4) * (60 * 3e-4) * 200 * 0.1 / 3600 * 3
    assert abs(len(rows) - expected) < 5 * expected**0.5 + 0.01 * expected
    assert {float(row["frame"]) for row in rows} == {0.0, 1.0, 2.0}


def test_no_dose_returns_the_frames(footage, tmp_path):
    assert run(footage, "-o", tmp_path / "out", "--dose-rate", 0, "--exposure", 0.1).exit_code == 0
    for number in (1, 2, 10):
        assert np.array_equal(read(footage / f"shot{number}.png"), read(tmp_path / "out" / f"shot{number}.png"))


def test_the_exposure_must_be_known(footage, tmp_path):
    result = run(footage, "-o", tmp_path / "out", "--dose-rate", 10)
    assert result.exit_code == 2
    assert "--exposure is needed" in result.output


def truncate(folder):
    path = folder / "shot2.png"
    path.write_bytes(path.read_bytes()[:40])


def resize(folder):
    cv2.imwrite(str(folder / "shot2.png"), np.zeros((61, 80), np.uint8))


def deepen(folder):
    cv2.imwrite(str(folder / "shot2.png"), np.zeros((60, 80), np.uint16))


def repeat(folder):
    cv2.imwrite(str(folder / "shot2.jpg"), np.zeros((60, 80), np.uint8))


def empty(folder):
    (folder / "shot2.png").write_bytes(b"")


@pytest.mark.parametrize("harm", [truncate, resize, deepen, repeat, empty])
def test_a_bad_frame_is_refused_by_name_and_nothing_is_written(footage, tmp_path, harm):
    harm(footage)
    result = run(footage, "-o", tmp_path / "out", "--dose-rate", 10, "--exposure", 0.1)
    assert result.exit_code == 2
    assert "shot2" in result.output
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mine"]


@pytest.mark.parametrize(("words", "tone"), [((), "srgb"), (("--tone", "linear"), "linear")])
def test_the_tone_is_that_of_the_clip_unless_another_is_asked_for(footage, tmp_path, words, tone):
    (footage / "input.json").write_text('{"exposure_s": 0.1, "tone": "srgb"}')
    assert run(footage, "-o", tmp_path / "out", "--dose-rate", 10, *words).exit_code == 0
    assert json.loads((tmp_path / "out" / "noise.json").read_text())["tone"] == tone


def test_a_tone_that_is_none_is_refused(footage, tmp_path):
    (footage / "input.json").write_text('{"exposure_s": 0.1, "tone": "loud"}')
    result = run(footage, "-o", tmp_path / "out", "--dose-rate", 10)
    assert result.exit_code == 2
    assert "tone must be linear or srgb, got 'loud'" in result.output
