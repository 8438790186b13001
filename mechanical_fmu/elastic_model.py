"""The elastic half: quasi-static, large displacement, thermoelastic, with contact.  Eq. (23) without inertia."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.model import Discard, Done, Link, Value, Values, Variable
from contact.half.surfaces import History
from contact.wire import Tractions
from mechanical_fmu.contact_forces import contact_outputs, contact_variables
from mechanical_fmu.elastic_spec import parse_elastic
from mechanical_fmu.material import MaterialRangeError
from mechanical_fmu.newton import Equilibrium, NoEquilibriumError, Settings, solve
from mechanical_fmu.system import Balance, Loading, System, system_of
from mechanical_fmu.tangent import MOST_SURFACE_DOFS, Anchor
from mechanical_fmu.volume import InvertedCellError, von_mises

Floats = NDArray[np.float64]

# Prescribed components this close to their target (share of the largest body) are set, not solved for: round-off.
SNAP = 1e-12
# An old factor that needs more iterations than this in a step has had its time.
MOST_ANCHORED = 8
# Anchors kept: one in use, one that a rollback may return to.
KEPT_ANCHORS = 2


@dataclass(frozen=True)
class ElasticState:
    """All that evolves.  u : (n_nodes, 2) [m] at time t [s].  contact : its history.

    anchor_u, anchor_T : where the stiffness was last taken, (n_nodes, 2) [m] and (n_nodes,) [K].
    anchored : whether its factor is in use.
    """

    t: float
    u: Floats
    contact: History
    anchor_u: Floats
    anchor_T: Floats
    anchored: bool


class ElasticHalf:
    """HalfModel of elastic bodies.  What is kept on the object can be rebuilt bit for bit from any state."""

    def __init__(self, system: System, settings: Settings) -> None:
        self.system, self.settings = system, settings
        self.variables = _variables(system)
        self._anchors: dict[bytes, Anchor] = {}

    def start(self, inputs: Values, t: float, link: Link) -> tuple[ElasticState, Mapping[str, Value]]:
        """Equilibrium at t from the reference, all at once.  Raises ArithmeticError where there is none."""
        n, T = self.system.volume.n_nodes, _array(inputs["T"])
        u = np.zeros((n, 2))
        history = self.system.contact.no_history(self.system.interface.nodes)
        loading = self._loading(inputs, t, 1, history, link)
        first = self._predicted(u, loading)
        found = solve(self.system, loading, first, None, self.settings)
        state = ElasticState(t, found.balance.u, self._history(found.balance, history), found.balance.u, T, False)
        return state, self._outputs(found, loading, u)

    def step(self, state: ElasticState, inputs: Values, t: float, h: float, link: Link) -> Done | Discard:
        """Equilibrium at t + h."""
        try:
            return self._step(state, inputs, t, h, link)
        except InvertedCellError as exc:
            body = self.system.interface.bodies[exc.body]
            return Discard(f"cell {exc.cell + 1} of body {body} would be turned inside out", 0.25 * h)
        except ArithmeticError as exc:
            return Discard(str(exc), 0.0 if isinstance(exc, MaterialRangeError) else 0.5 * h)

    def _step(self, state: ElasticState, inputs: Values, t: float, h: float, link: Link) -> Done:
        u, T = _array(state.u), _array(inputs["T"])
        loading = self._loading(inputs, t + h, -1, state.contact, link)
        anchor = self._anchor(state)
        first = self._predicted(u, loading, tangent=not state.anchored)
        anchored = state.anchored or self._adopts(anchor, first)
        found = self._solved(loading, first, anchor if anchored else None)
        fits = anchored and not found.fresh and found.iterations <= MOST_ANCHORED
        after = replace(state, t=t + h, u=found.balance.u, contact=self._history(found.balance, state.contact),
                        anchored=fits)
        if not fits:
            after = replace(after, anchor_u=found.balance.u, anchor_T=T)
        return Done(after, self._outputs(found, loading, u))

    def _solved(self, loading: Loading, first: Balance, anchor: Anchor | None) -> Equilibrium:
        if anchor is not None:
            try:
                return solve(self.system, loading, first, anchor, self.settings)
            except (InvertedCellError, NoEquilibriumError):
                # An old tangent may lead astray where today's would not.
                pass
        return solve(self.system, loading, first, None, self.settings)

    def _adopts(self, anchor: Anchor, first: Balance) -> bool:
        """Whether the anchor's factor is worth keeping: the stiffness has hardly changed over a whole step."""
        if self.settings.adopt < 0.0 or self.system.contact.dofs.size > MOST_SURFACE_DOFS:
            return False
        assert first.entries is not None
        return anchor.drift(first.entries) <= self.settings.adopt

    def _predicted(self, u: Floats, loading: Loading, tangent: bool = True) -> Balance:
        """Balance, with tangent if asked for, where driven bodies have moved by their mean prescribed increment."""
        moved = self.system.constraints.moved(u, loading.target)
        fixed = self.system.constraints.fixed
        off = np.abs(moved.ravel()[fixed] - loading.target)
        if off.size and off.max() <= SNAP * float(self.system.size.max()):
            moved.ravel()[fixed] = loading.target
        return self.system.balance(moved, loading, tangent)

    def _loading(self, inputs: Values, t: float, side: int, history: History, link: Link) -> Loading:
        spec = self.system.spec
        factors = {name: float(inputs[f"load.{name}"]) for name in spec.load_names}
        target = self.system.constraints.values(t, side, factors)
        pressure = np.array([p.value.at(t, side) * (factors[p.name] if p.name else 1.0) for p in spec.pressures])
        return Loading(self.system.moduli(_array(inputs["T"])), target, pressure, self._asker(history, link))

    def _asker(self, history: History, link: Link) -> Callable[[Floats], Tractions] | None:
        if not self.system.interface.pairs:
            return None
        return lambda x: self.system.contact.tractions(link, x, history)

    def _history(self, balance: Balance, before: History) -> History:
        if balance.tractions is None:
            return before
        at = self.system.interface.contact_nodes
        return History(before.multipliers, (self.system.interface.nodes + balance.u)[at], balance.tractions.shear)

    def _anchor(self, state: ElasticState) -> Anchor:
        key = state.anchor_u.tobytes() + state.anchor_T.tobytes()
        anchor = self._anchors.pop(key, None)
        if anchor is None:
            u, T = _array(state.anchor_u), _array(state.anchor_T)
            anchor = Anchor(self.system, u, self.system.moduli(T))
        self._anchors[key] = anchor
        while len(self._anchors) > KEPT_ANCHORS:
            del self._anchors[next(iter(self._anchors))]
        return anchor

    def _outputs(self, found: Equilibrium, loading: Loading, u_before: Floats) -> dict[str, Value]:
        system, balance = self.system, found.balance
        now = system.volume.stress(balance.u, loading.moduli)
        before = system.volume.stress(u_before, loading.moduli)
        increment = max(float(np.abs(a[1] - b[1]).max()) for a, b in zip(now, before, strict=True))
        outputs: dict[str, Value] = {
            "x": system.interface.nodes + balance.u,
            "sigma_v": np.concatenate([von_mises(stress).mean(axis=1) for stress, _ in now]),
            "iterations": float(found.iterations), "residual": found.residual, "max_strain_increment": increment,
        }
        held = balance.r * (1.0 - system.constraints.free.reshape(-1, 2))
        for i, name in enumerate(system.interface.bodies):
            outputs[f"reaction.{name}"] = held[system.interface.node_body == i].sum(axis=0)
        if balance.tractions is not None:
            outputs |= contact_outputs(balance.tractions, system.contact.slips)
        return outputs


