"""The paper's noise levels and the published way to put noise on frames, by name."""

from __future__ import annotations

from dataclasses import dataclass

from noise.gamma import GammaField
from noise.sensor import Sensor

DOSE_RATES_GY_H = {"L": 1.7, "M": 3.3, "H": 10.0}
"""Komatsu et al., Applied Sciences (2021): H about 10 Gy/h, M and L 33 % and 17 % of it."""

EXPOSURE_S = 1 / 12
"""Default exposure of the paper's presets: the whole frame interval at 12 frames/s."""

CONVERTER_BLUR_PX = 0.5
CONVERTER_JPEG_QUALITY = 25


@dataclass(frozen=True)
class Preset:
    """A field, a sensor and an exposure that belong together."""

    field: GammaField
    sensor: Sensor
    exposure_s: float


def converter_sensor() -> Sensor:
    """The published converter: pixel-wise maximum of scene and noise, a blur, clipping, JPEG."""
    return Sensor(combination="maximum", blur_px=CONVERTER_BLUR_PX, jpeg_quality=CONVERTER_JPEG_QUALITY)


def preset(name: str) -> Preset:
    """L, M, H (Cs-137, isotropic, the default sensor), or published-converter (H through `converter_sensor`).

    ValueError for any other name.
    """
    if name in DOSE_RATES_GY_H:
        return Preset(GammaField(DOSE_RATES_GY_H[name]), Sensor(), EXPOSURE_S)
    if name == "published-converter":
        return Preset(GammaField(DOSE_RATES_GY_H["H"]), converter_sensor(), EXPOSURE_S)
    raise ValueError(f"preset: name must be L, M, H or published-converter, got {name!r}")
