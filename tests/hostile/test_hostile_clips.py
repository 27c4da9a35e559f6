"""Damaged clips, exports and foreign footage: refused, or the result of the undamaged ones; never a crash."""

import hashlib
import json
import os
import random
import shutil

import pytest
from damage import damaged_bytes, damaged_text
from verdicts import assert_bearable, leakloc, tree

# what a manifest covers of the input is what an estimator sees
SEEN = ("left", "right", "rig.yaml", "input.json", "clip.json")
WHERE = {"left": 4, "right": 4, "rig.yaml": 2, "input.json": 2, "clip.json": 3, "truth.json": 2, "scenario.toml": 2}


def damaged_clip(folder, rng):
    """Spoil one file of a clip; returns its name, or None where it is as it was."""
    name = rng.choice([name for name, weight in WHERE.items() for _ in range(weight)])
    path = folder / name
    if path.is_dir():
        path = path / rng.choice(sorted(entry.name for entry in path.iterdir()))
    before = path.read_bytes()
    kind = rng.randrange(14)
    if kind < 6:
        is_text = path.suffix != ".png" and rng.random() < 0.5
        path.write_bytes(damaged_text(before.decode(), rng) if is_text else damaged_bytes(before, rng))
    elif kind == 6:
        path.unlink()
    elif kind == 7:
        path.write_bytes(b"")
    elif kind == 8:  # a frame in another's place, a file in another's
        path.write_bytes(rng.choice([p for p in path.parent.iterdir() if p.is_file()]).read_bytes())
    elif kind == 9:
        other = path.with_name(rng.choice(("0004.png", "9.png", "x.png", "0000 (1).png")))
        shutil.copy(path, other)
        return str(other.relative_to(folder))
    elif kind == 10:
        path.unlink()
        path.symlink_to(rng.choice(("/dev/zero", "/etc/passwd", "/nowhere", path.name, "..", "/dev/stdin")))
    elif kind == 11:
        path.unlink()
        os.mkfifo(path)
    elif kind == 12:
        path.unlink()
        path.mkdir()
    else:
        with path.open("r+b") as file:
            file.truncate(rng.choice((10**10, 10**6, 1)))
    unchanged = path.is_file() and path.stat().st_size == len(before) and path.read_bytes() == before
    return None if unchanged else str(path.relative_to(folder))


def rehashed(folder):
    """Let the manifest fit what is there: damage by someone who wants it to be believed."""
    if any((not path.is_dir() and path.lstat().st_size > 1 << 20) or path.is_fifo() for path in folder.rglob("*")):
        return
    if any(path.is_symlink() for path in folder.rglob("*")):
        return
    try:
        manifest = json.loads((folder / "clip.json").read_text())
        for name in manifest["files"]:
            with (folder / name).open("rb") as file:
                manifest["files"][name] = hashlib.sha256(file.read(1 << 20)).hexdigest()
        (folder / "clip.json").write_text(json.dumps(manifest))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return


def commands(clip, folder):
    """What reads a clip: the words, the file or folder that is written, and the files that it looks at."""
    result, made = folder / "result.json", folder / "made"
    return [
        (("locate", clip, "-o", result, "--method", "paper"), result, SEEN),
        (("locate", clip, "-o", result, "--method", "robust"), result, SEEN),
        (("inspect", clip, "--json"), None, SEEN),
        (("score", folder / "scored.json", clip, "--json"), None, WHERE),
        (("export", clip, "--video", "--csv", "--coco", "-o", made), made, WHERE),
        (("noise", clip, "-o", made, "--dose-rate", "1"), made, SEEN),
    ]


def answer(verdict, written):
    """What a command said and wrote, without the names of temporary folders."""
    if written is None:
        return verdict.out
    if written.is_dir():
        return {str(p.relative_to(written)): p.read_bytes() for p in sorted(written.rglob("*")) if p.is_file()}
    return written.read_bytes()


def emptied(written):
    if written is not None and written.is_dir():
        shutil.rmtree(written)
    elif written is not None:
        written.unlink(missing_ok=True)


@pytest.fixture
def whole_answers(tmp_path, small_clip):
    """What every command makes of the undamaged clip."""
    shutil.copytree(small_clip, tmp_path / "clip")
    assert leakloc("locate", tmp_path / "clip", "-o", tmp_path / "scored.json").code == 0
    answers = []
    for words, written, _ in commands(tmp_path / "clip", tmp_path):
        verdict = leakloc(*words)
        assert verdict.code == 0, verdict
        answers.append(answer(verdict, written))
        emptied(written)
    shutil.rmtree(tmp_path / "clip")
    return answers


