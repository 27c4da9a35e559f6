"""The results store of a campaign: SQLite, one writer, one commit a scene, so that a kill loses one scene at most.

Rollback journal and full synchronisation: about 1 ms a commit. (WAL with several connections has a corruption bug in
SQLite up to 3.51.2.) Times of rendering and estimating stand in a table of their own: everything else in a store is the
same whatever the number of workers and of stops.
"""

import fcntl
import glob
import json
import os
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any

from scenarios.campaign import Campaign
from scenarios.estimators import EstimatorSpec
from scenarios.output_folder import check_target, is_alive
from scenarios.scene_work import LeakOutcome, SceneOutcome
from scenarios.store_identity import Identity, StoreError, check_same
from scenarios.stored_run import COUNTED, Run, valid_run

APPLICATION_ID = 0x1EA10C  # marks a SQLite file as a store of leakloc
FORMAT = 2
MAX_STORE_BYTES = 4_000_000_000
MAX_CELL_BYTES = 4_000_000
WAIT_FOR_READERS_S = 60.0

SCHEMA = f"""
CREATE TABLE campaign (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE run (
  run INTEGER PRIMARY KEY, scene INTEGER NOT NULL, arm INTEGER NOT NULL, repeat INTEGER NOT NULL,
  arm_values TEXT NOT NULL, scenario TEXT NOT NULL, overrides TEXT NOT NULL, seed INTEGER NOT NULL,
  versions TEXT NOT NULL, method TEXT NOT NULL, outcome TEXT NOT NULL, detail TEXT NOT NULL,
  {", ".join(f"found_{which} INTEGER NOT NULL, of_{which} INTEGER NOT NULL" for which in COUNTED)},
  false_leaks INTEGER NOT NULL, false_codes TEXT NOT NULL, mean_error_m REAL,
  estimates_m TEXT NOT NULL, sha256 TEXT NOT NULL
);
CREATE TABLE leak (
  run INTEGER NOT NULL, leak INTEGER NOT NULL, x_m REAL NOT NULL, y_m REAL NOT NULL, in_view INTEGER NOT NULL,
  observable INTEGER NOT NULL, near_wall INTEGER NOT NULL, code TEXT NOT NULL, error_m REAL, error_px REAL,
  paper_estimate INTEGER,
  PRIMARY KEY (run, leak)
) WITHOUT ROWID;
CREATE TABLE timing (run INTEGER PRIMARY KEY, render_s REAL, method_s REAL);
PRAGMA application_id = {APPLICATION_ID};
PRAGMA user_version = {FORMAT};
"""


@dataclass(frozen=True)
class Stored:
    """Content of a store: its identity and its runs, by number."""

    identity: Identity
    runs: tuple[Run, ...]


class Writer:
    """The one writer of a store."""

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        """Write through an open connection."""
        self._path, self._connection = path, connection

    def scenes(self) -> frozenset[int]:
        """Numbers of the scenes that are there."""
        return frozenset(number for (number,) in self._connection.execute("SELECT DISTINCT scene FROM run"))

    def add(self, runs: Sequence[Run], outcome: SceneOutcome) -> None:
        """Add all runs of a scene, whole or not at all; raises StoreError when the disk is full or the like."""
        with _errors_told(self._path), self._connection:
            self._connection.executemany(_insert("run", len(RUN_COLUMNS)), [_row_of(run) for run in runs])
            leaks = [(run.run, *asdict(leak).values()) for run in runs for leak in run.leaks]
            self._connection.executemany(_insert("leak", 1 + len(fields(LeakOutcome))), leaks)
            times = [(run.run, outcome.seconds, method.seconds) for run, method in zip(runs, outcome.runs, strict=True)]
            self._connection.executemany(_insert("timing", 3), times)


