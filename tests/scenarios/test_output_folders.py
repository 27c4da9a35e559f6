"""Output folders appear whole or not at all, and nothing that the tool did not make is replaced."""

import subprocess
import sys

import pytest

from scenarios.output_folder import OutputError, creating, made_by, replacing, write_json


def fill(folder, word):
    write_json(folder / "clip.json", {"made_by": made_by(), "word": word})


def dead_process():
    """Number of a process that is no more."""
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def fail_half_way(new_folder, destination):
    def run():
        with new_folder(destination) as folder:
            fill(folder, "half")
            raise RuntimeError("killed")

    with pytest.raises(RuntimeError, match="killed"):
        run()


def test_a_folder_appears_when_its_block_ends_well(tmp_path):
    with creating(tmp_path / "deep" / "clip") as folder:
        fill(folder, "new")
        assert not (tmp_path / "deep" / "clip").exists()
    assert sorted(p.name for p in (tmp_path / "deep").iterdir()) == ["clip"]
    assert "new" in (tmp_path / "deep" / "clip" / "clip.json").read_text()


@pytest.mark.parametrize("new_folder", [creating, replacing])
def test_a_block_that_fails_leaves_nothing(tmp_path, new_folder):
    fail_half_way(new_folder, tmp_path / "clip")
    assert list(tmp_path.iterdir()) == []


def test_a_failed_replacement_keeps_the_old_folder(tmp_path):
    with creating(tmp_path / "clip") as folder:
        fill(folder, "old")
    fail_half_way(replacing, tmp_path / "clip")
    assert "old" in (tmp_path / "clip" / "clip.json").read_text()
    assert len(list(tmp_path.iterdir())) == 1


def test_replacing_takes_the_place_of_what_the_tool_made(tmp_path):
    for word in ("old", "new"):
        with replacing(tmp_path / "clip") as folder:
            fill(folder, word)
    assert "new" in (tmp_path / "clip" / "clip.json").read_text()
    assert len(list(tmp_path.iterdir())) == 1


def test_creating_refuses_a_folder_that_is_taken(tmp_path):
    with creating(tmp_path / "clip") as folder:
        fill(folder, "old")
    with pytest.raises(OutputError, match="--force"), creating(tmp_path / "clip"):
        pass


@pytest.mark.parametrize("name", ["notes.txt", "clip.json", "demo.json"])
def test_what_the_tool_did_not_make_is_never_replaced(tmp_path, name):
    precious = tmp_path / "mine" / name
    precious.parent.mkdir()
    precious.write_text('{"made_by": "me"}')
    with pytest.raises(OutputError, match="not made by leakloc"), replacing(tmp_path / "mine"):
        pass
    assert precious.read_text() == '{"made_by": "me"}'


def test_a_file_or_link_in_the_way_is_refused(tmp_path):
    (tmp_path / "file").write_text("x")
    (tmp_path / "link").symlink_to(tmp_path)
    for name in ("file", "link"):
        with pytest.raises(OutputError, match="not a file or link"), replacing(tmp_path / name):
            pass


def test_what_a_killed_run_had_moved_aside_is_put_back_by_the_next(tmp_path):
    aside = tmp_path / f".clip.old-{dead_process()}"
    aside.mkdir()
    fill(aside, "old")
    with pytest.raises(OutputError, match="--force"), creating(tmp_path / "clip"):
        pass
    assert "old" in (tmp_path / "clip" / "clip.json").read_text()


def test_something_else_that_the_tool_made_is_not_replaced(tmp_path):
    with creating(tmp_path / "data") as folder:
        write_json(folder / "dataset.json", {"made_by": made_by()})

    def run():
        with replacing(tmp_path / "data") as folder:
            fill(folder, "clip")

    with pytest.raises(OutputError, match="something else"):
        run()
    assert (tmp_path / "data" / "dataset.json").exists()
    assert len(list(tmp_path.iterdir())) == 1


def test_leftovers_are_told_by_their_whole_name(tmp_path):
    (tmp_path / f".d[7].partial-{dead_process()}").mkdir()
    with creating(tmp_path / "d[7]") as folder:
        fill(folder, "new")
    assert [p.name for p in tmp_path.iterdir()] == ["d[7]"]


def test_what_a_killed_run_left_is_cleared_by_the_next(tmp_path):
    (tmp_path / f".clip.partial-{dead_process()}").mkdir()
    with creating(tmp_path / "clip") as folder:
        fill(folder, "new")
    assert [p.name for p in tmp_path.iterdir()] == ["clip"]
