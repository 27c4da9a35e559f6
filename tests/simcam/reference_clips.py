"""The path-traced clips rendered again by simcam, and one measure of streaks and shadows applied to both."""

import json
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from simcam import ImageTexture, Lamp, Leak, Pedestal, Recording, Scene, stereo_rig
from simcam.fall import fall_depth
from simcam.static import light_scene, static_view

REFERENCE = Path(__file__).parent.parent / "reference"
VIEWS = ("left", "right")
BOUNCES = 2  # as the clips were made
TEXTURE_SHAPE = (1024, 2048)
WHITE = 250  # grey of a pixel in which a path met the lamp
ROUNDINGS = 8  # draws of the thresholds in `rounded`; the median column of 20 streaks hangs by 0.3 px on a single one
BLACK = 0.02  # reflectance that a wall hidden from both cameras at least has


@cache
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
    """sRGB grey 0..255, not rounded, of light (..., height, width)."""
    light = np.clip(light, 0, 1)
    return 255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def rounded(grey, draw=0):
    """8-bit grey; every pixel is rounded at its own threshold, the same in all frames.

    The texture is taken from an 8-bit picture, so without that all pixels would sit in the middle of a step.
    """
    return np.floor(grey + np.random.default_rng(draw).random(grey.shape[-2:])).astype(np.uint8)


def described(scene, texture):
    """The simcam scene of a reference's description; radiance 1 gives 1 per exposure, so images are linear light."""
    lamps = tuple(Lamp(tuple(one["position_m"]), one["radius_m"], one["power_w"]) for one in scene["lamps"])
    leaks = tuple(
        Leak(one["x_m"], one["y_m"], one["z_m"], one["drop_radius_m"], np.array(one["drop_times_s"]))
        for one in scene["leaks"]
    )
    recording = Recording(scene["n_frames"], scene["fps"], scene["exposure_s"], responsivity=1 / scene["exposure_s"])
    return Scene(Pedestal(texture=texture), lamps, leaks, (), BOUNCES), stereo_rig(), recording


@cache
def wall_from_medians(name, hidden=1.0):
    """The rust that the clip does not give: reflectance of the wall from the clip's own median, where it is seen.

    Elsewhere it is the mean of what is seen, times `hidden` on the wall behind the cameras.
    """
    frames, scene = read_reference(name)
    mean = 0.15
    texture = ImageTexture(np.full((1, 1), mean), mean)
    light = {view: linear(np.median(frames[view], axis=0)).ravel() for view in VIEWS}
    for _ in range(5):
        described_scene, rig, _ = described(scene, texture)
        lit = light_scene(described_scene)
        total, count = np.zeros(TEXTURE_SHAPE), np.zeros(TEXTURE_SHAPE)
        for view in VIEWS:
            seen = static_view(described_scene, getattr(rig, view))
            column = (np.arctan2(seen.points_m[1], seen.points_m[0]) + np.pi) / (2 * np.pi) * TEXTURE_SHAPE[1]
            row = (lit.pedestal.ceiling_z_m - seen.points_m[2]) / lit.pedestal.height_m * TEXTURE_SHAPE[0]
            place = (row.astype(int), np.clip(column.astype(int), 0, TEXTURE_SHAPE[1] - 1))
            now = lit.reflectance.read(lit.look(*_rays(getattr(rig, view))))
            flat = np.ravel_multi_index(place, TEXTURE_SHAPE)
            weight = light[view] / seen.radiance.ravel() * now
            total += np.bincount(flat, weight, total.size).reshape(TEXTURE_SHAPE)
            count += np.bincount(flat, minlength=count.size).reshape(TEXTURE_SHAPE)
        mean = float(total.sum() / count.sum())
        behind = np.abs(np.linspace(-1, 1, TEXTURE_SHAPE[1])) > 0.75
        unseen = np.where(behind, hidden * mean, mean)
        wall = np.where(count > 0, total / np.maximum(count, 1), unseen)
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


def measured(frames, still, window):
    """The measure, on 8-bit frames, against the picture without anything moving (their median).

    Columns: centroid of |difference|, where it is 1 grey or more, counted as 3 at most: the reference's 96 samples per
    pixel meet the lamp's image in a drop once in many streaks, and such a pixel is white. Ends: rows whose differences
    sum to 2 grey. Light: of all pixels that are not white.
    """
    here = window.of(np.broadcast_to(still, frames.shape))
    frame = window.of(frames)
    change = np.abs(frame.astype(float) - here)
    weight = np.where(change >= 1, np.minimum(change, 3), 0)
    rows = np.flatnonzero(change.sum(axis=1) >= 2) + window.first_row
    light = float(np.where(frame < WHITE, linear(frame) - linear(here), 0).sum())
    if not weight.any() or rows.size == 0:
        return Measure(np.nan, np.nan, np.nan, light)
    columns = np.arange(window.first_column, window.last_column + 1)
    return Measure(float((weight.sum(axis=0) * columns).sum() / weight.sum()), rows[0], rows[-1], light)


