"""model.json of both halves of a scenario, by role."""

from __future__ import annotations

import numpy as np

from contact.half.property import property_from
from coupler.scenario.context import FORMAT, Context, Model
from coupler.scenario.convert_material import properties_of
from coupler.scenario.kinds import OWN, check_kind
from coupler.scenario.mechanical_model import elastic_model, rigid_model
from coupler.scenario.quantity import did_you_mean
from coupler.scenario.schema_material import Material
from coupler.scenario.thermal_model import thermal_model

WRITERS = {"thermal": thermal_model, "elastic": elastic_model, "rigid": rigid_model}


def models(c: Context) -> dict[str, Model]:
    """role -> model.json.  Raises ScenarioError."""
    for name, body in c.file.bodies.items():
        if body.material not in c.file.materials:
            raise c.document.error(("bodies", name, "material"), f"there is no material {body.material!r}",
                                   did_you_mean(body.material, c.file.materials))
    kinds = {"thermal": c.file.thermal.half, "mechanical": c.file.mechanical.half}
    for role, kind in kinds.items():
        check_kind(c.document, role, kind)
    _positive_at_start(c)
    return {
        role: WRITERS[kind](c) if kind in OWN[role] else _foreign(c, role, kind)
        for role, kind in kinds.items()
    }


def _foreign(c: Context, role: str, kind: str) -> Model:
    """What a half of another package is told: everything the scene states, and its own options unchanged."""
    options = (c.file.thermal if role == "thermal" else c.file.mechanical).options
    return {"half": kind, "format": FORMAT, "options": options,
            "materials": {n: c.material(n, Material.model_fields) for n in c.file.materials},
            "bodies": {n: {"material": b.material, "T0": c.convert.kelvin(b.T0, ("bodies", n, "T0"))}
                       for n, b in c.file.bodies.items()},
            "pairs": {n: {} for n in c.file.contact}}


def _positive_at_start(c: Context) -> None:
    """A polynomial may turn negative somewhere; where the run begins it must not, in the phase it begins in."""
    for name, body in c.file.bodies.items():
        T0 = c.convert.kelvin(body.T0, ("bodies", name, "T0"))
        data = c.material(body.material, ("k", "c", "E", "latent"))
        absent = _absent_phase(data.pop("latent", None), T0)
        for key, spec in (found for datum in data for found in properties_of(data[datum], (datum,))):
            if key[-1] != absent and (value := float(property_from(spec)(np.array([T0]))[0])) <= 0:
                raise c.document.error(
                    ("materials", body.material, *key),
                    f"is {value:g} at the T0 of body {name!r}, but must be greater than zero",
                )


def _absent_phase(latent: Model | None, T: float) -> str:
    """The phase of which nothing is there at T [K]; empty where both may be."""
    if latent is None:
        return ""
    return "solid" if T > latent["T_l"] else "liquid" if T < latent["T_s"] else ""  # noqa: SIM300 (T is no constant)
