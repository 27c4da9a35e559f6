"""Anybody's estimator behind one call: ours, a Python callable, or a command line with the clip-folder contract.

Foreign code runs in a process of its own and sees frames and the believed rig alone; its crash, time-out, NaN or
malformed output is an outcome, not the end of the run.
"""

from __future__ import annotations

import importlib
import importlib.util
import math
import multiprocessing
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np

import leakloc
import leakloc.methods
from leakloc import Estimate, LeakEstimate, ResultError, Rig
from leakloc.result import MAX_LEAKS
from scenarios import naive
from scenarios.clip_folder import write_estimators_clip
from scenarios.simulate import SimulatedClip

Breakdown = Literal["crash", "timeout", "nan", "malformed"]
SHOWN_ERROR_CHARS = 300
MAX_TEXT_CHARS = 10_000
IMPORTABLE = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*")
WORLD = "world"
"""The frame in which places are scored: every rig of the harness knows where it stands."""
NUMBERS_OF_LEAKS = ("x_m", "y_m", "score", "left_column_px", "right_column_px", "column_sigma_px")
BUILT_IN = ("paper", "robust", "naive")


@dataclass(frozen=True)
class Broken:
    """An estimator that gave no usable answer, and how."""

    code: Breakdown
    detail: str


Answer = Estimate | Broken


class EstimatorError(ValueError):
    """An estimator that cannot be started at all; the message names it and the rule."""


@dataclass(frozen=True)
class EstimatorSpec:
    """Which estimator: a built-in method, `package.module:function`, or a command with {clip} and {result}."""

    kind: Literal["method", "callable", "command"]
    text: str
    timeout_s: float = 60.0

    def __post_init__(self) -> None:
        """Check what can be checked without running it."""
        if self.kind == "method" and self.text not in BUILT_IN:
            raise EstimatorError(f"method {self.text!r}: must be one of {', '.join(BUILT_IN)}")
        if not self.text.isprintable():  # it stands in comments, tables and XML
            raise EstimatorError(f"estimator {self.text[:60]!r}: must be of printable characters on one line")
        if len(self.text) > MAX_TEXT_CHARS:
            raise EstimatorError(f"estimator {self.text[:60]!r}...: must have at most {MAX_TEXT_CHARS} characters")
        if self.kind == "callable" and not IMPORTABLE.fullmatch(self.text):
            raise EstimatorError(f"estimator {self.text!r}: must have the form package.module:function")
        if self.kind == "command":
            _words_of(self.text)


def check_there(spec: EstimatorSpec) -> None:
    """Raise EstimatorError unless the package or program is there: before the first clip, and before it is started."""
    if spec.kind == "callable":
        package = spec.text.partition(":")[0].partition(".")[0]
        if package not in sys.modules and importlib.util.find_spec(package) is None:
            raise EstimatorError(f"estimator {spec.text!r}: cannot be imported: there is no module {package!r}")
    if spec.kind == "command":
        program = next(iter(_words_of(spec.text)), "")
        if shutil.which(program) is None:
            raise EstimatorError(f"command {program!r}: cannot be started: there is no such program")


def run_estimator(spec: EstimatorSpec, clip: SimulatedClip) -> Answer:
    """Run an estimator on a clip; the truth is out of its reach."""
    if spec.kind == "command":
        return run_command(spec, clip)
    if spec.kind == "callable":
        return _host_of(spec).run(clip)
    return _run_method(spec.text, clip)


