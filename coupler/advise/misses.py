"""What the advised model would show wrong beside what was asked for, measured against the scene whole."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from coupler.advise.amount import amount, of_range
from coupler.advise.coarse import OWN
from coupler.advise.known import Known
from coupler.advise.weigh import both, range_of
from coupler.trials.trial import Trial

# What is told: a probe that moves by this share of its range, a largest pressure this much above the mean.
TOLD, UNEVEN = 0.01, 1.05
STILL = 1e-9  # m


def misses(known: Known) -> Iterator[str]:
    """A line each.  Only pairs and probes that the combination has."""
    full, simple = known.reference, known.combined
    assert simple is not None
    own = [n.removeprefix(OWN) for n in full.probes if n.startswith(OWN)]
    pairs = [n.removesuffix(".p.max") for n in own if n.endswith(".p.max")]
    for pair in pairs:
        yield from _pressure(pair, full, simple)
        yield from _spring_back(pair, full, simple)
    asked = {goal.probe for goal in known.goals}
    for name in full.probes:
        if not name.startswith(OWN) and name not in asked:
            yield from _probe(name, full, simple)


def _pressure(pair: str, full: Trial, simple: Trial) -> Iterator[str]:
    """The largest pressure, and how much of it is that of corners and edges."""
    name = f"{OWN}{pair}.p.max"
    if name not in simple.probes or max(full.probes[name]) <= 0.0:
        return
    t, p, other = both(full, simple, name)
    k = int(p.argmax())
    mean = float(np.interp(t[k], full.t, full.probes[f"{OWN}{pair}.p.mean"]))
    text = f"pressure at {pair}: up to {amount(float(p[k]), 'Pa')} at t = {t[k]:.5g} s"
    if p[k] > UNEVEN * mean > 0.0:
        text += f", {p[k] / mean:.2g} times the mean (corners and edges)"
    if abs(other[k] - p[k]) > TOLD * p[k]:
        yield f"{text}; without it {amount(float(other[k]), 'Pa')} there and then"


def _spring_back(pair: str, full: Trial, simple: Trial) -> Iterator[str]:
    """How far the surface is from where the simpler model has it, and what of that goes when contact is lost."""
    for axis in ("u_x", "u_y"):
        name = f"{OWN}{pair}.{axis}"
        if name not in simple.probes:
            continue
        t, u, other = both(full, simple, name)
        off = u - other
        if np.abs(off).max() <= STILL:
            continue
        k = int(np.abs(off).argmax())
        text = f"the slave side of {pair} is off by {amount(float(off[k]), 'm')} along {axis[-1]} at t = {t[k]:.5g} s"
        lost = _lost(np.interp(t, full.t, full.probes[f"{OWN}{pair}.p.max"]))
        back = float(abs(off[k] - off[lost])) if lost > k else 0.0
        if back > TOLD * abs(off[k]):
            text += f"; it has sprung back by {amount(back, 'm')} when contact is lost, at t = {t[lost]:.5g} s"
        yield text


def _lost(p: NDArray[np.float64]) -> int:
    """The last time at which a pressure went to nothing; 0 where it never did."""
    found = np.flatnonzero((p[:-1] > 0.0) & (p[1:] <= 0.0))
    return int(found[-1]) + 1 if len(found) else 0


def _probe(name: str, full: Trial, simple: Trial) -> Iterator[str]:
    if name not in simple.probes:
        yield f"{name}: not there"
        return
    t, a, b = both(full, simple, name)
    off, unit = np.abs(a - b), full.units[name]
    k, scale = int(off.argmax()), range_of(name, full)
    if off[k] > TOLD * scale:
        yield f"{name}: by {amount(float(off[k]), unit)} at t = {t[k]:.5g} s ({of_range(float(off[k]) / scale)})"
