"""Reads contact pairs and ties: *SURFACE INTERACTION as conduction, radiation, friction and stiffness; *TIE."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from contact.problem.values import did_you_mean
from coupler.deck.bodies import DeckBody, DeckSurfaces, Names
from coupler.deck.lexer import KeywordBlock, Log, number, numbers, wrong
from coupler.deck.outline import Outline, Owner, named

ENDS = 1.001  # a table that ends before it is zero drops to zero within a thousandth of its last gap
TOUCH = 0.05  # of that: a gap over which surfaces of different meshes still touch
EDGES = 2.0  # surfaces see each other over so many edges at least
Tree = dict[str, Any]
Law = Tree | None


@dataclass(frozen=True)
class Analysis:
    """What the deck solves for.  moves : displacements.  heats : temperatures."""

    moves: bool
    heats: bool


def pairs_of(outline: Outline, bodies: Sequence[DeckBody], surfaces: DeckSurfaces, analysis: Analysis,
             log: Log) -> dict[str, Tree]:
    """Build the part `contact` of the scenario.  Raises ScenarioError for a pair of unknown surfaces or interaction."""
    pairs: dict[str, Tree] = {}
    names = Names()
    for block in [*outline.model, *(b for o in outline.steps for b in o.own)]:
        if block.word == "TIE":
            _add_ties(block, pairs, (bodies, surfaces, names), log)
        if block.word != "CONTACT PAIR":
            continue
        word = named(block, "INTERACTION")
        if word not in outline.interactions:
            raise wrong(block.row, f"there is no *SURFACE INTERACTION {word[:60]}",
                        did_you_mean(word[:60], outline.interactions))
        interaction = _interaction(outline.interactions[word], analysis, log)
        for row in block.data:
            if not row.field(0) or not row.field(1):
                raise wrong(row, "a pair has a slave and a master surface", "Write both names in one line.")
            if any(row.fields[2:]):
                log.miss(row, "a pair is two surfaces; what follows is not understood")
            slave, master = (surfaces.named(row.field(i), row) for i in (0, 1))
            edges = _reach(surfaces, slave)
            reach = max(edges, interaction["reach"])
            keys = {key: value for key, value in interaction.items() if key != "reach"}
            if not analysis.moves and "conduction" in keys:
                keys["conduction"] = _at_no_pressure(keys["conduction"], edges, log)
            for a in surfaces.on(slave, bodies):
                for b in surfaces.on(master, bodies):
                    if a.split(".")[0] != b.split(".")[0] or slave == master:
                        pairs[names.free(f"{slave}-{master}")] = {
                            "slave": a, "master": b, "gap_max": reach, **keys}
    if any("tied" not in pair for pair in pairs.values()):
        log.note("`gap_max` of a pair, beyond which its surfaces do not see each other, is a choice: two slave edges, "
                 "or where its tables end")
    return pairs


def _add_ties(block: KeywordBlock, pairs: dict[str, Tree], among: tuple[Sequence[DeckBody], DeckSurfaces, Names],
              log: Log) -> None:
    """Add the tied pairs of a *TIE.  among : bodies, surfaces, and the names that are taken.  Raises ScenarioError."""
    bodies, surfaces, names = among
    far = number_of(block, "POSITION TOLERANCE")
    if block.option("ADJUST") != "NO":
        log.note(f"{block.row.file}:{block.row.line}: *TIE keeps the gaps that the mesh has, as with ADJUST=NO; no "
                 "node is moved")
    for row in block.data:
        if not row.field(0) or not row.field(1):
            raise wrong(row, "a tie has a slave and a master surface", "Write both names in one line.")
        if any(row.fields[2:]):
            log.miss(row, "a tie is two surfaces; what follows is not understood")
        slave, master = (surfaces.named(row.field(i), row) for i in (0, 1))
        # fault: a tie reaches as far as a contact pair, whatever its tolerance -> reach = _reach(surfaces, slave) |
        #   coupler/test_deck
        reach = far if far > 0.0 else _reach(surfaces, slave)
        found = [(a, b) for a in surfaces.on(slave, bodies) for b in surfaces.on(master, bodies)
                 if a.split(".")[0] != b.split(".")[0]]
        if not found:
            raise wrong(row, "both surfaces of a tie belong to one body", "Leave it out: one mesh holds together.")
        for a, b in found:
            pairs[names.free(f"{slave}-{master}")] = {"slave": a, "master": b, "gap_max": reach, "tied": True}


def number_of(block: KeywordBlock, option: str) -> float:
    """Return the number that an option gives, 0 where it is not given.  Raises ScenarioError for another word."""
    word = block.options.get(option, "")
    if not word:
        return 0.0
    try:
        value = float(word.upper().replace("D", "E"))
    except ValueError:
        value = np.nan
    if not 0.0 <= value < np.inf:
        raise wrong(block.row, f"{option} of *{block.word} must be a number from 0 on, got {word[:60]!r}")
    return value


def _at_no_pressure(conduction: Tree, edges: float, log: Log) -> Tree:
    """Give a closed gap a conductance where bodies do not move: without pressure it counts as open.

    The conductance at no pressure holds where surfaces meet as well as meshes can.
    """
    closed = conduction["closed"]
    if conduction["open"] is not None or closed is None:
        return conduction
    log.note("where bodies do not move no pressure is known: what touches conducts as at no pressure, up to a gap of a "
             "tenth of a slave edge")
    if closed.get("variable") == "T":
        return {"closed": closed, "open": closed}
    h = closed["h"][0] if closed["law"] == "table" else closed["h"]
    gaps = [0.0, *(float(f"{times * TOUCH * edges:.4g}") for times in (1.0, 2.0))]
    return {"closed": closed, "open": {"law": "table", "x": gaps, "h": [h, h, 0.0]}}


def _reach(surfaces: DeckSurfaces, slave: str) -> float:
    """Return EDGES mean slave edges in the deck's length unit; 1 for a slave without edges, which fails later."""
    if not (edges := surfaces.edges[slave]):
        return 1.0
    ends = surfaces.mesh.points[np.array(edges)]
    return float(f"{EDGES * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean():.4g}")


