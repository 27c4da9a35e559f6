"""Light passed on between the walls: radiosity of the empty cylinder on a few hundred patches.

Structure neither blocks nor passes on bounced light. Source: Goral et al. 1984; form factors between patch centres,
rows scaled to sum to one (the cylinder is closed), so that no light is lost or made.
"""

from dataclasses import dataclass

import numpy as np

from simcam.lens import FloatArray
from simcam.light import open_irradiance
from simcam.scene import Lamp, Pedestal
from simcam.surface import CEILING, FLOOR, WALL, MapReader, Surface
from simcam.texture import SurfaceMaps

WALL_PATCHES = (14, 36)  # rows, columns: half a metre in the paper's pedestal
DISC_PATCHES = 10  # along a side of the square round floor and ceiling
FINE = 12  # direct light is averaged over FINE x FINE points of a patch: a lamp may hang 0.2 m from the wall


@dataclass(frozen=True)
class Patches:
    """Centres, normals (3, n), areas and kinds (n,) of the cylinder's patches: wall, floor, ceiling."""

    surface: Surface
    area_m2: FloatArray


def bounced_irradiance(
    pedestal: Pedestal, lamps: tuple[Lamp, ...], reflectance: MapReader, bounces: int
) -> SurfaceMaps:
    """Irradiance maps W/m^2 of light that met a wall 1 to `bounces` times before; zero maps for 0 bounces."""
    patches, fine = _patches(pedestal, 1), _patches(pedestal, FINE)
    passed_on = reflectance.read(fine.surface)
    albedo = _patch_means(fine, passed_on)
    direct = np.zeros(passed_on.shape, np.float32)
    for lamp in lamps:
        direct += open_irradiance(lamp, fine.surface.points_m, fine.surface.normals)
    given_w_m2 = _patch_means(fine, direct * passed_on)  # radiosity under direct light alone
    exchange = _form_factors(patches)
    arriving = np.zeros(len(patches.area_m2))
    for _ in range(bounces):
        arriving = exchange @ (given_w_m2 + albedo * arriving)
    return _as_maps(arriving.astype(np.float32))


def _form_factors(patches: Patches) -> FloatArray:
    """F (n, n): share of patch j's radiosity in patch i's irradiance, cos cos A_j / (pi r^2), rows summing to one."""
    points, normals = patches.surface.points_m.astype(float), patches.surface.normals.astype(float)
    between = points[:, None, :] - points[:, :, None]  # from i to j
    squared = np.einsum("kij,kij->ij", between, between)
    squared[squared == 0] = np.inf  # a patch and itself, and rim cells without area that coincide
    leaving = np.einsum("kij,ki->ij", between, normals)
    landing = -np.einsum("kij,kj->ij", between, normals)
    factors = np.maximum(leaving, 0) * np.maximum(landing, 0) * patches.area_m2 / (np.pi * squared**2)
    return factors / factors.sum(axis=1, keepdims=True)


def _patches(pedestal: Pedestal, fine: int) -> Patches:
    """Patches split `fine` times along each side; cells outside the disc have no area and lie on its rim."""
    rows, columns = WALL_PATCHES[0] * fine, WALL_PATCHES[1] * fine
    azimuth = -np.pi + (np.arange(columns) + 0.5) * 2 * np.pi / columns
    height = pedestal.ceiling_z_m - (np.arange(rows) + 0.5) * pedestal.height_m / rows
    height, azimuth = (axis.ravel() for axis in np.meshgrid(height, azimuth, indexing="ij"))
    wall = np.stack([pedestal.radius_m * np.cos(azimuth), pedestal.radius_m * np.sin(azimuth), height])
    wall_normals = np.stack([-np.cos(azimuth), -np.sin(azimuth), np.zeros_like(azimuth)])
    wall_area = np.full(rows * columns, 2 * np.pi * pedestal.radius_m * pedestal.height_m / (rows * columns))
    x, y, disc_area = _disc_cells(pedestal.radius_m, DISC_PATCHES * fine)
    points, normals, areas, kinds = [wall], [wall_normals], [wall_area], [np.full(rows * columns, WALL)]
    for kind, z, up in ((FLOOR, pedestal.floor_z_m, 1.0), (CEILING, pedestal.ceiling_z_m, -1.0)):
        points.append(np.stack([x, y, np.full_like(x, z)]))
        normals.append(np.stack([np.zeros_like(x), np.zeros_like(x), np.full_like(x, up)]))
        areas.append(disc_area)
        kinds.append(np.full(x.size, kind))
    centres, normal = np.concatenate(points, axis=1), np.concatenate(normals, axis=1)
    area = np.concatenate(areas)
    surface = Surface(
        centres.astype(np.float32),
        normal.astype(np.float32),
        np.zeros(area.size),
        np.concatenate(kinds).astype(np.int8),
    )
    return Patches(surface, area)


def _disc_cells(radius_m: float, cells: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Centres x, y of square cells over a disc, first row at +y, and their areas inside it."""
    place = (np.arange(cells) + 0.5) * 2 * radius_m / cells - radius_m
    y, x = (axis.ravel() for axis in np.meshgrid(-place, place, indexing="ij"))
    side = 2 * radius_m / cells
    inset = (np.arange(8) + 0.5) / 8 * side - side / 2
    inside = np.hypot(x[:, None, None] + inset[:, None], y[:, None, None] + inset) < radius_m
    area = inside.mean(axis=(1, 2)) * side**2
    pull = np.minimum(1.0, 0.98 * radius_m / np.maximum(np.hypot(x, y), 1e-9))
    return x * pull, y * pull, area


def _patch_means(fine: Patches, fine_values: FloatArray) -> FloatArray:
    """Area means of values on the fine cells, one per patch."""
    area = fine.area_m2
    n_wall = WALL_PATCHES[0] * WALL_PATCHES[1] * FINE**2
    blocks = [(0, WALL_PATCHES), (n_wall, (DISC_PATCHES, DISC_PATCHES))]
    blocks.append((n_wall + (DISC_PATCHES * FINE) ** 2, (DISC_PATCHES, DISC_PATCHES)))
    means = []
    for first, (rows, columns) in blocks:
        part = slice(first, first + rows * columns * FINE**2)
        weight = area[part].reshape(rows, FINE, columns, FINE).sum(axis=(1, 3))
        total = (fine_values[part] * area[part]).reshape(rows, FINE, columns, FINE).sum(axis=(1, 3))
        means.append(np.divide(total, weight, out=np.zeros_like(total), where=weight > 0).ravel())
    return np.concatenate(means)


def _as_maps(values: FloatArray) -> SurfaceMaps:
    n_wall, n_disc = WALL_PATCHES[0] * WALL_PATCHES[1], DISC_PATCHES**2
    return SurfaceMaps(
        values[:n_wall].reshape(WALL_PATCHES),
        values[n_wall : n_wall + n_disc].reshape(DISC_PATCHES, DISC_PATCHES),
        values[n_wall + n_disc :].reshape(DISC_PATCHES, DISC_PATCHES),
    )
