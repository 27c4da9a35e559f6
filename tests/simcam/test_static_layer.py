"""The static layer: cached by content, lit as the textbook says, no light made or lost between the walls."""

import numpy as np
import pytest

from simcam import (
    Box,
    Lamp,
    Leak,
    Lens,
    Pedestal,
    Pose,
    Recording,
    RustTexture,
    Scene,
    UniformTexture,
    render_clip,
    render_view,
    stereo_rig,
)
from simcam.light import open_irradiance
from simcam.raycast import rays_cast
from simcam.static import forget_static_layers, light_scene, static_view
from simcam.surface import hit_pedestal

SMALL = Lens(70.0, 96, 64)
UNIFORM = Pedestal(texture=UniformTexture(0.3))


def leak(released_s):
    return Leak(0.5, 0.0, 1.5, 0.01, np.array([released_s]))


def test_a_second_clip_with_the_same_rig_and_scene_casts_no_ray_at_the_static_scene():
    forget_static_layers()
    pixels = 2 * SMALL.width_px * SMALL.height_px

    def rays_of_a_clip(dripping):
        before = rays_cast()
        scene = Scene(Pedestal(texture=RustTexture(3)), (Lamp(),), dripping)
        render_clip(scene, stereo_rig(lens=SMALL), Recording(2))
        return rays_cast() - before

    assert rays_of_a_clip(()) == pixels
    assert rays_of_a_clip(()) == 0
    moving = rays_of_a_clip((leak(-0.4),))  # the drop's optics look up the scene; the static layer is not cast again
    assert rays_of_a_clip((leak(-0.3),)) == moving


@pytest.mark.parametrize(
    "changed",
    [
        lambda: (Scene(UNIFORM, (Lamp(power_w=26.0),)), stereo_rig(lens=SMALL)),
        lambda: (Scene(Pedestal(texture=UniformTexture(0.31)), (Lamp(),)), stereo_rig(lens=SMALL)),
        lambda: (Scene(UNIFORM, (Lamp(),), (), (Box((1, 0, 0), (0.1, 0.1, 0.1)),)), stereo_rig(lens=SMALL)),
        lambda: (Scene(UNIFORM, (Lamp(),), bounces=0), stereo_rig(lens=SMALL)),
        lambda: (Scene(UNIFORM, (Lamp(),)), stereo_rig(lens=SMALL, pose=Pose(yaw_deg=0.01))),
    ],
)
def test_anything_else_in_scene_or_rig_is_cast_anew(changed):
    forget_static_layers()  # another test may have cast the changed one before
    static_view(Scene(UNIFORM, (Lamp(),)), stereo_rig(lens=SMALL).left)
    before = rays_cast()
    scene, rig = changed()
    static_view(scene, rig.left)
    assert rays_cast() - before >= SMALL.width_px * SMALL.height_px


def test_rays_end_on_the_cylinder_or_its_ends():
    rng = np.random.default_rng(2)
    directions = rng.normal(size=(3, 1000))
    directions /= np.linalg.norm(directions, axis=0)
    surface = hit_pedestal(UNIFORM, np.array([[-2.0], [0.5], [1.0]]), directions)
    radius = np.hypot(surface.points_m[0], surface.points_m[1])
    on_wall = surface.kind == 0
    assert radius[on_wall] == pytest.approx(2.5, abs=1e-5)
    assert np.abs(surface.points_m[2][~on_wall]) == pytest.approx(3.5, abs=1e-5)
    assert (np.sum(surface.normals * directions, axis=0) < 0).all()


def test_irradiance_falls_with_the_square_of_the_distance_and_the_cosine():
    lamp = Lamp((0.0, 0.0, 0.0), 0.1, 4 * np.pi)  # 1 W/sr
    points = np.array([[1.0, 2.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]], np.float32)
    normals = np.array([[-1.0, -1.0, -1.0], [0, 0, 0], [0, 0, 0]], np.float32)
    assert open_irradiance(lamp, points, normals) == pytest.approx([1.0, 0.25, 0.5 / np.sqrt(2)], rel=1e-6)


