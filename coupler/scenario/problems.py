"""Which halves there are, and what each is told of a scenario: its problem, in SI, and all that is wrong with it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from contact.half import checks
from contact.half.functions import property_from
from contact.half.held import unheld
from contact.half.interface import Interface
from contact.half.pushed_off import pushed_off
from contact.half.start import start_temperature
from contact.problem.boundary import FORMAT, UNEVEN, Supported
from contact.problem.curves import FieldSum, Phases
from contact.problem.errors import Wrong
from contact.problem.laws import Constant
from contact.problem.material import Axes, Latent, Material
from contact.problem.mechanical import (
    BodyMaterial,
    BodyOptions,
    Elastic,
    ElasticBody,
    ElasticProblem,
    ElasticRegion,
    ElasticSettings,
    ForeignBody,
    ForeignMechanical,
    ForeignRegion,
    Rigid,
    RigidProblem,
    RodProblem,
    Solution,
)
from contact.problem.pairs import Augmented, Conduction, ContactPair, PairData
from contact.problem.part import Part, properties_in
from contact.problem.start import AtNodes, Course, FromFrames
from contact.problem.thermal import (
    BodyHeat,
    ForeignThermal,
    RegionHeat,
    ThermalBoundary,
    ThermalProblem,
    ThermalSettings,
)
from contact.problem.values import did_you_mean
from coupler.scenario.bodies import FromRun, MeshedBody
from coupler.scenario.document import Document, Key
from coupler.scenario.programs import program_wrongs
from coupler.scenario.schema import ScenarioFile
from coupler.scenario.ties import bond_conductance
from coupler.scenario.understood import declared_by, declared_in, left_out

# Which halves there are: our own, those of other packages (entry points `slideline.halves`), prebuilt FMUs.

GROUP = "slideline.halves"
REPLAY = "replay"  # in either role: what another run recorded
# role -> word of the scenario -> entry point, which is also the `half` of model.json.  A rod is one in either role.
OWN: dict[str, dict[str, str]] = {
    "thermal": {"thermal": "thermal", "lumped": "lumped", "rod": "thermal_rod", REPLAY: "thermal_replay"},
    "mechanical": {"elastic": "elastic", "rigid": "rigid", "rod": "mechanical_rod", REPLAY: "mechanical_replay"},
}
# Halves of ours around a program of another maker: told the scene, and checked, as halves of other packages are.
PROGRAMS: dict[str, dict[str, str]] = {"thermal": {"ccx": "thermal_ccx"}, "mechanical": {"ccx": "mechanical_ccx"}}
SHIPPED = frozenset(entry for table in (OWN, PROGRAMS) for kinds in table.values() for entry in kinds.values())


def known_kinds(role: str) -> tuple[str, ...]:
    """Kinds that can stand in a role: ours for it, and those of other packages, whose role we cannot know."""
    return (*OWN[role], *PROGRAMS[role], *sorted({e.name for e in entry_points(group=GROUP)} - SHIPPED))


def stands_in(role: str, kind: str) -> bool:
    """Whether a half of this kind can stand in a role; what others have installed is looked up for theirs alone."""
    return kind in OWN[role] or kind in PROGRAMS[role] or kind in known_kinds(role)


def entry_of(role: str, kind: str) -> str:
    """Return the entry point of the scenario's word for a half."""
    return OWN[role].get(kind) or PROGRAMS[role].get(kind, kind)


def fmu_path(kind: str, folder: Path) -> Path | None:
    """The FMU a half's name is the path of, relative to the scenario's folder; None where it names a kind."""
    return (folder / kind).resolve() if kind.endswith(".fmu") else None


def check_kind(document: Document, role: str, kind: str, at: Key = ()) -> None:
    """Raises ScenarioError where no such half is installed, it is one of the other role, or its FMU is not there."""
    fmu = fmu_path(kind, document.path.parent)
    if fmu is not None:
        if not fmu.is_file():
            raise document.error(at or (role, "half"), f"there is no FMU {fmu}",
                                 "Paths are relative to the scenario file.")
        return
    if not stands_in(role, kind):
        raise document.error(at or (role, "half"), f"there is no {role} half of kind {kind!r}",
                             did_you_mean(kind, known_kinds(role)))


