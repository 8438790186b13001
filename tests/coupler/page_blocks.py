"""The scenes in the YAML blocks of a page of docs/, as files, and the keys they use."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML


def written(scene: Any, folder: Path) -> Path:
    """The file of a scene."""
    path = folder / "s.yaml"
    YAML(typ="safe").dump(scene, path)
    return path


def keys_in(value: Any) -> Iterator[str]:
    """Every key of a tree, at any depth."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield key
            yield from keys_in(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from keys_in(inner)
