"""All that is wrong with the problems of both halves, each with its key in the scenario file."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from contact.half import checks
from contact.half.functions import property_from
from contact.half.held import unheld
from contact.half.pushed_off import pushed_off
from contact.problem.boundary import Supported
from contact.problem.curves import FieldSum, Phases
from contact.problem.errors import Wrong
from contact.problem.material import Latent
from contact.problem.mechanical import ElasticProblem, ForeignMechanical, RigidProblem, RodProblem
from contact.problem.part import Part, properties_in
from contact.problem.start import Course
from contact.problem.thermal import ThermalProblem
from coupler.scenario.document import Key
from coupler.scenario.kinds import OWN, PROGRAMS, REPLAY, entry_of, fmu_path, stands_in, understood_by
from coupler.scenario.problems import foreign_problem
from coupler.scenario.programs import program_wrongs
from coupler.scenario.schema import Mechanical, Thermal
from coupler.scenario.stated import Stated
from coupler.scenario.understood import left_out

Problems = Mapping[str, Part]


def _stated_courses(s: Stated) -> Iterator[Wrong]:
    """What only a model.json may say."""
    for i, b in enumerate(s.file.thermal.boundary):
        if isinstance(b.temperature, Course):
            yield Wrong(("boundary", i, "temperature"), "interface.h5 is the coupler's to write",
                        "Write {from: run.h5} to take the temperatures of another run.")


def _first_at_each(found: Iterable[Wrong]) -> Iterator[Wrong]:
    """One of those that stand at one key: another body's would say it again."""
    seen: set[Key] = set()
    for wrong in found:
        if wrong.key not in seen:
            seen.add(wrong.key)
            yield wrong


def wrongs_of(s: Stated, seen: Mapping[str, Stated], problems: Problems) -> Iterator[tuple[Key, str, str]]:
    """Tell all that is wrong with the problems: its key in the file, what, remedy.

    seen : role -> the same with the mesh of its half, which may be one of its own.
    """
    for name, body in s.file.bodies.items():
        yield from _in_file(s, "", checks.known(body.material, s.file.materials, ("bodies", name, "material"),
                                                "material"))
        for region, stated in (body.regions or {}).items():
            if stated.material is not None:
                yield from _in_file(s, "", checks.known(stated.material, s.file.materials,
                                                        ("bodies", name, "regions", region, "material"), "material"))
    yield from _in_file(s, "", _starts_below_zero(s))
    yield from _in_file(s, "", _first_at_each(_positive_at_start(s)))
    for role, found in (("thermal", _of_thermal(seen["thermal"], problems)),
                        ("mechanical", _of_mechanical(seen["mechanical"], problems))):
        yield from _in_file(s, role, found)


def _in_file(s: Stated, role: str, found: Iterable[Wrong]) -> Iterator[tuple[Key, str, str]]:
    for wrong in found:
        yield _file_key(s, role, wrong.key), wrong.text, wrong.remedy


def _file_key(s: Stated, role: str, key: Key) -> Key:
    """The key of the file that a key of a half's problem comes from."""
    if not role or key[:1] in (("materials",), ("bodies",), ("geometry",)) or key[:1] == (role,):
        return key
    if key[:1] == ("pairs",):
        return ("contact", *key[1:])
    if role == "thermal" or key[:1] in (("ignore",), ("options",)):
        return (role, *key)
    half = s.file.mechanical.half
    return (role, half if half in OWN[role] else "elastic", *key)


def _of_foreign(s: Stated, role: str, stated: Thermal | Mechanical,
                boundary: Sequence[Supported]) -> Iterator[Wrong]:
    """What is wrong for a half of another package, or around a program: it checks the rest itself."""
    if fmu_path(stated.half, s.file_folder) is None:
        yield from checks.places(s.interface, boundary)
    if stated.half in PROGRAMS[role]:
        yield from program_wrongs(role, stated.half, s.file)
    yield from _ignored(s, role, stated.half, stated.ignore)


def _ignored(s: Stated, role: str, kind: str, ignore: Collection[str]) -> Iterator[Wrong]:
    """Conditions of the scene that a half of another package declares not to read."""
    # A half of the other role is refused by its name (check_kind): what it reads of a scene says nothing here.
    # fault: a half of the other role is asked what it reads -> other_role = False | coupler/test_scenario_errors
    other_role = fmu_path(kind, s.file_folder) is None and not stands_in(role, kind)
    words = None if other_role else understood_by(entry_of(role, kind), s.file_folder)
    if words is None:
        return
    told = foreign_problem(s, role, kind)
    used = told.model_copy(update={"materials": {name: s.file.materials[name] for name in s.used}})
    for wrong in left_out(role, used, words, ignore):
        # What the mechanical half alone says of a body does not stand with the body.
        of_elastic = role == "mechanical" and wrong.key[:1] == ("bodies",)
        yield replace(wrong, key=("mechanical", "elastic", *wrong.key)) if of_elastic else wrong