# What each half is told of a scenario: the problem it solves, in SI, and all that is wrong with it.

P = TypeVar("P", bound=Part)
Problems = Mapping[str, Part]

ROOM = 293.15  # K, where a material that does not expand says no T_ref
NEAREST = ".nearest"  # the node set that stands for a named point where no node lies
THERMAL = ("rho", "k", "c", "latent")
ELASTIC = ("E", "nu", "alpha", "T_ref", "plastic", "creep", "liquid")
ROD = ("alpha", "T_ref", "E", "liquid")


@dataclass(frozen=True)
class Stated:
    """A scenario's physics in SI.  file : the checked file, its materials, bodies, contact and halves in SI."""

    file: ScenarioFile
    interface: Interface
    unit: str
    offset: float
    file_folder: Path

    @property
    def pairs(self) -> dict[str, Any]:
        """The pairs whose surfaces exist."""
        there = {pair.name for pair in self.interface.pairs}
        return {name: pair for name, pair in self.file.contact.items() if name in there}

    @property
    def used(self) -> tuple[str, ...]:
        """Materials in use, each once."""
        parts = [part for body in self.file.bodies.values() for part in body.parts.values()]
        return tuple(dict.fromkeys(part.material for part in parts if part.material in self.file.materials))

    @property
    def parts(self) -> Iterator[tuple[str, Key, MeshedBody]]:
        """Every part that has cells: its name (Interface.parts), where it stands in the file, what it is, in full."""
        for name, body in self.file.bodies.items():
            for region, part in body.parts.items():
                whole = f"{name}.{region}" if region else name
                key: Key = ("bodies", name, "regions", region) if region else ("bodies", name)
                if len(self.interface.part_nodes(self.interface.parts.index(whole))):
                    yield whole, key, part

    def start_range(self, name: str, T0: Any) -> tuple[float, float]:
        """The lowest and the highest temperature [K] a part has at its nodes at the start."""
        T0 = stated_start(T0)
        if isinstance(T0, float):
            return T0, T0
        T = start_temperature(T0, self.interface, self.interface.part_nodes(self.interface.parts.index(name)))
        return (float(T.min()), float(T.max())) if T.size else (ROOM, ROOM)


def stated_start(T0: Any) -> Any:
    """T0 as a model.json has it: a number [K], a sum, or where interface.h5 has what another run left."""
    return AtNodes(dataset="start/T") if isinstance(T0, FromRun) else T0


def problem_of(s: Stated, role: str, kind: str) -> Part:
    """Make the problem of a half.  kind : the scenario's word for it."""
    return _of_its_format(_problem_of(s, role, kind))


def _of_its_format(problem: Part) -> Part:
    """A problem that says by its format what a half must know to read it."""
    bodies = getattr(problem, "bodies", {}).values()
    uneven = any(isinstance(getattr(body, key, None), Part) for body in bodies for key in ("T0", "drawn_at"))
    uneven = uneven or any(getattr(body, "regions", None) for body in bodies)
    uneven = uneven or any(getattr(b, "temperature", None) is not None and b.body is not None
                           for b in getattr(problem, "boundary", ()))
    return problem.changed(format=UNEVEN) if uneven else problem


def _problem_of(s: Stated, role: str, kind: str) -> Part:
    own = OWN[role].get(kind)
    if own is None:
        maker: Callable[[Stated, str], Part] = _foreign_thermal if role == "thermal" else _foreign_mechanical
        fmu = fmu_path(kind, s.file_folder)
        return maker(s, entry_of(role, kind)) if fmu is None else _prebuilt(maker(s, str(fmu)))
    return _MAKERS[own](s, own)


def _made(cls: type[P], **values: Any) -> P:
    """A part made of checked values."""
    return cls.model_construct(**values)


def _as(cls: type[P], part: Part, **more: Any) -> P:
    """Those keys of a part that another class has, and more."""
    given = {name: getattr(part, name) for name in cls.model_fields if name in type(part).model_fields}
    return cls.model_construct(**given | more)


def _share(s: Stated, keys: Iterable[str]) -> dict[str, Material]:
    return {name: _made(Material, **{key: getattr(s.file.materials[name], key) for key in keys}) for name in s.used}


