"""The slab Monte Carlo, the bank made from it, and the footprints made from the bank."""

import numpy as np
import pytest

import noise.bank
from noise import GammaField, expected_deposit_kev, expected_tracks
from noise.bank import BATCH, BankKey, bank_for, bank_hash, make_batch, read_bank, write_bank
from noise.beam import beam_crossing, isotropic_crossing
from noise.compton import crossing_electrons
from noise.direct import collect
from noise.footprints import PHASES, footprints_for
from noise.silicon import PAIR_ENERGY_KEV, elastic_free_path_um, energy_after_kev, loss_kev_um, transport_free_path_um
from noise.straggling import (
    INNER_LEVEL_KEV,
    OUTER_LEVEL_KEV,
    collision_rates_per_um,
    largest_transfer_kev,
    sample_loss_kev,
)
from noise.transport import normals, scatter, screening, transport

N = 32768
DEPOSIT_QUARTILES_KEV = {0.25: 2.10, 0.5: 3.46, 0.75: 6.70}


@pytest.fixture(scope="module")
def deposit_kev():
    rng = np.random.default_rng(1)
    kinetic_kev, heading = isotropic_crossing(661.7, N, rng=rng)
    return transport(kinetic_kev, heading, 5.0, rng=rng).per_track_kev(N)


def assert_quartiles(deposit_kev, allowance):
    """Reference quartiles lie between order statistics 5 standard errors apart, widened by the allowance."""
    ordered = np.sort(deposit_kev)
    for probability, reference in DEPOSIT_QUARTILES_KEV.items():
        error = 5 * np.sqrt(probability * (1 - probability) / len(ordered))
        low, high = np.quantile(ordered, [probability - error, probability + error])
        assert low * (1 - allowance) <= reference <= high * (1 + allowance)


def assert_dose(deposit_kev, allowance):
    """Mean deposit times tracks per pixel is dose times mass, within 5 standard errors and the allowance."""
    per_pixel = expected_tracks(GammaField(10.0), 3.0, (1, 1), exposure_s=1 / 12)
    conserved = expected_deposit_kev(GammaField(10.0), 3.0, 5.0, exposure_s=1 / 12)
    error = 5 * deposit_kev.std() / np.sqrt(len(deposit_kev)) / deposit_kev.mean()
    assert deposit_kev.mean() * per_pixel == pytest.approx(conserved, rel=allowance + error)


def test_transported_deposits_have_the_designs_quartiles(deposit_kev):
    assert_quartiles(deposit_kev, 0.04)


def test_transported_deposits_conserve_the_dose(deposit_kev):
    assert_dose(deposit_kev, 0.03)


def test_quartiles_catch_tracks_without_straggling():
    rng = np.random.default_rng(2)
    kinetic_kev, heading = isotropic_crossing(661.7, N, rng=rng)
    smooth_kev = np.minimum(loss_kev_um(kinetic_kev) * 5.0 / heading[:, 2], kinetic_kev)
    with pytest.raises(AssertionError):
        assert_quartiles(smooth_kev, 0.04)


def test_quartiles_and_dose_catch_uniform_directions():
    rng = np.random.default_rng(3)
    kinetic_kev, heading = isotropic_crossing(661.7, N, rng=rng)
    cosine = np.maximum(rng.random(N), 1e-4)
    heading = np.stack([np.sqrt(1 - cosine**2), 0 * cosine, cosine], axis=1)
    planted_kev = transport(kinetic_kev, heading, 5.0, rng=rng).per_track_kev(N)
    with pytest.raises(AssertionError):
        assert_quartiles(planted_kev, 0.04)
    with pytest.raises(AssertionError):
        assert_dose(planted_kev, 0.03)


def test_the_bank_keeps_quartiles_dose_and_charge_spread():
    bank = read_bank()
    assert_quartiles(bank.deposit_kev.astype(float), 0.10)
    assert_dose(bank.deposit_kev.astype(float), 0.05)
    charge = bank.deposit_kev.astype(float) / PAIR_ENERGY_KEV
    assert np.sqrt(np.mean(charge**2) / np.mean(charge)) == pytest.approx(72, rel=0.06)
    assert np.median(charge) == pytest.approx(946, rel=0.05)
    assert bank.deposit_kev.mean() == pytest.approx(6.41, rel=0.04)


