"""`leakloc bench`: the suite of scenes on anybody's estimator, with an exit code for CI."""

import json
import sys
from pathlib import Path
from typing import Any

import click

from scenarios.output_folder import write_file, write_json

MAX_BASELINE_BYTES = 100_000_000
NOT_GOOD_ENOUGH = 1


class BaselineError(ValueError):
    """A baseline that cannot be compared with; the message names the file and the rule."""


def bench(options: dict[str, Any]) -> None:
    """Run the bench as the command line's options say; exits with 1 when the estimator is not good enough."""
    from scenarios.bench import as_json, run_bench, table, worse_than
    from scenarios.estimators import EstimatorSpec
    from scenarios.junit import junit_xml
    from scenarios.progress import progress
    from scenarios.space import STRATA

    kind, text = _chosen(options)
    spec = EstimatorSpec(kind, text, options["timeout"])
    baseline = read_baseline(options["baseline"]) if options["baseline"] else None
    total = options["scenes"] * len(STRATA)
    running = run_bench(spec, options["scenes"], options["seed"], options["workers"])
    trials = list(progress(running, "scenes", total))
    click.echo(table(trials))
    if options["json"]:
        write_json(options["json"], as_json(trials, spec, options["seed"]))
    if options["junit"]:
        write_file(options["junit"], junit_xml(trials, text))
    problems = [f"{trial.stratum} {trial.number}: {trial.codes[0]}: {trial.detail}" for trial in trials if trial.detail]
    if baseline is not None:
        try:
            problems += [f"worse than {options['baseline']}: {line}" for line in worse_than(trials, baseline)]
        except ValueError as error:
            raise BaselineError(f"{options['baseline']}: {error}") from None
    if problems:
        click.echo("\n".join(problems), err=True)
        sys.exit(NOT_GOOD_ENOUGH)


def read_baseline(path: Path) -> dict[str, Any]:
    """Read the JSON of an earlier run; raises BaselineError."""
    try:
        if path.stat().st_size > MAX_BASELINE_BYTES:
            raise BaselineError(f"{path}: must be at most {MAX_BASELINE_BYTES} bytes")
        content = json.loads(path.read_text(encoding="utf-8"))
        for row in content["trials"]:
            if not (
                isinstance(row["stratum"], str) and isinstance(row["number"], int) and row["right"] in (True, False)
            ):
                raise KeyError("trials")
    except OSError as error:
        raise BaselineError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, TypeError, KeyError, RecursionError):
        raise BaselineError(f"{path}: is not the --json of an earlier bench run") from None
    return dict(content)


def _chosen(options: dict[str, Any]) -> tuple[Any, str]:
    given = [(kind, options[kind]) for kind in ("method", "estimator", "command") if options[kind]]
    if len(given) != 1:
        raise click.UsageError("exactly one of --method, --estimator and --command says what is tested")
    kind, text = given[0]
    return ("callable" if kind == "estimator" else kind), text
