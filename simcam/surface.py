"""Where rays end on static surfaces: the pedestal in closed form, structure through Embree.

The cylinder is intersected analytically because a tessellated one has facets: at 5 m a 360-sided wall is off by up to
0.1 mm and, worse, its normals are, which shows as stripes; the closed form is exact and costs less than a ray query.
Arrays of points and directions are (3, n) float32 here: one contiguous row per axis.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from simcam.lens import FloatArray
from simcam.raycast import RayCaster, count_rays
from simcam.scene import Pedestal
from simcam.structures import IndexArray, Structure, join_meshes
from simcam.texture import SurfaceMaps

WALL, FLOOR, CEILING, STRUCTURE = 0, 1, 2, 3  # kinds of surface
REMAP_WIDTH = 1024  # cv2.remap takes images, no longer than 32767 along a side


@dataclass(frozen=True)
class Surface:
    """Points where rays ended: points_m, normals (3, n) towards the ray's side, distance_m, kind, face (n,)."""

    points_m: FloatArray
    normals: FloatArray
    distance_m: FloatArray
    kind: IndexArray
    face: IndexArray | None = None


@dataclass(frozen=True)
class Obstacles:
    """All structure of a scene as one mesh: caster; per face a unit normal, a reflectance and the structure's index;

    boxes_m (structures, 2, 3): lowest and highest corner of each.
    """

    caster: RayCaster
    normals: FloatArray
    reflectance: FloatArray
    structure: IndexArray
    boxes_m: FloatArray


def build_obstacles(structures: tuple[Structure, ...]) -> Obstacles | None:
    """One mesh of all structures; None when there are none. Raises ValueError for bad meshes."""
    if not structures:
        return None
    meshes = [structure.triangles() for structure in structures]
    vertices, faces = join_meshes(meshes)
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    reflectance = np.concatenate(
        [np.full(len(mesh[1]), structure.reflectance) for structure, mesh in zip(structures, meshes, strict=True)]
    )
    return Obstacles(
        RayCaster(vertices, faces),
        normals.astype(np.float32),
        reflectance.astype(np.float32),
        np.repeat(np.arange(len(meshes)), [len(mesh_faces) for _, mesh_faces in meshes]),
        np.array([[corners_m.min(axis=0), corners_m.max(axis=0)] for corners_m, _ in meshes]),
    )


def trace(pedestal: Pedestal, obstacles: Obstacles | None, origins_m: FloatArray, directions: FloatArray) -> Surface:
    """First static surface met by rays (3, n) from inside the pedestal; origins may be (3, 1)."""
    surface = hit_pedestal(pedestal, origins_m, directions)
    if obstacles is None:
        return surface
    return _nearer_structure(surface, obstacles, origins_m, directions)


