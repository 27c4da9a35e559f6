"""What made a result: this package and its source, Python, and the packages whose arithmetic it rests on."""

import hashlib
import platform
from functools import cache
from importlib.metadata import version
from importlib.resources import files

PACKAGES = ("numpy", "scipy", "opencv-python-headless", "trimesh", "embreex")
SOURCES = ("leakloc", "noise", "scenarios", "simcam")


@cache
def versions() -> str:
    """Return versions in one line, the first digits of the source's SHA-256 included: the same line, the same results.

    The line says nothing of the processor: without AVX-512 the last bits of exponentials differ.
    """
    ours = f"leakloc {version('leakloc')} ({_source_sha256()[:12]})"
    theirs = [f"{name} {version(name)}" for name in PACKAGES]
    return "; ".join([ours, f"python {platform.python_version()}", *theirs])


def _source_sha256() -> str:
    sums = hashlib.sha256()
    for package in SOURCES:
        for path in sorted(files(package).iterdir(), key=lambda entry: entry.name):
            if path.name.endswith(".py"):
                sums.update(f"{package}/{path.name}\n".encode() + path.read_bytes())
    return sums.hexdigest()
