"""The path-traced clips rendered again by simcam, and one measure of streaks and shadows applied to both."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from simcam import ImageTexture, Lamp, Leak, Pedestal, Recording, Scene, render_clip, stereo_rig
from simcam.fall import fall_depth
from simcam.static import light_scene, static_view

REFERENCE = Path(__file__).parent.parent / "reference"
VIEWS = ("left", "right")
BOUNCES = 2  # as the clips were made
TEXTURE_SHAPE = (1024, 2048)
BLACK = 0.02  # reflectance that a wall hidden from both cameras at least has


def read_reference(name):
    """Frames uint8 (frames, height, width) per view, and the scene they were rendered from."""
    with np.load(REFERENCE / f"{name}.npz", allow_pickle=False) as deltas:
        frames = {view: np.cumsum(deltas[f"{view}_delta"], axis=0, dtype=np.uint8) for view in VIEWS}
    return frames, json.loads((REFERENCE / f"{name}.json").read_text())


def linear(grey):
    """Light 0..1 of 8-bit sRGB (IEC 61966-2-1)."""
    encoded = np.arange(256) / 255
    curve = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return curve[grey] if grey.dtype == np.uint8 else np.interp(grey, np.arange(256), curve)


def encoded(light):
    """8-bit sRGB of light, rounded like the reference."""
    light = np.clip(light, 0, 1)
    curve = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.rint(255 * curve).astype(np.uint8)


def described(scene, texture):
    """The simcam scene of a reference's description; radiance 1 gives 1 per exposure, so images are linear light."""
    lamps = tuple(Lamp(tuple(one["position_m"]), one["radius_m"], one["power_w"]) for one in scene["lamps"])
    leaks = tuple(
        Leak(one["x_m"], one["y_m"], one["z_m"], one["drop_radius_m"], np.array(one["drop_times_s"]))
        for one in scene["leaks"]
    )
    recording = Recording(scene["n_frames"], scene["fps"], scene["exposure_s"], responsivity=1 / scene["exposure_s"])
    return Scene(Pedestal(texture=texture), lamps, leaks, (), BOUNCES), stereo_rig(), recording


def wall_from_medians(frames, scene):
    """The rust that the clip does not give: reflectance of the wall from the clip's own median, where it is seen."""
    mean = 0.25
    texture = ImageTexture(np.full((1, 1), mean), mean)
    for _ in range(3):
        described_scene, rig, _ = described(scene, texture)
        lit = light_scene(described_scene)
        total, count = np.zeros(TEXTURE_SHAPE), np.zeros(TEXTURE_SHAPE)
        for view in VIEWS:
            seen = static_view(described_scene, getattr(rig, view))
            column = (np.arctan2(seen.points_m[1], seen.points_m[0]) + np.pi) / (2 * np.pi) * TEXTURE_SHAPE[1]
            row = (lit.pedestal.ceiling_z_m - seen.points_m[2]) / lit.pedestal.height_m * TEXTURE_SHAPE[0]
            place = (row.astype(int), np.clip(column.astype(int), 0, TEXTURE_SHAPE[1] - 1))
            now = lit.reflectance.read(lit.look(*_rays(getattr(rig, view))))
            light = linear(np.median(frames[view], axis=0)).ravel()
            np.add.at(total, place, light / seen.radiance.ravel() * now)
            np.add.at(count, place, 1)
        mean = float((total.sum() / count.sum()))
        wall = np.where(count > 0, total / np.maximum(count, 1), mean)
        texture = ImageTexture(np.clip(wall, BLACK, 0.95), mean)
    return texture


def _rays(camera):
    return camera.centre_world_m.astype(np.float32)[:, None], camera.pixel_rays().reshape(-1, 3).T.astype(np.float32)


@dataclass(frozen=True)
class Window:
    """Where one streak is expected: frame, leak, view, inclusive rows, and columns about `column_px`."""

    frame: int
    leak: int
    view: str
    first_row: int
    last_row: int
    first_column: int
    last_column: int

    def of(self, frames):
        return frames[self.frame, self.first_row : self.last_row + 1, self.first_column : self.last_column + 1]


