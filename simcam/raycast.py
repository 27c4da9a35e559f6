"""The only user of Embree: every array is checked before it, because a wrong shape there crashes or gives garbage.

Embree answers in float32, drops NaN vertices and bad indices silently, ignores meshes added after the first query and
writes into a distances argument. Here a mesh is complete when it is built, and every ray counts in `rays_cast()`.
"""

import threading
from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from simcam.lens import FloatArray
from simcam.structures import IndexArray, check_mesh

NO_HIT = -1


@dataclass(frozen=True)
class Hits:
    """First hits of n rays: distance_m (n,) inf for none, face (n,) -1 for none."""

    distance_m: FloatArray
    face: IndexArray


class RayCaster:
    """Triangles ready for ray queries, in world metres."""

    def __init__(self, vertices_m: FloatArray, faces: IndexArray) -> None:
        """Build Embree's tree; raises ValueError for triangles that it would swallow silently."""
        check_mesh(vertices_m, faces, "RayCaster")
        self.vertices_m = np.ascontiguousarray(vertices_m, np.float32)
        self.faces = np.ascontiguousarray(faces, np.int32)
        self._scene = EmbreeScene()  # robust mode is its default
        self._mesh = TriangleMesh(self._scene, self.vertices_m, self.faces)

    def first_hits(self, origins_m: FloatArray, directions: FloatArray) -> Hits:
        """Nearest triangle along rays (n, 3); distances in units of the direction's length."""
        origins_m, directions = _checked_rays(origins_m, directions)
        if len(origins_m) == 0:
            return Hits(np.zeros(0, np.float32), np.zeros(0, np.int32))
        answer = self._scene.run(origins_m, directions, output=1)
        face = answer["primID"]
        return Hits(np.where(face == NO_HIT, np.float32(np.inf), answer["tfar"]), face)

    def blocked(self, origins_m: FloatArray, targets_m: FloatArray) -> NDArray[np.bool_]:
        """Whether a triangle lies strictly between each origin and its target, both (n, 3).

        A thousandth of the segment is left free at both ends, so that a surface does not shadow itself.
        """
        segments = np.asarray(targets_m) - np.asarray(origins_m)
        starts, segments = _checked_rays(np.asarray(origins_m) + SELF_HIT * segments, segments)
        if len(starts) == 0:
            return np.zeros(0, bool)
        distance = self._scene.run(starts, segments, query="DISTANCE")
        return np.asarray(distance < 1.0 - 2 * SELF_HIT)


SELF_HIT = 1e-3  # of a segment's length: 5 mm at 5 m, above the float32 error of Embree's hits

_count = threading.Lock()
_rays_cast = 0


def rays_cast() -> int:
    """Rays sent at static surfaces since the process started, by Embree or by closed form."""
    return _rays_cast


def count_rays(number: int) -> None:
    """Add rays to the count of `rays_cast`; thread-safe."""
    global _rays_cast
    with _count:
        _rays_cast += number


def _checked_rays(origins_m: FloatArray, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
    origins_m, directions = np.asarray(origins_m), np.asarray(directions)
    if origins_m.ndim != 2 or origins_m.shape[1] != 3 or origins_m.shape != directions.shape:
        raise ValueError(f"rays need origins and directions of shape (n, 3), got {origins_m.shape} {directions.shape}")
    origins_m = np.ascontiguousarray(origins_m, np.float32)
    directions = np.ascontiguousarray(directions, np.float32)
    if not (np.isfinite(origins_m).all() and np.isfinite(directions).all()):
        raise ValueError("rays must be finite: an origin or a direction is NaN or infinite")
    if not directions.any(axis=1).all():
        raise ValueError("rays need a direction: one has length 0")
    count_rays(len(origins_m))
    return origins_m, directions
