"""A rig that leans against gravity: where its plumb lines run in views that were believed level."""

from __future__ import annotations

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
    """Columns of the believed-level view where plumb lines cross its rows, (..., rows, columns) px.

    `columns_px` are the lines' columns in the truly level view of the same camera (same focal length and principal
    point); tilt_rad (..., 2) rolls and pitches. Every point of a plumb line lies in one vertical plane with the camera,
    which the view cuts in a straight line: with the horizon's ray (across, below, ahead) and the plumb line's direction
    (right, down, forward), x = (across down - below right + y (ahead right - across forward)) / (ahead down - below
    forward).
    """
    turn = _turn(believed, tilt_rad)
    believed_from_true = believed.axes @ np.swapaxes(_level_axes(believed, turn) @ turn, -1, -2)
    principal = believed.principal_px[view]
    x = (np.asarray(columns_px) - principal[0]) / believed.focal_px
    y = (np.asarray(rows_px)[:, None] - principal[1]) / believed.focal_px
    horizon = believed_from_true @ np.stack([x, np.zeros_like(x), np.ones_like(x)])
    across, below, ahead = (horizon[..., i, None, :] for i in range(3))
    right, down, forward = (believed_from_true[..., i, 1, None, None] for i in range(3))
    focal_over = believed.focal_px / (ahead * down - below * forward)
    middle_px = principal[0] + focal_over * (across * down - below * right)
    return np.asarray(middle_px + y * (focal_over * (ahead * right - across * forward)))


def upright(activity: Activity, columns_px: Array) -> Activity:
    """Activity (n, bands, width) read at columns (bands, width) of its view: leaning lines become columns."""
    bands, width = columns_px.shape
    x = columns_px.astype(np.float32)
    y = np.broadcast_to(np.arange(bands, dtype=np.float32)[:, None], (bands, width)).copy()
    return np.stack([cv2.remap(frame, x, y, cv2.INTER_LINEAR) for frame in activity])


def level_under(rig: Rig, believed: LevelPair, tilt_rad: Array) -> LevelPair:
    """The level pair of the tilted rig, with the believed one's focal length, principal points and size."""
    return replace(
        level_pair(tilted_rig(rig, believed, tilt_rad)),
        focal_px=believed.focal_px,
        principal_px=believed.principal_px,
        image_size=believed.image_size,
        maps=believed.maps,
    )


def _level_axes(believed: LevelPair, turn: Array) -> Array:
    """Axes (..., 3, 3) of the level pair once the rig has turned: its right follows the baseline's horizontal part."""
    right = turn @ believed.axes[0]
    level = np.hypot(right[..., 0], right[..., 1])
    x, y, zero, down = right[..., 0] / level, right[..., 1] / level, np.zeros_like(level), believed.axes[1, 2]
    rows = [[x, y, zero], [zero, zero, zero + down], [y * down, -x * down, zero]]  # down is along z
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def _turn(level: LevelPair, tilt_rad: Array) -> Array:
    """Ry(pitch) Rx(roll) about the axes forward, left, up of the level pair, (..., 3, 3), in the results' frame."""
    roll, pitch = np.moveaxis(np.asarray(tilt_rad, dtype=np.float64), -1, 0)
    forward_left_up = np.stack([level.axes[2], -level.axes[0], -level.axes[1]], axis=1)
    sr, cr, sp, cp, zero = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch), np.zeros_like(roll)
    rows = [[cp, sp * sr, sp * cr], [zero, cr, -sr], [-sp, cp * sr, cp * cr]]
    return np.asarray(forward_left_up @ np.moveaxis(np.array(rows), (0, 1), (-2, -1)) @ forward_left_up.T)
