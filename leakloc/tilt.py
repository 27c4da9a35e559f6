"""A rig that leans against gravity: where its plumb lines run in views that were believed level."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np

from leakloc.levelled import LevelPair, level_pair
from leakloc.rig import Array, Rig
from leakloc.streaks import Activity


def tilted_rig(rig: Rig, level: LevelPair, tilt_rad: Array) -> Rig:
    """The rig turned by roll and pitch (2,) against its believed pose: about the middle of the baseline, or about the

    left camera where the frame of the results is that camera's own. + roll lifts the left side, + pitch looks down.
    """
    turn = _turn(level, tilt_rad)
    pose = np.array(rig.frame_from_left)
    centre_m = level.centres_m[0] if rig.world_from_left is None else level.centres_m.mean(axis=0)
    pose[:3, :3] = turn @ pose[:3, :3]
    pose[:3, 3] = centre_m + turn @ (pose[:3, 3] - centre_m)
    return replace(rig, world_from_left=pose)


def leaning_columns(believed: LevelPair, tilt_rad: Array, view: int, rows_px: Array, columns_px: Array) -> Array:
    """Columns of the believed-level view where plumb lines cross its rows, (rows, columns) px.

    `columns_px` are the lines' columns in the truly level view of the same camera (same focal length and principal
    point); tilt_rad (2,) roll and pitch. Every point of a plumb line lies in one vertical plane with the camera; the
    plane's ray that is seen on the wanted row follows from one linear equation.
    """
    turn = _turn(believed, tilt_rad)
    believed_from_true = believed.axes @ turn.T @ _level_axes(believed, turn).T
    principal = believed.principal_px[view]
    x = (np.asarray(columns_px) - principal[0]) / believed.focal_px
    y = (np.asarray(rows_px)[:, None] - principal[1]) / believed.focal_px
    start = believed_from_true @ np.stack([x, np.zeros_like(x), np.ones_like(x)])  # ray on the horizon
    down = believed_from_true[:, 1]
    step = (y * start[2] - start[1]) / (down[1] - y * down[2])
    return np.asarray(principal[0] + believed.focal_px * (start[0] + step * down[0]) / (start[2] + step * down[2]))


def upright(activity: Activity, columns_px: Array) -> Activity:
    """Activity (n, bands, width) read at columns (bands, width) of its view: leaning lines become columns."""
    bands, width = columns_px.shape
    x = columns_px.astype(np.float32)
    y = np.broadcast_to(np.arange(bands, dtype=np.float32)[:, None], (bands, width)).copy()
    return np.stack([cv2.remap(frame, x, y, cv2.INTER_LINEAR) for frame in activity])


def level_under(rig: Rig, believed: LevelPair, tilt_rad: Array) -> LevelPair:
    """The level pair of the tilted rig, with the believed one's focal length and principal points."""
    return replace(
        level_pair(tilted_rig(rig, believed, tilt_rad)),
        focal_px=believed.focal_px,
        principal_px=believed.principal_px,
        maps=believed.maps,
    )


def _level_axes(believed: LevelPair, turn: Array) -> Array:
    """Axes of the level pair once the rig has turned: its right follows the baseline's horizontal part."""
    x, y, _ = turn @ believed.axes[0]
    level = np.hypot(x, y)
    x, y, down = x / level, y / level, believed.axes[1, 2]  # down is along z
    return np.array([[x, y, 0.0], [0.0, 0.0, down], [y * down, -x * down, 0.0]])


def _turn(level: LevelPair, tilt_rad: Array) -> Array:
    """Ry(pitch) Rx(roll) about the axes forward, left, up of the level pair, (3, 3) in the frame of the results."""
    roll, pitch = tilt_rad
    forward_left_up = np.stack([level.axes[2], -level.axes[0], -level.axes[1]], axis=1)
    (sr, cr), (sp, cp) = (math.sin(roll), math.cos(roll)), (math.sin(pitch), math.cos(pitch))
    Ry_Rx = np.array([[cp, sp * sr, sp * cr], [0.0, cr, -sr], [-sp, cp * sr, cp * cr]])
    return np.asarray(forward_left_up @ Ry_Rx @ forward_left_up.T)