def damaged_clips(folder, small_clip, answers, seed, numbers, tally):
    clip = folder / "clip"
    for number in numbers:
        rng = random.Random(f"clip {seed} {number}")
        shutil.copytree(small_clip, clip)
        name = damaged_clip(clip, rng)
        form = rng.choice(("as written", "as written", "rehashed", "without manifest"))
        if form == "rehashed":
            rehashed(clip)
        if form == "without manifest" and not (clip / "clip.json").is_dir():
            (clip / "clip.json").unlink(missing_ok=True)
        which = rng.randrange(len(answers))
        words, written, looked_at = commands(clip, folder)[which]
        before = tree(clip)
        try:
            verdict = leakloc(*words, inside=folder)
            assert_bearable(verdict)
            assert tree(clip) == before
            if verdict.code == 2:
                assert {path.name for path in folder.iterdir()} == {"clip", "scored.json"}
                tally["refused with exit code 2"] += 1
            elif form == "as written":
                seen = name is not None and name.partition("/")[0] in looked_at
                if seen and "clip.json" not in name:  # a manifest may lose what nobody looks at, its seed, say
                    raise AssertionError(f"damage to {name} went unnoticed")
                assert answer(verdict, written) == answers[which] or which == 4
                tally["accepted with the answer of the undamaged clip"] += 1
            else:  # another clip, then: its PNGs have checksums of their own, its texts may say what they like
                tally[f"another valid clip, {form}"] += 1
        except BaseException as error:
            error.add_note(f"clip {number} of seed {seed}: {name} damaged, {form}: {' '.join(map(str, words))}")
            raise
        finally:
            shutil.rmtree(clip)
            emptied(written)


def test_a_damaged_clip_is_refused_or_gives_the_answer_of_the_whole_one(tmp_path, small_clip, whole_answers, tally):
    damaged_clips(tmp_path, small_clip, whole_answers, 0, range(60), tally)
    assert sum(tally.values()) == 60
    assert 0 < tally["refused with exit code 2"] < 60


@pytest.mark.deep
def test_thousands_of_damaged_clips_are_refused_or_give_the_answer_of_the_whole_one(
    tmp_path, small_clip, whole_answers, harness_seed, tally
):
    damaged_clips(tmp_path, small_clip, whole_answers, harness_seed, range(2000), tally)
    assert sum(tally.values()) == 2000
    assert 0 < tally["refused with exit code 2"] < 2000


def damaged_videos(folder, clip, export, seed, numbers, tally):
    """Videos of an export beside their export.json, and the same as foreign ones, which nothing vouches for."""
    shutil.copy(clip / "rig.yaml", folder / "rig.yaml")
    result = folder / "result.json"
    words = ("--rig", folder / "rig.yaml", "--method", "paper", "-o", result)
    assert leakloc("locate", export / "left.avi", export / "right.avi", *words).code == 0
    whole = result.read_bytes()
    result.unlink()
    for number in numbers:
        rng = random.Random(f"video {seed} {number}")
        place = shutil.copytree(export, folder / "videos")
        is_foreign = rng.random() < 0.5
        path = place / rng.choice(("left.avi", "right.avi") if is_foreign else ("left.avi", "right.avi", "export.json"))
        before = path.read_bytes()
        for _ in range(rng.choice((1, 1, 5, 50)) if path.suffix == ".avi" else 1):
            path.write_bytes(damaged_bytes(path.read_bytes(), rng))
        if is_foreign:
            (place / "export.json").unlink()
        try:
            verdict = leakloc("locate", place / "left.avi", place / "right.avi", *words, inside=folder)
            assert_bearable(verdict)
            same = verdict.code == 0 and result.read_bytes() == whole
            if verdict.code == 2:
                assert not result.exists()
                assert str(place) in verdict.error, verdict
            elif not is_foreign:
                assert same, f"damage to {path.name} went unnoticed"
                assert path.name == "export.json" or path.read_bytes() == before
            kind = "foreign" if is_foreign else "exported"
            outcome = "refused" if verdict.code == 2 else "same answer" if same else "decoded to other frames"
            tally[f"{kind}: {outcome}"] += 1
        except BaseException as error:
            error.add_note(f"video {number} of seed {seed}: {path.name}")
            raise
        finally:
            shutil.rmtree(place)
            result.unlink(missing_ok=True)


def test_a_sound_video_that_is_not_the_one_exported_is_refused(tmp_path, small_clip, small_export):
    # No decoder complains of it, so what the export says of its bytes is all there is.
    place = shutil.copytree(small_export, tmp_path / "videos")
    shutil.copy(place / "right.avi", place / "left.avi")
    words = ("--rig", small_clip / "rig.yaml", "-o", tmp_path / "result.json")
    verdict = leakloc("locate", place / "left.avi", place / "right.avi", *words, inside=tmp_path)
    assert verdict.code == 2
    assert "left.avi: damaged: its SHA-256 differs from export.json" in verdict.error
    (place / "export.json").unlink()
    assert leakloc("locate", place / "left.avi", place / "right.avi", *words, inside=tmp_path).code == 0


def test_a_damaged_video_is_refused_where_its_export_vouches_for_it(tmp_path, small_clip, small_export, tally):
    damaged_videos(tmp_path, small_clip, small_export, 0, range(20), tally)
    assert sum(tally.values()) == 20
    assert tally["exported: refused"] > 0
    assert tally["exported: decoded to other frames"] == 0


@pytest.mark.deep
def test_a_thousand_damaged_videos_never_crash_and_exported_ones_never_go_unnoticed(
    tmp_path, small_clip, small_export, harness_seed, tally
):
    damaged_videos(tmp_path, small_clip, small_export, harness_seed, range(1000), tally)
    assert sum(tally.values()) == 1000
    assert tally["exported: refused"] > 0
    assert tally["exported: decoded to other frames"] == 0
    foreign = sum(count for kind, count in tally.items() if kind.startswith("foreign"))
    assert tally["foreign: decoded to other frames"] <= 0.05 * foreign  # frames that changed places, whole ones