def hit_pedestal(pedestal: Pedestal, origins_m: FloatArray, directions: FloatArray) -> Surface:
    """Closed-form exit of rays (3, n) through wall, floor or ceiling, seen from inside."""
    ox, oy, oz = np.asarray(origins_m, np.float32)
    dx, dy, dz = directions = np.asarray(directions, np.float32)
    count_rays(dx.size)
    horizontal = dx * dx + dy * dy
    along = ox * dx + oy * dy
    outside = ox * ox + oy * oy - np.float32(pedestal.radius_m**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        to_wall = (np.sqrt(np.maximum(along * along - horizontal * outside, 0)) - along) / horizontal
        cap_z = np.where(dz > 0, np.float32(pedestal.ceiling_z_m), np.float32(pedestal.floor_z_m))
        to_cap = np.where(dz != 0, (cap_z - oz) / dz, np.float32(np.inf))
    on_cap = ~(to_wall <= to_cap)
    distance = np.maximum(np.where(on_cap, to_cap, to_wall), 0).astype(np.float32)
    points = np.stack([ox + distance * dx, oy + distance * dy, oz + distance * dz])
    kind = np.where(on_cap, np.where(dz > 0, CEILING, FLOOR), WALL).astype(np.int8)
    inward = np.float32(-1.0 / pedestal.radius_m) * ~on_cap
    normals = np.stack([points[0] * inward, points[1] * inward, np.where(on_cap, -np.sign(dz), np.float32(0))])
    return Surface(points, normals, distance, kind)


def _nearer_structure(surface: Surface, obstacles: Obstacles, origins_m: FloatArray, directions: FloatArray) -> Surface:
    origins = np.broadcast_to(origins_m, directions.shape)
    hits = obstacles.caster.first_hits(np.ascontiguousarray(origins.T), np.ascontiguousarray(directions.T))
    near = hits.distance_m < surface.distance_m
    face = np.where(near, hits.face, -1)
    distance = np.where(near, hits.distance_m, surface.distance_m)
    hit = np.flatnonzero(near)
    points, normals = surface.points_m.copy(), surface.normals.copy()
    points[:, hit] = origins[:, hit] + distance[hit] * directions[:, hit]
    facing = obstacles.normals[face[hit]].T
    normals[:, hit] = facing * -np.sign(np.einsum("in,in->n", facing, directions[:, hit]))
    kind = np.where(near, np.int8(STRUCTURE), surface.kind)
    return Surface(points, normals, distance, kind, face)


class MapReader:
    """Bilinear look-up of wall, floor and ceiling maps at points of a pedestal; see `texture` for the maps' axes."""

    def __init__(self, pedestal: Pedestal, maps: SurfaceMaps) -> None:
        """Pad the wall by one column each side, so that interpolation runs round it."""
        self._pedestal = pedestal
        self._wall = np.pad(maps.wall, ((0, 0), (1, 1)), mode="wrap")
        self._discs = {FLOOR: maps.floor, CEILING: maps.ceiling}
        self._uniform = None
        if all(one.size == 1 and one.flat[0] == maps.wall.flat[0] for one in (maps.wall, maps.floor, maps.ceiling)):
            self._uniform = np.float32(maps.wall.flat[0])

    def read(self, surface: Surface) -> FloatArray:
        """Values (n,) at a surface's points; 0 on structure."""
        if self._uniform is not None:
            return np.where(surface.kind == STRUCTURE, np.float32(0), self._uniform)
        values = np.zeros(surface.kind.shape, np.float32)
        whole = bool((surface.kind == WALL).all())
        if whole:
            return self._read_wall(surface.points_m)
        for kind in (WALL, FLOOR, CEILING):
            here = np.flatnonzero(surface.kind == kind)
            if here.size:
                points_m = surface.points_m[:, here]
                values[here] = self._read_wall(points_m) if kind == WALL else self._read_disc(points_m, kind)
        return values

    def _read_wall(self, points_m: FloatArray) -> FloatArray:
        x, y, z = points_m
        rows, columns = self._wall.shape[0], self._wall.shape[1] - 2
        column = (np.arctan2(y, x) + np.float32(np.pi)) * np.float32(columns / (2 * np.pi)) + np.float32(0.5)
        row = (np.float32(self._pedestal.ceiling_z_m) - z) * np.float32(rows / self._pedestal.height_m) - np.float32(
            0.5
        )
        return read_map(self._wall, column, row)

    def _read_disc(self, points_m: FloatArray, kind: int) -> FloatArray:
        disc = self._discs[kind]
        scale = np.float32(disc.shape[0] / (2 * self._pedestal.radius_m))
        middle = np.float32((disc.shape[0] - 1) / 2)
        return read_map(disc, points_m[0] * scale + middle, middle - points_m[1] * scale)


def read_map(values: FloatArray, column: FloatArray, row: FloatArray) -> FloatArray:
    """Bilinear values (n,) of a float32 map at (column, row), clamped at its borders."""
    n = column.size
    padded = -(-n // REMAP_WIDTH) * REMAP_WIDTH
    coordinates = np.zeros((2, padded), np.float32)
    coordinates[0, :n], coordinates[1, :n] = column, row
    blocks = coordinates.reshape(2, -1, REMAP_WIDTH)
    picked = np.empty((padded // REMAP_WIDTH, REMAP_WIDTH), np.float32)
    for first in range(0, len(picked), 32000):
        part = slice(first, first + 32000)
        picked[part] = cv2.remap(
            values, blocks[0, part], blocks[1, part], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
    return picked.reshape(-1)[:n]
