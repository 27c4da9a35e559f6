"""Candidate columns (paper Algorithm 1): a threshold on the profile, then non-maximum suppression."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Profile = NDArray[np.float64]


def threshold_grey(profile_grey: Profile, k_sigma: float) -> float:
    """mean(g) + k_sigma std(g), grey (ddof 0). A flat profile's threshold is its own value: nothing stands out."""
    if profile_grey.min() == profile_grey.max():
        return float(profile_grey[0])  # the mean of equal numbers may round below them
    return float(profile_grey.mean() + k_sigma * profile_grey.std())


def detect_columns(profile_grey: Profile, *, k_sigma: float, g_win_px: int) -> NDArray[np.intp]:
    """Columns above the threshold that are the maximum of g over j - g_win .. j + g_win (paper Algorithm 1).

    profile_grey (width,), finite. The window is inclusive on both sides and clipped at the border; "above" is
    strict. Equal maxima within one window are one peak, which stands on its lowest column (the paper is silent; to the
    letter a plateau would be as many leaks as it has columns). Returns ascending columns, possibly none.
    """
    width = len(profile_grey)
    g_win_px = min(g_win_px, width)  # a wider window sees no more
    padded = np.concatenate([np.full(g_win_px, -np.inf), profile_grey, np.full(g_win_px, -np.inf)])
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * g_win_px + 1)
    first_maximum = windows.argmax(axis=1) - g_win_px + np.arange(width)
    above = profile_grey > threshold_grey(profile_grey, k_sigma)
    return np.flatnonzero(above & (first_maximum == np.arange(width)))
