"""A sandbox whose surroundings must not change, a small clip to damage, and the counts that a run is worth."""

import sys
from collections import Counter
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

SMALL = ("rig.width_px=96", "rig.height_px=64", "recording.n_frames=4", "seed=3")


@pytest.fixture(scope="session")
def small_clip(tmp_path_factory):
    """A clip of four small stereo frames, whole, and only to be copied."""
    from verdicts import leakloc

    folder = tmp_path_factory.mktemp("whole") / "clip"
    verdict = leakloc("simulate", "separated", "-o", folder, *(word for value in SMALL for word in ("--set", value)))
    assert verdict.code == 0, verdict
    return folder


@pytest.fixture(scope="session")
def small_export(small_clip):
    """The same clip as two videos."""
    from verdicts import leakloc

    folder = small_clip.with_name("export")
    assert leakloc("export", small_clip, "--video", "--csv", "-o", folder).code == 0
    return folder


@pytest.fixture
def tally(record_property, request):
    """Counts of what became of every case; shown at the end of the run."""
    counts = Counter()
    yield counts
    shown = ", ".join(f"{count} {what}" for what, count in sorted(counts.items()))
    record_property("hostile", f"{request.node.name}: {counts.total()} cases: {shown}")


def pytest_terminal_summary(terminalreporter):
    for report in terminalreporter.stats.get("", []):  # what passes in setup and teardown has no letter
        for name, line in report.user_properties if report.when == "teardown" else ():
            if name == "hostile":
                terminalreporter.write_line(line)