@contextmanager
def writing(path: Path, identity: Identity) -> Iterator[Writer]:
    """Open a store for its one writer, making it where there is none.

    Raises StoreError when it is another campaign's, damaged, no store at all, or another run is writing to it.
    """
    check_target(path)
    if not path.exists():
        _create(path, identity)
    with path.open("rb") as stream:  # open until the connection is closed: closing it would drop SQLite's own locks
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise StoreError(f"{path}: another run is writing to it") from None
        with closing(_connected(path)) as connection:
            with _errors_told(path):
                check_same(path, _identity_in(connection), identity)
                list(_runs_in(connection, identity))  # a damaged store is not gone on with
            yield Writer(path, connection)


def read_store(path: Path) -> Stored:
    """Read a store, every run checked against its digest; raises StoreError."""
    if not path.is_file():
        raise StoreError(f"{path}: {'must be a file, not a folder or device' if path.exists() else 'no such file'}")
    with closing(_connected(path)) as connection, _errors_told(path):
        identity = _identity_in(connection)
        return Stored(identity, tuple(_runs_in(connection, identity)))


def read_timings(path: Path) -> tuple[float, float]:
    """Seconds that rendering and all methods took in total."""
    each = "SELECT MIN(render_s) AS render_s, SUM(method_s) AS method_s FROM timing JOIN run USING (run) GROUP BY scene"
    with closing(_connected(path)) as connection, _errors_told(path):
        ((render_s, method_s),) = connection.execute(f"SELECT TOTAL(render_s), TOTAL(method_s) FROM ({each})")
        return render_s, method_s


RUN_COLUMNS = (
    *("run", "scene", "arm", "repeat", "arm_values", "scenario", "overrides", "seed", "versions", "method", "outcome"),
    *("detail", *(f"{kind}_{which}" for which in COUNTED for kind in ("found", "of"))),
    *("false_leaks", "false_codes", "mean_error_m", "estimates_m", "sha256"),
)
LEAK_COLUMNS = tuple(field.name for field in fields(LeakOutcome))


def _insert(table: str, n_columns: int) -> str:
    return f"INSERT INTO {table} VALUES ({', '.join('?' * n_columns)})"


def _row_of(run: Run) -> tuple[Any, ...]:
    counts = [number[which] for which in COUNTED for number in (run.found, run.of)]
    return (
        *(run.run, run.scene, run.arm, run.repeat, json.dumps(run.values), run.base, json.dumps(run.overrides)),
        *(run.seed, run.versions, run.method, run.outcome, run.detail, *counts),
        *(len(run.false_codes), json.dumps(run.false_codes), run.mean_error_m),
        *(json.dumps(run.estimates_m), run.sha256()),
    )


def _create(path: Path, identity: Identity) -> None:
    """Make an empty store under another name and put it into place whole."""
    for leftover in path.parent.glob(f".{glob.escape(path.name)}.partial-*"):
        pid = leftover.name.rpartition("-")[2]
        if pid.isdecimal() and not is_alive(int(pid)):
            leftover.unlink(missing_ok=True)
    partial = path.with_name(f".{path.name}.partial-{os.getpid()}")
    try:
        with _errors_told(path), closing(sqlite3.connect(partial)) as connection:
            connection.execute("PRAGMA journal_mode = MEMORY")
            connection.executescript(SCHEMA)
            with connection:
                connection.executemany(_insert("campaign", 2), identity.as_rows().items())
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _connected(path: Path) -> sqlite3.Connection:
    """Connect to a store that exists; read and write, for a killed writer's last commit may have to be undone."""
    with _errors_told(path):
        if path.stat().st_size > MAX_STORE_BYTES:
            raise StoreError(f"{path}: must be at most {MAX_STORE_BYTES} bytes")
        connection = sqlite3.connect(f"{path.absolute().as_uri()}?mode=rw", uri=True, timeout=WAIT_FOR_READERS_S)
        try:
            _begin(path, connection)
        except BaseException:
            connection.close()
            raise
        return connection


