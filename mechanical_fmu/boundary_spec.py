"""What holds and pushes the bodies, as model.json says it, checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.checks import keys, known, nodes_on, signal
from contact.half.interface import Interface
from contact.half.signal import Signal

Ints = NDArray[np.int32]

KINDS = ("displacement", "pressure", "traction", "force", "gravity", "body_force")


@dataclass(frozen=True)
class Displacement:
    """Eq. (15): component of u is value(t) [m] at nodes; or of a rigid body's point, component 2 its angle [rad].

    on : the name they go by.  name : of its inputs, or "".  rigid : number among the rigid bodies, else -1.
    """

    on: str
    nodes: Ints
    component: int
    value: Signal
    name: str
    rigid: int = -1


@dataclass(frozen=True)
class Pressure:
    """Eq. (16): a pressure value(t) [Pa] that pushes on the body and follows its edges : (n, 2)."""

    on: str
    edges: Ints
    value: Signal
    name: str


@dataclass(frozen=True)
class DeadLoad:
    """One component (0 x, 1 y; 2 a moment on a rigid body) of a force that keeps size and direction.

    kind : "traction" [Pa] of reference surface; "force" [N] at nodes, shared evenly (the whole turn when axisymmetric,
    per metre of depth when plane), or on a rigid body's reference point ([N], [N m]); "gravity" [m/s2] and
    "body_force" [N/m3] of reference volume on a body.  on : surface, node set or body.  name, rigid : as above.
    """

    kind: str
    on: str
    component: int
    value: Signal
    name: str
    rigid: int = -1


Condition = Displacement | Pressure | DeadLoad


def parse_boundary(interface: Interface, spec: Any, where: str, rigid: Mapping[str, int]) -> Condition:
    """One entry of "boundary".  rigid : name of each rigid body -> its number.  Raises ValueError."""
    kind = known(keys(spec, where, {"kind"}, spec)["kind"], f"{where}.kind", KINDS)
    if kind == "pressure":
        keys(spec, where, {"kind", "on", "value"}, {"name"})
        on = known(spec["on"], f"{where}.on", interface.surfaces)
        return Pressure(on, interface.surfaces[on], signal(spec["value"], f"{where}.value"), _name(spec))
    keys(spec, where, {"kind", "on", "component", "value"}, {"name"})
    value, name = signal(spec["value"], f"{where}.value"), _name(spec)
    number = rigid.get(spec["on"], -1) if kind in ("displacement", "force") and isinstance(spec["on"], str) else -1
    component = _component(spec["component"], where, number >= 0)
    if kind == "displacement":
        nodes = np.empty(0, np.int32) if number >= 0 else nodes_on(interface, spec["on"], f"{where}.on")
        return Displacement(spec["on"], nodes, component, value, name, number)
    return DeadLoad(kind, _place(interface, spec["on"], where, kind, number), component, value, name, number)


def _place(interface: Interface, on: Any, where: str, kind: str, number: int) -> str:
    places = {"traction": list(interface.surfaces), "force": list(interface.node_sets)}
    return str(on) if number >= 0 else known(on, f"{where}.on", places.get(kind, list(interface.bodies)))


def _component(component: Any, where: str, turns: bool) -> int:
    if isinstance(component, bool) or component not in ((0, 1, 2) if turns else (0, 1)):
        choice = "0 (x), 1 (y) or 2 (angle, moment)" if turns else "0 (x) or 1 (y)"
        raise ValueError(f"model.json: {where}.component must be {choice}, not {component!r}")
    return int(component)


def _name(spec: Mapping[str, Any]) -> str:
    return str(spec.get("name") or "")
