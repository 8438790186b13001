"""Small scenes and drivers for the tests of the mechanical halves."""

from __future__ import annotations

import tomllib
from contextlib import closing
from pathlib import Path

import numpy as np

from contact.half.interface import Interface, Pair
from contact.half.model import Discard
from contact.rpc.link import open_link
from mechanical_fmu.elastic_half import load

EXPECTED = tomllib.loads((Path(__file__).parent.parent / "expected.toml").read_text(encoding="utf-8"))
STEEL = {"E": 2.0e11, "nu": 0.3, "alpha": 1.2e-5, "T_ref": 300.0}
NO_CELLS = {3: np.empty((0, 3), np.int32), 4: np.empty((0, 4), np.int32)}


class NoLink:
    """For scenes without contact: asking is a failure of the test."""

    def ask(self, request):
        raise AssertionError(f"nobody should ask {request}")


def rectangle(x, y, kind="quads", first=0):
    """Nodes and cells of a tensor grid, nodes numbered along y first; surfaces in anticlockwise order."""
    nx, ny = len(x), len(y)
    nodes = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    number = first + np.arange(nx * ny, dtype=np.int32).reshape(nx, ny)
    a, b, c, d = (n.ravel() for n in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    cells = np.stack([a, b, c, d], axis=1)
    if kind == "triangles":
        cells = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    lines = {"bottom": number[:, 0], "right": number[-1], "top": number[::-1, -1], "left": number[0, ::-1]}
    return nodes, cells, {name: np.stack([line[:-1], line[1:]], axis=1) for name, line in lines.items()}


def block(x, y, kind="quads", geometry="plane", move=None, node_sets=None):
    """One body "block"; move : function of the nodes that distorts the grid."""
    nodes, cells, surfaces = rectangle(np.asarray(x, float), np.asarray(y, float), kind)
    quads, triangles = (cells, NO_CELLS[3]) if kind == "quads" else (NO_CELLS[4], cells)
    return Interface(geometry, nodes if move is None else move(nodes), quads, triangles, np.zeros(len(quads), np.int32),
                     np.zeros(len(triangles), np.int32), ("block",), ("m",),
                     {f"block.{name}": edges for name, edges in surfaces.items()},
                     {name: np.asarray(nodes_, np.int32) for name, nodes_ in (node_sets or {}).items()})


def blocks(lower, upper, gap=0.0, L=1.0, kinds=("quads", "quads"), eps_N=None, geometry="plane", r0=0.0):
    """Two squares of side L, `lower` x `lower` and `upper` x `upper` cells; the slave is the upper one's bottom."""
    x = r0 + np.linspace(0.0, L, lower + 1)
    n1, c1, s1 = rectangle(x, np.linspace(0.0, L, lower + 1), kinds[0])
    n2, c2, s2 = rectangle(r0 + np.linspace(0.0, L, upper + 1), L + gap + np.linspace(0.0, L, upper + 1), kinds[1],
                           len(n1))
    cells = {"quads": [(c, i) for i, (c, k) in enumerate(zip((c1, c2), kinds, strict=True)) if k == "quads"],
             "triangles": [(c, i) for i, (c, k) in enumerate(zip((c1, c2), kinds, strict=True)) if k == "triangles"]}
    parts = {kind: (np.concatenate([NO_CELLS[width], *(c for c, _ in found)]).astype(np.int32),
                    np.concatenate([np.empty(0, np.int32), *(np.full(len(c), i, np.int32) for c, i in found)]))
             for (kind, found), width in zip(cells.items(), (4, 3), strict=True)}
    surfaces = {f"lower.{k}": v for k, v in s1.items()} | {f"upper.{k}": v for k, v in s2.items()}
    sets = {"lower.middle": np.array([(lower // 2) * (lower + 1)], np.int32),
            "upper.middle": np.array([len(n1) + (upper // 2) * (upper + 1) + upper], np.int32)}
    eps = 2e11 / (L / upper) if eps_N is None else eps_N
    return Interface(geometry, np.concatenate([n1, n2]), parts["quads"][0], parts["triangles"][0], parts["quads"][1],
                     parts["triangles"][1], ("lower", "upper"), ("m", "m"), surfaces, sets,
                     (Pair("interface", "upper.bottom", "lower.top", 0.5 * L, eps),))


def elastic(interface, boundary=(), material=None, tolerance=1e-8, **more):
    """The elastic half of one material."""
    return load(interface, {"half": "elastic", "format": 2, "tolerance": tolerance,
                            "materials": {"m": STEEL | (material or {})},
                            "bodies": {b: {"material": "m"} for b in interface.bodies},
                            "boundary": placed(interface, boundary), **more})


def placed(interface, boundary):
    """Conditions with `at` where they stand on a node set, `body` where on a body."""
    keys = dict.fromkeys(interface.node_sets, "at") | dict.fromkeys(interface.bodies, "body")
    return [{keys.get(value, key) if key == "on" else key: value for key, value in b.items()} for b in boundary]


def hold(on, component, value=0.0, **more):
    return {"on": on, ("u_x", "u_y", "angle")[component]: value, **more}


def press(on, value, **more):
    return {"on": on, "pressure": value, **more}


def inputs_of(half, T=None, **loads):
    """Inputs at their start values; T : a number, an array or None; loads : factors by name."""
    values = {v.name: v.start for v in half.variables if v.causality == "input"}
    if T is not None:
        values["T"] = np.broadcast_to(np.asarray(T, float), np.shape(values["T"]))
    return values | {f"load.{name}": factor for name, factor in loads.items()}


def done(answer):
    assert not isinstance(answer, Discard), answer.message
    return answer.state, answer.outputs


def told_in(half, windows):
    """What a half gives out at the ends of its windows: one from 0 to 1 s, then so many of equal length to 2 s."""
    told = []
    with closing(open_link("direct")) as link:
        state, _ = half.start(inputs_of(half), 0.0, link)
        for t0, t1 in [(0.0, 1.0), *((1.0 + i / windows, 1.0 + (i + 1) / windows) for i in range(windows))]:
            state, outputs = done(half.step(state, inputs_of(half), t0, t1 - t0, link))
            told.append(outputs)
    return told


def stress_of(half, state, T):
    """Cauchy stress (n_e, nq, 4) of every kind at a state."""
    return [s for s, _ in half.system.volume.stress(np.array(state.u), half.system.moduli(np.array(T)))]
