"""The bright patch of wall behind a lamp: drops shade its light, and no picture without drops changes by it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from simcam import Box, ImageTexture, Lamp, Leak, Lens, Pedestal, Recording, Scene, UniformTexture, stereo_rig
from simcam.exposure import Exposures
from simcam.foot import foot_irradiance, lamp_feet
from simcam.light import open_irradiance
from simcam.shadows import expose_shadows, shadow_table, shadow_tables
from simcam.static import forget_static_layers, light_scene, static_view
from simcam.surface import MapReader, Surface

LENS = Lens(70.0, 240, 136)
BRIGHT = Pedestal(texture=UniformTexture(0.6))
LAMP = Lamp((-2.3, 0.0, 0.4))
RECORDING = Recording(1, 12.0, 0.02)


def feet_of(pedestal, *lamps):
    return lamp_feet(pedestal, lamps, MapReader(pedestal, pedestal.texture.maps()))


def facing(point_m, normal):
    columns = [np.array(values, np.float32)[:, None] for values in (point_m, normal)]
    return columns[0], columns[1]


@given(distance_m=st.floats(0.12, 0.45), reflectance=st.floats(0.1, 0.9), power_w=st.floats(1, 200))
def test_a_foot_reflects_the_light_that_lands_within_two_lamp_distances(distance_m, reflectance, power_w):
    pedestal, lamp = Pedestal(texture=UniformTexture(reflectance)), Lamp((distance_m - 2.5, 0, 0), 0.1, power_w)
    (foot,) = feet_of(pedestal, lamp)

    def ring(s, power):  # Lambert's law on the tangent plane, times s^power
        return 2 * np.pi * s ** (1 + power) * lamp.intensity_w_sr * distance_m / (s * s + distance_m**2) ** 1.5

    light, second = (quad(ring, 0, 2 * distance_m, args=(power,))[0] for power in (0, 2))
    assert foot.flux_w == pytest.approx(reflectance * light, rel=1e-4)
    assert foot.radius_m**2 / 2 == pytest.approx(second / light, rel=1e-6)
    assert foot.position_m == pytest.approx((-2.5, 0, 0))


def test_straight_ahead_a_foot_gives_1_1_times_its_reflectance_of_the_lamps_light():
    (foot,) = feet_of(BRIGHT, LAMP)
    there = facing((2.5, 0.0, 0.4), (-1.0, 0.0, 0.0))
    share = foot_irradiance(foot, *there)[0] * 5.0**2 / (open_irradiance(LAMP, *there)[0] * 4.8**2)
    assert share == pytest.approx(1.106 * 0.6, rel=0.01)


@pytest.mark.parametrize(
    ("position_m", "normals"),
    [
        ((-2.3, 0.0, 0.0), [(1, 0, 0)]),
        ((0.0, 0.0, 3.2), [(0, 0, -1)]),
        ((0.0, 0.0, -3.2), [(0, 0, 1)]),
        ((0.0, 2.2, 3.2), [(0, -1, 0), (0, 0, -1)]),
        ((0.0, 0.0, 0.0), []),
        ((-1.9, 0.0, 0.0), []),
    ],
)
def test_a_lamp_has_a_foot_on_every_surface_that_it_is_near(position_m, normals):
    assert [foot.normal for foot in feet_of(BRIGHT, Lamp(position_m))] == [pytest.approx(one) for one in normals]


def test_a_black_wall_or_a_dark_lamp_has_no_foot():
    assert feet_of(Pedestal(texture=UniformTexture(0.005)), LAMP) == ()
    assert feet_of(BRIGHT, replace(LAMP, power_w=0.0)) == ()


def test_a_foot_takes_the_reflectance_of_the_wall_behind_the_lamp():
    wall = np.full((64, 128), 0.2)
    wall[:, np.abs(np.arange(128) - 63.5) > 48] = 0.5  # the quarter about azimuth 180 degrees
    (foot,) = feet_of(Pedestal(texture=ImageTexture(wall)), LAMP)
    (grey,) = feet_of(Pedestal(texture=UniformTexture(0.5)), LAMP)
    assert foot.flux_w == pytest.approx(grey.flux_w, rel=1e-6)


def test_a_drop_takes_its_disc_of_a_foots_light_from_the_far_wall():
    # the wall loses, over all its points, the light that the drop's disc receives: E(drop) pi r^2
    leak, camera = Leak(1.0, 0.0, 0.6, 0.01, np.array([0.0])), stereo_rig(lens=Lens(70.0, 480, 272)).left
    scene = Scene(BRIGHT, (LAMP,), (leak,), bounces=1)
    lit, view = light_scene(scene), static_view(scene, camera)
    foot = lit.feet[0]
    table = shadow_table(lit, replace(view, by_source=np.ones_like(view.by_source)), leak, 1)
    share = np.zeros(view.radiance.size, np.float32)
    fall_s = 0.2
    step_s = 0.001
    opens = np.full(272, fall_s - step_s)
    expose_shadows(share, table, Exposures(opens[None], opens[None] + 2 * step_s, np.zeros(1, int)))
    share = -share.reshape(view.radiance.shape) / (2 * step_s)
    drop_m = np.array([1.0, 0.0, 0.6 - 9.81 * fall_s**2 / 2])
    # a wall point at place t along the line from it to the foot sees a blocked share that sums to pi (r / t_drop)^2
    points_m = view.points_m.reshape(3, *view.radiance.shape)
    across = np.linalg.norm(np.gradient(points_m, axis=2), axis=0)
    down = np.linalg.norm(np.gradient(points_m, axis=1), axis=0)
    towards = np.array(foot.position_m) - drop_m
    distance_m = np.linalg.norm(towards)
    normal = np.stack([-points_m[0], -points_m[1], np.zeros_like(points_m[0])]) / 2.5
    to_foot = np.array(foot.position_m)[:, None, None] - points_m
    cosine = np.einsum("kij,kij->ij", normal, to_foot) / np.linalg.norm(to_foot, axis=0)
    solid_angle = (share * across * down * cosine / np.sum(to_foot**2, axis=0)).sum()
    assert solid_angle == pytest.approx(np.pi * leak.drop_radius_m**2 / distance_m**2, rel=0.03)


def test_with_one_bounce_the_far_wall_has_the_closed_form_of_the_foots_light():
    scene, camera = Scene(BRIGHT, (LAMP,), bounces=1), stereo_rig(lens=LENS).left
    lit, view = light_scene(scene), static_view(scene, camera)
    row = np.argmin(np.hypot(*(view.points_m - np.array([[2.5], [0.0], [0.4]]))[1:]))
    x, y, z = view.points_m[:, row].astype(float)
    to_point = np.array([x + 2.5, y, z - 0.4])
    squared = to_point @ to_point
    cosines = to_point[0] * (to_point @ [x, y, 0]) / 2.5 / squared
    flux_w = 0.6 * LAMP.power_w / 2 * (1 - 1 / np.sqrt(5))
    expected = 0.6 / np.pi * flux_w / np.pi * cosines / (squared + 2 * 0.2**2 * (np.sqrt(5) - 1))
    assert view.by_source[1, row] == pytest.approx(expected, rel=1e-3)
    assert lit.sources == (LAMP, *lit.feet)


def test_without_bounces_there_is_no_foot_to_shade():
    leak = Leak(1.0, 0.0, 0.6, 0.01, np.array([-0.2]))
    for bounces, tables in ((0, 1), (1, 2)):
        scene = Scene(BRIGHT, (LAMP,), (leak,), bounces=bounces)
        view = static_view(scene, stereo_rig(lens=LENS).left)
        assert len(shadow_tables(light_scene(scene), view, leak)) == tables


def test_the_static_layer_does_not_know_of_feet(monkeypatch):
    box = Box((1.0, 0.3, 0.0), (0.3, 0.3, 0.3))
    scene, camera = Scene(BRIGHT, (LAMP,), (), (box,)), stereo_rig(lens=LENS).left
    with_feet = static_view(scene, camera)
    forget_static_layers()
    monkeypatch.setattr("simcam.static.lamp_feet", lambda *_: ())
    without = static_view(scene, camera)
    forget_static_layers()
    assert len(with_feet.by_source) == len(without.by_source) + 1
    np.testing.assert_array_equal(with_feet.radiance, without.radiance)
    np.testing.assert_array_equal(with_feet.direct, without.direct)


def test_structure_hides_a_foot():
    beam = Box((0.0, 0.0, 0.4), (0.1, 3.0, 1.5))
    camera = stereo_rig(lens=LENS, baseline_m=0.1).left
    scene = Scene(BRIGHT, (LAMP,), (), (beam,))
    lit = light_scene(scene)
    for point_m, hidden in (((2.5, 0.0, 0.4), True), ((2.5, 0.0, 3.2), False)):
        point, normal = facing(point_m, (-1.0, 0.0, 0.0))
        surface = Surface(point, normal, np.ones(1, np.float32), np.zeros(1, np.int8))
        assert (lit.leaving(surface, 1).feet[0, 0] == 0) == hidden
    assert static_view(scene, camera).by_source.shape[0] == 2


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000), bounces=st.integers(1, 3))
def test_feet_never_give_more_than_the_bounced_light(seed, bounces):
    rng = np.random.default_rng(seed)
    azimuth = rng.uniform(-np.pi, np.pi)
    near_the_rim = Lamp((2.3 * np.cos(azimuth), 2.3 * np.sin(azimuth), rng.uniform(3.1, 3.35)))
    lit = light_scene(Scene(Pedestal(texture=UniformTexture(rng.uniform(0.1, 0.9))), (near_the_rim,), bounces=bounces))
    directions = rng.normal(size=(3, 2000)).astype(np.float32)
    directions /= np.linalg.norm(directions, axis=0)
    surface = lit.look(np.zeros((3, 1), np.float32), directions)
    leaving = lit.leaving(surface, 1)
    assert len(leaving.feet) == 2
    assert (leaving.feet >= 0).all()
    assert (leaving.feet.sum(axis=0) <= leaving.bounced * (1 + 1e-5)).all()
