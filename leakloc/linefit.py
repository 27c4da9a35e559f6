"""One leak's line in both views, fitted to its signed column profiles: glints in its drops, and its shadows."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from leakloc.levelled import LevelPair
from leakloc.lineshape import BLUR_PX, PEAK, blurred_chord, gaussian, limb
from leakloc.prediction import DROP_RADIUS_M, Prediction, predict, predict_shadows
from leakloc.rig import Array, Rig

BLUR_SPREAD, BLUR_FACTORS = 0.25, (0.6, 2.0)  # of its logarithm; least and most
RADIUS_SPREAD, RADIUS_FACTORS = 0.7, (1 / 3, 3.0)  # of its logarithm; drops of 2 to 18 mm
LAMP_SPREAD = 0.3  # of the logarithm of one lamp's power over another's
WIDTH_SPREAD = 0.15  # of the logarithm of a shadow's width
WINDOW_PX = 25
DARK_PX = 1.5  # standard deviation of a seen shadow's columns, which its drop may have pulled
STRAY_PX = 1.5  # of a drop from where it was seen, lest it slides onto its shadow
LIMBS = (-1.0, 1.0)  # sides of a drop
LIMB_SHARE = 0.08  # of the profile's peak: standard deviation of what a limb shows of the walls
START_RADII = (0.6, 1.8)  # of DROP_RADIUS_M
TRIED_GLINTS = 2  # starts from single glints that are fitted, of the nine that are looked at
BAD_CHI2 = 4.0  # per sample of a bright line: its columns may be those of single glints, not of their drop
MODEL_ERROR = 0.02  # of the profile's peak: what the shapes cannot follow
STEP = 1e-6  # of a parameter, px or logarithm, for the slopes of the residuals
SAME_SHAPE = 1e-6  # shapes that differ by less of their size are one
LEAST_CHI2 = 0.2  # per sample of a bright line: most shapes follow better than that, and say so


@dataclass(frozen=True, eq=False)
class Profile:
    """What a view shows of one leak's signature: signed values per column (width,), and their standard deviation."""

    values: Array
    sigma: float


@dataclass(frozen=True, eq=False)
class LineFit:
    """`columns_px` (2,) of the drop, `covariance_px2` (2, 2); `glint_sigmas` (2,): significance of the bright part.

    `chi2` per sample: the covariance is already scaled by it, `glint_sigmas` where it is more than 1. `glint_shares`
    (2,): light of the drop over what its strongest shadow in the window takes, inf without one.
    """

    columns_px: Array
    covariance_px2: Array
    glint_sigmas: Array
    glint_shares: Array
    chi2: float


def stray(level: LevelPair, start_px: Array) -> float:
    """How far a drop may be from where it was seen, px."""
    depth_m = float(level.depths_m(level.places_of(start_px[None]))[0])
    return max(STRAY_PX, 2 * DROP_RADIUS_M * level.focal_px / depth_m) if depth_m > 0 else STRAY_PX


def _with_shadow(expected: Prediction, dark_px: Array) -> Prediction:
    """The prediction with a shadow that is seen and not told: crisp, on these columns to within DARK_PX."""
    told = np.full_like(expected.shadows_px, np.nan)
    first = told.copy()
    first[0] = 1.0
    told[0] = dark_px
    return replace(expected, shadows_px=told, lamp_blur_px=first, core_px=first, spread_px=DARK_PX * first)


