"""The wheel holds all that the program needs: it runs outside the checkout, from its own files alone."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def test_the_packages_come_with_their_data_and_type_marks(installed):
    for package in ("simcam", "noise", "leakloc", "scenarios"):
        assert (installed / package / "py.typed").is_file()
    shipped = {path.name for path in (installed / "scenarios" / "library").iterdir()}
    assert shipped == {path.name for path in (ROOT / "scenarios" / "library").iterdir()}
    assert (installed / "scenarios" / "campaigns" / "noise.toml").is_file()
    assert not (installed / "tests").exists()


def test_the_program_runs_from_the_wheel(installed, tmp_path):
    code = "import scenarios, noise; print(scenarios.__file__, noise.__file__); from scenarios.cli import main; main()"
    small = ["rig.width_px=96", "rig.height_px=54", "recording.n_frames=4"]
    arguments = ["simulate", "separated", "-o", "clip", *(word for value in small for word in ("--set", value))]
    done = subprocess.run(
        [sys.executable, "-P", "-c", code, *arguments],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(installed)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert str(installed) in done.stdout
    assert (tmp_path / "clip" / "truth.json").is_file()
