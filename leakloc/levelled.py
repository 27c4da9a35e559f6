"""Two views as a level rig would have taken them: plumb lines are columns, and two columns are a place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from leakloc.background import Frames
from leakloc.rectify import MAX_GROWTH
from leakloc.rig import Array, Rig, RigError
from leakloc.triangulate import UNDISTORT

VIEWS = ("left", "right")
SAME_PX = 0.02  # a view that levelling would move by less is used as it is
SLOPE_STEP = 0.1  # px or m
UP = np.array([0.0, 0.0, 1.0])
LEAST_HORIZONTAL = 0.2  # share of the baseline: cameras above one another give no two columns


@dataclass(frozen=True, eq=False)
class LevelPair:
    """The level rig: both cameras look along `forward`, the horizontal part of the baseline lies along `right`.

    `axes` (3, 3): right, down, forward in the frame of the results; `centres_m` (2, 3): left and right camera there;
    `focal_px`; `principal_px` (2, 2): column and row where `forward` is seen, for each view; `baseline_m` along `right`
    from the left to the right camera, negative if the views are swapped. `maps` per view: the remapping of raw frames,
    None for a view that is level already.
    """

    axes: Array
    centres_m: Array
    focal_px: float
    principal_px: Array
    baseline_m: float
    image_size: tuple[int, int]
    maps: tuple[tuple[NDArray[np.int16], NDArray[np.uint16]] | None, ...]

    def columns_of(self, places_m: ArrayLike) -> Array:
        """Left and right column of plumb lines through places (n, 2) of the frame, (n, 2) px; NaN behind a camera."""
        across_m, ahead_m = self._across_ahead(places_m)
        columns = [
            np.where(ahead_m > 0, self.principal_px[view, 0] + self.focal_px * (across_m - shift_m) / ahead_m, np.nan)
            for view, shift_m in enumerate((0.0, self.baseline_m))
        ]
        return np.stack(columns, axis=-1)

    def places_of(self, columns_px: ArrayLike) -> Array:
        """Places (n, 2) in m where the columns (n, 2), left and right, meet; NaN where they do not meet ahead."""
        slopes = (np.asarray(columns_px, dtype=np.float64) - self.principal_px[:, 0]) / self.focal_px
        difference = slopes[..., 0] - slopes[..., 1]
        ahead_m = self.baseline_m / np.where(difference * self.baseline_m > 0, difference, np.nan)
        across_m = slopes[..., 0] * ahead_m
        return self.centres_m[0, :2] + across_m[..., None] * self.axes[0, :2] + ahead_m[..., None] * self.axes[2, :2]

    def place_slopes(self, columns_px: Array) -> Array:
        """Change of the place with either column, (2, 2) m per px, at columns (2,)."""
        return _slopes(self.places_of, columns_px)

    def column_slopes(self, place_m: Array) -> Array:
        """Change of both columns with the place, (2, 2) px per m, at a place (2,)."""
        return _slopes(self.columns_of, place_m)

    def depths_m(self, places_m: ArrayLike) -> Array:
        """Distance ahead of the baseline, (n,) m."""
        return self._across_ahead(places_m)[1]

    def _across_ahead(self, places_m: ArrayLike) -> tuple[Array, Array]:
        offset_m = np.asarray(places_m, dtype=np.float64) - self.centres_m[0, :2]
        return offset_m @ self.axes[0, :2], offset_m @ self.axes[2, :2]


def _slopes(function: Callable[[Array], Array], at: Array) -> Array:
    """Central differences of a function of points (n, 2)."""
    steps = SLOPE_STEP * np.eye(2)
    return np.stack([(function((at + s)[None])[0] - function((at - s)[None])[0]) / (2 * SLOPE_STEP) for s in steps], 1)


def level_pair(rig: Rig) -> LevelPair:
    """The level rig that stands where the believed rig stands (z of the frame is up).

    Raises RigError if the baseline is steep: plumb lines seen from two heights of one place give no depth.
    """
    from_frame = (rig.left_from_frame, rig.right_from_frame)
    centres_m = np.array([-motion[:3, :3].T @ motion[:3, 3] for motion in from_frame])
    axes = _level_axes(centres_m, from_frame)
    focal_px = float(np.mean([rig.K1[0, 0], rig.K2[0, 0]]))
    turns = [axes @ motion[:3, :3].T for motion in from_frame]  # level camera from raw camera
    lenses = ((rig.K1, rig.D1), (rig.K2, rig.D2))
    principal_px = np.array([_principal_px(*lens, turn, rig) for lens, turn in zip(lenses, turns, strict=True)])
    principal_px[:, 1] = principal_px[:, 1].mean()  # the same row in both
    image_size = rig.image_size
    if rig.D1.any() or rig.D2.any():
        ends = [_ends(*lens, turn, rig) for lens, turn in zip(lenses, turns, strict=True)]
        first_px, image_size = _holding(focal_px * np.array(ends) + principal_px[:, None], rig.image_size)
        principal_px -= first_px
    maps = tuple(
        _map(*lens, turn, (focal_px, principal, image_size))
        for lens, turn, principal in zip(lenses, turns, principal_px, strict=True)
    )
    baseline_m = float((centres_m[1] - centres_m[0]) @ axes[0])
    return LevelPair(axes, centres_m, focal_px, principal_px, baseline_m, image_size, maps)


def levelled_frames(frames: Frames, level: LevelPair, view: int) -> Frames:
    """The frames (n, height, width) of view 0 or 1 as the level camera sees them; what it alone sees is black."""
    maps = level.maps[view]
    if maps is None:
        return np.ascontiguousarray(frames)
    return np.stack([cv2.remap(np.ascontiguousarray(frame), *maps, cv2.INTER_LINEAR) for frame in frames])


def _level_axes(centres_m: Array, from_frame: tuple[Array, Array]) -> Array:
    """Right, down and forward of the level cameras, rows of (3, 3)."""
    baseline_m = centres_m[1] - centres_m[0]
    level_m = baseline_m - (baseline_m @ UP) * UP
    if np.linalg.norm(level_m) < LEAST_HORIZONTAL * np.linalg.norm(baseline_m):
        raise RigError(f"locate: the baseline must be more level than steep, got {baseline_m.tolist()} m (z is up)")
    right = level_m / np.linalg.norm(level_m)
    forward = np.cross(right, -UP)
    if forward @ (from_frame[0][2, :3] + from_frame[1][2, :3]) < 0:  # views are swapped
        right, forward = -right, -forward
    return np.stack([right, -UP, forward])


def _principal_px(K: Array, D: Array, turn: Array, rig: Rig) -> Array:
    """Principal point that keeps the middle of the raw image in the middle of the level one."""
    middle = np.array([(side - 1) / 2 for side in rig.image_size])
    ray = turn @ np.append(cv2.undistortPoints(middle[None, None], K, D)[0, 0], 1.0)
    focal_px = np.mean([rig.K1[0, 0], rig.K2[0, 0]])
    return np.asarray(middle - focal_px * ray[:2] / ray[2])


def _ends(K: Array, D: Array, turn: Array, rig: Rig) -> Array:
    """Slopes (4, 2) at which the level camera sees the ends of the raw image's middle row and column."""
    width, height = rig.image_size
    middle = (width - 1) / 2, (height - 1) / 2
    ends = np.array([[0, middle[1]], [width - 1, middle[1]], [middle[0], 0], [middle[0], height - 1]])
    straight = cv2.undistortPoints(ends[:, None], K, D, R=turn, criteria=UNDISTORT)[:, 0]
    return np.asarray(straight, dtype=np.float64)