def _options_of_own(role: str, options: Mapping[str, Any]) -> Iterator[Wrong]:
    if options:
        yield Wrong((role, "options"), "options are for halves of other packages",
                    "Our own halves have keys of their own.")


def _of_thermal(s: Stated, problems: Problems) -> Iterator[Wrong]:
    problem, thermal = problems["thermal"], s.file.thermal
    assert isinstance(problem, ThermalProblem)
    if thermal.half not in OWN["thermal"]:
        yield from _of_foreign(s, "thermal", thermal, problem.boundary)
        return
    yield from _options_of_own("thermal", thermal.options)
    if thermal.half == REPLAY:
        return
    yield from _stated_courses(s)
    yield from checks.thermal_wrongs(problem, s.interface)
    yield from checks.thermal_start_wrongs(problem, s.interface)
    yield from _sums_below_zero(s, problem)
    if thermal.half == "rod":
        yield from _rectangles(s, "thermal")
    if thermal.half != "thermal":
        yield from checks.station_wrongs(problem, thermal.half)


def _sums_below_zero(s: Stated, problem: ThermalProblem) -> Iterator[Wrong]:
    for i, b in enumerate(problem.boundary):
        for key, spec in ((("temperature",), b.temperature), (("convection", "T"), b.convection and b.convection.T),
                          (("radiation", "T"), b.radiation and b.radiation.T)):
            if isinstance(spec, FieldSum) and (T := checks.least(spec, s.interface, b.where)) < 0.0:
                yield Wrong(("boundary", i, *key, "terms"), f"the sum reaches {T - s.offset:g} {s.unit} on {b.where}, "
                            "which is below absolute zero", "A sum of temperatures needs a constant term, such as "
                            "{t: 20}.")


def _starts_below_zero(s: Stated) -> Iterator[Wrong]:
    for name, key, part in s.parts:
        # fault: sums below absolute zero begin -> if isinstance(part.T0, FieldSum) and (T := s.start_range(name,
        #   part.T0)[0]) <= -1e9: | coupler/test_starts::test_what_cannot_begin_is_told_all_at_once
        if isinstance(part.T0, FieldSum) and (T := s.start_range(name, part.T0)[0]) <= 0.0:
            if len(key) > 2 and part.T0 is s.file.bodies[str(key[1])].T0:
                key = key[:2]  # the body's own sum
            yield Wrong((*key, "T0", "terms"), f"the sum reaches {T - s.offset:g} {s.unit} in body {name!r}, "
                        "which is not above absolute zero", "A sum of temperatures needs a constant term, such as "
                        "{t: 20}.")


def _rectangles(s: Stated, role: str) -> Iterator[Wrong]:
    own = s.file.thermal.meshes if role == "thermal" else s.file.mechanical.meshes
    for name, body in s.file.bodies.items():
        if own.get(name, body.mesh).rectangle is None:
            yield Wrong((role, "half"), f"a rod is a rectangle along x, but body {name!r} is meshed from a file")


def _of_mechanical(s: Stated, problems: Problems) -> Iterator[Wrong]:
    problem, mechanical = problems["mechanical"], s.file.mechanical
    if mechanical.half not in OWN["mechanical"]:
        assert isinstance(problem, ForeignMechanical)
        yield from _of_foreign(s, "mechanical", mechanical, problem.boundary)
        return
    yield from _options_of_own("mechanical", mechanical.options)
    if mechanical.half == REPLAY:
        return
    if isinstance(problem, ElasticProblem):
        yield from _of_elastic(s, problem)
    elif isinstance(problem, RigidProblem):
        yield from _nothing_to_solve(s)
        yield from checks.rigid_wrongs(problem, s.interface)
    elif isinstance(problem, RodProblem):
        yield from _rectangles(s, "mechanical")
        for name, pair in s.file.contact.items():
            for key in ("clearance", "interference"):
                if getattr(pair, key) is not None:
                    yield Wrong(("pairs", name, key), "the mechanical half `rod` finds its gaps from its lengths alone",
                                "Draw the gap, or choose the half elastic.")
        for name, body in s.file.bodies.items():
            if body.regions:
                yield Wrong(("bodies", name, "regions"), "the mechanical half `rod` has no regions",
                            "Choose the half elastic, or make each a body, with contact.")
        if mechanical.rod is None:
            yield Wrong(("mechanical",), "the half `rod` is chosen, but mechanical.rod is missing",
                        "Say which ends are held: mechanical: {rod: {held: {BODY: {left: 0}}}}.")
        else:
            yield from checks.rod_wrongs(problem, s.interface)


