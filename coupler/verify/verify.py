"""All checks of one half: its face first, then, where the face is one a run can use, how it behaves."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from coupler.errors import HalfError
from coupler.fmu.description import read_description
from coupler.fmu.fmi import load_half
from coupler.fmu.half import Half
from coupler.fmu.unpack import unpack
from coupler.verify.behaviour import behaviour_findings
from coupler.verify.bench import settled
from coupler.verify.face import face_findings, reference_finding, state_findings
from coupler.verify.finding import Finding, Verdict, failed, passed

RUNS = "takes substeps"


def verify_fmu(fmu: Path, scratch: Path, h: float) -> Iterator[Finding]:
    """Findings of an FMU one by one; h : substep to begin with [s].

    scratch : an empty folder.  Raises HalfError where the file is no FMU of FMI 2.0 for co-simulation.
    """
    extracted = unpack(fmu, scratch / "fmu")
    yield reference_finding(read_description(extracted))
    yield from verify_half(lambda: load_half(fmu, extracted, fmu.stem), h)


def verify_half(make: Callable[[], Half], h: float) -> Iterator[Finding]:
    """Findings of a half one by one.  make : a new instance, loaded and not initialised."""
    half = make()
    try:
        findings = [*face_findings(half.blocks), *state_findings(half.can_save, half.can_serialise)]
    finally:
        half.close()
    yield from findings
    if findings[0].verdict is Verdict.FAIL:
        return
    try:
        bench = settled(make, h)
    except HalfError as exc:
        yield failed(RUNS, str(exc).splitlines()[0], "Give a substep it can take, with --step")
        return
    yield passed(RUNS, f"of {bench.h:.3g} s")
    yield from behaviour_findings(bench)
