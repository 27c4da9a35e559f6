"""Structure: its sizes, what it hides and shades, and the clear refusal of bad meshes; the ray caster's checks."""

import numpy as np
import pytest
import trimesh

from simcam import (
    Box,
    Grating,
    ImageTexture,
    Lamp,
    Leak,
    Mesh,
    Pedestal,
    Pipe,
    Recording,
    RustTexture,
    Scene,
    UniformTexture,
    drop_mask,
    mesh_file,
    render_view,
    responsivity,
    shadow_mask,
    stereo_rig,
)
from simcam.raycast import RayCaster
from simcam.static import static_view

UNIFORM = Pedestal(texture=UniformTexture(0.3))
TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
FACE = np.array([[0, 1, 2]])


def volume(structure):
    vertices, faces = structure.triangles()
    return trimesh.Trimesh(vertices, faces, process=False).volume


def test_solids_have_their_volume_and_outward_faces():
    assert volume(Box((1, 2, 3), (0.1, 0.2, 0.3), yaw_deg=30)) == pytest.approx(0.006)
    assert volume(Pipe((0, 0, 0), (0, 1, 1), 0.1)) == pytest.approx(np.pi * 0.01 * np.sqrt(2))


def test_a_grating_has_a_bar_every_pitch():
    vertices, faces = Grating((0, 0, 0.5), (1.0, 0.6), 0.1, 0.01).triangles()
    assert len(faces) == 12 * (11 + 7)
    assert vertices[:, 2].mean() == pytest.approx(0.5)


def test_a_box_is_seen_where_it_is_and_hides_the_wall():
    camera = stereo_rig().left
    box = Box((1.0, 0.0, 0.0), (0.2, 0.4, 0.4))
    view, bare = (static_view(Scene(UNIFORM, (Lamp(),), (), structures), camera) for structures in ((box,), ()))
    on_box = view.range_m < bare.range_m - 0.01
    rows, columns = np.nonzero(on_box)
    left, top = camera.project([0.9, 0.2, 0.2])
    right, bottom = camera.project([0.9, -0.2, -0.2])
    assert (columns.min(), rows.min()) == pytest.approx((left, top), abs=1)
    assert (columns.max(), rows.max()) == pytest.approx((right, bottom), abs=1)


def test_a_box_casts_a_shadow_with_a_penumbra_of_the_lamps_size():
    # an edge at 2.4 m from the lamp, wall at 4.8: penumbra as wide as the lamp's diameter, 0.2 m
    plate = Box((0.1, 0.5, 0.0), (0.002, 1.0, 6.0))
    view = static_view(Scene(UNIFORM, (Lamp((-2.3, 0.0, 0.0), 0.1),), (), (plate,), 0), stereo_rig().right)
    row = view.direct.reshape(540, 960)[270]
    y_m = view.points_m[1].reshape(540, 960)[270]
    on_wall = view.range_m[270] > 4
    bare = static_view(Scene(UNIFORM, (Lamp((-2.3, 0.0, 0.0), 0.1),), bounces=0), stereo_rig().right)
    share = row / bare.direct.reshape(540, 960)[270]
    edge = on_wall & (np.abs(y_m) < 0.3)
    dark, bright = y_m[edge & (share < 0.05)], y_m[edge & (share > 0.95)]
    assert dark.min() - bright.max() == pytest.approx(0.17, abs=0.04)  # 5 to 95 % of a disc: 0.8 of its diameter
    assert np.interp(0.5, share[edge][::1], y_m[edge]) == pytest.approx(0, abs=0.02)


def test_a_beam_hides_drops_and_their_light_from_the_camera():
    leak = Leak(0.5, 0.25, 1.0, 0.01, np.array([-0.45]))
    camera, recording = stereo_rig().left, Recording(1, 12.0, 0.02)
    open_scene = Scene(UNIFORM, (Lamp(),), (leak,))
    behind = Scene(UNIFORM, (Lamp(),), (leak,), (Box((-0.5, 0.25, 0.0), (0.1, 0.4, 0.8)),))
    assert drop_mask(open_scene, camera, recording, 0).sum() > 5
    assert drop_mask(behind, camera, recording, 0).sum() == 0
    still = render_view(Scene(UNIFORM, (Lamp(),), (), behind.structures), camera, recording)
    column = int(camera.project([0.5, 0.25, 0.0])[0])
    change = np.abs(render_view(behind, camera, recording) - still)[0, :, column - 5 : column + 5]
    assert change.max() == 0


def test_a_beam_before_the_lamp_takes_the_drops_shadow_away():
    leak = Leak(1.0, 0.0, 1.0, 0.01, np.array([-0.45]))
    camera, recording = stereo_rig().left, Recording(1, 12.0, 0.02)
    screen = Box((-1.5, 0.0, 0.4), (0.02, 1.0, 1.0))
    assert shadow_mask(Scene(UNIFORM, (Lamp(),), (leak,)), camera, recording, 0).sum() > 5
    assert shadow_mask(Scene(UNIFORM, (Lamp(),), (leak,), (screen,)), camera, recording, 0).sum() == 0


def test_a_drops_shadow_falls_on_structure_too():
    leak = Leak(1.0, 0.0, 1.0, 0.01, np.array([-0.45]))
    plate = Box((1.3, 0.0, 0.0), (0.02, 1.5, 3.0))
    camera, recording = stereo_rig().left, Recording(1, 12.0, 0.02)
    mask = shadow_mask(Scene(UNIFORM, (Lamp(),), (leak,), (plate,)), camera, recording, 0)
    rows, columns = np.nonzero(mask > 0.5 * mask.max())
    seen = camera.project([1.29, 0.0, 0.0])[0]
    assert columns.mean() == pytest.approx(seen, abs=1)
    assert rows.size > 0


