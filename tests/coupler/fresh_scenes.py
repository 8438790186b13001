"""Four coupled scenes whose answers are known from elsewhere: none of them was at hand when the code was tuned.

two_rods : two unlike rods before each other oscillate by physics; own finite differences in space, BDF in time.
two_sided_rod : a hot rod before a cold wall, conducting by its gap where open and by its pressure where closed.
seizing_rod : a rod held between walls on a plate that slides at 1.25 times the critical speed (Barber 1969).
column : the coupled Danilovskaya problem, delta 0.36 (Sternberg & Chakravorty 1959).
"""

from __future__ import annotations

from typing import Any

import numpy as np

Doc = dict[str, Any]


def rectangle(x: float, y: float, width: float, height: float, nx: int, ny: int = 1) -> Doc:
    return {"rectangle": {"origin": [x, y], "size": [width, height], "cells": [nx, ny]}}


def coupling(scheme: str, end: float, size: float, **more: Any) -> Doc:
    return {"scheme": scheme, "end": end, "windows": [{"until": end, "size": size}], **more}


def two_rods(size: float, end: float = 60.0, scheme: str = "extrapolated") -> Doc:
    """T2, 300 K taken off, swings between 20.33 and 48.86 K with period 5.710 s.  size : of windows [s]."""
    gap = np.linspace(0.0, 10e-6, 401)
    h = np.clip(np.exp((4e-6 - gap) * 3.0 * 5.2 / 1e-6), 1e-12, 1e9)
    return {"slideline": 1, "units": {"temperature": "K"}, "geometry": "plane",
            "materials": {"hot": {"rho": 20, "c": 1, "k": 1, "alpha": 2e-8, "T_ref": 300, "E": 1e9},
                          "cold": {"rho": 1, "c": 1, "k": 1, "alpha": 1e-8, "T_ref": 300, "E": 1e9}},
            "bodies": {"one": {"mesh": rectangle(0, 0, 1, 0.1, 40), "material": "hot", "T0": 300},
                       "two": {"mesh": rectangle(1.000005833, 0, 1, 0.1, 40), "material": "cold", "T0": 300}},
            "contact": {"c": {"slave": "one.right", "master": "two.left", "gap_max": 0.001, "conduction": {
                "closed": {"law": "constant", "h": 1e9},
                "open": {"law": "table", "form": "cubic", "x": gap.tolist(), "h": h.tolist()}}}},
            "thermal": {"half": "rod", "method": "midpoint", "boundary": [
                {"on": "one.left", "temperature": 400}, {"on": "two.right", "temperature": 300}]},
            "mechanical": {"half": "rod", "rod": {"held": {"one": {"left": 0}, "two": {"right": 0}}}},
            "coupling": coupling(scheme, end, size),
            "probes": {"T1": {"T": "one.right.centre"}, "T2": {"T": "two.left.centre"},
                       "gap": {"gap": {"mean": "one.right"}}}}


def two_sided_rod(size: float, end: float, scheme: str = "staggered", method: str = "backward_euler") -> Doc:
    """At rest the gap is 0.90984e-6 m and TL 348.975 K.  size : of windows [s]."""
    return {"slideline": 1, "units": {"temperature": "K"}, "geometry": "plane",
            "materials": {"rod": {"rho": 1, "c": 1, "k": 1, "alpha": 8e-7, "T_ref": 300, "E": 1e9},
                          "wall": {"rho": 1, "c": 1, "k": 1, "alpha": 0}},
            "bodies": {"rod": {"mesh": rectangle(0, 0, 1, 0.1, 40), "material": "rod", "T0": 300},
                       "wall": {"mesh": rectangle(1.0000605, 0, 0.1, 0.1, 1), "material": "wall", "T0": 300}},
            "contact": {"c": {"slave": "rod.right", "master": "wall.left", "gap_max": 0.001, "conduction": {
                "closed": {"law": "constant", "h": 20}, "open": {"law": "gas", "k_g": 1e-6, "g_m": 5e-8}}}},
            "thermal": {"half": "rod", "method": method, "boundary": [
                {"on": "rod.left", "temperature": 400}, {"on": "wall.top", "temperature": 300}]},
            "mechanical": {"half": "rod", "rod": {"held": {"rod": {"left": 0}, "wall": {"left": 0, "right": 0}}}},
            "coupling": coupling(scheme, end, size),
            "probes": {"TL": {"T": "rod.right.centre"}, "gap": {"gap": {"mean": "rod.right"}}}}


