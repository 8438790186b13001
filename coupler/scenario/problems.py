"""What each half is told of a scenario: its problem, in SI."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

import numpy as np

from contact.half.functions import property_from
from contact.problem.boundary import FORMAT, UNEVEN, Supported
from contact.problem.curves import Phases
from contact.problem.laws import Constant
from contact.problem.material import Axes, Material
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
from contact.problem.part import Part
from contact.problem.start import Course, FromFrames
from contact.problem.thermal import (
    BodyHeat,
    ForeignThermal,
    RegionHeat,
    ThermalBoundary,
    ThermalProblem,
    ThermalSettings,
)
from coupler.scenario.bodies import MeshedBody
from coupler.scenario.kinds import OWN, entry_of, fmu_path
from coupler.scenario.stated import NEAREST, ROOM, Stated, stated_start
from coupler.scenario.ties import bond_conductance

P = TypeVar("P", bound=Part)

THERMAL = ("rho", "k", "c", "latent")
ELASTIC = ("E", "nu", "alpha", "T_ref", "plastic", "creep", "liquid")
ROD = ("alpha", "T_ref", "E", "liquid")


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
        fmu = fmu_path(kind, s.file_folder)
        return (foreign_problem(s, role, entry_of(role, kind)) if fmu is None
                else _prebuilt(foreign_problem(s, role, str(fmu))))
    return _MAKERS[own](s, own)


def foreign_problem(s: Stated, role: str, half: str) -> Part:
    """Make the problem of a half of another package: all that the scene states."""
    return _foreign_thermal(s, half) if role == "thermal" else _foreign_mechanical(s, half)


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
    #   scenarios/test_default_contact
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
