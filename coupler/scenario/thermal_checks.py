"""Thermal boundary conditions that contradict each other, or leave a steady temperature open."""

from __future__ import annotations

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