def _stood(s: Stated, boundary: Iterable[Supported]) -> tuple[Any, ...]:
    """Conditions with their points looked up: where no node lies, the nearest one."""
    sets = s.interface.node_sets
    return tuple(b.model_copy(update={"at": b.at + NEAREST})
                 if b.at is not None and b.at not in sets and b.at + NEAREST in sets else _with_course(s, b)
                 for b in boundary)


def _stated_courses(s: Stated) -> Iterator[Wrong]:
    """What only a model.json may say."""
    for i, b in enumerate(s.file.thermal.boundary):
        if isinstance(b.temperature, Course):
            yield Wrong(("boundary", i, "temperature"), "interface.h5 is the coupler's to write",
                        "Write {from: run.h5} to take the temperatures of another run.")


def _with_course(s: Stated, b: Supported) -> Supported:
    """A condition with the temperatures of another run where interface.h5 has them."""
    if not (isinstance(b, ThermalBoundary) and isinstance(b.temperature, FromFrames)):
        return b
    T = s.interface.start.get(f"T.{b.body}", np.full((1, 1), ROOM))  # a stand-in: what was wrong is told
    course = Course(dataset=f"start/T.{b.body}", least=float(T.min()), most=float(T.max()))
    return b.model_copy(update={"temperature": course})


def _thermal(s: Stated, half: str) -> ThermalProblem:
    thermal = s.file.thermal
    return _as(ThermalProblem, _as(ThermalSettings, thermal, boundary=_stood(s, thermal.boundary)), half=half,
               format=FORMAT, materials=_share(s, THERMAL),
               bodies={n: _as(BodyHeat, b, T0=stated_start(b.T0), regions=_regions(
                   b, lambda part: _as(RegionHeat, part, T0=stated_start(part.T0)))) for n, b in s.file.bodies.items()},
               pairs={n: _made(PairData, conduction=_conduction(s, n, p), radiation=p.radiation, friction=p.friction)
                      for n, p in s.pairs.items()})


def _conduction(s: Stated, name: str, pair: ContactPair) -> Conduction | None:
    """How heat crosses a pair: as it says; where it is tied through its resistance, as if pressed at all times."""
    if not pair.tied:
        return pair.conduction
    h = bond_conductance(s.interface, name, _k_at_start(s)) if pair.resistance is None else 1.0 / pair.resistance
    return _made(Conduction, closed=_made(Constant, law="constant", h=h), open=None)


def _k_at_start(s: Stated) -> dict[str, float]:
    """Part -> its conductivity [W/mK], the larger of two axes, as it starts."""
    found = {}
    for name, _, part in s.parts:
        material = s.file.materials.get(part.material)
        k = None if material is None else material.k
        axes = (k.k_1, k.k_2) if isinstance(k, Axes) else (k,)
        T = np.array([0.5 * sum(s.start_range(name, part.T0))])
        values = [float(property_from(one.solid if isinstance(one, Phases) else one)(T)[0])
                  for one in axes if one is not None]
        found[name] = max(values, default=0.0)  # what is missing is told
    return found


def _regions(body: MeshedBody, make: Callable[[MeshedBody], P]) -> dict[str, P] | None:
    """What a half is told of the regions of a body, None where it has none."""
    return {name: make(part) for name, part in body.parts.items() if name} if body.regions else None


def _foreign_thermal(s: Stated, kind: str) -> ForeignThermal:
    return _as(ForeignThermal, _thermal(s, kind), materials=dict(s.file.materials), pairs=_whole_pairs(s),
               options=s.file.thermal.options)


def _prebuilt(problem: Part) -> Part:
    """The problem of an FMU that was built before: it is told nothing, so nothing here drives it."""
    nothing: dict[str, Any] = {"boundary": (), "pairs": {}}
    if isinstance(problem, ForeignThermal):
        nothing["bodies"] = {n: _as(BodyHeat, b, Q_T=0.0, Q_T_factor=None, regions=None)
                             for n, b in problem.bodies.items()}
    else:
        nothing |= {"gravity": None, "rigid": None, "rod": None}
    return problem.model_copy(update=nothing)


