"""Masks and truth beside closed-form projection, for random rigs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simcam import (
    Box,
    Lamp,
    Leak,
    Lens,
    Pedestal,
    Pose,
    Recording,
    Scene,
    UniformTexture,
    drop_centres,
    drop_mask,
    ground_truth,
    shadow_mask,
    static_depth,
    stereo_rig,
)
from simcam.exposure import drop_exposures
from simcam.path import drop_path, landing_m
from simcam.penumbra import blocked_share
from simcam.static import light_scene, static_view

PEDESTAL = Pedestal(texture=UniformTexture(0.3))
LAMP = Lamp((-2.25, 0.1, 0.4), 0.08)
SMALL_LAMP = Lamp(LAMP.position_m, 0.02)
HEIGHTS_M = np.linspace(3, -3, 6001)


def line_columns(camera, x_m, y_m, rows):
    """Columns where the image of the vertical line through (x, y) crosses rows."""
    line = camera.project(np.stack([np.full_like(HEIGHTS_M, x_m), np.full_like(HEIGHTS_M, y_m), HEIGHTS_M], axis=-1))
    return np.interp(rows, line[:, 1], line[:, 0])


def wall_behind(lamp, leak):
    """Where the vertical plane through lamp and leak meets the wall beyond the leak."""
    start, ahead = np.array(lamp.position_m[:2]), np.array([leak.x_m, leak.y_m]) - lamp.position_m[:2]
    ahead = ahead / np.linalg.norm(ahead)
    along = -start @ ahead + np.sqrt((start @ ahead) ** 2 - start @ start + PEDESTAL.radius_m**2)
    return start + along * ahead


def column_error(mask, camera, place):
    """Mean over the mask's inner rows of its centroid column minus the line's."""
    weight = mask.sum(axis=1)
    rows = np.flatnonzero(weight > 0.5 * weight.max())
    centroids = (mask[rows] * np.arange(camera.width_px)).sum(axis=1) / weight[rows]
    return np.mean(centroids - line_columns(camera, *place, rows))


@settings(max_examples=10)
@given(
    tilt=st.tuples(*[st.floats(-5, 5)] * 3),
    brown=st.tuples(st.floats(-0.15, 0.15), st.floats(-0.003, 0.003)),
    place=st.tuples(st.floats(-0.2, 1.8), st.floats(-0.5, 0.5)),
    radius_m=st.floats(0.003, 0.01),
)
def test_columns_of_drop_and_shadow_masks_are_the_projected_lines(tilt, brown, place, radius_m):
    lens = Lens(distortion=(brown[0], 0.02, brown[1], -brown[1], 0.0))
    camera = stereo_rig(pose=Pose(*tilt), lens=lens).left
    # a small lamp: the middle of a penumbra a fifth of a metre wide lies up to 0.08 px beside the line on a curved wall
    leak = Leak(*place, 2.0, radius_m, np.array([-0.63]))
    scene, recording = Scene(PEDESTAL, (SMALL_LAMP,), (leak,)), Recording(1, 12.0, 0.04)
    drops, shadows = drop_mask(scene, camera, recording, 0), shadow_mask(scene, camera, recording, 0)
    if drops.any():
        assert column_error(drops, camera, place) == pytest.approx(0, abs=0.05)
    behind = wall_behind(LAMP, leak)
    inside = 60 < line_columns(camera, *behind, np.array([0, 270, 539])).min() < camera.width_px - 60
    if shadows.any() and inside:
        assert column_error(shadows, camera, behind) == pytest.approx(0, abs=0.05)


@settings(max_examples=10)
@given(
    tilt=st.tuples(*[st.floats(-5, 5)] * 3),
    place=st.tuples(st.floats(-0.2, 1.8), st.floats(-0.5, 0.5)),
    radius_m=st.floats(0.003, 0.01),
)
def test_a_wide_penumbra_lies_where_the_closed_form_of_every_moment_puts_it(tilt, place, radius_m):
    camera = stereo_rig(pose=Pose(*tilt)).left
    leak = Leak(*place, 2.0, radius_m, np.array([-0.63]))
    scene = Scene(PEDESTAL, (LAMP,), (leak,))
    mask = shadow_mask(scene, camera, Recording(1, 12.0, 0.04), 0)
    row = int(np.argmax(mask.sum(axis=1)))
    points_m = static_view(scene, camera).points_m.reshape(3, *mask.shape)[:, row].T.astype(float)
    falls_m = 9.81 / 2 * (0.61 + (np.arange(200) + 0.5) / 200 * 0.04) ** 2
    drops_m = leak.position_m - falls_m[:, None, None] * np.array([0.0, 0.0, 1.0])
    shares = blocked_share(points_m, np.array(LAMP.position_m), LAMP.radius_m, drops_m, radius_m).mean(axis=0)
    columns = np.arange(camera.width_px)
    if mask.any() and shares[:40].sum() + shares[-40:].sum() == 0:
        assert mask[row].sum() == pytest.approx(shares.sum(), rel=0.02)
        centroids = [(weight * columns).sum() / weight.sum() for weight in (mask[row], shares)]
        assert centroids[0] == pytest.approx(centroids[1], abs=0.05)


def test_the_paper_rigs_truth_has_the_conventions_columns():
    leak = Leak(0.0, 0.0, 2.0, 0.006, np.array([0.0]))
    (truth,) = ground_truth(Scene(PEDESTAL, (LAMP,), (leak,)), stereo_rig(), Recording()).leaks
    assert (truth.left.column_px, truth.right.column_px) == pytest.approx((550.91, 408.09), abs=0.005)
    assert truth.in_view
    assert truth.visible_fraction == 1
    assert truth.left.drop_width_px == pytest.approx(2 * 0.006 * 685.511 / 2.4, rel=0.02)
    behind = wall_behind(LAMP, leak)
    expected = line_columns(stereo_rig().left, *behind, np.array([269.5]))[0]
    assert truth.left.shadow_columns_px[0] == pytest.approx(expected, abs=1e-2)


def test_a_leak_at_the_side_is_out_of_view_of_one_camera():
    leak = Leak(0.0, -1.6, 2.0, 0.006, np.array([0.0]))
    (truth,) = ground_truth(Scene(PEDESTAL, (LAMP,), (leak,)), stereo_rig(), Recording()).leaks
    assert truth.right.in_view
    assert not truth.left.in_view
    assert not truth.in_view
    assert truth.visible_fraction == 0


def test_a_beam_takes_its_rows_from_the_visible_fraction_and_is_named():
    # a beam 0.3 m tall half way to the leak: 0.3 x f / 1.2 rows of 540
    beam = Box((-1.2, 0.125, 0.0), (0.01, 0.6, 0.3))
    leak = Leak(0.0, 0.0, 2.0, 0.006, np.array([0.0]))
    scene = Scene(PEDESTAL, (LAMP,), (leak,), (Box((2.0, -2.0, 0.0), (0.1, 0.1, 0.1)), beam))
    (truth,) = ground_truth(scene, stereo_rig(), Recording()).leaks
    assert truth.left.occluded_by == (1,)
    assert truth.left.visible_fraction == pytest.approx(1 - 0.3 * 685.511 / 1.2 / 540, abs=0.01)


def test_a_beam_below_the_leak_ends_the_fall():
    beam = Box((0.0, 0.0, 0.25), (0.5, 0.5, 0.1))
    leak = Leak(0.0, 0.0, 2.0, 0.006, np.array([0.0]))
    (truth,) = ground_truth(Scene(PEDESTAL, (LAMP,), (leak,), (beam,)), stereo_rig(), Recording()).leaks
    # seen down to the beam's far edge at most: drops end at z = 0.3
    assert truth.left.last_row_px <= 269.5 - 0.3 * 685.511 / 2.4 + 1
    assert truth.left.column_px == pytest.approx(550.91, abs=0.005)  # the line goes on


def test_drop_masks_are_shares_and_black_where_nothing_falls():
    leak = Leak(0.5, 0.2, 1.5, 0.008, np.array([-0.5, 5.0]))
    mask = drop_mask(Scene(PEDESTAL, (LAMP,), (leak,)), stereo_rig().left, Recording(), 0)
    assert mask.dtype == np.float32
    assert 0 < mask.max() <= 1
    assert np.count_nonzero(mask.sum(axis=0)) < 12


def test_drop_centres_are_projected_falls():
    leak = Leak(0.0, 0.0, 1.0, 0.006, np.array([-0.4, -9.0, 9.0]))
    centres = drop_centres(Scene(PEDESTAL, (LAMP,), (leak,)), stereo_rig().left, Recording(), 0)
    z_m = 1.0 - 9.81 * 0.4**2 / 2
    assert centres[0, 0] == pytest.approx((550.907, 269.5 - z_m * 685.511 / 2.4), abs=1e-3)
    assert np.isnan(centres[0, 1:]).all()


def test_static_depth_is_the_walls():
    depth = static_depth(Scene(PEDESTAL, (LAMP,)), stereo_rig().left)
    assert depth[269, 479] == pytest.approx(np.sqrt(2.5**2 - 0.25**2) + 2.4, abs=1e-3)


def test_strong_barrel_distortion_and_a_wide_view_show_a_leak_once():
    lens = Lens(90.0, distortion=(-0.08, 0.0, 0.0, 0.0, 0.0))
    camera = stereo_rig(lens=lens).left
    leak = Leak(0.5, 0.2, 2.5, 0.008, np.arange(-1.2, 0.0, 0.1))
    mask = drop_mask(Scene(PEDESTAL, (LAMP,), (leak,)), camera, Recording(), 0)
    columns = np.flatnonzero(mask.sum(axis=0))
    line = camera.project(np.stack([np.full(200, 0.5), np.full(200, 0.2), np.linspace(2.4, -2, 200)], axis=-1))
    shown = line[(line[:, 1] > 0) & (line[:, 1] < 539), 0]
    assert columns.min() == pytest.approx(shown.min(), abs=4)
    assert columns.max() == pytest.approx(shown.max(), abs=4)


TINY = Lens(70.0, 96, 54)
LOW = Leak(0.0, 0.3, 2.0, 0.006, np.array([0.0]))


def truth_of(lamp, leak, structures=(), lens=TINY, pedestal=PEDESTAL):
    (truth,) = ground_truth(Scene(pedestal, (lamp,), (leak,), structures), stereo_rig(lens=lens), Recording()).leaks
    return truth


def test_a_shadow_is_stated_where_there_is_one():
    truth = truth_of(LAMP, LOW)
    for side in ("left", "right"):
        assert np.isfinite(getattr(truth, side).shadow_columns_px[0])


@pytest.mark.parametrize(
    ("leak", "structures"),
    [
        (Leak(0.0, 0.3, -0.5, 0.006, np.array([0.0])), ()),  # it begins below the lamp's rays to the middle row
        (LOW, (Box((0.0, 0.3, 1.0), (0.1, 0.1, 0.02)),)),  # drops land on a ledge
        (LOW, (Box((-2.05, 0.0, 0.4), (0.05, 0.8, 0.8)),)),  # the lamp is hidden
    ],
    ids=["a low leak", "a ledge", "a hidden lamp"],
)
def test_no_shadow_is_stated_where_none_can_fall(leak, structures):
    truth = truth_of(LAMP, leak, structures)
    assert np.isnan([getattr(truth, side).shadow_columns_px[0] for side in ("left", "right")]).all()


def test_a_drop_behind_a_lamps_body_is_hidden_in_the_truth_as_it_is_in_the_picture():
    lamp, leak = Lamp((0.0, 0.0, 0.0), 0.9), Leak(1.5, 0.0, 2.0, 0.006, np.array([-0.5, -0.3]))
    truth = truth_of(lamp, leak)
    assert truth.visible_fraction < 0.2
    assert truth.left.occluded_by == ()
    assert truth_of(Lamp((0.0, 2.0, 0.0), 0.3), leak).visible_fraction == 1.0


@pytest.mark.parametrize(("lens", "height_m"), [(Lens(10.0, 960, 54), 100.0), (Lens(70.0, 96, 16), 100.0)])
def test_a_drop_that_passes_a_low_image_in_an_instant_is_drawn(lens, height_m):
    pedestal = Pedestal(height_m=height_m, texture=UniformTexture(0.3))
    leak = Leak(1.9, 0.0, 0.45 * height_m, 0.006, np.array([0.0]))
    camera = stereo_rig(lens=lens).left
    assert truth_of(LAMP, leak, lens=lens, pedestal=pedestal).left.visible_fraction == 1.0
    lit = light_scene(Scene(pedestal, (LAMP,), (leak,)))
    path = drop_path(camera, leak, landing_m(lit, leak))
    assert path is not None
    assert path.centre_px[0, 1] < 0
    assert path.centre_px[-1, 1] > camera.height_px - 1


@given(
    frames=st.lists(st.integers(0, 40), min_size=1, max_size=6, unique=True).map(sorted),
    released_s=st.lists(st.floats(-2.0, 4.0), max_size=8),
    falling_s=st.floats(0.01, 1.2),
    exposure_s=st.floats(0.001, 0.08),
    readout_s=st.floats(0.0, 0.05),
)
def test_exposures_are_those_of_all_drops_in_all_frames_less_the_empty_ones(
    frames, released_s, falling_s, exposure_s, readout_s
):
    recording = Recording(41, 12.0, exposure_s, readout_s=readout_s)
    found = drop_exposures(recording, frames, np.array(released_s), falling_s, (9, 5))
    expected = []
    for place, frame in enumerate(frames):
        for time_s in released_s:
            opens, closes = (
                np.clip(edge + recording.row_delays_s(9) - time_s, 0, falling_s)
                for edge in (recording.opens_s(frame), recording.closes_s(frame))
            )
            if (closes > opens).any():
                expected.append((place * 45, *opens, *closes))
    rows = np.column_stack([found.first_pixel, found.opens_s, found.closes_s])
    assert rows.reshape(-1, 19) == pytest.approx(np.array(expected).reshape(-1, 19), abs=1e-12)
