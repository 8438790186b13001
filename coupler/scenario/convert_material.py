"""Data of a material as model.json has them: SI, kelvin, radians."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import radians

from coupler.scenario.base import Polynomial, PropertyTable
from coupler.scenario.convert import Convert, Json
from coupler.scenario.document import Key
from coupler.scenario.schema_material import Axes, Latent, Phases


def datum(convert: Convert, spec: float | PropertyTable | Polynomial | Phases | Axes | Latent, key: Key) -> Json:
    """A PROPERTY, PHASED, CONDUCTIVITY or latent heat of model.json.  Raises ScenarioError below 0 K."""
    if isinstance(spec, Phases):
        return {name: convert.property(getattr(spec, name), (*key, name)) for name in ("solid", "liquid")}
    if isinstance(spec, Axes):
        return {**{name: datum(convert, getattr(spec, name), (*key, name)) for name in ("k_1", "k_2")},
                # fault: degrees taken for radians -> "angle": spec.angle, "turns": spec.turns} |
                #   coupler/test_scenario_thermal
                "angle": radians(spec.angle), "turns": spec.turns}
    if isinstance(spec, Latent):
        keys = ("T_m", "T_m") if spec.T_m is not None else ("T_s", "T_l")
        T_s, T_l = (convert.kelvin(T, (*key, name)) for T, name in zip(spec.limits, keys, strict=True))
        # fault: latent heat halved on its way to the half -> return {"L": 0.5 * spec.L, "T_s": T_s, "T_l": T_l} |
        #   thermal_fmu/test_thermal_fmu
        return {"L": spec.L, "T_s": T_s, "T_l": T_l}
    return convert.property(spec, key)


def properties_of(datum: Json, key: Key) -> Iterator[tuple[Key, Json]]:
    """Every PROPERTY inside a datum of model.json, with its key."""
    parts = [n for n in ("solid", "liquid", "k_1", "k_2") if isinstance(datum, Mapping) and n in datum]
    for name in parts:
        yield from properties_of(datum[name], (*key, name))
    if not parts:
        yield key, datum
