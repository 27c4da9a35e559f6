"""Closed forms of the gamma field against textbook and design numbers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from noise import (
    GammaField,
    Sensor,
    expected_deposit_kev,
    expected_tracks,
    mean_pixels_per_track,
    normal_incidence_charge_e,
    preset,
    track_length_survival,
    tracks_per_cm2_gy,
)
from noise.compton import cross_section_b, crossing_electrons, edge_kev, recoil_angle_cos, recoil_spectrum_b_kev
from noise.silicon import csda_range_um, energy_after_kev, stopping_power_mev_cm2_g, transport_free_path_um

pytestmark = [pytest.mark.statistical, pytest.mark.usefixtures("fresh_draws")]

HD = (540, 960)
EXPOSURE_S = 1 / 12


def test_stopping_power_is_that_of_icru_37():
    energy = np.array([10, 20, 50, 100, 200, 300, 400, 477.0])
    table = [16.89, 10.10, 5.174, 3.264, 2.235, 1.892, 1.729, 1.656]
    assert stopping_power_mev_cm2_g(energy) == pytest.approx(table, rel=1e-3)


def test_range_is_the_sum_of_path_over_all_energies_down_to_rest():
    energy = np.array([10, 20, 50, 100, 200, 300, 400, 477.0])
    assert csda_range_um(energy) == pytest.approx([1.5, 4.9, 24.0, 78.4, 243, 454, 693, 888], rel=0.01)


@given(st.floats(5, 1500), st.floats(0, 1))
def test_an_electron_after_part_of_its_range_has_the_energy_of_the_rest(energy_kev, part):
    path_um = part * float(csda_range_um(energy_kev))
    left_kev = float(energy_after_kev(energy_kev, path_um))
    if left_kev > 1:
        assert float(csda_range_um(left_kev)) == pytest.approx(float(csda_range_um(energy_kev)) - path_um, rel=1e-3)


def test_transport_mean_free_paths_are_the_designs():
    assert transport_free_path_um(np.array([100.0, 300.0])) == pytest.approx([34.5, 207], rel=0.01)


def test_klein_nishina_gives_the_cross_section_edge_and_mean_recoil_of_cs_137():
    assert cross_section_b(661.7) == pytest.approx(0.25620, rel=2e-4)
    assert edge_kev(661.657) == pytest.approx(477.33, abs=0.02)
    assert crossing_electrons(661.7).mean_recoil_kev == pytest.approx(252.46, rel=1e-3)
    assert crossing_electrons(661.7).mean_range_um == pytest.approx(392, rel=3e-3)


def test_low_photon_energies_approach_the_thomson_cross_section():
    assert cross_section_b(0.5) == pytest.approx(0.66525 * (1 - 2 * 0.5 / 511), rel=1e-3)


@given(st.floats(300, 1500))
def test_no_recoil_is_above_the_edge_and_the_hardest_flies_straight_on(photon_kev):
    edge = edge_kev(photon_kev)
    assert recoil_spectrum_b_kev(np.array([edge * 1.001]), photon_kev) == 0
    assert recoil_angle_cos(np.array([edge]), photon_kev) == pytest.approx(1, abs=1e-9)


def test_crossing_electrons_have_the_slowing_down_spectrum():
    quantiles = crossing_electrons(661.7).quantile_kev(np.array([0.05, 0.25, 0.5, 0.75, 0.95]))
    assert quantiles == pytest.approx([46, 128, 214, 307, 411], abs=1.0)


@pytest.mark.parametrize(
    ("photon_kev", "per_cm2_gy"),
    [(300, 6.0e8), (400, 7.8e8), (500, 9.3e8), (600, 1.06e9), (661.7, 1.129e9), (1252.9, 1.53e9)],
)
def test_tracks_per_area_and_dose_grow_with_photon_energy(photon_kev, per_cm2_gy):
    assert tracks_per_cm2_gy(GammaField(photon_energy_kev=photon_kev)) == pytest.approx(per_cm2_gy, rel=6e-3)


@pytest.mark.parametrize(("dose", "tracks"), [(10.0, 12200), (3.3, 4030), (1.7, 2075)])
def test_tracks_per_frame_of_the_papers_levels(dose, tracks):
    assert expected_tracks(GammaField(dose), 3.0, HD, exposure_s=EXPOSURE_S) == pytest.approx(tracks, rel=2e-3)


@pytest.mark.parametrize(("pitch_um", "tracks"), [(1.75, 4150), (4.5, 27500), (6.0, 48800)])
def test_tracks_per_frame_grow_with_the_area_of_a_pixel(pitch_um, tracks):
    assert expected_tracks(GammaField(10.0), pitch_um, HD, exposure_s=EXPOSURE_S) == pytest.approx(tracks, rel=3e-3)


@given(st.floats(0.01, 100), st.floats(1e-3, 1), st.integers(1, 500), st.integers(1, 500))
def test_expected_tracks_are_linear_in_dose_exposure_and_area(dose, exposure_s, height, width):
    unit = expected_tracks(GammaField(1.0), 3.0, (1, 1), exposure_s=1.0)
    expected = expected_tracks(GammaField(dose), 3.0, (height, width), exposure_s=exposure_s)
    assert expected == pytest.approx(unit * dose * exposure_s * height * width)


def test_mean_deposit_per_pixel_is_dose_times_mass():
    assert expected_deposit_kev(GammaField(10.0), 3.0, 5.0, exposure_s=EXPOSURE_S) == pytest.approx(0.151, abs=0.001)


def test_length_survival_is_a_half_a_fifth_and_a_tenth_at_one_two_and_three_thicknesses():
    assert track_length_survival(np.array([5.0, 10.0, 15.0]), 5.0) == pytest.approx([0.5, 0.2, 0.1])
    assert track_length_survival(np.array([5 * 3.0, 10 * 3.0]), 5.0) == pytest.approx([0.10, 0.027], abs=1e-3)


def test_mean_charge_at_normal_incidence_is_853_electrons():
    assert normal_incidence_charge_e(GammaField(), 5.0) == pytest.approx(853, rel=0.02)


def test_straight_tracks_touch_nine_and_a_half_percent_of_the_pixels_at_h():
    per_pixel = expected_tracks(GammaField(10.0), 3.0, (1, 1), exposure_s=EXPOSURE_S)
    touched = 1 - np.exp(-per_pixel * mean_pixels_per_track(3.0, 5.0))
    assert 0.093 < touched < 0.097


def test_a_dose_rate_may_be_a_function_of_time():
    field = GammaField(lambda t_s: 2.0 + t_s)
    one = expected_tracks(field, 3.0, HD, exposure_s=EXPOSURE_S, t_s=0.0)
    assert expected_tracks(field, 3.0, HD, exposure_s=EXPOSURE_S, t_s=2.0) == pytest.approx(2 * one)


def test_a_beam_along_the_sensor_crosses_it_less_often_than_one_onto_it():
    onto = tracks_per_cm2_gy(GammaField(photon_energy_kev=1252.9, direction=(0, 0, 1)))
    along = tracks_per_cm2_gy(GammaField(photon_energy_kev=1252.9, direction=(1, 0, 0)))
    isotropic = tracks_per_cm2_gy(GammaField(photon_energy_kev=1252.9))
    assert along < isotropic < onto


@given(st.floats(allow_nan=True, allow_infinity=True).filter(lambda e: not 300 <= e <= 1500))
def test_photon_energies_outside_the_model_are_refused(photon_kev):
    with pytest.raises(ValueError, match="photon_energy_kev must be 300 to 1500"):
        GammaField(photon_energy_kev=photon_kev)


@pytest.mark.parametrize("dose", [-1.0, np.nan, np.inf])
def test_dose_rates_that_are_not_rates_are_refused(dose):
    with pytest.raises(ValueError, match="dose_rate_gy_h must be >= 0"):
        GammaField(dose)
    with pytest.raises(ValueError, match="dose_rate_gy_h must be >= 0"):
        GammaField(lambda _: dose).dose_rate_at(0.0)


def test_directions_and_levels_that_do_not_exist_are_refused():
    with pytest.raises(ValueError, match="direction"):
        GammaField(direction=(0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="level"):
        GammaField(level="snow")  # type: ignore[arg-type]


def test_presets_are_the_papers_dose_rates_on_the_default_sensor():
    assert [preset(name).field.dose_rate_gy_h for name in "LMH"] == [1.7, 3.3, 10.0]
    assert all(preset(name).sensor == Sensor() and preset(name).exposure_s == EXPOSURE_S for name in "LMH")
    with pytest.raises(ValueError, match="published-converter"):
        preset("XL")
