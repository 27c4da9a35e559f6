"""One run as the results store keeps it: a scene, a method, and what came out; enough to replay and to tabulate."""

import hashlib
import json
import math
import shlex
from collections.abc import Callable
from dataclasses import asdict, dataclass

from pydantic import TypeAdapter

from scenarios.arms import Scene
from scenarios.campaign import Value
from scenarios.scene_work import OK, LeakOutcome, SceneOutcome

COUNTED: dict[str, Callable[[LeakOutcome], bool]] = {
    "all": lambda _: True,
    "in_view": lambda leak: leak.in_view,
    "observable": lambda leak: leak.observable,
}
"""Which leaks a rate may be of; none is given without the others."""


@dataclass(frozen=True)
class Run:
    """One scene and one method. Undefined is None; a scene that has no truth to tell, for it crashed, has no leaks."""

    run: int
    scene: int
    arm: int
    repeat: int
    values: dict[str, Value]
    base: str
    overrides: tuple[str, ...]
    seed: int
    versions: str
    method: str
    outcome: str
    detail: str
    leaks: tuple[LeakOutcome, ...]
    false_codes: tuple[str, ...]
    estimates_m: tuple[tuple[float, float], ...] = ()

    @property
    def found(self) -> dict[str, int]:
        """Found leaks among all, in view and observable."""
        return {
            which: sum(counts(leak) and leak.code == "found" for leak in self.leaks)
            for which, counts in COUNTED.items()
        }

    @property
    def of(self) -> dict[str, int]:
        """Leaks that count: all, in view and observable."""
        return {which: sum(map(counts, self.leaks)) for which, counts in COUNTED.items()}

    @property
    def errors_m(self) -> list[float]:
        """Errors of the leaks found, m."""
        return [leak.error_m for leak in self.leaks if leak.error_m is not None]

    @property
    def errors_px(self) -> list[float]:
        """Errors of the leaks found, px of disparity."""
        return [leak.error_px for leak in self.leaks if leak.error_px is not None]

    def paper_error_m(self, leak: LeakOutcome) -> float | None:
        """Error of a leak by the paper's rule, which has no gate, m; None when no estimate is left for it."""
        if leak.paper_estimate is None:
            return None
        x_m, y_m = self.estimates_m[leak.paper_estimate]
        return math.hypot(x_m - leak.x_m, y_m - leak.y_m)

    @property
    def mean_error_m(self) -> float | None:
        """Mean error of the leaks found; None without any."""
        return sum(self.errors_m) / len(self.errors_m) if self.errors_m else None

    @property
    def is_right(self) -> bool:
        """Whether every observable leak is found and nothing false is."""
        return self.outcome == OK and self.found["observable"] == self.of["observable"] and not self.false_codes

    def sha256(self) -> str:
        """Digest of everything that the run says."""
        return hashlib.sha256(json.dumps(asdict(self), sort_keys=True, allow_nan=False).encode()).hexdigest()


RUNS = TypeAdapter(Run)


def valid_run(**values: object) -> Run:
    """Return a run of values from outside, each of the type that it must have; raises ValueError."""
    run = RUNS.validate_python(values)
    for leak in run.leaks:
        if leak.paper_estimate is not None and not 0 <= leak.paper_estimate < len(run.estimates_m):
            raise ValueError(f"leak {leak.leak}: there is no estimate {leak.paper_estimate}")
    return run


def runs_of(scene: Scene, outcome: SceneOutcome) -> list[Run]:
    """Return the runs of a scene, numbered by scene and method."""
    return [
        Run(
            run=scene.number * len(outcome.runs) + i,
            scene=scene.number,
            arm=scene.arm.number,
            repeat=scene.repeat,
            values=scene.arm.values,
            base=scene.base,
            overrides=scene.overrides,
            seed=scene.seed,
            versions=outcome.versions,
            method=run.method,
            outcome=run.outcome,
            detail=run.detail,
            leaks=run.leaks,
            false_codes=run.false_codes,
            estimates_m=run.estimates_m,
        )
        for i, run in enumerate(outcome.runs)
    ]


def replay_command(run: Run, option: str) -> str:
    """Return the command that shows what went wrong in a run; `option` names the method, "--method" or another."""
    words = ["leakloc", "explain", run.base, *(word for override in run.overrides for word in ("--set", override))]
    return shlex.join([*words, "--seed", str(run.seed), option, run.method])
