"""Checks how a half behaves when it runs: new instances for each check, numbers compared to the bit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from coupler.errors import HalfError
from coupler.fmu.bounds import other_scene, wrong_blocks, wrong_start, wrong_values
from coupler.fmu.half import Array, Half, Status
from coupler.fmu.names import role_of
from coupler.verify.bench import LONG, Bench, Check, differing, first_outputs, took
from coupler.verify.border import Finding, failed, not_applicable, passed
from coupler.verify.needs import unmet
from coupler.verify.physics import PHYSICS

BALANCE = 1e-10  # of the sum of |terms|, as in the energy balance of a run
AGREEMENT = "program.tolerance"  # J, by which a program and the half around it may differ in a substep
LISTED = 5  # names in a reason
MANY = 20  # substeps after a restore


def behaviour_findings(bench: Bench) -> Iterator[Finding]:
    """Run every check in turn whose needs are met.  A half that raises in one fails it; the next begins anew."""
    for name, check in checks_of(role_of(bench.blocks)).items():
        if (lack := unmet(name, bench)) is not None:
            yield lack
            continue
        try:
            yield check(bench, name)
        except HalfError as exc:
            first = str(exc).splitlines()[0]
            yield failed(name, f"it failed: {first}", "A step that cannot be made is a Discard; nothing else may fail")


def checks_of(role: str) -> Mapping[str, Check]:
    """Return all checks of behaviour of a role, by name, in their order."""
    return {**CHECKS, **PHYSICS[role]}


def same_twice(bench: Bench, check: str) -> Finding:
    """Check that two instances with the same inputs give the same bits."""
    with bench.half() as a, bench.half() as b:
        # fault: verify-half: what changes after the third substep is not seen -> for k, (one, other) in enumerate(
        #   zip(bench.steps(a, 3), bench.steps(b, 3), strict=False), start=1): | coupler/test_plain_run
        for k, (one, other) in enumerate(zip(bench.steps(a), bench.steps(b), strict=False), start=1):
            if wrong := differing(one, other):
                return failed(check, f"two new instances differ after substep {k} in {_some(wrong)}",
                              "No random numbers, clocks, or memory that instances share; sums in a fixed order")
    return passed(check)


def scene_start(bench: Bench, check: str) -> Finding:
    """Check that the half starts as its scene does: the first T is T0, the first x the mesh."""
    assert bench.scene is not None, "needs.SCENE"
    role = role_of(bench.blocks)
    if other := other_scene(bench.strings, bench.scene.interface):
        return failed(check, f"it {other}", "Build it from this scene's mesh")
    if wrong := list(wrong_blocks(role, bench.blocks, bench.scene)):
        return failed(check, wrong[0].text, wrong[0].remedy)
    breach = wrong_start(role, first_outputs(bench), bench.scene)
    return passed(check) if breach is None else failed(check, breach.text, breach.remedy)


def possible(bench: Bench, check: str) -> Finding:
    """Check that every number at the border can be: T above 0 K, pressures that press, shares of 0 to 1."""
    role = role_of(bench.blocks)
    breach = wrong_values(role, first_outputs(bench), bench.scene)
    with bench.half() as half:
        for k, got in enumerate(bench.steps(half), start=1):
            breach = breach or wrong_values(role, got, bench.scene)
            if breach is not None:
                return failed(check, f"substep {k}: {breach.text}", breach.remedy)
    return passed(check)


def reading(bench: Bench, check: str) -> Finding:
    """Check that a half that is read again and again ends where one ends that is not read at all."""
    with bench.half() as read, bench.half() as unread:
        for k in (1, 2):
            read.advance((k - 1) * bench.h, bench.h, bench.inputs(k), bench.outputs)
            first, again = read.read(bench.outputs), read.read(bench.outputs)
            if wrong := differing(first, again):
                return failed(check, f"read twice, {_some(wrong)} changed", "Outputs are computed in the step")
            took(unread.advance((k - 1) * bench.h, bench.h, bench.inputs(k), ()))
        if wrong := differing(bench.step(read, 3), bench.step(unread, 3)):
            return failed(check, f"a half that was read goes on differently in {_some(wrong)}",
                          "Outputs are computed in the step, and getters change nothing")
    return passed(check)


def restoring(bench: Bench, check: str) -> Finding:
    """Check that a restored half has its outputs back, and that the same substeps give the same bits."""
    with bench.half() as half:
        bench.step(half, 1)
        token, there = half.save(), half.read(bench.outputs)
        first = [bench.step(half, k) for k in (2, 3)]
        for turn in ("first", "second"):
            half.restore(token)
            if wrong := differing(there, half.read(bench.outputs)):
                return failed(check, f"after the {turn} restore {_some(wrong)} is not as it was saved",
                              "Outputs are part of the state")
            again = [bench.step(half, k) for k in (2, 3)]
            # fault: verify-half: nobody looks what a restore gives again -> for k, (a, b) in enumerate(zip(first,
            #   first, strict=True), start=2): | coupler/test_verify
            for k, (a, b) in enumerate(zip(first, again, strict=True), start=2):
                if wrong := differing(a, b):
                    return failed(check, f"after the {turn} restore substep {k} gives another {_some(wrong)}",
                                  "All that evolves belongs to the state, copied on save and on restore: histories, "
                                  "counters, last increments; what is kept beside it must change no bits")
    return passed(check)


def restoring_long(bench: Bench, check: str) -> Finding:
    """Check that 20 substeps after a restore give the bits of the 20 before it: what counts substeps is state."""
    with bench.half() as half:
        bench.step(half, 1)
        token = half.save()
        first = list(bench.steps(half, MANY, 2))
        half.restore(token)
        # fault: verify-half: what comes late after a restore is not seen -> for k, (a, b) in enumerate(zip(first[:2],
        #   bench.steps(half, 2, 2), strict=False), start=2): | coupler/test_broken_halves
        for k, (a, b) in enumerate(zip(first, bench.steps(half, MANY, 2), strict=False), start=2):
            if wrong := differing(a, b):
                return failed(check, f"after a restore substep {k} gives another {_some(wrong)}",
                              "What happens every so many substeps (factors, searches) counts them in its state")
    return passed(check)


def remembers_inputs(bench: Bench, check: str) -> Finding:
    """Check that inputs set before a save hold again after the restore: only what changed is sent."""
    with bench.half() as half:
        bench.step(half, 1)
        token = half.save()
        given = took(half.advance(bench.h, bench.h, bench.inputs(1), bench.outputs))
        half.restore(token)
        bench.step(half, 2)
        half.restore(token)
        again = took(half.advance(bench.h, bench.h, {}, bench.outputs))
    if wrong := differing(given, again):
        return failed(check, f"restored and stepped without setting inputs, {_some(wrong)} comes from later inputs",
                      "Save the inputs with the state, and put them back with it")
    return passed(check)


def caches(bench: Bench, check: str) -> Finding:
    """Check that a new instance, with its caches empty, continues from a state of one used for 1 and 12 substeps."""
    with bench.half() as hot:
        bench.step(hot, 1)
        done = 1
        # fault: verify-half: the state of an instance that was hardly used is taken over -> for used in (1,): |
        #   coupler/test_plain_run
        for used in (1, LONG):
            done += len(list(bench.steps(hot, used - done, done + 1)))
            token = hot.save()
            data = hot.serialise(token)
            with bench.half() as cold:
                cold.restore(cold.deserialise(data))
                for k, (a, b) in enumerate(zip(bench.steps(hot, 2, done + 1), bench.steps(cold, 2, done + 1),
                                               strict=False), start=done + 1):
                    if wrong := differing(a, b):
                        return failed(check, f"taken over by a new instance, substep {k} gives another {_some(wrong)}",
                                      "What changes bits (first guesses, old factors, counters) is state, or is made "
                                      "anew at every step")
            hot.restore(token)
    return passed(check)


def discards(bench: Bench, check: str) -> Finding:
    """Check that an impossible substep is discarded, with a reason, and that the half survives it."""
    with bench.half() as half:
        bench.step(half, 1)
        reason = _refused(bench, half)
        if not reason:
            return not_applicable(check, "it takes every step it was offered (inputs that are no numbers, no length)",
                                  "its numbers are then checked by the coupler alone")
        if not reason.strip():
            return failed(check, "it gives no reason", "Set status.message, or log why")
    return passed(check, reason)


def no_trace(bench: Bench, check: str) -> Finding:
    """Check that a discard changes no output, and that the restored half continues as if it had not been."""
    with bench.half() as half, bench.half() as undisturbed:
        bench.step(half, 1)
        token, before = half.save(), half.read(bench.outputs)
        if not _refused(bench, half):
            return not_applicable(check, "it takes every step it was offered")
        values = [name for name in bench.outputs if not name.startswith("status.")]
        if wrong := [n for n in differing(before, half.read(bench.outputs)) if n in values]:
            return failed(check, f"the rejected substep changed {_some(wrong)}",
                          "Take new state and outputs over only when the step has succeeded")
        half.restore(token)
        bench.step(undisturbed, 1)
        if wrong := differing(bench.step(undisturbed, 2), bench.step(half, 2)):
            return failed(check, f"put back after a rejected substep it gives another {_some(wrong)}",
                          "A step works on copies; whatever it kept on its way out must not change the next one")
    return passed(check)


def substeps(bench: Bench, check: str) -> Finding:
    """Check a window in one substep, in two, and in one again."""
    t, h = bench.h, bench.h
    with bench.half() as half:
        bench.step(half, 1)
        token = half.save()
        whole = took(half.advance(t, h, bench.inputs(2), bench.outputs))
        half.restore(token)
        for part in (0.0, 0.5):
            took(half.advance(t + part * h, 0.5 * h, bench.inputs(2), bench.outputs))
        half.restore(token)
        if wrong := differing(whole, took(half.advance(t, h, bench.inputs(2), bench.outputs))):
            return failed(check, f"a window gives another {_some(wrong)} once it was tried in two substeps",
                          "What depends on the size of a substep (rates, factors) belongs to the substep")
    return passed(check)


def heat_balance(bench: Bench, check: str) -> Finding:
    """Check the half's own energy balance: the sum of heat.* without stored equals that of heat.stored.*"""
    terms = [name for name in bench.outputs if name.startswith("heat.")]
    with bench.half() as half:
        for k in (1, 2, 3):
            values = bench.step(half, k)
            gap, size = _imbalance(values, terms)
            # fault: verify-half: a program is asked for a balance to round-off -> most = BALANCE |
            #   scenarios/test_calculix_runs
            most = BALANCE + (float(np.sum(values.get(AGREEMENT, 0.0))) / size if size else 0.0)
            if gap > most:
                return failed(check, f"substep {k}: {gap:.1e} of the sum of |terms| is missing (at most {most:.2g})",
                              "Every heat.* is an energy of the substep into the bodies [J], at temperatures it used")
    return passed(check)