class _Problem:
    """Residuals of one leak's model.

    Parameters: the drop's two columns; the logarithms of its radius over DROP_RADIUS_M and of the blur over BLUR_PX;
    the logarithm of each further lamp's power over the first one's; then per shadow how far its two columns stray from
    where lamp and wall put them, and the logarithm of its width over the predicted one. Limbs are for bright lines:
    beside a shadow they could stand for it. Parameters come as stacks (n, parameters), for the numbers of one leak are
    so few that calling numpy costs more than they do.
    """

    def __init__(
        self,
        profiles: Sequence[Profile],
        start_px: Array,
        stage: tuple[LevelPair, Rig],
        dark_px: Array | None,
        limbs: tuple[float, ...],
    ) -> None:
        width = len(profiles[0].values)
        self.level, self.rig = level, rig = stage
        self.columns = [
            np.arange(max(0, round(c) - WINDOW_PX), min(width, round(c) + WINDOW_PX + 1)).astype(np.float64)
            for c in start_px
        ]
        self.data = [p.values[x.astype(int)] for p, x in zip(profiles, self.columns, strict=True)]
        self.sigmas = [
            float(np.hypot(p.sigma, MODEL_ERROR * np.abs(d).max())) for p, d in zip(profiles, self.data, strict=True)
        ]
        self.expected = predict(level.places_of(start_px[None])[0], level, rig)
        self.dark_px = dark_px if np.isnan(self.expected.shadows_px).all() else None
        if self.dark_px is not None:
            self.expected = _with_shadow(self.expected, self.dark_px)
        reach_px = WINDOW_PX + self.expected.blur_px
        self.shadows = np.flatnonzero((np.abs(self.expected.shadows_px - start_px) < reach_px).any(axis=1))
        self.lamps = len(self.expected.glints_px)
        self.limbs = limbs
        self.light = [float(np.abs(d).max()) / PEAK for d in self.data]
        self.first = 3 + self.lamps  # of the shadows' parameters
        self.start = np.concatenate([start_px, np.zeros(self.first - 2 + 3 * len(self.shadows))])
        self.stray_px = stray(level, start_px) if self.limbs else STRAY_PX
        self.spreads = np.concatenate(
            [
                [RADIUS_SPREAD, BLUR_SPREAD],
                np.full(self.lamps - 1, LAMP_SPREAD),
                *(np.append(self.expected.spread_px[lamp], WIDTH_SPREAD) for lamp in self.shadows),
            ]
        )

    def starts(self) -> list[Array]:
        """Of a bright line a small drop and a large one: several glints of the one may look like one of the other."""
        if not self.limbs:
            return [self.start]
        return [np.concatenate([self.start[:2], [np.log(radius)], self.start[3:]]) for radius in START_RADII]

    def starts_of_glints(self) -> list[Array]:
        """The start with either column a glint left or right of the middle of a large drop; the best ones by cost.

        Several lamps draw a near drop as glints apart, and what was matched may be one of this lamp and one of that.
        """
        if not self.limbs:
            return []
        sides = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=2)))
        starts = np.tile(self.start, (len(sides), 1))
        off_px = sides * START_RADII[-1] * self.expected.drop_px
        starts[:, :2] += np.clip(off_px, -0.9 * self.stray_px, 0.9 * self.stray_px)
        starts[:, 2] = np.log(START_RADII[-1])
        costs = (self.residuals(starts) ** 2).sum(axis=1)
        return list(starts[np.argsort(costs, kind="stable")[:TRIED_GLINTS]])

    def bounds(self) -> tuple[Array, Array]:
        """Least and greatest parameters: the drop stays where it was seen, radius and blur what they can be."""
        least, most = np.full_like(self.start, -np.inf), np.full_like(self.start, np.inf)
        least[:2], most[:2] = self.start[:2] - self.stray_px, self.start[:2] + self.stray_px
        (least[2], most[2]), (least[3], most[3]) = np.log(RADIUS_FACTORS), np.log(BLUR_FACTORS)
        return least, most

    def shapes(self, theta: Array, view: int) -> Array:
        """Light of unit glints, of a drop's limbs if they are asked for, and of unit shadows, (n, columns, shapes)."""
        x, radius, blur_px = self.columns[view], np.exp(theta[:, 2]), BLUR_PX * np.exp(theta[:, 3])
        powers = np.exp(np.concatenate([np.zeros((len(theta), 1)), theta[:, 4 : self.first]], axis=1))
        light = (self.expected.glint_light[:, view] * powers[:, :, None]).reshape(len(theta), -1, 1)
        at = theta[:, view, None] + radius[:, None] * self.expected.glints_px[:, view].ravel()
        glints = (gaussian(x[:, None], at[:, None], blur_px[:, None, None]) @ light)[..., 0]
        parts = [glints / glints.sum(axis=1, keepdims=True)]
        drop_px = radius * self.expected.drop_px[view]
        parts += [limb(x, theta[:, view], drop_px, blur_px, side) for side in self.limbs]
        if len(self.shadows):
            shadows_px = self.shadows_px(theta)[..., view]
            for k, lamp in enumerate(self.shadows):
                half_px = np.hypot(self.expected.lamp_blur_px[lamp, view], radius * self.expected.core_px[lamp, view])
                half_px = half_px * np.exp(theta[:, self.first + 3 * k + 2])
                parts.append(blurred_chord(x, shadows_px[:, k], half_px, blur_px))
        return np.stack(parts, axis=2)

    def shadows_px(self, theta: Array) -> Array:
        """Columns (n, shadows, 2) of the shadows."""
        strays = theta[:, self.first :].reshape(len(theta), -1, 3)[..., :2]
        if self.dark_px is not None:
            return np.asarray(self.dark_px + strays)
        told = predict_shadows(self.level.places_of(theta[:, :2]), self.level, self.rig)[:, self.shadows]
        return np.where(np.isnan(told), theta[:, None, :2], told) + strays  # at the wall a drop stands on its shadow

    def amplitudes(self, theta: Array, view: int) -> tuple[Array, Array]:
        """Least-squares light (n, shapes), and what is left of the profile in standard deviations (n, samples)."""
        limbs = len(self.limbs)
        A = self.shapes(theta, view) / self.sigmas[view]
        believed = np.eye(limbs, A.shape[2], k=1) / (LIMB_SHARE * self.light[view])  # limbs show little
        A = np.concatenate([A, np.broadcast_to(believed, (len(theta), *believed.shape))], axis=1)
        data = np.append(self.data[view] / self.sigmas[view], np.zeros(limbs))
        light = _least_norm(A, data)
        return light, data - (A @ light[..., None])[..., 0]

    def residuals(self, theta: Array) -> Array:
        """Both views' rests, and how far every other parameter strays from what is believed of it, (n, samples)."""
        rests = [self.amplitudes(theta, view)[1] for view in range(2)]
        return np.concatenate([*rests, theta[:, 2:] / self.spreads], axis=1)

    def slopes(self, theta: Array) -> Array:
        """Change of the residuals with every parameter at theta (parameters,), (samples, parameters)."""
        steps = np.where(theta + STEP > self.bounds()[1], -STEP, STEP)
        at = self.residuals(np.vstack([theta, theta + np.diag(steps)]))
        return np.asarray((at[1:] - at[0]).T / steps)


