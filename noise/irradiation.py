"""A sensor under gamma radiation for a while: the electrons and the truth of the hits of any of its frames."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from noise.arrays import Array
from noise.bank import BankKey
from noise.direct import direct_hits
from noise.exposure import Key
from noise.footprints import Footprints, footprints_for
from noise.gamma import GammaField, expected_tracks
from noise.hits import GammaHits, no_hits
from noise.salt import salt_hits
from noise.sensor import Sensor
from noise.streams import Stream
from noise.tracks import draw_border_stamps, draw_stamps, hit_table, stamp_charge


@dataclass(frozen=True)
class FrameHits:
    """Hits of one exposure: `charge_e` (height, width), float32, None without dose; tracks in the image and around."""

    charge_e: Array | None
    hits: GammaHits
    border_hits: GammaHits


@dataclass(frozen=True)
class Irradiation:
    """What the hits of a clip depend on; `shape` is (height, width), `fps` counts for a dose rate of time alone."""

    field: GammaField
    sensor: Sensor
    shape: tuple[int, int]
    exposure_s: float
    fps: float

    @property
    def bank_key(self) -> BankKey:
        """The bank of tracks that fits field and sensor."""
        return BankKey(self.field.photon_energy_kev, self.sensor.thickness_um, self.field.direction)

    def prints(self) -> Footprints:
        """The footprints of field and sensor: made at the first call (about a second), then kept."""
        return footprints_for(self.bank_key, self.sensor.pitch_um, self.sensor.charge_diffusion_um)

    def prepare(self) -> None:
        """Make what the level needs, before threads ask for it at once."""
        if self.field.level == "tracks" and self.field.dose_rate_gy_h != 0:
            self.prints()

    def expected(self, frame: int) -> float:
        """Mean number of tracks that enter the image in a frame."""
        t_s = frame / self.fps
        return expected_tracks(self.field, self.sensor.pitch_um, self.shape, exposure_s=self.exposure_s, t_s=t_s)

    def draw(self, key: Key) -> FrameHits:
        """Hits of one frame: always the same for the same key."""
        mean = self.expected(key.frame)
        if mean == 0:
            return FrameHits(None, no_hits(), no_hits())
        charge_e = np.zeros(self.shape, dtype=np.float32)
        if self.field.level == "salt":
            table = salt_hits(mean, charge_e, self.sensor, rng=key.rng(Stream.HIT_PLACE))
            return FrameHits(charge_e, in_clip(table, key.frame), no_hits())
        if self.field.level == "transport":
            return self.draw_direct(mean, charge_e, key)
        return self.draw_from_bank(mean, charge_e, key)

    def draw_from_bank(self, mean: float, charge_e: Array, key: Key) -> FrameHits:
        """Tracks of the bank, stamped."""
        prints = self.prints()
        inside = draw_stamps(mean, self.shape, prints.n_tracks, rng=key.rng(Stream.HIT_PLACE))
        per_pixel = mean / (self.shape[0] * self.shape[1])
        around = draw_border_stamps(per_pixel, self.shape, prints, rng=key.rng(Stream.BORDER))
        stamp_charge(charge_e, inside, prints)
        stamp_charge(charge_e, around, prints)
        pitch_um = self.sensor.pitch_um
        return FrameHits(
            charge_e,
            hit_table(inside, prints, key.frame, pitch_um),
            hit_table(around, prints, key.frame, pitch_um),
        )

    def draw_direct(self, mean: float, charge_e: Array, key: Key) -> FrameHits:
        """Every electron transported for itself: the definition, a second a frame."""
        height, width = self.shape
        per_pixel = mean / (height * width)
        table = direct_hits(per_pixel, charge_e, self.bank_key, self.sensor, rng=key.rng(Stream.HIT_PLACE))
        inside = (np.abs(table.x_px - (width - 1) / 2) <= width / 2) & (
            np.abs(table.y_px - (height - 1) / 2) <= height / 2
        )
        table = in_clip(table, key.frame)
        return FrameHits(charge_e, table.where(inside), table.where(~inside))


def in_clip(table: GammaHits, frame: int) -> GammaHits:
    """The same tracks as of another frame."""
    return replace(table, frame=np.full(len(table), frame, dtype=np.int32))
