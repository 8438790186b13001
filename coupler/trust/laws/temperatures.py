"""Temperatures stay within their data: the maximum principle of conduction.

Where no heat is made and none flows in by a prescribed flux, every temperature lies between the lowest and the highest
of the initial, the prescribed and the surrounding temperatures up to then (docs/theory.md).  Heat that is made, or
flows in, lifts the upper bound alone, heat that is taken away the lower; where both happen, anywhere, nothing is said.
0 K bounds every scene.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from coupler.scenario.thermal_data import TemperatureData
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, TrustVerdict, amount, measured

NOTE_AT, LIMIT = 1e-6, 1e-3  # of the span; round-off and iteration lie below, consistent elements between
# Of the largest temperature: what a scene at rest has for a span, so that nothing is held against a warmth of next to
# nothing (3 uK of a room), and what numbers leave.
LEAST_SPAN, ROUND_OFF = 1e-8, 1e-13
MADE, POWERS = ("mechanical", "friction.slave", "friction.master"), ("flux", "source")
"""Terms of the ledger by which heat comes from nowhere.  The sums of POWERS may be of one sign though they heat here
and cool there; `entropy` goes both ways."""
NAME = "temperatures within their data"


@dataclass(frozen=True)
class TemperatureLog:
    """low, high [K]: bounds of the data up to now, cold, hot [K]: of those without what surfaces radiate to, and sky
    [K]: of that.  made, taken : whether heat was made, or taken away.

    least, most [K]: of all temperatures so far.  excess [K]: the largest way out of the bounds, of a node at t [s];
    negative: below.  bound [K]: which it left.
    """

    low: float = math.inf
    high: float = -math.inf
    cold: float = math.inf
    hot: float = -math.inf
    sky: tuple[float, float] = (math.inf, -math.inf)
    made: bool = False
    taken: bool = False
    least: float = math.inf
    most: float = -math.inf
    excess: float = 0.0
    bound: float = 0.0
    node: int = -1
    t: float = 0.0

    @property
    def span(self) -> float:
        """Of all temperatures so far, those of the data too [K]."""
        # fault: a body that hardly warms has no span -> return self.most - self.least | coupler/test_trust_across
        return max(max(self.high, self.most) - min(self.low, self.least), self.least_span)

    @property
    def heat_span(self) -> float:
        """As span, but of temperatures that heat goes by [K].

        What a surface at T radiates to a sky at S goes with T^4 - S^4: an error of T counts as one of a film to
        surroundings that are (T^4 - S^4)/4T^3 colder.
        """
        low, high = min(self.cold, self.least), max(self.hot, self.most)
        below, above = self.sky
        # fault: bodies that radiate into space are driven by all of their temperature -> by_sky = high - below |
        #   coupler/test_trust_heat_mesh
        by_sky = (high**4 - below**4) / (4.0 * high**3) if 0.0 <= below < low else 0.0
        return max(high - low, by_sky, above - low, self.least_span)

    @property
    def share(self) -> float:
        """How far out of bounds a temperature was, of the span of data and of what heat opens on the other side [1]."""
        span = max(self.high, self.most) - self.low if self.excess < 0.0 else self.high - min(self.low, self.least)
        return abs(self.excess) / max(span, self.least_span)

    @property
    def own_span(self) -> float:
        """Of all temperatures so far, without the data [K]."""
        return max(self.most - self.least, self.least_span)

    @property
    def least_span(self) -> float:
        """What a span is at least [K]."""
        # fault: a scene of small differences is held against a fixed one -> return 1e-3 | coupler/test_trust
        # fault: a warmth of next to nothing is held against itself -> return 1e-300 |
        #   coupler/test_trust_heat_mesh::test_bodies_that_hardly_warm_are_not_held_against_their_own_warmth
        return LEAST_SPAN * max(abs(self.most), abs(self.least))


def begun(now: Level) -> TemperatureLog:
    """Return the log at the start: T : (n_nodes,) [K] of `now` are data."""
    low, high = float(now.T.min()), float(now.T.max())
    return TemperatureLog(low, high, least=low, most=high)


def watched(log: TemperatureLog, data: TemperatureData, levels: tuple[Level, Level], terms: Mapping[str, float],
            inputs: Mapping[str, float]) -> TemperatureLog:
    """Return the log after one more window.

    levels : at its start and its end.  terms : its heat, mechanism -> [J].  inputs : the thermal half's, by name.
    """
    before, now = levels
    (a, b), (c, d) = (data.between(before.t, now.t, now.x, inputs, sky) for sky in (False, True))
    log = replace(log, low=min(log.low, a, c), high=max(log.high, b, d), cold=min(log.cold, a), hot=max(log.hot, b),
                  sky=(min(log.sky[0], c), max(log.sky[1], d)))
    scale = sum(abs(v) for v in terms.values())
    heats = [v for n, v in terms.items() if n.removeprefix("heat.") in MADE and abs(v) > 1e-12 * scale]
    heated, cooled = data.powers(before.t, now.t, now.x, inputs)
    # A half that keeps no ledger, or states fluxes and sources in its own way, may make heat that is not told.
    own_way = not (heated or cooled) and any(n.removeprefix("heat.") in POWERS and v for n, v in terms.items())
    untold = not data.known or not terms or own_way
    both = untold or any(n.removeprefix("heat.") == "entropy" and v for n, v in terms.items())
    made = log.made or both or heated or any(v > 0.0 for v in heats)
    taken = log.taken or both or cooled or any(v < 0.0 for v in heats)
    least, most = float(now.T.min()), float(now.T.max())
    log = replace(log, made=made, taken=taken, least=min(log.least, least), most=max(log.most, most))
    found = log
    # Heat that is made or taken opens a span, on its own side, that the data have not.
    for sign, bound, outside, free in ((-1.0, log.low, log.low - least, taken), (1.0, log.high, most - log.high, made)):
        # fault: what numbers leave is out of bounds -> left = 0.0 | coupler/test_trust
        left = ROUND_OFF * max(abs(least), abs(most))
        # fault: what leaves its data is not seen -> if False: | coupler/test_trust
        if not free and outside - left > abs(found.excess):
            found = replace(found, excess=sign * outside, bound=bound, t=now.t, node=int((sign * now.T).argmax()))
    return found


def check(log: TemperatureLog, where: str) -> Check:
    """Return the check at the end.  where : of the worst node, in words."""
    remedy = ("Use smaller windows, thermal.method: sdirk2 or backward_euler, or a finer mesh at the surface; "
              "if it grows with shorter windows, the mesh is too coarse for them")
    if not log.least > 0.0:
        return Check(NAME, TrustVerdict.BROKEN, log.least, 0.0, "K",
                     what=f"the lowest temperature is {log.least:.6g} K", remedy=remedy)
    if log.made and log.taken:
        return Check(NAME, TrustVerdict.UNCHECKED,
                     what="sources or fluxes heat and cool the bodies, or the half does not report them")
    side = "below the lowest" if log.excess < 0.0 else "above the highest"
    what = (f"{where} is {amount(abs(log.excess), 'K')} {side} of its data so far, {log.bound:.6g} K, at "
            f"t = {log.t:.6g} s, {100 * log.share:.3g} % of the span: an undershoot or overshoot that is not physical")
    return measured(NAME, log.share, (NOTE_AT, LIMIT), what=what, remedy=remedy, t=log.t)
