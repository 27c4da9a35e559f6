"""What a hunt leaves behind: hunt.json, a scene file and a picture of every counterexample kept, and the atlas page."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from scenarios.atlas import Atlas
from scenarios.atlas_page import Entry, atlas_html
from scenarios.hunt import Quarry
from scenarios.hunted import Counterexample
from scenarios.output_folder import made_by, write_file, write_json
from scenarios.scenario import Scenario
from scenarios.scene_file import conditions
from scenarios.shrink import NothingFailsError, codes_of, shrink
from scenarios.shrunk_folder import explain_command, picture, told


@dataclass(frozen=True)
class Hunt:
    """A hunt that is over: what was hunted, how many scenes it took, and its atlas."""

    quarry: Quarry
    n_scenes: int
    atlas: Atlas


def plain_examples(hunted: Hunt, n_shrunk: int) -> Iterator[Entry]:
    """Yield an entry for every counterexample kept; of each code the plainest ones, `n_shrunk` of them, made plain.

    Shrinking moves a scene out of the cell that it was met in: the entry stays there, with the file as it was met
    beside the one made plain.
    """
    kept = hunted.atlas.counterexamples()
    chosen = {
        id(found)
        for code in hunted.atlas.codes()
        for found in sorted((one for one in kept if one.code == code), key=lambda one: (one.plainness, one.number))[
            :n_shrunk
        ]
    }
    for found in kept:
        scenario = _shrunk(found, hunted.quarry) if id(found) in chosen else None
        shown = scenario or found.scenario
        yield Entry(found, scenario, tuple(hunted.atlas.cells_met(found)), picture(shown, hunted.quarry.estimator))


def write_hunt(folder: Path, hunted: Hunt, entries: list[Entry]) -> None:
    """Write everything into an empty folder; the same hunt writes the same bytes."""
    estimator = hunted.quarry.estimator
    (folder / "scenes").mkdir()
    for entry in entries:
        found = entry.found
        write_file(folder / entry.file, told(found.scenario, found.code, estimator, Path(entry.file).name))
        write_file(folder / entry.picture, entry.png)
        if entry.shrunk is not None:
            write_file(
                folder / entry.plain_file, told(entry.shrunk, found.code, estimator, Path(entry.plain_file).name)
            )
    write_json(folder / "hunt.json", _summary(hunted, entries))
    write_file(folder / "atlas.html", atlas_html(hunted.quarry.space, estimator, hunted.n_scenes, entries))


def _shrunk(found: Counterexample, quarry: Quarry) -> Scenario | None:
    try:
        *_, last = shrink(found.scenario, found.code, codes_of(quarry.estimator), found.leak)
    except NothingFailsError:  # an estimator whose answers change from run to run
        return None
    return last.scenario


def _summary(hunted: Hunt, entries: list[Entry]) -> dict[str, object]:
    rows = [
        {
            "code": entry.found.code,
            "file": entry.file,
            "plain_file": entry.plain_file if entry.shrunk is not None else None,
            "severity": str(entry.found.severity),
            "scene": entry.found.number,
            "leak": entry.found.leak,
            "cells": [{"parameter": cell.parameter, "third": cell.third} for cell in entry.cells],
            "conditions": conditions(entry.shrunk or entry.found.scenario),
            "command": explain_command(entry.file, hunted.quarry.estimator),
        }
        for entry in entries
    ]
    return {
        "made_by": made_by(),
        "space": hunted.quarry.space.name,
        "estimator": hunted.quarry.estimator.text,
        "seed": hunted.quarry.seed,
        "scenes_tried": hunted.n_scenes,
        "note": "counterexamples that were looked for: no rate and no interval follows from them",
        "counterexamples": rows,
    }
