"""The thermal half as a HalfModel: its variables, first state, and pure step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.contact_client import ContactRefusedError, ContactSurfaces
from contact.half.interface import Interface
from contact.half.linalg import SingularMatrixError
from contact.half.model import Discard, Done, Link, Outputs, Value, Values, Variable
from contact.half.program import ProgramError
from contact.half.volume import volume_mesh
from contact.messages import Facing
from thermal_fmu import phase_change
from thermal_fmu.boundary import Heat, missed_along, names_of, no_heat
from thermal_fmu.cells import (
    BadPropertyError,
    CellGeometry,
    InvertedMeshError,
    ReferenceCells,
    capacities,
    shapes_of,
)
from thermal_fmu.conditions import NOTHING_COUNTED, HeatSoFar, n_heats, named_heats, no_heat_yet
from thermal_fmu.contact_quadrature import ContactPoints, contact_points, touching
from thermal_fmu.earlier import Earlier
from thermal_fmu.elsewhere import begun_with, course_of, course_outputs, course_variables, damps_of
from thermal_fmu.extremes import HalvedScene, StepEnded, extreme_variables, halved_variables
from thermal_fmu.flux import heat_flux
from thermal_fmu.fronts import FRONT_OFF, front_off, front_variables
from thermal_fmu.known import KnownRange, range_of, widened
from thermal_fmu.linear import AnchorMatrix, Factors
from thermal_fmu.mesh_error import (
    NOTHING_MISSED,
    MeshError,
    MissedHeat,
    SubstepHeat,
    mesh_variables,
    nothing_missed,
    solved_bodies,
)
from thermal_fmu.methods import DAMPED_SUBSTEPS, METHOD_NUMBERS, TimeMethod
from thermal_fmu.newton import NotConvergedError
from thermal_fmu.problem import Model, parse_foreign, parse_model
from thermal_fmu.program import ThermalProgram, refuse_beyond
from thermal_fmu.program_stage import AGREED
from thermal_fmu.scene import ThermalScene, freeze, with_friction
from thermal_fmu.sources import LoadFactors, calendar_of, factors_of
from thermal_fmu.steady_heat import SteadyFlow, between, flow_of
from thermal_fmu.step import StepContext, ThermalStep, entropy_jump
from thermal_fmu.substeps import NO_STEPS_YET, LeastStepError, StepController, SubstepStart, advance
from thermal_fmu.volume import Coordinates, ThermalVolume, volume_materials

Floats = NDArray[np.float64]

JOIN = "contact.join"

# Variables of every thermal half of this package, in one order

def face_variables(interface: Interface, model: Model) -> tuple[Variable, ...]:
    """List the variables of a thermal half, but for those that only one kind of half has."""
    n, n_q = len(interface.nodes), len(interface.pair_nodes)
    n_cells = len(interface.quads) + len(interface.triangles)
    surface = (Variable("contact.t_N", (n_q,), "input", "Pa", 0.0,
                        description="normal traction at pair nodes, <= 0", on="pair_nodes"),
               Variable("contact.E_friction", (n_q,), "input", "J", 0.0,
                        description="friction heat of the substep at pair nodes", on="pair_nodes"),
               Variable(JOIN, (), "input", "m", 0.0,
                        description="gap within which what is apart conducts in part as in touch")) if n_q else ()
    return (
        Variable("x", (n, 2), "input", "m", interface.nodes, description="coordinates, held in a substep", on="nodes"),
        *surface,
        *course_variables(interface, model),
        Variable("E_M", (n_cells,), "input", "J", 0.0, description="mechanical heat of the substep", on="cells"),
        Variable("E_S", (n_cells,), "input", "J", 0.0, description="entropy part, given at the substep's start",
                 on="cells"),
        *(Variable(f"load.{name}", (), "input", "1", 1.0) for name in model.load_names),
        Variable("T", (n,), unit="K", description="nodal temperature at the end of the substep", on="nodes"),
        *(Variable(name, unit="J", description="energy of the substep into the bodies") for name in names_of(model)),
        *(one.variable for one in named_heats(interface, model)),
        Variable("iterations", description="linear solves of the substep"),
        Variable("residual", description="heat missing, as a share of the heat that flowed"),
        Variable("max_dT", unit="K",
                 description="largest change of a nodal temperature that is not prescribed, in the substep"),
        Variable("heat_stored", unit="J", description="enthalpy gained since the start"),
        Variable("heat_moved", unit="J", description="what nodes took up or gave off in the substep, added up"),
        Variable("contact.touching", description="contact quadrature points under pressure"),
    )


def whole(inputs: Values, name: str) -> int:
    """Return an Integer input; 0 where the caller has none."""
    value = inputs.get(name, 0)
    assert isinstance(value, int | np.integer), f"{name} is an Integer"
    return int(value)


def contact_at(surfaces: ContactSurfaces, x: Floats, inputs: Values, link: Link) -> ContactPoints | None:
    """Find the contact quadrature points at coordinates x : (n_nodes, 2) [m]; None in a scene without pairs.

    Raises ContactRefusedError.
    """
    facing = facing_at(surfaces, x, link)
    return None if facing is None else contact_points(surfaces, facing, at_pairs("contact.t_N", inputs), x,
                                                      join_of(inputs))


def join_of(inputs: Values) -> float:
    """Return the gap [m] within which laws that jump at touch are joined."""
    return max(float(np.asarray(inputs.get(JOIN, 0.0))), 0.0)


def facing_at(surfaces: ContactSurfaces, x: Floats, link: Link) -> Facing | None:
    """Find what faces what at coordinates x : (n_nodes, 2) [m]; None in a scene without pairs.

    Raises ContactRefusedError.
    """
    return surfaces.facing(link, x) if surfaces.interface.pairs else None


def at_pairs(name: str, inputs: Values) -> Floats:
    """Return an input at pair nodes (n_q,); (0,) in a scene without pairs."""
    return np.asarray(inputs.get(name, np.empty(0)), dtype=np.float64)


# Outputs that are fields


def field_variables(scene: ThermalScene) -> tuple[Variable, ...]:
    """List the blocks that field_outputs fills."""
    n_s = len(scene.interface.contact_nodes)
    melts = (Variable("f_s", (scene.volume.n,), description="solid fraction at the end of the substep", on="nodes"),)
    surface = (Variable("surface.T", (n_s,), unit="K", description="temperature of surface nodes at the end",
                        on="contact_nodes"),
               Variable("surface.E", (n_s,), unit="J", description="heat surface nodes gave off in the substep",
                        on="contact_nodes"))
    return (*(melts if scene.melting else ()),
            Variable("q", (scene.volume.n_cells, 2), unit="W/m2", description="heat flux at the end, cell mean",
                     on="cells"),
            *(surface if n_s else ()))


def field_outputs(scene: ThermalScene, shapes: Sequence[CellGeometry], s: Floats,
                  released: Floats | None) -> Outputs:
    """Evaluate the outputs that are fields at s : (n,) [K]: heat flux, solid fraction, heat that surfaces gave off.

    released : (n,) [J] that left each node through the surface; None: nothing yet.  It comes from the residual of the
    terms
    inside the body (consistent recovery), so it holds whatever made it flow.  The flux is worked out when asked for.
    """
    at = phase_change.fields(scene.melting, s)
    nodes = scene.interface.contact_nodes
    out: dict[str, Value] = {}
    if at.f_s is not None:
        out["f_s"] = at.f_s
    if len(nodes):
        out |= {"surface.T": at.T[nodes], "surface.E": np.zeros(len(nodes)) if released is None else released[nodes]}
    return Outputs(out, ("q",), lambda: {"q": heat_flux(scene, shapes, at)})


# The half

ROUNDING = 4.0 * np.finfo(float).eps  # of the heat a body holds: start and end of a step, and what went between
ENERGIES = ("E_M", "contact.E_friction")  # inputs whose power goes with the length of a step
RETRY_SHARE = 0.5  # of a step that did not converge: the step a discard suggests


@dataclass(frozen=True)
class ThermalState:
    """All that evolves.

    s : (n,) [K], T itself in bodies that do not melt (phase_change).  X : (n, 2) reference coordinates [m], the first
    x: they set the mass.  event : the last count of control.event.  damped : how many substeps are still to be
    damped.  stored : enthalpy gained since the start [J].  anchor : the matrix whose factors the next solve starts
    from, anchor_S : likewise of the entropy part.  controller : of adaptive inner steps.
    given : heat since the start, by condition.  known : the data of bodies so far; None: as they are.
    rate : (n,) at which s moved in the last (inner) step [K/s]; None: in none yet.  missed : by the mesh, so far.
    flow : what flowed at the end of the last step, where that was to a steady state.  began [s]: the start.
    earlier : s at the start and where data bent.
    """

    s: Floats
    X: Floats
    event: int
    damped: int
    stored: float
    anchor: AnchorMatrix | None = None
    anchor_S: AnchorMatrix | None = None
    controller: StepController = NO_STEPS_YET
    given: HeatSoFar = NOTHING_COUNTED
    known: KnownRange | None = None
    rate: Floats | None = None
    missed: MissedHeat = NOTHING_MISSED
    flow: SteadyFlow | None = None
    began: float = 0.0
    earlier: Earlier = field(default_factory=Earlier)


@dataclass(frozen=True)
class UnsolvedStep:
    """A step to a steady state that was not solved: from s : (n,) [K] at t [s], with these inputs."""

    s: Floats
    t: float
    inputs: Mapping[str, NDArray[Any]]

    @classmethod
    def of(cls, state: ThermalState, inputs: Values, t: float) -> UnsolvedStep:
        """Copy what a step was tried with; the count of events says nothing to a steady state."""
        return cls(np.array(state.s), t, {name: np.array(value) for name, value in inputs.items()
                                          if name != "control.event"})

    def is_again(self, last: UnsolvedStep | None) -> bool:
        """Return whether it is the last one but for its length.  Energies [J] of mechanics are powers over it."""
        if last is None or self.t != last.t or self.inputs.keys() != last.inputs.keys():
            return False
        # fault: bodies that move are taken for resting -> same = True | thermal_fmu/test_thermal_steady
        same = all(np.array_equal(value, last.inputs[name]) for name, value in self.inputs.items())
        return same and np.array_equal(self.s, last.s) and not any(
            self.inputs[name].any() for name in ENERGIES if name in self.inputs)


class ThermalHalf:
    """Heat conduction in the bodies of an interface file, with the boundary data of a model.json.

    The object caches what follows from constant inputs, and factors of exactly the matrix asked for.
    """

    def __init__(self, interface: Interface, spec: Mapping[str, Any], given: ThermalVolume | None = None,
                 program: ThermalProgram | None = None) -> None:
        """Raises ValueError for a model.json that is not right, naming key and value.

        given : what conducts and stores inside bodies; None: the cells of this half.  program : one that does so and
        answers at nodes alone.
        """
        foreign = given is not None or program is not None
        model = parse_foreign(interface, spec) if foreign else parse_model(interface, spec)
        self._scene = ThermalScene(interface, model, given, program)
        if program is not None:
            refuse_beyond(model)
            program.start(volume_mesh(interface), volume_materials(model))
        self._scene.bulk  # noqa: B018  what it cannot solve is told before anything runs
        self._calendar = calendar_of(self._scene.model)
        # The error of inner steps is measured with the factors at hand, which are to know today's surfaces.
        adaptive = self._scene.model.stated.adaptive is not None
        self._factors = Factors() if adaptive else Factors(interface.contact_nodes)
        self._factors_S = Factors()
        self._masses: tuple[Floats, tuple[ReferenceCells, ...]] | None = None
        self._rounding = 0.0
        self._s_0 = np.zeros(0)
        self._unsolved: UnsolvedStep | None = None
        self.variables = _variables(self._scene)
        self._named = named_heats(interface, self._scene.model)
        self._mesh_error = None if foreign else MeshError(self._scene)
        self._halved = None if foreign else HalvedScene(
            interface, spec, solved_bodies(self._scene), model, self._scene.melting)

    def start(self, inputs: Values, t: float, link: Link) -> tuple[ThermalState, Mapping[str, Value]]:
        """Set T = T0 everywhere; a prescribed temperature acts from the first substep.  The first x is the reference.

        Raises InvertedMeshError, ContactRefusedError.
        """
        scene = self._scene
        X = np.array(inputs["x"], dtype=np.float64)
        T = scene.start(self._masses_of(X))
        state = ThermalState(phase_change.unknown(scene.melting, T), X, whole(inputs, "control.event"), DAMPED_SUBSTEPS,
                             0.0, given=no_heat_yet(n_heats(scene.interface, scene.model)), known=range_of(scene, T),
                             missed=nothing_missed(len(scene.interface.bodies)), began=t)
        points = contact_at(scene.surfaces, X, inputs, link)
        touched = touching(points, scene.model.solved)
        outputs = self._outputs(state, no_heat(len(scene.model.bodies)), touched, None, T) | self._counts(0, 0)
        if scene.model.elsewhere.size:
            outputs |= course_outputs(scene.interface.contact_nodes, scene.melting, state.s, [(t, state.s)], t, 1.0)
        fields = field_outputs(scene, shapes_of(scene.volume, X), state.s, None)
        unknown: dict[str, Value] = {} if self._halved is None else dict(self._halved.at_start)
        if self._halved is not None and scene.melting:
            unknown[FRONT_OFF] = np.zeros(state.s.size)
        return state, replace(fields, now=outputs | dict(fields.now) | unknown)

    def step(self, state: ThermalState, inputs: Values, t: float, h: float, link: Link) -> Done | Discard:
        """Take a substep from t to t + h [s] on the coordinates x, whose contact is searched once."""
        number = whole(inputs, "control.method")
        if number != 0 and number not in METHOD_NUMBERS:
            return Discard(f"control.method {number} is none of 0, {', '.join(map(str, METHOD_NUMBERS))}")
        model = self._scene.model
        method = model.method_of(METHOD_NUMBERS.get(number, model.stated.method.value))
        try:
            return self._advance(state, inputs, t, h, link, method)
        except (NotConvergedError, BadPropertyError, SingularMatrixError) as exc:
            # fault: a steady state that is not there is looked for in shorter steps -> again = RETRY_SHARE * h |
            #   thermal_fmu/test_thermal_steady
            again = h if self._is_same_at_any_length(method, state, inputs, t) else RETRY_SHARE * h
            return Discard(f"thermal step from {t:.9g} s by {h:.6g} s: {exc}", again)
        except ProgramError as exc:
            # The program would fail again: a step as long as this one says that no shorter one helps.
            return Discard(f"thermal step from {t:.9g} s by {h:.6g} s: {exc}", h)
        except LeastStepError as exc:
            # Inner steps can only get shorter where the substep itself is shorter than the least of them.
            return Discard(f"thermal step from {t:.9g} s by {h:.6g} s: {exc}", RETRY_SHARE * exc.least)
        except (InvertedMeshError, ContactRefusedError) as exc:
            # A smaller step of this half changes nothing here: the coordinates came from outside.
            return Discard(f"thermal step from {t:.9g} s by {h:.6g} s: {exc}")

    def _is_same_at_any_length(self, method: TimeMethod, state: ThermalState, inputs: Values, t: float) -> bool:
        """Whether any other step would have the same answer: steady, with loads that stay, and nothing moved since the
        start, or since a step from here that was not solved either.
        """
        if method.stores or self._calendar.breakpoints.size > 0:
            return False
        # fault: bodies that moved before the start are taken for moving -> last, self._unsolved = None,
        #   UnsolvedStep.of(state, inputs, t) | thermal_fmu/test_thermal_steady
        last, self._unsolved = self._unsolved, UnsolvedStep.of(state, inputs, t)
        return np.array_equal(np.asarray(inputs["x"]), state.X) or self._unsolved.is_again(last)

    def _advance(self, state: ThermalState, inputs: Values, t: float, h: float, link: Link,
                 method: TimeMethod) -> Done:
        scene = self._scene
        x = np.array(inputs["x"], dtype=np.float64)
        E_M = np.asarray(inputs["E_M"], dtype=np.float64)
        facing = facing_at(scene.surfaces, x, link)
        t_N, E_friction = (at_pairs(name, inputs) for name in ("contact.t_N", "contact.E_friction"))
        points = None if facing is None else contact_points(scene.surfaces, facing, t_N, x, join_of(inputs))
        # fault: mass from the current volume -> substep = freeze(scene, scene.masses(x), x, E_M, points) |
        #   thermal_fmu/test_thermal_nonlinear
        substep = freeze(scene, self._masses_of(state.X), x, E_M, points)
        if scene.given is not None or scene.program is not None:
            substep = replace(substep, place=Coordinates(x, np.array(state.X)))
        if points is not None:
            at_start = phase_change.fields(scene.melting, np.array(state.s))
            substep = with_friction(substep, scene, points, E_friction, at_start, h)
        load = factors_of(scene.model, inputs)
        # fault: how nodes moved before is forgotten -> rate = None |
        #   thermal_fmu/test_thermal_limits::test_a_node_follows_a_contact_that_shrinks
        rate = None if state.rate is None else np.array(state.rate)
        # fault: E_M as power -> context = StepContext(scene, substep, load, self._calendar, substep.E_M, self._factors)
        #   | thermal_fmu/test_thermal_nonlinear
        context = StepContext(scene, substep, load, self._calendar, substep.E_M / h, self._factors, state.known, rate)
        context = replace(context, elsewhere=course_of(scene.model, inputs, t, h))
        event = whole(inputs, "control.event")
        E_S = np.asarray(inputs["E_S"], dtype=np.float64)
        s_n = begun_with(context.elsewhere, scene.melting, np.array(state.s), scene.model.elsewhere)
        jump = entropy_jump(context, E_S, s_n, state.anchor_S, self._factors_S, t) if E_S.any() else None
        if jump is not None and state.known is not None:
            context = replace(context, known=widened(state.known, jump.known))
        # fault: entropy part without its jump -> start = SubstepStart(s_n, state.anchor, |
        #   thermal_fmu/test_thermal_entropy
        start = SubstepStart(s_n if jump is None else jump.s, state.anchor,
                      # fault: no damped restart after an event -> state.damped, state.controller) |
                      #   thermal_fmu/test_thermal_time
                             DAMPED_SUBSTEPS if event != state.event else state.damped, state.controller)
        result = advance(context, scene.model.stated, method, start, t, h)
        done = result.done if jump is None else jump.then(result.done)
        made = jump is not None or any(np.asarray(inputs[n]).any() for n in ENERGIES if n in inputs)
        # Heat of mechanics is that of the whole step, and what it makes flow at the end no rate of it.
        # fault: heat between steady states as it flows at the end -> flow = None | thermal_fmu/test_steady_heat
        flow = None if method.stores or made else flow_of(done, h, load)
        # fault: heat of steady states by the mean across a jump -> if flow is not None and state.flow is not None: |
        #   thermal_fmu/test_steady_heat
        if flow is not None and state.flow is not None and not self._jumps(state.flow, load, t, h):
            done = between(state.flow, done, h)
        stored = state.stored + float(done.heat.stored.sum())
        # fault: heat of a condition of the last substep alone -> given = no_heat_yet(done.heat.each.size).plus(
        #   done.heat.each) | thermal_fmu/test_named_heat
        given = state.given.plus(done.heat.each)
        anchor_S = state.anchor_S if jump is None else jump.anchor
        # fault: controller not part of the state -> controller = state.controller | thermal_fmu/test_thermal_adaptive
        controller = result.controller
        # fault: data of bodies forgotten after a substep -> known = range_of(scene, phase_change.temperature(
        #   scene.melting, done.s)) | thermal_fmu/test_thermal_monotone
        known = result.done.known
        # fault: nobody remembers from where data bent -> earlier = state.earlier | thermal_fmu/test_surplus
        earlier = self._earlier(state, t, h).after(h, np.array(state.s), done.s)
        # fault: anchor not part of the state -> new = ThermalState(done.s, state.X, event, result.damped, stored, None,
        #   anchor_S, controller, given, | thermal_fmu/test_thermal_solver
        new = ThermalState(done.s, state.X, event, result.damped, stored, done.anchor, anchor_S, controller, given,
                           known, result.rate, self._missed(state, context, x, done, t, h), flow,
                           state.began, earlier)
        T_n = phase_change.temperature(scene.melting, state.s)
        outputs = self._outputs(new, done.heat, substep.touching, done, T_n)
        # fault: heat given off with the sign of heat taken up -> fields = field_outputs(scene, substep.shapes, new.s,
        #   done.moved - done.inside) | thermal_fmu/test_thermal_anisotropy::test_surfaces_tell_what_they_gave_off
        fields = field_outputs(scene, substep.shapes, new.s, done.inside - done.moved)
        if context.elsewhere is not None:
            outputs |= course_outputs(scene.interface.contact_nodes, scene.melting, start.s, result.done.path, t, h,
                                      damps_of(result.done.damped, result.done.overshoots))
        counts = self._counts(result.substeps, result.rejected)
        fields = replace(fields, now=outputs | dict(fields.now) | counts)
        if self._halved is None:
            return Done(new, fields)
        end = StepEnded(replace(context, substep=done.substep), x, state.X, self._s_0, earlier, state.s, done.s,
                        t + h, h, t + h - max(state.began, self._calendar.last_jump(t + h, h)), method.stores, E_M,
                        facing, points, t_N, E_friction)
        # Of what a run asks for now and then a state in bytes keeps nothing: it costs more than a step.
        apart = self._halved.outputs(end)
        unless_asked = dict(self._halved.unknown)
        if scene.melting:
            apart |= {FRONT_OFF: partial(front_off, end)}
            unless_asked[FRONT_OFF] = np.full(done.s.size, np.nan)
        return Done(new, replace(fields, apart=apart, unless_asked=unless_asked))

    def _earlier(self, state: ThermalState, t: float, h: float) -> Earlier:
        """What it remembers of earlier times in a step from t by h [s]: only what halved cells are asked of."""
        if self._halved is None:
            return state.earlier
        begins = not state.earlier.t.size or self._calendar.bend_within(t, h)
        return state.earlier.then(t, np.array(state.s), h) if begins else state.earlier

    def _jumps(self, before: SteadyFlow, load: LoadFactors, t: float, h: float) -> bool:
        """Whether what acts from t [s] on is other than what acted up to then."""
        return dict(load) != dict(before.loads) or self._calendar.jump_within(t, h)

    def _missed(self, state: ThermalState, context: StepContext, x: Floats, done: ThermalStep, t: float,
                h: float) -> MissedHeat:
        if self._mesh_error is None:
            return state.missed
        scene, shapes = self._scene, context.substep.shapes
        T = phase_change.temperature(scene.melting, done.s)
        along = missed_along(done.substep, context.loads_at(t + h, -1), T, scene.interface.node_body,
                             len(scene.interface.bodies))
        step = SubstepHeat(h, np.array(state.s), done.s, done.moved, done.inside, along)
        # fault: what the mesh missed before is forgotten -> return self._mesh_error.after(nothing_missed(
        #   state.missed.heat.size), shapes, x, step) |
        #   thermal_fmu/test_mesh_error::test_what_was_missed_is_part_of_the_state
        return self._mesh_error.after(state.missed, shapes, x, step)

    def _counts(self, substeps: int, rejected: int) -> dict[str, Value]:
        if self._scene.model.stated.adaptive is None:
            return {}
        return {"substeps": float(substeps), "rejected": float(rejected)}

    def _masses_of(self, X: Floats) -> tuple[ReferenceCells, ...]:
        if self._masses is None or not np.array_equal(self._masses[0], X):
            self._masses = (np.array(X), self._scene.masses(np.array(X)))
            T = self._scene.start(self._masses[1])
            s = phase_change.unknown(self._scene.melting, T)
            self._s_0 = s
            M = capacities(self._scene.volume, self._masses[1], self._scene.model.parts, s)
            self._rounding = ROUNDING * float(M @ np.abs(T))
            self._capacity = float(M.sum())
        return self._masses[1]

    def _allowed(self, T: Floats, T_n: Floats) -> float:
        """Heat [J] of temperatures so far apart as program and surface may be, in a substep from T_n to T : (n,)."""
        return AGREED * self._capacity * float(np.ptp(np.concatenate([T, T_n])))

    def _outputs(self, state: ThermalState, heat: Heat, touching: int, done: ThermalStep | None,
                 T_n: Floats) -> dict[str, Value]:
        T = phase_change.temperature(self._scene.melting, state.s)
        return {
            "T": T, **heat.outputs(self._scene.model), **state.given.outputs(self._named),
            "iterations": float(done.iterations) if done else 0.0,
            "residual": done.residual if done else 0.0,
            # A rule watches it for the error of a window, and what is prescribed has none.
            # fault: prescribed temperatures bound the window -> "max_dT": float(np.abs(T - T_n).max()), |
            #   thermal_fmu/test_thermal_adaptive::test_a_prescribed_ramp_is_no_change_that_is_watched
            "max_dT": float(np.abs(T - T_n)[~self._scene.fixed].max(initial=0.0)),
            "heat_stored": state.stored,
            "heat_moved": heat.moved,
            "heat_rounding": self._rounding,
            **({} if self._mesh_error is None else self._mesh_error.outputs(state.missed)),
            "contact.touching": float(touching),
            **({} if self._scene.program is None else {"program.runs": float(done.runs) if done else 0.0,
                                                       "program.tolerance": self._allowed(T, T_n) if done else 0.0}),
        }


def _variables(scene: ThermalScene) -> tuple[Variable, ...]:
    inner = () if scene.model.stated.adaptive is None else (
        Variable("substeps", description="inner steps of the substep"),
        Variable("rejected", description="inner steps tried that were too long"))
    rounding = Variable("heat_rounding", unit="J", description="what round-off leaves of the heat of a substep")
    runs = () if scene.program is None else (
        Variable("program.runs", description="runs of the program in the substep"),
        Variable("program.tolerance", unit="J", description="heat by which program and surface may differ in the "
                 "substep"))
    face = (*face_variables(scene.interface, scene.model), *inner, rounding, *runs)
    if scene.given is not None or scene.program is not None:
        return (*face, *field_variables(scene))
    # Who reads what lies near reads what is costly by the way, so that is the last.
    return (*face, *mesh_variables(scene), *field_variables(scene), *front_variables(scene.interface, scene.melting),
            *extreme_variables(scene.interface, solved_bodies(scene)),
            *halved_variables(scene.interface, scene.model, scene.melting))


def load(interface: Interface, spec: Mapping[str, Any]) -> ThermalHalf:
    """Make the thermal half of an interface file and the content of its model.json.  Raises ValueError."""
    return ThermalHalf(interface, spec)


def thermal_half(volume: ThermalVolume, interface: Interface, spec: Mapping[str, Any]) -> ThermalHalf:
    """Make the thermal half of an interface file and a model.json, with the inside of its bodies by `volume`.

    Raises ValueError naming every key that is wrong.
    """
    return ThermalHalf(interface, spec, volume)


def thermal_program_half(program: ThermalProgram, interface: Interface, spec: Mapping[str, Any]) -> ThermalHalf:
    """Make the thermal half of an interface file and a model.json, with the inside of its bodies by a program.

    Raises ValueError naming every key that is wrong.
    """
    return ThermalHalf(interface, spec, program=program)
