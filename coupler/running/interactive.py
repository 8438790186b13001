"""What the user of a run may change between two of its windows, and whether that can be done."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypedDict, Unpack

from coupler.control.plan import Plan
from coupler.control.state import Committed, ControlState
from coupler.errors import CouplingError, ScenarioError
from coupler.fmu.half import Half
from coupler.record.checkpoint import RunRecord
from coupler.rules.fit import unfit
from coupler.scenario.options import Iteration, Scheme
from coupler.scenario.rule_model import Rule
from coupler.schemes.state import Halves

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


# Moments of a run that were kept, to go back to.

@dataclass(frozen=True, eq=False)
class Moment:
    """The end of a window.  tokens : of the states of both halves.  plan : its rules may have been changed since."""

    committed: Committed
    record: RunRecord
    plan: Plan
    tokens: tuple[int, int]

    @property
    def t(self) -> float:
        """s."""
        return self.committed.state.now.t


class Moments:
    """Those that can be gone back to; each holds a state of both halves until it is let go."""

    def __init__(self, halves: Halves) -> None:
        self._halves: tuple[Half, Half] = (halves.thermal, halves.mechanical)
        self._kept: list[Moment] = []

    def keep(self, committed: Committed, record: RunRecord, plan: Plan) -> Moment:
        """Both halves stand at the end of the committed window.  Raises CouplingError where one keeps no states."""
        for half in self._halves:
            if not half.can_save:
                raise CouplingError(f"half {half.name!r} keeps no states, so no window can be gone back to",
                                    t=committed.state.now.t)
        thermal, mechanical = self._halves
        self._kept.append(Moment(committed, record, plan, (thermal.save(), mechanical.save())))
        return self._kept[-1]

    def put_back(self, moment: Moment) -> None:
        """Both halves to a moment; later ones are let go, for what led there is no longer so.

        Raises CouplingError for a moment that was let go.
        """
        if moment not in self._kept:
            raise CouplingError("this moment was let go: the run was taken back to one before it", t=moment.t)
        for half, token in zip(self._halves, moment.tokens, strict=True):
            # fault: halves stay where they were when the run is rewound -> pass | coupler/test_interactive
            half.restore(token)
        for later in self._kept[self._kept.index(moment) + 1:]:
            # fault: moments after one that was gone back to stay -> pass | coupler/test_interactive
            self.let_go(later)

    def let_go(self, moment: Moment) -> None:
        """Give its states back."""
        self._kept.remove(moment)
        for half, token in zip(self._halves, moment.tokens, strict=True):
            half.release(token)
