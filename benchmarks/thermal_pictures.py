"""The pictures of docs/thermal.md: `python benchmarks/thermal_pictures.py [NAME ...]`, from runs of the thermal half.

Each is drawn from the scene of its section, or from the contact laws the half evaluates; one plain style for all.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from itertools import pairwise

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation
from scipy.optimize import brentq
from thermal_cases import Stefan
from thermal_page import PAGE
from thermal_runs import Array, drive, scenario

from contact.half.functions import property_from
from contact.laws import closed_conductance, gap_factor, open_conductance, parse_law
from contact.problem.thermal import SIGMA_SB
from coupler.report.figures import COLOURS, INK, line_style, new_figure, styled

FOLDER = PAGE.parent / "images"
MM = 1e3
T_LABEL, X_LABEL, TIME = "temperature [K]", "x [mm]", "time [s]"


def panels(*labels: tuple[str, str]) -> tuple[Figure, list[Axes]]:
    """Axes side by side in the house style, with their labels of x and y."""
    figure = new_figure(2.9, 4.6 * len(labels))
    axes = np.atleast_1d(figure.subplots(1, len(labels))).tolist()
    return figure, [styled(ax, *label) for ax, label in zip(axes, labels, strict=True)]


def legend(ax: Axes, where: str = "best") -> None:
    """A legend without a box."""
    ax.legend(frameon=False, fontsize=8.5, loc=where, labelcolor=INK)


def conduction() -> Figure:
    """k(T), and what it makes of the profile."""
    figure, (left, right) = panels((T_LABEL, "conductivity [W/mK]"), (X_LABEL, T_LABEL))
    spec = scenario("conduction").models["thermal"]["materials"]["steel"]["k"]
    law = parse_law({"law": "table", "x": spec["T"], "h": spec["value"], "variable": "T"})  # the same straight lines
    T = np.linspace(280, 520, 200)
    left.plot(T, open_conductance(law, np.zeros(200), T)[0], **line_style(0))
    left.plot(spec["T"], spec["value"], "o", color=COLOURS[0])
    run = drive(scenario("conduction"))
    plain = drive(scenario("conduction", materials={"steel": {"k": 30.0, "c": 480.0}}))
    for k, t in enumerate((10, 50, 400)):
        x, T = run.along(t)
        right.plot(MM * x, T, color=COLOURS[k], label=f"{t} s")
    x, T = plain.along(400)
    right.plot(MM * x, T, color=INK, linestyle=":", label="400 s, k = 30 W/mK")
    legend(right)
    return figure


def axes() -> Figure:
    """Isotherms around a hot spot."""
    run = drive(scenario("axes"))
    figure = new_figure(3.6, 4.2)
    ax = styled(figure.subplots(), X_LABEL, "y [mm]")
    shades = ax.tricontour(Triangulation(*(MM * run.X.T)), run.T[-1], levels=[302, 305, 310, 320, 340, 370],
                           cmap="plasma", vmin=290, vmax=440, linewidths=1.8)
    ax.clabel(shades, fmt="%g K", fontsize=8)
    a = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6)])
    ax.plot(*np.array([50 - 56 * a, 50 + 56 * a]).T, color=INK, linewidth=0.8, linestyle=":")
    ax.text(66, 55.5, "axis 1", color=INK, fontsize=9, rotation=30)
    ax.set(aspect="equal", xlim=(0, 100), ylim=(0, 100))
    return figure


def front(t: Array) -> Array:
    """[m] of two-phase freezing into a half-space at t [s] (Neumann), with the data of the scene."""
    model = scenario("melting").models["thermal"]
    m = model["materials"]["steel"]
    two = {f"{key}_{phase[0]}": m[key][phase] for key in ("k", "c") for phase in ("solid", "liquid")}
    known = Stefan(rho=m["rho"], **two, L=m["latent"]["L"], T_m=m["latent"].get("T_m", m["latent"].get("T_s")),
                   wall=model["boundary"][0]["temperature"], melt=model["bodies"]["bar"]["T0"])
    return np.array([known.front(s) for s in t])


def melting() -> Figure:
    """Profiles, and the front from the solid fraction against the closed form."""
    run = drive(scenario("melting"))
    figure, (left, right) = panels((X_LABEL, T_LABEL), (TIME, "front [mm]"))
    for k, t in enumerate((1, 3, 10)):
        x, T = run.along(t)
        left.plot(MM * x, T, color=COLOURS[k], label=f"{t} s")
    left.axhline(933, color=INK, linewidth=0.8, linestyle=":", label="T_m")
    left.set_xlim(0, 100)
    legend(left, "lower right")
    t = run.t[1:]
    row = np.flatnonzero(run.X[:, 1] == 0)
    right.plot(t, [MM * np.trapezoid(f[row], run.X[row, 0]) for f in run.of("f_s")], **line_style(0),
               label="half: integral of f_s")
    right.plot(t, MM * front(t), **line_style(1), label="closed form")
    legend(right, "lower right")
    return figure


def source() -> Figure:
    """A bar heated in its middle."""
    run = drive(scenario("source"))
    figure, (left, right) = panels((X_LABEL, T_LABEL), (TIME, T_LABEL))
    for k, t in enumerate((10, 40, 60, 100)):
        x, T = run.along(t)
        left.plot(MM * x, T, color=COLOURS[k], label=f"{t} s")
    legend(left)
    for k, x in enumerate((0.05, 0.03, 0.0)):
        right.plot(run.t, run.at(x), **line_style(k), label=f"x = {MM * x:g} mm")
    legend(right)
    return figure


def prescribed() -> Figure:
    """Both ends and the middle in time."""
    run = drive(scenario("prescribed"))
    figure, (ax,) = panels((TIME, T_LABEL))
    places = ((0.0, "left: flux from 20 s to 60 s"), (0.05, "middle"), (0.1, "right: prescribed"))
    for k, (x, name) in enumerate(places):
        ax.plot(run.t, run.at(x), **line_style(k), label=name)
    legend(ax)
    return figure


def convection() -> Figure:
    """Exponents, from runs of one short step; kappa, from the law."""
    figure, (left, right) = panels(("T - T_e [K]", "flux q_CF [kW/m2]"), ("gap g_N [mm]", "kappa [1]"))
    excess = np.linspace(-200, 200, 17)
    for k, (a, h) in enumerate(((0.0, 40.0), (0.25, 10.6), (1 / 3, 6.8))):
        film = {"boundary": [{"on": "bar.right", "convection": {"h": h, "T": 300.0, "exponent": a}}]}
        q = [one_step("convection", float(dT), film) for dT in excess]
        left.plot(excess, q, **line_style(k), label=f"exponent {a:.2g}, h = {h:g}")
    legend(left)
    g = np.linspace(0, 8e-3, 161)
    right.plot(MM * g, gap_factor(g, 1e-3, 6e-3), **line_style(0))
    for at, name in ((1.0, "d_cut"), (6.0, "d_full")):
        right.axvline(at, color=INK, linewidth=0.8, linestyle=":")
        right.text(at + 0.1, 0.5, name, color=INK, fontsize=9)
    return figure


def one_step(name: str, excess: float, thermal: dict[str, object]) -> float:
    """Flux out of the bar's right end [kW/m2] when it is `excess` [K] above 300 K, from a step of a microsecond."""
    run = drive(scenario(name, bodies={"bar": {"T0": 300.0 + excess}}, thermal=thermal), [1e-6])
    return -float(run.of("heat.convection")[0]) / (0.01 * 1e-6) / 1e3


