"""How far the hottest and the coldest temperature of each body are off because cells are too large: an estimate.

The balance of the scene is solved once more with every edge of its cells halved.  With T_h the temperatures of the
half, what smaller cells change of them is e, which the balance that T_h leaves there drives:

    C de/dt + K e = f(T_h) - C dT_h/dt,

in one step of backward Euler as long as it had time to grow: since the start or since data jumped, and no longer than
temperatures take at their present rate to where they are.  A steady scene has no C.  All that heats a scene is read
anew by the smaller cells, so what is narrower than a cell counts, and what is wrong at one place reaches others as heat
does.

Two numbers are told, the larger one.  What the highest (lowest) temperature changes by, times MORE: cells that are
halved again, and again, change it too, by 1/3 of that where it is smooth and more beside what is not.  And what still
hides between nodes: |e| of a node less what it is below the highest, times HIDDEN.  A strip of heat on two edges warms
their nodes too little or too much, by where it lies, and half as large cells may do either again.  Against cells a
quarter as large, of 428 extremes 163 were off by more than 0.5 % of the range, and 159 of those were told within a
factor 3; a source much narrower than a cell is told too small (docs/trust.md).

So is told of each output that a run may probe what smaller cells change of it (HALVED): of the temperature at each
node, the solid fraction, and the heat through each condition and pair since errors began to grow.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.linalg import SingularMatrixError
from contact.half.model import Value, Variable
from contact.messages import Facing
from thermal_fmu import phase_change
from thermal_fmu.boundary import through_prescribed
from thermal_fmu.cells import BadPropertyError, InvertedMeshError, MatrixEntries, shapes_of
from thermal_fmu.conditions import named_heats
from thermal_fmu.contact_quadrature import ContactPoints, contact_points
from thermal_fmu.earlier import Earlier
from thermal_fmu.elsewhere import TemperatureCourse
from thermal_fmu.halved import Halved, halved, halved_facing
from thermal_fmu.halved_means import Means
from thermal_fmu.linear import AnchorMatrix, Factors
from thermal_fmu.methods import KNOTS, Stage
from thermal_fmu.newton import NotConvergedError, StageProblem, balance, solve_stage
from thermal_fmu.phase_change import Melting, NodalFields
from thermal_fmu.problem import Model, parse_model
from thermal_fmu.scene import SubstepData, ThermalScene, freeze, prescribed_values, with_friction
from thermal_fmu.sources import loads_at
from thermal_fmu.step import StepContext, flow_at
from thermal_fmu.surface_terms import at_nodes
from thermal_fmu.surplus import Linear, MoreWarmth, surplus

Floats = NDArray[np.float64]

HIGH_OFF, LOW_OFF = "mesh.T_high_off.", "mesh.T_low_off."  # of a body: outputs
HALVED = "mesh.halved."  # of an output: what is added to it is nearer to the truth
UNKNOWN = -1.0
MORE, HIDDEN = 1.5, 0.4
# Of heat that flows in all: what Newton's method leaves of it.
LEFT = 1e-7
TOLERANCE = 1e-8
BACKWARD_EULER = Stage(1.0, 1.0, 1.0)


@dataclass(frozen=True)
class StepEnded:
    """The end of a substep.

    context : it was taken in.  x, X : (n, 2) [m] where nodes are, and were at the start.  s_0 : (n,) [K] of the run's
    start.  earlier : s of where errors may have begun to grow.  s_n, s : (n,) [K] at the substep's start and end.
    t, h [s]: its end and length.  since [s]: how long ago all began, or data jumped.  stores : whether bodies store
    heat.
    E_M : (n_cells,) [J] of it.  facing, points : what faces what; None without pairs.  t_N, E : traction [Pa] and
    friction heat [J] at pair nodes, (n_q,) each.
    """

    context: StepContext
    x: Floats
    X: Floats
    s_0: Floats
    earlier: Earlier
    s_n: Floats
    s: Floats
    t: float
    h: float
    since: float
    stores: bool
    E_M: Floats
    facing: Facing | None
    points: ContactPoints | None
    t_N: Floats
    E: Floats

    @property
    def grown(self) -> float:
        """How long errors grew [s].

        What drives them now may have begun a moment ago, with a ramp after a long rest: it did not all the time.
        Temperatures that come to rest make this long, so that what is steady grows since all began.
        """
        last = float(np.abs(self.s - self.s_n).max(initial=0.0))
        far = float(np.abs(self.s - self.s_0).max(initial=0.0))
        # fault: what has just begun to warm a body is taken to have done so all the time -> return self.since |
        #   thermal_fmu/test_extremes::test_errors_grow_since_temperatures_move
        return min(self.since, self.h * max(far / last, 1.0)) if last > 0.0 else self.since

    @property
    def rate(self) -> Floats:
        """(n,) [K/s] at which nodes take up heat, over what they store at `even`: free ones what flows into them.

        Heat flows smoothly from node to node also where c(T) has a peak, and temperatures do not: at a peak that has
        just come to a node, or left it, they say nothing of what they do between nodes, or a moment later.
        """
        if not self.stores:
            return np.zeros(self.s.size)
        scene, substep = self.context.scene, self.context.substep
        # fault: what nodes take up is taken for even in temperature -> C = scene.bulk.capacities(substep, self.s) |
        #   thermal_fmu/test_extremes::test_a_peak_of_the_heat_capacity_is_no_error_of_the_mesh
        C = scene.bulk.capacities(substep, self.even(self.s))
        flow = flow_at(self.context, self.s, self.t, self.h, -1).f
        took = np.where(scene.fixed, scene.bulk.capacities(substep, self.s) * (self.s - self.s_n) / self.h, flow)
        return np.divide(took, C, out=np.zeros(C.size), where=C > 0.0)

    @property
    def more(self) -> MoreWarmth | None:
        """By how much more nodes were warmed since errors began to grow than they are now; None: nothing is known.

        Of bodies that melt nothing is.  As of `rate` it is what they stored, over what they store at `even`.
        """
        scene, substep = self.context.scene, self.context.substep
        began = self.earlier.since(self.t - self.grown, self.t)
        if not self.stores or began is None:
            return None
        S = np.zeros(self.s.size)
        scene.bulk.store(substep, began.s, self.s, S, MatrixEntries(np.empty(0), 0.0))
        C = scene.bulk.capacities(substep, self.even(self.s))
        D = np.divide(S, C, out=np.zeros(C.size), where=C > 0.0) - self.grown * self.rate
        known = (C > 0.0) & ~scene.fixed
        y = (self.s - began.s) - began.way / self.grown
        for body in scene.melting:
            known[body.nodes] = False
        return MoreWarmth(D, y, known)

    def even(self, s: Floats) -> Floats:
        """One temperature of all nodes [K], at which they store by their size, in the shape of s."""
        return np.full(s.shape, self.s.mean())


def extreme_variables(interface: Interface, bodies: Mapping[str, int]) -> tuple[Variable, ...]:
    """List what is told.  bodies : name -> number, those that are solved for."""
    # One point a slave node is no piece that could be cut.
    if any(pair.by_node for pair in interface.pairs):
        return ()
    return tuple(Variable(prefix + name, unit="K", description=f"how far the {which} temperature of the body is off by "
                          "its mesh, estimated; -1: not known")
                 for name in bodies for prefix, which in ((HIGH_OFF, "highest"), (LOW_OFF, "lowest")))


def halved_variables(interface: Interface, model: Model, melting: Sequence[Melting]) -> tuple[Variable, ...]:
    """List what is told of other outputs: HALVED and the name of each."""
    if any(pair.by_node for pair in interface.pairs):
        return ()
    n, told = len(interface.nodes), "what halved cells change of it, estimated"
    melts = (Variable(f"{HALVED}f_s", (n,), on="nodes", description=f"solid fraction: {told}; its means are right"),)
    return (Variable(f"{HALVED}T", (n,), unit="K", on="nodes", description=f"temperature: {told}; 0 in bodies at "
                     "whose fronts something melts"),
            Variable(f"{HALVED}T_mean", (n,), unit="K", on="nodes", description=f"temperature: {told}, such that its "
                     "means over bodies and over cells are right"), *(melts if melting else ()),
            *(replace(heat.variable, name=HALVED + heat.variable.name, description=f"{heat.description}: {told}")
              for heat in named_heats(interface, model)))


@dataclass(frozen=True)
class _Solved:
    """What a half has, on straight lines, and what halved cells make of it.

    before, after : (n_halved,) each.  T : (n_halved,) [K] after, with what is left of what flowed otherwise before
    (surplus.py).  sizes : (n_halved,) of nodes, in any unit.  heat : (n_heats,) [J] that flows more with halved cells.
    """

    before: NodalFields
    after: NodalFields
    T: Floats
    sizes: Floats
    heat: Floats


class HalvedScene:
    """The scene of a half with halved cells.  It remembers what follows from the scene alone."""

    def __init__(self, interface: Interface, spec: Mapping[str, Any], bodies: Mapping[str, int], model: Model,
                 melting: Sequence[Melting]) -> None:
        """spec : content of model.json, model : what that says.  bodies : as extreme_variables has them."""
        self._interface, self._spec, self._bodies, self._melting = interface, spec, bodies, melting
        self._heats = named_heats(interface, model)
        self._extremes = tuple(v.name for v in extreme_variables(interface, bodies))
        others = halved_variables(interface, model, melting)
        self.unknown: dict[str, Value] = dict.fromkeys(self._extremes, UNKNOWN)
        self.unknown |= {v.name: np.full(v.shape, np.nan) if v.shape else np.nan for v in others}
        self.at_start: dict[str, Value] = dict.fromkeys(self._extremes, UNKNOWN)
        self.at_start |= {v.name: np.zeros(v.shape) if v.shape else 0.0 for v in others}

    @cached_property
    def _halved(self) -> Halved:
        return halved(self._interface)

    @cached_property
    def _scene(self) -> ThermalScene:
        return ThermalScene(self._halved.interface, parse_model(self._halved.interface, self._spec))

    @cached_property
    def _means(self) -> Means:
        return Means(self._scene.volume, self._halved)

    def outputs(self, end: StepEnded) -> dict[str, Callable[[], Value]]:
        """Return the outputs by name, each worked out when it is asked for, all at once."""
        told = _Told(self, end)
        return {name: partial(told.of, name) for name in self.unknown}

    def told(self, end: StepEnded) -> dict[str, Value]:
        """Estimate by name how far outputs are off; `unknown` where the halved cells have no solution."""
        try:
            solved = self._solved(end)
        except (NotConvergedError, SingularMatrixError, BadPropertyError, InvertedMeshError):
            return self.unknown
        return {**self._told_of_extremes(solved), **self._told_of_outputs(solved)}

    def _told_of_extremes(self, solved: _Solved) -> dict[str, Value]:
        of, found = self._halved.interface.node_body, dict[str, Value]()
        for name, b in self._bodies.items():
            own, free = of == b, ~self._scene.fixed[of == b]
            for prefix, sign in ((HIGH_OFF, 1.0), (LOW_OFF, -1.0)):
                found[prefix + name] = _off(sign * solved.before.T[own], sign * solved.after.T[own], free)
        return found

    def _told_of_outputs(self, solved: _Solved) -> dict[str, Value]:
        n, P = len(self._interface.nodes), self._halved.P
        T = MORE * (solved.T - solved.before.T)[:n]

        def mean(change: Floats) -> Floats:
            """What nodes in between have goes to those of the half, by their size."""
            return np.asarray(P.T @ (solved.sizes * change) / (P.T @ solved.sizes))

        # fault: means are those of the half's nodes alone -> T_mean = np.array(T) | coupler/test_trust_probed
        # fault: means are those by the size of nodes -> T_mean = MORE * mean(solved.after.T - solved.before.T) |
        #   thermal_fmu/test_halved_means
        T_mean = MORE * self._means.at_nodes(solved.T - solved.before.T)
        found: dict[str, Value] = {f"{HALVED}T": T, f"{HALVED}T_mean": T_mean}
        if solved.before.f_s is not None and solved.after.f_s is not None:
            # In one long step a front goes from node to node, as it does in the half: who tells of fronts is fronts.py.
            for body in self._melting:
                f_s = solved.before.f_s[:n][body.nodes]
                # fault: where a front is, halved cells tell of temperatures too -> if False: |
                #   thermal_fmu/test_extremes::test_fronts_are_told_by_others
                if f_s.min() < 1.0 and f_s.max() > 0.0:
                    T[body.nodes] = T_mean[body.nodes] = 0.0
            # What a front gives one node it takes from the next, so nodes in between count with those of the half.
            # fault: solid fractions are those of the half's nodes alone -> found[f"{HALVED}f_s"] = (solved.after.f_s -
            #   solved.before.f_s)[:n] | thermal_fmu/test_extremes
            found[f"{HALVED}f_s"] = mean(solved.after.f_s - solved.before.f_s)
        for heat in self._heats:
            off = MORE * np.array([solved.heat[list(rows)].sum() for rows in heat.rows])
            found[HALVED + heat.variable.name] = off if off.size > 1 else float(off[0])
        return found

    def _solved(self, end: StepEnded) -> _Solved:
        """What halved cells make of the end of a substep."""
        scene, P = self._scene, self._halved.P
        x, s = P @ end.x, P @ end.s
        points = None if end.facing is None else contact_points(
            scene.surfaces, halved_facing(end.facing), self._halved.at_pair_nodes(end.t_N), x,
            0.0 if end.points is None else end.points.join)
        substep = freeze(scene, scene.masses(P @ end.X), x, self._mechanical(end, x), points)
        if points is not None and end.points is not None and end.E.any():
            E = self._friction(end.points, points, end.E)
            substep = with_friction(substep, scene, points, E, phase_change.fields(scene.melting, s), end.h)
        return self._after(end, substep, s)

    def _after(self, end: StepEnded, substep: SubstepData, s: Floats) -> _Solved:
        scene, model = self._scene, self._scene.model
        T = phase_change.temperature(scene.melting, s)
        course = None
        if model.elsewhere.size:
            course = TemperatureCourse(end.t, 0.0, np.tile(T[model.elsewhere], (len(KNOTS), 1)))
        loads = loads_at(model, end.context.load_factors, end.context.calendar.snap(end.t, end.h), -1, course)
        guess = phase_change.prescribe(scene.melting, s, prescribed_values(substep, loads.prescribed, T), scene.fixed)
        sizes = scene.bulk.capacities(substep, end.even(s))
        # fault: what is stored is taken for an error -> kept = np.zeros(s.size) | thermal_fmu/test_extremes
        kept = -end.grown * sizes * (self._halved.P @ end.rate)
        problem = StageProblem(scene, substep, loads, BACKWARD_EULER, end.grown, s, substep.E_M / end.h, kept,
                               end.stores)
        factors = Factors()
        done = solve_stage(problem, guess, TOLERANCE, factors, None)
        whole, at_whole = done.s, done.balance
        # fault: what flowed otherwise before is forgotten -> more = None | thermal_fmu/test_surplus
        more = end.more
        if more is not None:
            J = done.linear.jacobian
            own = Linear(J, factors.of(AnchorMatrix(J.indptr, J.indices, J.data)),
                         scene.bulk.capacities(substep, done.linear.s), scene.fixed)
            whole = done.s + surplus(own, self._halved.P, sizes, more)
            at_whole = balance(problem, whole, jacobian=False)
        each, at_before = at_whole.each, balance(problem, s, jacobian=False)
        more_heat = end.grown * (each - at_before.each)
        held = self._through_held(end, sizes, at_before.R + kept, at_whole.R)
        # fault: heat that is no more with smaller cells is told by what iterations leave -> slight = 0.0 |
        #   thermal_fmu/test_extremes
        slight = LEFT * (end.grown * float(np.abs(each).sum()) + float(np.abs(at_whole.R[scene.fixed]).sum()))
        more_heat = np.concatenate([held, more_heat])
        heat = np.where(np.abs(more_heat) > slight, more_heat, 0.0)
        return _Solved(phase_change.fields(scene.melting, s), phase_change.fields(scene.melting, done.s),
                       phase_change.temperature(scene.melting, whole), sizes, heat)

    def _through_held(self, end: StepEnded, sizes: Floats, left: Floats, R: Floats) -> Floats:
        """(n_prescribed,) [J] that halved cells bring more through each prescribed temperature.

        What a node is held by is what it stores less what flows into it.  sizes : (n_halved,) capacities [J/K].  left :
        (n_halved,) [J] what leaves the nodes while temperatures are on straight lines; P' of it leaves those of the
        half.  R : (n_halved,) [J] as of StageBalance, with halved cells.
        """
        scene, of, P = self._scene, end.context.scene, self._halved.P
        n = len(scene.model.prescribed)
        half = through_prescribed((P.T @ left + end.grown * (P.T @ sizes) * end.rate)[of.fixed], of.owners, n)
        # fault: what prescribed temperatures bring is right on any mesh -> more = np.zeros(n) |
        #   thermal_fmu/test_extremes
        more = through_prescribed(R[scene.fixed], scene.owners, n) - half
        before, now = (-through_prescribed(flow_at(end.context, s, end.t, end.h, -1).f[of.fixed], of.owners, n)
                       for s in (end.s_n, end.s))
        # Heat that comes to a far side has flowed for a part of that time: at the least for as long as it takes to grow
        # to what it is, if the error grew as it did, at the most for all of it.  Between the two lies their mean.
        growth = np.maximum((now - before) * np.sign(now), 0.0)
        # fault: heat that has just come to a far side has flowed since all began -> flowed = np.full(n, end.grown) |
        #   thermal_fmu/test_extremes
        flowed = np.divide(np.abs(now) * end.h, growth, out=np.full(n, end.grown), where=growth > 0.0)
        return np.asarray(more * np.sqrt(np.minimum(flowed / end.grown, 1.0)))

    def _mechanical(self, end: StepEnded, x: Floats) -> Floats:
        """(n_cells,) [J] of halved cells, by their parts of the cell they are of."""
        if not end.E_M.any():
            return np.zeros(self._scene.volume.n_cells)
        V, parent = np.empty(self._scene.volume.n_cells), self._halved.parent
        for block, shape in zip(self._scene.volume.blocks, shapes_of(self._scene.volume, x), strict=True):
            V[block.numbers] = shape.dV.sum(axis=1)
        return np.asarray(end.E_M[parent] * V / np.bincount(parent, V)[parent])

    def _friction(self, old: ContactPoints, new: ContactPoints, E: Floats) -> Floats:
        """(n_q,) [J] at pair nodes of halved edges: the same heat per area."""
        def areas(points: ContactPoints, n: int) -> Floats:
            nodes, N = points.searched_from
            return at_nodes(nodes, N * points.area[:, None], n)

        area = areas(old, E.size)
        per_area = self._halved.at_pair_nodes(np.divide(E, area, out=np.zeros(E.size), where=area > 0.0))
        return areas(new, per_area.size) * per_area


def _off(T_h: Floats, T: Floats, free: NDArray[np.bool_]) -> float:
    """How far the highest of T_h is off [K].  T : with halved cells.  free : where it is solved for; (m,) of a body."""
    # fault: what hides between nodes is not told -> hidden = 0.0 | thermal_fmu/test_extremes
    hidden = float((np.abs(T - T_h) - (T.max() - T))[free].max(initial=0.0))
    return max(MORE * abs(float(T.max() - T_h.max())), HIDDEN * hidden)


@dataclass(frozen=True)
class _Told:
    """What is told of the end of a substep."""

    scene: HalvedScene
    end: StepEnded

    @cached_property
    def _all(self) -> dict[str, Value]:
        return self.scene.told(self.end)

    def of(self, name: str) -> Value:
        """One of the outputs."""
        return self._all[name]