def _least_norm(A: Array, data: Array) -> Array:
    """Least-squares solutions (n, shapes) of A (n, samples, shapes) for data (samples,), of least norm.

    By eigenvectors of the normal equations: shapes on one another, a few parts in 10^6 apart, count as one.
    """
    values, vectors = np.linalg.eigh(A.transpose(0, 2, 1) @ A)
    along = ((data @ A)[:, None] @ vectors)[:, 0]
    kept = np.where(values > SAME_SHAPE**2 * values[:, -1:], values, np.inf)
    return np.asarray((vectors @ (along / kept)[..., None])[..., 0])


def fit_line(
    profiles: Sequence[Profile], start_px: Array, stage: tuple[LevelPair, Rig], dark_px: Array | None = None
) -> LineFit:
    """Least-squares fit of both views' profiles; start_px (2,): the drop's columns to within a pixel or two.

    dark_px (2,): columns of a shadow that is seen beside the drop, which counts where lamp and wall tell of none.
    """
    return _least_squares(_Problem(profiles, start_px, stage, dark_px, ()), profiles)


def fit_bright_line(profiles: Sequence[Profile], start_px: Array, stage: tuple[LevelPair, Rig]) -> LineFit:
    """The same where nothing but a drop is seen: its limbs are fitted as well."""
    return _least_squares(_Problem(profiles, start_px, stage, None, LIMBS), profiles)


def _least_squares(problem: _Problem, profiles: Sequence[Profile]) -> LineFit:
    bounds = problem.bounds()

    def residuals(theta: Array) -> Array:
        return problem.residuals(theta[None])[0]

    def fitted(starts: Sequence[Array]) -> list[OptimizeResult]:
        return [
            least_squares(residuals, start, problem.slopes, bounds, max_nfev=20, ftol=1e-4, xtol=1e-4, gtol=1e-4)
            for start in starts
        ]

    fits = fitted(problem.starts())
    samples = sum(map(len, problem.data))
    if all(2.0 * one.cost > BAD_CHI2 * samples for one in fits):
        fits += fitted(problem.starts_of_glints())
    found = min(fits, key=lambda one: float(one.cost))
    solved = [problem.amplitudes(found.x[None], view) for view in range(2)]
    light, rest = [one[0][0] for one in solved], [one[1][0] for one in solved]
    chi2 = float((np.concatenate(rest) ** 2).mean())
    covariance = np.linalg.pinv(found.jac.T @ found.jac)[:2, :2] * max(LEAST_CHI2 if problem.limbs else 1.0, chi2)
    peak = float(gaussian(np.zeros(1), 0.0, BLUR_PX * np.sqrt(2))[0]) ** 0.5  # norm of a unit glint
    glint_sigmas = np.array([a[0] * peak / p.sigma for a, p in zip(light, profiles, strict=True)])
    glint_sigmas /= np.sqrt(max(1.0, chi2))
    taken = np.array([max(-a[1 + len(problem.limbs) :].min(initial=0.0), 1e-9) for a in light])
    return LineFit(found.x[:2], covariance, glint_sigmas, np.array([a[0] for a in light]) / taken, chi2)
