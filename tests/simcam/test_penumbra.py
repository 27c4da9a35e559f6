"""Shadows of drops: closed forms at one moment, the swept table against them, and the paper's observations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simcam import Lamp, Leak, Lens, Pedestal, Pose, Recording, Scene, UniformTexture, shadow_mask, stereo_rig
from simcam.penumbra import blocked_share, disc_overlap, swept_overlap, table_row

LAMP_M, LAMP_RADIUS_M, DROP_RADIUS_M = np.array([-2.3, 0.0, 0.0]), 0.1, 0.006


def test_overlap_of_discs_far_inside_and_half_way():
    assert disc_overlap(1.0, 2.0, 3.1) == 0
    assert disc_overlap(1.0, 2.0, 0.5) == pytest.approx(np.pi)
    # equal circles a radius apart: 2 pi / 3 - sqrt(3) / 2 (the vesica piscis)
    assert disc_overlap(1.0, 1.0, 1.0) == pytest.approx(2 * np.pi / 3 - np.sqrt(3) / 2)


@given(share=st.floats(0.02, 0.98), offset=st.floats(0, 1), travel=st.floats(-1, 1))
def test_the_swept_table_is_the_integral_of_the_overlap(share, offset, travel):
    middles = -1 + (np.arange(4000) + 0.5) / 4000 * (travel + 1)
    overlap = disc_overlap(share, 1 - share, np.hypot(offset, middles)) / (np.pi * share * (1 - share)) ** 2
    expected = overlap.mean() * (travel + 1)
    row = table_row(np.array([share], np.float32), np.array([offset], np.float32))
    whole = 2 / (np.pi * max(share, 1 - share))  # of the order of the largest value: a chord of the larger disc
    assert swept_overlap(row, np.array([travel], np.float32))[0] == pytest.approx(expected, abs=0.05 * whole)


def peak_share(drop_x_m, wall_x_m):
    """Closed form: the drop's solid angle over the lamp's, as seen from the wall behind the drop."""
    to_drop, to_lamp = wall_x_m - drop_x_m, wall_x_m - LAMP_M[0]
    return min(1.0, (DROP_RADIUS_M / to_drop) ** 2 / (LAMP_RADIUS_M / to_lamp) ** 2)


@pytest.mark.parametrize("drop_x_m", [0.0, 1.0, 2.0, 2.4])
def test_the_peak_blocked_share_on_the_wall_is_the_ratio_of_solid_angles(drop_x_m):
    wall = np.array([[2.5, 0.0, 0.0]])
    share = blocked_share(wall, LAMP_M, LAMP_RADIUS_M, np.array([drop_x_m, 0.0, 0.0]), DROP_RADIUS_M)
    assert share[0] == pytest.approx(peak_share(drop_x_m, 2.5), rel=0.05)


@pytest.mark.parametrize("drop_x_m", [0.0, 1.0, 2.4])
def test_the_rendered_peak_of_a_short_exposure_is_the_closed_form(drop_x_m):
    fall_s = 0.3
    drop_z_m = 0.0
    leak = Leak(drop_x_m, 0.0, drop_z_m + 9.81 * fall_s**2 / 2, DROP_RADIUS_M, np.array([-fall_s]))
    scene = Scene(Pedestal(texture=UniformTexture(0.3)), (Lamp(tuple(LAMP_M), LAMP_RADIUS_M),), (leak,))
    camera = stereo_rig(lens=Lens(20.0), pose=Pose(yaw_deg=-2.0)).left  # 1.8 mm a pixel: the near shadow is 7 wide
    mask = shadow_mask(scene, camera, Recording(1, 12.0, 1e-4), 0)
    assert mask.max() == pytest.approx(peak_share(drop_x_m, 2.5), rel=0.05)


def test_mid_pedestal_shadows_peak_under_a_tenth_of_near_wall_ones_but_keep_more_in_the_column():
    masks = {}
    for x_m in (0.0, 2.4):
        times = np.arange(-1.2, 0.1, 0.11)
        leak = Leak(x_m, 0.0, 2.0, DROP_RADIUS_M, times)
        scene = Scene(Pedestal(texture=UniformTexture(0.3)), (Lamp(tuple(LAMP_M), LAMP_RADIUS_M),), (leak,))
        masks[x_m] = sum(shadow_mask(scene, stereo_rig().left, Recording(24), frame) for frame in (0, 1))
    instantaneous = peak_share(0.0, 2.5) / peak_share(2.4, 2.5)
    assert instantaneous < 0.1
    column = {x_m: mask.sum(axis=0).max() for x_m, mask in masks.items()}
    # a column's sum is the chord of the drop, or of the lamp's disc in its plane times their areas' ratio
    expected = DROP_RADIUS_M / (LAMP_RADIUS_M * 2.5 / 4.8)
    assert column[0.0] / column[2.4] == pytest.approx(expected, rel=0.25)
    assert column[0.0] / column[2.4] > 3 * instantaneous


def test_the_blocked_light_of_a_drop_is_its_own_area_whatever_the_lamps_size():
    # projected from the lamp onto the wall: the integral of the blocked share is the drop's area times (w / a)^2
    fall_s = 0.25
    leak = Leak(0.5, 0.0, 9.81 * fall_s**2 / 2, 0.01, np.array([-fall_s]))
    totals = []
    for radius_m in (0.01, 0.05, 0.1):
        scene = Scene(Pedestal(texture=UniformTexture(0.3)), (Lamp(tuple(LAMP_M), radius_m),), (leak,))
        totals.append(shadow_mask(scene, stereo_rig().left, Recording(1, 12.0, 1e-4), 0).sum(dtype=float))
    expected = np.pi * (0.01 * (4.8 / 2.8)) ** 2 * (685.511 / 4.9) ** 2
    assert totals == pytest.approx([expected] * 3, rel=0.05)


def test_a_lamp_nearer_than_the_drop_is_not_hidden():
    wall = np.array([[2.5, 0.0, 0.0]])
    assert blocked_share(wall, LAMP_M, LAMP_RADIUS_M, np.array([-2.45, 0.0, 0.0]), 0.01)[0] == 0
    assert blocked_share(wall, LAMP_M, LAMP_RADIUS_M, np.array([2.6, 0.0, 0.0]), 0.01)[0] == 0