CHECKS: Mapping[str, Check] = {
    "starts as the scene": scene_start, "numbers that can be": possible,
    "same inputs, same bits": same_twice, "reading has no side effect": reading,
    "save and restore to the bit": restoring,
    "20 substeps after a restore": restoring_long, "inputs are part of the state": remembers_inputs,
    "hot and cold caches, same bits": caches, "a bad substep is discarded": discards,
    "a rejected substep leaves no trace": no_trace, "substeps of one window": substeps,
    "heat terms close": heat_balance}


def _refused(bench: Bench, half: Half) -> str:
    """Offer impossible substeps; return the reason of the first that is refused, " " without one, "" if none is."""
    name = next((n for n in ("T", "x", *bench.starts) if n in bench.starts and bench.starts[n].size), "")
    bad = {name: np.full(bench.starts[name].shape, np.nan)} if name else {}
    for inputs, h in ((bad, bench.h), ({}, 0.0)):
        if h and not inputs:
            continue
        done = half.advance(bench.h, h, {**bench.inputs(2), **inputs}, ())
        # fault: verify-half: a rejected substep is not offered -> if False: | coupler/test_verify
        if done.status is Status.DISCARD:
            return done.message or " "
    return ""


def _imbalance(values: Mapping[str, Array], terms: list[str]) -> tuple[float, float]:
    """Return |terms - stored| over the sum of |terms|, and this sum [J]; 0 where there are none."""
    heats = {name: float(np.sum(values[name])) for name in terms}
    total = sum(-v if name.startswith("heat.stored") else v for name, v in heats.items())
    size = sum(abs(v) for v in heats.values())
    return (abs(total) / size if size else 0.0), size


def _some(names: list[str]) -> str:
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return ", ".join(names[:LISTED]) + more
