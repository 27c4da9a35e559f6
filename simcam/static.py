"""The static layer: the pedestal as one camera sees it without drops, cast once per rig and scene.

`light_scene` prepares what all cameras share (maps, mesh, bounced light), `static_view` casts one ray per pixel. Both
are kept by content for the life of the process, so a second clip with the same rig and scene casts no ray here.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from simcam.camera import Camera
from simcam.content import ContentCache, content_key
from simcam.foot import LampFoot, foot_irradiance, lamp_feet
from simcam.lens import FloatArray
from simcam.light import LAMP_SAMPLES, ShadowSource, lamp_visibility, open_irradiance
from simcam.radiosity import bounced_irradiance
from simcam.scene import Lamp, Pedestal, Scene
from simcam.structures import IndexArray
from simcam.surface import STRUCTURE, MapReader, Obstacles, Surface, build_obstacles, trace

CACHED_SCENES = 4
CACHED_VIEWS = 6  # 21 MB each at 960 x 540 and one lamp with its foot
FOOT_SAMPLES = 4  # shadow rays to a foot: what they say darkens a shadow, never the picture


@dataclass(frozen=True, eq=False)
class Leaving:
    """Radiance W m^-2 sr^-1 that leaves points of a surface, float32: direct (lamps, n), feet (feet, n), bounced (n,).

    What the feet throw is a part of the bounced light.
    """

    direct: FloatArray
    feet: FloatArray
    bounced: FloatArray

    @property
    def by_source(self) -> FloatArray:
        """What drops can shade (sources, n), lamps first, then their feet."""
        return np.concatenate([self.direct, self.feet])

    @property
    def total(self) -> FloatArray:
        """All of it (n,)."""
        return self.direct.sum(axis=0) + self.bounced


@dataclass(frozen=True, eq=False)
class LitScene:
    """A scene's static surfaces with their light: what any ray needs to know the radiance where it ends."""

    pedestal: Pedestal
    lamps: tuple[Lamp, ...]
    feet: tuple[LampFoot, ...]
    obstacles: Obstacles | None
    reflectance: MapReader
    bounced: MapReader
    ambient_w_m2: float  # bounced irradiance on structure: the walls' mean

    @property
    def sources(self) -> tuple[ShadowSource, ...]:
        """Whose light drops shade: the lamps, then their feet."""
        return self.lamps + self.feet

    def look(self, origins_m: FloatArray, directions: FloatArray) -> Surface:
        """First static surface along rays (3, n)."""
        return trace(self.pedestal, self.obstacles, origins_m, directions)

    def leaving(self, surface: Surface, samples: int) -> Leaving:
        """Light that leaves a surface's points, `samples` shadow rays per lamp. A foot gives what it throws directly,

        a part of the bounced light and never more than that.
        """
        lambert = self.reflectances(surface) / np.float32(np.pi)
        irradiance = self._bounced_irradiance(surface)
        direct = np.zeros((len(self.lamps), surface.kind.size), np.float32)
        for lamp, light in zip(self.lamps, direct, strict=True):
            seen = lamp_visibility(lamp, surface, self.obstacles, samples)
            light[:] = lambert * open_irradiance(lamp, surface.points_m, surface.normals) * seen
        feet = np.zeros((len(self.feet), surface.kind.size), np.float32)
        for foot, light in zip(self.feet, feet, strict=True):
            seen = lamp_visibility(foot, surface, self.obstacles, min(samples, FOOT_SAMPLES))
            light[:] = foot_irradiance(foot, surface.points_m, surface.normals) * seen
        if self.feet:
            thrown = np.maximum(feet.sum(axis=0), np.float32(1e-30))
            feet *= lambert * np.minimum(irradiance / thrown, 1)
        return Leaving(direct, feet, lambert * irradiance)

    def _bounced_irradiance(self, surface: Surface) -> FloatArray:
        """Irradiance W/m^2 (n,) by way of other walls."""
        return np.where(surface.kind == STRUCTURE, np.float32(self.ambient_w_m2), self.bounced.read(surface))

    def reflectances(self, surface: Surface) -> FloatArray:
        """Diffuse reflectance (n,) of the surface's points."""
        values = self.reflectance.read(surface)
        if self.obstacles is not None and surface.face is not None:
            on_structure = surface.kind == STRUCTURE
            values = np.where(on_structure, self.obstacles.reflectance[np.maximum(surface.face, 0)], values)
        return values


