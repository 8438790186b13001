"""What each check of a half needs: of the half as it declares itself, and of the scene it is checked in.

A check whose need is not met is not run, and its row says why.  Nothing is tried out to find that: what an FMU can do
is in its description, and what a half reads of a scene is what it declares (coupler.scenario.understood).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from contact.problem.values import covers
from coupler.fmu.bounds import other_scene, wrong_blocks
from coupler.fmu.names import role_of
from coupler.verify.bench import Bench
from coupler.verify.border import Finding, not_applicable
from coupler.verify.matter import KnownScene

GIVE_SCENE = "give a scene that knows its materials, with --scenario"


@dataclass(frozen=True)
class Need:
    """lacks : what is missing where `met` says no; "" where the bench says it.

    cost : what a run then goes without, or what to do.
    """

    met: Callable[[Bench], bool]
    lacks: str
    cost: str


def _input(name: str) -> Need:
    return Need(lambda bench: name in bench.starts, f"it takes no {name}", "")


def _reads(path: str) -> Need:
    return Need(lambda bench: bench.declared.reads is None or covers(bench.declared.reads, path),
                f"it declares that it does not read {path}", "")


def _fits(bench: Bench) -> bool:
    """Whether the half is one of this scene: of its mesh, with its blocks."""
    if bench.scene is None or other_scene(bench.strings, bench.scene.interface):
        return False
    # fault: verify-half: a half of other rows is asked for the physics of a scene -> return True |
    #   coupler/test_verify_child
    return not list(wrong_blocks(role_of(bench.blocks), bench.blocks, bench.scene))


STATE = Need(lambda bench: bench.declared.can_save, "it cannot keep its state",
             "no iteration, no second try of a window")
WRITTEN = Need(lambda bench: bench.declared.can_save and bench.declared.can_serialise,
               "it cannot write its state down", "no resume of a run that stopped")
ANY_STEP = Need(lambda bench: bench.declared.any_step,
                "it declares that all its steps have one length (canHandleVariableCommunicationStepSize)",
                "no run can try a window again shorter, nor find the size of its windows")
SEVERAL = Need(lambda bench: bench.declared.many,
               "it declares that a process holds one instance of it (canBeInstantiatedOnlyOncePerProcess)",
               "that two give the same bits is not known")
SCENE = Need(lambda bench: bench.scene is not None, "no scene is known",
             "a run looks at it; here give one with --scenario")
MATTER = Need(lambda bench: isinstance(bench.scene, KnownScene), "no scene is known", GIVE_SCENE)
FITS = Need(_fits, "it is not a half of this scene", "see `starts as the scene`")
FITS_IF_KNOWN = Need(lambda bench: bench.scene is None or FITS.met(bench), FITS.lacks, FITS.cost)
FREE = Need(lambda bench: isinstance(bench.scene, KnownScene) and bool(np.isfinite(bench.scene.stretch).any()),
            "no body of the scene is known that is free to expand", GIVE_SCENE)
HEAT_TERMS = Need(lambda bench: any(name.startswith("heat.stored") for name in bench.outputs),
                  "it gives no heat terms", "the energy balance of a run does not include it")

REFERENCE = Need(lambda bench: bench.reference is not None, "",
                 "slideline run --swap --compare compares whole runs")

_HEATED = (_input("E_M"), MATTER, FITS, ANY_STEP, _reads("materials.rho"), _reads("materials.c"))
_EXPANDS = (_input("T"), FREE, FITS, _reads("materials.T_ref"))
NEEDS: Mapping[str, tuple[Need, ...]] = {
    "starts as the scene": (SCENE,),
    "same inputs, same bits": (SEVERAL,),
    "reading has no side effect": (SEVERAL,),
    "save and restore to the bit": (STATE,),
    "20 substeps after a restore": (STATE,),
    "inputs are part of the state": (STATE,),
    "hot and cold caches, same bits": (WRITTEN, SEVERAL),
    "a rejected substep leaves no trace": (STATE, SEVERAL),
    "substeps of one window": (STATE, ANY_STEP),
    "numbers that can be": (FITS_IF_KNOWN,),
    "heat terms close": (HEAT_TERMS,),
    "time passes": (ANY_STEP, SEVERAL),
    "substeps converge": (ANY_STEP,),
    "heat warms a body": _HEATED,
    "cells in order": _HEATED,
    "answers to a gap": (_input("x"), SCENE, FITS),
    "answers to pressure": (_input("contact.t_N"), SCENE, FITS),
    "expands freely": (*_EXPANDS, _reads("materials.alpha")),
    "moves rigidly": _EXPANDS,
    "nodes in order": (*_EXPANDS, _reads("materials.alpha")),
    "agrees with our half": (REFERENCE, MATTER, FITS, ANY_STEP),
}
"""Name of a check -> what it needs; one that is not named needs nothing."""


def unmet(check: str, bench: Bench) -> Finding | None:
    """Return the row of a check that cannot be made, None where it can."""
    # fault: verify-half: a check is made whatever it needs -> lacking = [] | coupler/test_needs
    lacking = [need for need in NEEDS.get(check, ()) if not need.met(bench)]
    return not_applicable(check, lacking[0].lacks or bench.why_none, lacking[0].cost) if lacking else None
