"""Structure inside the pedestal, as triangles: boxes, pipes, gratings by their sizes, or any mesh.

Every structure has `reflectance` (diffuse) and `triangles()` -> vertices (n, 3) in world metres, faces (m, 3).
"""

import io
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from simcam.lens import FloatArray

IndexArray = NDArray[Any]  # integers of any width
MAX_FACES = 5_000_000  # Embree's tree takes about 100 bytes a face: half a gigabyte
MAX_MESH_BYTES = 50_000_000  # of binary STL, a million faces
MESH_KINDS = ("stl", "ply", "obj", "off")  # glTF claims arrays of any size in a few bytes, archives unpack to any
MAX_EXTENT_M = 1000.0  # a mesh in millimetres is the usual cause
PIPE_SIDES = 48

BOX_CORNERS = np.array([[i, j, k] for i in (-0.5, 0.5) for j in (-0.5, 0.5) for k in (-0.5, 0.5)])
BOX_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


class Structure(Protocol):
    """Anything that can be hit by a ray."""

    @property
    def reflectance(self) -> float:
        """Diffuse reflectance."""
        ...

    def triangles(self) -> tuple[FloatArray, IndexArray]:
        """Vertices (n, 3) in world metres and faces (m, 3)."""
        ...


@dataclass(frozen=True)
class Box:
    """A cuboid: a beam, a plate. `size_m` along its own axes, turned by `yaw_deg` about the vertical."""

    centre_m: tuple[float, float, float]
    size_m: tuple[float, float, float]
    yaw_deg: float = 0.0
    reflectance: float = 0.2

    def __post_init__(self) -> None:
        """Check the size."""
        _check_positive("Box", "size_m", self.size_m)

    def triangles(self) -> tuple[FloatArray, IndexArray]:
        """Eight corners, twelve faces."""
        cos, sin = np.cos(np.radians(self.yaw_deg)), np.sin(np.radians(self.yaw_deg))
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        return (BOX_CORNERS * self.size_m) @ turn.T + self.centre_m, BOX_FACES


@dataclass(frozen=True)
class Pipe:
    """A solid cylinder between two points, with flat ends."""

    start_m: tuple[float, float, float]
    end_m: tuple[float, float, float]
    radius_m: float
    reflectance: float = 0.2

    def __post_init__(self) -> None:
        """Check the size."""
        _check_positive("Pipe", "radius_m", (self.radius_m,))
        if not np.linalg.norm(np.subtract(self.end_m, self.start_m)) > 0:
            raise ValueError(f"Pipe: start_m and end_m must differ, got {self.start_m} twice")

    def triangles(self) -> tuple[FloatArray, IndexArray]:
        """A prism of 48 sides whose cross-section has the circle's area."""
        start, end = np.asarray(self.start_m, float), np.asarray(self.end_m, float)
        axis = (end - start) / np.linalg.norm(end - start)
        across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        across /= np.linalg.norm(across)
        angle = 2 * np.pi * np.arange(PIPE_SIDES) / PIPE_SIDES
        rim_m = self.radius_m * np.sqrt(2 * np.pi / PIPE_SIDES / np.sin(2 * np.pi / PIPE_SIDES))
        ring = rim_m * (np.outer(np.cos(angle), across) + np.outer(np.sin(angle), np.cross(axis, across)))
        vertices = np.concatenate([start + ring, end + ring, [start, end]])
        here = np.arange(PIPE_SIDES)
        there = (here + 1) % PIPE_SIDES
        low_cap, high_cap = np.full(PIPE_SIDES, 2 * PIPE_SIDES), np.full(PIPE_SIDES, 2 * PIPE_SIDES + 1)
        corners = [
            (here, there, there + PIPE_SIDES),
            (here, there + PIPE_SIDES, here + PIPE_SIDES),
            (low_cap, there, here),
            (high_cap, here + PIPE_SIDES, there + PIPE_SIDES),
        ]
        return vertices, np.concatenate([np.stack(triple, axis=1) for triple in corners])


@dataclass(frozen=True)
class Grating:
    """A level walkway grating: square bars every `pitch_m` along both sides of a rectangle, centred on `centre_m`."""

    centre_m: tuple[float, float, float]
    size_m: tuple[float, float]
    pitch_m: float = 0.1
    bar_m: float = 0.01
    reflectance: float = 0.2

    def __post_init__(self) -> None:
        """Check the sizes."""
        _check_positive("Grating", "size_m", self.size_m)
        _check_positive("Grating", "pitch_m and bar_m", (self.pitch_m, self.bar_m))
        if self.bar_m >= self.pitch_m:
            raise ValueError(f"Grating: bar_m must be < pitch_m, got {self.bar_m} and {self.pitch_m}")

    def triangles(self) -> tuple[FloatArray, IndexArray]:
        """One box per bar."""
        length, width = self.size_m
        bars = [
            Box((0.0, y, 0.0), (length, self.bar_m, self.bar_m)).triangles() for y in _bar_places(width, self.pitch_m)
        ] + [Box((x, 0.0, 0.0), (self.bar_m, width, self.bar_m)).triangles() for x in _bar_places(length, self.pitch_m)]
        vertices, faces = join_meshes(bars)
        return vertices + np.asarray(self.centre_m), faces


