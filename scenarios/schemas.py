"""JSON Schemas of the files that the tool reads and writes."""

from typing import Any

from pydantic import BaseModel

from leakloc import result_schema
from scenarios.campaign import Campaign
from scenarios.scenario import Scenario
from scenarios.space_file import SpaceFile
from scenarios.truth import Truth


def schema(name: str) -> dict[str, Any]:
    """Return the JSON Schema of scenario.toml, a campaign file, a space file, result.json or truth.json."""
    if name == "result":
        return result_schema()
    models: dict[str, type[BaseModel]] = {
        "scenario": Scenario,
        "campaign": Campaign,
        "space": SpaceFile,
        "truth": Truth,
    }
    model = models[name]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **model.model_json_schema()}
