"""Energy of streaks: what a drop adds does not depend on where it falls between pixels."""

from dataclasses import replace

import numpy as np
import pytest

from simcam import (
    Camera,
    Lamp,
    Leak,
    Lens,
    Pedestal,
    Pose,
    Recording,
    Scene,
    UniformTexture,
    drop_mask,
    render_view,
    shadow_mask,
    stereo_rig,
)
from simcam.exposure import Exposures
from simcam.static import light_scene, static_view
from simcam.streaks import expose_drops, streak_table

PEDESTAL = Pedestal(texture=UniformTexture(0.3))
LENS = Lens(70.0, 240, 160)
FALL_S = 0.3


def shifted(camera, columns_px, rows_px):
    """The same camera with its pixels moved by a fraction of a pixel."""
    matrix = camera.camera_matrix.copy()
    matrix[:2, 2] += columns_px, rows_px
    return Camera(camera.width_px, camera.height_px, matrix, camera.distortion, camera.world_from_camera)


def streak_light(camera, leak, exposure_s):
    scene, recording = Scene(PEDESTAL, (Lamp(),), (leak,)), Recording(1, 12.0, exposure_s)
    still = static_view(scene, camera).radiance * recording.responsivity * exposure_s
    # shadows are left out by looking at the drop's own columns
    covered = drop_mask(scene, camera, recording, 0) > 0
    return float((render_view(scene, camera, recording)[0] - still)[covered].sum())


@pytest.mark.parametrize("width_px", [1.5, 4.0])
def test_a_streaks_light_does_not_depend_on_its_place_between_pixels(width_px):
    leak = Leak(0.0, 0.0, 0.3, width_px / 2 * 2.4 / LENS.focal_px, np.array([-FALL_S]))
    scene, light = Scene(PEDESTAL, (Lamp(),), (leak,)), []
    for columns_px in np.linspace(0, 1, 6):
        for rows_px in (0.0, 0.37):
            camera = shifted(stereo_rig(lens=LENS).left, columns_px, rows_px)
            table = streak_table(light_scene(scene), static_view(scene, camera), camera, leak)
            image = np.zeros(LENS.height_px * LENS.width_px, np.float32)
            opens = np.full((1, LENS.height_px), FALL_S - 0.01)
            expose_drops(image, table, Exposures(opens, opens + 0.02, np.zeros(1, int)))
            light.append(image.sum(dtype=float))
    assert np.ptp(light) < 0.02 * abs(np.mean(light))


def test_a_shadows_light_does_not_depend_on_its_place_between_pixels():
    leak = Leak(0.0, 0.0, 0.6, 0.01, np.array([-FALL_S]))
    scene, recording = Scene(PEDESTAL, (Lamp(),), (leak,)), Recording(1, 12.0, 0.02)
    light = [
        shadow_mask(scene, shifted(stereo_rig(lens=LENS).left, columns_px, 0.3), recording, 0).sum(dtype=float)
        for columns_px in np.linspace(0, 1, 6)
    ]
    assert np.ptp(light) < 0.02 * np.mean(light)


@pytest.mark.parametrize("columns_px", [0.0, 0.25, 0.5])
def test_a_drop_of_1_5_px_covers_its_own_area(columns_px):
    leak = Leak(0.0, 0.0, 0.3, 0.006, np.array([-FALL_S]))
    camera = shifted(stereo_rig(lens=LENS, baseline_m=0.1).left, columns_px, 0.0)
    area_px = np.pi * (0.006 * LENS.focal_px / 2.4) ** 2
    mask = drop_mask(Scene(PEDESTAL, (Lamp(),), (leak,)), camera, Recording(1, 12.0, 0.02), 0)
    assert mask.sum() == pytest.approx(area_px, rel=0.02)


def test_without_drop_shadows_a_drop_changes_only_what_it_covers():
    leak, camera, recording = Leak(0.0, 0.0, 0.3, 0.02, np.array([-FALL_S])), stereo_rig(lens=LENS).left, Recording(1)
    scene = Scene(PEDESTAL, (Lamp(),), (leak,))
    unshaded, covered = replace(scene, drop_shadows=False), drop_mask(scene, camera, recording, 0) > 0
    still, shaded, plain = (
        render_view(one, camera, recording)[0] for one in (replace(scene, leaks=()), scene, unshaded)
    )
    np.testing.assert_array_equal(plain[~covered], still[~covered])
    assert (shaded[~covered] < still[~covered]).any()
    assert np.abs(plain - still)[covered].max() > 0
    assert (shadow_mask(unshaded, camera, recording, 0) == 0).all()


def test_halving_the_exposure_halves_the_streak():
    leak = Leak(0.0, 0.0, 0.3, 0.01, np.array([-FALL_S]))
    camera = stereo_rig(lens=LENS).left
    whole, half = (streak_light(camera, leak, exposure_s) for exposure_s in (0.02, 0.01))
    assert half == pytest.approx(whole / 2, rel=0.02)