def test_nobody_deposits_more_than_it_brought():
    rng = np.random.default_rng(4)
    kinetic_kev, heading = isotropic_crossing(661.7, 2000, rng=rng)
    deposits = transport(kinetic_kev, heading, 5.0, rng=rng)
    assert np.all(deposits.per_track_kev(2000) <= kinetic_kev + 1e-9)
    assert np.all(deposits.energy_kev >= 0)


def test_a_thick_layer_stops_every_slow_electron():
    rng = np.random.default_rng(5)
    n = 300
    heading = np.tile([0.0, 0.0, 1.0], (n, 1))
    deposits = transport(np.full(n, 30.0), heading, 1000.0, rng=rng).per_track_kev(n)
    backscattered = deposits < 30.0 - 1e-6
    assert backscattered.mean() < 0.25  # Si backscatters 15-20 % of normally incident slow electrons
    assert np.all(deposits[~backscattered] == pytest.approx(30.0))


def test_mean_loss_on_a_short_path_is_the_stopping_power():
    rng = np.random.default_rng(6)
    for energy in (30.0, 100.0, 300.0):
        lost = sample_loss_kev(np.full(200_000, energy), np.full(200_000, 0.2), rng=rng)
        error = 5 * lost.std() / np.sqrt(len(lost))
        assert lost.mean() == pytest.approx(float(loss_kev_um(energy)) * 0.2, abs=error)


def test_losses_of_two_half_paths_are_those_of_the_whole():
    rng = np.random.default_rng(7)
    energy = np.full(100_000, 200.0)
    whole = sample_loss_kev(energy, np.full(100_000, 1.0), rng=rng)
    halves = sum(sample_loss_kev(energy, np.full(100_000, 0.5), rng=rng) for _ in range(2))
    for probability in (0.1, 0.5, 0.9):
        assert np.quantile(halves, probability) == pytest.approx(np.quantile(whole, probability), rel=0.03)


def test_collision_rates_times_their_losses_are_the_stopping_power():
    energy = np.array([20.0, 100.0, 400.0])
    outer, inner, tail = collision_rates_per_um(energy)
    largest = largest_transfer_kev(energy)
    mean_tail = np.log(largest / 0.010) / (1 / 0.010 - 1 / largest)
    total = outer * OUTER_LEVEL_KEV + inner * INNER_LEVEL_KEV + tail * mean_tail
    assert total == pytest.approx(loss_kev_um(energy), rel=1e-9)


def test_many_collisions_turn_an_electron_by_the_transport_mean_free_path():
    rng = np.random.default_rng(8)
    n, energy, n_collisions = 20_000, 100.0, 60
    path_um = n_collisions * float(elastic_free_path_um(energy))
    heading = np.tile([0.0, 0.0, 1.0], (n, 1))
    a = np.full(n, float(screening(energy)))
    for _ in range(n_collisions):
        heading = scatter(heading, a, rng=rng)
    expected = np.exp(-path_um / float(transport_free_path_um(energy)))
    error = 5 * heading[:, 2].std() / np.sqrt(n)
    assert heading[:, 2].mean() == pytest.approx(expected, abs=error + 2e-3)


def test_normals_are_orthonormal_everywhere_on_the_sphere():
    rng = np.random.default_rng(9)
    heading = rng.standard_normal((1000, 3))
    heading /= np.linalg.norm(heading, axis=1, keepdims=True)
    heading[0], heading[1] = (0, 0, -1), (0, 0, 1)
    frame = np.stack([heading, *normals(heading)], axis=1)
    assert np.einsum("nij,nkj->nik", frame, frame) == pytest.approx(np.tile(np.eye(3), (1000, 1, 1)), abs=1e-9)


def test_the_shipped_bank_is_what_transport_makes():
    bank, batch = read_bank(), make_batch(BankKey(), 3)
    rows = slice(3 * BATCH, 4 * BATCH)
    assert bank.key == BankKey()
    assert bank.length_um[rows] == pytest.approx(batch.length_um, rel=1e-5)
    assert bank.deposit_kev[rows] == pytest.approx(batch.deposit_kev, rel=1e-5)
    cells = (bank.track >= rows.start) & (bank.track < rows.stop)
    assert bank.charge_e[cells] == pytest.approx(batch.charge_e, rel=1e-5)
    assert np.array_equal(bank.cell_x[cells], batch.cell_x)


