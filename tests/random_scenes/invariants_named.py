"""Laws of heat and force by name: a name changes nothing, and what the names tell adds up to what is known without."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from random_scenes.invariant import Finding, Invariant
from random_scenes.invariants_contact import size_of
from random_scenes.scene import Scene
from random_scenes.story import REFUSED, Story, told

Floats = NDArray[np.float64]

HEAT = 1e-9  # of the heat that moved: Newton's residual is 1e-11 of it in a step
BY_KIND = 1e-12  # the same sums in another order
FORCE = 1e-9  # of the sizes of the forces added
SUMMED = 1e-13  # of the inner forces, whose sums leave round-off where nothing is held
KINDS = {"temperature": ("temperature.in", "temperature.out"), "flux": ("flux",), "convection": ("convection",),
         "radiation": ("radiation",)}
WORDS = ("add up", "balance")


def named(scene: Scene, force: bool) -> Scene:
    """The scene with a name for every condition that may have one, the components of a displacement apart.

    force : those of the elastic half too.
    """
    doc = scene.copied_doc()
    for i, b in enumerate(doc["thermal"].get("boundary", ())):
        b.setdefault("name", f"q{i}")
    elastic = doc["mechanical"].get("elastic", {})
    if force and "boundary" in elastic:
        elastic["boundary"] = [{**one, "name": one.get("name", f"f{i}_{j}")} for i, b in enumerate(elastic["boundary"])
                               for j, one in enumerate(_apart(b))]
    return Scene(doc, scene.recipes, scene.moved)


def _apart(b: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """One entry a component."""
    place = {k: v for k, v in b.items() if k in ("on", "at", "body", "name")}
    for key in [k for k in b if k not in place]:
        yield {**place, key: b[key]}


def _sizes(ledger: Mapping[str, Floats]) -> float:
    return float(sum(np.abs(np.diff(v)).sum() for v in ledger.values()))


def heats_off(story: Story) -> Iterator[Finding]:
    """Where heats by name are not those by mechanism, or not what is stored."""
    assert story.scenario is not None
    told_by = {n.removeprefix("thermal.condition.heat."): np.array(v) for n, v in story.extra.items()
               if n.startswith("thermal.condition.heat.")}
    moved = _sizes(story.ledger)
    total = np.zeros(len(story.t))
    kinds = {kind: np.zeros(len(story.t)) for kind in KINDS}
    for of in story.scenario.conditions.values():
        if of.half == "thermal":
            values = told_by[of.name.removeprefix("heat.")].reshape(len(story.t), -1).sum(axis=1)
            total += values
            if of.kind in kinds:
                kinds[of.kind] += values
    other = [story.ledger[n] for n in ("mechanical", "entropy") if n in story.ledger]
    stored = sum((v for n, v in story.ledger.items() if n.startswith("stored.")), np.zeros(len(story.t)))
    off = float(np.abs(total + sum(other, np.zeros(len(story.t))) - stored).max())
    if off > HEAT * moved:
        yield Finding(f"heats of named conditions, sources and pairs miss the stored heat by {off:.4g} J of the "
                      f"{moved:.4g} J that moved", off / (HEAT * moved) if moved else np.inf, WORDS)
    for kind, terms in KINDS.items():
        by_mechanism = sum((story.ledger[n] for n in terms if n in story.ledger), np.zeros(len(story.t)))
        off = float(np.abs(kinds[kind] - by_mechanism).max())
        if off > BY_KIND * moved:
            yield Finding(f"heats of named conditions by {kind} miss that mechanism by {off:.4g} J of the {moved:.4g} "
                          "J that moved", off / (BY_KIND * moved) if moved else np.inf, WORDS)


def forces_off(story: Story) -> Iterator[Finding]:
    """Bodies whose supports by name do not add up to the support of the body; along r the axis holds some."""
    assert story.scenario is not None
    along = slice(1, 2) if story.interface.axisymmetric else slice(0, 2)
    ring = 2.0 * np.pi * float(story.interface.nodes[:, 0].max()) if story.interface.axisymmetric else 1.0
    inner = float(np.abs(np.array(story.extra["mechanical.sigma"])).max()) * size_of(story) * ring
    for body in story.interface.bodies:
        held = [np.array(story.extra[f"mechanical.{of.output}"]) for of in story.scenario.conditions.values()
                if of.kind in ("u_x", "u_y") and of.name.startswith("reaction.") and of.place.split(".")[0] == body]
        whole = np.array(story.extra[f"mechanical.reaction.{body}"])
        size = float(np.abs(sum((np.abs(h) for h in held), np.abs(whole))).max())
        off, allowed = float(np.abs(sum(held, np.zeros_like(whole)) - whole)[:, along].max()), (
            FORCE * size + SUMMED * inner)
        if off > allowed:
            yield Finding(f"supports of {body} by name miss its reaction by {off:.4g} N of {size:.4g} N",
                          off / allowed if allowed else np.inf, WORDS)


def _check(scene: Scene, story: Story, rng: np.random.Generator) -> list[Finding]:
    other, force = told(named(scene, True)), True
    if other.outcome == REFUSED:  # a corner held alike by two conditions cannot have two names
        other, force = told(named(scene, False)), False
    if other.outcome != story.outcome or len(other.t) != len(story.t):
        return [Finding(f"with names the run is {other.outcome} in {len(other.t)} windows, without {story.outcome} in "
                        f"{len(story.t)}: {other.message}", np.inf, ("name",), other)]
    found = [*heats_off(other)]
    if force and scene.doc["mechanical"]["half"] == "elastic":
        found += forces_off(other)
    if not (np.array_equal(other.T, story.T) and np.array_equal(other.x, story.x)):
        found.append(Finding(f"names move temperatures by {np.abs(other.T - story.T).max():.4g} K and places by "
                             f"{np.abs(other.x - story.x).max():.4g} m", np.inf, ("name",), other))
    return found


NAMED = Invariant("names add up", lambda scene: True, _check, runs=1)
"""Heat of all named conditions, of sources and of either side of the pairs, with mechanical heat, is the heat stored,
to 1e-9 of what moved; by mechanism it is the heat balance, to 1e-12; what holds a body by name is what holds it; and
names change no bit of temperatures and places (a factor of 1 and an offset of 0 are exact).  Balance of energy and of
forces, at every window's end.
"""
