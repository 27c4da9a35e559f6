"""Campaigns of small images, for tests: a scene takes a tenth of a second."""

import subprocess
import sys
from concurrent.futures import BrokenExecutor, Executor, Future

from scenarios.campaign_csv import campaign_csv
from scenarios.campaign_file import read_campaign
from scenarios.lanes import Kind
from scenarios.run_campaign import local_workers, running
from scenarios.store import read_store

SMALL = """
name = "small"
description = "Frames and dose, for tests."
scenario = "separated"
seed = 3
set = ["rig.width_px=96", "rig.height_px=54", "pedestal.texture=uniform", "effects.drop_shadows=false"]
methods = ["paper", "naive"]
scene_limit_s = 30.0
repeats = {repeats}
[[axis]]
key = "recording.n_frames"
values = {frames}
[[axis]]
key = "gamma.dose_rate_gy_h"
label = "dose rate (Gy/h)"
values = {doses}
"""


def small_campaign(folder, repeats=2, frames="[4, 5, 6]", doses="[0.0, 5.0]"):
    path = folder / "small.toml"
    path.write_text(SMALL.format(repeats=repeats, frames=frames, doses=doses))
    return path


class Inline(Executor):
    """Does the work at once, in this process; its "worker" dies of the calls that `dies_of` says."""

    def __init__(self, dies_of=lambda _: False):
        self._dies_of = dies_of

    def submit(self, call, /, *arguments):
        future = Future()
        try:
            if self._dies_of((call.__name__, *arguments)):
                raise BrokenExecutor("dead")
            future.set_result(call(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future


def inline(dies_of=lambda _: False, n_lanes=1):
    """Lanes that cost no start of a process."""
    return Kind((lambda: Inline(dies_of),) * n_lanes, (BrokenExecutor,))


def run(path, store, kind=None, foreign=(), stop_after=None):
    """Run a campaign, or a part of it, on one process unless told otherwise; returns the scenes done, in order."""
    done = []
    with running(read_campaign(path), foreign, store, kind or local_workers(1)) as under_way:
        for outcome in under_way.left:
            done.append(outcome.number)
            if len(done) == stop_after:
                break
    return done


def start(path, store, n_workers=1):
    """Start a campaign as a program of its own."""
    words = [sys.executable, "-m", "scenarios", "campaign", "run", str(path), "-o", str(store)]
    return subprocess.Popen([*words, "--workers", str(n_workers)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT)


def csv_of(store):
    return campaign_csv(read_store(store))
