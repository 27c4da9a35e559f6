"""What the command line makes of an input, in this process or in one of its own with limits, and what it may make.

The rule: one clear error and exit code 2, or the right answer; within a second and 200 MB; nothing written elsewhere.
"""

import importlib
import os
import resource
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from click.testing import CliRunner
from watch import watching

from scenarios.cli import main

importlib.import_module("matplotlib.pyplot")  # makes its caches when it is first imported, and here it is not watched

ROOT = Path(__file__).parents[2]
LIMIT_S = 1.0
SLACK = 2.0  # of processor time, where other work shares the caches
LIMIT_MB = 200
HANG_S = 15
MAX_LINES = 60


@dataclass(frozen=True)
class Verdict:
    """Exit code, what was said on both streams, and what was touched outside of the folder that may be written to."""

    code: int
    out: str
    error: str
    elsewhere: tuple[Path, ...]
    seconds: float
    megabytes: float


def leakloc(*words: object, inside: Path | None = None) -> Verdict:
    """Run a command in this process; `inside` is where it may write. A traceback is raised as it is."""

    def hanging(number, frame):
        raise TimeoutError(f"still running after {HANG_S} s: {words}")

    peak_kb, start_s, before = _peak_kb(), time.process_time(), signal.signal(signal.SIGALRM, hanging)
    signal.alarm(HANG_S)
    try:
        with watching() as touched:
            result = CliRunner().invoke(main, [str(word) for word in words], prog_name="leakloc")
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    elsewhere = tuple(path for path in touched if inside is None or not path.is_relative_to(inside))
    seconds, megabytes = time.process_time() - start_s, (_peak_kb() - peak_kb) / 1024
    return Verdict(result.exit_code, result.stdout, result.stderr, elsewhere, seconds, megabytes)


def assert_bearable(verdict: Verdict) -> None:
    """Exit code 0 or 2; a refusal is a few clear lines, quick, small, and leaves nothing behind."""
    assert verdict.code in (0, 2), verdict
    assert "Traceback" not in verdict.error, verdict
    assert "Warning:" not in verdict.error, verdict
    if verdict.code == 2:
        lines = verdict.error.splitlines()
        assert lines, verdict
        assert len(lines) <= MAX_LINES, verdict
        assert all(line.isprintable() for line in lines), verdict
        assert any(line.startswith("Error: ") and len(line) > 10 for line in lines), verdict
        assert verdict.out == "", verdict
        assert verdict.seconds < LIMIT_S * SLACK, verdict
        assert verdict.megabytes < LIMIT_MB, verdict
    assert verdict.elsewhere == (), verdict


def assert_refused(verdict: Verdict, *said: str) -> None:
    """As `assert_bearable`, and with exit code 2, and the message holds these words."""
    assert_bearable(verdict)
    assert verdict.code == 2, verdict
    for words in said:
        assert words in verdict.error, verdict


MEASURED = """
import re, resource, sys, time
import leakloc, scenarios.bench, scenarios.campaign_summary, scenarios.cli, scenarios.export, scenarios.irradiate
import scenarios.report, scenarios.simulate, scenarios.store, trimesh

def kilobytes(name):
    return int(re.search(rf"{name}:\\s*(\\d+)", open("/proc/self/status").read())[1])

measures, *words = sys.argv[1:]
baseline_kb, start_s = kilobytes("VmRSS"), time.process_time()
addresses = (kilobytes("VmSize") << 10) + (600 << 20)
resource.setrlimit(resource.RLIMIT_AS, (addresses, addresses))
try:
    scenarios.cli.main(words, prog_name="leakloc")
finally:
    open(measures, "w").write(f"{time.process_time() - start_s} {(kilobytes('VmHWM') - baseline_kb) / 1024}")
"""  # not getrusage: its peak is that of the process before `exec`, too


def leakloc_alone(*words: object, cwd: Path) -> Verdict:
    """Run a command in a process of its own whose address space has a limit; measured beyond what importing takes.

    The limit of 600 MB is on addresses (threads reserve theirs without using them); memory in use is what is measured.
    """
    measures = cwd.parent / f"{cwd.name}.measures"
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", MEASURED, measures, *(os.fsencode(str(word)) for word in words)],
        cwd=cwd,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        errors="backslashreplace",
        timeout=2 * HANG_S,
        check=False,
    )
    seconds, megabytes = map(float, measures.read_text().split())  # missing when a signal ended it
    measures.unlink()
    return Verdict(done.returncode, done.stdout, done.stderr, (), seconds, megabytes)


def _peak_kb() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def tree(folder: Path) -> dict[str, tuple[int, ...]]:
    """Everything in a folder: kind and rights; of what is no folder, size and time of change, too."""
    found = {}
    for path in sorted(folder.rglob("*")):
        status = path.lstat()
        more = () if path.is_dir() and not path.is_symlink() else (status.st_size, status.st_mtime_ns)
        found[str(path.relative_to(folder))] = (status.st_mode, *more)
    return found
