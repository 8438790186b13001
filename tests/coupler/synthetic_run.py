"""Runs that no solver made, written through the Recorder: two blocks that approach, press, slide and part."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from contact.half.interface import Interface, Pair
from coupler.record.recorder import Recorder
from coupler.record.results import Results
from coupler.scenario.options import Scheme
from coupler.schemes.accounts import EnergyAccount
from coupler.schemes.ledger import Ledger
from coupler.schemes.levels import Level
from coupler.schemes.state import CoupledState, Solved, Verdict, Work

L, GAP, END = 0.0762, 0.0508, 25000.0
KINKS = (2500.0, 9900.0, 10000.0, 12500.0, 14772.727272727272, 15000.0)
PROBES = {f"lower.top.{n}": {"quantity": "T", "unit": "K"} for n in ("left", "centre", "right")} | {
    "upper.bottom.centre": {"quantity": "T", "unit": "K"}, "gap": {"quantity": "gap", "unit": "m"},
    "pressure": {"quantity": "p", "unit": "Pa"}}
# Heat of one window [J]: what came in differs from what was stored by STORED_OFF, a part in 1e4 of the lot.
TERMS = {"heat.temperature.in": 70.0, "heat.convection": -20.0, "heat.contact.slave": -30.0,
         "heat.contact.master": 30.0, "heat.stored.lower": 35.0, "heat.stored.upper": 14.98}
IMBALANCE = 0.02 / 199.98


@dataclass(frozen=True)
class Case:
    """What to write.  n : cells along an edge.  reject : every so many windows one is rejected (0: none)."""

    windows: int = 40
    frames: int = 8
    n: int = 4
    reject: int = 10
    probes: bool = True
    title: str = "Two blocks that no solver saw"
    message: str = "thermal: no convergence in 25 iterations"
    text: str = "slideline: 2\ntitle: synthetic\n"
    ledger: bool = True
    kinks: tuple[float, ...] = KINKS
    melts: bool = False  # with a solid fraction and a heat flux in its frames


def blocks(n: int, y0: float = L + GAP) -> Interface:
    """Two squares of n x n cells, the upper one's last row of cells cut into triangles."""
    X, Y = np.meshgrid(np.linspace(0, L, n + 1), np.linspace(0, L, n + 1))
    square = np.column_stack([X.ravel(), Y.ravel()])
    i = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    quads = np.column_stack([i, i + 1, i + n + 2, i + n + 1])
    upper = quads + len(square)
    cut = upper[-n:]
    triangles = np.concatenate([cut[:, [0, 1, 2]], cut[:, [0, 2, 3]]])
    low = np.arange(n)
    top, bottom = low + n * (n + 1), low + len(square)
    return Interface(
        "plane", np.concatenate([square, square + np.array([0.0, y0])]),
        np.concatenate([quads, upper[:-n]]).astype(np.int32), triangles.astype(np.int32),
        np.repeat([0, 1], [n * n, n * n - n]).astype(np.int32),
        np.ones(2 * n, dtype=np.int32), ("lower", "upper"), ("steel", "steel"),
        {"lower.top": np.column_stack([top + 1, top]).astype(np.int32),
         "upper.bottom": np.column_stack([bottom, bottom + 1]).astype(np.int32)},
        {}, (Pair("interface", "upper.bottom", "lower.top", 0.1, 6.3e13),))


def level(scene: Interface, t: float) -> Level:
    """Fields at a time [s]: the upper block falls by GAP, then slides; the lower one's top warms."""
    upper = scene.node_body == 1
    fall = np.interp(t, [2500, 10000], [0, GAP])
    slide = np.interp(t, [12500, 15000], [0, 1.1 * L])
    x = scene.nodes + np.where(upper[:, None], [slide, -fall], 0.0)
    warm = np.interp(t, [0, 2500, 9900, 12500, 15000, 17500], [0, 18, 80, 488, 75, 18])
    height = scene.nodes[:, 1]
    T = 273.15 + np.where(upper, 1000 - warm * (1 - (height - height[upper].min()) / L), warm * height / L)
    s = scene.pair_nodes
    p = np.full(len(s), np.interp(t, [10000, 12500, 14772, 15000], [0, 1e7, 1e7, 0]))
    return Level(t, T, x, -p, np.full(len(s), GAP - fall), np.ones(len(s)))


