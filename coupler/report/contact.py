"""Contact along the interface over time: where a slave surface is open, touches, sticks or slips, a picture a pair."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.patches import Patch
from numpy.typing import NDArray

from coupler.record.results import Along, Results
from coupler.report.curves import kinks_of
from coupler.report.figures import (
    COLOURS,
    INK,
    PageFigure,
    Picture,
    axis_names,
    draw_kinks,
    legend_below,
    number,
    page_figure,
    plain,
    png,
    shown,
)

Array = NDArray[np.float64]
Codes = NDArray[np.int8]

ALONE, OPEN, TOUCHES, STICKS, SLIPS, TIED = range(6)
WORDS = {ALONE: "faces nothing", OPEN: "open", TOUCHES: "touches", STICKS: "sticks", SLIPS: "slips", TIED: "tied"}
LOOKS = {ALONE: "#ffffff", TOUCHES: COLOURS[0], STICKS: COLOURS[2], SLIPS: COLOURS[1], TIED: COLOURS[3]}
MOST = 0.5  # a node slips where more than this share of what it touches does
# Of a file that does not tell what slips, the ratio of shear and pressure has to.  Of a node they are two different
# means of what its points have: where all of them slip, the ratio lies some percent around mu.
AT_THE_BOUND = 0.85
NARROW, WIDE = 0.25, 0.93  # greys of a closed gap and of the widest: neither is taken for black ink or white paper
GREYS = ListedColormap([str(v) for v in np.linspace(NARROW, WIDE, 64)])
ZOOM_BELOW = 0.4  # changes within less than this share of the run get a second, closer look
MARGIN = 0.08


def status(along: Along, mu: float, gap_max: float, tied: bool = False) -> Codes:
    """Return what each node does at each time, (n_t, n) codes of ALONE to TIED [1].

    Pressed: touching, or, where friction is known, sticking or slipping (most of what it touches is at Coulomb's
    bound; in a file that does not tell, |t_T| is nearly mu |t_N|).  Not pressed: open, or, at gap_max [m], with nothing
    to face.  A rigid half presses on whole surfaces: its nodes that face nothing are not pressed.  What is tied stays.
    """
    alone = along.gap >= np.float32(gap_max)
    if tied:
        # fault: report: a tied pair is open where it is pulled -> pass | coupler/test_ties::test_the_report_says_tied
        return np.where(alone, ALONE, TIED).astype(np.int8)
    # fault: report: a rigid body touches what it has left -> pressed = along.t_N < 0.0; alone = alone & ~pressed |
    #   coupler/test_contact_lines
    pressed = (along.t_N < 0.0) & ~alone
    code = np.where(alone, ALONE, np.where(pressed, TOUCHES, OPEN)).astype(np.int8)
    if mu > 0.0 and along.slip_share is not None:
        code[pressed & (along.slip_share <= MOST)] = STICKS
        # fault: report: a node slips as soon as any of it does -> code[pressed & (along.slip_share > 0.0)] = SLIPS |
        #   coupler/test_contact_lines
        code[pressed & (along.slip_share > MOST)] = SLIPS
    elif mu > 0.0 and along.t_T is not None:
        known = pressed & np.isfinite(along.t_T)
        code[known] = STICKS
        # fault: report: sticking is called slipping -> code[known & (np.abs(along.t_T) >= 0.0 * mu * along.t_N)] =
        #   SLIPS | coupler/test_contact_lines
        code[known & (np.abs(along.t_T) >= -AT_THE_BOUND * mu * along.t_N)] = SLIPS
    return code


def contact_pictures(results: Results) -> list[Picture]:
    """One a pair.  [] where nothing was recorded."""
    if len(results.t) < 2:
        return []
    pairs = {p["name"]: p for p in results.header["pairs"]}
    return [_picture(results, name, pairs[name], along) for name, along in results.contact.items()]


def _picture(results: Results, name: str, pair: Mapping[str, Any], along: Along) -> Picture:
    code = status(along, float(pair["mu"]), float(pair["gap_max"]), bool(pair.get("tied")))
    near = closer(results.t, code)
    figure = page_figure(3.4 if near is None else 5.6)
    length = shown("m", float(along.s[-1]))
    gap = _gaps(along, code)
    scale = shown("m", float(np.nanmax(gap, initial=0.0)))
    panels = [figure.subplots()] if near is None else list(figure.subplots(2, 1))
    for ax, limits in zip(panels, (None, near), strict=False):
        _paint(ax, (results.t, length(along.s)), code, scale(gap))
        ax.set_xlim(*(limits or (float(results.t[0]), float(results.t[-1]))))
        ax.set_xlabel("time [s]", color=INK)
        ax.set_ylabel(f"along {plain(str(pair['slave']))}\n[{length.unit}]", color=INK)
        ax.tick_params(colors=INK, labelsize=9)
        draw_kinks(ax, kinks_of(results) if limits is None else [])
    _legend(figure, code, scale.unit, float(np.nanmax(scale(gap), initial=0.0)))
    alt = f"Contact of pair {name} over time along {pair['slave']}: {_shares(results.t, code)}."
    return png(figure, alt, _caption(results, pair, along, near, code), dark=True)


def closer(t: Array, code: Codes) -> tuple[float, float] | None:
    """Return the range of time [s] in which all changes lie, with a margin; None if it is much of the run or is none.

    t : (n_t,) [s], ascending.  code : (n_t, n) as from `status` [1].
    """
    changed = np.flatnonzero((code[1:] != code[:-1]).any(axis=1))
    if len(changed) < 3:  # the picture of all of the run tells as much
        return None
    low, high = float(t[changed[0]]), float(t[changed[-1] + 1])
    if high - low >= ZOOM_BELOW * (t[-1] - t[0]):
        return None
    margin = MARGIN * (high - low)
    return max(low - margin, float(t[0])), min(high + margin, float(t[-1]))


def _gaps(along: Along, code: Codes) -> Array:
    """(n_t, n) [m] gaps of open nodes, nan elsewhere."""
    return np.where(code == OPEN, np.maximum(along.gap.astype(float), 0.0), np.nan)


def edges_of(s: Array) -> Array:
    """Return the ends (n + 1,) of what belongs to each of n places: halfway to the last one and halfway to the next.

    s : (n,), ascending, in any unit of length; the ends are in the same.
    """
    return np.concatenate([s[:1], 0.5 * (s[1:] + s[:-1]), s[-1:]])


def _paint(ax: Axes, places: tuple[Array, Array], code: Codes, gap: Array) -> None:
    """What a node does at the end of a window stands for the whole of it."""
    top = float(np.nanmax(gap, initial=0.0))
    colours = GREYS(np.nan_to_num(gap[1:].T) / (top or 1.0), bytes=True)
    for what, look in LOOKS.items():
        here = np.equal(code[1:].T, what)
        colours[here] = (*(int(look[k:k + 2], 16) for k in (1, 3, 5)), 255)
    # An image, for a patch a cell takes a hundred times longer.
    ax.pcolorfast(places[0], edges_of(places[1]), colours)


def _legend(figure: PageFigure, code: Codes, unit: str, widest: float) -> None:
    """What the colours mean.  widest : gap, in this unit."""
    here = [c for c in WORDS if c != OPEN and (code[1:] == c).any()]
    handles = [Patch(facecolor=LOOKS[c], edgecolor="#888888", linewidth=0.6, label=WORDS[c]) for c in here]
    if (code[1:] == OPEN).any():
        bar = ScalarMappable(Normalize(0.0, widest or 1.0), GREYS)
        figure.colorbar(bar, cax=figure.add_axes((0.9, 0.2, 0.02, 0.6)), label=f"open: gap [{unit}]")
    legend_below(figure, (), more=handles)


def _shares(t: Array, code: Codes) -> str:
    """How much of the surface does what, in the mean over time."""
    weights = np.diff(t) / (t[-1] - t[0])
    parts = {WORDS[c]: float(weights @ (code[1:] == c).mean(axis=1)) for c in WORDS}
    return ", ".join(f"{word} {number(100 * part, 2)} %" for word, part in parts.items() if part > 0.0)


def _caption(results: Results, pair: Mapping[str, Any], along: Along, near: tuple[float, float] | None,
             code: Codes) -> str:
    (a, b), (x, y) = along.X[[0, -1]], axis_names(str(results.header["geometry"]))
    unit = shown("m", float(np.abs(along.X).max()))

    def at(place: Array) -> str:
        return f"{x} {number(float(unit(place[0])))}, {y} {number(float(unit(place[1])))} {unit.unit}"

    text = (f"Pair {pair['name']}: what each place of {pair['slave']} does against {pair['master']}, as found "
            f"at the end of each window; lengths along the undeformed surface, from ({at(a)}) to ({at(b)}).")
    if (code >= STICKS).any():
        bound = f"Coulomb's bound, {number(float(pair['mu']))} times the pressure"
        text += (f" A node slips where more than half of what it touches is at {bound}." if along.slip_share is not None
                 else f" What slips was not recorded: a node is said to where its shear is at least "
                      f"{number(AT_THE_BOUND)} of {bound}.")
    if near is not None:
        text += f" Below, the same from {number(near[0], 6)} s to {number(near[1], 6)} s, where it changes."
    return text
