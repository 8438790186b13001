"""Laws of temperature: it stays within its data, it does not ring, and an isolated scene loses no entropy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.laws import parse_law
from random_scenes.data_bounds import Interval, field_span, property_span
from random_scenes.invariant import Finding, Invariant
from random_scenes.scene import Scene
from random_scenes.story import COMPLETED, Story, told

Floats = NDArray[np.float64]

# Of the span of the data: where the matrix is an M-matrix, and elsewhere.
EXACT, ROUGH = 1e-6, 1e-3
WINDOWS = 30  # of a scene run anew
OUTSIDE = ("outside its data", "undershoot", "overshoot", "ringing", " rings", "alternat", "up and down",
           "maximum principle", "below its data", "above its data")


# What a body exchanges heat with, and the bounds of what it may reach.

def components(story: Story) -> list[tuple[str, ...]]:
    """Bodies that heat crosses between, by pairs with conduction or radiation."""
    interface = story.interface
    pairs = _model(story)["pairs"]
    group = {b: b for b in interface.bodies}
    for pair in interface.pairs:
        if pairs.get(pair.name, {}).keys() & {"conduction", "radiation"}:
            a, b = (name.split(".")[0] for name in (pair.slave, pair.master))
            old, new = group[b], group[a]
            group = {body: new if g == old else g for body, g in group.items()}
    return [tuple(b for b in group if group[b] == g) for g in dict.fromkeys(group.values())]


def _model(story: Story) -> Mapping[str, Any]:
    assert story.scenario is not None
    return story.scenario.models["thermal"]


@dataclass(frozen=True)
class Bounds:
    """low, high : (n,) [K] the data of some bodies, up to each time of a story.  heats, cools : sources act on them."""

    bodies: tuple[str, ...]
    low: Floats
    high: Floats
    heats: bool
    cools: bool


def bounds_of(story: Story, bodies: tuple[str, ...]) -> Bounds:
    """The data of a component: where it began, what it is held at, what surrounds it."""
    model, mechanical = _model(story), story.scenario.models["mechanical"]  # type: ignore[union-attr]
    x = story.x.reshape(-1, 2)
    low = high = np.array([model["bodies"][b]["T0"] for b in bodies])
    heats = cools = False
    spans = []
    for entry in model["boundary"]:
        place = str(entry.get("on", entry.get("at")))
        if place.split(".")[0] not in bodies:
            continue
        for key in ("temperature", "convection", "radiation"):
            if key in entry:
                field = entry[key] if key == "temperature" else entry[key]["T"]
                spans.append(np.array([field_span(field, 0.0, t, x) for t in story.t]))
        if "flux" in entry:
            span = field_span(entry["flux"], 0.0, story.t[-1], x)
            heats, cools = heats or span[1] > 0.0, cools or span[0] < 0.0
    lows = [np.full(len(story.t), low.min()), *(s[:, 0] for s in spans)]
    highs = [np.full(len(story.t), high.max()), *(s[:, 1] for s in spans)]
    for b in bodies:
        span = field_span(model["bodies"][b].get("Q_T", 0.0), 0.0, story.t[-1], x)
        factor = model["bodies"][b].get("Q_T_factor")
        if factor is not None and span != (0.0, 0.0):
            span = (-np.inf, np.inf)
        heats, cools = heats or span[1] > 0.0, cools or span[0] < 0.0
    rubs = any(p.mu > 0.0 for p in story.interface.pairs) and mechanical["half"] == "elastic"
    heats = heats or rubs or "mechanical.E_M" in story.extra
    if mechanical.get("thermoelastic_heat") or mechanical.get("adiabatic"):
        heats = cools = True
    return Bounds(bodies, np.min(lows, axis=0), np.max(highs, axis=0), heats, cools)


# Whether the mesh keeps the maximum principle: off-diagonals of conduction, with films and contact, are not positive.

def gradients(x: Floats, cells: NDArray[Any], axisymmetric: bool) -> tuple[Floats, Floats]:
    """Gradients (n_e, n_q, n_n, 2) [1/m] of shape functions and volumes (n_e, n_q) of cells at x : (n, 2) [m]."""
    if cells.shape[1] == 3:
        N = np.full((1, 3), 1.0 / 3.0)
        dN = np.array([[[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]]])
        weight = 0.5
    else:
        g = 1.0 / np.sqrt(3.0)
        at = np.array([[-g, -g], [g, -g], [g, g], [-g, g]])
        s = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        one = 1.0 + s[None] * at[:, None]
        N = 0.25 * one[:, :, 0] * one[:, :, 1]
        dN = 0.25 * np.stack([s[None, :, 0] * one[:, :, 1], s[None, :, 1] * one[:, :, 0]], axis=-1)
        weight = 1.0
    X = x[cells]
    J = np.einsum("qai,eaj->eqij", dN, X)
    dV = weight * np.linalg.det(J)
    if axisymmetric:
        dV = dV * 2.0 * np.pi * np.einsum("qa,ea->eq", N, X[:, :, 0])
    return np.einsum("eqij,qaj->eqai", np.linalg.inv(J), dN), dV


def _tensors(k: Any, span: Interval) -> Iterator[Floats]:
    if not (isinstance(k, Mapping) and "k_1" in k):
        yield property_span(k, *span)[0] * np.eye(2)
        return
    c, s = np.cos(k["angle"]), np.sin(k["angle"])
    for first in property_span(k["k_1"], *span):
        for second in property_span(k["k_2"], *span):
            yield first * np.outer([c, s], [c, s]) + second * np.outer([-s, c], [-s, c])


def is_m_matrix(story: Story, body: str, span: Interval) -> bool:
    """Whether no off-diagonal of a body's conduction matrix, with what its surfaces exchange, is positive."""
    interface, model = story.interface, _model(story)
    if model["half"] != "thermal":
        return True  # bars and whole bodies: neighbours in a row
    k = model["materials"][model["bodies"][body]["material"]]["k"]
    number = interface.bodies.index(body)
    n = len(interface.nodes)
    for x in (story.levels[0].x, story.levels[-1].x):
        surface = _surface_terms(story, body, span, x)
        for K in _tensors(k, span):
            matrix = surface.copy()
            for cells, own in ((interface.quads, interface.quad_body), (interface.triangles, interface.triangle_body)):
                if not (own == number).any():
                    continue
                rows = cells[own == number]
                G, dV = gradients(x, rows, interface.axisymmetric)
                local = np.einsum("eq,eqai,ij,eqbj->eab", dV, G, K, G)
                np.add.at(matrix, (rows[:, :, None], rows[:, None, :]), local)
            off = matrix - np.diag(np.diag(matrix))
            if off.max(initial=0.0) > 1e-12 * np.abs(matrix).max(initial=0.0):
                return False
            assert matrix.shape == (n, n)
    return True


