"""A few small scenes made by hand, for the tests of the laws."""

from __future__ import annotations

from random_scenes.scene import Scene


def pressed() -> Scene:
    """A hot block, cells of both kinds, brought into contact with a cold one and pressed; friction; ten windows."""
    doc = {
        "slideline": 2, "units": {"temperature": "K"}, "geometry": "plane",
        "materials": {"al": {"rho": 2700, "c": 1000, "k": 200, "E": 7e10, "nu": 0.3, "alpha": 2e-5, "T_ref": 300}},
        "bodies": {"a": {"material": "al", "T0": 300}, "b": {"material": "al", "T0": 400}},
        "contact": {"p": {"slave": "b.bottom", "master": "a.top", "gap_max": 0.02, "friction": {"mu": 0.3},
                          "conduction": {"closed": {"law": "constant", "h": 2000},
                                         "open": {"law": "gas", "k_g": 0.05, "g_m": 2.5e-5}}}},
        "thermal": {"half": "thermal", "method": "midpoint", "boundary": [{"on": "a.bottom", "temperature": 300}]},
        "mechanical": {"half": "elastic", "elastic": {"boundary": [
            {"on": "a.bottom", "u_x": 0, "u_y": 0},
            {"on": "b.top", "u_x": 0, "u_y": {"t": [0, 5, 20], "value": [0, -1.2e-4, -2e-4]}}]}},
        "coupling": {"scheme": "staggered", "end": 20, "windows": [{"until": 20, "size": 2.0}]},
        "probes": {"T": {"T": {"mean": "b.bottom"}}, "p": {"p": {"max": "b.bottom"}}}}
    return Scene(doc, {
        "a": {"patch": [[0, 0], [0.1, 0], [0.1, 0.05], [0, 0.05]], "cells": [4, 2]},
        "b": {"patch": [[0.02, 0.0501], [0.08, 0.0501], [0.08, 0.09], [0.02, 0.09]], "cells": [3, 2],
              "triangles": "mixed", "jitter": 0.3}})


def adaptive() -> Scene:
    """The same in windows that find their own size."""
    return pressed().edited(coupling__windows=None, coupling__adaptive={
        "first": 0.5, "tolerance": {"temperature": {"atol": 0.05, "rtol": 0.01}}})


def across_a_film() -> Scene:
    """A block that swells towards another across a film of gas: what conducts is what the heat moves."""
    held = [{"on": "a.bottom", "u_x": 0, "u_y": 0}, {"on": "b.top", "u_x": 0, "u_y": 0}]
    return pressed().edited(
        contact__p__friction=None, mechanical__elastic__boundary=held, bodies__b__T0=300,
        contact__p__conduction={"closed": {"law": "constant", "h": 2e4},
                                "open": {"law": "gas", "k_g": 0.5, "g_m": 2.5e-5}},
        thermal__boundary=[{"on": "a.bottom", "temperature": 450},
                           {"on": "b.top", "convection": {"h": 3000, "T": 300}}])