def _interaction(owner: Owner, analysis: Analysis, log: Log) -> Tree:
    """Return the keys of a pair, and `reach`, the largest gap in its tables."""
    own = {block.word: block for block in owner.own}
    tree: Tree = {"reach": 0.0}
    if analysis.moves:
        tree |= _stiffness(own.get("SURFACE BEHAVIOR"), log)
    if analysis.heats:
        gaps = [block for block in owner.own if block.word == "GAP CONDUCTANCE"]
        closed, opened = _conductance(gaps, log)
        if gaps:
            tree["conduction"] = {"closed": closed, "open": opened}
            tree["reach"] = max((opened or {}).get("x", [0.0]))
        if "GAP RADIATION" in own:
            tree["radiation"] = _radiation(own["GAP RADIATION"], log)
            tree["reach"] = max(tree["reach"], tree["radiation"].get("gap", {}).get("d_far", 0.0))
    elif any(b.word.startswith("GAP") for b in owner.own):
        log.miss(owner.block, "a deck of *STATIC alone has no heat")
    if "FRICTION" in own:
        if analysis.moves:
            tree |= _friction(own["FRICTION"], own.get("GAP HEAT GENERATION"), analysis, log)
        else:
            log.miss(own["FRICTION"], "where bodies do not move nothing rubs")
    return tree


def _stiffness(block: KeywordBlock | None, log: Log) -> Tree:
    kind = block.option("PRESSURE-OVERCLOSURE") or "HARD" if block else "HARD"
    if block is not None and kind == "LINEAR" and block.data:
        if any(block.data[0].fields[1:]):
            log.miss(block.data[0], "only the stiffness, the first number, is understood")
        return {"penalty": number(block.data[0], 0, "the stiffness"), "augmented": None}
    if block is not None and kind != "HARD":
        log.miss(block, f"{kind[:30]} is not understood; the surfaces do not overlap, as with HARD")
    return {"augmented": {}}


def _conductance(blocks: Sequence[KeywordBlock], log: Log) -> tuple[Law, Law]:
    """Return the conductance laws of closed and of open surfaces."""
    closed: Law = None
    opened: Law = None
    for block in blocks:
        rows = _rows(block, log)
        pressures = "PRESSURE" in block.options
        if not pressures and len(rows) > 1:
            pressures = rows[-1][0] > rows[0][0]
            log.note(f"{block.row.file}:{block.row.line}: *GAP CONDUCTANCE is taken over the "
                     + ("pressure, because it rises" if pressures else "gap, because it does not rise")
                     + " (write PRESSURE where it is of the pressure)")
        h, x, T = ([row[i] for row in rows] for i in range(3))
        if min(h) < 0.0 or min(x) < 0.0:
            raise wrong(block.row, "conductances, pressures and gaps are not negative")
        if len(rows) > 1 and len(set(x)) == 1:
            closed = {"law": "table", "variable": "T", "x": T, "h": h}
        elif len(rows) == 1:
            closed = {"law": "constant", "h": h[0]}
            if not pressures and x[0] > 0.0:
                opened = {"law": "table", "x": [0.0, x[0], x[0] * ENDS], "h": [h[0], h[0], 0.0]}
        elif pressures:
            closed = {"law": "table", "x": x, "h": h}
        else:
            if h[-1]:
                x, h = [*x, x[-1] * ENDS], [*h, 0.0]
            opened = {"law": "table", "x": x, "h": h}
            closed = closed or {"law": "constant", "h": h[0]}
    return closed, opened


