"""Numbers as a reader wants them."""

from __future__ import annotations

# unit -> (below this, times this, is called this), the first that fits
READABLE = {"m": ((1e-3, 1e6, "um"), (1.0, 1e3, "mm")), "Pa": ((1e3, 1.0, "Pa"), (1e6, 1e-3, "kPa"),
                                                              (float("inf"), 1e-6, "MPa"))}


def amount(value: float, unit: str) -> str:
    """A number with its unit: 3.5 um, 12.1 MPa, 1 K."""
    for below, factor, name in READABLE.get(unit, ()):
        if abs(value) < below:
            return f"{value * factor:.3g} {name}"
    return f"{value:.3g} {unit}" if unit != "1" else f"{value:.3g}"


def percent(share: float) -> str:
    """Two digits: .2 as 20 %."""
    return f"{100 * share:.2g} %" if abs(share) < 0.995 else f"{100 * share:.0f} %"


def of_range(share: float) -> str:
    """20 % of its range; from twice on 2.1 times its range."""
    return f"{share:.2g} times its range" if share > 2.0 else f"{percent(share)} of its range"
