"""The pictures of docs/contact.md: `python benchmarks/contact_pictures.py [NAME ...]`, from the page's own scenes.

contact_ripple.svg is drawn by contact_ripple.py.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace

import matplotlib as mpl
import numpy as np
from contact_ripple import interface_of
from contact_runs import PAGE, drive, scenario
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from thermal_page import scenes

from contact.facing import cut_surfaces
from contact.half.register import register_message
from contact.surfaces import edge_frames, surfaces_of
from coupler.report.figures import COLOURS, INK, line_style, new_figure, styled

FOLDER = PAGE.parent / "images"
E, NU, LENGTH, DELTA = 2.0e11, 0.3, 0.1, 1e-7
MODULUS = E / (1 - NU**2)  # of a bar in plane strain, its sides free


def two_panels(*labels: tuple[str, str]) -> tuple[Figure, list[Axes]]:
    """Axes side by side in the house style, with their labels of x and y."""
    figure = new_figure(3.1)
    axes = figure.subplots(1, 2)
    return figure, [styled(ax, *label) for ax, label in zip(axes, labels, strict=True)]


def search() -> Figure:
    """Normals, rays through master nodes, pieces and facing points of two curved surfaces."""
    a, b = np.linspace(0.0, 1.0, 5), np.linspace(1.05, 0.15, 7)
    slave = np.column_stack([a, 0.34 + 0.55 * (a - 0.5) ** 2])
    master = np.column_stack([b, 0.12 + 0.10 * np.sin(5.0 * b)])
    interface = interface_of(slave, master, by_node=False)
    interface = replace(interface, pairs=tuple(replace(p, gap_max=1.0) for p in interface.pairs))
    message = register_message(interface)
    x, surfaces = interface.nodes, surfaces_of(message)
    cut = cut_surfaces(surfaces, x)  # by the rays of forces
    normal = edge_frames(x, message.edges, surfaces.previous, surfaces.following)[1]
    figure = new_figure(3.4, 6.4)
    ax = styled(figure.subplots(), "x", "y")
    ax.plot(*master.T, "-s", color=COLOURS[1], markersize=5, label="master")
    ax.plot(*slave.T, "-o", color=COLOURS[0], markersize=6, label="slave")
    for e in range(4):
        for k in range(2):
            ax.annotate("", slave[e + k] + 0.09 * normal[e, 1 + k], slave[e + k],
                        arrowprops={"arrowstyle": "->", "color": COLOURS[0], "lw": 0.9})
    P, M = ((1.0 - xi)[:, None] * x[message.edges[edge, 0]] + xi[:, None] * x[message.edges[edge, 1]]
            for edge, xi in zip(cut.met.T, cut.values.T, strict=False))
    for p, m in zip(P, M, strict=True):
        ax.plot(*np.array([p, m]).T, color=INK, linewidth=0.6, linestyle=":")
    ax.plot(*P.T, "x", color=INK, markersize=5, label="facing points")
    ax.plot(*M.T, "x", color=INK, markersize=4, alpha=0.6)
    for p, q in zip(P[::2], P[1::2], strict=True):
        for end in (0.5 * (p + q) - 0.5 * np.sqrt(3.0) * (q - p), 0.5 * (p + q) + 0.5 * np.sqrt(3.0) * (q - p)):
            ax.plot(*end, "|", color=COLOURS[2], markersize=15, markeredgewidth=1.6)
    ax.plot([], [], "|", color=COLOURS[2], markersize=11, markeredgewidth=1.6, label="cuts")
    ax.set_aspect("equal")
    ax.legend(frameon=False, fontsize=8.5, labelcolor=INK, ncols=4, loc="upper center", bbox_to_anchor=(0.5, 1.16))
    return figure


def penalty() -> Figure:
    """Missing pressure against the penalty, plain and augmented; penetration round by round."""
    figure, (left, right) = two_panels((r"penalty $\epsilon_N L/E$", "missing pressure (share)"),
                                       ("round", "penetration / squeeze"))
    exact = MODULUS * DELTA / LENGTH
    ratios = np.geomspace(1.0, 1e3, 10)
    for k, (name, more) in enumerate({"penalty alone": {}, "augmented, 1e-3": {"augmented": {"tolerance": 1e-3}},
                                      "augmented, 1e-5": {"augmented": {"tolerance": 1e-5}}}.items()):
        low = []
        for ratio in ratios:
            face = {"penalty": float(ratio * MODULUS / LENGTH), **more}
            ran = drive(scenario("base", contact={"face": face}), 1)
            low.append(abs(1.0 + ran.of("contact.t_N")[-1].mean() / exact))
        left.loglog(ratios, low, "o", color=COLOURS[k], markersize=4, label=name)
    left.loglog(ratios, 1.0 / (1.0 + ratios), color=INK, linewidth=0.8, linestyle=":", label=r"$1/(1+\epsilon_N L/E)$")
    left.legend(frameon=False, fontsize=8.5, labelcolor=INK)
    for k, ratio in enumerate((1.0, 10.0, 100.0)):
        # A tolerance that asks for nothing: one round a step, and two in the first.
        face = {"penalty": float(ratio * MODULUS / LENGTH), "augmented": {"tolerance": 0.999, "method": "uzawa"}}
        longer = {"end": 6.0, "windows": [{"until": 6.0, "size": 1.0}]}
        ran = drive(scenario("base", contact={"face": face}, coupling=longer), 6)
        gap = -ran.of("contact.gap").mean(axis=1) / DELTA
        right.semilogy(np.arange(2, 8), gap, "o", color=COLOURS[k], markersize=4)
        right.semilogy(np.arange(1, 8), (1.0 + ratio) ** -np.arange(1.0, 8.0), color=COLOURS[k], linewidth=0.9,
                       label=rf"$\epsilon_N L/E = {ratio:g}$")
    right.set_ylim(1e-8, 1.5)
    right.legend(frameon=False, fontsize=8.5, labelcolor=INK)
    return figure


def friction() -> Figure:
    """Stick and slip there and back, and the heat."""
    figure, (left, right) = two_panels(("way of the upper block's top [um]", "drag / pressing force"),
                                       ("time [s]", "friction heat [J/m]"))
    base = scenes(PAGE)["friction"]["mechanical"]["elastic"]["boundary"][1]["u_x"]
    for k, (name, stick) in enumerate({"stick: auto": "auto", "stick: 2.0e12": 2.0e12}.items()):
        ran = drive(scenario("friction", contact={"face": {"friction": {"stick": stick}}}), 180)
        force = ran.of("reaction.upper")
        after = ran.t >= 1.0
        way = np.interp(ran.t, base["t"], base["value"])
        left.plot(1e6 * way[after], force[after, 0] / -force[after, 1], label=name, **line_style(k))
        right.plot(ran.t, np.cumsum(ran.of("contact.E_friction").sum(axis=1)), label=name, **line_style(k))
    for bound in (-0.3, 0.3):
        left.axhline(bound, color=INK, linewidth=0.8, linestyle=":")
    left.legend(frameon=False, fontsize=8.5, labelcolor=INK, loc="lower right", bbox_to_anchor=(1.0, 0.06))
    return figure


PICTURES: dict[str, Callable[[], Figure]] = {f.__name__: f for f in (search, penalty, friction)}


def main(names: list[str]) -> None:
    """Draw the pictures of these names, or all."""
    mpl.rcParams |= {"svg.fonttype": "none", "svg.hashsalt": "slideline", "font.family": "sans-serif"}
    for name in names or PICTURES:
        PICTURES[name]().savefig(FOLDER / f"contact_{name}.svg", metadata={"Date": None})
        print(name, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
