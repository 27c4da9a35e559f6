"""The definition that simcam's fast path is held to: every ray of every frame, at many moments of the exposure.

A pixel's static radiance is taken at its centre, shadows and drops by a grid of rays over the pixel's square, each drop
ray through the sphere on its own way; only the lamps' images in a drop, a hundredth of a pixel wide, are placed in
closed form, at every moment anew. Nothing that moves is kept, interpolated, tabulated or swept.
"""

import numpy as np

from simcam.dropview import drop_glints, own_shadow
from simcam.fall import fall_depth
from simcam.optics import ORDERS, path_through_drop
from simcam.path import _followed, landing_m
from simcam.static import cast_view, light_scene
from simcam.surface import Surface

SHADOW_PLACES = (-1 / 3, 0.0, 1 / 3)  # px


class BruteForce:
    """Renders frames of one camera with `moments` per exposure and `across` x `across` rays per pixel."""

    def __init__(self, scene, camera, recording, moments=64, across=4):
        self.scene, self.camera, self.recording = scene, camera, recording
        self.moments, self.across = moments, across
        self.lit = light_scene(scene)
        self.view = cast_view(self.lit, camera)
        self.places = self._places()
        self.landings = [landing_m(self.lit, leak) for leak in scene.leaks]

    def _places(self):
        """What the pixels see at SHADOW_PLACES beside their centres, one place of all pixels after the other."""
        rows, columns, below, right = np.ix_(
            *(np.arange(side) for side in (self.camera.height_px, self.camera.width_px)), SHADOW_PLACES, SHADOW_PLACES
        )
        pixels = np.stack(np.broadcast_arrays(columns + right, rows + below), axis=-1)
        rays = self.camera.rays(pixels.transpose(2, 3, 0, 1, 4)).reshape(-1, 3).T.astype(np.float32)
        return self.lit.look(self.camera.centre_world_m.astype(np.float32)[:, None], rays)

    def frame(self, index):
        """Expected photo-electrons (height, width) of one frame; the shutter must be global and the lens sharp."""
        assert self.recording.readout_s == 0
        assert self.recording.psf_sigma_px == 0
        part = (np.arange(self.moments) + 0.5) / self.moments
        times = self.recording.opens_s(index) + part * self.recording.exposure_s
        total = sum(self.moment(time_s) for time_s in times) / self.moments
        total = total + self._glints(index)
        return total * self.recording.responsivity * self.recording.exposure_s

    def moment(self, time_s):
        """Radiance (height, width) at one moment, without the glints."""
        view = self.view
        radiance = view.radiance.astype(float).ravel()
        drops = list(self.falling(time_s))
        for centre_m, radius_m in drops if self.scene.drop_shadows else ():
            for source, light in zip(self.lit.sources, view.by_source, strict=True):
                drops_m = np.broadcast_to(centre_m, (self.places.kind.size, 3))
                share = own_shadow(self.places, np.array(source.position_m), source.radius_m, drops_m, radius_m)
                radiance -= light * share.reshape(-1, light.size).mean(axis=0)
        image = radiance.reshape(view.radiance.shape)
        for centre_m, radius_m in drops:
            self._place(image, view, centre_m, radius_m)
        return image

    def falling(self, time_s):
        """Centre and radius of every drop between its leak and the first surface below."""
        for leak, landing in zip(self.scene.leaks, self.landings, strict=True):
            for released_s in leak.drop_times_s:
                depth = fall_depth(time_s - released_s)
                if time_s > released_s and depth < landing:
                    yield leak.position_m - [0, 0, depth], leak.drop_radius_m

    def _place(self, image, view, centre_m, radius_m):
        """Replace the share of each pixel that the drop covers by what is seen through it."""
        rows, columns = self._box(centre_m, radius_m)
        if rows.size == 0 or columns.size == 0:
            return
        inset = (np.arange(self.across) + 0.5) / self.across - 0.5
        v = (rows[:, None] + inset).ravel()
        u = (columns[:, None] + inset).ravel()
        pixels = np.stack(np.meshgrid(u, v), axis=-1)
        rays = self.camera.rays(pixels).reshape(-1, 3)
        to_drop = centre_m - self.camera.centre_world_m
        along = rays @ to_drop
        miss = along[:, None] * rays - to_drop  # from the drop's centre to the ray
        impact = np.linalg.norm(miss, axis=1) / radius_m
        hit = np.flatnonzero((impact < 0.9999) & (along > 0))
        seen = np.zeros(len(rays))
        seen[hit] = self._through(rays[hit], miss[hit], impact[hit], (centre_m, radius_m))
        inside = np.zeros(len(rays))
        inside[hit] = 1
        shape = (rows.size, self.across, columns.size, self.across)
        covered, light = (values.reshape(shape).mean(axis=(1, 3)) for values in (inside, seen))
        here = np.ix_(rows, columns)
        in_front = np.linalg.norm(to_drop) < view.range_m[here] + radius_m
        image[here] += np.where(in_front, light - covered * image[here], 0)

    def _through(self, rays, miss, impact, drop):
        """Radiance (n,) along rays that meet the drop, by the three paths through it."""
        centre_m, radius_m = drop
        outward = miss / np.maximum(np.linalg.norm(miss, axis=1, keepdims=True), 1e-12)
        total = np.zeros(len(rays))
        for order in ORDERS:
            path = path_through_drop(impact, order)
            direction = np.cos(path.turn_rad)[:, None] * rays + np.sin(path.turn_rad)[:, None] * outward
            origin_m = centre_m + radius_m * (path.along[:, None] * rays + path.across[:, None] * outward)
            surface = self.lit.look(origin_m.T.astype(np.float32), direction.T.astype(np.float32))
            total += path.share * self._static(surface, centre_m, radius_m)
        return total

    def _static(self, surface: Surface, centre_m, radius_m):
        leaving = self.lit.leaving(surface, 1)
        radiance = leaving.total
        drops_m = np.broadcast_to(centre_m, (surface.kind.size, 3))
        for source, light in zip(self.lit.sources, leaving.by_source, strict=True):
            radiance -= light * own_shadow(surface, np.array(source.position_m), source.radius_m, drops_m, radius_m)
        return radiance

    def _box(self, centre_m, radius_m):
        """Rows and columns of the pixels that the drop may touch."""
        corner = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
        u, v = self.camera.project(centre_m + 1.2 * radius_m * corner).T
        if not np.isfinite(u).all():
            return np.zeros(0, int), np.zeros(0, int)
        rows = np.arange(max(0, int(v.min()) - 1), min(self.camera.height_px, int(v.max()) + 3))
        columns = np.arange(max(0, int(u.min()) - 1), min(self.camera.width_px, int(u.max()) + 3))
        return rows, columns

    def _glints(self, index):
        """Mean radiance (height, width) that the lamps' images add, at 32 times as many moments."""
        image = np.zeros((self.camera.height_px, self.camera.width_px))
        count = 32 * self.moments
        times = self.recording.opens_s(index) + (np.arange(count) + 0.5) / count * self.recording.exposure_s
        for leak, landing in zip(self.scene.leaks, self.landings, strict=True):
            for released_s in leak.drop_times_s:
                fall_s = times - released_s
                fall_s = fall_s[(fall_s > 0) & (fall_depth(fall_s) < landing)]
                if fall_s.size == 0:
                    continue
                path = _followed(self.camera, leak, fall_s)
                glints = drop_glints(self.lit, path)
                radius_m = leak.drop_radius_m
                column = path.centre_px[:, :1] + radius_m * (
                    path.right_px[:, None] * glints.right + path.down_px[:, :1] * glints.down
                )
                row = path.centre_px[:, 1:] + radius_m * path.down_px[:, 1:] * glints.down
                square_px = radius_m**2 * path.right_px * path.down_px[:, 1]
                j, i = np.rint(column).astype(int), np.rint(row).astype(int)
                inside = (j >= 0) & (j < self.camera.width_px) & (i >= 0) & (i < self.camera.height_px)
                i, j = np.where(inside, i, 0), np.where(inside, j, 0)
                inside &= path.range_m[:, None] < self.view.range_m[i, j] + radius_m
                np.add.at(image, (i, j), np.where(inside, glints.strength * square_px[:, None], 0) / count)
        return image