def radiation() -> Figure:
    """Cooling by radiation and by a film of the same first flux."""
    run = drive(scenario("radiation"))
    h = SIGMA_SB * 0.8 * (1200**4 - 300**4) / 900
    film = {"boundary": [{"on": "bar.right", "convection": {"h": h, "T": 300.0}}]}
    plain = drive(scenario("radiation", thermal=film))
    figure, (ax,) = panels((TIME, T_LABEL))
    ax.plot(run.t, run.at(0.01), **line_style(0), label="radiation, emissivity 0.8, to 300 K")
    ax.plot(plain.t, plain.at(0.01), **line_style(1), label=f"film, h = {h:.4g} W/m2K")
    legend(ax)
    return figure


def near() -> Figure:
    """What leaves the hot side against the gap: a step of a microsecond at each."""
    gaps = np.linspace(0.0, 14e-3, 29)
    rows = []
    for g in gaps:
        plate = {"plate": {"mesh": {"rectangle": {"origin": [0.02 + float(g), 0.0]}}}}
        run = drive(scenario("near", bodies=plate), [1e-6])
        rows.append([-float(run.of(f"heat.{n}")[0]) / (0.02e-6 * 1e3) for n in ("near_radiation.slave", "radiation")])
    q = np.array(rows)
    figure, (ax,) = panels(("gap g_N [mm]", "flux [kW/m2]"))
    ax.plot(MM * gaps, q[:, 0], **line_style(0), label="near radiation, out of the bar")
    ax.plot(MM * gaps, q[:, 1], **line_style(1), label="far radiation, both surfaces")
    for at, name in ((2.0, "d_near"), (10.0, "d_far")):
        ax.axvline(at, color=INK, linewidth=0.8, linestyle=":")
        ax.text(at + 0.1, 0.5 * q.max(), name, color=INK, fontsize=9)
    legend(ax, "upper left")
    return figure


