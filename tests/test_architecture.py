"""The arrows between the packages: only `scenarios` knows the others, and the estimator loads no ray caster."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("simcam", "noise", "leakloc", "scenarios")
MAY_IMPORT = {
    "simcam": {"numpy", "scipy", "cv2", "trimesh", "embreex"},
    "noise": {"numpy", "scipy", "cv2"},
    "leakloc": {"numpy", "scipy", "cv2", "yaml"},
    "scenarios": {
        *{"numpy", "scipy", "cv2", "pydantic", "click", "matplotlib", "tqdm", "tomli_w"},
        "hypothesis",  # its strategies, in space.py, imported where they are used
        "distributed",  # an extra, imported where a campaign runs on a Dask cluster
        *PACKAGES,
    },
}


def imported(path):
    """Top-level names that a module imports, relative imports resolved to its own package."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield path.parent.name if node.level else node.module.split(".")[0]


def modules():
    return [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(ROOT)))
def test_a_module_imports_only_what_its_package_may(path):
    package = path.relative_to(ROOT).parts[0]
    foreign = set(imported(path)) - set(sys.stdlib_module_names) - {package} - MAY_IMPORT[package]
    assert not foreign


def test_embree_is_behind_one_wrapper():
    users = [path.name for path in modules() if "embreex" in set(imported(path))]
    assert users == ["raycast.py"]


@pytest.mark.parametrize("package", ["leakloc", "noise"])
def test_importing_the_estimator_or_the_noise_loads_no_ray_caster(package):
    code = f"import sys, {package}; print(sorted({{'trimesh', 'embreex', 'simcam', 'scenarios'}} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(ROOT)))
def test_a_file_stays_under_300_lines_and_is_named_for_a_thing(path):
    assert len(path.read_text().splitlines()) < 300
    assert path.stem not in {"utils", "core", "base", "helpers", "common", "misc"}
