"""Laws of conductance in a unit that was not meant: told with the unit in which they would be usual.

Of a reference pressure of 10, meant in MPa, a law of pressure conducts a million times too well, and a table whose
pressures are in MPa is read at its end all the time.  Neither looks wrong in a run: two bodies have one temperature.
"""

from __future__ import annotations

from collections.abc import Iterator

from contact.problem.laws import Cmy, Gas, LawSpec, Power, Sum, Table, TableVariable
from coupler.scenario.plausible import STRESS, USUAL, Usual, told_as
from coupler.scenario.schema import ScenarioFile
from coupler.scenario.unit_system import UnitSystem

PRESSURE = Usual(1e3, 1e11, "Pa", STRESS)
LENGTHS = {"um": 1e-6, "mm": 1e-3}
# Rubber to diamond; polished to sand-cast; of gases at a low pressure jump distances are long; gases, liquids, pastes.
HARDNESS = Usual(1e5, 2e11, "Pa", {"GPa": 1e9, "MPa": 1e6})
ROUGHNESS = Usual(1e-10, 1e-3, "m", LENGTHS)
# Of what is bonded; a metre of foam has 40 m2K/W.
RESISTANCE = Usual(0.0, 50.0, "m2K/W", {"mm2K/W": 1e-6, "cm2K/W": 1e-4})
JUMP, GAS_K = Usual(1e-10, 1.0, "m", LENGTHS), Usual(1e-4, 12.0, "W/mK", {"mW/mK": 1e-3})


def unlikely_laws(stated: ScenarioFile, units: UnitSystem | None) -> list[str]:
    """Return a sentence for each pair whose laws of conductance have numbers that a unit mistaken explains.

    stated : what the file says, in SI.  units : of the file's plain numbers, where they are not SI.
    """
    notes = []
    for name, pair in stated.contact.items():
        laws, R = pair.conduction, pair.resistance
        found = [] if R is None else [("resistance", R, RESISTANCE)]
        if laws is not None:
            found += [*_numbers(laws.closed, pressed=True), *_numbers(laws.open, pressed=False)]
        # fault: laws of conductance mean what they say -> odd: list[str] = [] | coupler/test_scenario_plausible_laws
        odd = [told_as(key, value, usual, units) for key, value, usual in found if not usual.holds(value)]
        if odd:
            what = "All numbers are SI" if units is None else f"Plain numbers are in {units.symbols} and s"
            notes.append(f"the conductance of pair {name}: {', '.join(odd)}; no engineering surface is near. {what}; "
                         "in a scene in units of its own this may stand")
    return notes


def _numbers(law: LawSpec | None, *, pressed: bool) -> Iterator[tuple[str, float, Usual]]:
    """The data of a law with what is usual of them.  pressed : it is that of surfaces in touch."""
    if isinstance(law, Power):
        yield "p0", law.p0, PRESSURE
    elif isinstance(law, Cmy):
        yield from (("k_s", law.k_s, USUAL["k"]), ("sigma", law.sigma, ROUGHNESS), ("H", law.H, HARDNESS))
    elif isinstance(law, Gas):
        yield from (("k_g", law.k_g, GAS_K), ("g_m", law.g_m, JUMP))
    elif isinstance(law, Table) and pressed and law.variable is TableVariable.X:
        yield "the end of x", law.x[-1], PRESSURE
    elif isinstance(law, Sum):
        for part in law.of:
            yield from _numbers(part, pressed=pressed)
