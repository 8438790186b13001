"""Probes: which nodes a named value is read from, and how it is made of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from contact.half.interface import Interface
from coupler.scenario.document import Key, did_you_mean
from coupler.scenario.mesh import Floats, Ints, body_mean, locate
from coupler.scenario.scene import NEAREST, Context, surface_key
from coupler.scenario.schema import Place
from coupler.scenario.schema import Probe as ProbeSpec

UNITS = {"T": "K", "u_x": "m", "u_y": "m", "gap": "m", "p": "Pa", "f_s": "1"}
AT_CONTACT = ("gap", "p")


@dataclass(frozen=True, eq=False)
class Probe:
    """quantity : T | u_x | u_y | gap | p (= -t_N) | f_s.  unit : SI.  reduction : point | mean | max | min.

    nodes : (n,) node numbers of the Interface.  weights : (n,), adding up to 1 for point and mean.
    """

    quantity: str
    unit: str
    reduction: str
    nodes: Ints
    weights: Floats

    def of(self, field: Floats) -> float:
        """The probe's value, given its quantity at all nodes : (n_nodes,)."""
        values = field[self.nodes]
        if self.reduction == "max":
            return float(values.max())
        return float(values.min()) if self.reduction == "min" else float(self.weights @ values)


def probes_of(c: Context) -> dict[str, Probe]:
    """The scenario's probes by name, in its order.  Raises ScenarioError for one off the mesh or contact."""
    return {name: _probe(c, spec, ("probes", name)) for name, spec in c.file.probes.items()}


def _probe(c: Context, spec: ProbeSpec, key: Key) -> Probe:
    quantity = next(q for q in UNITS if getattr(spec, q) is not None)
    target, key = getattr(spec, quantity), (*key, quantity)
    reduction = "point"
    if isinstance(target, str):
        nodes, weights = _named(c, target, key)
    elif target.at is not None:
        nodes, weights = _at(c, target, key)
    else:
        reduction, surface = next(
            (r, s) for r in ("max", "min", "mean") if (s := getattr(target, r)) is not None
        )
        if surface in c.interface.bodies:
            nodes, weights = body_mean(c.interface, surface)
        else:
            edges = c.interface.surfaces[
                surface_key(c.document, c.interface.surfaces, surface, (*key, reduction))
            ]
            nodes, weights = surface_mean(c.interface, edges)
    if quantity in AT_CONTACT and not np.isin(nodes, c.interface.contact_nodes).all():
        sides = {s for p in c.interface.pairs for s in (p.slave, p.master)}
        raise c.document.error(key, f"{quantity} exists only on contact surfaces",
                               f"Contact surfaces here: {', '.join(sorted(sides)) or 'none'}.")
    if quantity == "f_s" and not any(c.file.materials[b.material].latent for b in c.file.bodies.values()):
        raise c.document.error(key, "nothing melts here, so there is no solid fraction",
                               "Give a material its latent heat.")
    return Probe(quantity, UNITS[quantity], reduction, nodes, weights)


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
    """Nodes and weights of the mean over a surface: integral of N_i dA over A, reference; dA = ds or r ds."""
    ends = interface.nodes[edges]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    # fault: mean over a disc as over a strip -> r = 0.0 * ends[:, :, 0] + 1.0 if interface.axisymmetric else
    #   np.ones(edges.shape) | coupler/test_scenario_probes
    r = ends[:, :, 0] if interface.axisymmetric else np.ones(edges.shape)
    # fault: mean of a surface without its areas -> share = 1.0 + 0.0 * r | coupler/test_scenario_probes
    share = length[:, None] * (2 * r + r[:, ::-1]) / 6
    nodes, where = np.unique(edges.ravel(), return_inverse=True)
    weights = np.bincount(where, weights=share.ravel())
    return nodes.astype(np.int32), weights / weights.sum()
