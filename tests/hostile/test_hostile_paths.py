"""Paths that lead elsewhere or nowhere, as input and as output: refused at once, and nothing else changes."""

import os
import shutil
import socket

import pytest
from verdicts import assert_bearable, assert_refused, leakloc, tree

SMALL = ("--set", "rig.width_px=96", "--set", "rig.height_px=64", "--set", "recording.n_frames=3")

# what reads a path (X): refused whatever the path
READING = [
    ("check", "X"),
    ("simulate", "X", "-o", "made"),
    ("generate", "X", "-n", "1", "-o", "made"),
    ("explain", "X", "--method", "naive", "-o", "made.html"),
    ("locate", "X", "-o", "made.json"),
    ("locate", "clip", "X", "--pan", "0", "40", "-o", "made.json"),
    ("locate", "X", "clip/right", "--rig", "clip/rig.yaml", "-o", "made.json"),
    ("locate", "clip/left", "X", "--rig", "clip/rig.yaml", "-o", "made.json"),
    ("locate", "clip/left", "clip/right", "--rig", "X", "-o", "made.json"),
    ("locate", "clip/left", "clip/right", "--rig", "clip/rig.yaml", "--rig", "X", "-o", "made.json"),
    ("inspect", "X"),
    ("score", "X", "clip"),
    ("score", "result.json", "X"),
    ("export", "X", "--video", "-o", "made"),
    ("noise", "X", "-o", "made", "--dose-rate", "1", "--exposure", "0.1"),
    ("campaign", "check", "X"),
    ("campaign", "run", "X", "-o", "made.db"),
    ("campaign", "show", "X"),
    ("campaign", "export", "--csv", "X", "-o", "made.csv"),
    ("campaign", "report", "X", "-o", "made.html"),
    ("campaign", "figure", "X", "-o", "made.svg"),
    ("bench", "--method", "naive", "--scenes", "1", "--baseline", "X"),
]

NO_INPUTS = [
    *(
        "",
        ".",
        "..",
        "/",
        "nowhere",
        "nowhere/at/all",
        "~",
        "*",
        "$HOME",
        "%s",
        "{clip}",
        "a\nb",
        "\x1b[2J",
        "\udcff",
        "‮txt",
    ),
    *("/dev/zero", "/dev/null", "/dev/full", "/dev/stdin", "/dev/tty", "/proc/self/mem", "/proc/self/environ"),
    *(
        "/proc/self/fd/0",
        "/etc/passwd",
        "../elsewhere/secret.toml",
        "n" * 300,
        "n/" * 3000,
        "../" * 1500 + "etc/passwd",
    ),
    *(
        "http://127.0.0.1:1/x",
        "file:///etc/passwd",
        "concat:left.avi|right.avi",
        "tcp://127.0.0.1:1",
        "left.avi:stream",
    ),
    *(
        "pipe",
        "pipe.toml",
        "socket",
        "loop",
        "to_pipe",
        "to_zero",
        "to_nowhere",
        "empty",
        "sparse",
        "sparse.toml",
        "texts",
    ),
    *("clip/clip.json/x", "result.json/x", "/dev/fd/99", "//", "pipe/", "C:\\x.toml", "nominal:99999999", "hard:x"),
]


@pytest.fixture
def sandbox(tmp_path, small_clip, monkeypatch):
    """A folder to work in, full of traps, and another beside it that nothing may touch."""
    elsewhere, here = tmp_path / "elsewhere", tmp_path / "here"
    elsewhere.mkdir()
    here.mkdir()
    (elsewhere / "secret.toml").write_text("password = 'x'\n")
    (elsewhere / "precious").mkdir()
    (elsewhere / "precious" / "only_copy.txt").write_text("x")
    shutil.copytree(small_clip, here / "clip")
    assert leakloc("locate", here / "clip", "-o", here / "result.json").code == 0
    os.mkfifo(here / "pipe")
    os.mkfifo(here / "pipe.toml")
    monkeypatch.chdir(here)
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("socket")
    for name, target in (
        ("loop", "loop"),
        ("to_pipe", "pipe"),
        ("to_zero", "/dev/zero"),
        ("to_nowhere", "../elsewhere/new"),
    ):
        (here / name).symlink_to(target)
    (here / "to_elsewhere").symlink_to("../elsewhere/precious")
    (here / "to_secret").symlink_to("../elsewhere/secret.toml")
    (here / "empty").write_bytes(b"")
    for name in ("sparse", "sparse.toml"):
        with (here / name).open("wb") as file:
            file.truncate(10**11)
    (here / "texts").mkdir()
    (here / "texts" / "left").mkdir()
    (here / "texts" / "0.png").write_text("no image")
    (here / "file").write_text("of the user")
    (here / "folder").mkdir()
    (here / "folder" / "notes.txt").write_text("of the user")
    return tmp_path


