"""Is the clip fit to be judged? Covered, saturated or frozen cameras, repeated frames, exposures that jump."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from leakloc.background import Frames
from leakloc.levelled import VIEWS
from leakloc.signature import signature
from leakloc.streaks import Streaks
from leakloc.tracks import Track

WHITES = (1023, 4095, 16383, 65535)  # of 10, 12, 14 and 16 bits
STEP_PX = 7  # every seventh row and column tells a frame's exposure
DARK_SHARE = 0.01  # of full scale: a median image below it is covered, or unlit
SATURATED_SHARE = 0.5  # of the pixels at full scale
EXPOSURE_JUMP = 0.03  # of a frame's brightness against the clip's median
MOST_JUMPS, LEAST_FRAMES = 0.25, 3  # share of frames that may be left out; frames that must stay
LAG_BANDS = 3  # rows are compared between the views this far up and down
LEAST_LAG_LINES = 1

FIT, DARK, SATURATED, FROZEN = "fit", "dark or covered", "saturated", "frozen: no pixel ever changes"


def describe_condition(frames: Frames) -> dict[str, Any]:
    """State of one view (n, height, width): FIT or what is wrong, frames that repeat the one before, exposure jumps."""
    sample = frames[:, ::STEP_PX, ::STEP_PX]
    repeated = [i for i in range(1, len(frames)) if _equal(frames[i], frames[i - 1], sample[i], sample[i - 1])]
    level = sample.reshape(len(frames), -1).mean(axis=1)
    usual = float(np.median(level))
    jumps = np.flatnonzero(np.abs(level - usual) > EXPOSURE_JUMP * usual).tolist() if usual > 0 else []
    return {
        "state": _state(sample, frozen=len(repeated) == len(frames) - 1),
        "repeated_frames": repeated,
        "exposure_jumps": jumps,
    }


def _equal(frame: Frames, before: Frames, sample: Frames, sample_before: Frames) -> bool:
    return bool(np.array_equal(sample, sample_before) and np.array_equal(frame, before))


def full_scale(frames: Frames) -> int:
    """White of frames: 255, or of more than 8 bits the least of WHITES that their brightest pixel allows."""
    if frames.dtype == np.uint8:
        return 255
    brightest = int(frames.max(initial=0))
    return next(white for white in WHITES if brightest <= white)


def _state(sample: Frames, *, frozen: bool) -> str:
    full = full_scale(sample)
    if (sample == full).mean() > SATURATED_SHARE:
        return SATURATED
    if np.median(sample) < DARK_SHARE * full:
        return DARK
    return FROZEN if frozen else FIT


def alike_frames(frames: Frames, condition: dict[str, Any]) -> Frames:
    """The frames of one view without those whose exposure jumps in either, if that leaves most of them."""
    jumps = sorted({jump for view in condition.values() for jump in view["exposure_jumps"]})
    if not jumps or len(jumps) > MOST_JUMPS * len(frames) or len(frames) - len(jumps) < LEAST_FRAMES:
        return frames
    return np.delete(frames, jumps, axis=0)


def row_offset(tracks: Sequence[Track], views: Sequence[Streaks]) -> dict[str, float]:
    """How much lower the right view shows the same drops, in rows, with its standard error over lines; NaN if unknown.

    Level views of a true rig agree: an offset is an error of the calibration, or of the rig since. The peak of the
    signatures' correlation over whole bands, refined by a parabola.
    """
    offsets = [_offset_bands(track, views) for track in tracks]
    known = np.array([offset for offset in offsets if np.isfinite(offset)])
    rows = float(views[0].rows_px[1] - views[0].rows_px[0]) if len(views[0].rows_px) > 1 else float("nan")
    if len(known) < LEAST_LAG_LINES:
        return {"rows": float("nan"), "sigma_rows": float("nan")}
    sigma = float(known.std(ddof=1) / np.sqrt(len(known))) if len(known) > 1 else float("nan")
    return {"rows": float(np.median(known)) * rows, "sigma_rows": sigma * rows}


def _offset_bands(track: Track, views: Sequence[Streaks]) -> float:
    left, right = (
        signature(view.activity, column, 1.0)
        for view, column in zip(views, (track.left_px, track.right_px), strict=True)
    )
    bands = left.shape[1]
    reach = min(LAG_BANDS, bands - 1)
    lags = np.arange(-reach, reach + 1)
    agreement = np.array([_lagged(left, right, int(lag)) for lag in lags])
    best = int(agreement.argmax())
    if not 0 < best < len(lags) - 1:
        return float("nan")
    before, top, after = agreement[best - 1 : best + 2]
    bend = before - 2 * top + after
    return float(lags[best] + 0.5 * (before - after) / bend) if bend < 0 else float("nan")


def _lagged(left: NDArray[np.float64], right: NDArray[np.float64], lag: int) -> float:
    bands = left.shape[1]
    upper, lower = left[:, max(0, -lag) : bands - max(0, lag)], right[:, max(0, lag) : bands + min(0, lag)]
    return float((upper * lower).sum()) / max(1, bands - abs(lag))


def describe_clip(left: Frames, right: Frames) -> dict[str, Any]:
    """Condition of both views."""
    return dict(zip(VIEWS, (describe_condition(frames) for frames in (left, right)), strict=True))