def _surface_terms(story: Story, body: str, span: Interval, x: Floats) -> Floats:
    """(n, n) [W/K], off-diagonals that films, radiation and contact can add to a body's matrix at most."""
    interface, model = story.interface, _model(story)
    matrix = np.zeros((len(interface.nodes),) * 2)
    hot = 4.0 * model["sigma_SB"] * span[1] ** 3
    found: list[tuple[str, float]] = []
    for entry in model["boundary"]:
        place = str(entry.get("on", ""))
        if place.split(".")[0] == body and "convection" in entry:
            film = entry["convection"]
            h = field_span(film["h"], 0.0, story.t[-1], x)[1] * (span[1] - span[0]) ** film.get("exponent", 0.0)
            found.append((place, 2.0 * h * property_span(film.get("h_factor", 1.0), *span)[1]))
        if place.split(".")[0] == body and "radiation" in entry:
            found.append((place, hot))
    p = np.linspace(0.0, max(float(-story.t_N.min(initial=0.0)), 1.0), 20)
    for pair in interface.pairs:
        spec = model["pairs"].get(pair.name, {})
        h = hot if "radiation" in spec else 0.0
        for branch in ("closed", "open"):
            law = spec.get("conduction", {}).get(branch)
            if law:
                at = (p, np.zeros(20)) if branch == "closed" else (np.zeros(20), np.linspace(0.0, pair.gap_max, 20))
                h += float(parse_law(law).conductance(*at, np.full(20, span[1]))[0].max())
        found += [(place, h) for place in (pair.slave, pair.master) if place.split(".")[0] == body]
    for place, h in found:
        for a, b in interface.surfaces[place]:
            length = float(np.linalg.norm(x[b] - x[a]))
            share = h * length / 6.0 * (2.0 * np.pi * max(x[a, 0], x[b, 0]) if interface.axisymmetric else 1.0)
            matrix[a, b] += share
            matrix[b, a] += share
    return matrix


# MAXIMUM: temperature within its data.

