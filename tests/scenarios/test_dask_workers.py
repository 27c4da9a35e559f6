"""Campaigns on a Dask cluster: the same table as on this machine, a dead worker or not."""

import os
import signal

import pytest
from click.testing import CliRunner
from small_campaigns import csv_of, small_campaign

from scenarios.campaign_file import read_campaign
from scenarios.cli import main
from scenarios.dask_workers import dask_workers
from scenarios.run_campaign import running
from scenarios.workers import WorkerError

distributed = pytest.importorskip("distributed")


def local_cluster(n_workers):
    return distributed.LocalCluster(n_workers=n_workers, threads_per_worker=1, dashboard_address=":0", silence_logs=50)


def test_two_dask_workers_of_which_one_is_killed_give_the_table_of_local_ones(whole_campaign, tmp_path):
    (path, local), done = whole_campaign, []
    with (
        local_cluster(2) as cluster,
        dask_workers(cluster.scheduler_address) as kind,
        running(read_campaign(path), [], tmp_path / "dask.db", kind) as under_way,
    ):
        doomed, other = (nanny.pid for nanny in cluster.workers.values())
        for outcome in under_way.left:
            done.append(outcome.number)
            if len(done) == 1:
                os.kill(doomed, signal.SIGKILL)
        assert other != doomed
    assert sorted(done) == list(range(12))
    assert csv_of(tmp_path / "dask.db") == csv_of(local)


def test_a_scheduler_that_is_not_there_is_one_clear_error(tmp_path, monkeypatch):
    monkeypatch.setattr("scenarios.dask_workers.PATIENCE_S", 0.5)
    path = small_campaign(tmp_path)
    arguments = ["campaign", "run", str(path), "-o", str(tmp_path / "r.db"), "--dask", "tcp://127.0.0.1:9"]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 2
    assert "tcp://127.0.0.1:9: no Dask scheduler answers" in result.output
    assert not (tmp_path / "r.db").exists()


def test_a_cluster_without_workers_is_refused():
    with (
        local_cluster(0) as empty,
        pytest.raises(WorkerError, match="no workers"),
        dask_workers(empty.scheduler_address),
    ):
        pass
