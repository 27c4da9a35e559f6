"""Inverse and predictions: the dose rate of a clip, the spread of the column aggregate, the bright share at H."""

import numpy as np
import pytest
from scipy.stats import binom

from noise import GammaField, Sensor, add_noise, estimate_dose_rate, expected_column_sd, preset
from noise.aggregate import column_aggregate
from noise.bank import BankKey
from noise.bright import BrightModel
from noise.footprints import footprints_for

pytestmark = [pytest.mark.statistical, pytest.mark.usefixtures("fresh_draws")]

EXPOSURE_S = 1 / 12


def textured(n_frames, shape, electrons_per_grey=33.0):
    """A static scene of 20 to 60 grey, photo-electrons."""
    rng = np.random.default_rng(0)
    frame = (electrons_per_grey * (20 + 40 * rng.random(shape))).astype(np.float32)
    return np.broadcast_to(frame, (n_frames, *shape))


def clip_at(dose, sensor=None, n_frames=12, seed=1):
    sensor = sensor or Sensor()
    scene = textured(n_frames, (200, 300), sensor.electrons_per_grey)
    return add_noise(scene, GammaField(dose), sensor, exposure_s=EXPOSURE_S, seed=seed, camera=0)


# --- dose rate ------------------------------------------------------------------------------------------------------


def is_inside(estimate, dose, widened):
    """Whether a dose is in the 95 % interval, made so many times as wide about the estimate."""
    half_gy_h = (estimate.high_gy_h - estimate.low_gy_h) / 2.0
    return abs(estimate.dose_rate_gy_h - dose) <= widened * half_gy_h


def assert_dose(estimate, dose):
    assert is_inside(estimate, dose, 2.0)  # twice a 95 % interval: chance alone leaves it once in ten thousand


@pytest.mark.parametrize("dose", [0.2, 1.7, 3.3, 10.0, 50.0, 200.0])
def test_the_dose_rate_of_a_clip_is_within_twice_its_interval(dose):
    assert_dose(estimate_dose_rate(clip_at(dose), Sensor()), dose)


def test_the_interval_of_a_small_dose_holds_it_as_often_as_it_says():
    # at 0.2 Gy/h counts make the interval; at more its systematic part, which is the same in every clip
    estimates = [estimate_dose_rate(clip_at(0.2, n_frames=6, seed=seed), Sensor()) for seed in range(25)]
    least = binom.ppf(1e-5, len(estimates), 0.95)
    assert sum(one.low_gy_h <= 0.2 <= one.high_gy_h for one in estimates) >= least
    assert sum(is_inside(one, 0.2, 0.25) for one in estimates) < least


@pytest.mark.parametrize(
    "sensor", [Sensor(tone="srgb"), Sensor(bits=12, electrons_per_grey=20.0), Sensor(electrons_per_grey=60.0)]
)
def test_other_sensors_tell_the_same_dose_rate(sensor):
    assert_dose(estimate_dose_rate(clip_at(10.0, sensor), sensor), 10.0)


@pytest.mark.parametrize("n_frames", [3, 4, 5, 24])
def test_few_frames_and_many_tell_the_same_dose_rate(n_frames):
    assert_dose(estimate_dose_rate(clip_at(10.0, n_frames=n_frames), Sensor()), 10.0)


def test_the_interval_catches_half_more_dose():
    estimate = estimate_dose_rate(clip_at(15.0), Sensor())
    with pytest.raises(AssertionError):
        assert_dose(estimate, 10.0)


def test_no_dose_is_a_small_upper_limit():
    estimate = estimate_dose_rate(clip_at(0.0), Sensor())
    assert estimate.dose_rate_gy_h == 0
    assert estimate.low_gy_h == 0
    assert 0 < estimate.high_gy_h < 0.05


def test_a_wrong_gain_gives_a_wrong_dose_so_the_sensor_must_be_stated():
    estimate = estimate_dose_rate(clip_at(10.0), Sensor(electrons_per_grey=66.0))
    assert estimate.dose_rate_gy_h > 13.0


def test_bare_frames_need_their_exposure():
    frames = clip_at(10.0).frames
    assert_dose(estimate_dose_rate(frames, Sensor(), exposure_s=EXPOSURE_S), 10.0)
    with pytest.raises(ValueError, match="exposure_s"):
        estimate_dose_rate(frames, Sensor())
    with pytest.raises(ValueError, match="at least 3 frames"):
        estimate_dose_rate(frames[:2], Sensor(), exposure_s=EXPOSURE_S)


def test_the_warning_states_threshold_and_share_of_visible_tracks():
    estimate = estimate_dose_rate(clip_at(10.0), Sensor())
    assert 0 < estimate.visible_share < 1
    assert f"{estimate.threshold_grey:.1f} grey" in estimate.warning
    assert f"{estimate.visible_share:.0%} of the tracks" in estimate.warning


def test_a_scene_too_bright_to_show_hits_is_refused():
    frames = np.full((4, 30, 30), 255, np.uint8)
    with pytest.raises(ValueError, match="too bright"):
        estimate_dose_rate(frames, Sensor(), exposure_s=EXPOSURE_S)


