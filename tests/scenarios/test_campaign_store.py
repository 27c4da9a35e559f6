"""The results store: one campaign's, one writer's, and refused in one line when anything is wrong with it."""

import shutil
import sqlite3
from dataclasses import replace

import pytest
from click.testing import CliRunner
from small_campaigns import csv_of, inline, run, small_campaign, start

from scenarios.campaign_file import read_campaign
from scenarios.cli import main
from scenarios.estimators import EstimatorSpec
from scenarios.scene_work import LeakOutcome, MethodOutcome, SceneOutcome
from scenarios.store import read_store, read_timings, writing
from scenarios.store_identity import Identity, StoreError
from scenarios.stored_run import runs_of


def identity(path):
    file = read_campaign(path)
    estimators = tuple(EstimatorSpec("method", name) for name in file.campaign.methods)
    return Identity(file.campaign, file.fingerprint(), estimators, "leakloc 0")


def outcome(scene):
    """An outcome of made-up numbers, some with many digits."""
    found = LeakOutcome(0, 0.1 + 0.2, -1e-17, True, True, False, "found", 1.0 / 3.0, 2.0 / 3.0)
    missed = LeakOutcome(1, 2.0, 1.4, True, False, True, "missed.merged", None, None, 1)
    runs = (
        MethodOutcome("paper", "ok", "", (found, missed), ("false.gamma",), 0.1, ((0.1, 1 / 3), (2.5, -0.7))),
        MethodOutcome(
            "naive", "nan", "a leak's place is not finite", (replace(missed, code="nan", paper_estimate=None),), (), 0.1
        ),
    )
    return SceneOutcome(scene.number, runs, "leakloc 0", 0.5)


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """A campaign file and a store with all of its scenes, none of them rendered."""
    folder = tmp_path_factory.mktemp("store")
    path = small_campaign(folder, repeats=20)
    fill(path, folder / "results.db", read_campaign(path).scenes())
    return path, folder / "results.db"


def fill(path, store, scenes):
    with writing(store, identity(path)) as writer:
        for scene in scenes:
            writer.add(runs_of(scene, outcome(scene)), outcome(scene))


@pytest.fixture
def own(filled, tmp_path):
    path, store = filled
    return path, shutil.copy(store, tmp_path / "results.db")


def assert_refused(store, *words):
    for command in (["show"], ["export", "--csv", "-o", "out.csv"], ["report", "-o", "out.html"]):
        result = CliRunner().invoke(main, ["campaign", command[0], str(store), *command[1:]])
        assert result.exit_code == 2, result.output
        (line,) = result.output.splitlines()
        assert line.startswith(f"Error: {store}: ")
        for word in words:
            assert word in line


def test_runs_come_back_as_they_went_in_whatever_the_order_of_scenes(filled, tmp_path):
    path, store = filled
    scenes = read_campaign(path).scenes()
    assert list(read_store(store).runs) == [run for scene in scenes for run in runs_of(scene, outcome(scene))]
    fill(path, tmp_path / "backwards.db", scenes[::-1])
    assert csv_of(tmp_path / "backwards.db") == csv_of(store)


def test_another_campaign_estimator_or_version_is_refused_and_nothing_is_written(own):
    path, store = own
    before, mine = store.read_bytes(), identity(path)
    other = replace(mine, fingerprint="0" * 64)
    for stranger, words in ((other, "another campaign"), (replace(mine, versions="leakloc 9"), "was begun with")):
        with pytest.raises(StoreError, match=words), writing(store, stranger):
            pass
    assert store.read_bytes() == before


def test_a_campaign_that_was_changed_is_refused_by_its_old_store(tmp_path):
    path, store = small_campaign(tmp_path), tmp_path / "results.db"
    run(path, store, inline(), stop_after=1)
    path.write_text(path.read_text().replace("seed = 3", "seed = 4"))
    result = CliRunner().invoke(main, ["campaign", "run", str(path), "-o", str(store)])
    assert (result.exit_code, "another campaign (small), or this one has changed" in result.output) == (2, True)