def contact() -> Figure:
    """Laws of the pressure and of the gap."""
    figure, (left, right) = panels(("pressure p_N [MPa]", "h_CI touching [kW/m2K]"),
                                   ("gap g_N [µm]", "h_CI apart [kW/m2K]"))
    p, g = np.linspace(0, 20e6, 201), np.linspace(0, 300e-6, 201)
    laws = {"constant": {"law": "constant", "h": 2000.0},
            "power, to p_max": {"law": "power", "h0": 2000.0, "h1": 6000.0, "p0": 1e7, "exponent": 0.95, "p_max": 1e7},
            "cmy": {"law": "cmy", "k_s": 74.0, "m": 0.1, "sigma": 2e-6, "H": 3e9},
            "sum: constant and cmy": scenario("contact").models["thermal"]["pairs"]["face"]["conduction"]["closed"]}
    for k, (name, spec) in enumerate(laws.items()):
        left.plot(p / 1e6, closed_conductance(parse_law(spec), p, 350.0)[0] / 1e3, **line_style(k), label=name)
    legend(left)
    for k, g_m in enumerate((10e-6, 25e-6, 100e-6)):
        law = parse_law({"law": "gas", "k_g": 0.05, "g_m": g_m})
        h = open_conductance(law, g, 350.0)[0]
        right.plot(1e6 * g, h / 1e3, **line_style(k), label=f"gas, g_m = {1e6 * g_m:g} µm")
    legend(right)
    return figure


def friction() -> Figure:
    """Both surfaces in time, and the profile."""
    scene = scenario("friction")
    E = np.full(len(scene.interface.pair_nodes), 0.0)
    slave = np.isin(scene.interface.pair_nodes, scene.interface.surfaces["bar.right"])
    E[slave] = 150e3 * 0.01 * 0.1 / slave.sum()
    run = drive(scene, contact_t_N=-1e6, contact_E_friction=E)
    figure, (left, right) = panels((TIME, "surface above start [K]"), (X_LABEL, T_LABEL))
    ends = [int(np.flatnonzero((run.X[:, 0] == 0.2) & (scene.interface.node_body == b))[0]) for b in (0, 1)]
    rise = 2 * 0.3649158 * 150e3 * np.sqrt(run.t / (np.pi * 45 * 7800 * 480))
    for k, (node, name) in enumerate(zip(ends, ("steel", "aluminium"), strict=True)):
        left.plot(run.t, run.T[:, node] - 300, **line_style(k), label=name)
    left.plot(run.t, rise, color=INK, linestyle=":", label="half-spaces, closed form")
    legend(left)
    for k, t in enumerate((1, 10)):
        x, T = run.along(t)
        right.plot(MM * x, T, color=COLOURS[k], label=f"{t} s")
    right.set_xlim(100, 300)
    right.text(140, 313, "steel", color=INK)
    right.text(235, 310, "aluminium", color=INK)
    legend(right)
    return figure


