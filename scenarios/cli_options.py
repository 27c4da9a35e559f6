"""Options and errors that the commands share."""

import math
import sys
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, NoReturn

import click

from scenarios.clip_folder import DamagedClipError
from scenarios.output_folder import OutputError
from scenarios.scenario_file import ScenarioError
from scenarios.truth import TruthError

INPUT_ERRORS = (ScenarioError, TruthError, OutputError, DamagedClipError)
BAD_INPUT = 2
STOPPED = 130
"""Exit code of a program that was interrupted, as shells have it."""
FOLDER = click.Path(path_type=Path, file_okay=False)
FILE = click.Path(path_type=Path, dir_okay=False)


class FiniteRange(click.FloatRange):
    """A range of numbers that NaN is not in, as it is in click's own."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Convert and check."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number", param, ctx)
        return number


SEED = click.IntRange(0, 2**63 - 1)


def clear_errors(command: Callable[..., Any]) -> Callable[..., Any]:
    """Turn an error of the user's input into one message and exit code 2; anything else is a defect and may be seen.

    What the system says of a path that it was given (too long, not permitted, no space) is such an error, too.
    """

    @wraps(command)
    def wrapped(*args: Any, **options: Any) -> Any:
        from leakloc import ClipError, ResultError, RigError
        from scenarios.campaign_file import CampaignError
        from scenarios.cli_bench import BaselineError
        from scenarios.envelope import NoTrialsError
        from scenarios.estimators import EstimatorError
        from scenarios.irradiate import FramesError
        from scenarios.shrink import NothingFailsError
        from scenarios.space_file import SpaceError
        from scenarios.store_identity import StoreError
        from scenarios.workers import WorkerError

        foreign = (ClipError, RigError, ResultError, FramesError, EstimatorError, BaselineError, WorkerError)
        studies = (CampaignError, StoreError, SpaceError, NothingFailsError, NoTrialsError)
        try:
            return command(*args, **options)
        except (*INPUT_ERRORS, *foreign, *studies) as error:
            _refuse(str(error))
        except OSError as error:
            if error.filename is None:
                raise
            _refuse(f"{error.filename}: {error.strerror}")

    return wrapped


def _refuse(message: str) -> NoReturn:
    """Say a line a mistake, so that nothing in a file or its name steers the terminal, and exit with 2."""
    for line in message.split("\n"):
        shown = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in line)
        click.echo(f"Error: {shown}", err=True)
    sys.exit(BAD_INPUT)


def scenario_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """SCENARIO with --set and --seed, as every command that reads a scenario has them."""
    for decorate in (
        click.option("--seed", type=SEED, help="Replace the scenario's seed: other draws, same rules."),
        click.option(
            "--set",
            "overrides",
            multiple=True,
            metavar="KEY=VALUE",
            help="Change a value, say gamma.dose_rate_gy_h=3.3 or leak.0.x_m=1.2; repeatable.",
        ),
        click.argument("scenario", metavar="SCENARIO"),
    ):
        command = decorate(command)
    return command


def estimator_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """One of ours, a Python callable or a command, as every command that tests an estimator has them."""
    for decorate in (
        click.option(
            "--timeout", type=FiniteRange(0.0, 3600.0, min_open=True), default=60.0, show_default=True, help="s."
        ),
        click.option("--command", metavar="COMMAND", help='Anything: "mytool {clip} {result}".'),
        click.option(
            "--estimator", metavar="MODULE:FUNCTION", help="Python: f(left, right, rig) -> (x, y)s or Estimate."
        ),
        click.option("--method", type=click.Choice(["paper", "robust", "naive"]), help="One of ours."),
    ):
        command = decorate(command)
    return command


def chosen_estimator(options: dict[str, Any]) -> Any:
    """Return the specification of the one estimator that the options name."""
    from scenarios.estimators import EstimatorSpec, check_there

    kinds = {"method": "method", "estimator": "callable", "command": "command"}
    given: list[tuple[Any, str]] = [(kind, options[name]) for name, kind in kinds.items() if options[name]]
    if len(given) != 1:
        raise click.UsageError("exactly one of --method, --estimator and --command must say what is tested")
    spec = EstimatorSpec(*given[0], options["timeout"])
    check_there(spec)
    return spec
