"""The units of a deck, which says none: given by its user, or seen from its materials."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from contact.problem.units import UnitError, unit_from
from coupler.deck.lexer import Log
from coupler.errors import ScenarioError
from coupler.scenario.plausible import DENSE_E, USUAL
from coupler.scenario.unit_system import UnitSystem, system_of, units_from

SEEN = ("E", "rho", "c", "k")  # by which units are seen
MM = {"length": "mm", "stress": "MPa"}
Tree = dict[str, Any]


def units_given(text: str) -> dict[str, str]:
    """Return the keys of `units` that an option such as "mm,MPa" stands for; none for SI.

    Raises ScenarioError for what is no system, and for a unit of temperature, which the deck says.
    """
    try:
        units = {} if text == "SI" else units_from(text)
    except UnitError as exc:
        raise ScenarioError(str(exc), key="--units", value=text, remedy=exc.remedy) from None
    if "temperature" in units:
        raise ScenarioError("the unit of temperature follows from the deck", key="--units", value=text,
                            remedy="Leave it out; docs/init.md says how it is found.")
    if units and system_of(units) is None:
        raise ScenarioError("a length and one unit of stress, force or mass are needed", key="--units", value=text,
                            remedy="For example --units mm,MPa; SI is m,Pa.")
    system = system_of(units)
    return {} if system is None or system.metre == system.kilogram == 1 else units


def units_seen(materials: Mapping[str, Tree], log: Log) -> dict[str, str]:
    """Return the keys of `units` of a deck's materials: those of mm and MPa, or none for SI; with a note.

    materials : name -> keys as `material_of` reads them.
    """
    mm = system_of(MM)
    assert mm is not None, "it is a system"
    si_odd = [w for tree in materials.values() for w in _odd(tree, None)]
    mm_odd = [w for tree in materials.values() for w in _odd(tree, mm)]
    soft = _soft(materials)
    # fault: decks in mm, t, s are taken for SI -> if True: | coupler/test_deck_units
    if len(mm_odd) >= len(si_odd) and not (soft and not si_odd and not mm_odd):
        log.note("numbers are as written; all is taken for SI (m, s, kg, Pa, W), which a deck does not say"
                 + (f", though {', '.join(si_odd)} is not usual there" if si_odd else "")
                 + "; --units says otherwise")
        return {}
    why = ", ".join(dict.fromkeys(si_odd)) if si_odd else soft
    log.note(f"numbers are as written, and taken for mm, MPa and s ({mm.sentence.partition('so ')[2]}): in SI {why} "
             "would be unusual; --units SI says otherwise")
    return dict(MM)


def _odd(tree: Tree, system: UnitSystem | None) -> Iterator[str]:
    """What would be unusual of any material, were the numbers in these units (None: SI)."""
    for key in SEEN:
        usual = USUAL[key]
        size = 1.0 if system is None else float(system.factor(unit_from(usual.unit).powers))
        values = [v for v in _numbers(tree.get(key)) if v != 0.0]
        if values and not any(usual.holds(v * size) for v in values):
            yield f"{key} = {max(values, key=abs):g}"


def _soft(materials: Mapping[str, Tree]) -> str:
    """The moduli, where all would be those of a rubber in Pa and of a solid in MPa; "" otherwise."""
    E = [v for tree in materials.values() for v in _numbers(tree.get("E"))]
    # 210000 alone says little: softer than rubber in Pa, steel in MPa.
    # fault: decks with stiffness alone are always SI -> if True: | coupler/test_deck_units
    if not E or not all(v < DENSE_E <= v * 1e6 for v in E):
        return ""
    return f"E = {max(E):g}"


def _numbers(value: Any) -> Iterator[float]:
    """All values of a property as `material_of` writes it."""
    if isinstance(value, Mapping):
        for key, one in value.items():
            if key not in ("T", "angle"):
                yield from _numbers(one)
    elif isinstance(value, list | tuple):
        for one in value:
            yield from _numbers(one)
    elif isinstance(value, int | float):
        yield float(value)


def in_units(si: float, unit: str, units: Mapping[str, str]) -> float:
    """Return a number of SI in the units of the deck.  unit : its unit in SI."""
    system = system_of(units)
    return si if system is None else si / float(system.factor(unit_from(unit).powers))