def _rows(block: KeywordBlock, log: Log) -> list[tuple[float, float, float]]:
    """Read (conductance, pressure or gap, temperature); of several temperatures the first.  Raises ScenarioError."""
    rows = []
    for row in block.data:
        h, x, T = (number(row, i, what, 0.0 if i else None)
                   for i, what in enumerate(("the conductance", "the pressure or gap", "a temperature")))
        if any(row.fields[3:]):
            log.miss(row, "columns behind the temperature are not understood")
        rows.append((row, (h, x, T)))
    if not rows:
        raise wrong(block.row, "*GAP CONDUCTANCE has no data", "Write the conductance, and perhaps pressure or gap.")
    one_place = len({values[1] for _, values in rows}) == 1
    accepted: list[tuple[float, float, float]] = []
    for row, values in rows:
        if not one_place and values[2] != rows[0][1][2]:
            log.miss(row, "a table over the gap or pressure is that of one temperature; the first is taken")
            continue
        if accepted and values[2 if one_place else 1] <= accepted[-1][2 if one_place else 1]:
            raise wrong(row, "the places of a table must increase", "Sort it.")
        accepted.append(values)
    return accepted


def _radiation(block: KeywordBlock, log: Log) -> Tree:
    if not block.data:
        raise wrong(block.row, "*GAP RADIATION has no data", "Write the emissivities of slave and master.")
    tree: Tree = {"emissivity_slave": number(block.data[0], 0, "an emissivity"),
                  "emissivity_master": number(block.data[0], 1, "an emissivity")}
    view = [(row, numbers(row, "the view factor, the gap") + [0.0, 0.0]) for row in block.data[1:]]
    if len(view) == 2 and view[0][1][0] == 1.0 and view[1][1][0] == 0.0 and view[1][1][1] > view[0][1][1] >= 0.0:
        tree["gap"] = {"d_near": view[0][1][1], "d_far": view[1][1][1]}
    elif any(values[0] != 1.0 for _, values in view):
        log.miss(view[0][0], "view factors go from 1 to 0 between two gaps; another table is taken as 1 at every gap")
    return tree


def _friction(block: KeywordBlock, heat: KeywordBlock | None, analysis: Analysis, log: Log) -> Tree:
    if not block.data:
        log.miss(block, "no coefficient is given")
        return {}
    row = block.data[0]
    friction: Tree = {"mu": number(row, 0, "the coefficient", 0.0)}
    if number(row, 1, "the stiffness of sticking", 0.0) > 0.0 and friction["mu"] > 0.0:
        friction["stick"] = number(row, 1, "the stiffness of sticking")
        log.note(f"{row.file}:{row.line}: the second number of *FRICTION is taken as the stiffness of sticking")
    if any(row.fields[2:]):
        log.miss(row, "one coefficient is understood, and a stiffness of sticking")
    for other in block.data[1:]:
        log.miss(other, "one coefficient is understood; that of the first line is taken")
    if analysis.heats:
        friction["share"] = _slave_fraction(heat, log)
    return {"friction": friction}


def _slave_fraction(heat: KeywordBlock | None, log: Log) -> float:
    """Return the fraction of the friction heat that enters the slave."""
    if heat is None:
        log.note("friction heat: all of the work, half to either side")
        return 0.5
    values = [number(heat.data[0], i, what, rest) for i, (what, rest) in enumerate(
        (("the fraction of the work", 1.0), ("the slave's share", 0.5)))] if heat.data else [1.0, 0.5]
    if values[0] != 1.0:
        log.miss(heat.data[0], "all of the work of friction becomes heat, not a part of it")
    if heat.data and any(heat.data[0].fields[2:]):
        log.miss(heat.data[0], "only the first two numbers are understood")
    return values[1]