def seizing_rod(size: float = 2.5, end: float = 300.0, scheme: str = "extrapolated") -> Doc:
    """The pressure grows from 1 MPa to 8.132 MPa in 300 s.  size : of windows [s]."""
    steel = {"rho": 7850, "c": 460, "k": 45, "E": 2e11, "nu": 0, "T_ref": 300}
    return {"slideline": 1, "units": {"temperature": "K"}, "geometry": "plane",
            "signals": {"slide": {"t": [0, 300], "value": [0, 0.9375]}},
            "materials": {"steel": {**steel, "alpha": 1.2e-5}, "plate": {**steel, "alpha": 0}},
            "bodies": {"plate": {"mesh": rectangle(-1.0375, -0.01, 1.2375, 0.01, 40), "material": "plate", "T0": 300},
                       "rod": {"mesh": rectangle(0, 0, 0.005, 0.05, 1, 40), "material": "steel", "T0": 300}},
            "contact": {"c": {"slave": "rod.bottom", "master": "plate.top", "gap_max": 0.01,
                              "friction": {"mu": 0.3, "share": 1}, "augmented": {"tolerance": 1e-6}}},
            "thermal": {"method": "sdirk2", "boundary": [{"on": "rod.top", "temperature": 300},
                                                         {"on": "plate.bottom", "temperature": 300}]},
            "mechanical": {"half": "elastic", "elastic": {"bodies": {"plate": {"rigid": True}}, "boundary": [
                {"body": "plate", "u_x": "slide", "u_y": 0}, {"body": "plate", "angle": 0},
                {"on": "rod.left", "u_x": 0}, {"on": "rod.right", "u_x": 0}, {"on": "rod.top", "u_y": -2.5e-7}]}},
            "coupling": coupling(scheme, end, size),
            "probes": {"p": {"p": {"mean": "rod.bottom"}}, "T": {"T": "rod.bottom.centre"}}}


def column(size: float = 0.02, end: float = 3.0, scheme: str = "iterated") -> Doc:
    """Stress over beta theta0 at x = 1: -0.39987 at 0.5 s, 0.07609 at 1.5 s, 0.03430 at 3 s.  size : of windows [s]."""
    return {"slideline": 1, "units": {"temperature": "K"}, "geometry": "plane",
            "materials": {"m": {"rho": 1, "k": 1, "c": 1, "E": 1, "nu": 0, "alpha": 3.16227766e-3, "T_ref": 36000}},
            "bodies": {"bar": {"mesh": rectangle(0, 0, 6, 0.04, 150), "material": "m", "T0": 36000}},
            "thermal": {"boundary": [{"on": "bar.left", "temperature": 36000.316227766}]},
            "mechanical": {"half": "elastic", "elastic": {
                "thermoelastic_heat": True, "adiabatic": True, "dynamics": {"rho_inf": 0}, "boundary": [
                    {"on": "bar.top", "u_y": 0}, {"on": "bar.bottom", "u_y": 0}, {"on": "bar.right", "u_x": 0}]}},
            "coupling": coupling(scheme, end, size, iteration={"tolerance": {"temperature": {
                "atol": 1e-6, "rtol": 1e-4}}}),
            "probes": {"T1": {"T": {"at": [1, 0.02], "body": "bar"}}}}
