"""One leak's line fitted to both profiles: where it says the drop is, and how well it says that it knows."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from scipy.stats import binom

from leakloc.levelled import level_pair
from leakloc.linefit import LIMBS, RADIUS_FACTORS, RADIUS_SPREAD, Profile, _Problem, fit_bright_line, fit_line
from leakloc.lineshape import BLUR_PX, gaussian, limb
from leakloc.prediction import DROP_RADIUS_M, predict
from leakloc.rig import Rig

LAMP = np.array([[-2.3, 0.8, 0.4, 0.1]])
"""Well to the side, so that a drop's glints stand off its middle by some tenths of its radius."""
N_FITS = 150


BOTH_SIDES = np.array([[-2.0, 1.2, 0.4, 0.1], [-2.0, -1.2, 0.4, 0.1]])


def with_lamps(rig, lamps=LAMP):
    return Rig(rig.K1, rig.D1, rig.K2, rig.D2, rig.R, rig.T, rig.image_size, rig.world_from_left, lamps)


def glinting(place_m, radius_factor, stage, rng, light=60):
    """Noisy profiles of a drop of so many believed radii, without a wall and so without shadows."""
    level, rig = stage
    expected, columns_px = predict(place_m, level, rig), level.columns_of(place_m[None])[0]
    x, profiles = np.arange(960.0), []
    for view in range(2):
        at = columns_px[view] + radius_factor * expected.glints_px[:, view]
        shape = gaussian(x[:, None], at.ravel(), BLUR_PX) @ expected.glint_light[:, view].ravel()
        profiles.append(Profile(light * shape + rng.normal(0, 1, 960), 1.0))
    return profiles, columns_px


def test_the_region_of_a_drop_of_unknown_radius_holds_its_columns(make_rig):
    rig, rng, inside = with_lamps(make_rig()), np.random.default_rng(11), 0
    level = level_pair(rig)
    for _ in range(N_FITS):
        place_m = np.array([rng.uniform(-0.5, 1.5), rng.uniform(-0.8, 0.8)])
        factor = np.clip(np.exp(RADIUS_SPREAD * rng.normal()), *RADIUS_FACTORS)
        profiles, columns_px = glinting(place_m, factor, (level, rig), rng)
        fit = fit_bright_line(profiles, np.rint(columns_px), (level, rig))
        off_px = fit.columns_px - columns_px
        inside += bool(off_px @ np.linalg.solve(fit.covariance_px2, off_px) < 5.99)
    # a coverage of 90 % gives fewer with probability 1e-4; with the radius thought known it is half of them
    assert inside >= binom.ppf(1e-4, N_FITS, 0.90), inside
    assert inside < N_FITS


def test_a_drop_of_the_believed_radius_is_found_within_its_noise(make_rig):
    rig, rng = with_lamps(make_rig()), np.random.default_rng(12)
    level, place_m = level_pair(rig), np.array([0.4, 0.3])
    errors_px = []
    for _ in range(40):
        profiles, columns_px = glinting(place_m, 1.0, (level, rig), rng)
        fit = fit_bright_line(profiles, np.rint(columns_px), (level, rig))
        errors_px.append(fit.columns_px - columns_px)
    # what the eye would say, the middle of the glints, is off by more
    glints = predict(place_m, level, rig)
    middle_px = (glints.glint_light[0] * glints.glints_px[0]).sum(axis=1)
    assert (np.abs(np.mean(errors_px, axis=0)) < 0.3 * np.abs(middle_px)).all()


@pytest.mark.parametrize("factor", [0.6, 1.9])
def test_a_drop_between_two_lamps_is_not_mistaken_for_a_smaller_or_a_larger_one(make_rig, factor):
    rig, rng = with_lamps(make_rig(), BOTH_SIDES), np.random.default_rng(13)
    level, place_m = level_pair(rig), np.array([0.1, 0.2])
    for _ in range(10):
        profiles, columns_px = glinting(place_m, factor, (level, rig), rng, 300)
        fit = fit_bright_line(profiles, np.rint(columns_px) + np.array([2, -1]), (level, rig))
        assert np.abs(fit.columns_px - columns_px).max() < 0.15
        assert fit.chi2 < 3


@pytest.mark.parametrize("off_px", [(-3.0, 3.0), (2.5, -3.0), (-3.0, -0.5)])
def test_a_near_drop_is_found_from_the_glints_of_different_lamps_that_were_matched(make_rig, off_px):
    rig, rng = with_lamps(make_rig(), BOTH_SIDES), np.random.default_rng(14)
    level, place_m = level_pair(rig), np.array([0.0, 0.3])
    for _ in range(5):
        profiles, columns_px = glinting(place_m, 1.9, (level, rig), rng, 300)
        fit = fit_bright_line(profiles, np.rint(columns_px + off_px), (level, rig))
        assert np.abs(fit.columns_px - columns_px).max() < 0.15
        assert fit.chi2 < 3


