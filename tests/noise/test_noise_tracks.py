"""Laws of the hits on the image: number, place, length, charge, and what the fast stamping is held to."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import noise.irradiation
from noise import GammaField, GammaHits, Sensor, add_noise, expected_deposit_kev, expected_tracks, track_length_survival
from noise.bank import BankKey, make_batch
from noise.exposure import Key
from noise.footprints import PHASES, footprints_for
from noise.irradiation import Irradiation
from noise.silicon import PAIR_ENERGY_KEV
from noise.tracks import Stamps, draw_stamps, stamp_charge

pytestmark = [pytest.mark.statistical, pytest.mark.usefixtures("fresh_draws"), pytest.mark.xdist_group("tracks")]

H = 10.0
EXPOSURE_S = 1 / 12
HD = (540, 960)
FINE = Sensor(bits=16, electrons_per_grey=330.0).without_noise()
"""Counts electrons nearly one by one, up to 84 000."""


def drawn(field, shape, n_frames, seed=1, camera=0, sensor=FINE):
    """Hits and images of charge of n frames, without the sensor."""
    irradiation = Irradiation(field, sensor, shape, EXPOSURE_S, 12.0)
    return [irradiation.draw(Key(seed, camera, n)) for n in range(n_frames)]


def counts_of(frames):
    return np.array([len(frame.hits) for frame in frames])


@pytest.fixture(scope="module")
def h_frames():
    """48 frames of 960 x 540 at H: 585 000 tracks."""
    return [frame for camera in (0, 1) for frame in drawn(GammaField(H), HD, 24, camera=camera)]


# --- number ---------------------------------------------------------------------------------------------------------


def assert_rate(counts, mean):
    """The mean count is the expected one within 5 standard errors: 0.65 % of 48 frames at H."""
    assert counts.mean() == pytest.approx(mean, abs=5 * np.sqrt(mean / len(counts)))


def assert_poisson(counts):
    """Variance over mean is 1 within 5 of its standard errors."""
    assert counts.var(ddof=1) / counts.mean() == pytest.approx(1.0, abs=5 * np.sqrt(2 / (len(counts) - 1)))


def test_tracks_per_frame_at_h(h_frames):
    assert_rate(counts_of(h_frames), 12200)


def test_the_rate_law_catches_two_percent_more(h_frames):
    assert h_frames  # the same size of sample
    planted = np.array(
        [count for camera in (0, 1) for count in counts_of(drawn(GammaField(1.02 * H), HD, 24, 2, camera))]
    )
    with pytest.raises(AssertionError):
        assert_rate(planted, 12200)


def test_the_number_of_tracks_is_poisson():
    counts = counts_of(drawn(GammaField(H), (40, 40), 1500))
    assert_poisson(counts)
    assert_rate(counts, expected_tracks(GammaField(H), 3.0, (40, 40), exposure_s=EXPOSURE_S))


def test_the_poisson_law_catches_a_fixed_number(monkeypatch):
    class Fixed:
        """A generator whose Poisson numbers are their mean."""

        def __init__(self, rng):
            self.rng = rng

        def __getattr__(self, name):
            return getattr(self.rng, name)

        def poisson(self, mean):
            return round(mean)

    def fixed_number(*args, rng):
        return draw_stamps(*args, rng=Fixed(rng))

    monkeypatch.setattr(noise.irradiation, "draw_stamps", fixed_number)
    with pytest.raises(AssertionError):
        assert_poisson(counts_of(drawn(GammaField(H), (40, 40), 1500)))


@pytest.mark.parametrize(
    ("dose", "shape", "exposure_s"),
    [(H, (10, 10), 1 / 12), (100.0, (10, 10), 1 / 50), (1.0, (20, 45), 0.5), (H, (1, 7), 1.0)],
)
def test_counts_are_linear_in_dose_exposure_and_area_down_to_tiny_sensors(dose, shape, exposure_s):
    irradiation = Irradiation(GammaField(dose), FINE, shape, exposure_s, 12.0)
    counts = np.array([len(irradiation.draw(Key(3, 0, n)).hits) for n in range(800)])
    assert_rate(counts, 12193 * dose / H * np.prod(shape) / np.prod(HD) * exposure_s * 12)
    assert_poisson(counts)


def test_a_dose_rate_of_time_is_followed_frame_by_frame():
    field = GammaField(lambda t_s: 5.0 if t_s < 0.99 else 20.0)
    clip = add_noise(
        np.zeros((24, 200, 200), np.float32), field, Sensor(), exposure_s=EXPOSURE_S, seed=1, camera=0, fps=12
    )
    counts = np.bincount(clip.hits.frame, minlength=24)
    mean = expected_tracks(GammaField(5.0), 3.0, (200, 200), exposure_s=EXPOSURE_S)
    assert_rate(counts[:12], mean)
    assert_rate(counts[12:], 4 * mean)


# --- place ----------------------------------------------------------------------------------------------------------


def assert_uniform_places(x_px, width):
    """Entry points fill half-pixel bins from -0.5 to width - 0.5 evenly (chi-square within 6 of its spreads)."""
    bins = np.histogram(x_px, bins=2 * width, range=(-0.5, width - 0.5))[0]
    assert bins.sum() == len(x_px)
    mean = len(x_px) / len(bins)
    chi2 = np.sum((bins - mean) ** 2 / mean)
    assert chi2 == pytest.approx(len(bins), abs=6 * np.sqrt(2 * len(bins)))


def test_entry_points_are_uniform_to_the_very_border(h_frames):
    assert_uniform_places(np.concatenate([frame.hits.x_px for frame in h_frames]), HD[1])
    assert_uniform_places(np.concatenate([frame.hits.y_px for frame in h_frames]), HD[0])


def test_the_place_law_catches_hits_clipped_to_the_border(h_frames):
    x_px = np.concatenate([frame.hits.x_px for frame in h_frames])
    with pytest.raises(AssertionError):
        assert_uniform_places(np.clip(x_px, 0, HD[1] - 1), HD[1])


def assert_border_dose(shape, n_frames):
    """The mean charge of a tiny sensor's pixels, all of them near a border, is that of an unbounded one."""
    images = np.array([frame.charge_e.mean() for frame in drawn(GammaField(30 * H), shape, n_frames)])
    expected_e = expected_deposit_kev(GammaField(30 * H), 3.0, 5.0, exposure_s=EXPOSURE_S) / PAIR_ENERGY_KEV
    assert images.mean() == pytest.approx(expected_e, rel=0.05, abs=5 * images.std() / np.sqrt(n_frames))


