"""model.json of the halves `lumped` and `thermal_rod`: that of the thermal half, less what they have no use for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from contact.half.interface import Interface
from thermal_fmu.spec import Model, parse_model


def parse_station_model(interface: Interface, spec: Mapping[str, Any], half: str) -> Model:
    """The model a model.json of `half` describes.  Raises ValueError naming key, value and what would do."""
    if spec.get("half") != half:
        raise ValueError(f"model.json: half {spec.get('half')!r} is not {half}")
    model = parse_model(interface, {**spec, "half": "thermal"})
    if model.stepping.adaptive is not None:
        raise ValueError(f"model.json: adaptive: the half {half!r} takes its substeps as they are; leave it out")
    if model.stepping.method == "steady":
        raise ValueError(f"model.json: method: the half {half!r} has no method 'steady'; run it to its end instead")
    for name, field in _fields(model):
        if not field.is_uniform:
            raise ValueError(f"model.json: {name}: the half {half!r} takes data that depend on time alone")
    for body in model.bodies:
        if body.Q_T_factor is not None:
            raise ValueError(f"model.json: bodies.{body.name}.Q_T_factor: the half {half!r} has none")
        if body.material.k.k_2 is not None:
            raise ValueError(f"model.json: bodies.{body.name}: k has two axes, of which the half {half!r} knows one")
    return model


def _fields(model: Model) -> list[tuple[str, Any]]:
    return [*((f"bodies.{b.name}.Q_T", b.Q_T) for b in model.bodies),
            *(("a prescribed temperature", p.value) for p in model.prescribed),
            *(("a flux", q.value) for q in model.fluxes),
            *(("a convection", f) for film in model.films for f in (film.h, film.Te)),
            *(("a radiation", r.T_inf) for r in model.radiators)]
