"""model.json of the thermal half, SI and kelvin (form: docs/design.md)."""

from __future__ import annotations

from coupler.scenario.context import FORMAT, Context, Model
from coupler.scenario.document import Key
from coupler.scenario.schema_halves import Convection, ThermalBoundary


def thermal_model(c: Context) -> Model:
    """The model of the half `thermal`.  Raises ScenarioError."""
    thermal = c.file.thermal
    c.no_options("thermal", thermal.options)
    place: Key = ("thermal", "boundary")
    c.names_once(thermal.boundary, place)
    return {
        "half": "thermal",
        "format": FORMAT,
        "method": thermal.method.value,
        "tolerance": thermal.tolerance,
        "materials": c.materials("thermal", ("rho", "k", "c")),
        "bodies": {
            n: {
                "material": b.material,
                "T0": c.convert.kelvin(b.T0, ("bodies", n, "T0")),
                "Q_T": c.convert.signal(b.Q_T, ("bodies", n, "Q_T")),
            }
            for n, b in c.file.bodies.items()
        },
        "boundary": [_boundary(c, b, (*place, i)) for i, b in enumerate(thermal.boundary)],
        "pairs": {n: _conduction(c, n) for n in c.file.contact},
    }


def _boundary(c: Context, boundary: ThermalBoundary, key: Key) -> Model:
    common = c.common(boundary, key)
    if boundary.temperature is not None:
        value = c.convert.temperature(boundary.temperature, (*key, "temperature"))
        return {"kind": "temperature", "value": value, **common}
    if boundary.flux is not None:
        return {"kind": "flux", "value": c.convert.signal(boundary.flux, (*key, "flux")), **common}
    assert boundary.convection is not None
    return {"kind": "convection", **_convection(c, boundary.convection, (*key, "convection")), **common}


def _convection(c: Context, film: Convection, key: Key) -> Model:
    gap = film.gap
    return {"h": c.convert.signal(film.h, (*key, "h"), least=0.0),
            "T": c.convert.temperature(film.T, (*key, "T")), "exponent": film.exponent,
            "d_cut": None if gap is None else gap.d_cut, "d_full": None if gap is None else gap.d_full}


def _conduction(c: Context, name: str) -> Model:
    law, key = c.file.contact[name].conduction, ("contact", name, "conduction")
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
    if law.get("variable") == "T":
        return {**law, "x": [c.convert.kelvin(T, (*key, "x", i)) for i, T in enumerate(law["x"])]}
    return law