def test_pixels_at_the_border_get_as_much_dose_as_those_inside():
    assert_border_dose((12, 12), 1000)


def test_the_border_law_catches_a_sensor_without_tracks_from_outside(monkeypatch):
    def nothing(*_args, **_rng):
        return Stamps(np.zeros(0), np.zeros(0), np.zeros(0, dtype=int))

    monkeypatch.setattr(noise.irradiation, "draw_border_stamps", nothing)
    with pytest.raises(AssertionError):
        assert_border_dose((12, 12), 1000)


# --- length and direction -------------------------------------------------------------------------------------------


def assert_length_law(length_um, thickness_um):
    """Survival at 1, 2, 3 thicknesses is that of the cosine law, within 5 standard errors."""
    for times in (1, 2, 3):
        expected = float(track_length_survival(times * thickness_um, thickness_um))
        error = 5 * np.sqrt(expected * (1 - expected) / len(length_um))
        assert np.mean(length_um > times * thickness_um) == pytest.approx(expected, abs=error)


def test_half_a_fifth_and_a_tenth_of_the_tracks_are_longer_than_one_two_and_three_thicknesses(h_frames):
    length_px = np.concatenate([frame.hits.length_px for frame in h_frames])
    assert_length_law(length_px * 3.0, 5.0)
    assert np.mean(length_px >= 5) == pytest.approx(0.10, abs=2e-3)
    assert np.mean(length_px >= 10) == pytest.approx(0.027, abs=1.2e-3)


def test_the_length_law_catches_uniform_directions(monkeypatch):
    def uniform(_photon_kev, _direction, n, *, rng):
        cosine = np.maximum(rng.random(n), 1e-4)
        return np.full(n, 200.0), np.stack([np.sqrt(1 - cosine**2), 0 * cosine, cosine], axis=1)

    monkeypatch.setattr(noise.bank, "crossing", uniform)
    planted = make_batch(BankKey(), 0)
    with pytest.raises(AssertionError):
        assert_length_law(planted.length_um, 5.0)


def test_azimuths_are_uniform(h_frames):
    azimuth = np.concatenate([frame.hits.azimuth_rad for frame in h_frames])
    bins = np.histogram(azimuth, bins=36, range=(-np.pi, np.pi))[0]
    assert bins.sum() == len(azimuth)
    assert bins == pytest.approx(np.full(36, bins.mean()), abs=6 * np.sqrt(bins.mean()))


