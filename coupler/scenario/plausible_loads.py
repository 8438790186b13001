"""Loads and surroundings in a unit that was not meant: told with the unit in which they would be usual.

What is large in SI can be meant there: a film of 1e6 W/m2K holds a surface at a temperature.  In a file in units of its
own such a load comes of a datum in SI that was not converted.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from typing import Any

from contact.problem.curves import FieldSum, ProfileTable, SignalTable
from contact.problem.units import unit_from
from coupler.scenario.plausible import ROOM_K
from coupler.scenario.scene import parts_of
from coupler.scenario.schema import ScenarioFile
from coupler.scenario.si import ZERO_CELSIUS
from coupler.scenario.unit_system import UnitSystem

# Most that a load has, SI.  Sprays and boiling films reach 3e4 W/m2K, induction and arcs 1e11 W/m3, lasers 1e10 W/m2;
# no press reaches 1e11 Pa.
MOST = {"convection.h": (3e4, "W/m2K"), "flux": (1e10, "W/m2"), "Q_T": (3e11, "W/m3"),
        **dict.fromkeys(("pressure", "t_x", "t_y"), (1e11, "Pa"))}
LEAST_H, PER_MM2 = 1e-3, 1e6  # W/m2K: a hand's breadth of vacuum panel lets 50 times as much through; W/m2K of 1 W/mm2K
G, NEAR_G = 9.81, 0.005  # m/s2, and the share by which authors round it
# Temperatures of a room as authors write them in degrees Celsius.
ROOM_C, APART = (15.0, 30.0), 150.0
HOT = 6000.0  # K: no solid and no melt is hotter; tungsten boils at 5900 K


@dataclass(frozen=True)
class Load:
    """key : as the file has it.  place : where it acts.  numbers : its values in SI."""

    key: str
    place: str
    numbers: tuple[float, ...]


def unlikely_loads(stated: ScenarioFile, units: UnitSystem | None) -> list[str]:
    """Return a sentence for each load, weight and temperature of surroundings that a unit mistaken explains.

    stated : what the file says, in SI.  units : of the file's plain numbers, where they are not SI.
    """
    sizes = _tiny(stated) if units is None else _large(stated, units)
    return [*sizes, *_weight(stated, units), *_surroundings(stated), *_hot(stated)]


def _large(stated: ScenarioFile, units: UnitSystem) -> Iterator[str]:
    for load in chain(_heat(stated), _forces(stated)):
        most, si = MOST[load.key]
        largest = max(map(abs, load.numbers), default=0.0)
        # fault: a film in W/m2K in a file in mm is taken for what it says -> if True: |
        #   coupler/test_scenario_plausible_loads
        if largest <= most:
            continue
        powers = unit_from(si).powers
        plain = largest / float(units.factor(powers))
        meant = f": is {plain:g} {si} meant?" if plain <= most else "."
        yield (f"{load.key} of {load.place} is {plain:g} {units.name(powers)}, which is {largest:.3g} {si}{meant} "
               f"Plain numbers are in {units.symbols} and s; a number may have its unit")


def _tiny(stated: ScenarioFile) -> Iterator[str]:
    """Films in a file in SI that let next to nothing through, but would be usual in W/mm2K."""
    for load in _heat(stated):
        h = max(map(abs, load.numbers), default=0.0)
        # fault: a film in W/mm2K is taken for what it says -> if True: | coupler/test_scenario_plausible_loads
        if load.key != "convection.h" or not 0.0 < h < LEAST_H:
            continue
        yield (f"convection.h of {load.place} is {h:g} W/m2K, which lets next to no heat through: is {h:g} W/mm2K, "
               f"{PER_MM2 * h:g} W/m2K, meant?")


def _heat(stated: ScenarioFile) -> Iterator[Load]:
    for boundary in stated.thermal.boundary:
        if boundary.flux is not None:
            yield Load("flux", boundary.where, _numbers(boundary.flux))
        if boundary.convection is not None and boundary.convection.exponent == 0.0:
            yield Load("convection.h", boundary.where, _numbers(boundary.convection.h))
    for name, part in parts_of(stated):
        yield Load("Q_T", name, _numbers(part.Q_T))


def _forces(stated: ScenarioFile) -> Iterator[Load]:
    elastic = stated.mechanical.elastic
    for boundary in () if elastic is None else elastic.boundary:
        for key in ("pressure", "t_x", "t_y"):
            if (spec := getattr(boundary, key)) is not None:
                yield Load(key, boundary.where, _numbers(spec))


def _weight(stated: ScenarioFile, units: UnitSystem | None) -> Iterator[str]:
    """Gravity whose number is that of another unit of length."""
    elastic = stated.mechanical.elastic
    if elastic is None or elastic.gravity is None:
        return
    a = unit_from("m/s2").powers
    size, name = (1.0, "m/s2") if units is None else (float(units.factor(a)), units.name(a))
    for axis in ("x", "y"):
        largest = max(map(abs, _numbers(getattr(elastic.gravity, axis))), default=0.0)
        plain = largest / size
        # fault: 9.81 in a file in mm is taken for what it says -> if False: | coupler/test_scenario_plausible_loads
        if size != 1.0 and abs(plain / G - 1.0) < NEAR_G:
            yield f"gravity.{axis} is {plain:g} {name}, {largest:.3g} m/s2: are {plain:g} m/s2 meant?"
        elif size == 1.0 and abs(plain / (1e3 * G) - 1.0) < NEAR_G:
            yield f"gravity.{axis} is {plain:g} m/s2: are mm/s2 meant? Plain numbers are in SI"


def _surroundings(stated: ScenarioFile) -> Iterator[str]:
    """Surroundings of a film or of radiation at the temperature of a room, written in the other unit."""
    own, T0 = stated.units.temperature.value, _starts(stated)
    if not T0:
        return
    for boundary in stated.thermal.boundary:
        for key in ("convection", "radiation"):
            if (condition := getattr(boundary, key)) is None:
                continue
            numbers = _numbers(condition.T)
            if len(set(numbers)) != 1:
                continue
            T = numbers[0]
            plain = round(T - (ZERO_CELSIUS if own == "degC" else 0.0), 6)
            # fault: a sky of 293 in a file in degC is taken for what it says -> if True: |
            #   coupler/test_scenario_plausible_loads
            if not (plain in ROOM_K if own == "degC" else ROOM_C[0] <= plain <= ROOM_C[1]):
                continue
            if (apart := min(abs(T - start) for start in T0)) > APART:
                yield (f"{key}.T of {boundary.where} is {plain:g} {own}, {apart:.3g} K from where any body starts: "
                       f"are {plain:g} {'K' if own == 'degC' else 'degC'} meant?")


def _hot(stated: ScenarioFile) -> Iterator[str]:
    """Bodies that start, or are held, where nothing is solid or molten."""
    zero, unit = (ZERO_CELSIUS, "degC") if stated.units.temperature.value == "degC" else (0.0, "K")
    told = [(f"{name} starts at", part.T0) for name, part in parts_of(stated) if isinstance(part.T0, int | float)]
    told += [(f"temperature of {b.where} is", T) for b in stated.thermal.boundary
             if isinstance(b.temperature, int | float | SignalTable) for T in _numbers(b.temperature)]
    for what, T in told:
        # fault: a body at 1e70 degrees passes without a word -> if False: | coupler/test_scenario_plausible_loads
        if T > HOT:
            yield f"{what} {T - zero:g} {unit}: no solid and no melt is as hot"


def _starts(stated: ScenarioFile) -> list[float]:
    """The temperatures at which bodies start, those that are plain numbers [K]."""
    return [float(part.T0) for _, part in parts_of(stated) if isinstance(part.T0, int | float)]


def _numbers(spec: Any) -> tuple[float, ...]:
    """The values of a signal, or the largest each term of a field has; none where a polynomial over place is in it."""
    if isinstance(spec, int | float):
        return (float(spec),)
    if isinstance(spec, SignalTable):
        return tuple(spec.value)
    if isinstance(spec, FieldSum):
        return tuple(_largest(term.t) * _largest(term.x) * _largest(term.y) for term in spec.terms)
    return ()


def _largest(factor: Any) -> float:
    if factor is None:
        return 1.0
    return max(map(abs, factor.value if isinstance(factor, ProfileTable) else _numbers(factor)), default=0.0)