def _of_elastic(s: Stated, problem: ElasticProblem) -> Iterator[Wrong]:
    if s.file.mechanical.elastic is None:
        yield Wrong(("mechanical",), "the half `elastic` is chosen, but mechanical.elastic is missing",
                    "Say how the bodies are held: mechanical: {elastic: {boundary: [...]}}.")
        return
    wrongs = list(checks.elastic_wrongs(problem, s.interface))
    # What is held can be said only where every condition stands somewhere.
    wrongs = wrongs or list(unheld(problem, s.interface, s.file.coupling.end))
    yield from wrongs or pushed_off(problem, s.interface)
    for name in s.file.mechanical.elastic.bodies:
        if name not in s.file.bodies:
            for wrong in checks.known(name, s.file.bodies, (), "body"):
                yield Wrong(("mechanical", "elastic", "bodies", name), wrong.text, wrong.remedy)
    melt = any(s.file.materials[name].latent is not None for name in s.used)
    for name in s.used:
        material = s.file.materials[name]
        if melt and material.liquid is not None and material.latent is None:
            yield Wrong(("materials", name, "liquid"),
                        "the thermal half says what has melted, and it needs latent heat "
                        "for that", f"Add latent: {{L: ..., T_s: ..., T_l: ...}} to {name}.")
        if problem.adiabatic and isinstance(material.c, Phases):
            yield Wrong(("materials", name, "c"), "frozen entropy needs one heat capacity for all phases",
                        "Give c as one PROPERTY, or leave mechanical.elastic.adiabatic out.")
    whole = {name: s.file.materials[name] for name in s.used}
    yield from checks.needed("elastic", whole, s.used, {"alpha": ""})
    yield from checks.unmeasured(whole, "State the temperature at which it is free of stress.")


def _nothing_to_solve(s: Stated) -> Iterator[Wrong]:
    """Rigid bodies move and press as prescribed: contact must not ask for more."""
    motion = {} if s.file.mechanical.rigid is None else s.file.mechanical.rigid.motion
    for name, pair in s.file.contact.items():
        one, other = pair.slave.split(".")[0], pair.master.split(".")[0]
        # fault: what is tied moves apart under the half rigid -> if False: |
        #   coupler/test_ties::test_other_contradictions_are_told_too
        if pair.tied and motion.get(one) != motion.get(other):
            yield Wrong(("pairs", name, "tied"), f"the half `rigid` moves {one} and {other} apart: their motions are "
                        "not one",
                        f"Give both one motion in mechanical.rigid.motion, or set contact.{name}.tied=false.")
        # fault: the rigid half ignores friction in silence -> if False: | coupler/test_scenario_contact
        if pair.mu > 0.0:
            yield Wrong(("pairs", name, "friction", "mu"), "the half `rigid` has no forces, and so no friction",
                        f"Choose the half `elastic`, or set contact.{name}.friction=null.")
        if pair.augmented is not None:
            yield Wrong(("pairs", name, "augmented"), "the half `rigid` presses as prescribed: there is no penetration "
                        "to drive out", f"Choose the half `elastic`, or set contact.{name}.augmented=null.")


def _positive_at_start(s: Stated) -> Iterator[Wrong]:
    """A polynomial may turn negative somewhere; where a body begins, and where it melts, it must not."""
    for name, _, body in s.parts:
        material = s.file.materials.get(body.material)
        if material is None:
            continue
        for datum in ("k", "c", "E"):
            for key, spec in properties_in(getattr(material, datum), (datum,)):
                starts = dict.fromkeys(s.start_range(name, body.T0))
                for T in dict.fromkeys(T for T0 in starts for T in _met(T0, material.latent, str(key[-1]))):
                    if (value := float(property_from(spec)(np.array([T]))[0])) <= 0:
                        where = "T0" if T in starts else "melting point"
                        yield Wrong(("materials", body.material, *key),
                                    f"is {value:g} at the {where} of body {name!r}, "
                                    "but must be greater than zero")
                        break


def _met(T0: float, latent: Latent | None, phase: str) -> tuple[float, ...]:
    """Temperatures [K] that a property is sure to meet, or near to it: of a phase only where there is some of it."""
    if latent is None:
        return (T0,)
    T_s, T_l = latent.limits
    return {"solid": (min(T0, T_s), T_s), "liquid": (max(T0, T_l), T_l)}.get(phase, (T0, T_s, T_l))