def test_azimuth_is_where_the_charge_goes():
    """Charge lies ahead of the entry along the azimuth, +u towards +v."""
    prints = footprints_for(BankKey(), 3.0, 1.2)
    y, x = np.indices((120, 120)) - 60
    ahead = []
    for track in np.flatnonzero((prints.bank.length_um > 30) & (prints.track_charge_e > 100))[:200]:
        image = np.zeros((120, 120), np.float32)
        stamp_charge(image, Stamps(np.full(1, 60.0), np.full(1, 60.0), np.full(1, track)), prints)
        azimuth = prints.bank.azimuth_rad[track]
        ahead.append(np.sum(image * (x * np.cos(azimuth) + y * np.sin(azimuth))) / image.sum())
    assert np.mean(ahead) > 1.0


def share_touched(hits):
    """Share of a frame's pixels that straight chords cross, drawn in steps of a fiftieth of a pixel."""
    touched = np.zeros(HD, dtype=bool)
    length = np.minimum(hits.length_px, 300)  # the longest electron goes 888 um
    steps = np.ceil(length * 50).astype(int) + 1
    owner = np.repeat(np.arange(len(hits)), steps)
    along = (np.arange(steps.sum()) - np.repeat(np.cumsum(steps) - steps, steps)) / 50
    x = np.floor(hits.x_px[owner] + along * np.cos(hits.azimuth_rad[owner]) + 0.5).astype(int)
    y = np.floor(hits.y_px[owner] + along * np.sin(hits.azimuth_rad[owner]) + 0.5).astype(int)
    inside = (x >= 0) & (x < HD[1]) & (y >= 0) & (y < HD[0])
    touched[y[inside], x[inside]] = True
    return touched.mean()


def test_straight_tracks_touch_nine_and_a_half_percent_of_the_pixels_at_h(h_frames):
    """The chords of the hit table; a few long tracks make single frames scatter by some per cent."""
    shares = [share_touched(frame.hits) for frame in h_frames[::6]]
    # 5 standard errors of 8 frames are 0.0023; a single frame scatters by 0.0013
    assert np.mean(shares) == pytest.approx(0.0955, abs=0.0025)


# --- charge ---------------------------------------------------------------------------------------------------------


def test_charge_on_the_image_conserves_the_dose(h_frames):
    charge_e = np.array([frame.charge_e.mean(dtype=float) for frame in h_frames])
    expected_e = expected_deposit_kev(GammaField(H), 3.0, 5.0, exposure_s=EXPOSURE_S) / PAIR_ENERGY_KEV
    assert charge_e.mean() == pytest.approx(expected_e, rel=0.05)
    assert charge_e.mean() * PAIR_ENERGY_KEV == pytest.approx(0.151, rel=0.05)


def test_deposits_of_the_hits_have_the_designs_quartiles(h_frames):
    deposit_kev = np.concatenate([frame.hits.deposit_kev for frame in h_frames])
    assert np.quantile(deposit_kev, [0.25, 0.5, 0.75]) == pytest.approx([2.10, 3.46, 6.70], rel=0.10)


def test_the_hits_of_a_frame_account_for_its_charge(h_frames):
    frame = h_frames[0]
    own = frame.hits.charge_e.sum()
    assert frame.charge_e.sum(dtype=float) == pytest.approx(own, rel=0.03)  # what leaves is what comes in
    assert frame.charge_e.sum(dtype=float) < own + frame.border_hits.charge_e.sum()
    assert frame.hits.charge_e * PAIR_ENERGY_KEV == pytest.approx(frame.hits.deposit_kev, rel=0.15, abs=0.15)


@pytest.mark.parametrize("direction", [(0, 0, 1), (1, 0, 0), (1.0, 1.0, -0.5)])
def test_a_beam_from_any_side_leaves_the_same_dose(direction):
    field = GammaField(5 * H, direction=direction)
    charge_e = np.array([frame.charge_e.mean(dtype=float) for frame in drawn(field, (200, 200), 12)])
    expected_e = expected_deposit_kev(field, 3.0, 5.0, exposure_s=EXPOSURE_S) / PAIR_ENERGY_KEV
    assert charge_e.mean() == pytest.approx(expected_e, rel=0.06)


def test_a_beam_along_the_rows_makes_tracks_along_the_rows():
    field = GammaField(5 * H, photon_energy_kev=1252.9, direction=(1, 0, 0))
    hits = drawn(field, (200, 200), 1)[0].hits
    assert np.average(np.cos(hits.azimuth_rad), weights=np.minimum(hits.length_px, 10)) > 0.3
    assert abs(np.average(np.sin(hits.azimuth_rad), weights=np.minimum(hits.length_px, 10))) < 0.1


# --- fast against slow ----------------------------------------------------------------------------------------------


