"""What the elastic half says of itself: its variables, and its outputs after a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.model import Value, Variable
from mechanical_fmu.advance import Found
from mechanical_fmu.contact_forces import contact_outputs, contact_variables
from mechanical_fmu.drive import NOT_GIVEN, Drive, between
from mechanical_fmu.elastic_state import ElasticState
from mechanical_fmu.flow_strain import flow_outputs, flow_variables
from mechanical_fmu.heat import moved_heat
from mechanical_fmu.system import Loading, System
from mechanical_fmu.volume import Step, von_mises

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Moved:
    """What a step began with.  loading : at its end.  u : (n, 2) [m], history : of points, drive : at its start.

    frozen : whether its entropy was held.
    """

    loading: Loading
    u: Floats
    history: Floats
    drive: Drive
    frozen: bool


def makes_heat(system: System) -> bool:
    """Whether E_M can be anything but 0."""
    return system.volume.makes_heat or system.spec.thermoelastic_heat


def elastic_variables(system: System) -> tuple[Variable, ...]:
    """Inputs and outputs of the half; what the scene cannot make is not among them."""
    interface, spec = system.interface, system.spec
    n, n_s, n_cells = mesh_nodes(system), interface.contact_nodes.size, system.volume.n_cells
    T_ref = np.array([m.T_ref for m in spec.materials])[spec.body_material]
    # A node outside every cell (body -1) takes the last body's; nothing depends on it.
    inputs = [Variable("T", (n,), "input", "K", T_ref[interface.node_body[:n]], description="temperature at the end")]
    if system.melts:
        inputs.append(Variable("f_s", (n,), "input", "1", NOT_GIVEN, description="solid fraction at the end; -1: by T"))
    for name in spec.load_names:
        inputs += [Variable(f"load.{name}", (), "input", "1", 1.0, description="factor"),
                   Variable(f"bc.{name}", (), "input", _unit(system, name), 0.0, description="added to the value")]
    outputs = [Variable("x", (n, 2), unit="m", start=interface.nodes[:n], description="current coordinates"),
               Variable("sigma_v", (n_cells,), unit="Pa", description="von Mises stress, cell mean"),
               Variable("sigma", (n_cells, 4), unit="Pa", description="stress 11, 22, 12, 33, cell mean"),
               Variable("iterations"), Variable("residual"), Variable("max_strain_increment"),
               Variable("cuts", description="pieces of the step beyond the first")]
    outputs += [Variable(f"reaction.{name}", (2,), unit="N", description="force of the prescribed displacements")
                for name in interface.bodies]
    outputs += flow_variables(system)
    if makes_heat(system):
        outputs.append(Variable("E_M", (n_cells,), unit="J", description="mechanical heat made in the substep"))
    if spec.adiabatic:
        outputs.append(Variable("E_S", (n_cells,), unit="J", description="heat moved by squeezing at frozen entropy"))
        inputs.append(Variable("control.mode", (), "input", start=0, kind="Integer",
                               description="0 isothermal, 1 adiabatic"))
    if spec.skip is not None:
        outputs.append(Variable("skipped", description="steps skipped since the start"))
    if system.rigid is not None:
        outputs += [Variable(f"motion.{interface.bodies[b]}", (3,), unit="1",
                             description="u_x, u_y [m] and angle [rad] of the reference point") for b in
                    system.rigid.body]
    return (*inputs, *outputs, *(contact_variables(n_s, system.contact.slips) if n_s else ()))


def mesh_nodes(system: System) -> int:
    """Nodes of the mesh, reference rows of rigid bodies apart."""
    return len(system.interface.nodes) if system.rigid is None else system.rigid.first


def outputs_of(system: System, found: Found, moved: Moved, state: ElasticState) -> dict[str, Value]:
    """All outputs at the end of a step that was solved."""
    balance, n = found.balance, mesh_nodes(system)
    sigma, sigma_v, increment = _stresses(system, found, moved)
    outputs: dict[str, Value] = {
        "x": system.interface.nodes[:n] + balance.u[:n], "sigma": sigma, "sigma_v": sigma_v,
        "iterations": float(found.iterations), "residual": found.residual,
        "max_strain_increment": increment, "cuts": float(found.cuts)}
    held = balance.r * (1.0 - system.constraints.free.reshape(-1, 2))
    for i, name in enumerate(system.interface.bodies):
        outputs[f"reaction.{name}"] = held[system.interface.node_body == i].sum(axis=0)
    if system.rigid is not None:
        for k, body in enumerate(system.rigid.body):
            point, turn = system.rigid.point_rows[k], system.rigid.turn_rows[k]
            name = system.interface.bodies[body]
            outputs[f"motion.{name}"] = np.array([*balance.u[point], balance.u[turn, 0] / system.rigid.size[k]])
            outputs[f"reaction.{name}"] = held[point]
    if system.spec.skip is not None:
        outputs["skipped"] = float(state.all_skipped)
    outputs |= flow_outputs(system, Step(moved.loading.step.dt, moved.history), found.balance.history)
    outputs |= _heats(system, found, moved, state)
    if balance.tractions is not None:
        outputs |= contact_outputs(balance.tractions, system.contact.slips)
    return outputs


def _stresses(system: System, found: Found, moved: Moved) -> tuple[Floats, Floats, float]:
    """(n_cells, 4) stress 11, 22, 12, 33 and (n_cells,) von Mises stress [Pa], means of the points of each cell.

    And the largest change of a Green-Lagrange component over the step, each end by the history and moduli of its own.
    """
    volume, moduli = system.volume, moved.loading.moduli
    # At its end a history knows all stresses but a liquid's, which is of the rate and needs the last piece itself.
    # fault: a liquid's stress lost after its step -> now = volume.stress(found.balance.u, moduli, Step(0.0,
    #   found.balance.history)) | mechanical_fmu/test_solution_melting
    now = volume.stress(found.balance.u, moduli, found.last if system.melts else Step(0.0, found.balance.history))
    sigma, sigma_v = np.zeros((volume.n_cells, 4)), np.zeros(volume.n_cells)
    for cells, (stress, _) in zip(volume.kinds, now, strict=True):
        # fault: shear for thickness in the stress that goes out -> sigma[cells.number], sigma_v[cells.number] =
        #   stress[:, :, [0, 1, 3, 2]].mean(axis=1), von_mises(stress).mean(axis=1) | mechanical_fmu/test_solution_fmu
        sigma[cells.number], sigma_v[cells.number] = stress.mean(axis=1), von_mises(stress).mean(axis=1)
    then = moduli if volume.elastic else system.moduli(moved.drive.T, moved.drive.f_s)
    # fault: strain before a step by the history after it -> before = volume.stress(moved.u, then, Step(0.0,
    #   found.balance.history)) | mechanical_fmu/test_solution_melting
    before = volume.stress(moved.u, then, Step(0.0, moved.history))
    increment = max([float(np.abs(a[1] - b[1]).max()) for a, b in zip(now, before, strict=True)], default=0.0)
    return sigma, sigma_v, increment


def _heats(system: System, found: Found, moved: Moved, state: ElasticState) -> dict[str, Value]:
    """E_M and E_S [J] of the step, where the scene has them."""
    out: dict[str, Value] = {}
    n = system.volume.n_cells
    made = found.heat if found.heat.size else np.zeros(n)
    squeezed = moved.frozen or system.spec.thermoelastic_heat
    end = state.drive
    heat = np.zeros(n)
    if squeezed:
        middle = 0.5 * (moved.drive.T + end.T), between(moved.drive, end, 0.5).f_s
        heat = moved_heat(system, middle, moved.u, found.balance.u)
    if makes_heat(system):
        # What is moved at frozen entropy goes out as E_S: counted once.
        out["E_M"] = made if moved.frozen else made + heat
    if system.spec.adiabatic:
        out["E_S"] = moved_heat(system, (end.T, end.f_s), moved.u, found.balance.u) if moved.frozen else np.zeros(n)
    return out


def _unit(system: System, name: str) -> str:
    """Unit of the condition(s) of a name: what bc.<name> is given in."""
    spec = system.spec
    for d in spec.displacements:
        if d.name == name:
            return "rad" if d.component == 2 else "m"
    if any(p.name == name for p in spec.pressures):
        return "Pa"
    load = next(d for d in spec.dead if d.name == name)
    if load.component == 2:
        return "N.m"
    return {"traction": "Pa", "force": "N", "gravity": "m/s2", "body_force": "N/m3"}[load.kind]
