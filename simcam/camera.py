"""One pin-hole camera with a Brown lens: pose, projection and un-projection.

Camera axes: x right, y down, z forward. The centre of the top-left pixel is (0, 0).
"""

from dataclasses import dataclass

import numpy as np

from simcam.lens import FloatArray, distort, undistort, unfolded


@dataclass(frozen=True, eq=False)
class Camera:
    """A pin-hole camera with Brown distortion.

    `camera_matrix` (3, 3) in px, `distortion` (5,) k1 k2 p1 p2 k3, `world_from_camera` (4, 4) in metres.
    """

    width_px: int
    height_px: int
    camera_matrix: FloatArray
    distortion: FloatArray
    world_from_camera: FloatArray

    def __post_init__(self) -> None:
        """Check sizes and that the pose is a rotation."""
        if self.width_px < 1 or self.height_px < 1:
            raise ValueError(f"Camera: the image must be at least 1 x 1 px, got {self.width_px} x {self.height_px}")
        shapes = {"camera_matrix": (3, 3), "distortion": (5,), "world_from_camera": (4, 4)}
        for name, shape in shapes.items():
            value = np.array(getattr(self, name), float)
            if value.shape != shape or not np.isfinite(value).all():
                raise ValueError(f"Camera: {name} must be finite with shape {shape}, got shape {value.shape}")
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        rotation = self.rotation
        if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6) or np.linalg.det(rotation) < 0:
            raise ValueError("Camera: world_from_camera must hold a rotation (orthonormal, determinant +1)")

    @property
    def rotation(self) -> FloatArray:
        """World from camera rotation (3, 3)."""
        return self.world_from_camera[:3, :3]

    @property
    def centre_world_m(self) -> FloatArray:
        """Centre of projection (3,) in the world."""
        return self.world_from_camera[:3, 3]

    @property
    def middle_px(self) -> FloatArray:
        """Middle (2,) of the image: (W - 1) / 2, (H - 1) / 2."""
        return np.array([self.width_px - 1, self.height_px - 1]) / 2

    def depth(self, points_world_m: FloatArray) -> FloatArray:
        """Distance in metres along the optical axis of points (..., 3)."""
        return (np.asarray(points_world_m) - self.centre_world_m) @ self.rotation[:, 2]

    def project(self, points_world_m: FloatArray) -> FloatArray:
        """Pixels (..., 2) = (u_px, v_px) of world points (..., 3); NaN behind the camera or beyond the lens's fold."""
        points_camera_m = (np.asarray(points_world_m, float) - self.centre_world_m) @ self.rotation
        depth_m = points_camera_m[..., 2:]
        with np.errstate(divide="ignore", invalid="ignore"):
            normalised = np.where(depth_m > 0, points_camera_m[..., :2] / depth_m, np.nan)
        if self.distortion.any():
            seen = unfolded(normalised, self.distortion)[..., None]
            normalised = np.where(seen, distort(normalised, self.distortion), np.nan)
        return normalised @ self.camera_matrix[:2, :2].T + self.camera_matrix[:2, 2]

    def rays(self, pixels_px: FloatArray) -> FloatArray:
        """Unit directions (..., 3) in the world of the rays through pixels (..., 2); exact inverse of `project`.

        NaN where the distortion model folds and no ray meets the pixel.
        """
        inverse = np.linalg.inv(self.camera_matrix[:2, :2])
        distorted = (np.asarray(pixels_px, float) - self.camera_matrix[:2, 2]) @ inverse.T
        normalised = undistort(distorted, self.distortion)
        x, y = normalised[..., 0], normalised[..., 1]
        scale = 1.0 / np.sqrt(1.0 + x * x + y * y)
        camera_directions = np.stack([x * scale, y * scale, scale], axis=-1)
        return camera_directions @ self.rotation.T

    def pixel_rays(self) -> FloatArray:
        """Unit directions (height, width, 3) in the world through the centre of every pixel."""
        columns, rows = np.arange(self.width_px, dtype=float), np.arange(self.height_px, dtype=float)
        return self.rays(np.stack(np.meshgrid(columns, rows), axis=-1))
