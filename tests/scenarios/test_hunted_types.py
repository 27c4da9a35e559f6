"""Hunted data never yields a rate, an interval or a quantile: the types refuse it, before a run and during one."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

from scenarios.hunted import Counterexample, HuntedDataError, Severity
from scenarios.scenario import Scenario
from scenarios.statistics import (
    assert_independent,
    assert_quantile,
    assert_rate,
    clopper_pearson,
    mean_interval,
    median_interval,
)

FOUND = Counterexample("missed.unexplained", Scenario(), 0, Severity(-0.5), 7, 1.0)
ROWS = [FOUND.severity] * 60


@pytest.mark.parametrize(
    "asked",
    [
        pytest.param(lambda: clopper_pearson(FOUND, 10), id="a counterexample as a count"),
        pytest.param(lambda: clopper_pearson(3, FOUND.severity), id="a margin as a number of trials"),
        pytest.param(lambda: median_interval(ROWS), id="a median of margins"),
        pytest.param(lambda: mean_interval([ROWS, ROWS]), id="a mean of margins"),
        pytest.param(lambda: assert_quantile(ROWS, 0.5, 1.0), id="a quantile of margins"),
        pytest.param(lambda: assert_independent(ROWS, ROWS), id="a correlation of margins"),
        pytest.param(lambda: assert_rate(lambda _: FOUND), id="a counterexample as a trial"),
        pytest.param(lambda: float(FOUND.severity), id="a margin as a number"),
        pytest.param(lambda: len(FOUND), id="a length"),
        pytest.param(lambda: list(FOUND), id="a list"),
        pytest.param(lambda: sum(ROWS), id="a sum"),
    ],
)
def test_what_was_hunted_is_no_sample(asked):
    with pytest.raises(TypeError) as caught:
        asked()
    assert isinstance(caught.value, HuntedDataError) or "unsupported operand" in str(caught.value)


def test_severities_can_be_put_in_order_and_shown():
    assert min(Severity(0.2), Severity(-0.3)) == Severity(-0.3)
    assert str(Severity(-0.3)) == "-0.30"


@pytest.mark.deep
@pytest.mark.skipif(importlib.util.find_spec("mypy") is None, reason="mypy is in the extra `lint`")
def test_the_type_checker_refuses_hunted_data(tmp_path):
    code = "from scenarios.hunted import Counterexample\nfrom scenarios.statistics import clopper_pearson\n"
    (tmp_path / "rate.py").write_text(
        f"{code}def rate(c: Counterexample) -> object:\n    return clopper_pearson(c, 9)\n"
    )
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--config-file", "", "--ignore-missing-imports", str(tmp_path / "rate.py")],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert 'Argument 1 to "clopper_pearson" has incompatible type "Counterexample"' in done.stdout
