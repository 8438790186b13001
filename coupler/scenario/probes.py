"""Probes: which nodes a named value is read from, and how it is made of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from contact.half.interface import Interface
from contact.problem.values import did_you_mean
from coupler.scenario.conditions import ConditionOutput, is_condition, remedy, resolved
from coupler.scenario.document import Key
from coupler.scenario.mesh import Floats, Ints
from coupler.scenario.of_a_step import SINCE_START, step_output
from coupler.scenario.scene import Context, surface_key
from coupler.scenario.schema import Place, ProbeSpec
from coupler.scenario.stated import NEAREST
from coupler.scenario.transfer import SLACK, shapes_at

UNITS = {"T": "K", "u_x": "m", "u_y": "m", "gap": "m", "p": "Pa", "f_s": "1"}
"""Quantities of the exchange, whose units the border fixes; of any other output its half says the unit."""
AT_CONTACT = ("gap", "p")
OF_MECHANICS = ("u_x", "u_y", *AT_CONTACT)
VALUE = "value"  # in the place of a point: an output that belongs to no place of the mesh
NONE, NO_WEIGHTS = np.empty(0, dtype=np.int32), np.empty(0)


@dataclass(frozen=True, eq=False)
class Probe:
    """quantity : T | u_x | u_y | gap | p (= -t_N) | f_s, or HALF.OUTPUT, any output of a half, or heat.NAME,
    reaction.NAME.y, reaction_moment.NAME of a condition.

    unit : SI; empty of an output: its half says it.  reduction : point | mean | max | min.
    nodes : (n,) node numbers of the Interface.  weights : (n,), adding up to 1 for point and mean.
    cells, cell_weights : the same of cells, quads first, for an output that is given on cells.
    An output without a place has neither nodes nor cells.  source : HALF.OUTPUT where the quantity is of a condition.
    """

    quantity: str
    unit: str
    reduction: str
    nodes: Ints
    weights: Floats
    cells: Ints = field(default_factory=lambda: NONE)
    cell_weights: Floats = field(default_factory=lambda: NO_WEIGHTS)
    source: str = ""

    @property
    def half(self) -> str:
        """The half whose output it is; empty for a quantity of the exchange."""
        return "" if self.quantity in UNITS else (self.source or self.quantity).partition(".")[0]

    @property
    def output(self) -> str:
        """The name of that output, with its component."""
        return (self.source or self.quantity).partition(".")[2]

    @property
    def of_a_step(self) -> str:
        """As `step_output`."""
        return "" if self.source else step_output(self.quantity)

    @property
    def placeless(self) -> bool:
        """Whether it is read from no place of the mesh."""
        return not len(self.nodes)

    def of(self, values: Floats) -> float:
        """Return the probe's value, in the unit of its quantity.

        values : (n_nodes,) in that unit, the quantity at all nodes.
        """
        return self._reduced(values[self.nodes], self.weights)

    def of_cells(self, values: Floats) -> float:
        """Return the probe's value, in the unit of its quantity.

        values : (n_cells,) in that unit, the quantity in all cells, quads first.
        """
        return self._reduced(values[self.cells], self.cell_weights)

    def _reduced(self, values: Floats, weights: Floats) -> float:
        if self.reduction == "max":
            return float(values.max())
        return float(values.min()) if self.reduction == "min" else float(weights @ values)


def probes_of(c: Context, conditions: Mapping[str, ConditionOutput]) -> dict[str, Probe]:
    """The scenario's probes by name, in its order.  conditions : by name, whose heat and force are known.

    Raises ScenarioError for one off the mesh or contact.
    """
    found = {}
    for name, spec in c.file.probes.items():
        with c.found.each():
            found[name] = _probe(c, spec, ("probes", name), conditions)
    return found


def probe_notes(probes: Mapping[str, Probe]) -> list[str]:
    """A sentence each on probes whose values hang on the size of windows."""
    # fault: what one step moved is told in silence -> told = {} | coupler/test_probes_of_a_step
    told = {name: probe for name, probe in probes.items() if probe.of_a_step}
    return [f"probe {name}: {probe.quantity} is of the last substep alone, so its size hangs on how long that is, and "
            "no error is estimated of it" + (f"; {SINCE_START[probe.of_a_step]} since the start"
                                          if probe.of_a_step in SINCE_START else "") for name, probe in told.items()]


def _probe(c: Context, spec: ProbeSpec, key: Key, conditions: Mapping[str, ConditionOutput]) -> Probe:
    quantity = spec.quantity
    target, key = getattr(spec, quantity), (*key, quantity)
    if quantity not in UNITS:
        if of := resolved(quantity, conditions, c.interface.bodies):
            return _of_condition(c, quantity, target, of, key)
        if is_condition(quantity):
            raise c.document.error(key, "no condition has this", remedy(quantity, conditions))
        return _of_output(c, quantity, target, key)
    spot = _spot(c, target, key)
    nodes = spot.nodes
    # A pair whose surfaces are wrong is told by itself.
    paired = len(c.interface.pairs) == len(c.file.contact)
    if quantity in AT_CONTACT and paired and not np.isin(nodes, c.interface.contact_nodes).all():
        sides = {s for p in c.interface.pairs for s in (p.slave, p.master)}
        raise c.document.error(key, f"{quantity} exists only on contact surfaces",
                               f"Contact surfaces here: {', '.join(sorted(sides)) or 'none'}.")
    if quantity == "f_s" and not any(
            c.file.materials[part.material].latent for body in c.file.bodies.values() for part in body.parts.values()
            if part.material in c.file.materials):
        raise c.document.error(key, "nothing melts here, so there is no solid fraction",
                               "Give a material its latent heat.")
    return Probe(quantity, UNITS[quantity], spot.reduction, nodes, spot.weights)


def _of_condition(c: Context, quantity: str, target: str | Place, of: tuple[ConditionOutput, int], key: Key) -> Probe:
    output, number = of
    if target != VALUE:
        raise c.document.error(key, "heat and force of a condition belong to no place of the mesh",
                               "Write `value` in the place of a point.")
    part = f"[{number}]" if len(output.parts) > 1 else ""
    return Probe(quantity, "", "point", NONE, NO_WEIGHTS, source=f"{output.half}.{output.output}{part}")


def _of_output(c: Context, quantity: str, target: str | Place, key: Key) -> Probe:
    """A probe of an output; whether the half has it, and on nodes or cells, is seen when the half is loaded."""
    if target == VALUE:
        return Probe(quantity, "", "point", NONE, NO_WEIGHTS)
    spot = _spot(c, target, key)
    cells, shares = _cells(c.interface, spot)
    return Probe(quantity, "", spot.reduction, spot.nodes, spot.weights, cells, shares / shares.sum())


@dataclass(frozen=True, eq=False)
class _Spot:
    """reduction, nodes, weights : as in Probe.  over : the surface or body of a reduction, empty of a point."""

    reduction: str
    nodes: Ints
    weights: Floats
    over: str = ""


def _spot(c: Context, target: str | Place, key: Key) -> _Spot:
    if isinstance(target, str):
        return _Spot("point", *_named(c, target, key))
    if target.at is not None:
        return _Spot("point", *_at(c, target, key))
    reduction, over = next((r, s) for r in ("max", "min", "mean") if (s := getattr(target, r)) is not None)
    if over in c.interface.bodies:
        return _Spot(reduction, *body_mean(c.interface, over), over)
    known = c.interface.surfaces
    surface = surface_key(c.document, known, over, (*key, reduction))
    return _Spot(reduction, *surface_mean(c.interface, known[surface]), surface)


def _cells(interface: Interface, spot: _Spot) -> tuple[Ints, Floats]:
    """Cells of a body, by volume; cells along a surface, by its area; else cells that meet at a point, by volume."""
    if spot.over in interface.surfaces:
        edges = interface.surfaces[spot.over]
        areas = _node_areas(interface, edges).sum(axis=1)
        cells, at = np.unique(cells_along(interface, edges), return_inverse=True)
        return cells, np.bincount(at, weights=areas).astype(float)
    if spot.over:
        owner = np.concatenate([interface.quad_body, interface.triangle_body])
        cells = np.flatnonzero(owner == interface.bodies.index(spot.over)).astype(np.int32)
    else:
        cells = cells_with(interface, spot.nodes)
    return cells, cell_volumes(interface)[cells]


def _named(c: Context, name: str, key: Key) -> tuple[Ints, Floats]:
    sets: Mapping[str, Ints] = c.interface.node_sets
    if name in sets and len(sets[name]) == 1:
        return sets[name], np.ones(1)
    if name in c.scene.points:
        found = locate(c.interface, *c.scene.points[name])
        assert found is not None, "a named point lies on its own body"
        return found
    if name in c.interface.surfaces or name in sets:
        raise c.document.error(
            key,
            f"{name} is not a single point",
            f"Write {{max: {name}}}, min or mean; a point is {{at: [x, y], body: name}}.",
        )
    known = set(c.scene.points) | {n for n, ids in sets.items() if len(ids) == 1 and not n.endswith(NEAREST)}
    raise c.document.error(key, f"there is no point {name!r}", did_you_mean(name, known))


def _at(c: Context, place: Place, key: Key) -> tuple[Ints, Floats]:
    assert place.at is not None
    if place.body is None or place.body not in c.interface.bodies:
        raise c.document.error((*key, "body"), f"there is no body {place.body!r}",
                               did_you_mean(str(place.body), c.interface.bodies))
    found = locate(c.interface, place.body, np.array(place.at))
    if found is None:
        own = c.interface.nodes[c.interface.node_body == c.interface.bodies.index(place.body)]
        (x0, y0), (x1, y1) = own.min(axis=0), own.max(axis=0)
        raise c.document.error(
            (*key, "at"),
            f"the point is not on the mesh of {place.body!r}",
            f"It spans x {x0:g} to {x1:g} m, y {y0:g} to {y1:g} m in the reference configuration.",
        )
    return found


def surface_mean(interface: Interface, edges: Ints) -> tuple[Ints, Floats]:
    """Return the nodes (n,), ascending, and weights (n,) [1], adding up to 1, of the mean over a surface.

    edges : (n_edges, 2) node numbers.  A weight is the integral of N_i dA over A, reference; dA = ds or r ds (ds where
    all of the surface lies on the axis).
    """
    nodes, where = np.unique(edges.ravel(), return_inverse=True)
    weights = np.bincount(where, weights=_node_areas(interface, edges).ravel())
    return nodes.astype(np.int32), weights / weights.sum()


def _node_areas(interface: Interface, edges: Ints) -> Floats:
    """(n_edges, 2) integral of N_i dA over each edge, reference."""
    ends = interface.nodes[edges]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    # fault: mean over a disc as over a strip -> r = 0.0 * ends[:, :, 0] + 1.0 if interface.axisymmetric else
    #   np.ones(edges.shape) | coupler/test_scenario_probes
    r = ends[:, :, 0] if interface.axisymmetric else np.ones(edges.shape)
    if not r.any():
        # A surface on the axis has no area.  The mean over a thin tube about it tends to the mean by length.
        # fault: no mean along the axis -> r = 0.0 * ends[:, :, 0] | coupler/test_scenario_probes
        r = np.ones(edges.shape)
    # fault: mean of a surface without its areas -> return 1.0 + 0.0 * r | coupler/test_scenario_probes
    return np.asarray(length[:, None] * (2 * r + r[:, ::-1]) / 6)


# Places of a mesh: which cell a point lies in, with what weights its nodes make up the value there or the mean over a
# body.


def locate(interface: Interface, body: str, at: Floats) -> tuple[Ints, Floats] | None:
    """Return the nodes (n,) and weights (n,) [1] of a point of a body's reference mesh; None where it is off the mesh.

    at : (2,) [m].  Weights are the cell's shape functions there; nodes with weight 0 are left out.
    """
    index = interface.bodies.index(body)
    for cells, owner in (
        (interface.quads, interface.quad_body),
        (interface.triangles, interface.triangle_body),
    ):
        own = cells[owner == index]
        if not len(own):
            continue
        x = interface.nodes[own]
        low, high = x.min(axis=1), x.max(axis=1)
        slack = SLACK * (high - low).max(axis=1, keepdims=True)
        near = np.flatnonzero(((at >= low - slack) & (at <= high + slack)).all(axis=1))
        N = shapes_at(x[near], np.tile(at, (len(near), 1)))
        inside = np.flatnonzero(N.min(axis=1) >= -SLACK)
        if inside.size:
            return _cleaned(own[near[inside[0]]], N[inside[0]])
    return None


def _cleaned(nodes: Ints, weights: Floats) -> tuple[Ints, Floats]:
    kept = weights > SLACK
    # fault: probe takes the first node of its cell -> return nodes[kept][:1], np.ones(1) | coupler/test_scenario_probes
    return nodes[kept], weights[kept] / weights[kept].sum()


GAUSS = 1 / np.sqrt(3)


def body_mean(interface: Interface, body: str) -> tuple[Ints, Floats]:
    """Return the nodes (n,), ascending, and weights (n,) [1], adding up to 1, of the mean over a body.

    A weight is the integral of N_i dV over V, reference; dV = dA or r dA.
    body : one of interface.bodies.  Exact for cells of any shape: N_i r det J has degree 3 along each side.
    """
    number = interface.bodies.index(body)
    quads = interface.quads[interface.quad_body == number]
    triangles = interface.triangles[interface.triangle_body == number]
    shares = [quad_shares(interface.nodes[quads], interface.axisymmetric),
              triangle_shares(interface.nodes[triangles], interface.axisymmetric)]
    nodes, where = np.unique(np.concatenate([quads.ravel(), triangles.ravel()]), return_inverse=True)
    weights = np.bincount(where, weights=np.concatenate([s.ravel() for s in shares]))
    return nodes.astype(np.int32), weights / weights.sum()


def cell_volumes(interface: Interface) -> Floats:
    """Return the reference volume of each cell (n_cells,), quads first.

    It is the integral of dA [m2] or, axisymmetric, of r dA [m3].
    """
    return np.concatenate([quad_shares(interface.nodes[interface.quads], interface.axisymmetric).sum(axis=1),
                           triangle_shares(interface.nodes[interface.triangles], interface.axisymmetric).sum(axis=1)])


def cells_with(interface: Interface, nodes: Ints) -> Ints:
    """Return the numbers of the cells (n,), quads first, that have all of these nodes.

    nodes : (m,) node numbers, each once.
    """
    has = [np.isin(cells, nodes).sum(axis=1) for cells in (interface.quads, interface.triangles)]
    return np.flatnonzero(np.concatenate(has) == len(nodes)).astype(np.int32)


def cells_along(interface: Interface, edges: Ints) -> Ints:
    """Return the cell (n_edges,), quads first, that has each edge of a surface.

    edges : (n_edges, 2) node numbers.
    """
    quads, triangles = interface.quads, interface.triangles
    every = np.concatenate([np.stack([cells, np.roll(cells, -1, axis=1)], axis=-1).reshape(-1, 2)
                            for cells in (quads, triangles)])
    owner = np.concatenate([np.repeat(np.arange(len(quads)), 4), len(quads) + np.repeat(np.arange(len(triangles)), 3)])
    key, wanted = (np.sort(e, axis=1).astype(np.int64) @ (len(interface.nodes), 1) for e in (every, edges))
    order = np.argsort(key, kind="stable")
    return owner[order][np.searchsorted(key[order], wanted)].astype(np.int32)


def quad_shares(x: Floats, axisymmetric: bool) -> Floats:
    """Integrals of N_i dV, (n, 4), of quads with corners x : (n, 4, 2)."""
    share = np.zeros(x.shape[:2])
    a, b = np.array([-1, 1, 1, -1]), np.array([-1, -1, 1, 1])
    for xi, eta in ((i * GAUSS, j * GAUSS) for i in (-1, 1) for j in (-1, 1)):
        N = (1 + a * xi) * (1 + b * eta) / 4
        along = np.einsum("i,nik->nk", a * (1 + b * eta) / 4, x)
        across = np.einsum("i,nik->nk", b * (1 + a * xi) / 4, x)
        volume = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
        if axisymmetric:
            # fault: mean over a cylinder as over a plate -> volume = volume * 1.0 | coupler/test_scenario_probes
            volume = volume * (x[:, :, 0] @ N)
        share += volume[:, None] * N
    return share


def triangle_shares(x: Floats, axisymmetric: bool) -> Floats:
    """Integrals of N_i dV, (n, 3), of triangles with corners x : (n, 3, 2)."""
    one, two = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    area = (one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]) / 2
    r = x[:, :, 0] if axisymmetric else np.ones(x.shape[:2])
    return np.asarray(area[:, None] * (r + r.sum(axis=1, keepdims=True)) / 12)