@dataclass(frozen=True, eq=False)
class Mesh:
    """Any triangles: vertices (n, 3) in world metres, faces (m, 3)."""

    vertices_m: FloatArray
    faces: IndexArray
    reflectance: float = 0.2
    name: str = "mesh"

    def __post_init__(self) -> None:
        """Check everything that a ray caster would swallow silently."""
        check_mesh(self.vertices_m, self.faces, self.name)

    def triangles(self) -> tuple[FloatArray, IndexArray]:
        """The triangles as given."""
        return np.asarray(self.vertices_m, float), np.asarray(self.faces)


def mesh_file(path: str | Path, *, scale: float = 1.0, reflectance: float = 0.2) -> Mesh:
    """Read a mesh file, STL, PLY, OBJ or OFF, in metres after `scale`, in world axes; it can name no other file.

    Raises ValueError for what is no regular file of one of these kinds and at most 50 MB, cannot be read, has no faces,
    NaN vertices, or is larger than a kilometre.
    """
    import trimesh  # here: it is slow to import and only mesh files need it

    kind = Path(path).suffix.lower().removeprefix(".")
    if kind not in MESH_KINDS:
        raise ValueError(f"{path}: must be a mesh file of a kind of {', '.join(MESH_KINDS)}")
    try:
        loaded = trimesh.load(io.BytesIO(_mesh_bytes(Path(path))), file_type=kind, force="mesh", process=False)
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from None
    except Exception as error:  # trimesh raises whatever its readers raise
        reason = f": {error}" if isinstance(error, ValueError) else ""
        raise ValueError(f"{path}: not a mesh that can be read{reason:.200}") from error
    vertices = np.asarray(getattr(loaded, "vertices", np.zeros((0, 3))), float) * scale
    return Mesh(vertices, np.asarray(getattr(loaded, "faces", np.zeros((0, 3), int))), reflectance, str(path))


def _mesh_bytes(path: Path) -> bytes:
    """Content of a regular file of bearable size: a pipe would hang, a device has no end."""
    if os.path.lexists(path) and not os.path.isfile(path):
        raise ValueError("must be a regular file")
    with path.open("rb") as file:
        content = file.read(MAX_MESH_BYTES + 1)
    if len(content) > MAX_MESH_BYTES:
        raise ValueError(f"must be at most {MAX_MESH_BYTES} bytes; simplify it first")
    return content


def check_mesh(vertices_m: FloatArray, faces: IndexArray, name: str) -> None:
    """Raise ValueError unless the triangles are finite, of sane size, and index their vertices."""
    vertices, faces = np.asarray(vertices_m), np.asarray(faces)
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise ValueError(f"{name}: vertices must have shape (n, 3), got {vertices.shape}")
    if faces.ndim != 2 or faces.shape[1] != 3 or not np.issubdtype(faces.dtype, np.integer):
        raise ValueError(f"{name}: faces must be integers of shape (m, 3), got {faces.dtype} {faces.shape}")
    if len(faces) == 0:
        raise ValueError(f"{name}: the mesh has no faces")
    if len(faces) > MAX_FACES:
        raise ValueError(f"{name}: the mesh has {len(faces)} faces, more than {MAX_FACES}; simplify it first")
    if not np.isfinite(vertices).all():
        raise ValueError(f"{name}: {int((~np.isfinite(vertices)).any(axis=1).sum())} vertices are NaN or infinite")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise ValueError(f"{name}: faces index vertices {faces.min()}..{faces.max()} of {len(vertices)}")
    if np.abs(vertices).max() > MAX_EXTENT_M:
        raise ValueError(f"{name}: a vertex is {np.abs(vertices).max():.0f} m away; is the mesh in millimetres?")


def join_meshes(meshes: list[tuple[FloatArray, IndexArray]]) -> tuple[FloatArray, IndexArray]:
    """One mesh of several: vertices stacked, faces re-indexed."""
    first = np.cumsum([0] + [len(vertices) for vertices, _ in meshes[:-1]])
    vertices = np.concatenate([vertices for vertices, _ in meshes])
    return vertices, np.concatenate([faces + start for (_, faces), start in zip(meshes, first, strict=True)])


def _bar_places(length_m: float, pitch_m: float) -> FloatArray:
    count = int(length_m / pitch_m + 1e-9) + 1
    return (np.arange(count) - (count - 1) / 2) * pitch_m


def _check_positive(who: str, name: str, values: tuple[float, ...]) -> None:
    if not all(0 < value < np.inf for value in values):
        raise ValueError(f"{who}: {name} must be > 0 and finite, got {values}")
