"""The names that mean something at the border of a half (docs/design.md), and what each must be in either role."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from coupler.fmu.half import Block

IN, OUT, PARAMETER = "input", "output", "parameter"
THERMAL, MECHANICAL = "thermal", "mechanical"


@dataclass(frozen=True)
class Face:
    """thermal, mechanical : causality in that role, "" where the name has no meaning there.  rank : of its indices."""

    thermal: str
    mechanical: str
    unit: str
    rank: int
    kind: str = "Real"

    def causality(self, role: str) -> str:
        return self.thermal if role == THERMAL else self.mechanical


BLOCKS: Mapping[str, Face] = {
    "T": Face(OUT, IN, "K", 1),
    "x": Face(IN, OUT, "m", 2),
    "contact.t_N": Face(IN, OUT, "Pa", 1),
    "contact.gap": Face(IN, OUT, "m", 1),
    "contact.covered": Face(IN, OUT, "1", 1),
    "contact.t_T": Face("", OUT, "Pa", 1),
    "contact.slip_share": Face("", OUT, "1", 1),
    "contact.slip": Face("", OUT, "m", 1),
    "contact.slip_path": Face("", OUT, "m", 1),
    "contact.E_friction": Face(IN, OUT, "J", 1),
    "contact.join": Face(IN, "", "m", 0),
    "E_M": Face(IN, OUT, "J", 1),
    "E_S": Face(IN, OUT, "J", 1),
    "f_s": Face(OUT, IN, "1", 1),
    "q": Face(OUT, "", "W/m2", 2),
    "surface.T": Face(OUT, "", "K", 1),
    "surface.E": Face(OUT, "", "J", 1),
    "sigma": Face("", OUT, "Pa", 2),
    "sigma_v": Face("", OUT, "Pa", 1),
    "elastic_strain": Face("", OUT, "1", 2),
    "max_strain_increment": Face("", OUT, "1", 0),
    "max_dT": Face(OUT, "", "K", 0),
    "heat_stored": Face(OUT, "", "J", 0),
    "control.mode": Face(IN, IN, "1", 0, "Integer"),
    "control.event": Face(IN, IN, "1", 0, "Integer"),
    "control.method": Face(IN, IN, "1", 0, "Integer"),
    "status.code": Face(OUT, OUT, "1", 0, "Integer"),
    "status.message": Face(OUT, OUT, "1", 0, "String"),
    "status.dt_suggest": Face(OUT, OUT, "s", 0),
    "status.dt_stable": Face(OUT, OUT, "s", 0),
    "mesh.hash": Face(OUT, OUT, "1", 0, "String"),
    "surfaces.hash": Face(OUT, OUT, "1", 0, "String"),
    "geometry": Face(OUT, OUT, "1", 0, "String"),
    "packages.hash": Face(OUT, OUT, "1", 0, "String"),
    "contact.E_friction.at": Face("", OUT, "1", 0, "String"),
    "contact.link": Face(PARAMETER, PARAMETER, "1", 0, "String"),
}
_FAMILIES: Mapping[str, Face] = {
    r"heat\..+": Face(OUT, "", "J", 0),
    r"load\..+": Face(IN, IN, "1", 0),
    r"reaction\..+": Face("", OUT, "N", 1),
    r"condition\.heat\.pair\..+": Face(OUT, "", "J", 1),
    r"condition\.heat\..+": Face(OUT, "", "J", 0),
    r"condition\.reaction\..+": Face("", OUT, "N", 1),
    r"condition\.reaction_moment\..+": Face("", OUT, "N.m", 0),
    r"flow\..+": Face("", OUT, "1", 0),
    r"flow_rate\..+": Face("", OUT, "1/s", 0),
    r"p\..+": Face("", OUT, "Pa", 0),
}
# Blocks that count the same things; the first index of each.
SAME_LENGTH = (("T", "x", "f_s"),
               ("contact.t_N", "contact.gap", "contact.covered", "contact.t_T", "contact.slip_share",
                "contact.slip", "contact.slip_path", "contact.E_friction"), ("surface.T", "surface.E"),
               ("E_M", "E_S", "q", "sigma", "sigma_v", "elastic_strain"))
NEEDED: Mapping[str, tuple[str, ...]] = {THERMAL: ("T", "x"), MECHANICAL: ("x",)}


def face_of(name: str) -> Face | None:
    """What a name must be; None where it means nothing at the border (a half's own monitor or parameter)."""
    return BLOCKS.get(name) or next((face for pattern, face in _FAMILIES.items() if re.fullmatch(pattern, name)), None)


def role_of(blocks: Mapping[str, Block]) -> str:
    """Return thermal or mechanical, or "" where its outputs do not say: one has the output T, the other x."""
    made = {name for name in ("T", "x") if name in blocks and blocks[name].causality == OUT}
    return {frozenset({"T"}): THERMAL, frozenset({"x"}): MECHANICAL}.get(frozenset(made), "")
