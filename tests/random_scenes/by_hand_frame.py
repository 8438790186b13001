"""Small scenes for laws of frame, roles and motion: heat, pressed blocks, a stack, a disc on a ring, even gaps."""

from __future__ import annotations

from typing import Any

from random_scenes.scene import Scene

STEEL = {"rho": 7800.0, "c": 500.0, "k": 40.0, "E": 2.0e11, "nu": 0.3, "alpha": 1.2e-5, "T_ref": 20.0}
ALUMINIUM = {"rho": 2700.0, "c": 900.0, "k": 200.0, "E": 7.0e10, "nu": 0.33, "alpha": 2.3e-5, "T_ref": 20.0}
GAP = {"closed": {"law": "power", "h0": 500.0, "h1": 3000.0, "p0": 1.0e7, "exponent": 0.95},
       "open": {"law": "gas", "k_g": 0.05, "g_m": 1.0e-4}}


def _doc(bodies: dict[str, Any], contact: dict[str, Any], thermal: list[Any], elastic: dict[str, Any] | None,
         **more: Any) -> dict[str, Any]:
    mechanical = {"half": "rigid"} if elastic is None else {"half": "elastic", "elastic": elastic}
    return {"slideline": 2, "units": {"temperature": "degC"}, "geometry": "plane",
            "materials": {"steel": STEEL, "aluminium": ALUMINIUM}, "bodies": bodies, "contact": contact,
            "thermal": {"boundary": thermal}, "mechanical": mechanical,
            "coupling": {"scheme": "staggered", "end": 4.0, "windows": [{"until": 4.0, "size": 1.0}]}, **more}


def heat() -> Scene:
    """Heat alone: a source and a film that vary over place and time, conductivity along axes, an open gap."""
    skew = {**STEEL, "k": {"k_1": 60.0, "k_2": 20.0, "angle": 30.0}}
    field = {"terms": [{"t": {"t": [0.0, 2.0, 4.0], "value": [0.0, 3.0e6, 1.0e6]},
                        "x": {"at": [0.0, 0.05, 0.1], "value": [1.0, 2.0, 0.0]},
                        "y": {"polynomial": [1.0, 8.0, -40.0]}}]}
    warm = {"terms": [{"t": 60.0}, {"t": "rise", "y": {"at": [0.0, 0.1], "value": [0.0, 1.0]}}]}
    doc = _doc({"low": {"material": "skew", "T0": 40.0, "Q_T": field}, "high": {"material": "aluminium", "T0": 90.0}},
               {"gap": {"slave": "high.bottom", "master": "low.top", "gap_max": 0.02, "conduction": GAP,
                        "radiation": {"emissivity_slave": 0.8, "emissivity_master": {"T": [0.0, 100.0],
                                                                                     "value": [0.3, 0.9]}}}},
               [{"on": "low.left", "temperature": 40.0}, {"on": "high.top", "convection": {"h": 300.0, "T": warm}},
                {"on": "high.right", "radiation": {"emissivity": 0.7, "T": 300.0}},
                {"on": "low.bottom", "flux": {"t": [0.0, 1.0, 1.0, 4.0], "value": [0.0, 0.0, 2.0e4, 1.0e4]}}],
               None, signals={"rise": {"t": [0.0, 3.0], "value": [0.0, 80.0]}},
               probes={"corner": {"T": {"at": [0.031, 0.012], "body": "low"}}, "q": {"thermal.q.x": {"max": "low"}}})
    doc["materials"]["skew"] = skew
    return Scene(doc, {"low": {"patch": [[0, 0], [0.1, 0], [0.1, 0.04], [0, 0.04]], "cells": [5, 2], "jitter": 0.3},
                       "high": {"patch": [[0.01, 0.041], [0.09, 0.042], [0.08, 0.08], [0.01, 0.08]], "cells": [4, 3],
                                "triangles": "mixed"}})


def pressed(mu: float = 0.0) -> Scene:
    """A warm block pressed onto a cold one by a pressure that follows it, and by weight aslant."""
    pair: dict[str, Any] = {"slave": "high.bottom", "master": "low.top", "gap_max": 0.01, "conduction": GAP}
    if mu:
        pair["friction"] = {"mu": mu}
    doc = _doc({"low": {"material": "steel", "T0": 20.0}, "high": {"material": "aluminium", "T0": 120.0}},
               {"flat": pair},
               [{"on": "low.bottom", "temperature": 20.0}],
               {"boundary": [{"on": "low.bottom", "u_x": 0.0, "u_y": 0.0},
                             {"on": "high.top", "u_x": {"t": [0.0, 4.0], "value": [0.0, 2.0e-5]},
                              "u_y": {"t": [0.0, 1.0, 4.0], "value": [0.0, -3.0e-5, -3.0e-5]}},
                             {"on": "low.right", "pressure": {"t": [0.0, 4.0], "value": [0.0, 5.0e6]}},
                             {"on": "high.left", "t_x": 2.0e6}],
                "gravity": {"x": 3.0e4, "y": {"t": [0.0, 4.0], "value": [0.0, -9.0e4]}}},
               probes={"press": {"p": {"max": "high.bottom"}}, "side": {"u_x": {"max": "high.right"}}})
    return Scene(doc, {"low": {"patch": [[0, 0], [0.1, 0], [0.1, 0.04], [0, 0.04]], "cells": [5, 2]},
                       "high": {"patch": [[0.02, 0.04], [0.08, 0.04], [0.07, 0.08], [0.02, 0.08]], "cells": [4, 3],
                                "grading": [2, 1], "triangles": "mixed", "jitter": 0.2}})