@given(
    st.tuples(st.integers(1, 70), st.integers(1, 70)), st.integers(0, 40), st.integers(0, 2**32 - 1), st.floats(-20, 20)
)
@settings(max_examples=40)
def test_stamping_all_at_once_is_stamping_pixel_by_pixel(shape, n, seed, shift):
    prints = footprints_for(BankKey(), 3.0, 1.2)
    rng = np.random.default_rng(seed)
    drawn_once = draw_stamps(float(n), shape, prints.n_tracks, rng=rng)
    stamps = replace(drawn_once, x_px=drawn_once.x_px + shift)
    fast, slow = np.zeros(shape, np.float32), np.zeros(shape)
    stamp_charge(fast, stamps, prints)
    for x_px, y_px, track in zip(stamps.x_px, stamps.y_px, stamps.track, strict=True):
        stamp_one(slow, (x_px, y_px), track, prints)
    assert fast == pytest.approx(slow, rel=1e-4, abs=0.05)


def stamp_one(image, place, track, prints):
    """Pixel by pixel: `image[y + dy, x + dx] += charge` where that is in the image."""
    column, row = (int(np.floor(value + 0.5)) for value in place)
    phase_x, phase_y = (int((value + 0.5 - np.floor(value + 0.5)) * PHASES) for value in place)
    label = (track * PHASES + phase_y) * PHASES + phase_x
    for pixel in prints.pixels[prints.start[label] : prints.start[label] + prints.count[label]]:
        x, y = column + int(pixel["dx_px"]), row + int(pixel["dy_px"])
        if 0 <= x < image.shape[1] and 0 <= y < image.shape[0]:
            image[y, x] += pixel["charge_e"]


def test_tracks_and_transport_light_the_same_share_of_pixels():
    """The bank against its definition, each electron for itself: shares above 4, 16 and 64 grey of 33 electrons."""
    shape, n = (270, 480), 4
    fast = np.stack([frame.charge_e for frame in drawn(GammaField(5 * H), shape, 4 * n)])
    slow = np.stack([frame.charge_e for frame in drawn(GammaField(5 * H, level="transport"), shape, n)])
    for grey in (4, 16, 64):
        share = np.mean(slow > 33 * grey)
        error = 5 * np.sqrt(share * 3 / slow.size)  # a track lights about three pixels
        assert np.mean(fast > 33 * grey) == pytest.approx(share, rel=0.03, abs=error)
    assert fast.mean() == pytest.approx(slow.mean(), rel=0.04)


def test_transport_hits_obey_the_same_laws_of_number_and_length():
    frames = drawn(GammaField(5 * H, level="transport"), (100, 100), 12)
    counts = counts_of(frames)
    assert_rate(counts, expected_tracks(GammaField(5 * H), 3.0, (100, 100), exposure_s=EXPOSURE_S))
    assert_length_law(np.concatenate([frame.hits.length_px for frame in frames]) * 3.0, 5.0)


def test_salt_is_white_pixels_at_the_rate_of_tracks():
    field = GammaField(H, level="salt")
    clip = add_noise(
        np.full((6, 270, 480), 33 * 20.0, np.float32), field, Sensor(), exposure_s=1 / 12, seed=1, camera=0
    )
    white = clip.frames == 255
    assert white.sum() == pytest.approx(len(clip.hits), rel=0.03)  # two on one pixel are one
    assert clip.frames[~white].max() < 40
    assert_rate(np.bincount(clip.hits.frame), expected_tracks(field, 3.0, (270, 480), exposure_s=EXPOSURE_S))
    assert np.all(clip.hits.length_px == 0)
    assert np.all(np.isnan(clip.hits.azimuth_rad))


def test_a_hit_table_knows_its_frames():
    clip = add_noise(np.zeros((3, 60, 60), np.float32), GammaField(H), Sensor(), exposure_s=1 / 12, seed=1, camera=0)
    assert isinstance(clip.hits, GammaHits)
    assert sum(len(clip.hits.in_frame(n)) for n in range(3)) == len(clip.hits)
    assert np.all(np.diff(clip.hits.frame) >= 0)


def test_the_mask_of_a_frame_is_where_its_hits_left_charge():
    sensor = FINE
    clip = add_noise(np.zeros((3, 80, 90), np.float32), GammaField(5 * H), sensor, exposure_s=1 / 12, seed=1, camera=1)
    for n in range(3):
        assert np.array_equal(clip.hit_mask(n, at_least_e=10.0), clip.hit_charge_e(n) >= 10)
        expected = np.rint(np.minimum(clip.hit_charge_e(n) / sensor.electrons_per_level, 65535))
        assert clip.frames[n] == pytest.approx(expected, abs=1)