@given(st.floats(-0.5, 1.5), st.floats(-1.8, 1.8), st.floats(-2.3, -1.5), st.floats(-1.0, 1.0))
def test_a_mirrored_glint_is_seen_where_the_drop_mirrors_the_lamp_on_and_off_the_axis(
    make_rig, x_m, y_m, lamp_x_m, lamp_y_m
):
    rig = with_lamps(make_rig(), np.array([[lamp_x_m, lamp_y_m, 0.0, 0.1]]))
    level, place_m = level_pair(rig), np.array([x_m, y_m])
    expected = predict(place_m, level, rig)
    for view, camera_m in enumerate(level.centres_m):
        to_lamp, to_camera = (end[:2] - place_m for end in (rig.lamps[0], camera_m))
        between = to_lamp / np.linalg.norm(to_lamp) + to_camera / np.linalg.norm(to_camera)
        mirror_m = place_m + 1e-5 * between / np.linalg.norm(between)
        off_px = (level.columns_of(mirror_m[None]) - level.columns_of(place_m[None]))[0, view]
        assert expected.glints_px[0, view, 0] == pytest.approx(off_px * DROP_RADIUS_M / 1e-5, abs=2e-3)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_limb_lies_on_its_own_side_of_the_drop_and_no_farther_off_than_its_edge(side):
    x = np.arange(100.0)
    seen = limb(x, 50.0, 4.0, 0.5, side)
    assert seen.sum() == pytest.approx(1.0, abs=1e-3)
    assert 0.4 * 4 < side * (seen @ x / seen.sum() - 50) < 4


def test_a_bright_and_a_dark_limb_do_not_push_the_drop_aside(make_rig):
    rig, rng = with_lamps(make_rig()), np.random.default_rng(14)
    level, place_m, x = level_pair(rig), np.array([0.0, 0.1]), np.arange(960.0)
    with_limbs_px, without_px = [], []
    for _ in range(10):
        profiles, columns_px = glinting(place_m, 1.9, (level, rig), rng, 150)
        radius_px = 1.9 * DROP_RADIUS_M * level.focal_px / float(level.depths_m(place_m[None])[0])
        shown = [
            Profile(p.values + 16 * (limb(x, c, radius_px, BLUR_PX, 1.0) - limb(x, c, radius_px, BLUR_PX, -1.0)), 1.0)
            for p, c in zip(profiles, columns_px, strict=True)
        ]
        for found, fit in ((with_limbs_px, fit_bright_line), (without_px, fit_line)):
            found.append(fit(shown, np.rint(columns_px), (level, rig)).columns_px - columns_px)
    rms_px, rms_without_px = (np.sqrt(np.mean(np.square(errors))) for errors in (with_limbs_px, without_px))
    assert rms_px < 0.1
    assert rms_px < 0.5 * rms_without_px


@settings(max_examples=25, phases=(Phase.explicit, Phase.generate))  # a plainer example shows no more
@given(
    distance_m=st.floats(0.2, 2.4),  # of 2.5 to the wall, where shadows stand beside the drop
    azimuth_rad=st.floats(-0.5, 0.5),
    limbs=st.sampled_from([(), LIMBS]),
    seed=st.integers(0, 2**32 - 1),
    at_most=st.booleans(),
)
def test_residuals_of_a_stack_are_those_of_each_alone_and_slopes_are_their_derivatives(
    make_rig, distance_m, azimuth_rad, limbs, seed, at_most
):
    rig = replace(with_lamps(make_rig(), BOTH_SIDES), pedestal_radius=2.5)
    rng = np.random.default_rng(seed)
    stage = level_pair(rig), rig
    place_m = distance_m * np.array([np.cos(azimuth_rad), np.sin(azimuth_rad)])
    profiles, columns_px = glinting(place_m, 1.0, stage, rng)
    problem = _Problem(profiles, np.rint(columns_px), stage, None, limbs)
    least, most = problem.bounds()
    thetas = problem.start + rng.uniform(-0.3, 0.3, (4, len(problem.start)))
    if at_most:  # there a difference can only be taken backwards
        thetas[0, :4] = most[:4]
    alone = np.concatenate([problem.residuals(theta[None]) for theta in thetas])
    assert problem.residuals(thetas) == pytest.approx(alone, rel=1e-7, abs=1e-7)
    step = 1e-4 * np.eye(len(least))
    central = (problem.residuals(thetas[0] + step) - problem.residuals(thetas[0] - step)).T / 2e-4
    assert problem.slopes(thetas[0]) == pytest.approx(central, rel=1e-2, abs=1e-2 * np.abs(central).max())