METHODS = ("midpoint", "sdirk2", "theta 0.75", "backward_euler")


def methods() -> Figure:
    """Error at the end against the number of steps, after the first 16 s in steps of 1/8 s for all."""
    figure, (ax,) = panels(("steps from 16 s to 128 s", "largest error [K]"))
    start = np.full(128, 0.125)

    def end(method: str, n: int) -> Array:
        word, _, theta = method.partition(" ")
        more = {"method": word, "theta": float(theta) if theta else None}
        return drive(scenario("methods", thermal=more), np.append(start, np.full(n, 112 / n))).T[-1]

    counts = (4, 8, 16, 32, 64)
    exact = end("sdirk2", 512)
    for k, method in enumerate(METHODS):
        error = [float(np.abs(end(method, n) - exact).max()) for n in counts]
        slope = np.log2(error[-2] / error[-1])
        ax.loglog(counts, error, marker="o", **line_style(k), label=f"{method}: order {slope:.2f}")
    ax.set_xticks(counts, [str(n) for n in counts])
    ax.minorticks_off()
    legend(ax)
    return figure


def steady() -> Figure:
    """The profile against Kirchhoff's: what radiates at the end enters at the wall, and int k dT is linear between."""
    scene = scenario("steady")
    run, model = drive(scene), scene.models["thermal"]
    k, wall, end = property_from(model["materials"]["steel"]["k"]), *model["boundary"]
    length = float(run.X[:, 0].max())
    far = end["radiation"]
    T_w, T_inf, strength = wall["temperature"], far["T"], length * far["emissivity"] * SIGMA_SB

    def moved(T: Array) -> Array:
        return k.increase(T, np.full(np.shape(T), T_w))

    T_end = brentq(lambda T: float(moved(np.array(T))) - strength * (T**4 - T_inf**4), T_inf, T_w)
    line = np.linspace(T_end, T_w, 200)
    figure, (ax,) = panels((X_LABEL, T_LABEL))
    ax.plot(MM * length * moved(line) / moved(line[0]), line, color=INK, linewidth=1, label="closed form")
    ax.plot(MM * run.X[::2, 0], run.T[-1, ::2], "o", color=COLOURS[0], markersize=4, label="half")
    ax.plot([0, MM * length], [T_w, T_end], color=INK, linestyle=":", label="straight, as of a constant k")
    legend(ax)
    return figure


def adaptive() -> Figure:
    """Temperature under a pulse, and the inner steps it took."""
    scene = scenario("adaptive")
    run, fine = drive(scene), drive(scenario("adaptive", thermal={"adaptive": None}), 0.05)
    figure, (left, right) = panels((TIME, T_LABEL), (TIME, "inner steps in a substep"))
    left.plot(fine.t, fine.at(0.0), color=INK, linewidth=1, label="steps of 0.05 s")
    left.plot(run.t, run.at(0.0), "o", color=COLOURS[1], markersize=4, label="substeps of 10 s, cut by the half")
    legend(left)
    for (a, b), n in zip(pairwise(run.t), run.of("substeps"), strict=True):
        right.bar(0.5 * (a + b), n, width=0.8 * (b - a), color=COLOURS[0])
    return figure


PICTURES: dict[str, Callable[[], Figure]] = {f.__name__: f for f in (
    conduction, axes, melting, source, prescribed, convection, radiation, near, contact, friction, methods, steady,
    adaptive)}


def main(names: list[str]) -> None:
    """Draw the pictures of these names, or all."""
    mpl.rcParams |= {"svg.fonttype": "none", "svg.hashsalt": "slideline", "font.family": "sans-serif"}
    for name in names or PICTURES:
        PICTURES[name]().savefig(FOLDER / f"thermal_{name}.svg", metadata={"Date": None})


if __name__ == "__main__":
    main(sys.argv[1:])
