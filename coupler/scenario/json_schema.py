"""The JSON Schema of a scenario, so that editors complete and check its keys."""

from __future__ import annotations

from typing import Any

from coupler.scenario.schema import VERSION, ScenarioFile

DRAFT = "https://json-schema.org/draft/2020-12/schema"


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of a scenario file of the newest version.

    It knows keys, types, units (in the descriptions) and bounds; what hangs together across keys only `check` can say.
    """
    schema = _without_titles(ScenarioFile.model_json_schema(mode="validation"))
    schema["properties"]["slideline"] = {"enum": list(range(1, VERSION + 1)), "description": "version of this form"}
    return {"$schema": DRAFT, "$id": f"slideline-scenario-{VERSION}", "title": "Slideline scenario"} | schema


def _without_titles(node: Any) -> Any:
    """A schema less the titles that only repeat the names of keys."""
    if isinstance(node, dict):
        return {key: _without_titles(value) for key, value in node.items()
                if not (key == "title" and isinstance(value, str))}
    return [_without_titles(value) for value in node] if isinstance(node, list) else node