@dataclass(frozen=True, eq=False)
class StaticView:
    """One camera's static layer, pixels in rows: radiances W m^-2 sr^-1, places in world metres, all float32.

    radiance (height, width); by_source (sources, height * width): what of it drops can shade, lamps first, then their
    feet, 0 where a lamp is seen directly; n_lamps; points_m (3, height * width); range_m (height, width) along the
    pixel's ray.
    """

    radiance: FloatArray
    by_source: FloatArray
    n_lamps: int
    points_m: FloatArray
    range_m: FloatArray

    @cached_property
    def pixel_m(self) -> float:
        """Metres between the points of neighbouring pixels where they are far apart (95 %), on every eighth row."""
        rows_m = self.points_m.reshape(3, *self.radiance.shape)[:, ::8]
        return float(np.percentile(np.linalg.norm(np.diff(rows_m, axis=2), axis=0), 95))

    @property
    def direct(self) -> FloatArray:
        """Radiance (lamps, height * width) of the lamps' direct light."""
        return self.by_source[: self.n_lamps]


_scenes: ContentCache[LitScene] = ContentCache(CACHED_SCENES)
_views: ContentCache[StaticView] = ContentCache(CACHED_VIEWS)


def scene_key(scene: Scene) -> bytes:
    """Key of everything in a scene that does not move."""
    return content_key(scene.pedestal, scene.lamps, scene.structures, scene.bounces)


def light_scene(scene: Scene) -> LitScene:
    """Maps, mesh and bounced light of a scene's static part, kept by content."""
    return _scenes.get(scene_key(scene), lambda: _light_scene(scene))


def static_view(scene: Scene, camera: Camera) -> StaticView:
    """What the camera sees without drops, kept by content of scene and camera."""
    key = content_key(scene_key(scene).hex(), camera)
    return _views.get(key, lambda: cast_view(light_scene(scene), camera))


def forget_static_layers() -> None:
    """Empty the caches: for timing and for counting rays."""
    _scenes.clear()
    _views.clear()


def _light_scene(scene: Scene) -> LitScene:
    pedestal = scene.pedestal
    reflectance = MapReader(pedestal, pedestal.texture.maps())
    bounced = bounced_irradiance(pedestal, scene.lamps, reflectance, scene.bounces)
    return LitScene(
        pedestal,
        scene.lamps,
        lamp_feet(pedestal, scene.lamps, reflectance) if scene.bounces else (),
        build_obstacles(scene.structures),
        reflectance,
        MapReader(pedestal, bounced),
        float(bounced.wall.mean()),
    )


def cast_view(lit: LitScene, camera: Camera) -> StaticView:
    """One ray through every pixel's centre, and shadow rays where structure may hide a lamp."""
    if not lit.pedestal.holds(camera.centre_world_m):
        raise ValueError(f"a camera must be inside the pedestal, got one at {tuple(camera.centre_world_m)}")
    directions = camera.pixel_rays().reshape(-1, 3).T.astype(np.float32)
    if not np.isfinite(directions).all():
        raise ValueError("the lens folds inside the image: no ray meets some pixels; use a weaker distortion")
    origin_m = camera.centre_world_m.astype(np.float32)[:, None]
    surface = lit.look(origin_m, directions)
    light = lit.leaving(surface, LAMP_SAMPLES)
    radiance, by_source = light.total, light.by_source
    range_m = surface.distance_m.copy()
    for lamp in lit.lamps:
        seen, lamp_range_m = _sees_lamp(lamp, origin_m, directions, range_m)
        radiance[seen], range_m[seen] = lamp.radiance_w_m2_sr, lamp_range_m
        by_source[:, seen] = 0
    shape = (camera.height_px, camera.width_px)
    return StaticView(radiance.reshape(shape), by_source, len(lit.lamps), surface.points_m, range_m.reshape(shape))


def _sees_lamp(
    lamp: Lamp, origin_m: FloatArray, directions: FloatArray, distance_m: FloatArray
) -> tuple[IndexArray, FloatArray]:
    """Indices of the rays that meet the lamp's sphere before anything else, and how far along them."""
    to_lamp = (np.asarray(lamp.position_m) - origin_m[:, 0]).astype(np.float32)
    along = to_lamp @ directions
    missed_by = np.maximum(to_lamp @ to_lamp - along * along, 0)
    seen = np.flatnonzero((missed_by < lamp.radius_m**2) & (along > 0) & (along < distance_m))
    return seen, along[seen]
