"""What rules looked at and what they drove, against time: one figure a monitor, one a driven load."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from coupler.record.results import Results
from coupler.report.curves import LOW, kinks_of
from coupler.report.kinks import draw_kinks
from coupler.report.picture import Picture, axes_of, line_style, page_figure, plain, svg
from coupler.report.units import number

Array = NDArray[np.float64]

# What a drive says of itself: the input of a half that it sets, and the value.
DRIVEN = re.compile(r"((?:thermal|mechanical)\.(?:load|bc)\.\S+) ([-+.\deE]+)")


def watched_pictures(results: Results) -> list[Picture]:
    """Monitors that are no probes (those are drawn already), then driven loads.  [] where no rule looked at any."""
    t = results.t
    if len(t) < 2:
        return []
    seen = {n: v for n, v in results.monitors.items() if n not in results.probe_names and np.isfinite(v).any()}
    pictures = [_picture(results, name, t, values, f"Monitor {name}, which a rule looks at") for name, values in
                seen.items()]
    for name, (times, values) in driven_loads(results).items():
        pictures.append(_picture(results, name, times, values, f"Factor {name} as the rules set it"))
    return pictures


def driven_loads(results: Results) -> dict[str, tuple[Array, Array]]:
    """Inputs of halves by name: the times [s] of the ends of windows after which a rule set them, and the values."""
    ends = {float(t): float(t + h) for t, h in zip(results.windows.t, results.windows.H, strict=True)}
    found: dict[str, list[tuple[float, float]]] = {}
    for firing in results.firings:
        for name, value in DRIVEN.findall(firing.text):
            found.setdefault(name, []).append((ends.get(firing.t, firing.t), float(value)))
    return {name: (np.array([t for t, _ in points]), np.array([v for _, v in points]))
            for name, points in found.items() if len(points) > 1}


def _picture(results: Results, name: str, t: Sequence[float] | Array, values: Array, what: str) -> Picture:
    figure = page_figure(LOW)
    ax = axes_of(figure, "time [s]", f"{plain(name)} [SI]")
    # What was set holds from then on; what was seen is known at ends of windows.
    ax.plot(t, values, drawstyle="steps-post" if what.startswith("Factor") else "default", **line_style(0))
    ax.set_xlim(float(results.t[0]), float(results.t[-1]))
    draw_kinks(ax, kinks_of(results))
    known = values[np.isfinite(values)]
    alt = f"{what}: {number(float(known[0]), 5)} at first, {number(float(known[-1]), 5)} at last."
    return svg(figure, alt, f"{what}; least {number(float(known.min()), 5)}, largest {number(float(known.max()), 5)}.")
