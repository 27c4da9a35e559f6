"""What a scenario reads beside its own file: meshes, told by their content so that results of two are never mixed."""

import hashlib
from pathlib import Path

from leakloc.outside_file import read_regular_file
from scenarios.scenario import Scenario
from scenarios.scenario_file import ScenarioError
from simcam.structures import MAX_MESH_BYTES


def mesh_hashes(scenario: Scenario) -> dict[str, str]:
    """SHA-256 of every mesh file, by its place in the scenario; raises ScenarioError for one that cannot be read."""
    hashes = {}
    for number, table in enumerate(scenario.structure):
        if table.kind == "mesh":
            try:
                content = read_regular_file(Path(table.path), MAX_MESH_BYTES)
            except ValueError as error:
                raise ScenarioError(f"structure.{number}.path: {table.path}: {error}") from None
            hashes[f"structure.{number}"] = hashlib.sha256(content).hexdigest()
    return hashes