def test_a_bank_that_was_changed_is_refused(tmp_path, monkeypatch):
    bank = read_bank()
    path = tmp_path / "bank.npz"
    write_bank(bank, path)
    with np.load(path, allow_pickle=False) as stored:
        columns = {name: stored[name] for name in stored.files}
    columns["charge_e"] = columns["charge_e"] * np.float32(1.01)
    np.savez_compressed(path, **columns)
    monkeypatch.setattr(noise.bank, "SHIPPED", path)
    with pytest.raises(ValueError, match="hash"):
        read_bank.__wrapped__()
    assert bank_hash(bank) != ""


def test_another_field_or_thickness_gets_a_bank_of_its_own():
    thick = bank_for(BankKey(thickness_um=10.0, n_tracks=4096))
    assert np.median(thick.length_um) == pytest.approx(10.0, rel=0.01)
    assert np.median(thick.deposit_kev) > 1.8 * np.median(read_bank().deposit_kev)


def test_electrons_of_a_beam_keep_the_spectrum_of_fluence_weighted_by_their_cosine():
    rng = np.random.default_rng(10)
    kinetic_kev, heading = beam_crossing(1252.9, (0.0, 0.0, 1.0), 20_000, rng=rng)
    assert np.linalg.norm(heading, axis=1) == pytest.approx(np.ones(20_000))
    # The fast ones have had no time to turn: they cross more steeply than the slow ones.
    fast = kinetic_kev > np.quantile(kinetic_kev, 0.9)
    slow = kinetic_kev < np.quantile(kinetic_kev, 0.1)
    assert heading[fast, 2].mean() > heading[slow, 2].mean() + 0.1
    assert np.median(kinetic_kev) == pytest.approx(
        float(crossing_electrons(1252.9).quantile_kev(np.array(0.5))), rel=0.15
    )


def test_a_footprint_is_the_diffused_track_at_its_phase():
    """The fast table against exact diffusion of the same cells: a quarter-pixel grid costs less than 3 % of a pixel."""
    prints = footprints_for(BankKey(), 3.0, 1.2)
    bank = prints.bank
    rng = np.random.default_rng(11)
    short = np.flatnonzero(prints.reach_px <= 10)
    for track in rng.choice(short, 40, replace=False):
        a, b = rng.integers(0, PHASES, 2)
        label = (track * PHASES + a) * PHASES + b
        rows = slice(prints.start[label], prints.start[label] + prints.count[label])
        fast = np.zeros((24, 24))
        pixels = prints.pixels[rows]
        fast[12 + pixels["dy_px"], 12 + pixels["dx_px"]] = pixels["charge_e"]
        slow = np.zeros((24, 24))
        cells = bank.track == track
        # The table rounds cells to its own grid; so does this, to hold the diffusion to it.
        fine_x = np.rint(bank.cell_x[cells] * (0.5 * PHASES / 3.0)) / PHASES
        fine_y = np.rint(bank.cell_y[cells] * (0.5 * PHASES / 3.0)) / PHASES
        x, y = 11.5 + (b + 0.5) / PHASES + fine_x, 11.5 + (a + 0.5) / PHASES + fine_y
        collect(slow, x, y, bank.charge_e[cells].astype(float), 0.4)
        assert fast.sum() == pytest.approx(slow.sum(), rel=1e-4)
        # Cells are squares of a quarter pixel, points here: their width adds 0.07 px to 0.4 px in quadrature.
        assert np.abs(fast - slow).max() < 0.03 * slow.max() + 2


def test_energy_left_after_more_than_the_range_is_nothing():
    assert energy_after_kev(np.array([50.0]), np.array([30.0])) == 0


def test_tracks_longer_than_a_thousand_fine_pixels_have_footprints():
    prints = footprints_for(BankKey(thickness_um=50.0, n_tracks=24), 0.25, 0.5)
    assert prints.reach_px.max() > 512
    assert prints.track_charge_e == pytest.approx(
        np.add.reduceat(prints.pixels["charge_e"], prints.start[:: PHASES**2]) / PHASES**2, rel=0.02, abs=5.0
    )
