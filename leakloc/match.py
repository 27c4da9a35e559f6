"""Matching of candidate columns between the views (paper Algorithm 2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Vectors = NDArray[np.float64]  # (candidates, frames, rows): the F_n column vector of every candidate, grey


def match_columns(left: Vectors, right: Vectors) -> NDArray[np.intp]:
    """Pairs of candidates whose columns look alike in most frames (paper Algorithm 2).

    left (a, n, rows) and right (b, n, rows) are the foreground's column vectors, candidates in ascending columns.
    Each candidate of the shorter list (the left one when equal), in turn, takes the candidate of the other list that
    is nearest in L2 in the most frames; that one is then no longer there for the next. Ties, of a distance within a
    frame and of the mode, go to the lowest column. Returns (min(a, b), 2) indices into left and right, in the order of
    the shorter list.
    """
    if len(left) > len(right):
        return match_columns(right, left)[:, ::-1]
    squared = _squared_distances(left, right)
    free = np.arange(len(right))
    pairs = np.empty((len(left), 2), np.intp)
    for candidate, distances in enumerate(squared):
        nearest = distances[:, free].argmin(axis=1)  # argmin and argmax take the first of equals
        winner = np.bincount(nearest).argmax()
        pairs[candidate] = candidate, free[winner]
        free = np.delete(free, winner)
    return pairs


def _squared_distances(left: Vectors, right: Vectors) -> NDArray[np.float64]:
    """|a - b|^2 of every two column vectors of one frame, (left, frames, right).

    By |a|^2 + |b|^2 - 2 a.b, which is as exact as the difference here: entries are whole or half greys, and every sum
    stays far below 2^53 quarters, so no term is ever rounded.
    """
    a, b = left.transpose(1, 0, 2), right.transpose(1, 2, 0)
    product = a @ b
    squared = (left**2).sum(axis=2).T[:, :, None] + (right**2).sum(axis=2).T[:, None, :] - 2 * product
    return np.ascontiguousarray(squared.transpose(1, 0, 2))
