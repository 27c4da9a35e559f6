"""An image sensor: from expected photo-electrons and the electrons of hits to grey values."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

Tone = Literal["linear", "srgb"]
Combination = Literal["sum", "maximum"]

GREY_LEVELS_8_BIT = 255
"""`electrons_per_grey` is stated per grey of 8 bits, whatever the number of bits."""


@dataclass(frozen=True)
class Sensor:
    """A monochrome sensor (defaults: the project's); every effect has a value that switches it off, given below.

    Geometry: `pitch_um`, sensitive `thickness_um` (thin: see `noise.transport`), `charge_diffusion_um` (sigma; 0 off).
    Electronics:
    `electrons_per_grey` of an 8-bit scale (full well = 255 of them), `shot_noise` (False off), `read_noise_e` (0 off),
    `dark_e_s` per pixel (0), `hot_pixel_share` of pixels with an exponentially distributed extra dark current of mean
    `hot_pixel_e_s` (0), `row_noise_e` fresh in every frame (0), `column_noise_e` fixed for the clip (0). After it:
    `defect_threshold_grey`, how much (8-bit grey) a pixel may exceed its brightest neighbour before it is replaced by
    it (None), `tone` linear or srgb, `bits` 8 to 16, `jpeg_quality` (None), `duplicate_share` of frames that repeat the
    one before (0). A real sensor adds the electrons of hits to photo-electrons; `combination` "maximum" and `blur_px`
    (sigma of a blur of the whole image, 0 off) are those of the published converter. ValueError for a value out of its
    range.
    """

    pitch_um: float = 3.0
    thickness_um: float = 5.0
    electrons_per_grey: float = 33.0
    read_noise_e: float = 3.0
    charge_diffusion_um: float = 1.2
    tone: Tone = "linear"
    bits: int = 8
    shot_noise: bool = True
    dark_e_s: float = 0.0
    hot_pixel_share: float = 0.0
    hot_pixel_e_s: float = 2000.0
    row_noise_e: float = 0.0
    column_noise_e: float = 0.0
    defect_threshold_grey: float | None = None
    jpeg_quality: int | None = None
    duplicate_share: float = 0.0
    combination: Combination = "sum"
    blur_px: float = 0.0

    def __post_init__(self) -> None:
        """Check every value once, here."""
        for name in ("pitch_um", "thickness_um", "electrons_per_grey"):
            check(name, getattr(self, name), 0 < getattr(self, name) < math.inf, "> 0 and finite")
        for name in (
            "read_noise_e",
            "charge_diffusion_um",
            "dark_e_s",
            "hot_pixel_e_s",
            "row_noise_e",
            "column_noise_e",
            "blur_px",
        ):
            check(name, getattr(self, name), 0 <= getattr(self, name) < math.inf, ">= 0 and finite")
        for name in ("hot_pixel_share", "duplicate_share"):
            check(name, getattr(self, name), 0 <= getattr(self, name) <= 1, "in 0 to 1")
        check("combination", self.combination, self.combination in ("sum", "maximum"), "'sum' or 'maximum'")
        check("tone", self.tone, self.tone in ("linear", "srgb"), "'linear' or 'srgb'")
        check("bits", self.bits, self.bits in range(8, 17), "a whole number, 8 to 16")
        if self.defect_threshold_grey is not None:
            check("defect_threshold_grey", self.defect_threshold_grey, self.defect_threshold_grey >= 0, "None or >= 0")
        if self.jpeg_quality is not None:
            check("jpeg_quality", self.jpeg_quality, self.jpeg_quality in range(1, 101), "None or 1 to 100")
            check("bits", self.bits, self.bits == 8, "8 with JPEG")

    @property
    def full_well_e(self) -> float:
        """Electrons at which a pixel is white."""
        return self.electrons_per_grey * GREY_LEVELS_8_BIT

    @property
    def white_level(self) -> int:
        """Largest grey value: 255 of 8 bits."""
        return 2**self.bits - 1

    @property
    def electrons_per_level(self) -> float:
        """Electrons per step of the converter (linear tone)."""
        return self.full_well_e / self.white_level

    def without_noise(self) -> Sensor:
        """The same sensor with every random effect, the codec and the defect correction off: it only quantises."""
        off = Sensor()
        kept = {name: getattr(off, name) for name in OFF_BY_DEFAULT}
        return replace(self, shot_noise=False, read_noise_e=0.0, **kept)


OFF_BY_DEFAULT = (
    "dark_e_s",
    "hot_pixel_share",
    "row_noise_e",
    "column_noise_e",
    "defect_threshold_grey",
    "jpeg_quality",
    "duplicate_share",
    "blur_px",
)
"""Effects that the default sensor does not have."""


def check(name: str, value: object, holds: bool, rule: str) -> None:  # noqa: FBT001 - the outcome of a rule
    """ValueError with name, rule and value where a rule does not hold."""
    if not holds:
        raise ValueError(f"Sensor: {name} must be {rule}, got {value!r}")
