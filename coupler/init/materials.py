"""Named materials for new scenarios: room temperature, each number with its source (materials.yaml)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from coupler.errors import ScenarioError
from coupler.scenario.quantity import did_you_mean
from coupler.scenario.reading import read_document

FILE = Path(__file__).resolve().parent / "materials.yaml"


@dataclass(frozen=True)
class Material:
    """about : what it is.  source : where its numbers are from.  values : rho, k, c, E, nu, alpha, SI, at 300 K."""

    name: str
    about: str
    source: str
    values: Mapping[str, float]


@cache
def library() -> Mapping[str, Material]:
    """All named materials."""
    tree = read_document(FILE).tree
    sources = tree["sources"]
    return {name: Material(name, entry["about"], "; ".join(sources[key] for key in entry["from"]),
                           {key: entry[key] for key in ("rho", "k", "c", "E", "nu", "alpha")})
            for name, entry in tree["materials"].items()}


def material_named(name: str, key: str) -> Material:
    """The material of a name; key : whose it was to be.  Raises ScenarioError with the nearest one."""
    if name not in library():
        raise ScenarioError("there is no such material", key=key, value=name,
                            remedy=f"{did_you_mean(name, library())} Others are written by hand: docs/scenario.md")
    return library()[name]


def exchangeable(tree: Mapping[str, Any]) -> list[str]:
    """Materials of a scenario that a named one may stand for: those that are plain numbers, without flow or melting."""
    plain = {"rho", "k", "c", "E", "nu", "alpha", "T_ref"}
    return [name for name, values in tree["materials"].items()
            # fault: init: a metal that melts may be exchanged -> if all(True or isinstance(v, int | float) for v in
            #   values.values())] | coupler/test_init
            if set(values) <= plain and all(isinstance(v, int | float) for v in values.values())]


def put_in_place(values: Mapping[str, Any], material: Material) -> dict[str, float]:
    """The named material's numbers for the keys that stand in the scenario's.

    Without T_ref a body does not expand (alpha is 0 on purpose), and that stays.
    """
    return {key: value for key, value in material.values.items()
            # fault: init: a body that was not to expand does -> if key in values and True} | coupler/test_init
            if key in values and (key != "alpha" or "T_ref" in values)}
