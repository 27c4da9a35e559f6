"""What is true of every leak in both views: columns, what hides it, shadow columns. Geometry only.

A leak's column is where its vertical line crosses the middle row (height - 1) / 2 of the raw image.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simcam.camera import Camera
from simcam.lens import FloatArray
from simcam.light import LAMP_SAMPLES, lamp_visibility
from simcam.path import landing_m
from simcam.recording import Recording
from simcam.rig import StereoRig
from simcam.scene import Lamp, Leak, Scene
from simcam.static import LitScene, light_scene
from simcam.structures import IndexArray
from simcam.surface import Surface

LINE_POINTS = 4001  # along a leak's line, floor to ceiling: 2 mm in the paper's pedestal
IN_VIEW_MARGIN_PX = 3.0
SECTIONS, SECTIONINGS = 32, 6
ON_PLANE_M = 1e-3  # of the lamp-leak plane: nearer, a surface crosses it; farther, an outline jumps over it


@dataclass(frozen=True)
class LeakView:
    """A leak in one camera. Undefined is NaN.

    column_px at mid-row; in_view: column at least 3 px inside; drop_width_px there; visible_fraction: share of the
    image's rows in which the drop is seen (in the image, falling, not hidden); occluded_by: indices of structures that
    hide rows; first_row_px, last_row_px of what is seen; shadow_columns_px at mid-row, one per lamp.
    """

    column_px: float
    in_view: bool
    drop_width_px: float
    visible_fraction: float
    occluded_by: tuple[int, ...]
    first_row_px: float
    last_row_px: float
    shadow_columns_px: tuple[float, ...]


@dataclass(frozen=True)
class LeakTruth:
    """A leak in both views."""

    left: LeakView
    right: LeakView

    @property
    def in_view(self) -> bool:
        """In view of both cameras."""
        return self.left.in_view and self.right.in_view

    @property
    def visible_fraction(self) -> float:
        """Visible share of the rows, in the worse view."""
        return min(self.left.visible_fraction, self.right.visible_fraction)


@dataclass(frozen=True)
class Truth:
    """All leaks of a scene, in its order, and the rig that saw them."""

    leaks: tuple[LeakTruth, ...]
    rig: StereoRig


def ground_truth(scene: Scene, rig: StereoRig, recording: Recording) -> Truth:
    """Columns, visibility and shadows of every leak in both cameras; `recording` does not move any of them."""
    del recording  # a leak's line is where its drops are at any time
    lit = light_scene(scene)
    leaks = tuple(LeakTruth(leak_view(lit, rig.left, leak), leak_view(lit, rig.right, leak)) for leak in scene.leaks)
    return Truth(leaks, rig)


def leak_view(lit: LitScene, camera: Camera, leak: Leak) -> LeakView:
    """One leak in one camera."""
    column_px, middle_m = line_crossing(lit, camera, leak)
    inside = IN_VIEW_MARGIN_PX <= column_px <= camera.width_px - 1 - IN_VIEW_MARGIN_PX
    range_m = float(np.linalg.norm(middle_m - camera.centre_world_m))
    seen_rows, hidden_by = _rows_seen(lit, camera, leak)
    shadows = tuple(shadow_column(lit, camera, leak, lamp) for lamp in lit.lamps)
    return LeakView(
        column_px,
        bool(inside),
        _width_px(camera, middle_m, leak.drop_radius_m, range_m),
        len(seen_rows) / camera.height_px,
        hidden_by,
        float(seen_rows[0]) if len(seen_rows) else np.nan,
        float(seen_rows[-1]) if len(seen_rows) else np.nan,
        shadows,
    )


def line_crossing(lit: LitScene, camera: Camera, leak: Leak) -> tuple[float, FloatArray]:
    """Column where the leak's vertical line crosses the middle row, and the point (3,) there; NaN where it does not."""
    points_m = _line(leak, np.linspace(lit.pedestal.ceiling_z_m, lit.pedestal.floor_z_m, LINE_POINTS))
    below_px = camera.project(points_m)[:, 1] - (camera.height_px - 1) / 2
    crossing = np.flatnonzero((below_px[:-1] < 0) & (below_px[1:] >= 0))
    if crossing.size == 0:
        return np.nan, np.full(3, np.nan)
    low, high = points_m[crossing[0]], points_m[crossing[0] + 1]
    for _ in range(4):  # false position; the row is nearly linear over 2 mm
        ends = camera.project(np.stack([low, high]))[:, 1] - (camera.height_px - 1) / 2
        middle = low + (high - low) * (-ends[0] / (ends[1] - ends[0]))
        if camera.project(middle)[1] < (camera.height_px - 1) / 2:
            low = middle
        else:
            high = middle
        if np.allclose(low, high, atol=1e-12):
            break
    return float(camera.project(middle)[0]), middle


def shadow_column(lit: LitScene, camera: Camera, leak: Leak, lamp: Lamp) -> float:
    """Column at mid-row of the middle of a leak's shadow from one lamp; NaN when none is in the image.

    The shadow lies in the vertical plane through lamp and leak, beyond the leak, on whatever surface is seen there, as
    far as the lamp reaches it past a height from which drops fall.
    """
    columns = np.arange(camera.width_px, dtype=float)
    side, ahead = _beside_plane(_at_mid_row(lit, camera, columns), leak, lamp)
    for place in np.flatnonzero((side[:-1] * side[1:] <= 0) & (ahead[:-1] > 1) & (ahead[1:] > 1)):
        column = _column_of_plane(lit, camera, columns[place : place + 2], leak, lamp)
        if _is_shaded(lit, _at_mid_row(lit, camera, np.array([column])), leak, lamp):
            return column
    return np.nan


