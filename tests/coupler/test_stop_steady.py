"""A run that ends where temperatures are steady does not end where they only rest because something melts."""

import json
import math

import pytest

from coupler import run
from coupler.scenario.load import scenario_from
from coupler.scenario.scales import latent_span
from coupler.scenario.timing import moves_on

RHO, C, LATENT, H, WIDTH = 2700.0, 1000.0, 4.0e5, 100.0, 0.02
START, MELTS, AROUND = 900.0, 933.0, 1100.0
RATE = 1e-3  # K/s at which temperatures are called steady


def scene(tmp_path, T0, around, **material):
    """A thin plate that conducts well, in a film."""
    made = {
        "slideline": 2, "units": {"temperature": "K"}, "geometry": "plane",
        "materials": {"metal": {"rho": RHO, "k": 500.0, "c": C, "latent": {"L": LATENT, "T_m": MELTS}, **material}},
        "bodies": {"plate": {"mesh": {"rectangle": {"origin": [0.0, 0.0], "size": [WIDTH, 0.01], "cells": [2, 1]}},
                             "material": "metal", "T0": T0}},
        "thermal": {"boundary": [{"on": "plate.left", "convection": {"h": H, "T": around}}]},
        "mechanical": {"half": "rigid"}, "coupling": {"end": 50000.0, "stop": {"steady": RATE}},
        "probes": {"T": {"T": {"mean": "plate"}}, "solid": {"f_s": {"mean": "plate"}}},
    }
    return scenario_from(json.dumps(made), tmp_path / "scene.yaml", {})


@pytest.mark.parametrize(("T0", "around", "solid"), [(START, AROUND, 0.0), (1000.0, 800.0, 1.0)])
def test_a_run_goes_on_while_something_melts_or_freezes(tmp_path, T0, around, solid):
    results = run(scene(tmp_path, T0, around), out=tmp_path / "run.h5")
    t, T = results.probe("T")
    assert results.probe("solid")[1][-1] == pytest.approx(solid, abs=1e-6)
    # One temperature behind a film: steady once h (T_inf - T) is rho c w times the rate.
    tau = RHO * C * WIDTH / H
    phase = sum(tau * math.log((around - a) / (around - b)) for a, b in ((T0, MELTS), (MELTS, around - RATE * tau)
                                                                         if around > T0 else
                                                                         (MELTS, around + RATE * tau)))
    melting = RHO * LATENT * WIDTH / (H * abs(around - MELTS))
    assert phase + melting < t[-1] < 50000.0, "it ends, but not sooner"
    assert t[-1] < 1.5 * (phase + melting)
    assert abs(T[-1] - around) < RATE * tau


def test_the_latent_heat_counts_by_what_it_would_warm(tmp_path):
    models = scene(tmp_path, START, AROUND).models["thermal"]
    assert latent_span(models) == pytest.approx(LATENT / C)
    phased = scene(tmp_path, START, AROUND, c={
        "solid": {"T": [800.0, 1066.0], "value": [400.0, 800.0]}, "liquid": 2000.0}).models["thermal"]
    assert latent_span(phased) == pytest.approx(LATENT / 600.0)
    for material in phased["materials"].values():
        del material["latent"]
    assert latent_span(phased) == 0.0


@pytest.mark.parametrize(("model", "told"), [
    ({"dynamics": {}}, "bodies with inertia move on"), ({"method": "explicit"}, "bodies with inertia move on"),
    ({"materials": {"lead": {"creep": {"law": "norton"}}, "steel": {}}}, "lead creeps on"),
    ({"materials": {"steel": {}}, "method": "newton"}, "")])
def test_what_moves_on_at_steady_temperatures_is_told(model, told):
    notes = moves_on(model, RATE)
    assert [told in note for note in notes] == [True] * bool(told)
    assert moves_on(model, 0.0) == []
