"""What no single key can tell: whether a problem and its mesh fit together.

The coupler asks before it builds a half, and names file and line; a half asks when it reads its model.json.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import field_from, property_from
from contact.half.interface import Interface
from contact.half.prescribed import conflicts
from contact.half.start import start_temperature, start_temperatures
from contact.problem.boundary import FORCES, HELD, Supported
from contact.problem.curves import FieldSum, Polynomial
from contact.problem.errors import Wrong
from contact.problem.material import Axes, Material
from contact.problem.mechanical import Solution
from contact.problem.regions import regions_in
from contact.problem.start import AtNodes, Course
from contact.problem.values import At, did_you_mean, no_such_surface

Floats = NDArray[np.float64]

if TYPE_CHECKING:
    # A half reads one of the two: it need not load the other.
    from contact.problem.mechanical import ElasticProblem, RigidProblem, RodProblem
    from contact.problem.thermal import ThermalProblem

# Both halves


def known(name: str, among: Iterable[str], key: At, what: str, bodies: Iterable[str] | None = None) -> Iterator[Wrong]:
    """A name that is none of those there are.  what : of what it is the name.  bodies : of the scene, for a surface."""
    names = list(among)
    if name not in names:
        yield Wrong(key, f"there is no {what} {name!r}",
                    did_you_mean(name, names) if bodies is None else no_such_surface(name, names, bodies))


def _bodies(interface: Interface, bodies: Mapping[str, Any], materials: Mapping[str, Material]) -> Iterator[Wrong]:
    for name in interface.bodies:
        if name not in bodies:
            yield Wrong(("bodies",), f"key {name!r} is missing")
    for name, body in bodies.items():
        yield from known(name, interface.bodies, ("bodies", name), "body")
        yield from known(body.material, materials, ("bodies", name, "material"), "material")
        if not hasattr(body, "regions"):
            return  # a half of rods: no regions reach it
        for region, part in (body.regions or {}).items():
            yield from known(part.material, materials, ("bodies", name, "regions", region, "material"), "material")
    if (stated := set(regions_in(bodies))) != set(interface.regions):
        yield Wrong(("bodies",), f"the regions {sorted(stated)} are not those of the mesh, {sorted(interface.regions)}")


def needed(half: str, materials: Mapping[str, Material], used: Iterable[str],
           needs: Mapping[str, str]) -> Iterator[Wrong]:
    """Materials in use that lack what a half needs: key -> what needs it, "" for the half itself."""
    for name in dict.fromkeys(used):
        if name in materials and (lacking := materials[name].lacks(tuple(needs))):
            why = "".join(f", {needs[key]} needs {key}" for key in lacking if needs[key])
            yield Wrong(("materials", name), f"material {name!r} lacks {', '.join(lacking)}, which the half {half!r} "
                        f"needs{why and f' ({why[2:]})'}", "Add what is missing, in SI.")


def places(interface: Interface, boundary: Sequence[Supported]) -> Iterator[Wrong]:
    """Conditions that stand nowhere, and names given twice."""
    seen: dict[str, int] = {}
    for i, b in enumerate(boundary):
        if b.on is not None:
            yield from known(b.on, interface.surfaces, ("boundary", i, "on"), "surface", interface.bodies)
        if b.at is not None:
            yield from known(b.at, interface.node_sets, ("boundary", i, "at"), "point")
        if b.name is not None and seen.setdefault(b.name, i) != i:
            yield Wrong(("boundary", i, "name"), f"the name {b.name!r} is already that of entry {seen[b.name]}",
                        "Each named condition is one input load.<name>.")


def _pairs(interface: Interface, pairs: Iterable[str], key: str) -> Iterator[Wrong]:
    there = [p.name for p in interface.pairs]
    for name in pairs:
        yield from known(name, there, (key, name), "contact pair")


# The thermal halves


def thermal_wrongs(problem: ThermalProblem, interface: Interface) -> Iterator[Wrong]:
    """All that does not fit in the problem of a thermal half."""
    yield from _bodies(interface, problem.bodies, problem.materials)
    yield from places(interface, problem.boundary)
    yield from _pairs(interface, problem.pairs, "pairs")
    for i, b in enumerate(problem.boundary):
        if b.body is not None:
            yield from known(b.body, interface.bodies, ("boundary", i, "body"), "body")
        h = None if b.convection is None else field_from(b.convection.h)
        if h is not None and h.is_uniform and h.least is not None and h.least < 0.0:
            yield Wrong(("boundary", i, "convection", "h"), f"must not be less than 0, but reaches {h.least:g}")
    used = (part.material for part in problem.parts.values())
    yield from needed(problem.half, problem.materials, used, dict.fromkeys(("rho", "k", "c"), ""))
    yield from _one_melt(problem, interface)


def _one_melt(problem: ThermalProblem, interface: Interface) -> Iterator[Wrong]:
    """Regions that meet and do not melt alike: one unknown a node cannot tell how far each of two has melted."""
    melts = {name: made.latent for name, part in problem.parts.items()
             if (made := problem.materials.get(part.material)) is not None and name in interface.parts}
    if not any(melts.values()):
        return
    for name in interface.regions:
        body, region = name.split(".", 1)
        own = interface.part_nodes(interface.parts.index(name))
        for k in np.flatnonzero(interface.part_body == interface.bodies.index(body)):
            other = interface.parts[k]
            # fault: regions that melt apart share their nodes -> if False: |
            #   coupler/test_regions::test_a_region_may_melt_beside_one_that_melts_alike
            if melts.get(other) != melts.get(name) and np.intersect1d(own, interface.part_nodes(int(k))).size:
                yield Wrong(("bodies", body, "regions", region, "material"), "it melts otherwise than what it shares "
                            f"nodes with ({other})", "Give both the same latent heat, or make it a body of its own, "
                            "with contact.")
                break


def thermal_start_wrongs(problem: ThermalProblem, interface: Interface) -> Iterator[Wrong]:
    """What would fail at the start, or leave the answer open: a half that meets it discards its step and says why."""
    yield from _temperatures_once(problem)
    if problem.method == "steady":
        yield from _steady_is_held(problem, interface)
    yield from _surfaces_work_at_start(problem, interface)
    yield from _films_at_start(problem, interface)


def _temperatures_once(problem: ThermalProblem) -> Iterator[Wrong]:
    """Places with two prescribed temperatures, of which one would be ignored."""
    seen: dict[str, int] = {}
    whole = {b.body: i for i, b in reversed(list(enumerate(problem.boundary))) if b.body is not None}
    for i, b in enumerate(problem.boundary):
        body = b.where.split(".")[0]
        # fault: a temperature on a body whose temperature is given, ignored -> if False: |
        #   coupler/test_given_temperatures::test_what_is_given_twice_or_nowhere_is_refused
        if b.temperature is not None and b.body is None and body in whole:
            yield Wrong(("boundary", i, "at" if b.on is None else "on"),
                        f"the temperature of all of {body} is already prescribed by entry {whole[body]}",
                        "Keep one of the two.")
        # fault: two temperatures on one place, the first ignored -> if b.temperature is not None and
        #   seen.setdefault(b.where, i) > i: | coupler/test_scenario_thermal
        if b.temperature is not None and seen.setdefault(b.where, i) != i:
            yield Wrong(("boundary", i, "body" if b.body else "at" if b.on is None else "on"),
                        f"the temperature of {b.where} is already prescribed by entry {seen[b.where]}",
                        "Keep one of the two; a temperature that changes in time is one SIGNAL.")


def _steady_is_held(problem: ThermalProblem, interface: Interface) -> Iterator[Wrong]:
    """Bodies that are tied to no temperature, neither by their surfaces nor through pairs.

    A source that depends on temperature may fix it too; whether it does, only the solution can say.
    """
    # fault: a flux taken for something that holds a steady temperature -> held = {body for b in problem.boundary for
    #   body in _bodies_at(interface, b.where)} | coupler/test_scenario_thermal
    held = {body for b in problem.boundary if b.flux is None for body in _bodies_at(interface, b.where)}
    held |= {name.split(".")[0] for name, part in problem.parts.items() if part.Q_T_factor is not None}
    held |= set(problem.elsewhere or ())
    pairs = [{side.split(".")[0] for side in (p.slave, p.master)} for p in interface.pairs
             if (data := problem.pairs.get(p.name)) and (data.conduction is not None or data.radiation is not None)]
    while reached := [sides for sides in pairs if sides & held and not sides <= held]:
        held = held.union(*reached)
    for name in problem.bodies:
        if name not in held:
            yield Wrong(("bodies", name), f"method steady, but nothing fixes the temperature of body {name!r}",
                        "Give a surface of it a temperature, convection or radiation, or choose a method that steps in "
                        "time.")


def _bodies_at(interface: Interface, where: str) -> set[str]:
    """The bodies that a surface or node set belongs to; a body itself."""
    if where in interface.bodies:
        return {where}
    nodes = interface.surfaces.get(where, interface.node_sets.get(where))
    return set() if nodes is None else {interface.bodies[i] for i in np.unique(interface.node_body[nodes]) if i >= 0}


def _surfaces_work_at_start(problem: ThermalProblem, interface: Interface) -> Iterator[Wrong]:
    """Polynomial emissivities and h_factors out of their range at T0: no smaller step could mend it later."""
    for spec, key, surface, most in _polynomials(problem, interface):
        if not isinstance(spec, Polynomial):
            continue
        for body in sorted(_bodies_at(interface, surface) & set(problem.bodies)):
            # fault: an emissivity is held against the first body's T0 -> values = property_from(spec)(np.array(
            #   [next(iter(problem.bodies.values())).T0])) | coupler/test_scenario_thermal
            values = property_from(spec)(_at_start(problem, interface, body, surface))
            wrong = values[~((values > 0.0) & (values <= most) | ((values == 0.0) & (most == inf)))]
            if wrong.size:
                must = "must not be negative" if most == inf else f"must be greater than zero and at most {most:g}"
                yield Wrong(key, f"is {wrong[0]:g} at the T0 of body {body!r}, but {must}",
                            "Mind T_ref: a polynomial counts temperatures from there.")


def _at_start(problem: ThermalProblem, interface: Interface, body: str, surface: str) -> Floats:
    """Temperatures (n,) [K] that a body has on a surface at the start."""
    nodes = np.unique(interface.surfaces[surface] if surface in interface.surfaces else interface.node_sets[surface])
    own = nodes[interface.node_body[nodes] == interface.bodies.index(body)]
    if not interface.regions:
        return start_temperature(problem.bodies[body].T0, interface, own)
    parts = problem.parts
    return start_temperatures(interface, [parts[name].T0 for name in interface.parts])[own]


def _polynomials(problem: ThermalProblem, interface: Interface) -> Iterator[tuple[object, At, str, float]]:
    """Each property of a surface: its place, the surface, the most it may be (inf: a factor)."""
    for i, b in enumerate(problem.boundary):
        if b.radiation is not None:
            yield b.radiation.emissivity, ("boundary", i, "radiation", "emissivity"), b.where, 1.0
        if b.convection is not None:
            yield b.convection.h_factor, ("boundary", i, "convection", "h_factor"), b.where, inf
    for pair in interface.pairs:
        radiation = problem.pairs[pair.name].radiation if pair.name in problem.pairs else None
        if radiation is not None:
            key = ("pairs", pair.name, "radiation")
            yield radiation.emissivity_slave, (*key, "emissivity_slave"), pair.slave, 1.0
            yield radiation.emissivity_master, (*key, "emissivity_master"), pair.master, 1.0


def _films_at_start(problem: ThermalProblem, interface: Interface) -> Iterator[Wrong]:
    for i, b in enumerate(problem.boundary):
        if b.convection is not None and isinstance(b.convection.h, FieldSum):
            value = least(b.convection.h, interface, b.where)
            if value < 0.0 and not field_from(b.convection.h).is_uniform:
                yield Wrong(("boundary", i, "convection", "h", "terms"),
                            f"must not be less than 0, but reaches {value:g} on {b.where}")


def least(field: Any, interface: Interface, where: str) -> float:
    """Return the smallest value of a field at the nodes of a place in the reference, at any time; inf for no place."""
    made = field_from(field)
    nodes = interface.surfaces.get(where, interface.node_sets.get(where))
    if where in interface.bodies:
        nodes = np.flatnonzero(interface.node_body == interface.bodies.index(where)).astype(np.int32)
    if nodes is None:
        return inf
    x = interface.nodes[np.unique(nodes)]
    # Linear in time between the times of its signals, so the smallest value is at one of them.
    times = np.unique(np.concatenate([s.t for s in made.signals]))
    # fault: fields below zero not looked for -> return min((float(made.at(x, t, side).min()) for t in times[:0] for
    #   side in (-1, 1)), default=inf) | coupler/test_scenario_thermal
    return min(float(made.at(x, t, side).min()) for t in times for side in (-1, 1))


def station_wrongs(problem: ThermalProblem, word: str) -> Iterator[Wrong]:
    """What a half of stations (lumped, rod) cannot take.  word : what the half is called."""
    if problem.adaptive is not None:
        yield Wrong(("adaptive",), f"the half {word!r} has no inner steps", "Leave it out, or take more substeps.")
    if problem.method == "steady":
        yield Wrong(("method",), f"the half {word!r} has no method 'steady'", "Let it run until nothing changes.")
    for name, body in problem.bodies.items():
        if body.Q_T_factor is not None:
            yield Wrong(("bodies", name, "Q_T_factor"), f"the half {word!r} has no such factor")
        if isinstance(body.Q_T, FieldSum):
            yield Wrong(("bodies", name, "Q_T"), f"the half {word!r} takes data that depend on time alone",
                        "Write a number or a signal.")
        yield from _start_of_stations(name, body.T0, word)
        if body.regions:
            yield Wrong(("bodies", name, "regions"), f"the half {word!r} has no regions", "Choose the half thermal, or "
                        "make each a body, with contact.")
    for name, material in problem.materials.items():
        if isinstance(material.k, Axes):
            yield Wrong(("materials", name, "k"), f"k has two axes, of which the half {word!r} knows one",
                        "Write one PROPERTY, or one for each phase.")
    for i, b in enumerate(problem.boundary):
        film = b.convection
        data = (b.temperature, b.flux, film and film.h, film and film.T, b.radiation and b.radiation.T)
        if any(isinstance(field, FieldSum | Course) for field in data):
            yield Wrong(("boundary", i), f"the half {word!r} takes data that depend on time alone",
                        "Write a number or a signal.")


def _start_of_stations(name: str, T0: Any, word: str) -> Iterator[Wrong]:
    """A start that differs where such a half has one temperature."""
    along = isinstance(T0, FieldSum) and all(term.y is None for term in T0.terms)
    if isinstance(T0, AtNodes) or (isinstance(T0, FieldSum) and not (along and word in ("rod", "thermal_rod"))):
        one = "one temperature a body" if word == "lumped" else "one temperature at each x"
        yield Wrong(("bodies", name, "T0"), f"the half {word!r} has {one}",
                    "Write a number, or choose the half thermal." if word == "lumped" else
                    "Write a number or terms of x, or choose the half thermal.")


# The mechanical halves


def elastic_wrongs(problem: ElasticProblem, interface: Interface) -> Iterator[Wrong]:
    """All that does not fit in the problem of the half `elastic`."""
    yield from _bodies(interface, problem.bodies, problem.materials)
    yield from _pairs(interface, problem.pairs, "pairs")
    soft = [pair.name for pair in interface.pairs if not pair.eps_N > 0.0]
    stiff = {name for name, material in problem.materials.items() if material.E is not None}
    # A material that lacks E is told of itself, below.
    if all(part.material in stiff for part in problem.parts.values()):
        for name in soft:
            yield Wrong(("pairs", name), "no penalty can be found, because a body has no E",
                        "State E of both bodies' materials, or the penalty [Pa/m].")
    yield from _one_way_to_settle(problem)
    yield from places(interface, problem.boundary)
    for i in range(len(problem.boundary)):
        yield from _condition(problem, i)
        if problem.boundary[i].rotation is not None and interface.axisymmetric:
            yield Wrong(("boundary", i, "rotation"), "a body of revolution does not turn in the plane of its section",
                        "Write `geometry: plane`, or give u_x and u_y as fields.")
    yield from conflicts(problem, interface)
    if problem.gravity is not None and any(b.name == problem.gravity.name for b in problem.boundary if b.name):
        yield Wrong(("gravity", "name"), f"the name {problem.gravity.name!r} is already that of a boundary condition",
                    "Each named condition is one input load.<name>.")
    for name, body in problem.bodies.items():
        used_here = dict.fromkeys((body.material, *(part.material for part in (body.regions or {}).values())))
        rho = {problem.materials[used].rho for used in used_here if used in problem.materials}
        # fault: a rigid body of two densities moves about the middle of its volume -> if False: |
        #   coupler/test_regions::test_halves_without_regions_refuse_them
        if problem.inert and body.rigid and len(rho) > 1:
            yield Wrong(("bodies", name, "regions"), "a rigid body with inertia has one density",
                        "Give its regions materials of the same rho, or let it deform.")
    if problem.state == "plane_stress" and interface.axisymmetric:
        yield Wrong(("state",), "plane stress is of plane geometry", "This scene is axisymmetric.")
    used = (part.material for part in problem.parts.values())
    weighed = {"inertia": problem.inert, "gravity": problem.gravity is not None, "adiabatic": problem.adiabatic}
    why = ", ".join(name for name, is_so in weighed.items() if is_so)
    needs = {"E": "", "nu": ""} | ({"rho": why} if why else {})
    yield from needed(problem.half, problem.materials, used, needs | ({"c": "adiabatic"} if problem.adiabatic else {}))


def _one_way_to_settle(problem: ElasticProblem) -> Iterator[Wrong]:
    """Augmented pairs, whose pressures hang together, that are to settle in different ways, or by no equilibrium."""
    ways = {name: pair.augmented.method for name, pair in problem.pairs.items() if pair.augmented is not None}
    first = next(iter(ways), "")
    for name, way in ways.items():
        # fault: different ways to settle not seen -> if False: | coupler/test_scenario_contact
        #   mechanical_fmu/test_semi_smooth
        if way is not ways[first]:
            yield Wrong(("pairs", name, "augmented", "method"),
                        f"{way.value} here, {ways[first].value} in contact.{first}: all augmented pairs are solved "
                        "together", "Write one method in all of them.")
        # fault: explicit steps with pressures that never settle are taken -> if False: | coupler/test_scenario_contact
        if problem.method is Solution.EXPLICIT:
            yield Wrong(("pairs", name, "augmented"), "method: explicit finds no equilibrium in which pressures settle",
                        f"Leave contact.{name}.augmented out: contact then presses by its penalty; or choose another "
                        "method.")


def _condition(problem: ElasticProblem, i: int) -> Iterator[Wrong]:
    """A condition that stands on the wrong kind of body."""
    boundary, key, bodies = problem.boundary[i], ("boundary", i), problem.bodies
    if boundary.body is not None:
        if boundary.body not in bodies:
            yield from known(boundary.body, bodies, (*key, "body"), "body")
        elif bodies[boundary.body].rigid:
            for k in ("u_x", "u_y"):
                field = getattr(boundary, k)
                if isinstance(field, FieldSum) and not field_from(field).is_uniform:
                    yield Wrong((*key, k), f"body {boundary.body!r} is rigid: it moves as a whole",
                                "Write a SIGNAL, and `rotation` or `angle` for its turn.")
        elif any(getattr(boundary, w) is not None for w in ("angle", *FORCES)):
            yield Wrong((*key, "body"), f"body {boundary.body!r} is not rigid",
                        "Drive its surfaces (on: body.surface), or say mechanical.elastic.bodies."
                        f"{boundary.body}.rigid: true.")
        return
    owner = bodies.get(boundary.where.split(".")[0])
    if owner is not None and owner.rigid and any(getattr(boundary, k) is not None for k in HELD):
        name = boundary.where.split(".")[0]
        yield Wrong(key, f"body {name!r} is rigid: it moves as a whole",
                    f"Write `body: {name}` with u_x, u_y, angle or rotation.")


def rigid_wrongs(problem: RigidProblem, interface: Interface) -> Iterator[Wrong]:
    """All that does not fit in the problem of the half `rigid`."""
    for name, motion in problem.motion.items():
        yield from known(name, interface.bodies, ("motion", name), "body")
        if motion.rotation is not None and interface.axisymmetric:
            yield Wrong(("motion", name, "rotation"), "a body of revolution does not turn in the plane of its section",
                        "Write `geometry: plane`.")
    yield from _pairs(interface, problem.pressure, "pressure")


def rod_wrongs(problem: RodProblem, interface: Interface) -> Iterator[Wrong]:
    """All that does not fit in the problem of the half `mechanical_rod`."""
    if interface.axisymmetric:
        yield Wrong(("geometry",), "the mechanical half `rod` is straight", "Write `geometry: plane`.")
    yield from _bodies(interface, problem.bodies, problem.materials)
    for pair in interface.pairs:
        # fault: rods leave aside in silence that they are tied -> if False: |
        #   coupler/test_ties::test_rods_are_not_tied
        if pair.tied:
            yield Wrong(("pairs", pair.name, "tied"), "rods press on each other, they do not pull: the mechanical half "
                        "`rod` has no tied pairs", "Choose the half elastic, or make the two one body.")
    for name in problem.held:
        yield from known(name, interface.bodies, ("held", name), "body")
    for name in interface.bodies:
        if name not in problem.held:
            yield Wrong(("held",), f"nothing holds body {name!r}", f"Add {name}: {{left: 0}}, or right.")
    yield from needed("rod", problem.materials, (b.material for b in problem.bodies.values()), {"alpha": ""})
    yield from unmeasured(problem.materials, "State the temperature at which it has its length.")


def unmeasured(materials: Mapping[str, Material], remedy: str) -> Iterator[Wrong]:
    """Materials that expand from a temperature that is not said."""
    for name, material in materials.items():
        if material.alpha not in (None, 0.0) and material.T_ref is None:
            yield Wrong(("materials", name), f"material {name!r} expands, but has no T_ref", remedy)
