"""One leak's line in both views, fitted to its signed column profiles: glints in its drops, and its shadows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from leakloc.glints import glint_offsets
from leakloc.levelled import LevelPair
from leakloc.rig import Array, Rig
from leakloc.shadows import penumbra_m, shadow_places

BLUR_PX = 0.75  # standard deviation of a point's image: lens, and the pixel's own width
CHORD_NODES = 24
CHORD_ANGLES = np.arange(1, CHORD_NODES + 1) * np.pi / (CHORD_NODES + 1)
CHORD_PLACES, CHORD_WEIGHTS = np.cos(CHORD_ANGLES), np.sin(CHORD_ANGLES) ** 2 / (np.sin(CHORD_ANGLES) ** 2).sum()
RADIUS_FACTORS = (1 / 3, 2.5)  # drops of 2 to 15 mm; two lamps' glints stand apart and tell, one lamp's do not
DROP_RADIUS_M = 0.006  # in the middle of what drips: free drops reach 3 mm, drops of the paper are drawn larger
UNKNOWN_GLINT = (np.zeros(1), np.ones(1))  # without a lamp: in the middle of the drop
LAMP_ERROR_M, WALL_ERROR = 0.05, 0.01  # how well lamp and wall (share of its radius) are believed to be known
RADIUS_SPREAD = 0.7  # of its logarithm
ONE_RADIUS = 1e-6
WIDTH_SPREAD = 0.15  # of the logarithm of a shadow's width
WINDOW_PX = 25
STRAY_PX = 1.5  # of a drop from where it was seen, lest it slides onto its shadow
MODEL_ERROR = 0.02  # of the profile's peak: what the shapes cannot follow


@dataclass(frozen=True, eq=False)
class Profile:
    """What a view shows of one leak's signature: signed values per column (width,), and their standard deviation."""

    values: Array
    sigma: float


@dataclass(frozen=True, eq=False)
class LineFit:
    """`columns_px` (2,) of the drop, `covariance_px2` (2, 2); `glint_sigmas` (2,): significance of the bright part.

    `chi2` per sample.
    """

    columns_px: Array
    covariance_px2: Array
    glint_sigmas: Array
    chi2: float


@dataclass(frozen=True, eq=False)
class Prediction:
    """What a leak at a place would look like: per lamp and view, arrays (lamps, 2).

    `shadows_px`: columns of its shadows, NaN where there is none or it is not known; `blur_px`: half-width of the
    penumbra; `spread_px`: standard deviation of what is believed of the column. `glints[lamp][view]`: offsets in px
    and shares of light.
    """

    shadows_px: Array
    blur_px: Array
    spread_px: Array
    glints: list[list[tuple[Array, Array]]]

    @property
    def lamps(self) -> int:
        """How many lamps glitter."""
        return len(self.glints)


def gaussian(columns_px: Array, centre_px: float, sigma_px: float) -> Array:
    """A point's image, of unit sum."""
    return np.asarray(np.exp(-0.5 * ((columns_px - centre_px) / sigma_px) ** 2) / (np.sqrt(2 * np.pi) * sigma_px))


def blurred_chord(columns_px: Array, centre_px: float, radius_px: float) -> Array:
    """A disc swept along the column and blurred, of unit sum: sqrt(1 - u^2) by Gauss-Chebyshev nodes."""
    places = centre_px + radius_px * CHORD_PLACES
    sigma = np.hypot(BLUR_PX, 1.2 * radius_px / CHORD_NODES)  # bridges the nodes of a very wide shadow
    return np.asarray(
        np.exp(-0.5 * ((columns_px[:, None] - places) / sigma) ** 2) @ CHORD_WEIGHTS / (np.sqrt(2 * np.pi) * sigma)
    )


def predict(place_m: Array, level: LevelPair, rig: Rig) -> Prediction:
    """Glints and shadows of a leak at place (2,), as far as lamps and wall are known."""
    lamps = rig.lamps if rig.lamps is not None else np.empty((0, 4))
    n = max(1, len(lamps))
    shadows, blur, spread = (np.full((n, 2), np.nan) for _ in range(3))
    glints = [[UNKNOWN_GLINT] * 2 for _ in range(n)]
    drop_m = np.append(place_m, level.centres_m[:, 2].mean())
    px_per_m = level.focal_px / float(level.depths_m(place_m[None])[0])
    for i, lamp in enumerate(lamps):
        for view in range(2):
            offsets, shares = glint_offsets(level.centres_m[view], lamp[:3], drop_m, level.axes[0])
            glints[i][view] = DROP_RADIUS_M * px_per_m * offsets, shares
        if rig.pedestal_radius is not None:
            shadows[i], blur[i], spread[i] = _shadow(place_m, lamp, level, rig.pedestal_radius)
    return Prediction(shadows, blur, spread, glints)


def _shadow(place_m: Array, lamp: Array, level: LevelPair, radius_m: float) -> tuple[Array, Array, Array]:
    shadow_m = shadow_places(place_m, lamp[:2], radius_m)
    depth_m = float(level.depths_m(shadow_m)[0])
    if not depth_m > 0:  # behind the cameras, or no shadow at all
        return (np.full(2, np.nan),) * 3
    blur_m, magnified = penumbra_m(place_m, shadow_m[0], lamp[:2], lamp[3])
    px_per_m = level.focal_px / depth_m
    lamp_error_m, wall_error_m = LAMP_ERROR_M * (magnified - 1), WALL_ERROR * radius_m
    spread = px_per_m * np.hypot(lamp_error_m, 0.3 * wall_error_m) + 0.1
    return (
        level.columns_of(shadow_m)[0],
        np.full(2, px_per_m * np.hypot(blur_m, magnified * DROP_RADIUS_M)),
        np.full(2, spread),
    )


