"""The keys of coupling.iteration: defaults, values, and what is refused."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from coupler.scenario.options import Acceleration, Iteration, OnMax, Scheme, Tolerance, Tolerances

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import GOOD, error_of, load_text

OLD = "  scheme: extrapolated\n"
FULL = """\
  scheme: iterated
  iteration:
    acceleration: aitken
    relaxation: 0.5
    max_iterations: 12
    on_max: stop
    reuse: 0
    tolerance: {temperature: {atol: 1.0e-3}, gap: {rtol: 0}, pressure: {atol: 5, rtol: 1.0e-6}}
"""


def test_defaults_are_those_of_the_method(tmp_path):
    found = load_text(tmp_path, GOOD).coupling.iteration
    assert found.changed(tolerance=Tolerances()) == Iteration()
    assert [q.rtol for _, q in found.tolerance] == [q.rtol for _, q in Tolerances()]  # atol: test_scales


def test_every_key_arrives(tmp_path):
    c = load_text(tmp_path, GOOD.replace(OLD, FULL)).coupling
    assert c.scheme is Scheme.ITERATED
    d = Tolerances()
    assert c.iteration == Iteration(
        acceleration=Acceleration.AITKEN, relaxation=0.5, max_iterations=12, on_max=OnMax.STOP, tolerance=Tolerances(
            temperature=Tolerance(atol=1e-3, rtol=d.temperature.rtol),
            gap=Tolerance(atol=c.iteration.tolerance.gap.atol, rtol=0.0),
            pressure=Tolerance(atol=5.0, rtol=1e-6), solid_fraction=d.solid_fraction))


@pytest.mark.parametrize("scheme", list(Scheme))
def test_every_scheme_can_be_chosen(tmp_path, scheme):
    needs = {"mechanical.elastic.adiabatic": True} if scheme is Scheme.ADIABATIC else {}
    assert load_text(tmp_path, GOOD, {"coupling.scheme": scheme.value, **needs}).coupling.scheme is scheme


@pytest.mark.parametrize(("spec", "message"), [
    ("{acceleration: newton}", "iqn_ils"), ("{relaxation: 0}", "positive|above 0|greater"),
    ("{relaxation: 1.5}", "at most 1"), ("{acceleration: constant}", "below 1"), ("{reuse: 1.5}", "whole"),
    ("{max_iterations: 0}", "whole|count|1"), ("{on_max: hope}", "retry_smaller"), ("{tolerences: {}}", "tolerance"),
    ("{tolerance: {temperature: {atol: 0}}}", "positive|above 0|greater")])
def test_what_cannot_be_is_refused(tmp_path, spec, message):
    error = error_of(tmp_path, OLD, f"  scheme: iterated\n  iteration: {spec}\n")
    assert error.key.startswith("coupling.iteration")
    assert re.search(message, str(error)), str(error)
