"""Small scenes for the thermal half, a run loop, and a contact service for flat edges along x."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from contact.half.interface import Interface, Pair
from contact.half.model import Done
from contact.messages import Facing, Project, Refused, Register, Registered
from thermal_fmu.half import ThermalHalf, ThermalState, contact_at, load
from thermal_fmu.linear import Factors
from thermal_fmu.scene import freeze
from thermal_fmu.step import StepContext

EXPECTED = tomllib.loads((Path(__file__).parent.parent / "expected.toml").read_text(encoding="utf-8"))
I32 = np.int32
GAUSS = (0.5 - 0.5 / np.sqrt(3.0), 0.5 + 0.5 / np.sqrt(3.0))


@dataclass(frozen=True)
class Box:
    """A rectangle of nx x ny quads, from (x0, y0) to (x1, y1); x_lines, if given, are its own columns."""

    x0: float
    x1: float
    y0: float
    y1: float
    nx: int
    ny: int = 1
    x_lines: Any = None
    triangles: bool = False


def scene(*boxes: Box, geometry: str = "plane", pairs: tuple[Pair, ...] = (), names: tuple[str, ...] = ("a", "b"),
          move: Callable[[np.ndarray], np.ndarray] | None = None) -> Interface:
    """Boxes as bodies "a", "b", with surfaces .left .right .bottom .top; move : X -> X distorts the nodes."""
    nodes, quads, triangles, surfaces, first = [], [], [], {}, 0
    for name, box in zip(names, boxes, strict=False):
        xs = np.linspace(box.x0, box.x1, box.nx + 1) if box.x_lines is None else np.asarray(box.x_lines)
        X, Y = np.meshgrid(xs, np.linspace(box.y0, box.y1, box.ny + 1))
        nodes.append(np.stack([X.ravel(), Y.ravel()], axis=1))
        grid = first + np.arange(X.size).reshape(X.shape)
        cells = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1).reshape(-1, 4)
        quads.append(np.empty((0, 4), I32) if box.triangles else cells)
        split = np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
        triangles.append(split if box.triangles else np.empty((0, 3), I32))
        for side, line in (("bottom", grid[0]), ("right", grid[:, -1]), ("top", grid[-1, ::-1]),
                           ("left", grid[::-1, 0])):
            surfaces[f"{name}.{side}"] = np.stack([line[:-1], line[1:]], axis=1).astype(I32)
        first += X.size
    bodies = tuple(names[: len(boxes)])
    all_nodes = np.concatenate(nodes)
    return Interface(
        geometry, all_nodes if move is None else move(all_nodes), np.concatenate(quads).astype(I32),
        np.concatenate(triangles).astype(I32), np.repeat(np.arange(len(boxes)), [len(q) for q in quads]).astype(I32),
        np.repeat(np.arange(len(boxes)), [len(t) for t in triangles]).astype(I32), bodies,
        ("m",) * len(boxes), surfaces, {}, pairs)


def spec(boundary: list[dict[str, Any]], k: Any = 1.0, c: Any = 1.0, rho: float = 1.0, T0: float = 0.0,
         **more: Any) -> dict[str, Any]:
    """A model.json with one material and one body "a"; more: its other keys."""
    return {"half": "thermal", "format": 2, "materials": {"m": {"rho": rho, "k": k, "c": c}},
            "bodies": {"a": {"material": "m", "T0": T0}}, "boundary": boundary, **more}


class FlatContact:
    """Contact of flat edges along x, written apart from the contact service: every overlap of two edges, 2 points."""

    surfaces: Register | None = None

    def ask(self, request: Any) -> Any:
        if isinstance(request, Register):
            self.surfaces = request
            return Registered("flat")
        assert isinstance(request, Project)
        if self.surfaces is None:
            return Refused("unknown_surfaces", "nothing is registered")
        x, m = request.x, self.surfaces
        found = []
        for pair in range(len(m.passes.slave)):
            for s in np.flatnonzero(m.edge_surface == m.passes.slave[pair]):
                for f in np.flatnonzero(m.edge_surface == m.passes.master[pair]):
                    found += self._overlap(pair, s, f, x)
        pair, s, f, xi_s, xi_m, gap, area = (list(v) for v in zip(*found, strict=True)) if found else ([],) * 7
        zeros = np.zeros(m.n_nodes)
        return Facing(np.array(pair, I32), np.array(s, I32), np.array(f, I32), np.array(xi_s, float),
                      np.array(xi_m, float), np.array(gap, float), np.array(area, float), np.array(area, float),
                      np.ones(len(area)), np.ones(len(area)), zeros, zeros)

    def _overlap(self, pair: int, s: int, f: int, x: np.ndarray) -> list[tuple[float, ...]]:
        m = self.surfaces
        (a, y_s), (b, _) = x[m.edges[s]]
        (c, y_m), (d, _) = x[m.edges[f]]
        low, high = max(min(a, b), min(c, d)), min(max(a, b), max(c, d))
        if high - low <= 1e-9 * abs(b - a):
            return []
        at = [low + g * (high - low) for g in GAUSS]
        weight = [0.5 * (high - low) * (2 * np.pi * X if m.axisymmetric else 1.0) for X in at]
        return [(pair, s, f, (X - a) / (b - a), (X - c) / (d - c), abs(y_s - y_m), w)
                for X, w in zip(at, weight, strict=True)]


def inputs_of(interface: Interface, half: ThermalHalf, **given: Any) -> dict[str, Any]:
    """The inputs of a half at their start values, but for those given (t_N for contact.t_N, load_NAME)."""
    values: dict[str, Any] = {}
    for variable in half.variables:
        if variable.causality == "input":
            start = np.broadcast_to(variable.start, variable.shape)
            values[variable.name] = start.copy() if variable.shape else float(variable.start)
    values |= {"control.event": 0, "control.method": 0}
    names = {"t_N": "contact.t_N"}
    return values | {names.get(key, key.replace("load_", "load.")): value for key, value in given.items()}


@dataclass(frozen=True)
class Ran:
    """t : (n,) ends of steps.  T : (n, n_nodes).  outputs of every step.  state : the last one."""

    t: np.ndarray
    T: np.ndarray
    outputs: list[dict[str, Any]]
    state: ThermalState

    def imbalance(self) -> float:
        """|sum of all terms| of the heat ledger over the run, by the sum of |terms|."""
        return imbalance(self.outputs)


def run(interface: Interface, model: dict[str, Any], dt: Any, n: int = 0, link: Any = None, **given: Any) -> Ran:
    """n steps of dt from t = 0 (or the steps dt, an array)."""
    half = load(interface, model)
    link = FlatContact() if link is None else link
    inputs = inputs_of(interface, half, **given)
    state, _ = half.start(inputs, 0.0, link)
    t, times, T, outputs = 0.0, [], [], []
    for h in np.full(n, dt) if n else dt:
        done = half.step(state, inputs, t, float(h), link)
        assert isinstance(done, Done), done
        state, t = done.state, t + float(h)
        times.append(t)
        T.append(np.array(done.outputs["T"]))
        # What is costly is worked out where it is asked for.
        outputs.append({n: done.outputs[n] for n in done.outputs if n not in getattr(done.outputs, "apart", ())})
    return Ran(np.array(times), np.array(T), outputs, state)


def imbalance(outputs: list[dict[str, Any]]) -> float:
    """|sum of all heat terms - sum of stored| over steps, by the sum of their sizes summed over steps."""
    stored = sum(v for o in outputs for k, v in o.items() if k.startswith("heat.stored."))
    rest = [v for o in outputs for k, v in o.items() if k.startswith("heat.") and not k.startswith("heat.stored.")]
    sizes = sum(abs(v) for o in outputs for k, v in o.items() if k.startswith("heat."))
    return float(abs(sum(rest) - stored) / sizes)


def order(errors: list[float]) -> float:
    """Order of convergence from errors at steps each half of the one before, by least squares."""
    return float(-np.polyfit(np.arange(len(errors)), np.log2(errors), 1)[0])


def the_context(interface: Interface, model: dict[str, Any], **given: Any) -> StepContext:
    """What single steps of a half need, with nothing made by mechanics."""
    half, link = load(interface, model), FlatContact()
    inputs = inputs_of(interface, half, **given)
    half.start(inputs, 0.0, link)
    setting = half._scene
    x = interface.nodes
    points = contact_at(half._scene.surfaces, x, inputs, link)
    substep = freeze(setting, setting.masses(x), x, np.zeros(setting.volume.n_cells), points)
    return StepContext(setting, substep, {}, half._calendar, np.zeros(len(x)), Factors())
