"""Pressure and shear along the interface at some times of a run, a picture a pair."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupler.record.results import Along, Results
from coupler.report.figures import COLOURS, Picture, axes_of, legend_below, number, page_figure, plain, shown, svg

Array = NDArray[np.float64]

MOST_LINES = 5
HEIGHT = 3.0  # inches
ALONE = 2.0  # times the rest of a surface: what is more at one node is not resolved by the mesh
ON_AXIS = 1e-9  # of the length of a surface
EVEN = 0.01  # of the rest of a surface: a corner that has so little more has no peak
WIDEST, THINNER = 3.8, 0.7  # points: of the first line, and each next one by so much


def largest(along: Along) -> tuple[float, int]:
    """Return the largest pressure of a pair [Pa] and the number of the time at which it was."""
    row = int((-along.t_N).max(axis=1, initial=0.0).argmax())
    return float((-along.t_N[row]).max(initial=0.0)) + 0.0, row


def place_of_peak(along: Along, slave: str, axisymmetric: bool = False) -> str:
    """Tell where along a slave surface the largest pressure of a pair was, and whether a corner alone has it.

    The last node of a surface is a corner of its body: a sharp edge pressed on another body has no finite pressure
    there, so the number grows as the mesh is refined, and the rest of the surface says more.  On the axis of a round
    body a surface has an end in the mesh but not in space.  What one node carries there is a peak that the mesh does
    not resolve.
    """
    p = -along.t_N[largest(along)[1]]
    k = int(p.argmax())
    x, y = (number(float(c), 4) for c in along.X[k])
    text = f"on {slave} at ({x}, {y}) m"
    closed = len(along.X) > 2 and bool((along.X[0] == along.X[-1]).all())
    # fault: the end of a surface is told like any place of it -> if True: |
    #   coupler/test_one_pressure::test_a_peak_at_a_corner_is_told_as_one
    if closed or k not in (0, len(p) - 1):
        return text
    rest = float(np.delete(p, k).max(initial=0.0))
    # fault: the middle of a round surface is told as a corner -> if False: |
    #   coupler/test_one_pressure::test_a_peak_on_the_axis_is_no_corner
    if axisymmetric and abs(along.X[k][0]) <= ON_AXIS * float(np.ptp(along.s)):
        alone = (f"; the rest of the surface has at most {shown('Pa', rest).text(rest, 3)} then: one node carries the "
                 "peak")
        return f"{text}, on the axis{alone if float(p[k]) > ALONE * rest else ''}"
    # fault: an even pressure is told as that of a corner -> if False: |
    #   coupler/test_one_pressure::test_a_peak_at_a_corner_is_told_as_one
    if float(p[k]) <= (1.0 + EVEN) * rest:
        return text
    return (f"{text}, the corner at its end: the pressure of a sharp corner grows as the mesh is refined; "
            f"the rest of the surface has at most {shown('Pa', rest).text(rest, 3)} then")


def largest_at(results: Results, row: int) -> float:
    """Return the largest pressure [Pa] of all pairs at one of the times; 0 where none was recorded."""
    return max((float((-along.t_N[row]).max(initial=0.0)) for along in results.contact.values()), default=0.0) + 0.0


def pressure_pictures(results: Results) -> list[Picture]:
    """One a pair that was pressed.  [] where nothing was recorded."""
    pairs = {p["name"]: p for p in results.header["pairs"]}
    return [_picture(results, name, pairs[name], along) for name, along in results.contact.items()
            if largest(along)[0] > 0.0]


def times_to_show(t: Array, p: Array) -> list[int]:
    """Return numbers of at most MOST_LINES times: that of the largest pressure, others evenly while it is pressed.

    t : (n_t,) [s], ascending.  p : (n_t,) [Pa], the largest pressure at each.
    """
    pressed = np.flatnonzero(p > 0.0)
    even = np.linspace(t[pressed[0]], t[pressed[-1]], MOST_LINES - 1)
    near = pressed[np.abs(t[pressed][:, None] - even).argmin(axis=0)]
    # fault: report: the time of the largest pressure is not shown -> return sorted({*near.tolist()}) |
    #   coupler/test_one_pressure
    return sorted({int(p.argmax()), *near.tolist()})


def _picture(results: Results, name: str, pair: Mapping[str, Any], along: Along) -> Picture:
    p, (top, row) = np.maximum(-along.t_N, 0.0).astype(float), largest(along)
    scale, length = shown("Pa", top), shown("m", float(along.s[-1]))
    sheared = along.t_T is not None and bool(np.nan_to_num(np.abs(along.t_T)).any())
    figure = page_figure(HEIGHT)
    ax = axes_of(figure, f"along {plain(str(pair['slave']))} [{length.unit}]",
                 f"pressure{', shear' * sheared} [{scale.unit}]")
    for k, at in enumerate(times_to_show(results.t, p.max(axis=1))):
        # Dots are for the shear; of equal lines each is still seen under the thinner next.
        look: dict[str, Any] = {"color": COLOURS[k], "linewidth": WIDEST - k * THINNER}
        ax.plot(length(along.s), scale(p[at]), label=f"t = {number(float(results.t[at]), 6)} s", **look)
        if sheared:
            assert along.t_T is not None
            ax.plot(length(along.s), scale(np.nan_to_num(along.t_T[at].astype(float))), linestyle=":", **look)
    legend_below(figure, ax, MOST_LINES)
    when = number(float(results.t[row]), 6)
    where = number(float(length(along.s[int((-along.t_N[row]).argmax())])), 4)
    text = (f"Pair {name}: contact pressure along {pair['slave']}, the mean over what each node faces, at some times. "
            f"Its largest, {scale.text(top, 5)}, is at {where} {length.unit} at t = {when} s.")
    if sheared:
        text += " Dotted: the shear of friction, positive along the surface with the body on the left."
    return svg(figure, text, text)
