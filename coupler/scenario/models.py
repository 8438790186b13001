"""model.json of both halves of a scenario, by role."""

from __future__ import annotations

import numpy as np

from contact.half.property import property_from
from coupler.scenario.context import FORMAT, Context, Model
from coupler.scenario.convert_material import properties_of
from coupler.scenario.kinds import OWN, check_kind, fmu_path
from coupler.scenario.mechanical_model import augmented, elastic_model, rigid_model
from coupler.scenario.quantity import did_you_mean
from coupler.scenario.rod_model import lumped_model, mechanical_rod_model, thermal_rod_model
from coupler.scenario.schema_material import Material
from coupler.scenario.thermal_model import thermal_model

WRITERS = {"thermal": thermal_model, "lumped": lumped_model, "thermal_rod": thermal_rod_model,
           "elastic": elastic_model, "rigid": rigid_model, "mechanical_rod": mechanical_rod_model}


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
        role: WRITERS[OWN[role][kind]](c) if kind in OWN[role] else _foreign(c, role, kind)
        for role, kind in kinds.items()
    }


def _foreign(c: Context, role: str, kind: str) -> Model:
    """What a half of another package is told: everything the scene states, and its own options unchanged.

    An FMU that lies ready was built before and is told nothing; its `half` is where it lies.
    """
    fmu = fmu_path(kind, c.document.path.parent)
    options = (c.file.thermal if role == "thermal" else c.file.mechanical).options
    return {"half": kind if fmu is None else str(fmu), "format": FORMAT, "options": options,
            "materials": {n: c.material(n, Material.model_fields) for n in c.file.materials},
            "bodies": {n: {"material": b.material, "T0": c.convert.kelvin(b.T0, ("bodies", n, "T0"))}
                       for n, b in c.file.bodies.items()},
            "pairs": {n: augmented(p) if role == "mechanical" else {} for n, p in c.file.contact.items()}}


def _positive_at_start(c: Context) -> None:
    """A polynomial may turn negative somewhere; where a body begins, and where it melts, it must not."""
    for name, body in c.file.bodies.items():
        T0 = c.convert.kelvin(body.T0, ("bodies", name, "T0"))
        data = c.material(body.material, ("k", "c", "E", "latent"))
        latent = data.pop("latent", None)
        for key, spec in (found for datum in data for found in properties_of(data[datum], (datum,))):
            for T in _met(T0, latent, str(key[-1])):
                if (value := float(property_from(spec)(np.array([T]))[0])) <= 0:
                    where = "T0" if T == T0 else "melting point"
                    raise c.document.error(
                        ("materials", body.material, *key),
                        f"is {value:g} at the {where} of body {name!r}, but must be greater than zero",
                    )


def _met(T0: float, latent: Model | None, phase: str) -> tuple[float, ...]:
    """Temperatures [K] that a property is sure to meet, or near to it: of a phase only where there is some of it."""
    if latent is None:
        return (T0,)
    T_s, T_l = latent["T_s"], latent["T_l"]
    return {"solid": (min(T0, T_s), T_s), "liquid": (max(T0, T_l), T_l)}.get(phase, (T0, T_s, T_l))
