"""Changes a run between two windows, and takes snapshots of it to go back to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypedDict, Unpack

from coupler.control.plan import Plan
from coupler.control.state import Committed, ControlState
from coupler.errors import CouplingError, ScenarioError
from coupler.fmu.half import Half
from coupler.record.checkpoint import RunRecord
from coupler.rules.engine import unfit
from coupler.scenario.options import Iteration, Scheme
from coupler.scenario.rule_model import Rule
from coupler.schemes.state import Halves

METHOD, SIDES = "control.method", ("thermal", "mechanical")


class Changes(TypedDict, total=False):
    """What may be changed.

    scheme : name or Scheme.  window : size of the next window [s], where windows are adaptive.
    window_factor, window_cap [s], substeps, iteration, inputs : as in Settings; substeps and inputs are added to those
    in force.  rules : replace all, without memory.
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
    """Return the control state with these settings from the next window on.

    Raises ScenarioError for an unknown key, and for a value that the halves or the run cannot take.
    """
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
    schemes = {s.value: s for s in Scheme}
    value = name.value if isinstance(name, Scheme) else name
    if value not in schemes:
        raise _refused("scheme", value, f"One of {', '.join(schemes)}.")
    return schemes[value]


def _substeps(wanted: Mapping[str, int]) -> Mapping[str, int]:
    for side, n in wanted.items():
        if side not in SIDES or int(n) != n or n < 1:
            raise _refused(f"substeps.{side}", n, "A whole number from 1 on, for thermal or mechanical.")
    return wanted


def _inputs(before: Mapping[str, Mapping[str, float]], wanted: Mapping[str, Mapping[str, float]],
            halves: Halves) -> dict[str, Mapping[str, float]]:
    inputs = dict(before)
    for side, values in wanted.items():
        if side not in SIDES:
            raise _refused(f"inputs.{side}", "", "There are a thermal and a mechanical half.")
        blocks = getattr(halves, side).blocks
        fits = [n for n, b in blocks.items() if b.causality == "input" and b.shape == () and b.kind != "String"]
        for name in values:
            if name not in fits:
                raise _refused(f"inputs.{side}.{name}", values[name],
                               f"Inputs of that half that are one number: {', '.join(sorted(fits)) or 'none'}.")
        inputs[side] = {**before.get(side, {}), **values}
    return inputs


def _refused(key: str, value: object, remedy: str) -> ScenarioError:
    return ScenarioError("this cannot be changed to that in a run", key=key, value=value, remedy=remedy)


# Snapshots of a run, to go back to.

@dataclass(frozen=True, eq=False)
class Snapshot:
    """The end of a window.

    record : of the run up to there.  plan : its rules may have been changed since.  tokens : of both halves' states.
    """

    committed: Committed
    record: RunRecord
    plan: Plan
    tokens: tuple[int, int]

    @property
    def t(self) -> float:
        """Its time [s]."""
        return self.committed.state.now.t


class Snapshots:
    """The snapshots one can go back to; each holds a state of both halves until it is released."""

    def __init__(self, halves: Halves) -> None:
        self._halves: tuple[Half, Half] = (halves.thermal, halves.mechanical)
        self._all: list[Snapshot] = []

    def take(self, committed: Committed, record: RunRecord, plan: Plan) -> Snapshot:
        """Take a snapshot; both halves are at the end of the committed window.

        Raises CouplingError where a half cannot save its state.
        """
        for half in self._halves:
            if not half.can_save:
                raise CouplingError(f"half {half.name!r} cannot save its state, so there are no snapshots",
                                    t=committed.state.now.t)
        thermal, mechanical = self._halves
        self._all.append(Snapshot(committed, record, plan, (thermal.save(), mechanical.save())))
        return self._all[-1]

    def restore(self, snapshot: Snapshot) -> None:
        """Restore both halves to a snapshot, and release later ones: the run now takes another course.

        Raises CouplingError for a snapshot that was released.
        """
        if snapshot not in self._all:
            raise CouplingError("this snapshot was released: the run went back to one before it", t=snapshot.t)
        for half, token in zip(self._halves, snapshot.tokens, strict=True):
            # fault: halves stay where they were when the run is rewound -> pass | coupler/test_interactive
            half.restore(token)
        for later in self._all[self._all.index(snapshot) + 1:]:
            # fault: snapshots after one that was gone back to stay -> pass | coupler/test_interactive
            self.release(later)

    def release(self, snapshot: Snapshot) -> None:
        """Release the states of a snapshot."""
        self._all.remove(snapshot)
        for half, token in zip(self._halves, snapshot.tokens, strict=True):
            half.release(token)