def _whole_pairs(s: Stated) -> dict[str, Any]:
    """Pairs in full, with the penalty that was found."""
    eps_N = {p.name: p.eps_N for p in s.interface.pairs}
    tied = {n: {"conduction": _conduction(s, n, p)} for n, p in s.pairs.items() if p.tied}
    return {n: p.model_copy(update=({"penalty": eps_N[n]} if eps_N.get(n) else {}) | tied.get(n, {}))
            for n, p in s.pairs.items()}


def _elastic(s: Stated, half: str) -> ElasticProblem:
    elastic = s.file.mechanical.elastic or Elastic()
    weighed = elastic.inert or elastic.gravity is not None or elastic.adiabatic
    keys = (*ELASTIC, *(("rho",) if weighed else ()), *(("c",) if elastic.adiabatic else ()))
    materials = {name: material if material.T_ref is not None else material.model_copy(update={"T_ref": ROOM})
                 for name, material in _share(s, keys).items()}
    return _as(ElasticProblem, _as(ElasticSettings, elastic, boundary=_stood(s, elastic.boundary)), half=half,
               format=FORMAT, materials=materials, bodies={n: _elastic_body(s, n, elastic) for n in s.file.bodies},
               # fault: augmentation lost on the way -> pairs={n: _made(PairData) for n in s.pairs}) |
               #   coupler/test_scenario_contact
               pairs={n: _made(PairData, augmented=_augmented(s, p, elastic)) for n, p in s.pairs.items()})


def _augmented(s: Stated, pair: ContactPair, elastic: Elastic) -> Augmented | None:
    """How the penetration of a pair is driven out: as it says, and where it says nothing by the default.

    With inertia contact is a spring of the motion unless a pair says otherwise: what collides has no steady pressure.
    What is tied does not collide; but explicit steps have no equilibrium to settle in.
    """
    # fault: with inertia ties are springs unless told -> bonded = False |
    #   coupler/test_ties::test_ties_settle_with_inertia_too_but_not_in_explicit_steps
    bonded = pair.tied and elastic.method is not Solution.EXPLICIT
    if "augmented" in pair.model_fields_set or (elastic.inert and not bonded):
        return pair.augmented
    # All pairs of a scene settle by one method: where others state one, it is theirs.
    stated = [other.augmented.method for other in s.pairs.values() if other.augmented is not None]
    # fault: contact is as soft as its penalty unless told -> return pair.augmented | coupler/test_penalties
    return Augmented(method=stated[0]) if stated else Augmented()


def _elastic_body(s: Stated, name: str, elastic: Elastic) -> ElasticBody:
    """A body that is not all solid at the start was poured: its mesh is the shape it has then."""
    body = s.file.bodies[name]
    regions = {region: _made(ElasticRegion, material=part.material, drawn_at=_drawn_at(s, f"{name}.{region}", part))
               for region, part in body.parts.items() if region}
    return _as(ElasticBody, elastic.bodies.get(name, BodyOptions()), material=body.material,
               drawn_at=_drawn_at(s, name, body), regions=regions or None)


def _drawn_at(s: Stated, name: str, part: MeshedBody) -> Any:
    liquid = s.file.materials[part.material].liquid if part.material in s.file.materials else None
    poured = liquid is not None and liquid.T_s < s.start_range(name, part.T0)[1]
    return stated_start(part.T0) if poured else None


def _foreign_mechanical(s: Stated, kind: str) -> ForeignMechanical:
    mechanical = s.file.mechanical
    elastic = _elastic(s, kind)
    stated = s.file.mechanical.elastic or Elastic()
    # Defaults are written out: no half has to know them.
    # fault: a foreign half is not told how penetration is driven out -> pairs = _whole_pairs(s) |
    #   coupler/test_foreign_defaults
    pairs = {n: p.model_copy(update={"augmented": _augmented(s, p, stated)}) for n, p in _whole_pairs(s).items()}
    materials = {n: m if m.T_ref is not None else m.model_copy(update={"T_ref": ROOM})
                 for n, m in s.file.materials.items()}
    return _as(ForeignMechanical, elastic, materials=materials, pairs=pairs,
               bodies={n: _foreign_body(b, s.file.bodies[n]) for n, b in elastic.bodies.items()},
               options=mechanical.options, rigid=mechanical.rigid, rod=mechanical.rod)


