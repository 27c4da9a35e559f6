"""Estimators of other people, good and bad, as the bench meets them."""

import os
import signal
import time

import cv2
import numpy as np

import leakloc


def one_leak_on_the_axis(left, right, rig):
    assert left.dtype == np.uint8
    assert left.shape == right.shape
    assert rig.image_size == (left.shape[2], left.shape[1])
    return [(0.0, 0.0)]


def one_leak_as_far_as_there_are_threads(left, right, rig):
    return [(cv2.getNumThreads(), 0.0)]


def nothing(left, right, rig):
    return []


def raises(left, right, rig):
    raise RuntimeError("no idea")


def dies(left, right, rig):
    os._exit(3)


def hangs(left, right, rig):
    time.sleep(60)


def says_nan(left, right, rig):
    return [(float("nan"), 0.0)]


def says_nonsense(left, right, rig):
    return "over there"


def looks_for_the_truth(left, right, rig):
    """Search this process and the file system from here for anything that says where the leaks are."""
    import gc

    found = [o for o in gc.get_objects() if type(o).__name__ in {"Truth", "LeakTruth", "Scenario", "SimulatedClip"}]
    return [(1.0, 1.0)] if found else []


def kills_its_caller_or_hangs(left, right, rig):
    """Kills on clips of 5 frames, hangs on those of 6."""
    if len(left) == 5:
        os.kill(os.getppid(), signal.SIGKILL)
    time.sleep(60 if len(left) == 6 else 0)
    return []


def blind_below_20_cm(left, right, rig):
    """The robust method, broken on purpose: says nothing for baselines under 0.2 m."""
    if np.linalg.norm(rig.T) < 0.2 - 1e-9:
        return []
    return leakloc.locate(left, right, rig)