def test_the_law_of_a_pixel_is_that_of_stamped_frames():
    """Campbell's theorem against stamping: share of pixels above a threshold at H and 20 H, nothing else on."""
    sensor = Sensor(bits=16, electrons_per_grey=330.0).without_noise()
    prints = footprints_for(BankKey(), 3.0, 1.2)
    for dose, n_frames in ((10.0, 9), (200.0, 9)):
        frames = add_noise(
            np.zeros((n_frames, 270, 480), np.float32), GammaField(dose), sensor, exposure_s=1 / 12, seed=4, camera=0
        ).frames.astype(np.float32)
        above = frames * sensor.electrons_per_level > 33 * 12 + np.median(frames, axis=0) * sensor.electrons_per_level
        per_pixel = 12193 * dose / 10 / (540 * 960)
        model = BrightModel(prints, 33.0 * 12, 1.0, n_frames)
        error = 5 * np.sqrt(above.mean() * 3 / above.size)
        assert model.share(per_pixel) == pytest.approx(above.mean(), rel=0.03, abs=error)


# --- bright share ---------------------------------------------------------------------------------------------------


def bright_share(sensor, dose=10.0):
    scene = np.full((6, 540, 960), 33 * 40.0, np.float32)
    frames = add_noise(scene, GammaField(dose), sensor, exposure_s=EXPOSURE_S, seed=3, camera=0).frames
    return np.mean(frames >= 40 + 16)


def assert_bright_share(share):
    assert 0.012 <= share <= 0.020


def test_at_h_one_to_two_percent_of_the_pixels_are_sixteen_grey_brighter():
    assert_bright_share(bright_share(preset("H").sensor))


def test_the_bright_share_catches_a_dose_of_one_and_a_half():
    with pytest.raises(AssertionError):
        assert_bright_share(bright_share(Sensor(), dose=15.0))


# --- column aggregate -----------------------------------------------------------------------------------------------


def assert_column_sd(dose, n_frames, predicted, grey=18.0):
    """Monte Carlo over 2 x 900 columns of a scene with a gradient down the rows; 10 % as the project allows.

    On top three standard errors of the Monte Carlo: where tracks are few, some columns with a long one make the spread.
    """
    n_rows = 270
    rows = (33 * np.linspace(grey - 8, grey + 8, n_rows)).astype(np.float32)[None, :, None]
    scene = np.broadcast_to(rows, (n_frames, n_rows, 900))
    columns = [
        column_aggregate(
            add_noise(scene, GammaField(dose), Sensor(), exposure_s=EXPOSURE_S, seed=seed, camera=1).frames
        )
        for seed in (11, 12)
    ]
    squares = np.concatenate([(one - one.mean()) ** 2 for one in columns])
    error = squares.std() / np.sqrt(len(squares)) / (2.0 * squares.mean())
    assert predicted == pytest.approx(np.sqrt(squares.mean()), rel=0.10 + 3.0 * error)


def predicted_sd(dose, n_frames, n_rows=270, grey=18.0):
    background_e = 33 * np.linspace(grey - 8, grey + 8, n_rows)
    return expected_column_sd(
        background_e, GammaField(dose), Sensor(), exposure_s=EXPOSURE_S, n_rows=n_rows, n_frames=n_frames
    )


@pytest.mark.parametrize("dose", [0.0, 1.7, 3.3, 10.0, 50.0])
def test_the_predicted_spread_of_the_column_aggregate_is_that_of_monte_carlo(dose):
    assert_column_sd(dose, 24, predicted_sd(dose, 24))


@pytest.mark.parametrize(("dose", "n_frames"), [(10.0, 5), (0.0, 13), (10.0, 13), (10.0, 40)])
def test_the_prediction_holds_for_few_frames_and_for_more_than_are_drawn(dose, n_frames):
    assert_column_sd(dose, n_frames, predicted_sd(dose, n_frames))


def test_the_spread_law_catches_a_missing_half_of_the_tracks():
    with pytest.raises(AssertionError):
        assert_column_sd(10.0, 24, predicted_sd(5.0, 24))


def test_the_spread_of_an_image_is_one_value_per_column_and_falls_with_the_rows():
    background_e = np.linspace(0, 5000, 6)[None, :] + np.zeros((50, 1))
    arguments = {"exposure_s": EXPOSURE_S, "n_frames": 6}
    sd = expected_column_sd(background_e, GammaField(), Sensor(), n_rows=50, **arguments)
    assert np.shape(sd) == (6,)
    one = expected_column_sd(1000.0, GammaField(), Sensor(), n_rows=50, **arguments)
    assert expected_column_sd(1000.0, GammaField(), Sensor(), n_rows=200, **arguments) == pytest.approx(one / 2)
    with pytest.raises(ValueError, match="background_e"):
        expected_column_sd(-1.0, GammaField(), Sensor(), n_rows=50, **arguments)
    with pytest.raises(ValueError, match="n_rows"):
        expected_column_sd(1.0, GammaField(), Sensor(), n_rows=0, **arguments)


def test_the_column_aggregate_is_the_papers_worked_by_hand():
    frames = np.array([[[0, 5]], [[4, 5]], [[1, 5]], [[9, 8]]], np.uint8)
    # Column 0: median of 0 1 4 9 is 2.5, |I - 2.5| = 2.5 1.5 1.5 6.5; column 1: median 5, |I - 5| = 0 0 0 3.
    assert column_aggregate(frames).tolist() == [3.0, 0.75]
