"""What radiation and the sensor add to a clip: the only randomness of the images."""

from noise.clip import NoisyClip, add_noise
from noise.gamma import GammaField, expected_deposit_kev, expected_tracks, track_length_survival
from noise.hits import GammaHits
from noise.sensor import Sensor

__all__ = [
    "GammaField",
    "GammaHits",
    "NoisyClip",
    "Sensor",
    "add_noise",
    "expected_deposit_kev",
    "expected_tracks",
    "track_length_survival",
]
