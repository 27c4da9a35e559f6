"""Damaged and forged results stores: refused in a line, or the whole one's table; nothing in a database is run."""

import random
import shutil
import sqlite3
from contextlib import closing
from dataclasses import replace

import pytest
from damage import damaged_bytes
from verdicts import assert_bearable, assert_refused, leakloc

from scenarios.campaign_file import read_campaign
from scenarios.estimators import EstimatorSpec
from scenarios.scene_work import LeakOutcome, MethodOutcome, SceneOutcome
from scenarios.store import writing
from scenarios.store_identity import Identity
from scenarios.stored_run import runs_of

CAMPAIGN = (
    'name = "small"\nscenario = "plain"\nrepeats = 3\n[[axis]]\nkey = "gamma.dose_rate_gy_h"\nvalues = [0.0, 5.0]\n'
)


def runs_and_outcome(scene):
    found = LeakOutcome(0, 0.1, -0.2, True, True, False, "found", 1.0 / 3.0, 2.0 / 3.0, 0)
    missed = LeakOutcome(1, 2.0, 1.4, True, False, True, "missed.merged", None, None, 1)
    run = MethodOutcome("robust", "ok", "", (found, missed), ("false.gamma",), 0.1, ((0.1, 0.1), (2.5, -0.7)))
    outcome = SceneOutcome(scene.number, (run,), "leakloc 0", 0.5)
    return runs_of(scene, outcome), outcome


def identity(file):
    return Identity(file.campaign, file.fingerprint(), (EstimatorSpec("method", "robust"),), "leakloc 0")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A store whose results are made up, and the campaign that it is of."""
    folder = tmp_path_factory.mktemp("store")
    (folder / "campaign.toml").write_text(CAMPAIGN)
    file = read_campaign(folder / "campaign.toml")
    with writing(
        folder / "whole.db",
        Identity(file.campaign, file.fingerprint(), (EstimatorSpec("method", "robust"),), "leakloc 0"),
    ) as writer:
        for scene in file.scenes():
            writer.add(*runs_and_outcome(scene))
    return folder / "whole.db"


def table_of(store):
    verdict = leakloc("campaign", "show", store)
    assert verdict.code == 0, verdict
    return verdict.out.replace(str(store), "")


def damaged_stores(folder, whole, seed, numbers, tally):
    table, path = table_of(whole), folder / "damaged.db"
    commands = (("show", path), ("export", "--csv", path, "-o", folder / "x"), ("report", path, "-o", folder / "x"))
    for number in numbers:
        rng = random.Random(f"store {seed} {number}")
        raw = whole.read_bytes()
        for _ in range(rng.choice((1, 1, 3, 20))):
            raw = damaged_bytes(raw, rng)
        path.write_bytes(raw)
        try:
            verdict = leakloc("campaign", *rng.choice(commands), inside=folder)
            assert_bearable(verdict)
            if verdict.code == 2:
                assert str(path) in verdict.error, verdict
                assert {p.name for p in folder.iterdir()} <= {path.name, f"{path.name}-journal"}
            else:
                assert table_of(path).split("\nworkers")[0] == table.split("\nworkers")[0]
        except BaseException as error:
            error.add_note(f"store {number} of seed {seed}")
            raise
        (folder / "x").unlink(missing_ok=True)
        tally["refused with exit code 2" if verdict.code == 2 else "accepted with the table of the whole one"] += 1


def test_a_damaged_store_is_refused_or_has_the_table_of_the_whole_one(tmp_path, whole, tally):
    damaged_stores(tmp_path, whole, 0, range(40), tally)
    assert sum(tally.values()) == 40
    assert tally["refused with exit code 2"] > 0


@pytest.mark.deep
def test_a_thousand_damaged_stores_are_refused_or_have_the_table_of_the_whole_one(tmp_path, whole, harness_seed, tally):
    damaged_stores(tmp_path, whole, harness_seed, range(1000), tally)
    assert sum(tally.values()) == 1000
    assert tally["refused with exit code 2"] > 0


FOREVER = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i FROM n"
FORGERIES = {
    "a view without end": f"DROP TABLE timing; CREATE VIEW timing AS {FOREVER}",
    "a view for the runs": f"ALTER TABLE run RENAME TO other; CREATE VIEW run AS SELECT * FROM other, ({FOREVER})",
    "a trigger": "CREATE TRIGGER t AFTER INSERT ON run BEGIN DELETE FROM leak; END",
    "a table too many": "CREATE TABLE more (x)",
    "an index on an expression": "CREATE INDEX i ON run (abs(run))",
    "a column too many": "ALTER TABLE run ADD COLUMN more",
    "a cell of 5 MB": "UPDATE run SET detail = zeroblob(5000000)",
    "a text of 6 MB": "UPDATE run SET detail = replace(hex(zeroblob(3000000)), '0', 'x')",
    "no text": "UPDATE run SET method = CAST(x'fffe' AS TEXT)",
    "nested JSON": "UPDATE run SET arm_values = replace(hex(zeroblob(50000)), '0', '[')",
    "a nested campaign": "UPDATE campaign SET value = replace(hex(zeroblob(50000)), '0', '[')",
    "no campaign": "DELETE FROM campaign",
    "words for numbers": "UPDATE leak SET x_m = 'far'",
    "a place at infinity": "UPDATE leak SET x_m = 9e999",
    "another truth value": "UPDATE leak SET in_view = 7",
}


@pytest.mark.parametrize("kind", FORGERIES)
def test_a_forged_store_is_refused_and_nothing_in_it_is_run(tmp_path, whole, kind):
    path = shutil.copy(whole, tmp_path / "forged.db")
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(FORGERIES[kind])
    before = path.read_bytes()
    assert_refused(leakloc("campaign", "show", path), "forged.db: ")
    assert path.read_bytes() == before


# whoever forges a store can forge its digests, too: then the values themselves must be such as a run has
IMPOSSIBLE = {
    "a leak of an estimate that is not there": lambda run: replace(run, estimates_m=()),
    "another method": lambda run: replace(run, method="guess"),
    "a word for a place": lambda run: replace(run, leaks=(replace(run.leaks[0], x_m="far"), run.leaks[1])),
    "a word for a seed": lambda run: replace(run, seed="seven"),
    "a list for a value": lambda run: replace(run, values={"gamma.dose_rate_gy_h": [1]}),
    "three coordinates": lambda run: replace(run, estimates_m=((1, 2, 3),)),
    "other axes": lambda run: replace(run, values={"rig.baseline_m": 1.0}),
    "no axes": lambda run: replace(run, values={}),
}


@pytest.mark.parametrize("kind", IMPOSSIBLE)
def test_a_run_that_cannot_be_is_refused_though_its_digest_fits(tmp_path, kind):
    (tmp_path / "campaign.toml").write_text(CAMPAIGN)
    file, path = read_campaign(tmp_path / "campaign.toml"), tmp_path / "forged.db"
    with writing(
        path, Identity(file.campaign, file.fingerprint(), (EstimatorSpec("method", "robust"),), "leakloc 0")
    ) as writer:
        for scene in file.scenes():
            (run,), outcome = runs_and_outcome(scene)
            forged = IMPOSSIBLE[kind](run) if scene.number == 4 else run
            writer.add([forged], outcome)
    assert_refused(leakloc("campaign", "show", path), "forged.db: damaged")
    assert_refused(leakloc("campaign", "report", path, "-o", tmp_path / "x.html"), "forged.db: damaged")
