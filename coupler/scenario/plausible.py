"""Numbers far from those of engineering: most often a unit other than SI, or degrees for kelvin.

Limits leave room around what materials have (of solids, melts and gases, foams and rubbers to diamond; CRC Handbook of
Chemistry and Physics, Ashby's charts); what lies outside is told, with the unit that would bring it inside.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from contact.half.interface import Interface
from contact.problem.curves import Polynomial, PropertyTable
from contact.problem.errors import wrongs
from contact.problem.material import Material
from contact.problem.part import properties_in
from contact.problem.units import unit_from
from coupler.scenario.schema import ScenarioFile
from coupler.scenario.si import ZERO_CELSIUS
from coupler.scenario.unit_system import UnitSystem

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Usual:
    """least, most : of the magnitude, in SI; 0 is always usual.  unit : SI.  slips : other unit -> its size in SI."""

    least: float
    most: float
    unit: str
    slips: Mapping[str, float]

    def slip(self, value: float) -> str:
        """The unit in which the value would be usual, or ""."""
        return next((name for name, size in self.slips.items() if self.holds(value * size)), "")

    def holds(self, value: float) -> bool:
        """Whether a value is usual."""
        return value == 0.0 or self.least <= abs(value) <= self.most


STRESS = {"MPa": 1e6, "GPa": 1e9}
USUAL = {
    "E": Usual(1e4, 1.3e12, "Pa", {"GPa": 1e9, "MPa": 1e6}),
    "rho": Usual(0.05, 2.3e4, "kg/m3", {"g/cm3": 1e3, "t/mm3": 1e12}),
    "c": Usual(80.0, 1.5e4, "J/kgK", {"kJ/kgK": 1e3, "mJ/tK": 1e-6}),
    "k": Usual(5e-3, 6e3, "W/mK", {"W/mmK": 1e3}),
    "alpha": Usual(0.0, 1e-3, "1/K", {"1e-6/K": 1e-6}),
    "latent.L": Usual(500.0, 1e7, "J/kg", {"kJ/kg": 1e3}),
    "plastic.s_y": Usual(1e3, 1e11, "Pa", STRESS),
    "plastic.hardening.stress": Usual(1e3, 1e11, "Pa", STRESS),
    "plastic.hardening.Q": Usual(1e3, 1e11, "Pa", STRESS),
    # From rubbers to what hardens as it stretches.  Of K the unit has the seconds of the file, which are seconds.
    # fault: what hardens by 1000 Pa is taken for what it says -> "plastic.hardening.H": Usual(0.0, 1e13, "Pa", STRESS),
    #   | coupler/test_scenario_plausible_flow
    "plastic.hardening.H": Usual(1e5, 1e13, "Pa", STRESS),
    "plastic.kinematic.C": Usual(1e5, 1e14, "Pa", STRESS),
    "plastic.overstress.K": Usual(1e3, 1e12, "Pa", STRESS),
    "creep.K": Usual(1e2, 1e13, "Pa", STRESS),
    "creep.Q": Usual(3e3, 3e6, "J/mol", {"kJ/mol": 1e3}),  # hydrogen bonds to a hundred times those of metals
    "liquid.bulk": Usual(1e6, 1e12, "Pa", STRESS),
}
# What is stiff everywhere (STIFF) flows at no less: lead and salt at 1e6, metals next to melting at 1e5 Pa.
STIFF_S_Y = Usual(1e5, 1e10, "Pa", {**STRESS, "kPa": 1e3})
SOLID_RHO = 12.0  # kg/m3; a solid is no lighter
DENSE, DENSE_E = 1500.0, 1e7  # kg/m3, Pa: what is denser than foams, gels and rubbers is stiffer than they are, too
STIFF, STIFF_K = 3e10, 0.45  # Pa, W/mK: what is dense and so stiff (metals, stone, ceramics) conducts better than that
LENGTH = Usual(1e-6, 10.0, "m", {"mm": 1e-3, "um": 1e-6})
# Spacing of coordinates where a body is drawn, in lengths of its shortest edge.  Stiff bodies in contact find no
# equilibrium to 1e-8 of their forces from about 5e-10 on (3 mm at 10 km); at 4e-11 they do as at the origin.
ROUNDED = 2e-10
COLD = (10.0, 60.0)  # K; written so, a temperature at the start is rather in degrees Celsius
# A reference temperature so far from the start [K], though it is that of a room in the other unit, is in that one.
APART, ROOM = 150.0, (273.0, 303.0)
ROOM_K = (293.0, 293.15, 298.0, 298.15)  # as authors write them in kelvin


def unlikely(stated: ScenarioFile, interface: Interface, units: UnitSystem | None = None) -> list[str]:
    """Return a sentence for each material, and one for the bodies, whose numbers are far from those of engineering.

    stated : what the file says, in SI.  units : of the file's plain numbers, where they are not SI.
    """
    used = {part.material for body in stated.bodies.values() for part in body.parts.values()}
    notes = unlikely_materials({name: stated.materials[name] for name in used & stated.materials.keys()}, units)
    x = interface.nodes
    for k, body in enumerate(interface.bodies):
        own = x[interface.node_body == k]
        size = float((own.max(axis=0) - own.min(axis=0)).max())
        if not LENGTH.holds(size):
            slip = LENGTH.slip(size)
            what = "metres" if units is None else units.length
            notes.append(f"body {body} is {size:.3g} m long" + (f": is {slip} meant? Lengths are in {what}, those of a "
                         "mesh file times its `unit`" if slip else ""))
        notes.extend(_far(body, own, _shortest_edge(interface, k)))
    return notes + _cold(stated) + _warm(stated) + _reference(stated)


def _far(body: str, x: Floats, edge: float) -> Iterator[str]:
    """Yield a sentence on a body whose coordinates x : (n, 2) [m] are rounded too coarsely for its edges."""
    far = float(np.abs(x).max())
    unit = float(np.spacing(far))
    # fault: a body far from the origin is not told -> if False: | coupler/test_scenario_plausible
    if unit > ROUNDED * edge:
        yield (f"body {body} lies {far:.3g} m from the origin, where coordinates are rounded to {unit:.2g} m, "
               f"{unit / edge:.1g} of its shortest edge: steps may find no equilibrium, and pressures vary. "
               "Draw the scene near the origin")


def _shortest_edge(interface: Interface, body: int) -> float:
    """Return the length of the shortest edge of the cells of a body [m]."""
    own = (interface.quads[interface.quad_body == body], interface.triangles[interface.triangle_body == body])
    return min((float(np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2).min())
                for x in (interface.nodes[cells] for cells in own) if x.size), default=np.inf)


def unlikely_materials(materials: Mapping[str, Material], units: UnitSystem | None) -> list[str]:
    """Return a sentence for each material whose numbers are far from those of engineering."""
    notes = []
    for name in sorted(materials):
        # fault: numbers far from any material's pass without a word -> told: list[str] = [] |
        #   coupler/test_scenario_plausible
        told = [told_as(*odd, units) for odd in _odd(materials[name])]
        if told:
            what = "All numbers are SI" if units is None else f"Plain numbers are in {units.symbols} and s"
            notes.append(f"material {name}: {', '.join(told)}; no engineering material is near. {what}; "
                         "in a scene in units of its own this may stand")
    return notes


def unlikely_text(tree: Mapping[str, Any], units: UnitSystem | None) -> list[str]:
    """Return the same of a file whose form is wrong: of the data of its materials that can be read.

    tree : the values of the file, plain numbers in SI.
    """
    materials = tree.get("materials")
    if not isinstance(materials, Mapping):
        return []
    return unlikely_materials({name: _readable(spec) for name, spec in materials.items() if isinstance(spec, Mapping)},
                              units)


def _readable(spec: Mapping[str, Any]) -> Material:
    """The material of a mapping without the keys that are wrong."""
    while True:
        try:
            return Material.model_validate(spec)
        except ValidationError as exc:
            wrong = {w.key[0] for w in wrongs(exc) if w.key}
            if not wrong & spec.keys():
                return Material()
            spec = {key: value for key, value in spec.items() if key not in wrong}


def _odd(material: Material) -> Iterator[tuple[str, float, Usual]]:
    """The data of a material that are not usual, the farthest value of each, and what would be."""
    for key, usual in USUAL.items():
        if key == "rho" and material.E is not None:
            usual = replace(usual, least=SOLID_RHO)
        # fault: 210000 meant in MPa is taken for the stiffness of a metal -> if False: |
        #   coupler/test_scenario_plausible
        if key == "E" and _above(material, "rho", DENSE):
            usual = replace(usual, least=DENSE_E)
        # fault: steel's 0.05 W/mmK is taken for the conductivity of an insulator -> if False: |
        #   coupler/test_scenario_plausible
        if key == "k" and _above(material, "rho", DENSE) and _above(material, "E", STIFF):
            usual = replace(usual, least=STIFF_K)
        # fault: steel's 50000 meant in kPa is taken for what it says -> if False: | coupler/test_scenario_plausible
        if key == "plastic.s_y" and _above(material, "E", STIFF) and not _above(material, key, STIFF_S_Y.least, max):
            usual = STIFF_S_Y
        for values in _values(material, key):
            # A stray value of a table is a fit's; a unit moves all of them.
            if values and not any(usual.holds(v) for v in values):
                yield key, max(values, key=abs), usual
                break


def _above(material: Material, key: str, least: float, of: Callable[[Sequence[float]], float] = min) -> bool:
    """Whether a part of a property is above a bound everywhere, or with max for `of`, somewhere."""
    return any(of(values) > least for values in _values(material, key) if values)


def _values(material: Material, key: str) -> Iterator[list[float]]:
    """The values of a property, a list for each of its parts (directions, states)."""
    holder: Any = material
    for name in key.split("."):
        holder = getattr(holder, name, None)
    for _, spec in properties_in(holder, ()):
        if isinstance(spec, tuple):  # of a table of hardening: a list, or one for each temperature
            yield [v for v in np.ravel(np.array(spec, dtype=float)).tolist() if v != 0.0]
        elif isinstance(spec, PropertyTable):
            yield [v for v in spec.value if v != 0.0]
        else:
            # Of a polynomial what it has where its argument is 0.
            yield [spec.polynomial[0] if isinstance(spec, Polynomial) else float(spec)]


def told_as(key: str, value: float, usual: Usual, units: UnitSystem | None) -> str:
    """Return a number that is not usual in words, with the unit in which it would be."""
    if units is not None:
        powers = unit_from(usual.unit).powers
        plain, size = value / float(units.factor(powers)), units.name(powers)
        # fault: SI in a file in mm, MPa is told without its slip -> meant = "" |
        #   coupler/test_scenario_file_units::test_a_number_in_si_is_told
        meant = f" (in {usual.unit} it would be usual)" if usual.holds(plain) and plain != value else ""
        return f"{key} is {plain:g} {size}{meant}"
    slip = usual.slip(value)
    meant = f" (in {slip} it would be {value * usual.slips[slip]:.4g})" if slip else ""
    return f"{key} is {value:g} {usual.unit}{meant}"


def _cold(stated: ScenarioFile) -> list[str]:
    """Bodies that start near absolute zero in a file in kelvin."""
    # fault: 20 in a file in kelvin is taken for what it says -> if True: | coupler/test_scenario_plausible
    if stated.units.temperature.value != "K":
        return []
    starts = {name: float(body.T0) for name, body in stated.bodies.items() if isinstance(body.T0, int | float)}
    cold = [name for name, T0 in starts.items() if COLD[0] <= T0 <= COLD[1]]
    if not cold:
        return []
    T0 = starts[cold[0]]
    return [f"bod{'ies' if len(cold) > 1 else 'y'} {', '.join(cold)} start{'s' * (len(cold) == 1)} at {T0:g} K "
            f"({T0 - 273.15:g} degC): for degrees Celsius write units: {{temperature: degC}}"]


def _warm(stated: ScenarioFile) -> list[str]:
    """Bodies that start at a room's temperature in kelvin in a file in degC, though their T_ref is that of a room."""
    notes = {}
    for name, body in stated.bodies.items():
        for part in body.parts.values():
            material, T0 = stated.materials.get(part.material), part.T0
            T_ref = None if material is None or material.alpha in (None, 0) else material.T_ref
            if stated.units.temperature.value != "degC" or T_ref is None or not isinstance(T0, int | float):
                continue
            plain, ref = (round(T - ZERO_CELSIUS, 6) for T in (T0, T_ref))
            # fault: a start at 293 in a file in degC is taken for what it says -> if True: |
            #   coupler/test_scenario_plausible
            if plain not in ROOM_K or not ROOM[0] <= T_ref <= ROOM[1]:
                continue
            notes[name] = (f"body {name} starts at {plain:g} degC, with the strain of {plain - ref:.3g} K from T_ref "
                           f"of {part.material}: is {plain:g} K meant?")
    return list(notes.values())


def _reference(stated: ScenarioFile) -> list[str]:
    """Materials free of stress at the temperature of a room, written in the other unit.  stated : in kelvin."""
    own = stated.units.temperature.value
    other, (low, high), zero = ("degC", COLD, 0.0) if own == "K" else ("K", ROOM, ZERO_CELSIUS)
    notes = {}
    for body in stated.bodies.values():
        for part in body.parts.values():
            material = stated.materials.get(part.material)
            T0, T_ref = part.T0, None if material is None or material.alpha in (None, 0) else material.T_ref
            if T_ref is None or not isinstance(T0, int | float):
                continue
            # fault: 293 in a file in degC is taken for what it says -> if True: | coupler/test_scenario_plausible
            if not (low <= T_ref - zero <= high and abs(T_ref - T0) > APART):
                continue
            notes[part.material] = (
                f"material {part.material}: T_ref is {T_ref - zero:g} {own}, and bodies of it start at {T0 - zero:g} "
                f"{own}, with the strain of {abs(T_ref - T0):.3g} K: is {T_ref - zero:g} {other} meant?")
    return list(notes.values())
