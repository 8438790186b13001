"""How far a mesh is from one that resolves the stress of its bodies, by the strain energy that it misses.

A half that knows its stress estimates that energy (outputs mesh.missed.BODY and mesh.energy.BODY [J]).  The error in
the energy norm, sqrt(missed/(energy + uneven)), is held against limits at which displacements, whose error goes with
its square, are off by 4 % and 16 %.  What is missed is told of bodies as they are on the mesh.  Cells that bend by
1 + d times as stiffly as they should make d of the energy of the same shape bent rightly, so d/(1 + d) of their own:
under given forces just the share of the displacement that lacks (E - E_h = d E_h, of E), under given displacements that
of the force which is made of nothing (E_h - E = d E, of E_h).  The energy is that of displacements under given forces;
uneven (mesh.uneven.BODY [J]) is that of those by heat: a plate that bows freely has no stress, so what its cells make
of it is no measure of itself.  Of each body the largest of each energy over the run counts: at the end of unloading
little of any is left.

Right after a surface is heated all of the heat is in the first cells, which no mesh resolves, and what they miss of it
moves little.  So what a mesh misses while heat does most of the stress (energy below HEATED times uneven) counts by the
share of the thermal strain that is there by then, in energy: mesh.heat.BODY over its largest.

A body that warms evenly has a stress too, and no mesh is fine enough for it: 10 kPa in an aluminium disc that cools by
180 K in air, where the same strain, held, would be 290 MPa.  So a body bears nothing, either, if its elastic strain is
less than a ten-thousandth of the thermal strain it goes through (output mesh.heat.BODY [J], the energy of that strain
if it were held).  Displacements are those of the heat then.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from coupler.trust.checks import Check, measured

LIMITS = (0.2, 0.4)  # in the energy norm: noted, broken
SMALL = 0.01  # a body with less than this share of the strain energy of the scene, or of its heat's, bears nothing
FAINT = 1e-4  # so does one whose elastic strain is less than this share of the change of its thermal strain
HEATED = 4.0  # stress of uneven heat that is held has so much of its energy at most: in plane strain, at nu near 1/2
NAME = "cells fine enough for stress"
MISSED, ENERGY, HEAT, UNEVEN = "mesh.missed.", "mesh.energy.", "mesh.heat.", "mesh.uneven."


def mesh_outputs(blocks: Iterable[str]) -> list[str]:
    """Return the outputs of a half that tell of its mesh.  blocks : names of all it has."""
    names = set(blocks)
    bodies = sorted(n.removeprefix(ENERGY) for n in names if n.startswith(ENERGY))
    return [what + body for body in bodies if MISSED + body in names
            for what in (MISSED, ENERGY, HEAT, UNEVEN) if what + body in names]


@dataclass(frozen=True)
class MeshLog:
    """missed, energy, uneven : body -> the largest so far [J].  t : body -> when the mesh missed most [s].

    heated : body -> the largest of missed times heat so far, of looks at which heat does most of the stress [J^2], and
    when [s]; they are left out of `missed`.
    heat : body -> the least and the largest root of mesh.heat so far [J^1/2]: their difference is that of a change.
    """

    missed: Mapping[str, float] = field(default_factory=dict)
    energy: Mapping[str, float] = field(default_factory=dict)
    t: Mapping[str, float] = field(default_factory=dict)
    heat: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    uneven: Mapping[str, float] = field(default_factory=dict)
    heated: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def misses(self, body: str) -> tuple[float, float]:
        """What the mesh of a body misses [J], and when [s]."""
        missed, (product, when) = self.missed.get(body, 0.0), self.heated.get(body, (0.0, 0.0))
        most = self.heat.get(body, (0.0, 0.0))[1] ** 2
        return max((missed, self.t.get(body, 0.0)), (product / most if most > 0.0 else 0.0, when))


def watched(log: MeshLog, told: Mapping[str, float], t: float) -> MeshLog:
    """Return the log after a look at t [s].  told : outputs by name [J]."""
    missed, energy, when, heat = dict(log.missed), dict(log.energy), dict(log.t), dict(log.heat)
    uneven, heated = dict(log.uneven), dict(log.heated)
    for name, misses in told.items():
        if not name.startswith(MISSED):
            continue
        body = name.removeprefix(MISSED)
        J, of_heat, apart = (told.get(what + body, 0.0) for what in (ENERGY, HEAT, UNEVEN))
        # fault: what a body bore before it was unloaded is forgotten -> energy[body] = J | coupler/test_trust_mesh
        energy[body] = max(J, energy.get(body, 0.0))
        uneven[body] = max(apart, uneven.get(body, 0.0))
        root = math.sqrt(of_heat)
        least, most = heat.get(body, (root, root))
        heat[body] = min(least, root), max(most, root)
        # Where nothing warms, no stress is of heat.
        # fault: heat that has just come in counts in full -> by_heat = False | coupler/test_trust_mesh
        by_heat = HEATED * apart > J
        if not by_heat:
            if misses >= missed.get(body, 0.0):
                missed[body], when[body] = misses, t
        elif misses * of_heat >= heated.get(body, (0.0, 0.0))[0]:
            heated[body] = misses * of_heat, t
    return MeshLog(missed, energy, when, heat, uneven, heated)


def checks(log: MeshLog) -> tuple[Check, ...]:
    """Return the check at the end, none where no half tells of its mesh."""
    if not log.energy:
        return ()
    # fault: a body that bears nothing is held against itself -> bearing = [b for b, J in log.energy.items() if J > 0.0]
    #   | coupler/test_trust_mesh
    bearing = [body for body, much in bears(log).items() if much]
    # fault: a plate that bows freely is held against its own faint stress -> moved = log.energy |
    #   coupler/test_trust_mesh
    moved = {b: log.energy[b] + log.uneven.get(b, 0.0) for b in bearing}
    # fault: triangles that bend are told half of what they miss -> norms = {b: math.sqrt(missed / (missed + moved[b]))
    #   for b in bearing for missed in [log.misses(b)[0]]} | coupler/test_trust_mesh
    norms = {b: math.sqrt(min(log.misses(b)[0] / moved[b], 1.0)) if moved[b] > 0.0 else 1.0 for b in bearing}
    worst = max(norms, key=lambda b: norms[b], default="")
    # fault: what a mesh misses is not told -> norm = 0.0 | coupler/test_trust_mesh
    norm = norms.get(worst, 0.0)
    t = log.misses(worst)[1]
    more = max(2, math.ceil(norm / LIMITS[0]))
    return (measured(
        NAME, norm, LIMITS, t=t,
        what=f"the mesh of {worst} misses about {100 * norm**2:.3g} % of the strain energy that loads and uneven heat "
             f"make, so its displacements, or the forces that they take, are off by about as much, and its stress by "
             f"some {100 * norm:.3g} % of theirs, at t = {t:.6g} s",
        remedy=f"Use {more} times as many cells along each edge of the body, or where its stress changes most; where "
               "it bends, mechanical.elastic.element: enhanced"),)


def bears(log: MeshLog) -> dict[str, bool]:
    """Return body -> whether it bears more than SMALL of the scene's strain energy, or of its heat's.

    Bodies that bear nothing beside their heat, or nothing at all, are left out.
    """
    sums = [(of, sum(of.values())) for of in (log.energy, log.uneven)]
    shares = {b: max(of.get(b, 0.0) / J if J > 0.0 else 0.0 for of, J in sums) for b in log.energy}
    return {b: shares[b] > SMALL for b, J in log.energy.items() if _of_heat(log, b) < J + log.misses(b)[0]}


def _of_heat(log: MeshLog, body: str) -> float:
    """Return the energy [J] below which a body bears nothing beside its thermal strain; 0 without such a strain."""
    least, most = log.heat.get(body, (0.0, 0.0))
    # fault: a body that warms evenly is held against its faint stress -> return 0.0 * (most - least) |
    #   coupler/test_trust_mesh
    return float((FAINT * (most - least)) ** 2)