class _Problem:
    """Residuals of one leak's model.

    Parameters: the drop's two columns, the logarithm of its radius over DROP_RADIUS_M, then per shadow two columns and
    the logarithm of its width over the predicted one.
    """

    def __init__(self, profiles: Sequence[Profile], start_px: Array, level: LevelPair, rig: Rig) -> None:
        width = len(profiles[0].values)
        self.level, self.rig = level, rig
        self.columns = [
            np.arange(max(0, round(c) - WINDOW_PX), min(width, round(c) + WINDOW_PX + 1)).astype(np.float64)
            for c in start_px
        ]
        self.data = [p.values[x.astype(int)] for p, x in zip(profiles, self.columns, strict=True)]
        self.sigmas = [
            float(np.hypot(p.sigma, MODEL_ERROR * np.abs(d).max())) for p, d in zip(profiles, self.data, strict=True)
        ]
        self.expected = predict(level.places_of(start_px[None])[0], level, rig)
        reach_px = WINDOW_PX + self.expected.blur_px
        self.shadows = np.flatnonzero((np.abs(self.expected.shadows_px - start_px) < reach_px).any(axis=1))
        self.start = np.concatenate(
            [start_px, [0.0], *(np.append(self.expected.shadows_px[lamp], 0.0) for lamp in self.shadows)]
        )

    def bounds(self) -> tuple[Array, Array]:
        """Least and greatest parameters: the drop stays where it was seen, its radius unknown to one lamp."""
        least, most = np.full_like(self.start, -np.inf), np.full_like(self.start, np.inf)
        least[:2], most[:2] = self.start[:2] - STRAY_PX, self.start[:2] + STRAY_PX
        told = self.expected.lamps > 1
        least[2], most[2] = np.log(RADIUS_FACTORS) if told else (-ONE_RADIUS, ONE_RADIUS)
        return least, most

    def shapes(self, theta: Array, view: int) -> Array:
        """Columns' light of unit glints and shadows, (columns, shapes)."""
        x = self.columns[view]
        parts = [
            np.sum(
                [
                    s * gaussian(x, theta[view] + np.exp(theta[2]) * o, BLUR_PX)
                    for o, s in zip(*glint[view], strict=True)
                ],
                axis=0,
            )
            for glint in self.expected.glints
        ]
        for k, lamp in enumerate(self.shadows):
            at, log_width = theta[3 + 3 * k + view], theta[5 + 3 * k]
            parts.append(blurred_chord(x, at, self.expected.blur_px[lamp, view] * np.exp(log_width)))
        return np.stack(parts, axis=1)

    def amplitudes(self, theta: Array, view: int) -> tuple[Array, Array]:
        """Least-squares light of every shape, and what is left of the profile in standard deviations."""
        A = self.shapes(theta, view)
        light = np.linalg.lstsq(A, self.data[view], rcond=1e-6)[0]
        return light, (self.data[view] - A @ light) / self.sigmas[view]

    def residuals(self, theta: Array) -> Array:
        """Both views' rests, and how far shadows stray from where lamp and wall put them."""
        parts = [self.amplitudes(theta, view)[1] for view in range(2)]
        parts.append(theta[2:3] / RADIUS_SPREAD)
        place_m = self.level.places_of(theta[None, :2])[0]
        for k, lamp in enumerate(self.shadows):
            here = (
                predict(place_m, self.level, self.rig).shadows_px[lamp]
                if np.isfinite(place_m).all()
                else np.full(2, np.nan)
            )
            here = np.where(np.isnan(here), theta[:2], here)  # at the wall a drop stands on its shadow
            parts += [
                (theta[3 + 3 * k : 5 + 3 * k] - here) / self.expected.spread_px[lamp],
                theta[5 + 3 * k : 6 + 3 * k] / WIDTH_SPREAD,
            ]
        return np.concatenate(parts)


def fit_line(profiles: Sequence[Profile], start_px: Array, level: LevelPair, rig: Rig) -> LineFit:
    """Least-squares fit of both views' profiles; start_px (2,): the drop's columns to within a pixel or two."""
    problem = _Problem(profiles, start_px, level, rig)
    bounds = problem.bounds()
    found = least_squares(problem.residuals, problem.start, bounds=bounds, max_nfev=20, ftol=1e-4, xtol=1e-4, gtol=1e-4)
    covariance = np.linalg.pinv(found.jac.T @ found.jac)[:2, :2]
    n_lamps = len(problem.expected.glints)
    light, rest = zip(*(problem.amplitudes(found.x, view) for view in range(2)), strict=True)
    peak = float(gaussian(np.zeros(1), 0.0, BLUR_PX * np.sqrt(2))[0]) ** 0.5  # norm of a unit glint
    glint_sigmas = np.array([a[:n_lamps].sum() * peak / p.sigma for a, p in zip(light, profiles, strict=True)])
    return LineFit(found.x[:2], covariance, glint_sigmas, float((np.concatenate(rest) ** 2).mean()))