def _holding(ends_px: Array, size_px: tuple[int, int]) -> tuple[Array, tuple[int, int]]:
    """First column and row, and size, of an image that holds both views' ends (2, 4, 2): a barrel lens sees beyond it.

    It never shrinks, and grows to MAX_GROWTH at most.
    """
    size, room = np.array(size_px), (MAX_GROWTH - 1) / 2 * np.array(size_px)
    first = np.floor(np.clip(np.nanmin(ends_px, axis=(0, 1)), -room, 0.0))
    last = np.ceil(np.clip(np.nanmax(ends_px, axis=(0, 1)), size - 1, size - 1 + room))
    width, height = (last - first).astype(int) + 1
    return first, (int(width), int(height))


def _map(
    K: Array, D: Array, turn: Array, camera: tuple[float, Array, tuple[int, int]]
) -> tuple[NDArray[np.int16], NDArray[np.uint16]] | None:
    focal_px, principal_px, (width, height) = camera
    level_K = np.array([[focal_px, 0, principal_px[0]], [0, focal_px, principal_px[1]], [0, 0, 1]])
    corners = np.array([[0, 0, 1], [width - 1, 0, 1], [0, height - 1, 1], [width - 1, height - 1, 1.0]]).T
    moved = level_K @ turn @ np.linalg.inv(K) @ corners
    if not D.any() and np.abs(moved[:2] / moved[2] - corners[:2]).max() < SAME_PX:  # lines stay lines: corners tell
        return None
    x, y = cv2.initUndistortRectifyMap(K, D, turn, level_K, (width, height), cv2.CV_32FC1)
    return cv2.convertMaps(x, y, cv2.CV_16SC2)  # type: ignore[return-value]
