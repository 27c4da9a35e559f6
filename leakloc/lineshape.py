"""What drops and shadows look like across the column that they fall along: the shapes of a line's profile."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from leakloc.rig import Array

BLUR_PX = 0.65  # standard deviation of a point's image: lens, and the pixel's own width
CHORD_NODES = 24
CHORD_ANGLES = np.arange(1, CHORD_NODES + 1) * np.pi / (CHORD_NODES + 1)
CHORD_PLACES, CHORD_WEIGHTS = np.cos(CHORD_ANGLES), np.sin(CHORD_ANGLES) ** 2 / (np.sin(CHORD_ANGLES) ** 2).sum()
PEAK = 1 / (np.sqrt(2 * np.pi) * BLUR_PX)  # of a point's image of unit light
LIMB_FROM = 0.4  # of a drop's radius: nearer the middle its glints outshine it


def gaussian(columns_px: Array, centre_px: float | Array, sigma_px: float | Array) -> Array:
    """A point's image, of unit sum."""
    return np.asarray(np.exp(-0.5 * ((columns_px - centre_px) / sigma_px) ** 2) / (np.sqrt(2 * np.pi) * sigma_px))


def blurred_chord(
    columns_px: Array, centre_px: float | Array, radius_px: float | Array, blur_px: float | Array = BLUR_PX
) -> Array:
    """Discs (n,) swept along the column and blurred, each of unit sum, (n, columns).

    sqrt(1 - u^2) by Gauss-Chebyshev nodes.
    """
    sigma_px = np.hypot(blur_px, 1.2 * radius_px / CHORD_NODES)  # bridges the nodes of a very wide shadow
    return _swept(columns_px, centre_px, radius_px, sigma_px, slice(None))


def limb(
    columns_px: Array, centre_px: float | Array, radius_px: float | Array, blur_px: float | Array, side: float
) -> Array:
    """One limb of drops' discs (n,) swept along the column and blurred, each of unit sum, (n, columns).

    `side`: -1 (left) or 1 (right). Besides the lamp's images a drop shows the walls, bent: one limb those beside the
    lamp, the other the dark ones.
    """
    return _swept(columns_px, centre_px, radius_px, blur_px, side * CHORD_PLACES > LIMB_FROM)


def _swept(
    columns_px: Array,
    centre_px: float | Array,
    radius_px: float | Array,
    sigma_px: float | Array,
    nodes: NDArray[np.bool_] | slice,
) -> Array:
    places_px = np.asarray(centre_px)[..., None] + np.asarray(radius_px)[..., None] * CHORD_PLACES[nodes]
    weights = CHORD_WEIGHTS[nodes] / CHORD_WEIGHTS[nodes].sum()
    sigmas_px = np.asarray(sigma_px)[..., None, None]
    return np.asarray(gaussian(columns_px[:, None], places_px[..., None, :], sigmas_px) @ weights)
