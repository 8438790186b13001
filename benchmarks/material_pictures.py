"""Pictures of what materials do, from the functions the mechanical half computes with: docs/images/materials.svg.

    python benchmarks/material_pictures.py [FILE.svg]

One point is drawn with nothing on its sides (hardening, cycles, rates), held at its length (relaxation), or held and
cooled through its mush (solidification).
"""

from __future__ import annotations

import sys
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from matplotlib import rcParams
from numba import njit
from numpy.typing import NDArray

from coupler.report.figures import line_style, new_figure, styled
from mechanical_fmu.laws.law import history_size
from mechanical_fmu.material import moduli
from mechanical_fmu.point import update
from mechanical_fmu.problem import parse_material

Floats = NDArray[np.float64]
STEEL = {"E": 2e11, "nu": 0.3}
NORMAL = np.array([1.0, 1.0, 0.0, 1.0])
TARGET = Path(__file__).resolve().parent.parent / "docs/images/materials.svg"


def pulled(spec: dict[str, Any], axial: Floats, t: Floats, T: Floats | None = None) -> Floats:
    """Axial stress [Pa] of a point with free sides along strains axial : (n,) at times t [s] and temperatures T [K]."""
    material = parse_material("m", {**STEEL, **spec})
    h, E, out = np.zeros(history_size(material.kind)), np.zeros(4), np.empty(len(t))
    for k, strain in enumerate(axial):
        now = np.array([300.0 if T is None else T[k]])
        found = moduli((material,), np.zeros(1, np.intp), now)
        kappa, e_th, dt = found.kappa[0], found.e_th[0, 0], t[k] - (t[k - 1] if k else 0.0)
        E[0] = strain
        for _ in range(40):
            S, D, after = np.empty(4), np.empty((4, 4)), np.empty_like(h)
            update(material.kind, found.p[0], found.tables, E, dt, h, after, S, D)
            S += kappa * (E @ NORMAL - e_th) * NORMAL
            D += kappa * np.outer(NORMAL, NORMAL)
            if np.abs(S[1:]).max() <= 1e-8 * np.abs(S).max():
                break
            E[1:] -= np.linalg.solve(D[1:, 1:], S[1:])
        h, out[k] = after, S[0]
    return out


def hardening(ax: Any) -> None:
    e = np.linspace(0.0, 0.3, 200)
    table = {"law": "table", "strain": [0, 0.02, 0.1, 0.25], "stress": [3e8, 3.2e8, 4.6e8, 5e8]}
    laws = {"perfect": {"s_y": 3e8}, "linear": {"s_y": 3e8, "hardening": {"law": "linear", "H": 1e9}},
            "voce": {"s_y": 3e8, "hardening": {"law": "voce", "Q": 2e8, "b": 17.0}}, "table": {"hardening": table}}
    for k, (name, plastic) in enumerate(laws.items()):
        ax.plot(e, pulled({"plastic": plastic}, e, e) / 1e6, label=name, **line_style(k))
    styled(ax, "strain", "stress [MPa]").set_title("hardening", fontsize=10)


def cycles(ax: Any) -> None:
    turn = np.concatenate([np.linspace(0, 0.01, 60), np.linspace(0.01, -0.01, 120), np.linspace(-0.01, 0.01, 120)])
    kinds = {"isotropic": {"hardening": {"law": "linear", "H": 8e9}}, "C": {"kinematic": {"C": 8e9}},
             "C, gamma": {"kinematic": {"C": 6e10, "gamma": 400.0}}}
    for k, (name, rest) in enumerate(kinds.items()):
        ax.plot(100 * turn, pulled({"plastic": {"s_y": 2.5e8, **rest}}, turn, np.arange(len(turn))) / 1e6, label=name,
                **line_style(k))
    styled(ax, "strain [%]", "stress [MPa]").set_title("there and back", fontsize=10)


def rates(ax: Any) -> None:
    rate = np.geomspace(1e-8, 1.0, 25)
    laws = {"creep A, n": {"creep": {"A": 1e-40, "n": 4.0}}, "creep K, m": {"creep": {"K": 1e9, "m": 0.5}},
            "overstress": {"plastic": {"s_y": 2e8, "overstress": {"K": 1e8, "m": 0.2}}}}
    for k, (name, spec) in enumerate(laws.items()):
        steady = [pulled(spec, np.linspace(0, 0.5, 30), np.linspace(0, 0.5, 30) / r)[-1] for r in rate]
        ax.loglog(rate, np.array(steady) / 1e6, label=name, **line_style(k))
    styled(ax, "strain rate [1/s]", "steady stress [MPa]").set_title("rate", fontsize=10)


