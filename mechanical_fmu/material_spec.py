"""A material of model.json, checked and made."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from contact.half.checks import keys, known, made, number
from contact.half.property import Property, positive_property, property_from
from mechanical_fmu.flow_laws import NOTHING, ONE, Curves, Flow, Liquid, Norton, Plastic, PowerLaw, Voce
from mechanical_fmu.material import ELASTIC, Material
from mechanical_fmu.point_layout import CUBIC, SLOPED

Floats = NDArray[np.float64]

DEFAULT_CHI = 0.9  # Taylor and Quinney's share for metals at large strain
LAWS = ("linear", "voce", "table")


def parse_material(name: str, spec: Any, others: Iterable[str] = ("rho", "c")) -> Material:
    """The material a model.json describes.  others : keys that are read elsewhere.

    Raises ValueError naming the key, the value and what would do.
    """
    where = f"materials.{name}"
    keys(spec, where, {"E", "nu"}, {"alpha", "T_ref", "plastic", "creep", "liquid", *others})
    T_ref = number(spec.get("T_ref", 0.0), f"{where}.T_ref")
    material = Material(name, _positive(spec, "E", where, "Young's modulus"), _poisson(spec["nu"], f"{where}.nu"),
                        _property(spec, "alpha", where, NOTHING), T_ref, _flow(spec, where))
    if material.kind and (why := material.flow.refusal(_temperatures(spec, T_ref))):
        raise ValueError(f"model.json: {where}: {why}")
    return material


def _flow(spec: Mapping[str, Any], where: str) -> Flow:
    if not {"plastic", "creep", "liquid"} & set(spec):
        return ELASTIC
    plastic = _plastic(spec["plastic"], f"{where}.plastic") if "plastic" in spec else None
    creep = _creep(spec["creep"], f"{where}.creep") if "creep" in spec else None
    liquid = _liquid(spec["liquid"], f"{where}.liquid") if "liquid" in spec else None
    if plastic and plastic.kinematic and creep:
        raise ValueError(f"model.json: {where}: creep does not go with a kinematic backstress, which would have to "
                         "creep too; give plastic.overstress instead of creep, or leave plastic.kinematic out")
    return Flow(plastic, creep, liquid, plastic.data if plastic else np.empty(0))


def _plastic(spec: Any, where: str) -> Plastic:
    keys(spec, where, set(), {"yield", "hardening", "factor", "kinematic", "overstress", "chi", "softening"})
    softening = spec.get("softening", False)
    if not isinstance(softening, bool):
        raise ValueError(f"model.json: {where}.softening must be true or false, not {softening!r}")
    kinematic = keys(spec.get("kinematic", {"C": 0.0}), f"{where}.kinematic", {"C"}, {"gamma"})
    overstress = keys(spec.get("overstress", {"K": 0.0, "m": 1.0}), f"{where}.overstress", {"K", "m"})
    return Plastic(
        hardening=_hardening(spec, where), factor=_property(spec, "factor", where, ONE),
        C=_property(kinematic, "C", f"{where}.kinematic", NOTHING),
        gamma=_property(kinematic, "gamma", f"{where}.kinematic", NOTHING),
        K=_property(overstress, "K", f"{where}.overstress", NOTHING),
        m=_exponent(overstress["m"], f"{where}.overstress.m"), chi=_share(spec, "chi", where, DEFAULT_CHI),
        softening=softening, kinematic="kinematic" in spec, overstress="overstress" in spec)


def _hardening(spec: Mapping[str, Any], where: str) -> Voce | Curves:
    at = f"{where}.hardening"
    law = spec.get("hardening", {"law": "linear", "H": 0.0})
    kind = known(keys(law, at, {"law"}, law)["law"], f"{at}.law", LAWS)
    if kind == "table":
        if "yield" in spec:
            raise ValueError(f"model.json: {where}.yield: a table begins with the yield stress; leave it out "
                             "(factor scales the table by temperature)")
        return _curves(law, at)
    keys(spec, where, {"yield"}, spec)
    s0 = _positive(spec, "yield", where, "the yield stress")
    if kind == "linear":
        return Voce(s0, H=_property(keys(law, at, {"law", "H"}), "H", at, NOTHING))
    keys(law, at, {"law", "Q", "b"}, {"H"})
    b = number(law["b"], f"{at}.b", 0.0)
    return Voce(s0, _property(law, "Q", at, NOTHING), b, _property(law, "H", at, NOTHING))


def _curves(law: Mapping[str, Any], where: str) -> Curves:
    keys(law, where, {"law", "strain", "stress"}, {"T", "form", "beyond"})
    strain, T = _numbers(law["strain"], f"{where}.strain"), _numbers(law.get("T", [0.0]), f"{where}.T")
    rows = law["stress"] if "T" in law else [law["stress"]]
    if not isinstance(rows, list | tuple) or len(rows) != len(T):
        raise ValueError(f"model.json: {where}.stress needs one list for each of the {len(T)} temperatures in T")
    stress = [_numbers(row, f"{where}.stress") for row in rows]
    if strain.size < 2 or strain[0] != 0.0 or (np.diff(strain) <= 0.0).any():
        raise ValueError(f"model.json: {where}.strain must begin at 0, increase, and have at least two values")
    if (np.diff(T) <= 0.0).any():
        raise ValueError(f"model.json: {where}.T must increase")
    for row in stress:
        if row.size != strain.size or (row <= 0.0).any():
            raise ValueError(f"model.json: {where}.stress needs {strain.size} positive values, one for each strain")
    cubic = known(law.get("form", "linear"), f"{where}.form", ("linear", "cubic")) == "cubic"
    sloped = known(law.get("beyond", "flat"), f"{where}.beyond", ("flat", "slope")) == "slope"
    slope = [PchipInterpolator(strain, row).derivative()(strain) if cubic
             else np.append(d := np.diff(row) / np.diff(strain), d[-1]) for row in stress]
    return Curves(strain, T, np.array(stress), np.array(slope), CUBIC * cubic + SLOPED * sloped)


def _creep(spec: Any, where: str) -> Norton | PowerLaw:
    if isinstance(spec, Mapping) and "K" in spec:
        keys(spec, where, {"K", "m"}, {"heat"})
        return PowerLaw(_positive(spec, "K", where, "K"), _exponent(spec["m"], f"{where}.m"),
                        _share(spec, "heat", where, 1.0))
    keys(spec, where, {"A", "n"}, {"Q", "heat"})
    return Norton(_property(spec, "A", where, NOTHING), number(spec["n"], f"{where}.n", 0.0),
                  number(spec.get("Q", 0.0), f"{where}.Q", 0.0, low_itself=True), _share(spec, "heat", where, 1.0))


def _liquid(spec: Any, where: str) -> Liquid:
    keys(spec, where, {"eta", "bulk", "T_s", "T_l"}, {"shrinkage", "heat"})
    T_s, T_l = number(spec["T_s"], f"{where}.T_s", 0.0), number(spec["T_l"], f"{where}.T_l", 0.0)
    if T_s > T_l:
        raise ValueError(f"model.json: {where}: T_s = {T_s:g} K, where melting begins, must not be above "
                         f"T_l = {T_l:g} K, where it ends")
    return Liquid(_positive(spec, "eta", where, "the viscosity"), _positive(spec, "bulk", where, "the bulk modulus"),
                  T_s, T_l, number(spec.get("shrinkage", 0.0), f"{where}.shrinkage", -0.5, 0.5),
                  _share(spec, "heat", where, 1.0))


def _poisson(spec: Any, where: str) -> Property:
    if not isinstance(spec, Mapping):
        return Property(number(spec, where, -1.0, 0.5))
    for value in spec.get("value", ()):
        number(value, where, -1.0, 0.5)
    return made(property_from, spec, where)


def _positive(spec: Mapping[str, Any], key: str, where: str, what: str) -> Property:
    return made(lambda s: positive_property(s, what), spec[key], f"{where}.{key}")


def _property(spec: Mapping[str, Any], key: str, where: str, default: Property) -> Property:
    return made(property_from, spec[key], f"{where}.{key}") if key in spec else default


def _share(spec: Mapping[str, Any], key: str, where: str, default: float) -> float:
    share = number(spec.get(key, default), f"{where}.{key}", 0.0, low_itself=True)
    if share > 1.0:
        raise ValueError(f"model.json: {where}.{key} is a share, from 0 to 1, not {share!r}")
    return share


def _exponent(value: Any, where: str) -> float:
    m = number(value, where, 0.0)
    if m > 1.0:
        raise ValueError(f"model.json: {where} must lie above 0 and be at most 1, not {value!r}")
    return m


def _numbers(values: Any, where: str) -> Floats:
    if not isinstance(values, list | tuple) or not values:
        raise ValueError(f"model.json: {where} must be a list of numbers, not {values!r}")
    return np.array([number(v, f"{where}[{i}]") for i, v in enumerate(values)])


def _temperatures(spec: Any, T_ref: float) -> Floats:
    """Temperatures at which the tables inside a spec have knots; T_ref (or 1 K) where there are none.  Ascending."""
    found: set[float] = set()
    todo = [spec]
    while todo:
        part = todo.pop()
        if isinstance(part, Mapping):
            if isinstance(part.get("T"), list | tuple):
                found |= {float(T) for T in part["T"]}
            todo += part.values()
    return np.array(sorted(T for T in found if T > 0.0) or [max(T_ref, 1.0)])
