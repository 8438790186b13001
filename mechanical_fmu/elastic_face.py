"""What the elastic half says of itself: its variables, and its outputs after a step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from contact.half.memory import LAYOUT
from contact.half.model import Outputs, Value, Variable
from contact.problem.mechanical import Solution
from mechanical_fmu.advance import NOT_GIVEN, StepResult, between
from mechanical_fmu.contact import contact_outputs, contact_variables
from mechanical_fmu.dynamics import end_residual
from mechanical_fmu.elastic_state import ElasticState
from mechanical_fmu.energy import kinetic
from mechanical_fmu.heat import flow_outputs, flow_variables, log_dilatation, moved_heat
from mechanical_fmu.named_forces import ForcesAt
from mechanical_fmu.stress_outputs import Moved, mesh_variables, stress_outputs, stress_variables
from mechanical_fmu.system import System, mesh_nodes
from mechanical_fmu.unstable import unasked, unstable_outputs, unstable_variables
from mechanical_fmu.volume import PointStep
from mechanical_fmu.warm import memory_layout


def makes_heat(system: System) -> bool:
    """Say whether E_M can be anything but 0."""
    return system.volume.makes_heat or system.spec.stated.thermoelastic_heat


def elastic_variables(system: System) -> tuple[Variable, ...]:
    """List the inputs and outputs of the half; what the scene cannot make is not among them."""
    interface, spec = system.interface, system.spec
    n, n_q, n_cells = mesh_nodes(system), interface.pair_nodes.size, system.volume.n_cells
    T_ref = np.array([m.T_ref for m in spec.materials])[spec.part_material[:len(interface.bodies)]]
    # A node outside every cell (body -1) takes the last body's; nothing depends on it.
    inputs = [Variable("T", (n,), "input", "K", T_ref[interface.node_body[:n]], description="temperature at the end",
                       on="nodes")]
    if system.melts:
        inputs.append(Variable("f_s", (n,), "input", "1", NOT_GIVEN, description="solid fraction at the end; -1: by T",
                               on="nodes"))
    for name in spec.load_names:
        inputs += [Variable(f"load.{name}", (), "input", "1", 1.0, description="factor"),
                   Variable(f"bc.{name}", (), "input", _unit(system, name), 0.0, description="added to the value")]
    outputs = [Variable("x", (n, 2), unit="m", start=interface.nodes[:n], description="current coordinates",
                        on="nodes"),
               *stress_variables(system), Variable("iterations"), Variable("residual"),
               Variable("cuts", description="pieces of the step beyond the first")]
    if system.program is not None:
        outputs.append(Variable("program.runs", description="runs of the program in the step"))
    outputs += [Variable(f"reaction.{name}", (2,), unit="N", description="force of the prescribed displacements",
                         on="none")
                for name in interface.bodies]
    outputs += [Variable(LAYOUT, kind="String", start=memory_layout(system).text(), variability="constant"),
                *system.named.variables]
    outputs += flow_variables(system)
    if makes_heat(system):
        outputs.append(Variable("E_M", (n_cells,), unit="J", description="mechanical heat made in the substep",
                                on="cells"))
    if spec.stated.adiabatic:
        outputs.append(Variable("E_S", (n_cells,), unit="J", description="heat moved by squeezing at frozen entropy",
                                on="cells"))
        inputs.append(Variable("control.mode", (), "input", start=0, kind="Integer",
                               description="0 isothermal, 1 adiabatic"))
    if spec.stated.skip is not None:
        outputs.append(Variable("skipped", description="steps skipped since the start"))
    if damps(system):
        outputs.append(Variable("work.stabilisation", unit="J", description="work of what damped bodies until contact "
                                                                            "held them, since the start"))
    if tells_energy(system):
        outputs += [Variable("energy.made", unit="J", description="energy that steps made of nothing since the start"),
                    Variable("energy.kinetic", unit="J", description="kinetic energy of all bodies")]
    if system.rigid is not None:
        outputs += [Variable(f"motion.{interface.bodies[b]}", (3,), unit="1",
                             description="u_x, u_y [m] and angle [rad] of the reference point", on="none")
                    for b in system.rigid.body]
    # Who reads what lies near reads what is costly by the way, so that is the last.
    return (*inputs, *outputs, *(contact_variables(n_q, system.contact.slips, with_status=True,
                                                   tied=system.contact.tied is not None,
                                                   by_end=not spec.stated.inert) if n_q else ()),
            *mesh_variables(system), *unstable_variables(system))


def tells_energy(system: System) -> bool:
    """Say whether steps keep account of the energy of motion."""
    return system.spec.dynamics is not None and system.spec.stated.method is not Solution.EXPLICIT


def damps(system: System) -> bool:
    """Say whether a body may have to be damped until contact holds it."""
    let_go = any(d.until is not None for d in system.spec.displacements)
    return (system.can_be_loose or let_go) and bool(system.interface.pairs) and not system.spec.stated.inert


def outputs_of(system: System, found: StepResult, moved: Moved, state: ElasticState) -> Outputs:
    """Compute all outputs at the end of a step that was solved."""
    balance, n = found.balance, mesh_nodes(system)
    outputs: dict[str, Value] = {
        "x": system.interface.nodes[:n] + balance.u[:n],
        "iterations": float(found.iterations), "residual": found.residual, "cuts": float(found.cuts)}
    if system.program is not None:
        outputs["program.runs"] = float(found.runs)
    # An explicit step has no acceleration of what is held: their own masses, lumped at the nodes, are left out.
    residual = balance.r if found.dt_stable else end_residual(system, balance, found.motion)
    held = residual * (1.0 - system.constraints.free.reshape(-1, 2))
    for i, name in enumerate(system.interface.bodies):
        outputs[f"reaction.{name}"] = held[system.interface.node_body == i].sum(axis=0)
    if system.rigid is not None:
        for k, body in enumerate(system.rigid.body):
            point, turn = system.rigid.point_rows[k], system.rigid.turn_rows[k]
            name = system.interface.bodies[body]
            outputs[f"motion.{name}"] = np.array([*balance.u[point], balance.u[turn, 0] / system.rigid.size[k]])
            outputs[f"reaction.{name}"] = held[point]
    at = ForcesAt(residual, system.interface.nodes + balance.u, state.drive.pressure, state.drive.dead)
    outputs |= system.named.outputs(at)
    if system.spec.stated.skip is not None:
        outputs["skipped"] = float(state.all_skipped)
    if damps(system):
        outputs["work.stabilisation"] = state.damped
    if tells_energy(system):
        # fault: energy that contact owes is not told -> owed = 0.0 | mechanical_fmu/test_groups
        owed = found.motion.owed
        outputs |= {"energy.made": state.made + owed, "energy.kinetic": kinetic(system, found.motion)}
    outputs |= flow_outputs(system, PointStep(moved.loading.step.dt, moved.history), found.balance.history)
    outputs |= _heats(system, found, moved, state)
    if balance.tractions is not None:
        outputs |= contact_outputs(balance.tractions, state.slid if system.contact.slips else None,
                                   system.contact.tied)
    if found.rubbed.size:
        outputs["contact.E_friction"] = found.rubbed
    if system.contact.slips and system.spec.stated.inert:
        outputs["contact.slip_speed"] = found.motion.rubbing.along
    stress = stress_outputs(system, found, moved)
    # Of what a run asks for a dozen times a state in bytes keeps nothing: it would cost a factorisation each.
    seldom = unstable_outputs(system, found, moved)
    return replace(stress, now=outputs | dict(stress.now), apart={**stress.apart, **seldom},
                   unless_asked=unasked(system, seldom))


def _heats(system: System, found: StepResult, moved: Moved, state: ElasticState) -> dict[str, Value]:
    """E_M and E_S [J] of the step, where the scene has them."""
    out: dict[str, Value] = {}
    n = system.volume.n_cells
    made = found.heat if found.heat.size else np.zeros(n)
    squeezed = moved.frozen or system.spec.stated.thermoelastic_heat
    end = state.drive
    heat = np.zeros(n)
    if squeezed:
        T, f_s = 0.5 * (moved.drive.T + end.T), between(moved.drive, end, 0.5).f_s
        before = log_dilatation(system, moved.u, moved.history)
        after = log_dilatation(system, found.balance.u, found.balance.history)
        heat = moved_heat(system, T, f_s, before, after)
    if makes_heat(system):
        # What is moved at frozen entropy goes out as E_S: counted once.
        out["E_M"] = made if moved.frozen else made + heat
    if system.spec.stated.adiabatic:
        out["E_S"] = moved_heat(system, end.T, end.f_s, before, after) if moved.frozen else np.zeros(n)
    return out


def _unit(system: System, name: str) -> str:
    """Unit of the condition(s) of a name: what bc.<name> is given in."""
    spec = system.spec
    for d in spec.displacements:
        if d.turn is not None and d.turn.name == name:
            return "rad"
        if d.name == name:
            return "rad" if d.component == 2 else "m"
    if any(p.name == name for p in spec.pressures):
        return "Pa"
    load = next(d for d in spec.dead if d.name == name)
    if load.component == 2:
        return "N.m"
    return {"traction": "Pa", "force": "N", "gravity": "m/s2", "body_force": "N/m3"}[load.kind]
