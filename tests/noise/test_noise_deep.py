"""Fresh seeds and big samples of the laws of the other files; the seed is in the message of a failure."""

import secrets

import numpy as np
import pytest

from noise import GammaField, Sensor, add_noise, estimate_dose_rate, expected_deposit_kev, expected_tracks
from noise.beam import isotropic_crossing
from noise.transport import transport

pytestmark = pytest.mark.deep


def test_transport_meets_quartiles_and_dose_with_a_fresh_seed():
    seed, n = secrets.randbits(32), 2**18
    rng = np.random.default_rng(seed)
    kinetic_kev, heading = isotropic_crossing(661.7, n, rng=rng)
    deposit_kev = transport(kinetic_kev, heading, 5.0, rng=rng).per_track_kev(n)
    assert np.quantile(deposit_kev, [0.25, 0.5, 0.75]) == pytest.approx([2.10, 3.46, 6.70], rel=0.04), seed
    per_pixel = expected_tracks(GammaField(), 3.0, (1, 1), exposure_s=1 / 12)
    conserved = expected_deposit_kev(GammaField(), 3.0, 5.0, exposure_s=1 / 12)
    assert deposit_kev.mean() * per_pixel == pytest.approx(conserved, rel=0.03), seed


@pytest.mark.parametrize("dose", [2.0, 3.3, 10.0, 60.0])
def test_counts_and_dose_estimates_hold_for_fresh_seeds(dose):
    for _ in range(10):
        seed = secrets.randbits(32)
        scene = np.full((12, 300, 400), 33 * 30.3, np.float32)
        clip = add_noise(scene, GammaField(dose), Sensor(), exposure_s=1 / 12, seed=seed, camera="right")
        mean = 12 * expected_tracks(GammaField(dose), 3.0, (300, 400), exposure_s=1 / 12)
        assert len(clip.hits) == pytest.approx(mean, abs=5 * np.sqrt(mean)), seed
        estimate = estimate_dose_rate(clip, Sensor())
        assert 0.85 * dose < estimate.dose_rate_gy_h < 1.15 * dose, seed
