"""What an estimator hands back, whatever its method."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

FRAMES_OF_REFERENCE = ("world", "left camera")


@dataclass(frozen=True, eq=False)
class LeakEstimate:
    """One leak on the top view; undefined numbers are NaN.

    `x_m`, `y_m` in the estimate's frame; `covariance_m2` (2, 2); `score` grows with certainty and is comparable within
    one method only; columns are where the leak's line crosses row (H - 1) / 2 of the raw images, `column_sigma_px`
    their standard deviation.
    """

    x_m: float
    y_m: float
    covariance_m2: NDArray[np.float64]
    score: float
    left_column_px: float
    right_column_px: float
    column_sigma_px: float


@dataclass(frozen=True, eq=False)
class Estimate:
    """The leaks of one clip, in `frame` ("world" or "left camera", see `Rig.frame`), and how they were found.

    `diagnostics` is plain data (mappings, sequences, numbers with NaN for undefined, texts) whose keys belong to the
    method; the paper's are listed in `leakloc.paper`. No leaks is a result.
    """

    method: str
    frame: str
    leaks: tuple[LeakEstimate, ...]
    diagnostics: Mapping[str, Any] = field(default_factory=dict)