def beyond_data(story: Story, about: str) -> list[Finding]:
    """Where a story's temperature leaves its data, the worst place of each component."""
    findings = []
    cold = np.unravel_index(int(story.T.argmin()), story.T.shape)
    if not story.T[cold] > 0.0:
        findings.append(Finding(f"{about}: {story.T[cold]:.6g} K at node {cold[1]} at t = {story.t[cold[0]]:.6g} s, "
                                "below absolute zero", np.inf, ("absolute zero", "0 K", *OUTSIDE), story))
    if story.scene.doc.get("rules"):
        return findings  # they may drive a condition anywhere
    tolerance = float(_model(story)["tolerance"])
    for bodies in components(story):
        bounds = bounds_of(story, bodies)
        nodes = np.concatenate([story.nodes_of(b) for b in bodies])
        T = story.T[:, nodes]
        under = np.where(bounds.cools, -np.inf, bounds.low[:, None] - T)
        over = np.where(bounds.heats, -np.inf, T - bounds.high[:, None])
        span = float(bounds.high[-1] - bounds.low[-1])
        beyond = np.maximum(under, over)
        k, i = np.unravel_index(int(beyond.argmax()), beyond.shape)
        # A scene of one temperature has no span: round-off and Newton's tolerance of the temperature itself.
        floor = 100.0 * max(tolerance, 1e-12) * float(bounds.high[-1])
        if beyond[k, i] <= max(EXACT * span, floor):
            continue
        body = story.interface.bodies[story.interface.node_body[nodes[i]]]
        exact = all(is_m_matrix(story, b, (float(bounds.low[-1]), float(bounds.high[-1]))) for b in bodies)
        allowed = max((EXACT if exact else ROUGH) * span, floor)
        if beyond[k, i] > allowed:
            side = "below" if under[k, i] >= over[k, i] else "above"
            findings.append(Finding(
                f"{about}: node {nodes[i]} of {body} is at {T[k, i]:.6g} K at t = {story.t[k]:.6g} s, "
                f"{beyond[k, i]:.4g} K ({beyond[k, i] / span if span else np.inf:.3g} of the span) {side} all its data "
                f"({bounds.low[k]:.6g} to {bounds.high[k]:.6g} K){', on an M-matrix' if exact else ''}",
                float(beyond[k, i] / allowed), OUTSIDE, story))
    return findings


def cell_time(story: Story) -> float:
    """The shortest h^2/a [s] of a scene's bodies: h the shortest edge, a the largest diffusivity."""
    model = _model(story)
    span = (float(story.T.min()), float(story.T.max()))
    times = []
    for body, shape in story.scene.shapes.items():
        material = model["materials"][model["bodies"][body]["material"]]
        k = max(float(np.linalg.eigvalsh(K).max()) for K in _tensors(material["k"], span))
        times.append(shape.cell_size**2 * material["rho"] * property_span(material["c"], *span)[0] / k)
    return min(times)


def slowest_cell_time(story: Story) -> float:
    """The longest h^2/a [s] of a scene's bodies: h the longest edge, a the least diffusivity."""
    model = _model(story)
    span = (float(story.T.min()), float(story.T.max()))
    times = []
    for body, shape in story.scene.shapes.items():
        material = model["materials"][model["bodies"][body]["material"]]
        k = min(float(np.linalg.eigvalsh(K).min()) for K in _tensors(material["k"], span))
        times.append(shape.longest_edge**2 * material["rho"] * property_span(material["c"], *span)[1] / k)
    return max(times)


def in_windows_of(scene: Scene, size: float, most: int = WINDOWS) -> Scene:
    """The same scene in even windows of `size` [s], some 4 to `most` of them; without rules, studies and pictures."""
    doc = scene.copied_doc()
    coupling = doc["coupling"]
    end = min(float(coupling["end"]), most * size)
    if 4.0 * size > end:
        end = 4.0 * size
    for key in ("adaptive", "stop", "windows"):
        coupling.pop(key, None)
    coupling |= {"end": end, "windows": [{"until": end, "size": size}]}
    if "kinks" in coupling:
        coupling["kinks"] = [t for t in coupling["kinks"] if t < end]
    for key in ("rules", "study", "output"):
        doc.pop(key, None)
    return Scene(doc, scene.recipes, scene.moved)


def _within_data(scene: Scene, story: Story, rng: np.random.Generator) -> list[Finding]:
    factor = float(10.0 ** rng.uniform(-4.0, 4.0))
    other = told(in_windows_of(scene, factor * cell_time(story)), most=120)
    return beyond_data(other, f"in windows of {factor:.2g} h^2/a") if other.outcome == COMPLETED else []


WITHIN = Invariant("within its data", lambda scene: True,
                   lambda scene, story, rng: beyond_data(story, "as drawn"), runs=0)
MAXIMUM = Invariant("maximum principle", lambda scene: True, _within_data)
"""Without sources, temperature stays between the least and the largest of what it began at, is held at and faces, up to
the time seen (the maximum principle of div(k grad T) = rho c dT/dt with films, contact and radiation, melting too:
enthalpy rises with temperature).  A source that only heats leaves the lower bound, one that only cools the upper one.

In exact time it holds on a mesh whose matrix has no positive off-diagonal (an M-matrix; Ciarlet & Raviart 1973): 1e-6
of the span is asked there, far above Newton's tolerance of 1e-10; elsewhere 1e-3, the least that would be seen.
WITHIN looks at the scene as drawn, MAXIMUM runs it in windows of 1e-4 to 1e4 h^2/a, a factor drawn anew.  Nothing is
ever below 0 K.
"""

INVARIANTS: Sequence[Invariant] = (WITHIN, MAXIMUM)
