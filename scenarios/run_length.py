"""Run-length codes of masks, as COCO has them: lengths of runs of 0 and 1 in turn, down the columns."""

from typing import Any

import numpy as np


def encoded(mask: np.ndarray) -> dict[str, Any]:
    """Return a boolean mask (height, width) as COCO's uncompressed run lengths; the first run is of zeros."""
    flat = np.concatenate([[False], mask.ravel(order="F"), [not mask[-1, -1]]])
    ends = np.flatnonzero(flat[1:] != flat[:-1])
    return {"counts": np.diff(ends, prepend=0).tolist(), "size": list(mask.shape)}


def decoded(code: dict[str, Any]) -> np.ndarray:
    """Return the boolean mask (height, width) of run lengths; raises ValueError where they do not fill it."""
    height_px, width_px = code["size"]
    counts = np.asarray(code["counts"], dtype=int)
    if counts.sum() != height_px * width_px:
        raise ValueError(f"run lengths add up to {counts.sum()}, not {height_px} x {width_px}")
    runs = np.arange(len(counts)) % 2 == 1
    return np.repeat(runs, counts).reshape((height_px, width_px), order="F")