def _foreign_body(told: ElasticBody, body: MeshedBody) -> ForeignBody:
    regions = {name: _as(ForeignRegion, region, T0=stated_start(body.parts[name].T0))
               for name, region in (told.regions or {}).items()}
    return _as(ForeignBody, told, T0=stated_start(body.T0), regions=regions or None)


def _rigid(s: Stated, half: str) -> RigidProblem:
    rigid = s.file.mechanical.rigid or Rigid()
    return _as(RigidProblem, rigid, half=half, format=FORMAT,
               pressure={n: rigid.pressure.get(n, 0.0) for n in dict.fromkeys((*s.pairs, *rigid.pressure))})


def _rod(s: Stated, half: str) -> RodProblem:
    rod = s.file.mechanical.rod
    return _made(RodProblem, held={} if rod is None else rod.held, half=half, format=FORMAT, materials=_share(s, ROD),
                 bodies={n: _as(BodyMaterial, b) for n, b in s.file.bodies.items()})


_MAKERS: Mapping[str, Callable[[Stated, str], Part]] = {
    "thermal": _thermal, "lumped": _thermal, "thermal_rod": _thermal,
    "elastic": _elastic, "rigid": _rigid, "mechanical_rod": _rod,
    # Told all, so that windows end where those of the run that it plays do.
    "thermal_replay": _foreign_thermal, "mechanical_replay": _foreign_mechanical}


# What is wrong


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


def _ignored(s: Stated, role: str, problem: Part, kind: str, ignore: Collection[str]) -> Iterator[Wrong]:
    """Conditions of the scene that a half of another package declares not to read."""
    # A half of the other role is refused by its name (check_kind): what it reads of a scene says nothing here.
    # fault: a half of the other role is asked what it reads -> other_role = False | coupler/test_scenario_errors
    other_role = fmu_path(kind, s.file_folder) is None and not stands_in(role, kind)
    words = None if other_role else understood_by(entry_of(role, kind), s.file_folder)
    if words is None:
        return
    used = problem.model_copy(update={"materials": {name: s.file.materials[name] for name in s.used}})
    for wrong in left_out(role, used, words, ignore):
        # What the mechanical half alone says of a body does not stand with the body.
        of_elastic = role == "mechanical" and wrong.key[:1] == ("bodies",)
        yield replace(wrong, key=("mechanical", "elastic", *wrong.key)) if of_elastic else wrong


def understood_by(kind: str, folder: Path) -> frozenset[str] | None:
    """What a half of another package declares to read of a scene; None where it says nothing.  kind : its entry point.
    """
    if (fmu := fmu_path(kind, folder)) is not None:
        return declared_in(fmu)
    entry = next((e for e in entry_points(group=GROUP) if e.name == kind), None)
    return None if entry is None else declared_by(entry)


def _options_of_own(role: str, options: Mapping[str, Any]) -> Iterator[Wrong]:
    if options:
        yield Wrong((role, "options"), "options are for halves of other packages",
                    "Our own halves have keys of their own.")


def _of_thermal(s: Stated, problems: Problems) -> Iterator[Wrong]:
    problem, thermal = problems["thermal"], s.file.thermal
    assert isinstance(problem, ThermalProblem)
    if thermal.half not in OWN["thermal"]:
        if fmu_path(thermal.half, s.file_folder) is None:
            yield from checks.places(s.interface, problem.boundary)
        if thermal.half in PROGRAMS["thermal"]:
            yield from program_wrongs("thermal", thermal.half, s.file)
        yield from _ignored(s, "thermal", _foreign_thermal(s, thermal.half), thermal.half, thermal.ignore)
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
        if fmu_path(mechanical.half, s.file_folder) is None and isinstance(problem, ForeignMechanical):
            yield from checks.places(s.interface, problem.boundary)
        if mechanical.half in PROGRAMS["mechanical"]:
            yield from program_wrongs("mechanical", mechanical.half, s.file)
        yield from _ignored(s, "mechanical", _foreign_mechanical(s, mechanical.half), mechanical.half,
                            mechanical.ignore)
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
