"""Laws of sign and balance: contact only presses, friction only brakes, work makes heat, forces and heats add up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Pair
from random_scenes.data_bounds import signal_at
from random_scenes.invariant import Finding, Invariant
from random_scenes.invariants_contact import body_of, size_of
from random_scenes.invariants_rest import stiffest
from random_scenes.invariants_thermal import gradients
from random_scenes.scene import Scene
from random_scenes.story import Story

Floats = NDArray[np.float64]

ROUND_OFF = 1e-9  # of the largest of its kind
FORCE_FLOOR = 1e-4  # of E L: forces below are as good as none (docs/theory.md, Deformation)
TIMES_TOLERANCE = 10.0
ENTROPY = 1e-3  # of what is still to be gained


def _model(story: Story, half: str) -> Mapping[str, Any]:
    assert story.scenario is not None
    return story.scenario.models[half]


def _worst(story: Story, what: str, unit: str, beyond: Floats, allowed: float,
           named_by: tuple[str, ...]) -> list[Finding]:
    """A finding of the largest of beyond : (n, m), where it is more than allowed."""
    if not beyond.size or not beyond.max() > allowed:
        return []
    k, i = np.unravel_index(int(beyond.argmax()), beyond.shape)
    return [Finding(f"{what} {i} by {beyond[k, i]:.4g} {unit} at t = {story.t[k]:.6g} s, where {allowed:.2g} {unit} "
                    "are round-off", float(beyond[k, i] / allowed) if allowed else np.inf, named_by)]


# Contact presses, friction brakes, work heats.

def _pressing(scene: Scene, story: Story, rng: np.random.Generator) -> list[Finding]:
    t_N = story.t_N.copy()
    for side in story.interface.pair_sides:
        if any(pair.tied for pair in story.interface.pairs if pair.name == side.pair):
            t_N[:, side.at] = 0.0
    return _worst(story, "contact pulls at pair node", "Pa", t_N, 0.0, ("pulls", "tension"))


PRESSURE = Invariant("contact presses", lambda scene: bool(scene.pairs), _pressing, runs=0)
"""t_N <= 0, without any tolerance (Eq. 18; docs/design.md states it of the exchange).  What is tied may pull."""


def friction_excess(story: Story, pair: Pair) -> Floats:
    """(n, n_slave) [Pa] by how much |t_T| of a slave node exceeds Coulomb's bound; 0 where that can not be told.

    Told is t_T = before + mean(tau - before) over what the node touches, `before` linear between nodes: so it may
    exceed the mean of tau by what `before` differs to its neighbours.  Nodes are looked at that touch with all they
    face: they and both neighbours press, and are deeper than the edges on both sides bend between them.
    """
    interface, surface = story.interface, story.interface.surfaces[pair.slave]
    nodes = np.unique(surface)
    s = dict(zip(nodes.tolist(), range(*interface.side_of(pair.name, pair.slave).at.indices(story.t_N.shape[1])),
                 strict=True))
    t_T = np.array(story.extra["mechanical.contact.t_T"])
    gap, covered = (np.array([getattr(level, name) for level in story.levels]) for name in ("gap", "covered"))
    beyond = np.zeros((len(story.t), len(nodes)))
    for j, node in enumerate(nodes):
        around = [s[int(n)] for n in np.unique(surface[(surface == node).any(axis=1)])]
        own = s[int(node)]
        sure = ((story.t_N[:, around] < 0.0) & (gap[:, around] <= 0.0) & (covered[:, around] > 0.999)).all(axis=1)
        sure &= -gap[:, around].max(axis=1) > bends(story, pair, int(node))
        before = np.vstack([t_T[:1], t_T[:-1]])
        uneven = np.abs(before[:, around] - before[:, [own]]).max(axis=1)
        excess = np.abs(t_T[:, own]) - pair.mu * np.abs(story.t_N[:, own]) - uneven
        beyond[1:, j] = np.where(sure, np.maximum(excess, 0.0), 0.0)[1:]
    return beyond


def bends(story: Story, pair: Pair, node: int) -> Floats:
    """(n,) [m] how far the gap between a slave node and its neighbours may be from a straight line, at each level.

    A chain of edges over h whose directions differ by at most an angle from one another is h/2 times that from its
    chord at most.
    """
    own, other = (story.interface.surfaces[name] for name in (pair.slave, pair.master))
    edges = own[(own == node).any(axis=1)]
    found = np.zeros(len(story.t))
    for k, x in enumerate(story.x):
        t = x[edges[:, 1]] - x[edges[:, 0]]
        a, b = x[other[:, 0]], x[other[:, 1]]
        h = float(np.linalg.norm(t, axis=1).max())
        middle = x[edges].mean(axis=1)
        reach = np.linalg.norm(0.5 * (a + b)[:, None] - middle, axis=2).min(axis=1) < h + np.linalg.norm(b - a, axis=1)
        all_t = np.vstack([t, (a - b)[reach]])
        all_t = all_t / np.linalg.norm(all_t, axis=1)[:, None]
        found[k] = 0.5 * h * np.abs(all_t[:, 0] * all_t[0, 1] - all_t[:, 1] * all_t[0, 0]).max()
    return found


def _coulomb(scene: Scene, story: Story, rng: np.random.Generator) -> list[Finding]:
    findings = []
    whole = scene.doc["coupling"].get("substeps", {}).get("mechanical", 1) == 1
    cut = any(float(c) > 0.0 for c in story.extra.get("mechanical.cuts", ()))
    for pair in story.interface.pairs:
        if "mechanical.contact.t_T" in story.extra and whole and not cut and not pair.two_pass and not pair.by_node:
            allowed = ROUND_OFF * max(pair.mu * float(-story.t_N.min()), 1.0)
            findings += _worst(story, f"pair {pair.name}: shear exceeds mu p at slave node", "Pa",
                               friction_excess(story, pair), allowed, ("coulomb", "shear"))
    return findings


COULOMB = Invariant("Coulomb's bound", lambda scene: any(p.get("friction") for p in scene.pairs.values()), _coulomb,
                    runs=0)
"""|t_T| <= mu |t_N| at nodes that touch with all they face, to round-off and to what the memory of shear at nodes may
differ from its mean (friction_excess derives it).
"""


def _dissipation(scene: Scene, story: Story, rng: np.random.Generator) -> list[Finding]:
    findings = []
    model = _model(story, "mechanical")
    reversible = model.get("thermoelastic_heat") or model.get("adiabatic")
    for name, what in (("mechanical.contact.E_friction", "friction takes heat at contact node"),
                       ("mechanical.E_M", "flow takes heat in cell")):
        if name in story.extra and not (reversible and name.endswith("E_M")):
            made = np.array(story.extra[name])
            findings += _worst(story, what, "J", -made, ROUND_OFF * float(np.abs(made).max()),
                               ("negative", "takes heat", "dissipation"))
    return findings


DISSIPATION = Invariant("work makes heat", lambda scene: True, _dissipation, runs=0)
"""Friction, plastic flow and creep give off heat and never take it (second law): E_friction and E_M >= 0 to round-off.
Squeezing (thermoelastic heat) does both, and is left out.
"""


# Balance of forces.

def volumes(story: Story) -> dict[str, float]:
    """Body -> reference volume [m3]."""
    interface = story.interface
    found = dict.fromkeys(interface.bodies, 0.0)
    for cells, own in ((interface.quads, interface.quad_body), (interface.triangles, interface.triangle_body)):
        if len(cells):
            dV = gradients(interface.nodes, cells, interface.axisymmetric)[1].sum(axis=1)
            for number, body in enumerate(interface.bodies):
                found[body] += float(dV[own == number].sum())
    return found


def _edge_forces(story: Story, edges: NDArray[Any], x: Floats) -> tuple[float, Floats]:
    """Area [m2] of edges and the integral (2,) [m2] of their outward normal, with nodes at x : (n, 2) [m]."""
    t = x[edges[:, 1]] - x[edges[:, 0]]
    ring = np.pi * (x[edges[:, 0], 0] + x[edges[:, 1], 0]) if story.interface.axisymmetric else np.ones(len(edges))
    return float((np.linalg.norm(t, axis=1) * ring).sum()), np.array([(t[:, 1] * ring).sum(), -(t[:, 0] * ring).sum()])


def loads_on(story: Story, k: int, side: int) -> dict[str, Floats]:
    """Body -> sum (2,) [N] of its loads at level k; side : -1 before a jump of a load there, 1 behind it."""
    interface, model, V = story.interface, _model(story, "mechanical"), volumes(story)
    t = float(story.t[k])
    found = {b: np.zeros(2) for b in interface.bodies}
    for entry in model["boundary"]:
        place = str(entry.get("on", entry.get("at", entry.get("body"))))
        body = body_of(place)
        for c, axis in enumerate("xy"):
            for kind, share in (("t", None), ("f", 1.0), ("b", V[body])):
                if entry.get(f"{kind}_{axis}") is not None:
                    size = share
                    if size is None:
                        size = _edge_forces(story, interface.surfaces[place], interface.nodes)[0]
                    found[body][c] += signal_at(entry[f"{kind}_{axis}"], t, side) * size
        if entry.get("pressure") is not None:
            normal = _edge_forces(story, interface.surfaces[place], story.x[k])[1]
            found[body] -= signal_at(entry["pressure"], t, side) * normal
    if model.get("gravity"):
        for body in interface.bodies:
            rho = model["materials"][model["bodies"][body]["material"]]["rho"]
            found[body] += [rho * V[body] * signal_at(model["gravity"].get(axis, 0.0), t, side) for axis in "xy"]
    return found


def joined(story: Story, k: int) -> list[list[str]]:
    """Bodies that press on each other at level k, or are tied, in groups."""
    interface = story.interface
    group = {b: b for b in interface.bodies}
    for pair in interface.pairs:
        sides = [side.at for side in interface.pair_sides if side.pair == pair.name]
        if pair.tied or any((story.levels[k].t_N[at] < 0.0).any() for at in sides):
            old, new = group[body_of(pair.master)], group[body_of(pair.slave)]
            group = {b: new if g == old else g for b, g in group.items()}
    return [[b for b in group if group[b] == g] for g in dict.fromkeys(group.values())]


def unbalanced(story: Story) -> list[Finding]:
    """Groups of bodies whose supports do not carry what loads them."""
    interface, model = story.interface, _model(story, "mechanical")
    worst = (1.0, "")
    floor = FORCE_FLOOR * stiffest(story) * size_of(story)
    axes = [1] if interface.axisymmetric else [0, 1]
    ring = 2.0 * np.pi * float(interface.nodes[:, 0].max()) if interface.axisymmetric else 1.0
    tolerance = TIMES_TOLERANCE * model["tolerance"] * np.sqrt(len(interface.nodes))
    for k in range(len(story.t)):
        loads = [loads_on(story, k, side) for side in (-1, 1)]
        inner = float(np.abs(story.extra["mechanical.sigma"][k]).max()) * size_of(story) * ring
        for bodies in joined(story, k):
            held = sum((story.extra[f"mechanical.reaction.{b}"][k] for b in bodies), np.zeros(2))
            off = min(float(np.abs((held + sum(side[b] for b in bodies))[axes]).max()) for side in loads)
            outer = sum(float(np.abs(side[b]).max()) for side in loads for b in bodies)
            allowed = tolerance * max(inner, outer, floor * ring)
            if off / allowed > worst[0]:
                worst = (off / allowed, f"supports and loads of {', '.join(bodies)} are {off:.4g} N out of balance at "
                         f"t = {story.t[k]:.6g} s, where {allowed:.2g} N are the solver's tolerance")
    return [Finding(worst[1], worst[0], ("out of balance", "equilibrium"))] if worst[1] else []


def _static(scene: Scene) -> bool:
    elastic = scene.doc["mechanical"].get("elastic", {})
    return (scene.doc["mechanical"]["half"] == "elastic" and not {"dynamics", "skip"} & elastic.keys()
            and elastic.get("method") != "explicit" and not scene.doc.get("rules"))


FORCES = Invariant("forces add up", _static, lambda scene, story, rng: unbalanced(story), runs=0)
"""Without inertia, what holds a group of bodies that press on each other and what loads it add up to nothing: supports
(mechanical.reaction), tractions and body forces on the reference, pressure on the current surface, weight, forces.  To
ten times the tolerance of the force residual, of the largest of inner force, loads and 1e-4 E L, for the square root of
the number of nodes (the residual is a norm over them, the sum is not).  Bodies that touch nothing stand alone, so a
pair that is apart passes no force.  About an axis only the sum along it is 0.
"""


# Balance of heat, and entropy.

def capacities(story: Story) -> Floats | None:
    """(n_nodes,) [J/K] int N rho c dV0; None where a property is not a number, or something melts."""
    interface, model = story.interface, _model(story, "thermal")
    C = np.zeros(len(interface.nodes))
    for number, body in enumerate(interface.bodies):
        material = model["materials"][model["bodies"][body]["material"]]
        if isinstance(material["c"], Mapping) or "latent" in material:
            return None
        for cells, own in ((interface.quads, interface.quad_body), (interface.triangles, interface.triangle_body)):
            rows = cells[own == number]
            if len(rows):
                N, dV = at_points(interface.nodes, rows, interface.axisymmetric)
                np.add.at(C, rows, material["rho"] * material["c"] * np.einsum("eq,qa->ea", dV, N))
    return C


def at_points(x: Floats, cells: NDArray[Any], axisymmetric: bool) -> tuple[Floats, Floats]:
    """Shape functions (n_q, n_n) and volumes (n_e, n_q) at points that integrate N r exactly; x : (n, 2) [m]."""
    if cells.shape[1] == 4:
        g = 1.0 / np.sqrt(3.0)
        at, s = np.array([[-g, -g], [g, -g], [g, g], [-g, g]]), np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        one = 1.0 + s[None] * at[:, None]
        N = 0.25 * one[:, :, 0] * one[:, :, 1]
        return N, gradients(x, cells, axisymmetric)[1]
    N = np.array([[4.0, 1.0, 1.0], [1.0, 4.0, 1.0], [1.0, 1.0, 4.0]]) / 6.0
    area = gradients(x, cells, False)[1] / 3.0
    return N, area * (2.0 * np.pi * x[cells][:, :, 0] @ N.T if axisymmetric else np.ones((1, 3)))


def heat_lost(story: Story) -> list[Finding]:
    """Heat that the ledger does not account for, and stored heat that is not that of the temperatures."""
    findings = []
    model = _model(story, "thermal")
    content = 0.0
    C = capacities(story)
    if C is not None and model["half"] == "thermal" and "stored." + story.interface.bodies[0] in story.ledger:
        content = float((C * story.T[0]).sum())
        for body in story.interface.bodies:
            own = story.nodes_of(body)
            gained = float(C[own] @ (story.T[-1] - story.T[0])[own])
            stored = float(np.ravel(story.ledger[f"stored.{body}"])[-1])
            allowed = ROUND_OFF * float(C[own] @ story.T[0, own])
            if abs(gained - stored) > allowed:
                findings.append(Finding(f"{body} has gained {gained:.6g} J by its temperatures, the heat balance says "
                                        f"{stored:.6g} J", abs(gained - stored) / allowed, ("heat", "imbalance")))
    terms = sum(abs(float(np.ravel(v)[-1])) for v in story.ledger.values())
    allowed = TIMES_TOLERANCE * max(float(model["tolerance"]), 1e-12)
    if story.imbalance > allowed and terms > 1e-12 * content:
        findings.append(Finding(f"the heat balance is open by {story.imbalance:.3g} of its terms, {terms:.4g} J",
                                story.imbalance / allowed, ("imbalance", "balance")))
    return findings


HEATS = Invariant("heats add up", lambda scene: scene.doc["thermal"].get("method") != "steady",
                  lambda scene, story, rng: heat_lost(story), runs=0)
"""What crosses all surfaces, sources and work add up to what is stored, to ten times the tolerance of Newton's method
(1e-10 of the terms of each step); and where rho and c are numbers and nothing melts, what a body stores is
int rho c (T - T0) dV0 by its temperatures, to 1e-9 of its content.
"""


def entropy_fall(story: Story) -> list[Finding]:
    """Windows in which the entropy of an isolated scene of constant properties falls."""
    C = capacities(story)
    if C is None or not (story.T > 0.0).all():
        return []
    S = np.log(story.T) @ C
    mean = story.T @ C / C.sum()
    room = C.sum() * np.log(mean) - S  # to what it has once all is at one temperature
    fall = S[:-1] - S[1:]
    allowed = ENTROPY * float(room.max()) + 1e-12 * float(C.sum())
    k = int(fall.argmax())
    if not fall[k] > allowed:
        return []
    return [Finding(f"entropy falls by {fall[k]:.4g} J/K from t = {story.t[k]:.6g} to {story.t[k + 1]:.6g} s, with "
                    f"{room.max():.4g} J/K to be gained in all", float(fall[k] / allowed), ("entropy", "second law"))]


def _isolated(scene: Scene) -> bool:
    doc = scene.doc
    elastic = doc["mechanical"].get("elastic", {})
    return (not doc["thermal"].get("boundary") and not any("Q_T" in b for b in doc["bodies"].values())
            and not elastic.get("thermoelastic_heat") and not elastic.get("adiabatic") and not doc.get("rules")
            and doc["thermal"].get("half", "thermal") == "thermal" and doc["thermal"].get("method") != "steady")


ENTROPY_RISES = Invariant("entropy does not fall", _isolated, lambda scene, story, rng: entropy_fall(story), runs=0)
"""Entropy, the sum of int rho c ln T dV0, of a scene that no heat enters or leaves does not fall in any window (second
law); heat of friction and of flow only adds to it.  A midpoint step keeps it to third order in the differences of
temperature: 1e-3 of what levelling them would gain is allowed.
"""

INVARIANTS: Sequence[Invariant] = (PRESSURE, COULOMB, DISSIPATION, FORCES, HEATS, ENTROPY_RISES)
