"""All that flows into the nodes except by conduction inside: flux, film, sources, contact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermal_fmu.exchange import exchange_flow
from thermal_fmu.film import film_flow
from thermal_fmu.held import Held
from thermal_fmu.loads import Loads
from thermal_fmu.spec import Film

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

TERMS = ("flux", "convection", "source", "mechanical", "contact.slave", "contact.master", "gap.slave",
         "gap.master")


@dataclass(frozen=True)
class Boundary:
    """f : (n,) heat flow into the nodes [W].  terms : by mechanism [W], in the order of TERMS.

    magnitude : sum of the sizes of all nodal contributions [W].  The derivative of -f [W/K] is in places, as (places
    in the matrix data, values), and, where it joins two bodies, in across, as (nodes (n, 4), values (n, 4, 4)).
    """

    f: Floats
    terms: Floats
    magnitude: float
    places: tuple[tuple[NDArray[np.int64], Floats], ...]
    across: tuple[tuple[Ints, Floats], ...]


def boundary_flow(films: Sequence[Film], held: Held, loads: Loads, power_M: Floats, T: Floats) -> Boundary:
    """The boundary terms at T : (n,) [K].  power_M : (n,) mechanical heat [W], E_M spread evenly over the substep."""
    flux = np.zeros(T.size)
    for q, area in zip(loads.fluxes, held.flux_areas, strict=True):
        flux += q * area
    source = np.array(loads.Q_T) @ held.sources
    f = flux + source + power_M
    terms = dict.fromkeys(TERMS, 0.0)
    terms |= {"flux": flux.sum(), "source": source.sum(), "mechanical": power_M.sum()}
    magnitude = float(np.abs(flux).sum() + np.abs(source).sum() + np.abs(power_M).sum())
    places, across = [], []
    for film, points, (h, Te) in zip(films, held.films, loads.films, strict=True):
        flow, slope = film_flow(film, points, h, Te, T)
        f -= _nodal(points.nodes, flow, T.size)
        terms["convection"] -= flow.sum()
        magnitude += float(np.abs(flow).sum())
        places.append((points.slots, slope))
    for group in held.groups:
        factor = loads.pairs[group.pair][0 if group.closed else 1]
        if factor == 0.0:
            continue
        flow, slope = exchange_flow(group, factor, T)
        f -= _nodal(group.nodes, flow, T.size)
        # Either side from its own shape functions: that they agree is what the ledger shows.
        terms[f"{group.mechanism}.slave"] -= flow[:, :2].sum()
        terms[f"{group.mechanism}.master"] -= flow[:, 2:].sum()
        magnitude += float(np.abs(flow).sum())
        across.append((group.nodes, slope))
    return Boundary(f, np.array([terms[name] for name in TERMS]), magnitude, tuple(places), tuple(across))


def _nodal(nodes: Ints, flow: Floats, n: int) -> Floats:
    return np.bincount(nodes.ravel(), weights=flow.ravel(), minlength=n).astype(np.float64, copy=False)