def _column_of_plane(lit: LitScene, camera: Camera, between_px: FloatArray, leak: Leak, lamp: Lamp) -> float:
    """Column between two (2,) at which what is seen changes sides of the lamp-leak plane.

    Many columns at a time are as quick as two: sections, not halves, to 1e-9 px.
    """
    low, high = between_px
    for _ in range(SECTIONINGS):
        columns = np.linspace(low, high, SECTIONS + 1)
        side, _ = _beside_plane(_at_mid_row(lit, camera, columns), leak, lamp)
        first = int(np.argmax(side[:-1] * side[1:] <= 0))
        low, high = columns[first], columns[first + 1]
    return float((low + high) / 2)


def _is_shaded(lit: LitScene, surface: Surface, leak: Leak, lamp: Lamp) -> bool:
    """Whether drops pass between the lamp and a point (one) of the lamp-leak plane."""
    (side,), (ahead,) = _beside_plane(surface, leak, lamp)
    if abs(side) > ON_PLANE_M:  # the outline of something before the plane
        return False
    passes_z_m = lamp.position_m[2] + (float(surface.points_m[2, 0]) - lamp.position_m[2]) / ahead
    if not leak.z_m - landing_m(lit, leak) < passes_z_m < leak.z_m:
        return False
    return bool(lamp_visibility(lamp, surface, lit.obstacles, LAMP_SAMPLES)[0] > 0)


def _at_mid_row(lit: LitScene, camera: Camera, columns: FloatArray) -> Surface:
    """What is seen at columns (n,) of the middle row."""
    pixels = np.stack([columns, np.full_like(columns, (camera.height_px - 1) / 2)], axis=-1)
    origin_m = camera.centre_world_m.astype(np.float32)[:, None]
    return lit.look(origin_m, camera.rays(pixels).T.astype(np.float32))


def _beside_plane(surface: Surface, leak: Leak, lamp: Lamp) -> tuple[FloatArray, FloatArray]:
    """Metres of points (n,) beside the lamp-leak plane; their distance from the lamp along it, the leak's being 1."""
    points_m = surface.points_m
    x, y = leak.x_m - lamp.position_m[0], leak.y_m - lamp.position_m[1]
    distance_m = max(np.hypot(x, y), 1e-9)
    from_x, from_y = points_m[0] - lamp.position_m[0], points_m[1] - lamp.position_m[1]
    return (from_y * x - from_x * y) / distance_m, (from_x * x + from_y * y) / distance_m**2


def _rows_seen(lit: LitScene, camera: Camera, leak: Leak) -> tuple[IndexArray, tuple[int, ...]]:
    """Rows in which the drops are seen, and the structures that hide others."""
    low_z_m = leak.z_m - landing_m(lit, leak)
    points_m = _line(leak, np.linspace(leak.z_m, low_z_m, LINE_POINTS))
    pixels = camera.project(points_m)
    ahead = np.isfinite(pixels[:, 1])
    if ahead.sum() < 2:
        return np.zeros(0, int), ()
    first, last = np.nanmin(pixels[:, 1]), np.nanmax(pixels[:, 1])
    rows = np.arange(max(0, np.ceil(first)), min(camera.height_px - 1, np.floor(last)) + 1)
    heights_m = np.interp(rows, pixels[ahead, 1], points_m[ahead, 2])
    at_rows_m = _line(leak, heights_m)
    columns = camera.project(at_rows_m)[:, 0]
    inside = (columns > -0.5) & (columns < camera.width_px - 0.5)
    hidden, hidden_by = _hidden(lit, camera, at_rows_m)
    seen = inside & ~hidden & ~_behind_lamps(lit, camera, at_rows_m)
    return rows[seen], tuple(int(index) for index in np.unique(hidden_by[inside & hidden]))


def _hidden(lit: LitScene, camera: Camera, points_m: FloatArray) -> tuple[FloatArray, IndexArray]:
    """Whether structure lies between the camera and points (n, 3), and which."""
    nothing = np.zeros(len(points_m), bool), np.zeros(len(points_m), int)
    if lit.obstacles is None or len(points_m) == 0:
        return nothing
    origins = np.repeat(camera.centre_world_m[None], len(points_m), axis=0)
    hits = lit.obstacles.caster.first_hits(origins, points_m - origins)
    return hits.distance_m < 1.0, lit.obstacles.structure[hits.face]


def _behind_lamps(lit: LitScene, camera: Camera, points_m: FloatArray) -> NDArray[np.bool_]:
    """Whether a lamp's body lies between the camera and points (n, 3)."""
    sight = points_m - camera.centre_world_m
    range_m = np.linalg.norm(sight, axis=1)
    behind = np.zeros(len(points_m), bool)
    for lamp in lit.lamps:
        to_lamp = np.asarray(lamp.position_m) - camera.centre_world_m
        along = sight @ to_lamp / range_m
        missed_by = np.linalg.norm(to_lamp - along[:, None] * sight / range_m[:, None], axis=1)
        behind |= (missed_by < lamp.radius_m) & (along > 0) & (along < range_m)
    return behind


def _line(leak: Leak, heights_m: FloatArray) -> FloatArray:
    return np.stack([np.full_like(heights_m, leak.x_m), np.full_like(heights_m, leak.y_m), heights_m], axis=-1)


def _width_px(camera: Camera, centre_m: FloatArray, radius_m: float, range_m: float) -> float:
    """Width of a drop's picture along the row, from the two points where the sight line is tangent."""
    if not np.isfinite(centre_m).all():
        return np.nan
    sight = (centre_m - camera.centre_world_m) / range_m
    across = np.cross(camera.rotation[:, 1], sight)
    across *= radius_m / np.linalg.norm(across)
    ends = camera.project(np.stack([centre_m - across, centre_m + across]))
    return float(abs(ends[1, 0] - ends[0, 0]))
