"""Make small campaigns and other people's estimators importable by their names, here and in worker processes."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def whole_campaign(tmp_path_factory):
    """A small campaign that ran without a stop on one worker: its file and its store, both only to be read."""
    from small_campaigns import run, small_campaign

    folder = tmp_path_factory.mktemp("campaign")
    path = small_campaign(folder)
    run(path, folder / "whole.db")
    return path, folder / "whole.db"