def _exposures(leak, recording):
    for frame in range(1, recording.n_frames):  # the reference's drops stand still before time 0, half of frame 0
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


def compared(name, render, hidden=1.0):
    """Measures of every streak that stands apart: rows (kind, view, leak, reference Measure, simcam Measure).

    `render` is simcam's render_clip or another with its signature.
    """
    frames, description = read_reference(name)
    scene, rig, recording = described(description, wall_from_medians(name, hidden))
    clip = render(scene, rig, recording)
    rows = []
    for view in VIEWS:
        drops, shadows = (windows(scene, rig, recording, view) for windows in (drop_windows, shadow_windows))
        windows = [("drop", one) for one in apart(drops, shadows)] + [("shadow", one) for one in apart(shadows, drops)]
        still = np.median(frames[view], axis=0)
        theirs = [measured(frames[view], still, one) for _, one in windows]
        ours = _mean_measures(getattr(clip, view), [one for _, one in windows])
        rows += [
            (kind, f"{name} {view}", one.leak, *measures)
            for (kind, one), *measures in zip(windows, theirs, ours, strict=True)
        ]
    return rows


def _mean_measures(light, windows):
    """Measures of rendered light, the column as the mean over draws of the rounding, the rest from the first."""
    grey, draws = encoded(light), []
    seen = np.zeros(light.shape[1:], dtype=bool)
    for one in windows:
        seen[one.first_row : one.last_row + 1, one.first_column : one.last_column + 1] = True
    for draw in range(ROUNDINGS):
        rendered = rounded(grey, draw)
        still = np.zeros(seen.shape)
        still[seen] = np.median(rendered[:, seen], axis=0)  # of a tenth of the pixels
        draws.append([measured(rendered, still, one) for one in windows])
    columns = np.nanmean([[one.column_px for one in draw] for draw in draws], axis=0)
    return [replace(first, column_px=float(column)) for first, column in zip(draws[0], columns, strict=True)]


def pooled_light(name, render, hidden):
    """Signed light summed over the streaks that stand apart, white pixels left out: per kind, [reference, simcam].

    Simcam's is not rounded to grey. `render` should leave out the lamps' images in the drops: in the reference they are
    rare white pixels, 87 times brighter than 8 bits can hold.
    """
    frames, description = read_reference(name)
    scene, rig, recording = described(description, wall_from_medians(name, hidden))
    clip = render(scene, rig, recording)
    light = {"drop": [], "shadow": []}
    for view in VIEWS:
        rendered, still = getattr(clip, view), static_view(scene, getattr(rig, view)).radiance
        middle = np.median(frames[view], axis=0)
        drops, shadows = (windows(scene, rig, recording, view) for windows in (drop_windows, shadow_windows))
        for kind, windows in (("drop", apart(drops, shadows)), ("shadow", apart(shadows, drops))):
            for one in windows:
                there = np.s_[one.first_row : one.last_row + 1, one.first_column : one.last_column + 1]
                changed = float((one.of(rendered) - still[there]).sum())
                light[kind].append((measured(frames[view], middle, one).light, changed))
    return {kind: np.array(rows) for kind, rows in light.items()}


def disc_light(name):
    """Light of the wall behind the drops of the streaks that stand apart: what an opaque black drop would take."""
    frames, description = read_reference(name)
    scene, rig, recording = described(description, ImageTexture(np.full((1, 1), 0.15)))
    total = 0.0
    for view in VIEWS:
        camera, wall = getattr(rig, view), linear(np.median(frames[view], axis=0))
        for one in apart(drop_windows(scene, rig, recording, view), shadow_windows(scene, rig, recording, view)):
            leak = scene.leaks[one.leak]
            depth_m = camera.depth(leak.position_m)
            area_px = np.pi * (leak.drop_radius_m * camera.camera_matrix[0, 0] / depth_m) ** 2
            total += area_px * wall[one.first_row : one.last_row, one.first_column : one.last_column].mean()
    return total
