"""Reads materials: the tables of a deck as properties of a scenario, and the unit its temperatures are in."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from coupler.deck.lexer import DeckLine, KeywordBlock, Log, number, numbers, wrong
from coupler.deck.outline import Outline, Owner

MAX_ROWS = 2_000  # of a table: a scenario is a text of some kilobytes
FINER = 4  # pieces of a table's interval, where an expansion counted from elsewhere bends between its points
Property = float | dict[str, list[float]]
Tree = dict[str, Any]


@dataclass(frozen=True)
class TableRow:
    """A line of a table: its values, and the temperature behind them (0 where the line has none)."""

    line: DeckLine
    values: Sequence[float]
    T: float


@dataclass(frozen=True)
class _StressCurve:
    """strain, stress : plastic strain, and yield stress at it, at one temperature T."""

    T: float
    strain: list[float]
    stress: list[float]


@dataclass(frozen=True)
class DeckPhysics:
    """temperature_unit : K or degC.  sigma_SB : the Stefan-Boltzmann constant, 0 where the deck has none."""

    temperature_unit: str
    sigma_SB: float


def table(block: KeywordBlock, columns: int, what: str, log: Log) -> list[TableRow]:
    """Read a table: so many columns of values, then the temperature.

    Raises ScenarioError for an empty or too long table, and for lines with fewer numbers.
    """
    if not block.data:
        raise wrong(block.row, f"*{block.word} has no data")
    if len(block.data) > MAX_ROWS:
        raise wrong(block.row, f"more than {MAX_ROWS} lines in a table")
    out = []
    for row in block.data:
        values = numbers(row, what)
        if len(values) < columns:
            raise wrong(row, f"*{block.word} has {columns} number{'s' * (columns > 1)} in a line, then the temperature")
        if len(values) > columns + 1:
            log.miss(row, "columns behind the temperature are not understood")
        out.append(TableRow(row, values[:columns], values[columns] if len(values) > columns else 0.0))
    return out


def over_T(rows: Sequence[TableRow], column: int) -> Property:
    """Return one column as a property.  Raises ScenarioError where temperatures do not increase."""
    if len(rows) == 1:
        return rows[0].values[column]
    for before, row in pairwise(rows):
        if row.T <= before.T:
            raise wrong(row.line, f"temperatures must increase, {row.T:g} follows {before.T:g}", "Sort the table.")
    return {"T": [row.T for row in rows], "value": [row.values[column] for row in rows]}


def material_of(owner: Owner, log: Log) -> Tree:
    """Read a *MATERIAL as keys of `materials.NAME`; expansion as `zero` and `alpha`, for `expansion_from`.

    Raises ScenarioError for a table that cannot be read, and for a type that is not understood.
    """
    tree: Tree = {}
    heat = 0.0
    for block in owner.own:
        if block.word == "INELASTIC HEAT FRACTION":
            heat = number(block.data[0], 0, "the fraction", 0.9) if block.data else 0.9
        else:
            tree |= _READ[block.word](block, log)
    if "plastic" in tree:
        tree["plastic"]["chi"] = heat
    return tree


def _elastic(block: KeywordBlock, log: Log) -> Tree:
    if (kind := block.option("TYPE")) not in ("", "ISO", "ISOTROPIC"):
        raise wrong(block.row, f"*ELASTIC of type {kind[:30]} is not understood", "Bodies are isotropic: E, nu.")
    rows = table(block, 2, "E, nu", log)
    return {"E": over_T(rows, 0), "nu": _flat(over_T(rows, 1))}


def _expansion(block: KeywordBlock, log: Log) -> Tree:
    if (kind := block.option("TYPE")) not in ("", "ISO"):
        raise wrong(block.row, f"*EXPANSION of type {kind[:30]} is not understood", "Bodies expand alike all ways.")
    zero = DeckLine(block.row.file, block.row.line, block.row.text, (block.options.get("ZERO", ""),))
    return {"alpha": _flat(over_T(table(block, 1, "alpha", log), 0)), "zero": number(zero, 0, "ZERO", 0.0)}


def _conductivity(block: KeywordBlock, log: Log) -> Tree:
    kind = block.option("TYPE")
    if kind == "ORTHO":
        rows = table(block, 3, "conductivities", log)
        return {"k": {"k_1": over_T(rows, 0), "k_2": over_T(rows, 1)}}
    if kind not in ("", "ISO"):
        raise wrong(block.row, f"*CONDUCTIVITY of type {kind[:30]} is not understood", "Write ISO or ORTHO.")
    return {"k": over_T(table(block, 1, "k", log), 0)}


def _density(block: KeywordBlock, log: Log) -> Tree:
    rows = table(block, 1, "rho", log)
    for row in rows[1:]:
        log.miss(row.line, "the density is that of the reference, one number; the first line is taken")
    return {"rho": rows[0].values[0]}


def _latent(block: KeywordBlock, log: Log) -> Tree:
    for row in block.data[1:]:
        log.miss(row, "a material melts once; the first line is taken")
    if not block.data:
        raise wrong(block.row, "*LATENT HEAT has no data")
    L, T_s, T_l = (number(block.data[0], i, w) for i, w in enumerate(("L", "the solidus", "the liquidus")))
    return {"latent": {"L": L, "T_s": T_s, "T_l": T_l}}


def _plastic(block: KeywordBlock, log: Log) -> Tree:
    if (kind := block.option("HARDENING")) not in ("", "ISOTROPIC"):
        log.miss(block, f"hardening {kind[:30]} is not understood; taken as isotropic")
    curves: list[_StressCurve] = []
    for row in table(block, 2, "yield stress, plastic strain", log):
        stress, strain = row.values
        if not curves or curves[-1].T != row.T:
            if strain != 0.0 or (curves and curves[-1].T > row.T):
                raise wrong(row.line, "for each temperature, in order, a table of *PLASTIC begins at no plastic strain")
            curves.append(_StressCurve(row.T, [], []))
        elif strain <= curves[-1].strain[-1]:
            raise wrong(row.line, "plastic strains must increase")
        curves[-1].strain.append(strain)
        curves[-1].stress.append(stress)
    return {"plastic": _hardening(curves)}


def _hardening(curves: Sequence[_StressCurve]) -> Tree:
    """Tabulate stress over strain, by temperature, at all strains that occur; constant beyond the last."""
    strains = sorted({strain for curve in curves for strain in curve.strain})
    rows = [[float(s) for s in np.interp(strains, curve.strain, curve.stress)] for curve in curves]
    if len(strains) == 1:
        return {"s_y": rows[0][0] if len(rows) == 1 else {"T": [c.T for c in curves], "value": [r[0] for r in rows]}}
    falls = {"softening": True} if any(b < a for row in rows for a, b in pairwise(row)) else {}
    if len(rows) == 1:
        return {"hardening": {"law": "table", "strain": strains, "stress": rows[0]}, **falls}
    return {"hardening": {"law": "table", "strain": strains, "T": [c.T for c in curves], "stress": rows}, **falls}


def _flat(spec: Property) -> Property:
    """Reduce a table of one value to that number."""
    if isinstance(spec, dict) and len(set(spec["value"])) == 1:
        return spec["value"][0]
    return spec


_READ = {"ELASTIC": _elastic, "EXPANSION": _expansion, "CONDUCTIVITY": _conductivity,
         "SPECIFIC HEAT": lambda b, log: {"c": over_T(table(b, 1, "c", log), 0)},
         "DENSITY": _density, "LATENT HEAT": _latent, "PLASTIC": _plastic}


def expansion_from(alpha: Property, zero: float, T_I: float) -> Property:
    """Convert a secant coefficient of expansion from `zero` to one from T_I, all in the deck's temperature unit.

    alpha'(T) (T - T_I) = alpha(T) (T - zero) - alpha(T_I) (T_I - zero).  A deck's body is free of stress at its own
    first temperature T_I, whatever `zero` is; a scenario's at T_ref = T_I.
    """
    # fault: decks: expansion counts from the deck's zero, not from the first temperature -> if True: |
    #   coupler/test_deck
    if not isinstance(alpha, dict) or zero == T_I:
        return alpha
    T = np.array(alpha["T"])
    T = np.unique(np.concatenate([np.linspace(a, b, FINER + 1) for a, b in pairwise(T)]))

    def stretch(at: Any) -> Any:
        return np.interp(at, alpha["T"], alpha["value"]) * (at - zero)

    dT = T - T_I
    near = np.abs(dT) < 1e-6 * max(float(np.ptp(T)), 1e-300)
    slope = _slope_at(T_I, T, stretch)
    value = np.where(near, slope, (stretch(T) - stretch(T_I)) / np.where(near, 1.0, dT))
    return {"T": [float(v) for v in T], "value": [float(f"{v:.9g}") for v in value]}


def _slope_at(T_I: float, T: np.ndarray, stretch: Callable[[float], Any]) -> float:
    """Return d(stretch)/dT at T_I, one-sided at an end of the table.

    T : (n,) temperatures of the table.  Beyond its end alpha is constant, and a hot body's table often ends at T_I.
    """
    step = 1e-3 * max(float(np.ptp(T)), 1e-300)
    below, above = T_I - step, T_I + step
    # fault: decks: expansion at the end of its table is half of what stands still beyond it -> if False: |
    #   coupler/test_deck
    if above > T[-1] and below >= T[0]:
        above = T_I
    elif below < T[0] and above <= T[-1]:
        below = T_I
    return float((stretch(above) - stretch(below)) / (above - below))


def merged(base: Mapping[str, Any], **more: Any) -> Tree:
    """Return a material of the scenario: what the deck says and `more`, without `zero`."""
    return {key: value for key, value in {**base, **more}.items() if key != "zero"}


# The unit of a deck's temperatures: absolute zero, and the Stefan-Boltzmann constant.

ZERO_C = -273.15
NEAR = 0.2  # decks round absolute zero
COLD = 150.0  # a deck whose temperatures are all above is in K


def physics_of(outline: Outline, temperatures: Sequence[float], radiates: bool, log: Log) -> DeckPhysics:
    """Read *PHYSICAL CONSTANTS, or guess the temperature unit.  temperatures : all that the deck has.

    Raises ScenarioError where absolute zero is that of another scale.
    """
    zero, sigma = None, 0.0
    for block in (b for b in outline.model if b.word == "PHYSICAL CONSTANTS"):
        for option in block.options:
            row = DeckLine(block.row.file, block.row.line, block.row.text, (block.options[option],))
            if option == "ABSOLUTE ZERO":
                zero = number(row, 0, "absolute zero")
                if min(abs(zero), abs(zero - ZERO_C)) > NEAR:
                    raise wrong(row, "absolute zero is -273.15 (degC) or 0 (K)", "Write the deck in degC or K.")
            elif option == "STEFAN BOLTZMANN":
                sigma = number(row, 0, "the constant")
    if radiates and not sigma:
        log.note("the deck has no STEFAN BOLTZMANN; the constant is that of SI")
    if zero is not None:
        return DeckPhysics("K" if abs(zero) <= NEAR else "degC", sigma)
    unit = "K" if radiates or min(temperatures) > COLD else "degC"
    log.note(f"the deck has no ABSOLUTE ZERO; temperatures are taken for {unit}")
    return DeckPhysics(unit, sigma)