def run_command(spec: EstimatorSpec, clip: SimulatedClip) -> Answer:
    """Run a command line on a clip folder without the truth and read the result it writes."""
    with tempfile.TemporaryDirectory(prefix="estimator-") as temporary:
        folder, result = Path(temporary) / "clip", Path(temporary) / "result.json"
        write_estimators_clip(clip, folder)
        words = [word.replace("{clip}", str(folder)).replace("{result}", str(result)) for word in _words_of(spec.text)]
        try:
            done = subprocess.run(
                words,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                errors="replace",
                timeout=spec.timeout_s,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return Broken("timeout", f"no result within {spec.timeout_s:g} s")
        except OSError as error:
            raise EstimatorError(f"command {words[0]!r}: cannot be started: {error.strerror}") from None
        if done.returncode != 0:
            return Broken("crash", f"exit code {done.returncode}: {done.stderr.strip()[-SHOWN_ERROR_CHARS:]}")
        try:
            return _checked(leakloc.read_result(result))
        except ResultError as error:
            return Broken("malformed", str(error).replace(str(result), "result.json"))


def _words_of(command: str) -> list[str]:
    """Split a command line as a shell splits words; raises EstimatorError."""
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise EstimatorError(f"command {command!r}: cannot be split into words: {error}") from None
    if not ("{clip}" in command and "{result}" in command):
        raise EstimatorError(f"command {command!r}: must name {{clip}} and {{result}}")
    return words


class Host:
    """A process of its own for a Python callable; a new one is made after a crash or a time-out."""

    def __init__(self, spec: EstimatorSpec) -> None:
        """Start nothing yet."""
        self._spec = spec
        self._process: multiprocessing.process.BaseProcess | None = None
        self._pipe: Connection | None = None

    def run(self, clip: SimulatedClip) -> Answer:
        """Give the callable frames and believed rig, and wait for its answer as long as the specification allows."""
        pipe = self._started()
        try:
            pipe.send((clip.left, clip.right, clip.believed_rig))
            if not pipe.poll(self._spec.timeout_s):
                self.stop()
                return Broken("timeout", f"no result within {self._spec.timeout_s:g} s")
            kind, content = pipe.recv()
        except (EOFError, OSError):
            self.stop()
            return Broken("crash", "its process died")
        if kind == "missing":
            raise EstimatorError(content)
        return _checked(content) if kind == "estimate" else Broken(kind, content)

    def stop(self) -> None:
        """End the process, if there is one."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
        self._process = self._pipe = None

    def _started(self) -> Connection:
        if self._process is None or not self._process.is_alive() or self._pipe is None:
            context = multiprocessing.get_context("spawn")
            self._pipe, far_end = context.Pipe()
            arguments = (self._spec.text, far_end, cv2.getNumThreads())
            self._process = context.Process(target=_serve, args=arguments, daemon=True)
            self._process.start()
            far_end.close()
        return self._pipe


_hosts: dict[EstimatorSpec, Host] = {}


def _host_of(spec: EstimatorSpec) -> Host:
    """One host a callable and process: starting Python anew for every clip would cost more than the estimate."""
    return _hosts.setdefault(spec, Host(spec))


def _serve(name: str, pipe: Connection, n_threads: int) -> None:
    """Answer clips until the other end is gone; runs in the host's process, with as many threads as the other end.

    The first clip is taken before anything is imported: the other end, whose time-out begins after it, is not held up.
    """
    cv2.setNumThreads(n_threads)
    function = None
    while True:
        try:
            left, right, rig = pipe.recv()
        except EOFError:
            return
        try:
            function = function or _imported(name)
        except EstimatorError as error:
            pipe.send(("missing", str(error)))
            return
        answer = _answer(function, left, right, rig)
        try:
            pipe.send(answer)
        except Exception as error:  # what cannot be pickled says so in many ways
            pipe.send(("malformed", f"must return plain data: {error}"[:SHOWN_ERROR_CHARS]))


def _imported(name: str) -> Callable[[np.ndarray, np.ndarray, Rig], Any]:
    """Import a callable by its name; raises EstimatorError whatever the module does instead of being imported."""
    module, _, attribute = name.partition(":")
    try:
        function = getattr(importlib.import_module(module), attribute)
    except (Exception, SystemExit) as error:
        raise EstimatorError(f"estimator {name!r}: cannot be imported: {error}"[:SHOWN_ERROR_CHARS]) from None
    if not callable(function):
        raise EstimatorError(f"estimator {name!r}: must be a function, got {type(function).__name__}")
    return function


def _answer(
    function: Callable[[np.ndarray, np.ndarray, Rig], Any], left: np.ndarray, right: np.ndarray, rig: Rig
) -> tuple[str, Any]:
    try:
        found = function(left, right, rig)
    except (Exception, SystemExit) as error:
        return "crash", f"{type(error).__name__}: {error}"[:SHOWN_ERROR_CHARS]
    try:
        return "estimate", found if isinstance(found, Estimate) else _from_places(found, rig)
    except (TypeError, ValueError) as error:
        return "malformed", f"must return an Estimate or (x_m, y_m) pairs: {error}"[:SHOWN_ERROR_CHARS]


def _from_places(places: Iterable[tuple[float, float]], rig: Rig) -> Estimate:
    undefined = np.full((2, 2), np.nan)
    leaks = []
    for number, (x_m, y_m) in enumerate(places):
        if number == MAX_LEAKS:
            raise ValueError(f"more than {MAX_LEAKS} leaks")
        place = np.array([float(x_m), float(y_m), 0.0, 1.0])
        columns_px = [float(u / w) for u, _, w in (rig.P1 @ place, rig.P2 @ place)] if np.isfinite(place).all() else []
        left_px, right_px = columns_px or (np.nan, np.nan)
        leaks.append(LeakEstimate(place[0], place[1], undefined, 0.0, left_px, right_px, float("nan")))
    return Estimate("foreign", rig.frame, tuple(leaks))


def _run_method(name: str, clip: SimulatedClip) -> Answer:
    if len(clip.left) < leakloc.methods.MIN_FRAMES:
        return Broken("malformed", f"a clip of {len(clip.left)} frames: {name} needs {leakloc.methods.MIN_FRAMES}")
    if name == "naive":
        return _checked(naive.locate(clip.left, clip.right, clip.believed_rig))
    return _checked(leakloc.locate(clip.left, clip.right, clip.believed_rig, method=name))


def _checked(estimate: Estimate) -> Answer:
    """The estimate in plain numbers, or what is wrong with it: foreign code may put anything anywhere."""
    if estimate.frame != WORLD:
        return Broken("malformed", f"frame must be {WORLD!r}, got {estimate.frame!r:.80}")
    if not isinstance(estimate.method, str) or not isinstance(estimate.diagnostics, Mapping):
        return Broken("malformed", "method must be a text and diagnostics a mapping")
    try:
        leaks = tuple(_in_numbers(leak) for leak in estimate.leaks)
    except (AttributeError, TypeError, ValueError, OverflowError) as error:
        return Broken("malformed", f"leaks must be LeakEstimates of numbers: {error}"[:SHOWN_ERROR_CHARS])
    if not all(math.isfinite(leak.x_m) and math.isfinite(leak.y_m) for leak in leaks):
        return Broken("nan", "a leak's place is not finite")
    return replace(estimate, leaks=leaks)


def _in_numbers(leak: LeakEstimate) -> LeakEstimate:
    covariance_m2 = np.asarray(leak.covariance_m2, dtype=float)
    if covariance_m2.shape != (2, 2):
        raise ValueError(f"covariance_m2 must be 2 x 2, got {covariance_m2.shape}")
    numbers = {name: float(getattr(leak, name)) for name in NUMBERS_OF_LEAKS}
    return LeakEstimate(covariance_m2=covariance_m2, **numbers)
