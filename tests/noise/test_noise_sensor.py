"""The sensor chain: photon transfer, saturation, converter, and each extra effect by itself."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import noise.exposure
from noise import GammaField, Sensor, add_noise, converter_sensor
from noise.exposure import Key, electrons_table, hot_pixels, normal_table

pytestmark = [pytest.mark.statistical, pytest.mark.usefixtures("fresh_draws")]

NO_GAMMA = GammaField(0.0)
SHAPE = (200, 250)


def noisy(mean_e, sensor, n_frames=1, field=NO_GAMMA, shape=SHAPE, seed=2):
    frames = np.broadcast_to(np.asarray(mean_e, np.float32), (n_frames, *shape))
    return add_noise(frames, field, sensor, exposure_s=1 / 12, seed=seed, camera=0).frames


# --- nothing in, nothing changed ------------------------------------------------------------------------------------


@given(arrays(np.uint8, (2, 7, 9)), st.sampled_from(["linear", "srgb"]), st.floats(0.1, 1000))
@settings(max_examples=40)
def test_grey_frames_come_back_when_dose_and_sensor_are_off(frames, tone, electrons_per_grey):
    sensor = Sensor(tone=tone, electrons_per_grey=electrons_per_grey).without_noise()
    out = add_noise(frames, NO_GAMMA, sensor, exposure_s=0.1, seed=1, camera=0)
    assert out.frames.dtype == np.uint8
    assert np.array_equal(out.frames, frames)
    assert len(out.hits) == 0


@pytest.mark.parametrize("tone", ["linear", "srgb"])
@pytest.mark.parametrize("bits", [10, 12, 13, 14, 16])
def test_grey_of_more_bits_comes_back_when_dose_and_sensor_are_off(bits, tone):
    frames = np.arange(2**bits, dtype=np.uint16).reshape(1, 2 ** (bits - 5), 32)
    out = add_noise(frames, NO_GAMMA, Sensor(bits=bits, tone=tone).without_noise(), exposure_s=0.1, seed=1, camera=0)
    assert np.array_equal(out.frames, frames)


def test_electrons_become_grey_at_the_stated_gain():
    ideal = Sensor().without_noise()
    row = 33 * np.array([[0, 1.4, 1.6, 100, 254.4, 255, 300]], np.float32)
    assert noisy(row, ideal, shape=row.shape)[0].tolist() == [[0, 1, 2, 100, 254, 255, 255]]


def test_srgb_tone_is_the_standards():
    ideal = Sensor(tone="srgb").without_noise()
    row = 33 * 255 * np.array([[0, 0.0031308, 0.21586, 0.5, 1.0]], np.float32)
    assert noisy(row, ideal, shape=row.shape)[0].tolist() == [[0, 10, 128, 188, 255]]  # 0.216 of the light is half grey


# --- photon transfer ------------------------------------------------------------------------------------------------


def assert_poisson_moments(electrons, mean_e, read_e):
    """Mean, variance and third moment of shot plus read noise, within 5 standard errors each."""
    n = electrons.size
    variance = mean_e + read_e**2
    skewness = mean_e / variance**1.5
    assert electrons.mean() == pytest.approx(mean_e, abs=5 * np.sqrt(variance / n))
    assert electrons.var() == pytest.approx(variance, rel=5 * np.sqrt((2 + 1 / mean_e) / n))
    third = np.mean(((electrons - electrons.mean()) / electrons.std()) ** 3)
    assert third == pytest.approx(skewness, abs=5 * np.sqrt((6 + 40 * skewness**2) / n))


@pytest.mark.parametrize("mean_e", [0.3, 2.0, 12.0, 19.9, 20.1, 60.0, 700.0, 5000.0])
def test_shot_noise_has_the_moments_of_a_poisson_number(mean_e):
    sensor = Sensor(bits=16, electrons_per_grey=65535 / 255 / 8, read_noise_e=0.0)  # an eighth of an electron a level
    # A level less than the read noise: no mean shifts by clipping at zero, for there are no negative electrons.
    electrons = noisy(mean_e, sensor, 4).astype(float) * sensor.electrons_per_level
    assert_poisson_moments(electrons, mean_e, np.sqrt(sensor.electrons_per_level**2 / 12 * (mean_e >= 20)))


def test_the_moments_catch_a_normal_number_in_low_light(monkeypatch):
    monkeypatch.setattr(noise.exposure, "NORMAL_FROM_E", 0.0)
    sensor = Sensor(bits=16, electrons_per_grey=65535 / 255 / 8, read_noise_e=0.0)
    electrons = noisy(2.0, sensor, 4).astype(float) * sensor.electrons_per_level
    with pytest.raises(AssertionError):
        assert_poisson_moments(electrons, 2.0, 0.0)


def test_dark_pixels_are_empty_as_often_as_poisson_says():
    sensor = Sensor(bits=16, electrons_per_grey=65535 / 255, read_noise_e=0.0)
    empty = np.mean(noisy(1.5, sensor, 4) == 0)
    assert empty == pytest.approx(np.exp(-1.5), abs=5 * np.sqrt(0.25 / (4 * 200 * 250)))


def photon_transfer(sensor, greys):
    """Mean and variance (grey) of flat fields spread over one grey each, so that rounding acts as noise of 1/12."""
    means, variances = [], []
    spread = (np.arange(SHAPE[1]) / SHAPE[1] - 0.5) * sensor.electrons_per_grey
    for grey in greys:
        frames = noisy(grey * sensor.electrons_per_grey + spread, sensor, 8).astype(float)
        means.append(frames.mean())
        variances.append(frames.var(axis=0, ddof=1).mean())
    return np.array(means), np.array(variances)


@pytest.mark.parametrize("electrons_per_grey", [5.0, 33.0])
def test_the_slope_of_the_photon_transfer_curve_is_the_gain(electrons_per_grey):
    sensor = Sensor(electrons_per_grey=electrons_per_grey, read_noise_e=10.0)
    mean, variance = photon_transfer(sensor, np.array([10, 40, 80, 120, 160, 200]))
    assert_gain(mean, variance, electrons_per_grey, read_e=10.0)


def assert_gain(mean, variance, electrons_per_grey, read_e):
    """Slope and offset of the curve, within 5 standard errors of variances of 350 000 degrees of freedom each."""
    slope, offset = np.polyfit(mean, variance, 1)
    error = 5 * np.sqrt(2 / (7 * 200 * 250)) * variance.max() / 100
    assert slope == pytest.approx(1 / electrons_per_grey, abs=error)
    assert offset == pytest.approx(read_e**2 / electrons_per_grey**2 + 1 / 12, abs=100 * error)


def test_the_photon_transfer_law_catches_five_percent_too_much_gain():
    mean, variance = photon_transfer(
        Sensor(electrons_per_grey=33.0 / 1.05, read_noise_e=10.0), np.array([10, 100, 200])
    )
    with pytest.raises(AssertionError):
        assert_gain(mean, variance, 33.0, read_e=10.0)


def test_read_noise_from_the_table_is_normal():
    sensor = Sensor(bits=16, electrons_per_grey=20.0, shot_noise=False, read_noise_e=4.0)
    electrons = noisy(2000.0, sensor, 4).astype(float) * sensor.electrons_per_level
    n = electrons.size
    z = (electrons - 2000.0) / 4.0
    assert z.mean() == pytest.approx(0, abs=5 / np.sqrt(n) + 1e-3)
    assert z.var() == pytest.approx(1 + (sensor.electrons_per_level / 4) ** 2 / 12, rel=5 * np.sqrt(2 / n))
    assert np.mean(z**4) / z.var() ** 2 == pytest.approx(3, abs=5 * np.sqrt(24 / n))
    assert np.mean(np.abs(z) > 3) == pytest.approx(0.0027, abs=5 * np.sqrt(0.0027 / n) + 1e-4)
    assert normal_table(4.0).std() == pytest.approx(4.0, rel=1e-5)


def test_hits_carry_no_shot_noise_of_their_own_and_saturate_with_the_scene():
    field = GammaField(100.0)
    ideal = Sensor(bits=16, electrons_per_grey=33.0).without_noise()
    dark = noisy(0.0, ideal, field=field).astype(float)
    bright = noisy(33 * 250.0, ideal, field=field).astype(float)
    assert np.abs(bright - np.minimum(dark + 65535 * 250 / 255, 65535)).max() <= 1
    assert np.mean(bright == 65535) > 0.1


# --- extra effects --------------------------------------------------------------------------------------------------


def test_dark_current_adds_poisson_electrons():
    sensor = Sensor(bits=16, electrons_per_grey=20.0, dark_e_s=1200.0, read_noise_e=0.0, shot_noise=False)
    electrons = noisy(50.0, sensor, 2).astype(float) * sensor.electrons_per_level - 50.0
    assert electrons.mean() == pytest.approx(100.0, abs=5 * np.sqrt(100 / electrons.size))
    assert electrons.var() == pytest.approx(100.0, rel=5 * np.sqrt(2 / electrons.size))


def test_hot_pixels_stay_where_they_are_in_every_frame_and_differ_between_cameras():
    sensor = Sensor(hot_pixel_share=0.01, hot_pixel_e_s=30_000.0)
    frames = noisy(0.0, sensor, 3)
    place, rate_e_s = hot_pixels(SHAPE, sensor, Key(2, 0, 0))
    assert len(place) == pytest.approx(500, abs=5 * np.sqrt(500))
    assert rate_e_s.mean() == pytest.approx(30_000, rel=5 / np.sqrt(len(place)))
    hot = np.zeros(SHAPE, dtype=bool)
    hot.reshape(-1)[place[rate_e_s > 20_000]] = True
    assert all(np.all(frame[hot] > 30) for frame in frames)
    assert np.all(frames[:, ~np.isin(np.arange(hot.size), place).reshape(SHAPE)] <= 1)
    other, _ = hot_pixels(SHAPE, sensor, Key(2, 1, 0))
    assert len(np.intersect1d(place, other)) < 30


def test_row_noise_is_fresh_in_every_frame_and_column_noise_fixed_for_the_clip():
    rows = noisy(3300.0, Sensor(row_noise_e=100.0).without_noise(), 2)
    assert np.ptp(rows) == 0  # switched off
    fixed = {"shot_noise": False, "read_noise_e": 0.0, "bits": 16}
    rows = noisy(3300.0, Sensor(row_noise_e=100.0, **fixed), 2).astype(float)
    assert np.all(rows == rows[:, :, :1])
    assert not np.array_equal(rows[0], rows[1])
    assert rows[0, :, 0].std() * Sensor(bits=16).electrons_per_level == pytest.approx(100, rel=5 / np.sqrt(400))
    columns = noisy(3300.0, Sensor(column_noise_e=100.0, **fixed), 2)
    assert np.all(columns == columns[:1, :1])
    assert np.ptp(columns) > 0


def test_defect_correction_takes_lone_pixels_and_leaves_longer_marks():
    frame = np.full(SHAPE, 33 * 10.0, np.float32)
    frame[50, 50] = 33 * 200.0
    frame[100, 100:103] = 33 * 200.0
    out = noisy(frame, Sensor(shot_noise=False, read_noise_e=0.0, defect_threshold_grey=20.0))[0]
    assert out[50, 50] == 10
    assert out[100, 100:103].tolist() == [200, 200, 200]
    assert np.sum(out != 10) == 3


def test_jpeg_is_what_the_codec_makes_of_the_frame():
    frame = cv2.GaussianBlur((33 * 200 * np.random.default_rng(0).random(SHAPE)).astype(np.float32), (0, 0), 2)
    plain, packed = noisy(frame, Sensor())[0], noisy(frame, Sensor(jpeg_quality=25))[0]
    _, data = cv2.imencode(".jpg", plain, [cv2.IMWRITE_JPEG_QUALITY, 25])
    assert np.array_equal(packed, cv2.imdecode(data, cv2.IMREAD_GRAYSCALE))
    assert not np.array_equal(packed, plain)


def test_a_stalled_camera_repeats_frames_with_their_hits_at_its_rate():
    clip = add_noise(
        np.full((300, 12, 20), 990.0, np.float32),
        GammaField(200.0),
        Sensor(duplicate_share=0.25),
        exposure_s=1 / 12,
        seed=1,
        camera=0,
    )
    repeats = np.array([np.array_equal(a, b) for a, b in zip(clip.frames[:-1], clip.frames[1:], strict=True)])
    assert repeats.mean() == pytest.approx(0.25, abs=5 * np.sqrt(0.25 * 0.75 / 299))
    first = int(np.flatnonzero(repeats)[0])
    assert np.array_equal(clip.hits.in_frame(first).x_px, clip.hits.in_frame(first + 1).x_px)
    assert np.array_equal(clip.hit_charge_e(first), clip.hit_charge_e(first + 1))


def test_the_published_converter_takes_the_maximum_and_never_brightens_a_brighter_scene():
    sensor = Sensor(combination="maximum").without_noise()
    field = GammaField(50.0)
    dark, bright = (noisy(33 * grey, sensor, field=field).astype(int) for grey in (0, 60))
    assert np.array_equal(bright, np.maximum(dark, 60))
    assert converter_sensor().combination == "maximum"
    assert converter_sensor().jpeg_quality == 25
    assert converter_sensor().blur_px > 0


def test_blur_spreads_a_point_by_its_sigma():
    frame = np.zeros(SHAPE, np.float32)
    frame[100, 100] = 33 * 255.0
    out = noisy(frame, Sensor(bits=16, shot_noise=False, read_noise_e=0.0, blur_px=1.0))[0].astype(float)
    x = np.arange(SHAPE[1]) - 100
    assert np.sqrt(np.sum(out * x**2) / out.sum()) == pytest.approx(1.0, abs=0.03)


# --- refused --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "bad",
    [
        {"pitch_um": 0.0},
        {"thickness_um": -1.0},
        {"electrons_per_grey": np.nan},
        {"read_noise_e": -1.0},
        {"charge_diffusion_um": np.inf},
        {"tone": "gamma"},
        {"bits": 7},
        {"bits": 17},
        {"dark_e_s": -1.0},
        {"hot_pixel_share": 1.5},
        {"duplicate_share": -0.1},
        {"jpeg_quality": 0},
        {"jpeg_quality": 90, "bits": 12},
        {"defect_threshold_grey": -1.0},
        {"combination": "product"},
        {"blur_px": -1.0},
    ],
)
def test_a_sensor_that_cannot_be_is_refused_by_name(bad):
    with pytest.raises(ValueError, match="Sensor: " + ("bits" if "bits" in bad else next(iter(bad)))):
        Sensor(**bad)


@pytest.mark.parametrize(
    ("frames", "rule"),
    [
        (np.zeros((3, 4), np.float32), "must be \\(n, height, width\\)"),
        (np.zeros((1, 3, 4), np.int32), "float32 electrons or uint8"),
        (np.zeros((1, 3, 4), np.uint16), "float32 electrons or uint8"),
        (np.full((1, 3, 4), -1.0, np.float32), ">= 0 and finite"),
        (np.full((1, 3, 4), np.nan, np.float32), ">= 0 and finite"),
    ],
)
def test_frames_that_are_not_light_are_refused(frames, rule):
    with pytest.raises(ValueError, match=rule):
        add_noise(frames, NO_GAMMA, Sensor(), exposure_s=0.1, seed=1, camera=0)


@pytest.mark.parametrize("times", [{"exposure_s": 0.0}, {"exposure_s": np.nan}, {"exposure_s": 0.1, "fps": 0.0}])
def test_times_that_are_not_positive_are_refused(times):
    with pytest.raises(ValueError, match="must be > 0"):
        add_noise(np.zeros((1, 3, 4), np.float32), NO_GAMMA, Sensor(), seed=1, camera=0, **times)


def test_a_number_of_workers_below_one_is_refused():
    with pytest.raises(ValueError, match="workers"):
        add_noise(np.zeros((1, 3, 4), np.float32), NO_GAMMA, Sensor(), exposure_s=0.1, seed=1, camera=0, workers=0)


def test_an_empty_clip_stays_empty():
    clip = add_noise(np.zeros((0, 3, 4), np.float32), GammaField(), Sensor(), exposure_s=0.1, seed=1, camera=0)
    assert clip.frames.shape == (0, 3, 4)
    assert len(clip.hits) == 0


def test_grey_is_read_on_the_sensors_own_scale_without_offset():
    assert electrons_table(Sensor())[[0, 1, 255]].tolist() == [0.0, 33.0, 8415.0]
    assert electrons_table(Sensor(bits=12))[4095] == pytest.approx(8415.0)


@pytest.mark.parametrize("changes", [{}, {"hot_pixel_share": 0.1, "hot_pixel_e_s": 20_000.0}])
def test_the_order_of_frames_in_memory_changes_nothing(changes):
    frames = np.full((3, 40, 60), 2.0, np.float32)
    frames[:, :, 30:] = 400.0
    sensor = Sensor(electrons_per_grey=0.5, **changes)
    turned = np.transpose(np.ascontiguousarray(np.transpose(frames, (0, 2, 1))), (0, 2, 1))
    assert not turned.flags.c_contiguous
    one, other = (add_noise(f, NO_GAMMA, sensor, exposure_s=0.1, seed=1, camera=0).frames for f in (frames, turned))
    assert np.array_equal(one, other)
