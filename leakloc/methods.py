"""The one way in: frames and a believed rig to leaks, by the method of the user's choice."""

from __future__ import annotations

import numpy as np

from leakloc.background import Frames
from leakloc.estimate import Estimate
from leakloc.paper import PaperOptions, locate_by_paper
from leakloc.rig import Rig
from leakloc.robust import locate_robustly

METHODS = ("robust", "paper")
MIN_FRAMES = 3  # the median of two frames is their mean: nothing would stand out against it


def locate(  # noqa: PLR0913  # the one front door: every method's numbers come in here
    left: Frames,
    right: Frames,
    rig: Rig,
    *,
    method: str = "robust",
    options: PaperOptions | None = None,
    expected_false_leaks: float = 0.05,
) -> Estimate:
    """Where the leaks are, from the two views of one clip and the rig that is believed to have taken it.

    left, right (frames, height, width) uint8 or uint16 raw grey, at least 3 frames; neither is changed. Method "robust"
    is held to `expected_false_leaks` per clip without leaks (0 < it <= 1); `options` belong to the paper's method (its
    defaults if None). Raises ValueError for arrays that are not that, that differ from each other or from the rig's
    image size, for an unknown method, and for a number or options that the method cannot use.
    """
    if method not in METHODS:
        raise ValueError(f"locate: method must be one of {', '.join(METHODS)}, got {method!r}")
    if options is not None and not isinstance(options, PaperOptions):
        raise ValueError(f"locate: options must be PaperOptions, got {type(options).__name__}")
    if options is not None and method != "paper":
        raise ValueError(f"locate: options belong to method 'paper', got method {method!r}")
    if not 0 < expected_false_leaks <= 1:
        raise ValueError(f"locate: expected_false_leaks must be > 0 and <= 1 per clip, got {expected_false_leaks}")
    _check_frames(left, right, rig)
    if method == "robust":
        return locate_robustly(left, right, rig, expected_false_leaks)
    return locate_by_paper(left, right, rig, options or PaperOptions())


def _check_frames(left: Frames, right: Frames, rig: Rig) -> None:
    for name, frames in (("left", left), ("right", right)):
        if not isinstance(frames, np.ndarray) or frames.dtype not in (np.uint8, np.uint16):
            raise ValueError(
                f"locate: {name} must be a uint8 or uint16 array, got {getattr(frames, 'dtype', type(frames).__name__)}"
            )
        if frames.ndim != 3:
            raise ValueError(f"locate: {name} must be (frames, height, width), got shape {frames.shape}")
    if left.shape != right.shape or left.dtype != right.dtype:
        raise ValueError(
            f"locate: left and right must be alike, got {left.shape} {left.dtype} and {right.shape} {right.dtype}"
        )
    if len(left) < MIN_FRAMES:
        raise ValueError(f"locate: at least {MIN_FRAMES} frames are needed, got {len(left)}")
    if (left.shape[2], left.shape[1]) != rig.image_size:
        raise ValueError(
            f"locate: images must have the rig's image_size {rig.image_size}, got {(left.shape[2], left.shape[1])}"
        )
