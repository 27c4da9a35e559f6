"""Plant single-line faults one at a time and see that the tests named for each kill it: `make defects`.

Every fault is planted in a copy of the checkout; a survivor is a missing test. A fault whose text is no longer in its
file is stale and counts as a survivor.
"""

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
LIST = Path(__file__).with_name("defects.toml")
TIMEOUT_S = 600
MEMORY_BYTES = 8 * 2**30  # a fault that lets memory grow without end fails its test, and not the machine
LEFT_OUT = (".git", ".venv", "demo", ".hypothesis", ".pytest_cache", ".mypy_cache", ".ruff_cache", "__pycache__")


@dataclass(frozen=True)
class Verdict:
    """What became of one planted fault."""

    name: str
    killed: bool
    by: str
    seconds: float


def defects() -> list[dict]:
    """The list: name, file, find, replace and tests of each fault."""
    return tomllib.loads(LIST.read_text(encoding="utf-8"))["defect"]


def plant(defect: dict, root: Path) -> str | None:
    """Put the fault into its file; returns why that is impossible, or None."""
    path = root / defect["file"]
    text = path.read_text(encoding="utf-8") if path.is_file() else ""
    if text.count(defect["find"]) != 1:
        return f"stale: the text to replace stands {text.count(defect['find'])} times in {defect['file']}"
    path.write_text(text.replace(defect["find"], defect["replace"]), encoding="utf-8")
    return None


def run(defect: dict) -> Verdict:
    """Plant one fault in a copy and run its tests there."""
    start_s = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="defect-") as folder:
        root = Path(folder) / "checkout"
        shutil.copytree(ROOT, root, ignore=shutil.ignore_patterns(*LEFT_OUT))
        if stale := plant(defect, root):
            return Verdict(defect["name"], killed=False, by=stale, seconds=time.monotonic() - start_s)
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-x",
            "-q",
            "-p",
            "no:cacheprovider",
            "-m",
            "not deep",
            *defect["tests"],
        ]
        environment = {**os.environ, "PYTHONPATH": str(root), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        try:
            done = subprocess.run(
                command,
                cwd=root,
                env=environment,
                capture_output=True,
                text=True,
                timeout=TIMEOUT_S,
                check=False,
                preexec_fn=bounded,
            )
        except subprocess.TimeoutExpired:
            return Verdict(defect["name"], killed=False, by="time-out: undecided", seconds=time.monotonic() - start_s)
        failed = [
            line.split(" ")[1].split("::")[-1]
            for line in done.stdout.splitlines()
            if line.startswith(("FAILED", "ERROR"))
        ]
        by = failed[0] if failed else f"nothing (exit code {done.returncode})"
        return Verdict(defect["name"], done.returncode == 1 and bool(failed), by, time.monotonic() - start_s)


def bounded() -> None:
    """Bound the memory of this process."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))


def main() -> int:
    """Run all, or those whose names hold the words given; two at a time."""
    chosen = [defect for defect in defects() if all(word in defect["name"] for word in sys.argv[1:])]
    with ThreadPoolExecutor(2) as pool:
        verdicts = []
        for verdict in pool.map(run, chosen):
            verdicts.append(verdict)
            word = "killed  " if verdict.killed else "SURVIVED"
            print(f"{word} {verdict.seconds:5.1f} s  {verdict.name}: {verdict.by}", flush=True)
    killed = sum(verdict.killed for verdict in verdicts)
    print(f"{killed} of {len(verdicts)} killed")
    return 0 if killed == len(verdicts) else 1


if __name__ == "__main__":
    sys.exit(main())