def test_bounced_light_obeys_the_integrating_sphere_rule():
    # closed cavity, reflectance rho: absorbed = emitted, so the area mean of all irradiance is power / (area (1 - rho))
    power_w, reflectance = 100.0, 0.5
    pedestal = Pedestal(radius_m=1.0, height_m=2.0, texture=UniformTexture(reflectance))
    lit = light_scene(Scene(pedestal, (Lamp((0.0, 0.0, 0.0), 0.05, power_w),), bounces=60))
    rng = np.random.default_rng(3)
    directions = rng.normal(size=(3, 40_000))
    surface = hit_pedestal(pedestal, np.zeros((3, 1)), directions / np.linalg.norm(directions, axis=0))
    # directions uniform from the centre hit an area with density cos / d^2; weight by its inverse for an area mean
    squared = np.sum(surface.points_m**2, axis=0)
    weight = squared**1.5 / -np.sum(surface.normals * surface.points_m, axis=0)
    total = lit.leaving(surface, 1).total
    mean = np.average(total, weights=weight) * np.pi / reflectance
    area = 2 * np.pi * 1.0 * 2.0 + 2 * np.pi
    assert mean == pytest.approx(power_w / (area * (1 - reflectance)), rel=0.03)


def test_without_bounces_there_is_only_direct_light():
    view = static_view(Scene(UNIFORM, (Lamp(),), bounces=0), stereo_rig(lens=SMALL).left)
    np.testing.assert_allclose(view.radiance.ravel(), view.direct.sum(axis=0), rtol=1e-6)


def test_light_adds_up_over_lamps():
    lamps = (Lamp((-2.3, 0.0, 0.4)), Lamp((0.0, 0.0, 2.8), power_w=10.0))
    camera = stereo_rig(lens=SMALL).left
    both = static_view(Scene(UNIFORM, lamps), camera).radiance
    single = [static_view(Scene(UNIFORM, (lamp,)), camera).radiance for lamp in lamps]
    np.testing.assert_allclose(both, single[0] + single[1], rtol=1e-4)


def test_a_lamp_in_view_shows_its_own_radiance():
    lamp = Lamp((1.0, 0.25, 0.0), 0.1, 25.0)
    camera = stereo_rig().left
    view = static_view(Scene(UNIFORM, (lamp,)), camera)
    u, v = np.rint(camera.project(np.array(lamp.position_m))).astype(int)
    assert view.radiance[v, u] == pytest.approx(25.0 / (4 * np.pi**2 * 0.1**2), rel=1e-6)
    assert np.sum(view.radiance == view.radiance[v, u]) == pytest.approx(np.pi * (0.1 * 685.511 / 3.4) ** 2, rel=0.03)


def test_rust_is_the_same_for_the_same_seed_seamless_and_a_reflectance():
    wall = RustTexture(5).maps().wall
    np.testing.assert_array_equal(wall, RustTexture(5).maps().wall)
    assert not np.array_equal(wall, RustTexture(6).maps().wall)
    assert wall.min() >= 0.12 - 1e-6
    assert wall.max() <= 0.45 + 1e-6
    inner = np.abs(np.diff(wall, axis=1)).max()
    assert np.abs(wall[:, 0] - wall[:, -1]).max() <= inner


def test_photo_electrons_are_proportional_to_exposure_and_power():
    camera = stereo_rig(lens=SMALL).left
    reference = render_view(Scene(UNIFORM, (Lamp(),)), camera, Recording(1, 12.0, 0.02))
    longer = render_view(Scene(UNIFORM, (Lamp(),)), camera, Recording(1, 12.0, 0.04))
    brighter = render_view(Scene(UNIFORM, (Lamp(power_w=75.0),)), camera, Recording(1, 12.0, 0.02))
    assert reference.dtype == np.float32
    np.testing.assert_allclose(longer, 2 * reference, rtol=1e-5)
    np.testing.assert_allclose(brighter, 3 * reference, rtol=1e-4)


def test_the_same_scene_renders_the_same_bytes():
    scene = Scene(Pedestal(texture=RustTexture(1)), (Lamp(),), (leak(-0.4), leak(-0.3)))
    first = render_clip(scene, stereo_rig(lens=SMALL), Recording(3))
    forget_static_layers()
    second = render_clip(scene, stereo_rig(lens=SMALL), Recording(3))
    np.testing.assert_array_equal(first.left, second.left)
    np.testing.assert_array_equal(first.right, second.right)
