"""Values as the text of a scenario file, laid out as ours are."""

from __future__ import annotations

import io
from typing import Any

from ruamel.yaml import YAML

WIDTH = 120


def layout() -> YAML:
    """What reads a file with its comments and writes it again: lists stand under their key, lines end at WIDTH."""
    yaml = YAML()
    yaml.width = WIDTH
    yaml.indent(mapping=2, sequence=4, offset=2)
    return yaml


def dumped(tree: Any, yaml: YAML) -> str:
    """The text of a tree, plain or with comments."""
    out = io.StringIO()
    yaml.dump(tree, out)
    return out.getvalue()
