"""docs/scenario.md names every key of the schema and every value a key may choose from."""

from __future__ import annotations

import importlib.util
import re
import sys
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import BaseModel

from coupler.scenario import document, timing
from coupler.scenario.schema import ScenarioFile

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import ROOT

TEXT = (ROOT / "docs" / "scenario.md").read_text(encoding="utf-8")
QUOTED = set(re.findall(r"[A-Za-z_]\w*", " ".join(re.findall(r"`([^`]*)`", TEXT))))


def types_in(annotation: Any) -> Iterator[type]:
    """Every class inside an annotation."""
    if isinstance(annotation, type) and not get_args(annotation):
        yield annotation
    for inner in get_args(annotation):
        yield from types_in(inner)


def words(part: type[BaseModel]) -> Iterator[str]:
    """Keys of a part of the schema and of the parts inside it, and values of its enumerations."""
    for key, field in part.model_fields.items():
        yield key
        for kind in types_in(field.annotation):
            if issubclass(kind, BaseModel):
                yield from words(kind)
            elif issubclass(kind, Enum):
                yield from (member.value for member in kind)


@pytest.mark.parametrize("word", sorted(set(words(ScenarioFile))))
def test_every_word_is_explained(word: str) -> None:
    assert word in QUOTED


def test_the_limits_are_the_real_ones() -> None:
    spaced = f"{document.MAX_VALUES:,}".replace(",", " ")
    for limit in (f"{document.MAX_BYTES // 1000} kB", f"{spaced} values", f"{document.MAX_ALIASES} aliases",
                  f"{document.MAX_DEPTH} levels", f"{timing.MAX_WINDOWS:,} windows".replace(",", " ")):
        assert limit in TEXT


def test_the_tables_are_those_of_the_declaration() -> None:
    found = importlib.util.spec_from_file_location("keys", ROOT / "docs/site/keys.py")
    assert found is not None
    assert found.loader is not None
    keys = importlib.util.module_from_spec(found)
    sys.modules["keys"] = keys
    found.loader.exec_module(keys)
    assert keys.page(TEXT) == TEXT, "stale: run python docs/site/keys.py"
    assert TEXT.count("<!-- keys: ") == len(keys.MARK.findall(TEXT)) > 20