@pytest.mark.parametrize("tilt_deg", [0.0, 4.0])
def test_a_streak_is_as_long_as_the_fall_during_the_exposure(tilt_deg):
    leak = Leak(0.0, 0.0, 0.8, 0.004, np.array([-0.35]))
    rig, recording = stereo_rig(pose=Pose(roll_deg=tilt_deg)), Recording(1, 12.0, 0.02)
    mask = drop_mask(Scene(PEDESTAL, (Lamp(),), (leak,)), rig.left, recording, 0)
    rows = np.flatnonzero(mask.max(axis=1) > 1e-3)
    heights = 0.8 - 9.81 * np.array([0.34, 0.36]) ** 2 / 2
    (_, top), (_, bottom) = rig.left.project([[0, 0, heights[0]], [0, 0, heights[1]]])
    radius_px = 0.004 * 685.5 / 2.4
    assert rows[0] == pytest.approx(top - radius_px, abs=1)
    assert rows[-1] == pytest.approx(bottom + radius_px, abs=1)


def test_a_rolling_shutter_lengthens_a_streak_by_the_rows_delay():
    # the drop falls with the readout: the streak grows by 1 / (1 - speed of the drop / speed of the readout)
    leak = Leak(0.0, 0.0, 0.8, 0.004, np.array([-0.35]))
    camera, readout_s = stereo_rig().left, 0.02
    lengths = []
    for delay in (0.0, readout_s):
        mask = drop_mask(Scene(PEDESTAL, (Lamp(),), (leak,)), camera, Recording(1, 12.0, 0.02, delay), 0)
        lengths.append(np.ptp(np.flatnonzero(mask.max(axis=1) > 1e-3)))
    speed = 9.81 * 0.35 * 685.5 / 2.4  # rows per second
    radius_px = 0.004 * 685.5 / 2.4
    still, moving = (length - 2 * radius_px for length in lengths)
    assert moving / still == pytest.approx(1 / (1 - speed * readout_s / 540), rel=0.05)


def test_a_point_spread_keeps_the_streaks_light():
    leak = Leak(0.0, 0.0, 0.3, 0.01, np.array([-FALL_S]))
    camera, scene = stereo_rig(lens=LENS).left, Scene(PEDESTAL, (Lamp(),), (leak,))
    changes = []
    for sigma_px in (0.0, 1.5):
        recording = Recording(1, 12.0, 0.02, psf_sigma_px=sigma_px)
        still = render_view(Scene(PEDESTAL, (Lamp(),)), camera, recording)[0]
        changes.append(render_view(scene, camera, recording)[0].astype(float) - still)
    assert changes[1].sum() == pytest.approx(changes[0].sum(), rel=0.01)
    assert changes[1].max() < 0.5 * changes[0].max()


@pytest.mark.parametrize("sigma_px", [0.5, 0.8])
def test_behind_a_lens_a_streak_stands_where_its_drop_is_at_any_place_within_a_pixel(sigma_px):
    # a black pedestal leaves the glints alone, a tenth of a pixel wide: without a lens they would stand on whole pixels
    camera, recording = stereo_rig(lens=LENS).left, Recording(1, 12.0, 0.02, psf_sigma_px=sigma_px)
    offsets_px = []
    for step in range(8):
        leak = Leak(0.0, 0.0017 * step, 0.3, 0.002, np.array([-FALL_S]))
        scene = Scene(Pedestal(texture=UniformTexture(0.001)), (Lamp((-2.3, 0.0, 0.4), 0.02),), (leak,))
        still = render_view(replace(scene, leaks=()), camera, recording)[0]
        profile = (render_view(scene, camera, recording)[0].astype(float) - still).sum(axis=0)
        column = np.sum(np.arange(profile.size) * profile) / profile.sum()
        offsets_px.append(column - camera.project(np.array([0.0, leak.y_m, 0.0]))[0])
    assert np.ptp(offsets_px) < 0.13  # cells of an eighth of a pixel; a third of a pixel and more without the lens


def test_a_drop_is_seen_only_between_its_release_and_its_landing():
    camera, recording = stereo_rig(lens=LENS).left, Recording(1, 12.0, 0.02)
    low = Pedestal(height_m=1.0, texture=UniformTexture(0.3))  # the floor at -0.5 m: 0.32 s below the leak

    def changed(released_s):
        leak = Leak(1.0, 0.0, 0.0, 0.01, np.array([released_s]))
        return render_view(Scene(low, (Lamp((-2.3, 0, 0.3)),), (leak,)), camera, recording)[0]

    still = changed(-10.0)
    np.testing.assert_array_equal(changed(0.011), still)
    np.testing.assert_array_equal(changed(-0.34), still)
    assert np.abs(changed(-0.2) - still).max() > 0
    assert np.abs(changed(-0.30) - still).max() > 0


@pytest.mark.parametrize("columns_px", [0.0, 0.3, 0.5, 0.8])
def test_a_shadow_smaller_than_a_pixel_is_not_lost_between_the_pixels_centres(columns_px):
    # 0.1 m before the wall, where a pixel of this camera is 44 mm wide and the shadow 20 mm
    leak = Leak(2.4, 0.0, 0.5, 0.01, np.array([-0.25]))
    camera = shifted(stereo_rig(lens=Lens(70.0, 156, 88)).left, columns_px, 0.0)
    mask = shadow_mask(Scene(PEDESTAL, (Lamp((-2.3, 0.0, 0.2)),), (leak,)), camera, Recording(1, 12.0, 0.02), 0)
    expected = np.pi * (0.01 * 4.8 / 4.7 * camera.camera_matrix[0, 0] / 4.9) ** 2
    assert mask.sum(dtype=float) == pytest.approx(expected, rel=0.1)