def reading_tricks():
    return [(command, trick) for command in READING for trick in NO_INPUTS]


def refuse_all(sandbox, cases, tally):
    before = tree(sandbox)
    for command, trick in cases:
        words = [trick if word == "X" else word for word in command]
        try:
            verdict = leakloc(*words, inside=sandbox / "here")  # where it may stage, and clear away
            assert_bearable(verdict)
            assert is_empty_and_harmless(command, trick) or verdict.code == 2, verdict
        except BaseException as error:
            error.add_note(f"{words!r:.300}")
            raise
        tally["refused with exit code 2" if verdict.code == 2 else "read: an empty file is a valid scenario"] += 1
    assert tree(sandbox) == before


def is_empty_and_harmless(command, trick):
    """An empty file, or one of nothing, is a scenario of defaults."""
    return command == ("check", "X") and trick == "empty"


def without_work(cases):
    """The defaults are a valid scenario: only `check` is asked, for the others would go to work."""
    rendering = {"simulate", "generate", "explain"}
    return [(c, t) for c, t in cases if not (t == "empty" and c[0] in rendering)]


def test_a_trick_of_a_path_is_refused_and_nothing_changes(sandbox, tally):
    cases = without_work(reading_tricks()[::9])
    refuse_all(sandbox, cases, tally)
    assert tally["refused with exit code 2"] >= len(cases) - 1 > 100


@pytest.mark.deep
def test_a_thousand_tricks_of_paths_are_refused_and_nothing_changes(sandbox, tally):
    cases = without_work(reading_tricks())
    refuse_all(sandbox, cases, tally)
    assert tally["refused with exit code 2"] >= len(cases) - 1 > 1000


# what writes to a path (X)
WRITING = [
    ("simulate", "plain", *SMALL, "-o", "X"),
    ("simulate", "plain", *SMALL, "--force", "-o", "X"),
    ("generate", "plain", *SMALL, "-n", "1", "--workers", "1", "-o", "X"),
    ("export", "clip", "--csv", "-o", "X"),
    ("export", "clip", "--csv", "--force", "-o", "X"),
    ("noise", "clip", "--dose-rate", "1", "-o", "X"),
    ("locate", "clip", "-o", "X"),
    ("locate", "clip", "--figure", "X"),
    ("campaign", "run", "plain_campaign.toml", "-o", "X"),
    ("reproduce", "--quick", "-o", "X"),
    ("demo", "-o", "X"),
]

# within the sandbox alone: where this fails, what is named here is written over
NO_OUTPUTS = [
    *("", ".", "..", "pipe", "socket", "loop", "to_pipe", "to_secret"),
    *("to_elsewhere", "to_elsewhere/../precious", "file/x", "folder", "../elsewhere", "../elsewhere/precious", "clip"),
    *(
        "clip/left",
        "clip/truth.json",
        "clip/clip.json",
        "clip/left/0000.png",
        "n" * 300,
        "n/" * 3000,
        "n" * 240,
        "file/x/y",
        "\udcff" * 240,
    ),
]


def test_an_output_that_is_something_else_is_refused_before_the_work_and_nothing_changes(sandbox, tally):
    before = tree(sandbox)
    for command in WRITING:
        for trick in NO_OUTPUTS:
            words = [trick if word == "X" else word for word in command]
            if trick == "clip" and command[0] == "simulate" and "--force" in command:
                continue  # no trick: a clip is what --force replaces
            try:
                assert_refused(leakloc(*words))
                assert tree(sandbox) == before
            except BaseException as error:
                error.add_note(f"{words!r:.300}")
                raise
            tally["refused with exit code 2"] += 1


@pytest.mark.parametrize(
    "output", ["made", "new/and/deep/made", "../here/made", "clip/../made", "é 漢.x", "\udcff", "-o"]
)
def test_an_odd_name_is_made_where_it_says_and_nothing_else_changes(sandbox, output):
    before = tree(sandbox)
    verdict = leakloc("export", "clip", "--csv", f"--output={output}")
    assert verdict.code == 0, verdict
    made = (sandbox / "here" / output).resolve()
    assert (made / "export.json").is_file()
    top = made.relative_to(sandbox / "here").parts[0]
    shutil.rmtree(sandbox / "here" / top)
    after = tree(sandbox)
    assert {name for name, what in after.items() if before.get(name) != what} <= {"here"}
    assert after.keys() == before.keys()
