"""Thermal boundary conditions that contradict each other, leave a steady temperature open, or fail at the start."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

import numpy as np

from contact.half.property import property_from
from coupler.scenario.base import Polynomial
from coupler.scenario.context import Context
from coupler.scenario.document import Key
from coupler.scenario.schema_thermal import Method


def temperatures_once(c: Context, place: Key) -> None:
    """No place has two prescribed temperatures, of which one would be ignored.  Raises ScenarioError."""
    seen: dict[str, int] = {}
    for i, b in enumerate(c.file.thermal.boundary):
        if b.temperature is None:
            continue
        where = c.where(b, (*place, i))
        # fault: two temperatures on one place, the first ignored -> if seen.setdefault(where, i) > i: |
        #   coupler/test_scenario_thermal
        if seen.setdefault(where, i) != i:
            raise c.document.error(
                (*place, i, "at" if b.on is None else "on"),
                f"the temperature of {where} is already prescribed by entry {seen[where]}",
                "Keep one of the two; a temperature that changes in time is one SIGNAL.")


def steady_is_held(c: Context) -> None:
    """Under `steady` every body is tied to a temperature, by its surfaces or through pairs.  Raises ScenarioError.

    A source that depends on temperature may fix it too; whether it does, only the solution can say.
    """
    if c.file.thermal.method is not Method.STEADY:
        return
    # fault: a flux taken for something that holds a steady temperature -> held = {b.where.split(".")[0] for b in
    #   c.file.thermal.boundary} | coupler/test_scenario_thermal
    held = {b.where.split(".")[0] for b in c.file.thermal.boundary if b.flux is None}
    held |= {name for name, body in c.file.bodies.items() if body.Q_T_factor is not None}
    pairs = [{side.split(".")[0] for side in (p.slave, p.master)} for p in c.file.contact.values()
             if p.conduction is not None or p.radiation is not None]
    while reached := [sides for sides in pairs if sides & held and not sides <= held]:
        held = held.union(*reached)
    for name in c.file.bodies:
        if name not in held:
            raise c.document.error(
                ("bodies", name), f"method steady, but nothing fixes the temperature of body {name!r}",
                "Give a surface of it a temperature, convection or radiation, or choose a method that steps in time.")


def surfaces_work_at_start(c: Context, place: Key) -> None:
    """A polynomial emissivity or h_factor in its range at the T0 of its body: no smaller step could mend it later.

    Numbers and tables are checked where they are read.  Raises ScenarioError.
    """
    for spec, key, surface, most in _polynomials(c, place):
        body = surface.split(".")[0]
        # fault: an emissivity is held against the first body's T0 -> T0 =
        #   c.convert.kelvin(next(iter(c.file.bodies.values())).T0, ("bodies", body, "T0")) |
        #   coupler/test_scenario_thermal
        T0 = c.convert.kelvin(c.file.bodies[body].T0, ("bodies", body, "T0"))
        value = float(property_from(c.convert.property(spec, key))(np.array([T0]))[0])
        if not (0.0 < value <= most or (value == 0.0 and most == inf)):
            needed = "must not be negative" if most == inf else f"must be greater than zero and at most {most:g}"
            raise c.document.error(key, f"is {value:g} at the T0 of body {body!r}, but {needed}",
                                   "Mind T_ref: a polynomial counts temperatures from there.")


def _polynomials(c: Context, place: Key) -> Iterator[tuple[Polynomial, Key, str, float]]:
    """Each polynomial of a surface: where it stands, the surface, the most it may be (inf: a factor)."""
    found: list[tuple[object, Key, str, float]] = []
    for i, b in enumerate(c.file.thermal.boundary):
        if b.radiation is not None:
            found.append((b.radiation.emissivity, (*place, i, "radiation", "emissivity"), b.where, 1.0))
        if b.convection is not None:
            found.append((b.convection.h_factor, (*place, i, "convection", "h_factor"), b.where, inf))
    for name, pair in c.file.contact.items():
        if pair.radiation is not None:
            key: Key = ("contact", name, "radiation")
            found += [(pair.radiation.emissivity_slave, (*key, "emissivity_slave"), pair.slave, 1.0),
                      (pair.radiation.emissivity_master, (*key, "emissivity_master"), pair.master, 1.0)]
    return ((spec, key, surface, most) for spec, key, surface, most in found if isinstance(spec, Polynomial))
