"""Reflectance of the pedestal: uniform, procedural rust, or an image; read as maps of the unrolled surfaces.

A wall map (rows, columns) has its first row at the ceiling and runs once round, azimuth -pi to pi from left to right;
a floor or ceiling map covers the square |x|, |y| <= radius, first row at +y.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import cv2
import numpy as np

from simcam.lens import FloatArray

WALL_MAP_SHAPE = (1024, 2048)  # rows, columns: about 7 mm, one pixel of the paper's rig at the far wall
DISC_MAP_SIZE = 512
OCTAVES = 7


@dataclass(frozen=True)
class SurfaceMaps:
    """Reflectance maps float32 of wall, floor and ceiling; see the module for their axes."""

    wall: FloatArray
    floor: FloatArray
    ceiling: FloatArray


class Texture(Protocol):
    """Anything that paints the pedestal."""

    def maps(self) -> SurfaceMaps:
        """Reflectance maps of wall, floor and ceiling."""
        ...


@dataclass(frozen=True)
class UniformTexture:
    """The same diffuse reflectance everywhere."""

    reflectance: float = 0.3

    def __post_init__(self) -> None:
        """A reflectance of 1 or more would make light."""
        _check_reflectance("UniformTexture", self.reflectance)

    def maps(self) -> SurfaceMaps:
        """One-pixel maps."""
        pixel = np.full((1, 1), self.reflectance, np.float32)
        return SurfaceMaps(pixel, pixel, pixel)


@dataclass(frozen=True)
class RustTexture:
    """Blotches of rust on dark steel: fractal noise from a seed, between two diffuse reflectances."""

    seed: int = 0
    steel_reflectance: float = 0.12
    rust_reflectance: float = 0.45
    blotches_around: int = 8

    def __post_init__(self) -> None:
        """Check the reflectances."""
        _check_reflectance("RustTexture", self.steel_reflectance)
        _check_reflectance("RustTexture", self.rust_reflectance)
        if self.blotches_around < 1:
            raise ValueError(f"RustTexture: blotches_around must be >= 1, got {self.blotches_around}")

    def maps(self) -> SurfaceMaps:
        """Maps of the three surfaces, the same for the same seed; seamless round the wall."""
        return _rust_maps(self)


@dataclass(frozen=True, eq=False)
class ImageTexture:
    """A picture of the unrolled wall (rows, columns), reflectance 0 to 1; floor and ceiling uniform."""

    wall: FloatArray
    floor_reflectance: float = 0.3

    def __post_init__(self) -> None:
        """Check that every pixel is a reflectance."""
        wall = np.array(self.wall, np.float32)
        if wall.ndim != 2 or wall.size == 0:
            raise ValueError(f"ImageTexture: wall must be a grey image (rows, columns), got shape {wall.shape}")
        if not ((wall >= 0) & (wall < 1)).all():
            raise ValueError("ImageTexture: every wall reflectance must lie in [0, 1)")
        _check_reflectance("ImageTexture", self.floor_reflectance)
        wall.setflags(write=False)
        object.__setattr__(self, "wall", wall)

    def maps(self) -> SurfaceMaps:
        """The picture, and one-pixel maps for floor and ceiling."""
        disc = np.full((1, 1), self.floor_reflectance, np.float32)
        return SurfaceMaps(self.wall, disc, disc)


def _check_reflectance(who: str, value: float) -> None:
    if not 0 <= value < 1:
        raise ValueError(f"{who}: a reflectance must lie in [0, 1), got {value}")


@lru_cache(maxsize=8)
def _rust_maps(texture: RustTexture) -> SurfaceMaps:
    rng = np.random.default_rng(np.random.SeedSequence([texture.seed, 0x52555354]))
    rows, columns = WALL_MAP_SHAPE
    blotches = texture.blotches_around
    wall = _fractal_noise(WALL_MAP_SHAPE, (max(1, blotches * rows // columns), blotches), rng=rng)
    discs = [_fractal_noise((DISC_MAP_SIZE, DISC_MAP_SIZE), (max(1, blotches // 3),) * 2, rng=rng) for _ in range(2)]
    return SurfaceMaps(*(_rusted(texture, noise) for noise in (wall, *discs)))


def _rusted(texture: RustTexture, noise: FloatArray) -> FloatArray:
    """Noise of unit deviation to reflectance: a smooth step that saturates in bare steel and in full rust."""
    rust = np.clip(0.5 + 0.25 * noise, 0.0, 1.0)
    rust = rust * rust * (3.0 - 2.0 * rust)
    span = texture.rust_reflectance - texture.steel_reflectance
    return (texture.steel_reflectance + span * rust).astype(np.float32)


def _fractal_noise(shape: tuple[int, int], cells: tuple[int, int], *, rng: np.random.Generator) -> FloatArray:
    """Octaves of smooth noise, finer ones weaker; periodic in the columns; mean 0, deviation 1."""
    total = np.zeros(shape, np.float32)
    for octave in range(OCTAVES):
        grid_rows, grid_columns = cells[0] << octave, cells[1] << octave
        if grid_rows > shape[0] // 2 or grid_columns > shape[1] // 2:
            break
        total += _smooth_noise(shape, (grid_rows, grid_columns), rng=rng) * np.float32(0.6**octave)
    total -= total.mean()
    return total / max(float(total.std()), 1e-12)


def _smooth_noise(shape: tuple[int, int], cells: tuple[int, int], *, rng: np.random.Generator) -> FloatArray:
    """White noise on a grid, enlarged by cubic interpolation; the grid is wrapped so that left meets right."""
    margin = 3
    grid = rng.standard_normal(cells).astype(np.float32)
    grid = np.pad(grid, ((margin, margin), (margin, margin)), mode="wrap")
    step_rows, step_columns = -(-shape[0] // cells[0]), -(-shape[1] // cells[1])
    enlarged = cv2.resize(grid, None, fx=step_columns, fy=step_rows, interpolation=cv2.INTER_CUBIC)
    first_row, first_column = margin * step_rows, margin * step_columns
    return np.asarray(enlarged[first_row : first_row + shape[0], first_column : first_column + shape[1]])