@dataclass(frozen=True)
class Measure:
    """Of one streak: centroid column of |difference|, first and last changed row, signed light; NaN where unchanged."""

    column_px: float
    first_row: float
    last_row: float
    light: float


def drop_windows(scene, rig, recording, view):
    """Windows of all drops that fall wholly inside the image during an exposure."""
    camera, windows = getattr(rig, view), []
    for leak_index, leak in enumerate(scene.leaks):
        for frame, opens, closes in _exposures(leak, recording):
            ends = camera.project(_at(leak, np.array([opens, closes])))
            depth = camera.depth(_at(leak, np.array([closes])))[0]
            radius = leak.drop_radius_m * camera.camera_matrix[0, 0] / depth
            windows += _window(camera, (frame, leak_index, view), ends, (radius + 2, radius + 2))
    return windows


def shadow_windows(scene, rig, recording, view):
    """Windows of all shadows on the wall that fall wholly inside the image during an exposure."""
    camera, windows = getattr(rig, view), []
    (lamp,), lit = scene.lamps, light_scene(scene)
    for leak_index, leak in enumerate(scene.leaks):
        for frame, opens, closes in _exposures(leak, recording):
            drops = _at(leak, np.array([opens, closes]))
            light = np.asarray(lamp.position_m)
            rays = (drops - light).T.astype(np.float32)
            surface = lit.look(light.astype(np.float32)[:, None], rays)
            ends = camera.project(surface.points_m.T)
            if not (surface.kind == 0).all() or not np.isfinite(ends).all():
                continue
            scale = camera.camera_matrix[0, 0] / camera.depth(surface.points_m.T).min()
            stretch = surface.distance_m.max()  # wall over drop distance from the lamp
            reach = scale * (leak.drop_radius_m * stretch + lamp.radius_m * (stretch - 1))
            windows += _window(camera, (frame, leak_index, view), ends, (1.3 * reach + 2, 1.6 * reach + 2))
    return windows


def apart(windows, others):
    """The windows that no other one of the same frame touches."""
    boxes = windows + others

    def touches(one, other):
        return (
            one is not other
            and one.frame == other.frame
            and one.first_row <= other.last_row
            and other.first_row <= one.last_row
            and one.first_column <= other.last_column
            and other.first_column <= one.last_column
        )

    return [one for one in windows if not any(touches(one, other) for other in boxes)]


def measured(frames, window, threshold):
    """The measure, on 8-bit frames: difference from the median over the frames, at least `threshold` grey."""
    frame, still = window.of(frames), window.of(np.median(frames, axis=0)[None].repeat(len(frames), axis=0))
    change = np.abs(frame - still)
    weight = np.where(change >= threshold, change, 0)
    if not weight.any():
        return Measure(np.nan, np.nan, np.nan, 0.0)
    columns = np.arange(window.first_column, window.last_column + 1)
    rows = np.flatnonzero(weight.any(axis=1)) + window.first_row
    light = float((linear(frame) - linear(still)).sum())
    return Measure(float((weight.sum(axis=0) * columns).sum() / weight.sum()), rows[0], rows[-1], light)


def _exposures(leak, recording):
    for frame in range(recording.n_frames):
        for released in leak.drop_times_s:
            opens, closes = recording.opens_s(frame) - released, recording.closes_s(frame) - released
            if opens > 0:
                yield frame, opens, closes


def _at(leak, fall_s):
    places = np.repeat(leak.position_m[None], len(fall_s), axis=0)
    places[:, 2] -= fall_depth(fall_s)
    return places


def _window(camera, key, ends, margins):
    across, along = margins
    first_column, last_column = ends[:, 0].min() - across, ends[:, 0].max() + across
    first_row, last_row = ends[:, 1].min() - along, ends[:, 1].max() + along
    if not (first_column >= 0 and first_row >= 0 and last_column < camera.width_px and last_row < camera.height_px):
        return []
    rows_and_columns = (int(first_row), int(np.ceil(last_row)), int(first_column), int(np.ceil(last_column)))
    return [Window(*key, *rows_and_columns)]
