"""Temperatures within their data where heat is made or taken away: which bound each opens."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from test_trust import boxes, level

from coupler.trust.checks import Check
from coupler.trust.laws.temperatures import NAME
from coupler.trust.table.watch import TrustWatch

WARMED, COOLED = np.array([330.0, *[300.0] * 7]), np.array([*[300.0] * 7, 290.0])


def told(T: Any, bodies: dict | None = None, boundary: tuple[dict, ...] = (), terms: dict | None = None,
         inputs: dict | None = None) -> Check:
    """What a run tells that went from 300 K to T.  terms : heat of its window [J]; None: of a source."""
    watch = TrustWatch(boxes(), {"thermal": {"boundary": boundary, "bodies": bodies or {}},
                                 "mechanical": {"half": "elastic"}})
    terms = {"heat.source": 1.0, "heat.stored.low": 1.0} if terms is None else terms
    log = watch.after(watch.begun(level(0.0)), (level(0.0), level(1.0, list(T))), terms, fresh=False,
                      inputs=inputs or {})
    return next(c for c in watch.judged(log, terms) if c.name == NAME)


def verdicts(**scene: Any) -> tuple[str, str]:
    """Of a run that warms and of one that cools."""
    return told(WARMED, **scene).verdict, told(COOLED, **scene).verdict


def test_a_half_that_tells_no_heat_is_not_checked():
    assert verdicts(terms={}) == ("not checked",) * 2
    assert verdicts(terms={"heat.entropy": 1.0}) == ("not checked",) * 2


@pytest.mark.parametrize("name", ["source", "flux"])
def test_heat_that_a_half_makes_in_its_own_way_is_not_checked(name):
    assert verdicts(terms={f"heat.{name}": 1.0}) == ("not checked",) * 2


@pytest.mark.parametrize("of", [
    {"bodies": {"low": {"Q_T": 5.0}}},
    {"bodies": {"low": {"regions": {"core": {"Q_T": {"t": [0.0, 4.0], "value": [0.0, 5.0]}}}}}},
    {"bodies": {"low": {"Q_T": 5.0, "Q_T_factor": {"T": [300.0, 400.0], "value": [1.0, 0.0]}}}},
    {"boundary": ({"on": "low.top", "flux": {"terms": [{"t": 2.0, "x": {"at": [0.0, 1.0], "value": [1.0, 0.0]}}]}},)},
])
def test_what_heats_lifts_the_upper_bound_alone(of):
    assert verdicts(**of) == ("holds", "broken")


def test_what_cools_lowers_the_lower_bound_alone():
    assert verdicts(bodies={"low": {"Q_T": -5.0}}) == ("broken", "holds")
    assert verdicts(boundary=({"on": "low.top", "flux": 5.0, "name": "beam"},), inputs={"load.beam": -1.0}
                    ) == ("broken", "holds")


def test_what_heats_one_body_and_cools_another_opens_both():
    """Two bodies, +1000 J and -500 J: 50 K below its data, said a run that was right."""
    assert verdicts(bodies={"low": {"Q_T": 10.0}, "high": {"Q_T": -5.0}}) == ("not checked",) * 2
    by_place = {"terms": [{"x": {"at": [0.0, 1.0], "value": [10.0, -5.0]}}]}
    assert verdicts(boundary=({"on": "low.top", "flux": by_place},)) == ("not checked",) * 2
    by_T = {"T": [300.0, 400.0], "value": [2.0, -1.0]}
    assert verdicts(bodies={"low": {"Q_T": 5.0, "Q_T_factor": by_T}}) == ("not checked",) * 2
    assert verdicts(bodies={"low": {"Q_T": 5.0, "Q_T_factor": {"polynomial": [1.0, 0.1], "T_ref": 300.0}}}
                    ) == ("not checked",) * 2


def test_heat_before_it_flows_opens_nothing():
    late = {"low": {"Q_T": {"t": [0.0, 5.0, 5.0], "value": [0.0, 0.0, 1.0]}}}
    assert verdicts(bodies=late, terms={"heat.convection": 1.0}) == ("broken",) * 2


def test_an_undershoot_is_a_share_of_what_heat_has_opened():
    """0.02 K below where 500 K were made is next to nothing; of the first moment's 4 K it was a two-hundredth."""
    watch = TrustWatch(boxes(), {"thermal": {"bodies": {"low": {"Q_T": 5.0}}}, "mechanical": {"half": "elastic"}})
    terms, log = {"heat.source": 1.0}, watch.begun(level(0.0))
    first, last = level(1.0, [304.0, *[299.98] * 7]), level(2.0, [800.0, *[400.0] * 7])
    log = watch.after(log, (level(0.0), first), terms, fresh=False, inputs={})
    assert next(c for c in watch.judged(log, terms) if c.name == NAME).verdict == "broken"
    log = watch.after(log, (first, last), terms, fresh=False, inputs={})
    check = next(c for c in watch.judged(log, terms) if c.name == NAME)
    assert (check.verdict, check.t) == ("noted", 1.0)
    assert check.number == pytest.approx(0.02 / 500.0)
