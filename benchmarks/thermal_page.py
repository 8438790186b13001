"""The scenes of a page of docs: its YAML blocks, each merged into the first."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

PAGE = Path(__file__).resolve().parents[1] / "docs" / "thermal.md"
BLOCK = re.compile(r"<!-- scene: (\w+) -->\n```yaml\n(.*?)```", re.DOTALL)


def scenes(page: Path = PAGE) -> dict[str, dict[str, Any]]:
    """name -> the whole scenario of each block of the page; a name given twice is an error."""
    blocks = BLOCK.findall(page.read_text(encoding="utf-8"))
    read = {name: YAML(typ="safe").load(text) for name, text in blocks}
    assert len(read) == len(blocks), "a name stands twice on the page"
    return {name: merged(read["base"], scene) for name, scene in read.items()}


def merged(base: Mapping[str, Any], change: Mapping[str, Any]) -> dict[str, Any]:
    """base with a change put in: mappings key by key, anything else replaced."""
    def put(key: str, value: Any) -> Any:
        old = base.get(key)
        return merged(old, value) if isinstance(value, Mapping) and isinstance(old, Mapping) else value

    return {**base, **{key: put(key, value) for key, value in change.items()}}