def probes_at(now: Level, n: int) -> np.ndarray:
    top = n * (n + 1)
    own = now.T[[top, top + n // 2, top + n, (n + 1) ** 2 + n // 2]]
    delay = np.array([0.0, -5.0, -9.0, 0.0]) * (12500 < now.t < 15000)
    return np.array([*(own + delay), now.gap[0], -now.t_N[0]])


def header(case: Case) -> dict:
    return {
        "title": case.title, "started": "2026-01-02T03:04:05+00:00",
        "scenario": {"text": case.text, "hash": "abc123", "resolved": {"title": case.title},
                     "file": "s.yaml"},
        "temperature_unit": "degC", "geometry": "plane",
        "halves": {"thermal": "thermal", "mechanical": "elastic"},
        "coupling": {"scheme": "extrapolated", "end": END, "windows": case.windows, "kinks": list(case.kinks),
                     "substeps": {"thermal": 1, "mechanical": 1}},
        "bodies": ["lower", "upper"], "pairs": [vars(p) for p in blocks(1 + 1).pairs],
        "probes": PROBES if case.probes else {},
        "fields": {"thermal": {"point": ["T", *(["f_s"] if case.melts else [])], "cell": ["q"] if case.melts else []},
                   "mechanical": {"point": ["u", "p", "gap"], "cell": ["sigma_v"]}},
        "processes": False, "notes": ["a note of the run"], "machine": "somewhere",
        "versions": {"python": "3.11", "numpy": "2.0"},
    }


def thermal_fields(case: Case, now: Level, cells: int) -> dict[str, np.ndarray]:
    """f_s falls with T; q points up, the last cell of all ten times the others."""
    if not case.melts:
        return {}
    q = np.column_stack([np.zeros(cells), np.full(cells, 1e3 + now.t)])
    q[-1] *= 10
    return {"f_s": np.clip((900 - now.T) / 600, 0, 1), "q": q}


def times_of(case: Case) -> np.ndarray:
    return np.linspace(0.0, END, case.windows + 1)


def record(out: Path, case: Case) -> Recorder:
    """Write header, windows and frames of a run; its end is the caller's."""
    scene = blocks(case.n)
    cells = len(scene.quads) + len(scene.triangles)
    times = times_of(case)
    at = set(np.linspace(0, case.windows, case.frames).round().astype(int).tolist())
    r = Recorder(out, header(case), scene)
    now, ledger = level(scene, 0.0), Ledger()
    r.start(now, probes_at(now, case.n)[: len(header(case)["probes"])])
    if 0 in at:
        r.frame(now, {"sigma_v": np.zeros(cells), **thermal_fields(case, now, cells)})
    for k in range(case.windows):
        t, H = times[k], times[k + 1] - times[k]
        facts = {"t": float(t), "H": float(H), "scheme": "extrapolated", "seconds": 0.05}
        state = CoupledState(now, (), 0, {"E_M": EnergyAccount(np.zeros(cells))})
        if case.reject and k % case.reject == 1:
            no = Solved(Verdict.THERMAL_DISCARD, case.message, state, (), Work(thermal_solves=1), {},
                        scheme=Scheme.EXTRAPOLATED)
            r.window(no, facts | {"H": float(2 * H)}, ledger, probes_at(now, case.n))
        now = level(scene, float(times[k + 1]))
        if case.ledger:
            ledger = ledger.plus(TERMS)
        work = Work(1, 1, 4, 3, 0.02, 0.01, 0.005, 1000)
        monitors = {"touching": 5.0, "max_T": float(now.T.max()), "max_p": float(-now.t_N.min())}
        state = CoupledState(now, (), 0, state.accounts)
        yes = Solved(Verdict.ACCEPTED, "", state, (TERMS,), work, monitors, scheme=Scheme.EXTRAPOLATED)
        r.window(yes, facts, ledger, probes_at(now, case.n)[: len(header(case)["probes"])])
        if k + 1 in at:
            stress = np.full(cells, -float(now.t_N.min())) * (1 + 0.1 * np.arange(cells))
            r.frame(now, {"sigma_v": stress, **thermal_fields(case, now, cells)})
    return r


def write_run(out: Path, case: Case | None = None, outcome: str = "completed", message: str = "") -> Results:
    """A whole run; .05 s a window, .5 s of set-up."""
    record(out, case or Case()).end(outcome, message, {
        "seconds": 0.05 * (case or Case()).windows, "setup_seconds": 0.5,
        "mechanical_heat": {"made": 0.0, "delivered": 0.0, "carried": 0.0}})
    return Results(out)
