"""All checks of one half: its description first, then its behaviour on a bench."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

from coupler.errors import HalfError
from coupler.fmu.bounds import BorderScene
from coupler.fmu.description import read_description, unpack
from coupler.fmu.fmi import load_half
from coupler.fmu.half import Half
from coupler.verify.behaviour import behaviour_findings
from coupler.verify.bench import EVERYTHING, NO_REFERENCE, Declared, settled
from coupler.verify.border import (
    CheckVerdict,
    Finding,
    conversion_findings,
    description_findings,
    failed,
    passed,
    reference_finding,
    state_findings,
)

RUNS = "takes substeps"


def verify_fmu(fmu: Path, scratch: Path, h: float, scene: BorderScene | None = None,
               wrap: Callable[[Half], Half] = lambda half: half, reads: frozenset[str] | None = None,
               reference: Callable[[], Half] | None = None, why_none: str = NO_REFERENCE) -> Iterator[Finding]:
    """Check an FMU in this process, and yield its findings one by one.  h : substep to begin with [s].

    scratch : an empty folder.  scene : that the FMU is for, where it is known.  wrap : what is put around every
    instance.  reads : what it declares to read of a scene (coupler.scenario.understood); None: nothing is declared.
    reference, why_none : as of a Bench.  Raises HalfError where the file is no FMU for co-simulation.
    """
    extracted = unpack(fmu, scratch / "fmu")
    description = read_description(extracted)
    yield reference_finding(description)
    yield from conversion_findings(description)
    declared = Declared(any_step=description.any_step, many=description.many, reads=reads)
    yield from verify_half(lambda: wrap(load_half(fmu, extracted, fmu.stem)), h, scene, declared,
                           reference, why_none)


def verify_half(make: Callable[[], Half], h: float, scene: BorderScene | None = None,
                declared: Declared = EVERYTHING, reference: Callable[[], Half] | None = None,
                why_none: str = NO_REFERENCE) -> Iterator[Finding]:
    """Check a half, and yield its findings one by one.  make : returns a new instance, loaded and not initialised.

    declared : what it says it can do; of its state the half itself says it.  reference, why_none : as of a Bench.
    """
    half = make()
    try:
        findings = [*description_findings(half.blocks), *state_findings(half.can_save, half.can_serialise)]
        declared = replace(declared, can_save=half.can_save, can_serialise=half.can_serialise)
    finally:
        half.close()
    yield from findings
    if findings[0].verdict is CheckVerdict.FAIL:
        return
    try:
        bench = settled(make, h, scene, declared, reference, why_none)
    except HalfError as exc:
        yield failed(RUNS, str(exc).splitlines()[0], "Give a substep it can take, with --step")
        return
    yield passed(RUNS, f"of {bench.h:.3g} s")
    yield from behaviour_findings(bench)
