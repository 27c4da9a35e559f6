"""A drop of water as a lens and a mirror: textbook numbers."""

import numpy as np
import pytest

from simcam.dropview import disc_strips
from simcam.optics import ORDERS, WATER_INDEX, fresnel_reflectance, glint, glint_branches, path_through_drop


def test_water_reflects_two_per_cent_head_on_and_everything_at_grazing():
    assert fresnel_reflectance(0.0) == pytest.approx(((WATER_INDEX - 1) / (WATER_INDEX + 1)) ** 2)
    assert fresnel_reflectance(np.pi / 2 - 1e-6) == pytest.approx(1, abs=1e-4)


def test_the_three_paths_carry_6_6_88_and_4_4_per_cent():
    impact = np.sqrt((np.arange(20_000) + 0.5) / 20_000)  # uniform over the disc
    shares = [path_through_drop(impact, order).share.mean() for order in ORDERS]
    assert shares == pytest.approx([0.066, 0.881, 0.044], abs=0.001)


def test_a_ray_near_the_middle_is_focused_two_radii_behind_the_centre():
    # paraxial focal length of a ball lens, n r / (2 (n - 1)) from its centre
    impact = 1e-4
    path = path_through_drop(np.array([impact]), 1)
    focus = path.along[0] + path.across[0] / np.tan(-path.turn_rad[0])
    assert focus == pytest.approx(WATER_INDEX / (2 * (WATER_INDEX - 1)), rel=1e-3)


def test_every_path_leaves_the_sphere_outwards_from_its_surface():
    impact = np.linspace(0.01, 0.99, 50)
    for order in ORDERS:
        path = path_through_drop(impact, order)
        assert np.hypot(path.along, path.across) == pytest.approx(np.ones(50))
        outward = np.cos(path.turn_rad) * path.along + np.sin(path.turn_rad) * path.across
        # the angle of leaving is the angle of incidence: the sphere is symmetric
        assert outward == pytest.approx(np.sqrt(1 - impact**2))


def test_the_primary_rainbow_is_at_138_degrees():
    assert np.degrees(glint_branches()[2].angle_rad[0]) == pytest.approx(137.9, abs=0.2)


def test_glints_of_all_directions_together_carry_their_orders_light():
    angle = np.linspace(1e-3, np.pi - 1e-3, 20_001)
    carried = []
    for branch in glint_branches():
        _, strength = glint(branch, angle, np.full(angle.size, 0.02))
        carried.append(2 * np.trapezoid(strength * np.sin(angle), angle))  # over pi
    assert carried[:2] == pytest.approx([0.066, 0.881], abs=0.001)
    assert sum(carried[2:]) == pytest.approx(0.044, abs=0.001)


def test_a_sphere_reflects_a_lamp_like_a_convex_mirror():
    # without losses d(sigma)/d(Omega) = r^2 / 4 for external reflection, whatever the angle
    branch = glint_branches()[0]
    angle = np.array([1.0, 2.0, 3.0])
    impact, strength = glint(branch, angle, np.full(3, 1e-3))
    assert impact == pytest.approx(np.cos(angle / 2), abs=1e-5)
    assert strength == pytest.approx(0.25 * fresnel_reflectance(np.arcsin(impact)), rel=1e-2)


def test_the_inner_glint_is_nearly_four_times_the_outer_one_seen_from_beside_the_lamp():
    angle, half = np.radians([175.0]), np.array([0.03])
    outer, inner = (glint(glint_branches()[index], angle, half)[1][0] for index in (0, 2))
    assert inner / outer == pytest.approx(3.9, rel=0.05)


@pytest.mark.parametrize("strips", [1, 7, 24])
def test_strips_have_the_discs_area_and_their_samples_lie_within_it(strips):
    disc = disc_strips(strips)
    assert (2 * disc.half_width * disc.height).sum() == pytest.approx(np.pi)
    right, down = disc.samples
    assert (np.hypot(right, down) < 1.001).all()
