"""interface.h5: what a half and its coupler both know of the scene (mesh, surfaces, node sets, contact pairs)."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

FORMAT = "slideline.interface"
FORMAT_VERSION = 1

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Pair:
    """A contact pair: slave and master are names of surfaces.

    gap_max : farther than this [m] nothing is faced.  eps_N : penalty stiffness [Pa/m], 0 where no half needs it.
    mu : Coulomb's coefficient.  eps_T : stiffness of sticking [Pa/m], 0 for that of the penalty.  two_pass : searched
    from either side with half the weight.  by_node : one point a slave node, not points on cut edges.
    """

    name: str
    slave: str
    master: str
    gap_max: float
    eps_N: float
    mu: float = 0.0
    eps_T: float = 0.0
    two_pass: bool = False
    by_node: bool = False


@dataclass(frozen=True)
class Interface:
    """The mesh of every body in one numbering (0-based inside, 1-based in FMI names).

    geometry : "plane" (per metre of depth) or "axisymmetric" (x = r, y = z).
    nodes : (n_nodes, 2) reference coordinates X [m].
    quads : (n_quads, 4), triangles : (n_triangles, 3), node numbers anticlockwise.  *_body : index into bodies.
    surfaces : name -> (n_edges, 2) node numbers, the body on the left hand going from first to second node, so the
        outward normal of an edge with tangent (tx, ty) is (ty, -tx).  Named "body.surface".
    node_sets : name -> node numbers.
    """

    geometry: str
    nodes: Floats
    quads: Ints
    triangles: Ints
    quad_body: Ints
    triangle_body: Ints
    bodies: tuple[str, ...]
    materials: tuple[str, ...]
    surfaces: dict[str, Ints]
    node_sets: dict[str, Ints] = field(default_factory=dict)
    pairs: tuple[Pair, ...] = ()

    @property
    def axisymmetric(self) -> bool:
        return self.geometry == "axisymmetric"

    @cached_property
    def contact_nodes(self) -> Ints:
        """(n_s,) node number of every contact surface node s, both sides of all pairs, ascending, each once."""
        names = {name for pair in self.pairs for name in (pair.slave, pair.master)}
        if not names:
            return np.empty(0, dtype=np.int32)
        return np.unique(np.concatenate([self.surfaces[name].ravel() for name in sorted(names)])).astype(np.int32)

    @cached_property
    def node_body(self) -> Ints:
        """(n_nodes,) index of the body each node belongs to; -1 for a node no cell uses."""
        body = np.full(len(self.nodes), -1, dtype=np.int32)
        body[self.quads] = self.quad_body[:, None]
        body[self.triangles] = self.triangle_body[:, None]
        return body

    @cached_property
    def mesh_hash(self) -> str:
        """Hash of geometry, nodes and cells: both halves of a run must have the same."""
        return _hash(self.geometry.encode(), self.nodes, self.quads, self.triangles, self.quad_body,
                     self.triangle_body)

    @cached_property
    def surfaces_hash(self) -> str:
        """Hash of everything the contact service is told of the surfaces."""
        text = json.dumps([vars(p) for p in self.pairs])
        names = sorted({n for p in self.pairs for n in (p.slave, p.master)})
        return _hash(self.geometry.encode(), text.encode(), self.contact_nodes,
                     self.nodes[self.contact_nodes], *(self.surfaces[n] for n in names))


def _hash(*parts: bytes | Floats | Ints) -> str:
    digest = hashlib.sha256()
    for part in parts:
        data = part if isinstance(part, bytes) else repr(part.shape).encode() + np.ascontiguousarray(part).tobytes()
        digest.update(len(data).to_bytes(8, "little"))
        digest.update(data)
    return digest.hexdigest()[:32]


def write_interface(interface: Interface, path: Path) -> None:
    """Write an interface to an HDF5 file (layout: docs/design.md)."""
    with h5py.File(path, "w", track_order=True) as f:
        f.attrs.update(format=FORMAT, version=FORMAT_VERSION, geometry=interface.geometry,
                       bodies=json.dumps(interface.bodies), materials=json.dumps(interface.materials),
                       pairs=json.dumps([vars(p) for p in interface.pairs]))
        for name in ("nodes", "quads", "triangles", "quad_body", "triangle_body"):
            f[name] = getattr(interface, name)
        for group in ("surfaces", "node_sets"):
            f.create_group(group, track_order=True)
            for name, value in getattr(interface, group).items():
                f[group].create_dataset(name, data=value)


def read_interface(path: Path) -> Interface:
    """Read an interface file.  Raises ValueError where it is not one, or of another version."""
    try:
        with h5py.File(path, "r") as f:
            if f.attrs.get("format") != FORMAT or f.attrs.get("version") != FORMAT_VERSION:
                raise ValueError(f"{path}: not a {FORMAT} file of version {FORMAT_VERSION}")
            return Interface(
                geometry=str(f.attrs["geometry"]),
                nodes=f["nodes"][()].astype(np.float64),
                **{k: f[k][()].astype(np.int32) for k in ("quads", "triangles", "quad_body", "triangle_body")},
                bodies=tuple(json.loads(f.attrs["bodies"])),
                materials=tuple(json.loads(f.attrs["materials"])),
                surfaces={k: v[()].astype(np.int32) for k, v in f["surfaces"].items()},
                node_sets={k: v[()].astype(np.int32) for k, v in f["node_sets"].items()},
                pairs=tuple(Pair(**p) for p in json.loads(f.attrs["pairs"])),
            )
    except (OSError, KeyError, TypeError) as exc:
        raise ValueError(f"{path}: not a readable {FORMAT} file ({exc})") from exc
