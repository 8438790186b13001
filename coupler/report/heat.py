"""Where the heat went: the ledger over time and in total."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupler.record.results import Results, depth_of
from coupler.report.curves import kinks_of
from coupler.report.figures import (
    COLOURS,
    DASHES,
    Picture,
    Shown,
    axes_of,
    draw_kinks,
    legend_below,
    number,
    page_figure,
    plain,
    shown,
    svg,
)
from coupler.report.pack import Chart, Curve
from coupler.schemes.ledger import PREFIX, mechanism

Array = NDArray[np.float64]
STORED = "stored."
POINTS = 200  # of a curve of the still picture
DIGITS = 6  # of the largest heat of a table
# What leaves one side enters the other; friction is not among them, both sides get heat.
SIDES = {"contact": "solid contact", "gap": "gas gap", "near_radiation": "near radiation"}


@dataclass(frozen=True)
class HeatTable:
    """Rows (name, heat) of what came in and of what is stored; sides : (name, slave, master, misfit) of interfaces."""

    unit: str
    came_in: list[tuple[str, str]]
    stored: list[tuple[str, str]]
    total_in: str
    total_stored: str
    sides: list[tuple[str, str, str, str]]
    imbalance: str


def heat_table(results: Results) -> HeatTable | None:
    """Totals of the run, or None if it kept no ledger or moved no heat."""
    _, history = results.ledger_history()
    # A mechanism that never moved heat is not part of the scene; what a body stored is told even where it is 0.
    ledger = {n: e for n, e in results.ledger.items() if n.startswith(STORED) or np.any(history[n])}
    if not any(np.any(history[n]) for n in ledger):
        return None
    scale = shown("J", max(abs(e) for e in ledger.values()))
    digits = _decimals(scale(np.array(list(ledger.values()))))

    def rows(stored: bool) -> list[tuple[str, str]]:
        return [(mechanism(PREFIX + n), _in(scale, e, digits)) for n, e in ledger.items()
                if n.startswith(STORED) == stored]

    def total(stored: bool) -> str:
        return _in(scale, sum(e for n, e in ledger.items() if n.startswith(STORED) == stored), digits)

    return HeatTable(scale.unit, rows(False), rows(True), total(False), total(True), _sides(ledger, scale, digits),
                     number(results.heat_imbalance, 2))


def _decimals(heats: Array) -> int:
    """Decimals with which the largest heat has six digits, less where all end in zeros: columns add up by eye."""
    most = max(DIGITS - 1 - int(np.floor(np.log10(np.abs(heats).max()))), 0)
    whole = np.round(heats, most)
    return next(n for n in range(most + 1) if (np.abs(np.round(heats, n) - whole) < 0.1 * 10.0**-most).all())


def _in(scale: Shown, energy: float, decimals: int) -> str:
    # fault: every heat has decimals of its own -> text = number(float(scale(np.array(energy))), DIGITS) |
    #   coupler/test_report
    text = f"{float(scale(np.array(energy))):.{decimals}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text


def _sides(ledger: Mapping[str, float], scale: Shown, digits: int) -> list[tuple[str, str, str, str]]:
    """What each side of an interface got, taken from its own numbers, and how far the two are from cancelling."""
    rows = []
    for term, name in SIDES.items():
        slave, master = ledger.get(f"{term}.slave"), ledger.get(f"{term}.master")
        if slave is None or master is None:
            continue
        size = abs(slave) + abs(master)
        misfit = abs(slave + master) / size if size else 0.0
        rows.append((name, _in(scale, slave, digits), _in(scale, master, digits), number(misfit, 2)))
    return rows


def heat_picture(results: Results) -> Picture | None:
    """The ledger stacked by mechanism over time, with what the bodies stored as lines."""
    t, terms = results.ledger_history()
    largest = max((float(np.abs(v).max(initial=0.0)) for v in terms.values()), default=0.0)
    if len(t) < 2 or largest == 0.0:
        return None
    by = {n: v for n, v in terms.items() if not n.startswith(STORED) and np.any(v)}
    kept = {n: v for n, v in terms.items() if n.startswith(STORED)}
    scale, every = shown("J", largest), t
    # Bands of many points are most of the size of a page, and a picture is not as wide.
    some = np.unique(np.linspace(0, len(t) - 1, min(len(t), POINTS)).round().astype(int))
    t = t[some]
    figure = page_figure(4.8)
    ax = axes_of(figure, "time [s]", f"heat into the bodies so far [{scale.unit}]\n{depth_of(results)}")
    flows = {n: scale(v[some]) for n, v in by.items()}
    up, down = np.zeros(len(t)), np.zeros(len(t))
    for k, (name, value) in enumerate(flows.items()):
        gain, loss = np.maximum(value, 0.0), np.minimum(value, 0.0)
        look: dict[str, Any] = {
            "facecolor": COLOURS[k % len(COLOURS)], "alpha": 0.55 if k < len(COLOURS) else 0.3, "linewidth": 0}
        ax.fill_between(t, up, up + gain, label=plain(mechanism(PREFIX + name)), **look)
        ax.fill_between(t, down, down + loss, **look)
        up, down = up + gain, down + loss
    stored = {n: scale(v[some]) for n, v in kept.items()}
    for k, (name, value) in enumerate(stored.items()):
        ax.plot(t, value, color="black", linewidth=1.3, linestyle=DASHES[(k + 1) % len(DASHES)],
                label=plain(mechanism(PREFIX + name)))
    if len(stored) > 1:
        ax.plot(t, sum(stored.values(), np.zeros(len(t))), color="black", linewidth=1.6, label="stored in all")
    ax.axhline(0.0, color="black", linewidth=0.6)
    ax.set_xlim(float(t[0]), float(t[-1]))
    draw_kinks(ax, kinks_of(results))
    legend_below(figure, ax, columns=3)
    alt = f"Heat into the bodies by mechanism over time, {depth_of(results)}; totals are in the table."
    curves = [Curve(mechanism(PREFIX + n), scale(v)) for n, v in (*by.items(), *kept.items())]
    caption = ("Heat into the bodies by each mechanism since the start, above zero into the bodies, below zero out of "
               "them, and what the bodies stored.")
    return replace(svg(figure, alt, caption),
                   chart=Chart(f"heat so far [{scale.unit}]", alt, every, curves, 320))
