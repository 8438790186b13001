"""What the user of a run may change between two of its windows, and whether that can be done."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypedDict, Unpack

from coupler.control.state import ControlState
from coupler.errors import ScenarioError
from coupler.rules.fit import unfit
from coupler.rules.model import Rule
from coupler.scenario.options import Iteration, Scheme
from coupler.schemes.window import Halves

METHOD, SIDES = "control.method", ("thermal", "mechanical")


class Changes(TypedDict, total=False):
    """scheme : name or Scheme.  window [s]: the size of the next window where windows find their own.

    window_factor, window_cap [s], substeps, iteration, inputs : as in Settings; substeps and inputs are added to what
    there is.  rules : take the place of all there are, and remember nothing.
    """

    scheme: str | Scheme
    window: float
    window_factor: float
    window_cap: float
    substeps: Mapping[str, int]
    iteration: Iteration
    inputs: Mapping[str, Mapping[str, float]]
    rules: Sequence[Rule]


def changed(control: ControlState, halves: Halves, **changes: Unpack[Changes]) -> ControlState:
    """Control with these settings from the next window on.  Raises ScenarioError for what cannot be."""
    if unknown := set(changes) - set(Changes.__annotations__):
        raise _refused(min(unknown), "", f"What can be changed: {', '.join(Changes.__annotations__)}")
    blocks = {"thermal": halves.thermal.blocks, "mechanical": halves.mechanical.blocks}
    if lacks := unfit(changes.get("rules", ()), blocks):
        raise _refused("rules", None, "; ".join(lacks))
    settings = control.settings
    if "scheme" in changes:
        settings = replace(settings, scheme=_scheme(changes["scheme"]))
    if "iteration" in changes:
        settings = replace(settings, iteration=changes["iteration"])
    for name in ("window", "window_factor", "window_cap"):
        if name in changes and not changes[name] > 0.0:
            raise _refused(name, changes[name], "It must be above 0.")
    settings = replace(settings, window_factor=changes.get("window_factor", settings.window_factor),
                       window_cap=changes.get("window_cap", settings.window_cap),
                       substeps={**settings.substeps, **_substeps(changes.get("substeps", {}))},
                       inputs=_inputs(settings.inputs, changes.get("inputs", {}), halves))
    return replace(control, settings=settings, size=changes.get("window", control.size),
                   reason="as changed" if "window" in changes else control.reason)


def _scheme(name: str | Scheme) -> Scheme:
    known = {s.value: s for s in Scheme}
    value = name.value if isinstance(name, Scheme) else name
    if value not in known:
        raise _refused("scheme", value, f"Known: {', '.join(known)}.")
    return known[value]


def _substeps(wanted: Mapping[str, int]) -> Mapping[str, int]:
    for side, n in wanted.items():
        if side not in SIDES or int(n) != n or n < 1:
            raise _refused(f"substeps.{side}", n, "A whole number from 1 on, for thermal or mechanical.")
    return wanted


def _inputs(known: Mapping[str, Mapping[str, float]], wanted: Mapping[str, Mapping[str, float]],
            halves: Halves) -> dict[str, Mapping[str, float]]:
    found = dict(known)
    for side, values in wanted.items():
        if side not in SIDES:
            raise _refused(f"inputs.{side}", "", "There are a thermal and a mechanical half.")
        blocks = getattr(halves, side).blocks
        fits = [n for n, b in blocks.items() if b.causality == "input" and b.shape == () and b.kind != "String"]
        for name in values:
            if name not in fits:
                raise _refused(f"inputs.{side}.{name}", values[name],
                               f"Inputs of that half that are one number: {', '.join(sorted(fits)) or 'none'}.")
        found[side] = {**known.get(side, {}), **values}
    return found


def _refused(key: str, value: object, remedy: str) -> ScenarioError:
    return ScenarioError("this cannot be changed to that in a run", key=key, value=value, remedy=remedy)