def test_a_second_writer_is_refused_and_a_reader_is_not(own):
    path, store = own
    with writing(store, identity(path)):
        with pytest.raises(StoreError, match="another run"), writing(store, identity(path)):
            pass
        assert len(read_store(store).runs) == 240
    with writing(store, identity(path)) as writer:
        assert len(writer.scenes()) == 120


@pytest.mark.parametrize("content", [b"", b"not SQLite at all " * 100, b"SQLite format 3\x00" + b"\x01" * 5000])
def test_what_is_no_store_is_refused_in_one_line_and_stays_as_it_is(tmp_path, content):
    store = tmp_path / "results.db"
    store.write_bytes(content)
    assert_refused(store, "not a results store")
    path = small_campaign(tmp_path)
    with pytest.raises(StoreError, match=r"results\.db"), writing(store, identity(path)):
        pass
    assert store.read_bytes() == content


def test_a_folder_a_missing_file_and_a_foreign_database_are_refused_in_one_line(tmp_path):
    assert_refused(tmp_path / "none.db", "no such file")
    connection = sqlite3.connect(tmp_path / "mine.db")
    connection.execute("CREATE TABLE precious (value)")
    connection.commit()
    connection.close()
    before = (tmp_path / "mine.db").read_bytes()
    assert_refused(tmp_path / "mine.db", "not a results store of leakloc")
    assert (tmp_path / "mine.db").read_bytes() == before
    result = CliRunner().invoke(main, ["campaign", "show", str(tmp_path)])
    assert (result.exit_code, "is a directory" in result.output) == (2, True)


def test_a_store_cut_short_is_refused(own):
    _, store = own
    store.write_bytes(store.read_bytes()[: 3 * store.stat().st_size // 4])
    assert_refused(store, "damaged")


def test_no_byte_of_a_result_changes_unnoticed(own):
    """Change one byte at each of many places: the store says so, or reads as it did (the byte was of no use)."""
    _, store = own
    whole, csv = store.read_bytes(), csv_of(store)
    n_refused = 0
    for place in range(200, len(whole), len(whole) // 80):
        changed = bytearray(whole)
        changed[place] ^= 0x15
        store.write_bytes(changed)
        try:
            assert csv_of(store) == csv, place
        except StoreError:
            n_refused += 1
    assert n_refused > 30


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE run SET found_observable = 1 - found_observable WHERE run = 7",
        "UPDATE leak SET error_m = error_m + 1e-15 WHERE run = 6 AND leak = 0",
        "UPDATE run SET arm_values = '[' WHERE run = 0",
        "DELETE FROM leak WHERE run = 3",
        "DELETE FROM run WHERE run = 3",
        "UPDATE campaign SET value = '{}' WHERE key = 'campaign'",
        "DROP TABLE leak",
    ],
)
def test_a_store_that_was_written_to_by_hand_is_refused(own, statement):
    _, store = own
    connection = sqlite3.connect(store)
    connection.execute(statement)
    connection.commit()
    connection.close()
    assert_refused(store, "damaged")


def test_a_killed_start_leaves_no_half_store(tmp_path):
    path = small_campaign(tmp_path)
    program = start(path, tmp_path / "results.db")
    program.kill()
    program.communicate()
    (tmp_path / f".results.db.partial-{program.pid}").write_bytes(b"half")
    with writing(tmp_path / "results.db", identity(path)):
        assert sorted(p.name for p in tmp_path.iterdir()) == ["results.db", "small.toml"]


def test_times_stand_in_a_table_of_their_own(filled):
    _, store = filled
    connection = sqlite3.connect(store)
    times = connection.execute("SELECT run, render_s, method_s FROM timing").fetchall()
    others = {
        name
        for table in ("run", "leak")
        for (name,) in connection.execute(f"SELECT name FROM pragma_table_info('{table}')")
    }
    connection.close()
    assert times == [(run, 0.5, 0.1) for run in range(240)]
    assert not {name for name in others if name.endswith("_s")}
    assert read_timings(store) == (pytest.approx(60.0), pytest.approx(24.0))
