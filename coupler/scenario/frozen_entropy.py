"""The scheme `adiabatic` needs a mechanical half that can step at frozen entropy, once in a window; and what is told of
the heat of compression.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from contact.half.functions import property_from
from contact.problem.errors import Wrong
from coupler.scenario.document import Key
from coupler.scenario.options import Scheme
from coupler.scenario.schema import ScenarioFile


def frozen_entropy_wrong(file: ScenarioFile, scheme: Scheme | None, key: Key) -> Wrong | None:
    """Return why a scheme, stated at a key, cannot be run by the halves of a file; None where nothing is known.

    What a half of another package can do is known once it is loaded (coupler.schemes.schemes.lacking).
    """
    if scheme is not Scheme.ADIABATIC:
        return None
    kind, elastic = file.mechanical.half, file.mechanical.elastic
    other = "give another scheme, such as auto."
    if kind in ("rigid", "rod"):
        return Wrong(key, f"the scheme adiabatic holds the entropy of mechanics, which the half {kind} does not have",
                     f"Choose mechanical.half: elastic with mechanical.elastic.adiabatic: true, or {other}")
    # fault: the scheme adiabatic is taken from a half that cannot freeze its entropy -> if False: |
    #   coupler/test_frozen_entropy
    if kind == "elastic" and not (elastic is not None and elastic.adiabatic):
        return Wrong(key, "the scheme adiabatic needs mechanics that can hold their entropy, "
                          "mechanical.elastic.adiabatic, which is not given",
                     f"Write mechanical: {{elastic: {{adiabatic: true}}}}, with rho and c of each material, or {other}")
    # fault: the entropy of a window is frozen in each of its substeps -> if False: | coupler/test_frozen_entropy
    if file.coupling.substeps.mechanical != 1:
        return Wrong(key, f"the scheme adiabatic holds the entropy of a window's start once, and mechanics have "
                          f"{file.coupling.substeps.mechanical} substeps in it",
                     f"Leave coupling.substeps.mechanical at 1, or {other}")
    return None


def lost_heat(mechanical: Mapping[str, Any], scheme: Scheme) -> list[str]:
    """A sentence where only windows of the scheme adiabatic have the heat of compression.

    mechanical : model.json of the mechanical half.
    """
    # fault: nobody says that heat of compression is left out -> if True: | coupler/test_frozen_entropy
    if scheme is Scheme.ADIABATIC or not mechanical.get("adiabatic") or mechanical.get("thermoelastic_heat"):
        return []
    return ["mechanical.elastic.adiabatic: only windows of the scheme adiabatic heat what is compressed; with scheme: "
            f"{scheme.value} others leave that heat out: add thermoelastic_heat: true"]


# The heat capacity of a body that may expand, over that of one that is held, less 1, from which on it is told.
TOLD = 0.005


def held_capacity(mechanical: Mapping[str, Any], thermal: Mapping[str, Any], T: float) -> list[str]:
    """A sentence for each material whose `c` counts as that of a body that is held, where that makes a difference.

    What warms and expands cools by it: rho c_p = rho c_v + 9 kappa alpha^2 T, kappa the bulk modulus.
    mechanical, thermal : model.json of the halves.  T [K]: at the start.
    """
    # fault: nobody says that a handbook has another heat capacity -> if True: | coupler/test_frozen_entropy
    if not mechanical.get("thermoelastic_heat"):
        return []
    found = []
    for name, m in mechanical.get("materials", {}).items():
        heat = thermal.get("materials", {}).get(name, {})
        values = [m.get("E"), m.get("nu"), m.get("alpha"), heat.get("c"), heat.get("rho")]
        if any(v is None or (isinstance(v, Mapping) and "solid" in v) for v in values):
            continue
        E, nu, alpha, c, rho = (float(property_from(v)(np.array([T]))[0]) for v in values)
        more = 9.0 * E / (3.0 * (1.0 - 2.0 * nu)) * alpha**2 * T / (rho * c) if nu < 0.5 else 0.0
        if more > TOLD:
            found.append(f"material {name}: with thermoelastic_heat `c` is the heat capacity of what is held and does "
                         f"not expand. Where it may, it takes {100.0 * more:.3g} % more heat; if {c:g} J/kgK is that "
                         f"of a handbook (at constant pressure), write {c * (1.0 - more):.4g}")
    return found
