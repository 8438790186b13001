"""model.json of the thermal half, SI and kelvin (form: docs/design.md).

What the file leaves out is left out here too: the half then does no work for it.
"""

from __future__ import annotations

from coupler.scenario.base import Polynomial, PropertyTable
from coupler.scenario.context import FORMAT, Context, Model
from coupler.scenario.document import Key
from coupler.scenario.schema_contact import Conduction
from coupler.scenario.schema_thermal import (
    SIGMA_SB,
    Convection,
    NearRadiation,
    Radiation,
    RadiationGap,
    Thermal,
    ThermalBoundary,
)
from coupler.scenario.thermal_checks import steady_is_held, surfaces_work_at_start, temperatures_once


def thermal_model(c: Context) -> Model:
    """The model of the half `thermal`.  Raises ScenarioError."""
    thermal = c.file.thermal
    c.no_options("thermal", thermal.options)
    place: Key = ("thermal", "boundary")
    c.names_once(thermal.boundary, place)
    temperatures_once(c, place)
    steady_is_held(c)
    surfaces_work_at_start(c, place)
    return {
        "half": "thermal",
        "format": FORMAT,
        **_stepping(thermal),
        "materials": c.materials("thermal", ("rho", "k", "c"), also=("latent",)),
        "bodies": {n: _body(c, n) for n in c.file.bodies},
        "boundary": [_boundary(c, b, (*place, i)) for i, b in enumerate(thermal.boundary)],
        "pairs": {n: _pair(c, n) for n in c.file.contact},
    }


def _stepping(thermal: Thermal) -> Model:
    model: Model = {"method": thermal.method.value, "tolerance": thermal.tolerance}
    for key in ("theta", "increments"):
        if getattr(thermal, key) is not None:
            model[key] = getattr(thermal, key)
    if thermal.adaptive is not None:
        # fault: inner tolerance converted like a temperature -> model["adaptive"] = {k: v + 273.15 for k, v in
        #   thermal.adaptive.model_dump(exclude_none=True).items()} | coupler/test_scenario_thermal
        model["adaptive"] = thermal.adaptive.model_dump(exclude_none=True)
    return model | ({"sigma_SB": thermal.sigma_SB} if thermal.sigma_SB != SIGMA_SB else {})


def _body(c: Context, name: str) -> Model:
    body, key = c.file.bodies[name], ("bodies", name)
    return {"material": body.material, "T0": c.convert.kelvin(body.T0, (*key, "T0")),
            # fault: factor of a source dropped on its way to the half -> "Q_T": c.convert.field(body.Q_T, (*key,
            #   "Q_T")), **_factor(c, "Q_T_factor", None, key)} | thermal_fmu/test_thermal_fmu
            "Q_T": c.convert.field(body.Q_T, (*key, "Q_T")), **_factor(c, "Q_T_factor", body.Q_T_factor, key)}


def _factor(c: Context, name: str, spec: float | PropertyTable | Polynomial | None, key: Key) -> Model:
    return {} if spec is None else {name: c.convert.property(spec, (*key, name))}


def _boundary(c: Context, boundary: ThermalBoundary, key: Key) -> Model:
    common = c.common(boundary, key)
    on = common["on"]
    if boundary.temperature is not None:
        value = c.temperatures(boundary.temperature, (*key, "temperature"), on)
        return {"kind": "temperature", "value": value, **common}
    if boundary.flux is not None:
        return {"kind": "flux", "value": c.convert.field(boundary.flux, (*key, "flux")), **common}
    if boundary.radiation is not None:
        return {"kind": "radiation", **_radiation(c, boundary.radiation, (*key, "radiation"), on), **common}
    assert boundary.convection is not None
    return {"kind": "convection", **_convection(c, boundary.convection, (*key, "convection"), on), **common}


def _convection(c: Context, film: Convection, key: Key, on: str) -> Model:
    gap = film.gap
    return {"h": c.not_negative(film.h, (*key, "h"), on), **_factor(c, "h_factor", film.h_factor, key),
            "T": c.temperatures(film.T, (*key, "T"), on), "exponent": film.exponent,
            "d_cut": None if gap is None else gap.d_cut, "d_full": None if gap is None else gap.d_full}


def _radiation(c: Context, radiation: Radiation, key: Key, on: str) -> Model:
    # fault: emissivity halved on its way to the half -> return {"emissivity": c.convert.property(0.5 *
    #   radiation.emissivity, (*key, "emissivity")), | thermal_fmu/test_thermal_fmu
    return {"emissivity": c.convert.property(radiation.emissivity, (*key, "emissivity")),
            "T": c.temperatures(radiation.T, (*key, "T"), on), **_blend(radiation.gap)}


def _blend(gap: RadiationGap | None) -> Model:
    return {"d_near": None if gap is None else gap.d_near, "d_far": None if gap is None else gap.d_far}


def _pair(c: Context, name: str) -> Model:
    pair, key = c.file.contact[name], ("contact", name)
    model = _conduction(c, pair.conduction, (*key, "conduction"))
    if pair.radiation is not None:
        model["radiation"] = _near_radiation(c, pair.radiation, (*key, "radiation"))
    if pair.friction is not None and pair.friction.share is not None:
        model["friction_share"] = pair.friction.share
    return model


def _near_radiation(c: Context, radiation: NearRadiation, key: Key) -> Model:
    sides = ("emissivity_slave", "emissivity_master")
    return {**{side: c.convert.property(getattr(radiation, side), (*key, side)) for side in sides},
            **_blend(radiation.gap)}


def _conduction(c: Context, law: Conduction | None, key: Key) -> Model:
    if law is None:
        return {"closed": None, "open": None, "closed_factor": 1.0, "open_factor": 1.0}
    return {"closed": _law(c, law.closed, (*key, "closed")), "open": _law(c, law.open, (*key, "open")),
            "closed_factor": c.convert.signal(law.closed_factor, (*key, "closed_factor"), least=0.0),
            "open_factor": c.convert.signal(law.open_factor, (*key, "open_factor"), least=0.0)}


def _law(c: Context, law: Model | None, key: Key) -> Model | None:
    """A law with the temperatures of its tables in K, those within sums too."""
    if law is None:
        return None
    if law["law"] == "sum":
        return {**law, "of": [_law(c, part, (*key, "of", i)) for i, part in enumerate(law["of"])]}
    # fault: tables of conductance left in degC -> if False: | coupler/test_scenario_laws
    if law.get("variable") == "T":
        return {**law, "x": [c.convert.kelvin(T, (*key, "x", i)) for i, T in enumerate(law["x"])]}
    return law