def load(interface: Interface, model: Mapping[str, Any]) -> ElasticHalf:
    """The elastic half of an interface and a model.json.  Raises ValueError naming what is wrong."""
    spec = parse_elastic(interface, model)
    return ElasticHalf(system_of(interface, spec), Settings(spec.tolerance))


def _array(value: Any) -> Floats:
    """A private, writable copy: the kernels are compiled for such arrays, and states are read-only."""
    return np.array(value, dtype=np.float64, order="C")


def _variables(system: System) -> tuple[Variable, ...]:
    interface, spec = system.interface, system.spec
    n, n_s = len(interface.nodes), interface.contact_nodes.size
    T_ref = np.array([m.T_ref for m in spec.materials])[spec.body_material]
    # A node outside every cell (body -1) takes the last body's; nothing depends on it.
    inputs = [Variable("T", (n,), "input", "K", T_ref[interface.node_body], description="temperature at the end")]
    inputs += [Variable(f"load.{name}", (), "input", "1", 1.0, description="factor") for name in spec.load_names]
    outputs = [Variable("x", (n, 2), unit="m", start=interface.nodes, description="current coordinates"),
               Variable("sigma_v", (system.volume.n_cells,), unit="Pa", description="von Mises stress, cell mean"),
               Variable("iterations"), Variable("residual"), Variable("max_strain_increment")]
    outputs += [Variable(f"reaction.{name}", (2,), unit="N", description="force of the prescribed displacements")
                for name in interface.bodies]
    return (*inputs, *outputs, *(contact_variables(n_s, system.contact.slips) if n_s else ()))