def test_a_mesh_file_is_read_in_metres(tmp_path):
    path = tmp_path / "box.stl"
    trimesh.creation.box((100, 200, 300)).export(path)
    mesh = mesh_file(path, scale=1e-3)
    assert volume(mesh) == pytest.approx(0.006)


@pytest.mark.parametrize(
    ("vertices", "faces", "rule"),
    [
        (TRIANGLE * np.nan, FACE, "NaN"),
        (TRIANGLE, np.zeros((0, 3), int), "no faces"),
        (TRIANGLE, np.array([[0, 1, 3]]), "index"),
        (TRIANGLE, np.array([[0, 1, -1]]), "index"),
        (TRIANGLE * 1e4, FACE, "millimetres"),
        (TRIANGLE[:, :2], FACE, "shape"),
        (TRIANGLE, FACE.astype(float), "integers"),
        (TRIANGLE, np.zeros((5_000_001, 3), np.int32), "simplify"),
    ],
)
def test_a_bad_mesh_is_refused_with_its_reason(vertices, faces, rule):
    with pytest.raises(ValueError, match=rule):
        Mesh(vertices, faces, name="bad.stl")


def test_a_file_that_is_no_mesh_is_refused_by_name(tmp_path):
    path = tmp_path / "not_a_mesh.stl"
    path.write_text("hello")
    with pytest.raises(ValueError, match="not_a_mesh"):
        mesh_file(path)
    with pytest.raises(ValueError, match="missing"):
        mesh_file(tmp_path / "missing.obj")


@pytest.mark.parametrize(
    ("origins", "directions", "rule"),
    [
        (np.zeros(3), np.ones(3), "shape"),
        (np.zeros((2, 3)), np.ones((3, 3)), "shape"),
        (np.zeros((2, 2)), np.ones((2, 2)), "shape"),
        (np.full((1, 3), np.nan), np.ones((1, 3)), "finite"),
        (np.zeros((1, 3)), np.zeros((1, 3)), "direction"),
    ],
)
def test_rays_that_would_crash_embree_are_refused(origins, directions, rule):
    with pytest.raises(ValueError, match=rule):
        RayCaster(TRIANGLE, FACE).first_hits(origins, directions)


def test_the_caster_finds_the_triangle_and_what_is_hidden_behind_it():
    caster = RayCaster(TRIANGLE, FACE)
    origins = np.array([[0.2, 0.2, -1.0], [0.9, 0.9, -1.0]])
    hits = caster.first_hits(origins, np.array([[0, 0, 1.0]] * 2))
    assert hits.distance_m[0] == pytest.approx(1)
    assert np.isinf(hits.distance_m[1])
    assert hits.face.tolist() == [0, -1]
    up = np.array([0, 0, 1.0])
    targets = origins + 2 * up
    assert caster.blocked(origins, targets).tolist() == [True, False]
    assert caster.blocked(origins, origins + 0.9 * up).tolist() == [False, False]
    assert caster.first_hits(np.zeros((0, 3)), np.zeros((0, 3))).face.size == 0


@pytest.mark.parametrize(
    ("make", "rule"),
    [
        (lambda: Box((0, 0, 0), (0.0, 1, 1)), "size_m"),
        (lambda: Pipe((0, 0, 0), (0, 0, 0), 0.1), "differ"),
        (lambda: Pipe((0, 0, 0), (0, 0, 1), -0.1), "radius_m"),
        (lambda: Grating((0, 0, 0), (1, 1), 0.1, 0.2), "bar_m"),
        (lambda: Lamp(radius_m=0.0), "radius_m"),
        (lambda: Lamp(power_w=-1.0), "power_w"),
        (lambda: Leak(0, 0, 0, 0.0, np.zeros(1)), "drop_radius_m"),
        (lambda: Leak(0, 0, 0, 0.01, np.array([np.nan])), "drop_times_s"),
        (lambda: Pedestal(radius_m=-1.0), "radius_m"),
        (lambda: RustTexture(rust_reflectance=1.5), "reflectance"),
        (lambda: ImageTexture(np.full((2, 2), 2.0)), "reflectance"),
        (lambda: Scene(UNIFORM, (Lamp((3.0, 0.0, 0.0)),)), "lamp 0"),
        (lambda: Scene(UNIFORM, (Lamp(),), (Leak(0, 2.6, 0, 0.01, np.zeros(1)),)), "leak 0"),
        (lambda: Recording(exposure_s=0.0), "exposure_s"),
        (lambda: Recording(n_frames=0), "n_frames"),
        (lambda: Recording(psf_sigma_px=-1.0), "psf_sigma_px"),
    ],
)
def test_impossible_things_are_refused_by_name(make, rule):
    with pytest.raises(ValueError, match=rule):
        make()


def test_a_camera_outside_the_pedestal_is_refused():
    scene = Scene(Pedestal(radius_m=1.0, texture=UniformTexture(0.3)), (Lamp((0, 0, 0)),))
    with pytest.raises(ValueError, match="inside the pedestal"):
        render_view(scene, stereo_rig().left, Recording(1))


def test_responsivity_is_the_camera_equation():
    # pi / (4 x 4) x (3 um)^2 x 0.6 / (h c / 550 nm) = 0.19635 x 9e-12 m2 x 0.6 / 3.6117e-19 J
    assert responsivity() == pytest.approx(0.19635 * 9e-12 * 0.6 / 3.6117e-19, rel=1e-4)