def relaxation(ax: Any) -> None:
    t = np.concatenate([[0.0], np.geomspace(10.0, 1e7, 200)])
    for k, n in enumerate((3.0, 4.0, 5.0)):
        held = pulled({"E": 1.5e11, "creep": {"A": 1e-8 * 1e8**-n, "n": n}}, np.full(len(t), 1e8 / 1.5e11), t)
        ax.semilogx(t[1:], held[1:] / 1e6, label=f"n = {n:g}", **line_style(k))
    styled(ax, "time [s]", "stress [MPa]").set_title("held at its length: creep", fontsize=10)


def heat(ax: Any) -> None:
    T = 300.0 + np.concatenate([np.linspace(0, 300, 80), np.linspace(300, 0, 80)])
    kinds = {"elastic": 1e12, "yield 250 MPa": 2.5e8, "yield falls with T": {"T": [300, 600], "value": [2.5e8, 1e8]}}
    for k, (name, s0) in enumerate(kinds.items()):
        plastic = {"s_y": s0, "hardening": {"law": "linear", "H": 2e9}}
        stress = pulled({"alpha": 1.2e-5, "T_ref": 300.0, "plastic": plastic}, 0 * T, np.arange(len(T)), T)
        ax.plot(T, stress / 1e6, label=name, **line_style(k))
    styled(ax, "temperature [K]", "stress [MPa]").set_title("held, heated and cooled", fontsize=10)


def solidification(ax: Any) -> None:
    T = np.linspace(1000.0, 700.0, 150)
    for k, shrinkage in enumerate((0.0, 0.002)):
        liquid = {"eta": 1e3, "bulk": 5e10, "T_s": 820.0, "T_l": 920.0, "shrinkage": shrinkage}
        stress = pulled({"E": 5e10, "alpha": 2e-5, "T_ref": 300.0, "liquid": liquid},
                        np.full(len(T), np.log(1.0 + 2e-5 * 700 + shrinkage)), np.arange(len(T)), T)
        ax.plot(T, stress / 1e6, label=f"shrinkage {shrinkage:g}", **line_style(k))
    ax.axvspan(820.0, 920.0, color="#eeeeee", zorder=0)
    styled(ax, "temperature [K]", "stress [MPa]").set_title("held and solidified (grey: mush)", fontsize=10)


@njit
def repeated(n: int, kind: int, p: Floats, tables: Floats, E: Floats, h_n: Floats, h: Floats, S: Floats,
             D: Floats) -> float:
    total = 0.0
    for _ in range(n):
        total += update(kind, p, tables, E, 1.0, h_n, h, S, D)[1]
    return total


def speed() -> None:
    """Print nanoseconds of one update of every kind, flowing."""
    voce = {"s_y": 2.5e8, "hardening": {"law": "voce", "Q": 2e8, "b": 17.0}}
    creep, liquid = {"A": 1e-40, "n": 4.0}, {"eta": 1e6, "bulk": 5e10, "T_s": 200.0, "T_l": 500.0}
    kinds: dict[str, dict[str, Any]] = {
        "perfectly plastic": {"plastic": {"s_y": 2.5e8}}, "voce": {"plastic": voce},
        "voce, C, gamma": {"plastic": {**voce, "kinematic": {"C": 5e10, "gamma": 300.0}}},
        "voce, overstress": {"plastic": {**voce, "overstress": {"K": 5e7, "m": 0.1}}},
        "creep": {"creep": creep}, "voce, creep": {"plastic": voce, "creep": creep},
        "voce in the mush": {"plastic": voce, "liquid": liquid}}
    E = np.array([0.01, -0.004, 0.003, -0.003])
    for name, spec in kinds.items():
        m = parse_material("m", {**STEEL, **spec})
        found, h = moduli((m,), np.zeros(1, np.intp), np.array([300.0])), np.zeros(history_size(m.kind))
        rest = (m.kind, found.p[0], found.tables, E, h, h.copy(), np.empty(4), np.empty((4, 4)))
        repeated(1, *rest)
        times = []
        for _ in range(7):
            begin = process_time()
            repeated(10000, *rest)
            times.append((process_time() - begin) / 10000)
        print(f"{name:20} {1e9 * min(times):6.0f} ns")


def main() -> None:
    rcParams["svg.hashsalt"] = "slideline"
    figure = new_figure(5.6)
    axes = figure.subplots(2, 3).ravel()
    for draw, ax in zip((hardening, cycles, rates, relaxation, heat, solidification), axes, strict=True):
        draw(ax)
        ax.legend(frameon=False, fontsize=8)
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else TARGET
    figure.savefig(target, metadata={"Date": None})  # equal numbers make equal files
    speed()


if __name__ == "__main__":
    main()
