"""Profiles, fresh seeds, random orders, and the rendered scenes that a run is worth.

`ci` replays the same examples on every run, `deep` (make deep) draws fresh ones. HARNESS_SEED chooses the scenes and
draws of the statistical tests: 0 unless told, a fresh one in the deep profile; it is printed. HARNESS_ORDER shuffles
the files and the tests in each of them.
"""

import os
import random
import secrets
import sys
import time
from itertools import groupby

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

PROFILE = os.environ.get("HYPOTHESIS_PROFILE", "ci")
SCENES = pytest.StashKey[int]()
BEGAN_S = pytest.StashKey[float]()

settings.register_profile(
    "ci", derandomize=True, deadline=None, database=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile("deep", max_examples=1000, deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile(PROFILE)


def pytest_configure(config):
    # set for the workers too: they are started later and inherit it
    os.environ.setdefault("HARNESS_SEED", str(secrets.randbelow(10**9) if PROFILE == "deep" else 0))
    config.stash[SCENES], config.stash[BEGAN_S] = 0, time.monotonic()


@pytest.fixture(scope="session")
def harness_seed():
    """Seed of the scenes of statistical tests, below 10^9."""
    return int(os.environ["HARNESS_SEED"])


@pytest.fixture(scope="module")
def fresh_draws(harness_seed):
    """Let every fixed seed of numpy in a file stand for another one unless HARNESS_SEED is 0."""
    if harness_seed == 0:
        yield
        return
    generator, sequence = np.random.default_rng, np.random.SeedSequence

    def salted(entropy):
        return entropy if entropy is None else (harness_seed, *np.atleast_1d(entropy).tolist())

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            np.random, "default_rng", lambda seed=None: generator(seed if isinstance(seed, sequence) else salted(seed))
        )
        patch.setattr(np.random, "SeedSequence", lambda entropy=None, **keys: sequence(salted(entropy), **keys))
        yield


def pytest_collection_modifyitems(items):
    """Shuffle files, then the tests of each: what a file prepares once is not prepared again for every test."""
    if order := os.environ.get("HARNESS_ORDER"):
        shuffler = random.Random(order)
        files = [list(group) for _, group in groupby(items, key=lambda item: item.path)]
        for tests in files:
            shuffler.shuffle(tests)
        shuffler.shuffle(files)
        items[:] = [test for tests in files for test in tests]


def pytest_collection_finish(session):
    """Count rendered clips from here on, in this process."""
    if "simcam" not in sys.modules:
        return
    simcam = sys.modules["simcam"]
    render_clip = simcam.render_clip

    def counted(*arguments, **options):
        session.config.stash[SCENES] += 1
        return render_clip(*arguments, **options)

    simcam.render_clip = counted


def pytest_sessionfinish(session):
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["scenes"] = session.config.stash[SCENES]


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node, error):
    node.config.stash[SCENES] += getattr(node, "workeroutput", {}).get("scenes", 0)


def pytest_terminal_summary(terminalreporter, config):
    minutes = (time.monotonic() - config.stash[BEGAN_S]) / 60
    scenes = config.stash[SCENES]
    told = [f"{name}={os.environ[name]}" for name in ("HARNESS_SEED", "HARNESS_ORDER") if os.environ.get(name)]
    terminalreporter.write_line(" ".join(told))
    terminalreporter.write_line(
        f"{scenes} scenes rendered in {60 * minutes:.0f} s, the tests included: {scenes / minutes:.0f} scenes a minute"
    )
