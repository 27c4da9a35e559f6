"""What radiation and the sensor add to a clip: the only randomness of the images.

Dose rate in, video and the truth of every hit out: `add_noise(frames, GammaField(10.0), Sensor(), ...)`.

Physics: `silicon`, `compton`, `beam`, `gamma` (closed forms), `straggling` and `transport` (the slow definition).
Hits: `bank` and `footprints` (tracks made once), `tracks` (stamped), `direct` (each for itself), `salt`, `irradiation`.
Sensor: `sensor`, `exposure`, `codec`. Draws: `streams`. Inverses: `bright`, `dosimetry`, `aggregate`.
"""

from noise.aggregate import expected_column_sd
from noise.clip import NoisyClip, add_noise
from noise.dosimetry import DoseEstimate, estimate_dose_rate
from noise.exposure import shown_grey
from noise.gamma import (
    GammaField,
    expected_deposit_kev,
    expected_tracks,
    mean_pixels_per_track,
    normal_incidence_charge_e,
    track_length_survival,
    tracks_per_cm2_gy,
)
from noise.hits import GammaHits
from noise.presets import DOSE_RATES_GY_H, EXPOSURE_S, Preset, converter_sensor, preset
from noise.sensor import Sensor

__all__ = [
    "DOSE_RATES_GY_H",
    "EXPOSURE_S",
    "DoseEstimate",
    "GammaField",
    "GammaHits",
    "NoisyClip",
    "Preset",
    "Sensor",
    "add_noise",
    "converter_sensor",
    "estimate_dose_rate",
    "expected_column_sd",
    "expected_deposit_kev",
    "expected_tracks",
    "mean_pixels_per_track",
    "normal_incidence_charge_e",
    "preset",
    "shown_grey",
    "track_length_survival",
    "tracks_per_cm2_gy",
]
