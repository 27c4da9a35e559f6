"""Raw stereo frames to frames of two parallel cameras without distortion: rows agree and straight lines are straight.

Source: OpenCV's stereoRectify (Bouguet's method: both cameras turn by half of what parts them).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from leakloc.background import Frames
from leakloc.estimate import Estimate, LeakEstimate
from leakloc.rig import Rig, RigError
from leakloc.triangulate import UNDISTORT

Array = NDArray[np.float64]

PARALLEL = 1e-9  # largest entry of R - 1, and of T.y and T.z over T.x, in a rig that needs no rectification
NEWTON_STEPS = 20
ON_ROW_PX = 1e-6
SAME_COLUMN_PX = 1e-2
MAX_GROWTH = 1.5  # of width and height: beyond, the edges of a wide lens are cut off


@dataclass(frozen=True, eq=False)
class StraightView:
    """One camera before and after: raw matrix and distortion, the turn, and the matrix of the rectified image.

    X_rectified = `turn` (3, 3) X_raw about the camera's centre.
    """

    K: Array
    D: Array
    turn: Array
    K_rectified: Array

    def to_rectified(self, points_px: ArrayLike) -> Array:
        """Where points (n, 2) of the raw image lie in the rectified one, px."""
        points = np.asarray(points_px, dtype=np.float64).reshape(-1, 1, 2)
        if not len(points):
            return points[:, 0]
        straight = cv2.undistortPoints(points, self.K, self.D, R=self.turn, P=self.K_rectified, criteria=UNDISTORT)
        return straight[:, 0].astype(np.float64)

    def to_raw(self, points_px: ArrayLike) -> Array:
        """Where points (n, 2) of the rectified image lie in the raw one, px."""
        points = np.asarray(points_px, dtype=np.float64).reshape(-1, 2)
        if not len(points):
            return points
        homogeneous = np.column_stack([points, np.ones(len(points))])
        rays = homogeneous @ np.linalg.inv(self.K_rectified).T @ self.turn  # turn^T on the left of a column
        raw, _ = cv2.projectPoints(rays[:, None, :], np.zeros(3), np.zeros(3), self.K, self.D)
        return raw[:, 0].astype(np.float64)

    def raw_columns(self, columns_px: ArrayLike, height_px: int) -> Array:
        """Where rectified columns (n,) cross row (H - 1) / 2 of the raw image, px; NaN where they never do.

        Newton's steps down the column, from where the raw row is nearly the rectified one.
        """
        columns = np.asarray(columns_px, dtype=np.float64)
        middle = (height_px - 1) / 2
        rows = np.full_like(columns, middle)
        for _ in range(NEWTON_STEPS):
            raw, below = (self.to_raw(np.column_stack([columns, rows + step])) for step in (0.0, 1.0))
            with np.errstate(divide="ignore", invalid="ignore"):  # a column far outside has no such row
                rows = rows + (middle - raw[:, 1]) / (below[:, 1] - raw[:, 1])
        raw = self.to_raw(np.column_stack([columns, rows]))
        meets = np.abs(raw[:, 1] - middle) < ON_ROW_PX
        same = np.abs(self.to_rectified(raw)[:, 0] - columns) < SAME_COLUMN_PX  # far out a lens model folds back
        return np.where(meets & same, raw[:, 0], np.nan)


@dataclass(frozen=True, eq=False)
class Rectified:
    """Rectified frames and their rig, and what leads back.

    `left`, `right` (frames, height, width) of `rig`'s own size, 0 where the raw image does not reach; `rig` has no
    distortion and parallel cameras; its `world_from_left` is set so that positions are in the frame of `raw_rig`,
    whatever that is called. `views` are the left and the right camera's.
    """

    left: Frames
    right: Frames
    rig: Rig
    raw_rig: Rig
    views: tuple[StraightView, StraightView]

    def estimate_of_raw(self, estimate: Estimate) -> Estimate:
        """An estimate on the rectified frames as one on the raw frames: their columns, and the raw rig's frame.

        Positions and covariances stay; the deviation of a column is scaled as columns are there.
        """
        leaks = tuple(self._leak_of_raw(leak) for leak in estimate.leaks)
        return replace(estimate, frame=self.raw_rig.frame, leaks=leaks)

    def _leak_of_raw(self, leak: LeakEstimate) -> LeakEstimate:
        height_px = self.raw_rig.image_size[1]
        columns = (leak.left_column_px, leak.right_column_px)
        at = [
            view.raw_columns([column, column + 1.0], height_px)
            for view, column in zip(self.views, columns, strict=True)
        ]
        scale = float(np.mean([np.abs(pair[1] - pair[0]) for pair in at]))
        return replace(
            leak,
            left_column_px=float(at[0][0]),
            right_column_px=float(at[1][0]),
            column_sigma_px=leak.column_sigma_px * scale,
        )


def rectify(left: Frames, right: Frames, rig: Rig) -> Rectified:
    """Undistorted and rectified frames; the very same arrays if the rig needs nothing.

    left, right (frames, height, width) raw, of the rig's image size. The focal length stays about the same and the
    image grows or shrinks so that the raw images' middle rows and columns fit (`MAX_GROWTH`): an image of the same size
    would cut 20 px (k1 = -0.1) to 100 px (k1 = -0.3) off either side of the paper's. Raises ValueError for other sizes
    and RigError for cameras above each other, whose rows cannot be made to agree.
    """
    for name, frames in (("left", left), ("right", right)):
        if frames.ndim != 3 or (frames.shape[2], frames.shape[1]) != rig.image_size:
            raise ValueError(
                f"rectify: {name} must be (frames, height, width) of the rig's image_size {rig.image_size}, "
                f"got shape {frames.shape}"
            )
    straight, views = rectified_rig(rig)
    if straight is rig:
        return Rectified(left, right, rig, rig, views)
    left, right = (
        _remapped(frames, view, straight.image_size) for frames, view in zip((left, right), views, strict=True)
    )
    return Rectified(left, right, straight, rig, views)


def rectified_rig(rig: Rig) -> tuple[Rig, tuple[StraightView, StraightView]]:
    """The rig of the rectified images and how each view gets there; the rig itself if it needs nothing.

    Raises RigError as `rectify` does.
    """
    if is_rectified(rig):
        same = np.eye(3)
        return rig, (StraightView(rig.K1, rig.D1, same, rig.K1), StraightView(rig.K2, rig.D2, same, rig.K2))
    if abs(rig.T[1]) >= abs(rig.T[0]):
        raise RigError(f"T must be of cameras side by side (|T.x| > |T.y|) to be rectified, got {rig.T.tolist()}")
    turn1, turn2, P1, P2, *_ = cv2.stereoRectify(
        rig.K1, rig.D1, rig.K2, rig.D2, rig.image_size, rig.R, rig.T[:, None], flags=cv2.CALIB_ZERO_DISPARITY
    )
    left_from_straight = np.eye(4)
    left_from_straight[:3, :3] = turn1.T
    views, image_size = _fitted(
        StraightView(rig.K1, rig.D1, turn1.astype(np.float64), P1[:, :3].astype(np.float64)),
        StraightView(rig.K2, rig.D2, turn2.astype(np.float64), P2[:, :3].astype(np.float64)),
        rig.image_size,
    )
    undistorted = np.zeros(5)
    straight = replace(
        rig.of_known_place(),
        K1=views[0].K_rectified,
        D1=undistorted,
        K2=views[1].K_rectified,
        D2=undistorted,
        R=np.eye(3),
        T=np.array([P2[0, 3] / P2[0, 0], 0, 0]),
        image_size=image_size,
        world_from_left=rig.frame_from_left @ left_from_straight,
    )
    return straight, views


def is_rectified(rig: Rig) -> bool:
    """Whether rows of the raw images agree and lines are straight: no distortion or skew, parallel, one row scale."""
    return (
        not rig.D1.any()
        and not rig.D2.any()
        and not (rig.K1[0, 1] or rig.K2[0, 1])
        and np.array_equal(rig.K1[1], rig.K2[1])
        and bool(np.abs(rig.R - np.eye(3)).max() <= PARALLEL)
        and bool(np.abs(rig.T[1:]).max() <= PARALLEL * abs(rig.T[0]))
    )


def _fitted(
    left: StraightView, right: StraightView, raw_size: tuple[int, int]
) -> tuple[tuple[StraightView, StraightView], tuple[int, int]]:
    """Both views moved alike, so that rows still agree, into an image that holds their middle rows and columns."""
    width_px, height_px = raw_size
    middle = np.array([(width_px - 1) / 2, (height_px - 1) / 2])
    ends = np.array([[0, middle[1]], [width_px - 1, middle[1]], [middle[0], 0], [middle[0], height_px - 1]])
    there = np.stack([view.to_rectified(ends) for view in (left, right)])
    centre = np.array([view.to_rectified(middle)[0] for view in (left, right)]).mean(axis=0)
    reach = MAX_GROWTH / 2 * np.array(raw_size)
    first = np.floor(np.maximum([there[:, :2, 0].min(), there[:, 2:, 1].min()], centre - reach))
    last = np.ceil(np.minimum([there[:, :2, 0].max(), there[:, 2:, 1].max()], centre + reach))
    moved = np.array([[1, 0, -first[0]], [0, 1, -first[1]], [0, 0, 1]])
    views = (replace(left, K_rectified=moved @ left.K_rectified), replace(right, K_rectified=moved @ right.K_rectified))
    return views, (int(last[0] - first[0]) + 1, int(last[1] - first[1]) + 1)


def _remapped(frames: Frames, view: StraightView, size_px: tuple[int, int]) -> Frames:
    """Each rectified pixel from the raw place that it shows, between its four neighbours."""
    maps = cv2.initUndistortRectifyMap(view.K, view.D, view.turn, view.K_rectified, size_px, cv2.CV_32FC1)
    straight = np.empty((len(frames), size_px[1], size_px[0]), frames.dtype)
    for raw, out in zip(frames, straight, strict=True):
        cv2.remap(np.ascontiguousarray(raw), *maps, cv2.INTER_LINEAR, dst=out)
    return straight