def _begin(path: Path, connection: sqlite3.Connection) -> None:
    """Check that a database is a whole store of this format, and say how it is to be written."""
    connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_CELL_BYTES)
    connection.execute("PRAGMA trusted_schema = OFF")
    if connection.execute("PRAGMA application_id").fetchone() != (APPLICATION_ID,):
        raise StoreError(f"{path}: is not a results store of leakloc")
    ((version,),) = connection.execute("PRAGMA user_version")
    if version != FORMAT:
        raise StoreError(f"{path}: has format {version}; this version reads and writes {FORMAT}")
    if _tables_of(connection) != _our_tables():  # a view or trigger in their place could do anything, for ever
        raise StoreError(f"{path}: damaged: its tables are not those of a results store")
    for pragma in ("journal_mode = DELETE", "synchronous = FULL"):
        connection.execute(f"PRAGMA {pragma}")
    ((verdict,),) = connection.execute("PRAGMA quick_check(1)")
    if verdict != "ok":
        raise StoreError(f"{path}: damaged: {verdict}")


def _tables_of(connection: sqlite3.Connection) -> list[tuple[str, ...]]:
    return connection.execute("SELECT type, name, sql FROM sqlite_master ORDER BY name").fetchall()


@cache
def _our_tables() -> list[tuple[str, ...]]:
    with closing(sqlite3.connect(":memory:")) as connection:
        connection.executescript(SCHEMA)
        return _tables_of(connection)


@contextmanager
def _errors_told(path: Path) -> Iterator[None]:
    """Turn what SQLite and the content of a store can say into a StoreError."""
    try:
        yield
    except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
        busy = "locked" in str(error) or "full" in str(error)
        raise StoreError(f"{path}: {error}" if busy else f"{path}: damaged, or not a results store: {error}") from None
    except OSError as error:
        raise StoreError(f"{path}: cannot be used: {error.strerror}") from None


def _identity_in(connection: sqlite3.Connection) -> Identity:
    rows = dict(connection.execute("SELECT key, value FROM campaign"))
    try:
        identity = Identity(
            campaign=Campaign.model_validate_json(rows["campaign"]),
            fingerprint=rows["fingerprint"],
            estimators=tuple(EstimatorSpec(**spec) for spec in json.loads(rows["estimators"])),
            versions=rows["versions"],
        )
    except (KeyError, TypeError, ValueError, RecursionError):
        raise sqlite3.DatabaseError("its campaign cannot be read") from None
    if identity.as_rows() != rows:
        raise sqlite3.DatabaseError("its campaign is not as it was written")
    return identity


def _runs_in(connection: sqlite3.Connection, identity: Identity) -> Iterator[Run]:
    """Yield the runs by number; raises sqlite3.DatabaseError at one that is not as it was written."""
    leaks: dict[int, list[dict[str, Any]]] = {}
    for number, *cells in connection.execute("SELECT * FROM leak"):
        leaks.setdefault(number, []).append(dict(zip(LEAK_COLUMNS, cells, strict=True)))
    for row in connection.execute("SELECT * FROM run ORDER BY run"):
        cells = dict(zip(RUN_COLUMNS, row, strict=True))
        try:
            run = _run_of(cells, tuple(leaks.pop(cells["run"], ())))
            is_whole = _row_of(run) == row and identity.may_have(run)
        except (TypeError, ValueError, AttributeError, RecursionError):
            is_whole = False
        if not is_whole:
            raise sqlite3.DatabaseError(f"run {cells['run']} is not as it was written")
        yield run
    if leaks:
        raise sqlite3.DatabaseError(f"run {min(leaks)} is missing")


def _run_of(cells: dict[str, Any], leaks: tuple[dict[str, Any], ...]) -> Run:
    same = ("run", "scene", "arm", "repeat", "seed", "versions", "method", "outcome", "detail")
    return valid_run(
        **{name: cells[name] for name in same},
        values=json.loads(cells["arm_values"]),
        base=cells["scenario"],
        overrides=json.loads(cells["overrides"]),
        leaks=leaks,
        false_codes=json.loads(cells["false_codes"]),
        estimates_m=json.loads(cells["estimates_m"]),
    )