def stack() -> Scene:
    """Three blocks on each other, two pairs, of two materials; at rest until it is pressed and heated at 1 s."""
    press = {"t": [0.0, 1.0, 3.0], "value": [0.0, 0.0, -4.0e-5]}
    warm = {"t": [0.0, 1.0, 3.0], "value": [20.0, 20.0, 150.0]}
    pairs = {f"{a}{b}": {"slave": f"{b}.bottom", "master": f"{a}.top", "gap_max": 0.01, "conduction": GAP,
                         "friction": {"mu": mu}} for a, b, mu in (("a", "b", 0.4), ("b", "c", 0.1))}
    doc = _doc({name: {"material": m, "T0": 20.0} for name, m in (("a", "steel"), ("b", "aluminium"), ("c", "steel"))},
               pairs, [{"on": "a.bottom", "temperature": 20.0}, {"on": "c.top", "temperature": warm}],
               {"boundary": [{"on": n, "u_x": 0.0, "u_y": 0.0} for n in ("a.bottom", "b.left")]
                + [{"on": "c.top", "u_x": 0.0, "u_y": press}]})
    return Scene(doc, {name: {"patch": [[x, y], [x + 0.06, y], [x + 0.06, y + 0.03], [x, y + 0.03]], "cells": [n, 2]}
                       for name, x, y, n in (("a", 0.0, 0.0, 5), ("b", 0.005, 0.03, 4), ("c", 0.01, 0.06, 3))})


def disc() -> Scene:
    """A hot disc that is pressed onto a ring, about the axis."""
    doc = _doc({"ring": {"material": "steel", "T0": 20.0}, "disc": {"material": "aluminium", "T0": 200.0}},
               {"flat": {"slave": "disc.bottom", "master": "ring.top", "gap_max": 0.01, "conduction": GAP,
                         "friction": {"mu": 0.2}}},
               [{"on": "ring.bottom", "temperature": 20.0}],
               {"boundary": [{"on": "ring.bottom", "u_x": 0.0, "u_y": 0.0}, {"on": "disc.left", "u_x": 0.0},
                             {"on": "disc.top", "u_y": {"t": [0.0, 4.0], "value": [0.0, -5.0e-5]}}],
                "gravity": {"y": -1.0e5}}, geometry="axisymmetric")
    doc["geometry"] = "axisymmetric"
    return Scene(doc, {"ring": {"patch": [[0.02, 0], [0.06, 0], [0.06, 0.03], [0.02, 0.03]], "cells": [4, 2]},
                       "disc": {"patch": [[0, 0.03], [0.05, 0.03], [0.05, 0.06], [0, 0.06]], "cells": [5, 2]}})


def flat_gap() -> Scene:
    """Two blocks of one width, a gap of a millimetre between them, meshes that do not match."""
    doc = _doc({"low": {"material": "steel", "T0": 20.0}, "high": {"material": "aluminium", "T0": 220.0}},
               {"gap": {"slave": "high.bottom", "master": "low.top", "gap_max": 0.02, "conduction": GAP,
                        "radiation": {"emissivity_slave": 0.8, "emissivity_master": 0.3}}}, [], None)
    return Scene(doc, {"low": {"patch": [[0, 0], [0.06, 0], [0.06, 0.02], [0, 0.02]], "cells": [5, 2]},
                       "high": {"patch": [[0, 0.021], [0.06, 0.021], [0.06, 0.04], [0, 0.04]], "cells": [4, 2]}})


def rings(ratio: float, geometry: str = "plane") -> Scene:
    """A hot ring inside a cold one, or about an axis a ball inside a shell; ratio : of the two radii of the gap."""
    r, angles = 0.02, [0, 360] if geometry == "plane" else [-90, 90]
    doc = _doc({"core": {"material": "steel", "T0": 220.0}, "ring": {"material": "aluminium", "T0": 20.0}},
               {"gap": {"slave": "ring.inner", "master": "core.outer", "gap_max": r, "conduction": GAP}}, [], None,
               geometry=geometry)
    doc["geometry"] = geometry
    return Scene(doc, {"core": {"ring": [0.01, r], "angles": angles, "cells": [1, 32]},
                       "ring": {"ring": [ratio * r, (ratio + 0.5) * r], "angles": angles, "cells": [1, 32]}})
