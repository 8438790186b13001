"""What a user should know of a thermal model though it is no error."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.diagnostics import facing_at, start_notes
from contact.half.functions import property_from
from contact.half.gap_area import gap_areas
from contact.half.interface import Interface, Pair
from contact.half.outlines import depths, outline_of
from contact.half.pieces import piece_notes
from contact.half.register import register_message, search_depth
from contact.half.signs import wrong_signs
from contact.half.start import mean_start
from contact.laws import branch_jump, closed_conductance, gap_factor, open_conductance, parse_law
from contact.problem.thermal import SIGMA_SB
from coupler.scenario.si import ZERO_CELSIUS

# Conductances that differ by less than this share at touch join.
JOINED = 1e-6
# Heat that ends at gap_max is told where it is more than this share of what crosses in touch.
LEFT_OUT = 0.01
NO_CONDUCTANCE = {"law": "constant", "h": 0.0}

Model = Mapping[str, Any]
Floats = NDArray[np.float64]


def thermal_notes(model: Model, pairs: Iterable[Pair], T: float) -> list[str]:
    """A sentence each: conductance that jumps at touch, or is missing, starts at melting points, radiation missing or
    twice, gaps never seen.

    model : model.json of the thermal half (of another package: nothing is found in it).  pairs : of the scene.
    T : the mean over the bodies at the start [K].
    """
    known, pairs = model.get("pairs", {}), list(pairs)
    own = [note for pair in pairs for note in (*_torn_laws(pair.name, known.get(pair.name, {}), T),
                                               *_radiation(model, pair, known.get(pair.name, {})),
                                               *_cut_off(model, pair, known.get(pair.name)),
                                               *_out_of_sight(model, pair, known.get(pair.name, {})))]
    return own + _unlit(model, pairs) + _at_melting(model)


def _at_melting(model: Model) -> list[str]:
    """Bodies, and regions of them, that start at the one temperature at which their material melts."""
    latent = {name: material.get("latent") or {} for name, material in model.get("materials", {}).items()}
    stated = {name: part for body, heat in model.get("bodies", {}).items()
              for name, part in ((body, heat), *((f"{body}.{n}", r) for n, r in (heat.get("regions") or {}).items()))}
    found = []
    for name, part in stated.items():
        T_m = latent.get(part["material"], {}).get("T_m")
        # fault: nobody says in which phase a body starts -> if False: | coupler/test_scenario_thermal
        if isinstance(part["T0"], float | int) and part["T0"] == T_m:
            found.append(f"body {name} starts at {T_m:.6g} K, the melting temperature of {part['material']}: all of it "
                         "is molten then (f_s = 0). A T0 a little lower, by 0.01 K say, starts it solid")
    return found


def scaled_temperatures(model: Model, inputs: Iterable[str]) -> list[str]:
    """Prescribed temperatures that rules multiply, of a scenario in degC: a half has them in kelvin.

    model : model.json of the thermal half.  inputs : what rules set of it, `load.NAME`.
    """
    named = {f"load.{b['name']}" for b in model.get("boundary", ()) if "temperature" in b and "name" in b}
    example = 0.6 * (500.0 + ZERO_CELSIUS) - ZERO_CELSIUS
    # fault: nobody says of which temperature a factor is -> named = set() | coupler/test_scenario_rules
    named &= set(inputs)
    return [f"{name} multiplies a prescribed temperature in kelvin, in a file in degC too: 0.6 times 500 degC is "
            f"{example:.1f} degC. A temperature that is known beforehand is better given as a table over time"
            for name in sorted(named)]


def _torn_laws(name: str, pair: Model, T: float) -> list[str]:
    """A pair whose conductance jumps when it touches (physics wants h(g -> 0+) = h(p -> 0+))."""
    laws = pair.get("conduction", {})
    torn = None if laws.get("closed") is None or laws.get("open") is None else _torn(pair, T)
    return [] if torn is None else [
        f"pair {name}: the conductance jumps from {torn[0]:.6g} to {torn[1]:.6g} W/m2K when it touches; laws that join "
        "there let windows stay large"]


def _cut_off(model: Model, pair: Pair, spec: Model | None) -> list[str]:
    """A pair across which no heat goes, though the scene warms or cools its bodies.  spec : None of another package."""
    bodies = [surface.partition(".")[0] for surface in (pair.slave, pair.master)]
    stated = [model.get("bodies", {}).get(body, {}) for body in bodies]
    warmed = any(str(b.get("on", b.get("body", ""))).partition(".")[0] in bodies for b in model.get("boundary", ()))
    # fault: a pair that lets no heat pass is not told -> if True: | coupler/test_scenario_thermal
    if spec is None or pair.tied or bodies[0] == bodies[1] or spec.get("conduction") or spec.get("radiation"):
        return []
    if not warmed and stated[0].get("T0") == stated[1].get("T0"):
        return []
    return [f"pair {pair.name}: no heat crosses between {bodies[0]} and {bodies[1]}, because the pair has no "
            "conduction"]


def torn_pairs(model: Model, pairs: Iterable[Pair], T: float) -> dict[str, tuple[float, float]]:
    """Pairs whose conductance jumps when they touch -> h apart and h in touch [W/m2K]; no law is no conductance.

    model, pairs and T : as in thermal_notes.
    """
    known = model.get("pairs", {})
    found = {pair.name: _torn(known.get(pair.name, {}), T) for pair in pairs}
    return {name: torn for name, torn in found.items() if torn is not None}


def _torn(pair: Model, T: float) -> tuple[float, float] | None:
    laws = pair.get("conduction") or {}
    closed, opened = (parse_law(laws.get(key) or NO_CONDUCTANCE) for key in ("closed", "open"))
    h, jump = float(closed_conductance(closed, 0.0, T)[0]), branch_jump(closed, opened, T)
    return None if abs(jump) <= JOINED * max(abs(h), abs(h - jump)) else (h - jump, h)


def mean_T0(model: Model, interface: Interface) -> float:
    """Return the mean [K] over the bodies of what each has at the start."""
    return float(np.mean([_body_start(interface, name, body["T0"]) for name, body in model["bodies"].items()]))


def _body_start(interface: Interface, name: str, T0: Any) -> float:
    """The mean [K] over the nodes of a body at the start; the number itself where it is one."""
    return mean_start(T0, interface, np.flatnonzero(interface.node_body == interface.bodies.index(name)))


def _unlit(model: Model, pairs: Iterable[Pair]) -> list[str]:
    """Surfaces that give off heat to the facing one alone: one sentence for all that fade at the same gap."""
    known, alike = model.get("pairs", {}), dict[float, dict[str, str]]()
    for pair in pairs:
        near = known.get(pair.name, {}).get("radiation")
        if near is None or "gap" not in near:
            continue
        for surface in (pair.slave, pair.master):
            if not _far(model, surface):
                alike.setdefault(near["gap"]["d_far"], {}).setdefault(surface, pair.name)
    notes = []
    for gap, places in alike.items():
        names = list(dict.fromkeys(places.values()))
        has, it, faces, gives = (("has", "its", "it faces", "it gives") if len(places) == 1
                                 else ("have", "their", "they face", "they give"))
        notes.append(f"pair{'s' * (len(names) > 1)} {_listed(names)}: near radiation ends at a gap of {gap:g} m, and "
                     f"{_listed(list(places))} {has} no radiation of {it} own: farther apart, and where {faces} "
                     f"nothing, {gives} off none")
    return notes


def _listed(names: list[str]) -> str:
    """a, b and c."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _far(model: Model, surface: str) -> list[Model]:
    """The radiation of a surface to its surroundings."""
    return [b["radiation"] for b in model.get("boundary", ()) if "radiation" in b and b["on"] == surface]


def _radiation(model: Model, pair: Pair, spec: Model) -> list[str]:
    """Near radiation of a pair beside far radiation of its surfaces: they should share one pair of gaps."""
    near = spec.get("radiation")
    if near is None:
        return []
    notes = []
    for surface in dict.fromkeys((pair.slave, pair.master)):
        for b in _far(model, surface):
            if "gap" not in b or "gap" not in near:
                notes.append(f"pair {pair.name}: near radiation and the radiation on {surface} both act at every gap: "
                             "give both the same gap")
            elif b["gap"] != near["gap"]:
                notes.append(f"pair {pair.name}: near radiation and the radiation on {surface} fade over different "
                             "gaps")
    return notes


def _out_of_sight(model: Model, pair: Pair, spec: Model) -> list[str]:
    """What fades over gaps that reach beyond gap_max ends there at once: nothing is faced farther off."""
    fading = [("near radiation", "d_far", spec.get("radiation", {}).get("gap", {}).get("d_far"))]
    fading += [(f"{kind} on {b['on']}", key, b.get(kind, {}).get("gap", {}).get(key)) for b in model.get("boundary", ())
               if b.get("on") in (pair.slave, pair.master) for kind, key in (("convection", "d_full"),
                                                                            ("radiation", "d_far"))]
    return [f"pair {pair.name}: {what} fades up to {key} = {far:g} m, but the surfaces see each other only up to "
            f"gap_max = {pair.gap_max:g} m: it jumps there" for what, key, far in fading
            if far is not None and far > pair.gap_max]


def crossing_at_reach(model: Model, pairs: Iterable[Pair], T: float) -> dict[str, float]:
    """Pairs that leave out heat beyond gap_max -> the conductance their laws have there [W/m2K].

    Where that is next to nothing of what they have in touch, nothing is left out.  model, pairs and T : as in
    thermal_notes.
    """
    known = model.get("pairs", {})
    found = {}
    for pair in pairs:
        at_touch, there = (_conductance(known.get(pair.name, {}), model, gap, T) for gap in (0.0, pair.gap_max))
        # fault: what is next to nothing at gap_max is told to be left out -> if there > 0.0 and not pair.tied: |
        #   coupler/test_scenario_thermal
        if there > LEFT_OUT * at_touch and not pair.tied:
            found[pair.name] = there
    return found


def _conductance(spec: Model, model: Model, gap: float, T: float) -> float:
    """What crosses a gap [m] of a pair by its law and by radiation, for small differences of T [W/m2K]."""
    opened, near = (spec.get("conduction") or {}).get("open"), spec.get("radiation")
    h = 0.0 if opened is None else float(open_conductance(parse_law(opened), gap, T)[0])
    if near is not None:
        eps_s, eps_m = (float(property_from(near[f"emissivity_{side}"])(np.array([T]))[0])
                        for side in ("slave", "master"))
        fade = near.get("gap")
        seen = 1.0 if fade is None else 1.0 - float(gap_factor(gap, fade["d_near"], fade["d_far"]))
        h += seen * 4.0 * model.get("sigma_SB", SIGMA_SB) * T**3 / (1.0 / eps_s + 1.0 / eps_m - 1.0)
    return h


# What a user should know of a scenario's contact though it is no error.

def contact_notes(interface: Interface, thermal: Model, mechanical: Model) -> list[str]:
    """A sentence each: bodies that overlap, pairs that face nothing, folds, too stiff penalties, gaps not parallel.

    thermal, mechanical : model.json of the halves (of another package: what is not found in them is not told).
    """
    return (overlap_notes(interface) + start_notes(interface, _stiffness(interface, thermal, mechanical))
            + role_notes(interface, thermal) + film_notes(interface, thermal) + node_notes(interface)
            + tie_notes(interface) + piece_notes(interface))


def _stiffness(interface: Interface, thermal: Model, mechanical: Model) -> dict[str, float]:
    """Body -> E [Pa] at its T0, of the bodies that deform."""
    found = {}
    for name, body in mechanical.get("bodies", {}).items():
        T0 = thermal.get("bodies", {}).get(name, {}).get("T0")
        made_of = dict.fromkeys((body.get("material"), *(r["material"] for r in body.get("regions", {}).values())))
        E = [mechanical.get("materials", {}).get(material, {}).get("E") for material in made_of]
        if T0 is not None and None not in E and not body.get("rigid", False):
            found[name] = min(float(property_from(e)(np.array([_body_start(interface, name, T0)]))[0]) for e in E)
    return found


# Pairs whose bodies start inside each other, too deep for contact to see.

# Nodes of a surface looked at: a body in the wrong place shows on a few of them as well as on all.
SAMPLES = 40
TOUCHES = 1e-6  # of an edge: how numbers of what touches are written


def overlap_notes(interface: Interface) -> list[str]:
    """One sentence a pair of which a side lies inside the other's body, deeper than contact looks.

    What lies deeper faces nothing: the half elastic refuses it, others go on as if the bodies did not meet.
    """
    notes = []
    for pair in interface.pairs:
        for own, other in ((pair.slave, pair.master), (pair.master, pair.slave)):
            body = other.split(".")[0]
            if n := _too_deep(interface, pair, own, other, body):
                notes.append(f"pair {pair.name}: {n} of the nodes looked at on {own} start inside {body}, deeper than "
                             "contact looks; is a body in the wrong place?")
                break
    return notes


def _too_deep(interface: Interface, pair: Pair, own: str, other: str, body: str) -> int:
    ends = [interface.nodes[interface.surfaces[name]] for name in (pair.slave, pair.master)]
    longest = max(float(np.linalg.norm(e[:, 1] - e[:, 0], axis=1).max()) for e in ends)
    nodes = np.unique(interface.surfaces[own])
    face = interface.nodes[np.unique(interface.surfaces[other])]
    depth = search_depth(interface, pair)
    points = interface.nodes[nodes[:: max(1, len(nodes) // SAMPLES)]]
    # The nearest node of the other face is at most half an edge farther than the face itself.
    apart = np.array([np.linalg.norm(face - x, axis=1).min() for x in points])
    outline = outline_of(interface, interface.bodies.index(body))
    deep = depths(points, interface.nodes[outline[:, 0]], interface.nodes[outline[:, 1]])
    # fault: what touches another side of the body is taken to lie inside -> inside = deep >= 0.0 |
    #   coupler/test_scenario_load::test_a_block_that_touches_with_one_side_is_not_told_to_be_inside
    inside = deep > TOUCHES * longest
    return int((inside & (apart > max(longest, depth) + 0.5 * longest)).sum())


# Gaps that conduct otherwise when slave and master change over.

# The heat with one side as the slave may differ by this share from that with the other before it is told.
UNLIKE_ROLES = 1e-3


def role_notes(interface: Interface, thermal: Model) -> list[str]:
    """One sentence a pair whose open gap conducts otherwise, at the start, when slave and master change over."""
    if not any(_open_law(thermal, pair) for pair in interface.pairs):
        return []
    exchanged = tuple(replace(pair, slave=pair.master, master=pair.slave) for pair in interface.pairs)
    by_slave, by_master = (_gap_conductances(i, thermal) for i in (interface, replace(interface, pairs=exchanged)))
    notes = []
    for pair, a, b in zip(interface.pairs, by_slave, by_master, strict=True):
        # fault: either side taken for the same -> if pair.two_pass or a * b >= 0.0: |
        #   coupler/test_scenario_thermal
        if pair.two_pass or abs(a - b) <= UNLIKE_ROLES * max(a, b):
            continue
        notes.append(f"pair {pair.name}: at the start its gap conducts {a:.4g} W/K with {pair.slave} as the slave and "
                     f"{b:.4g} with {pair.master}, {100.0 * abs(a - b) / max(a, b):.2g} % apart: "
                     + ("one point a node does not measure it better" if pair.by_node else
                        "a place faces more than one other there, as at a hollow, or edges are long beside the gap")
                     + "; two_pass: true takes the mean")
    return notes


def _open_law(thermal: Model, pair: Pair) -> Model | None:
    laws: Model = thermal.get("pairs", {}).get(pair.name, {}).get("conduction") or {}
    return laws.get("open")


def _gap_conductances(interface: Interface, thermal: Model) -> list[float]:
    """Return the heat each pair passes across what is open at the start, by one kelvin [W/K]; 0 where it has no law."""
    facing = facing_at(interface, interface.nodes)
    edges = interface.contact_nodes[register_message(interface).edges].reshape(-1, 2)
    area, _, _ = gap_areas(interface, edges, facing, interface.nodes)
    out = []
    for k, pair in enumerate(interface.pairs):
        law = _open_law(thermal, pair)
        at = (facing.pair == k) & (facing.gap > 0.0)
        h = 0.0 if law is None else open_conductance(parse_law(law), facing.gap[at], mean_T0(thermal, interface))[0]
        out.append(float((h * area[at]).sum()))
    return out


# Films on what another body covers.

CLOSE = 1e-3  # of an edge: a gap that is less is none as drawn


def film_notes(interface: Interface, thermal: Model) -> list[str]:
    """One sentence for each film, without a gap, on a surface that the other side of a pair touches as drawn."""
    films = {b["on"] for b in thermal.get("boundary", ()) if "convection" in b and "gap" not in b["convection"]}
    pairs = [(k, pair) for k, pair in enumerate(interface.pairs) if films & {pair.slave, pair.master}]
    if not pairs:
        return []
    facing, notes = facing_at(interface, interface.nodes), {}
    edges = interface.contact_nodes[register_message(interface).edges].reshape(-1, 2)
    length = np.linalg.norm(interface.nodes[edges[:, 1]] - interface.nodes[edges[:, 0]], axis=1)
    for k, pair in pairs:
        at = facing.pair == k
        touches = bool((facing.gap[at] < CLOSE * length[facing.slave_edge[at]]).any())
        for own, other in ((pair.slave, pair.master), (pair.master, pair.slave)):
            # fault: a film under another body is not told -> if False: | coupler/test_scenario_thermal
            if own in films and touches:
                notes[own] = (f"convection on {own} acts where {other} covers it, too. With a gap, such as "
                              "`gap: {d_cut: 0, d_full: 1 mm}`, it acts on what is uncovered alone")
    return list(notes.values())


# Points of `form: nodes` that do not face a node.

ON_NODE = 1e-3  # of an edge: what is nearer to a node faces it


def node_notes(interface: Interface) -> list[str]:
    """One sentence a pair of one point a node, between meshes whose nodes do not face each other."""
    if not any(pair.by_node for pair in interface.pairs):
        return []
    facing = facing_at(interface, interface.nodes)
    beside = (np.minimum(facing.xi_m, 1.0 - facing.xi_m) > ON_NODE) & (facing.area > 0.0)
    return [f"pair {pair.name}: with form: nodes the patch test fails where nodes do not face each other: a uniform "
            "flow of heat, or a uniform pressure, is passed on unevenly (0.8 to 1.7 % of the span of temperature "
            "between edges of 3 and 4 cells); form: edges is exact, and so are meshes that match"
            for k, pair in enumerate(interface.pairs) if pair.by_node and beside[facing.pair == k].any()]


# Ties of a part of a surface.

WHOLE = 0.999  # of its area: a corner that lies a little beyond the other side is no news


def tie_notes(interface: Interface) -> list[str]:
    """One sentence a tied pair of which only a part of the slave, or none, faces the master as drawn."""
    if not any(pair.tied for pair in interface.pairs):
        return []
    facing, notes = facing_at(interface, interface.nodes), []
    for k, pair in enumerate(interface.pairs):
        ends = interface.nodes[interface.surfaces[pair.slave]]
        area = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        if interface.axisymmetric:
            area *= 2.0 * np.pi * ends[..., 0].mean(axis=1)
        share = float(facing.area[facing.pair == k].sum() / area.sum())
        # fault: ties of a part of a surface are not told -> if False: | coupler/test_ties
        if pair.tied and share < WHOLE:
            notes.append(f"pair {pair.name}: {100.0 * share:.3g} % of {pair.slave} is tied; the rest faces nothing "
                         f"within gap_max = {pair.gap_max:g} m as drawn, and stays free")
    return notes


# Meshes on which temperatures may leave their data.

# Of a node's own entry in the conduction matrix: a coupling with the wrong sign that is told.
WRONG_SHARE = 1e-3


def sign_notes(interface: Interface, thermal: Model) -> list[str]:
    """One sentence a body whose mesh couples nodes with the wrong sign.  thermal : model.json, as in thermal_notes."""
    if thermal.get("half") != "thermal" or not interface.bodies:
        return []
    k = {part: _tensor(thermal, interface, part) for part in interface.parts}
    notes = []
    for name, worst in wrong_signs(interface, k, WRONG_SHARE).items():
        shape = ("triangles without angles beyond 90 degrees" if worst.triangle else "quads nearer to rectangles")
        if any(k[part][0, 0] != k[part][1, 1] or k[part][0, 1] != 0.0 for part in k if part.split(".")[0] == name):
            shape = "rectangles along the axes of conductivity, sqrt(k_1/k_2) times longer along the first,"
        notes.append(f"body {name}: {worst.edges} of the {worst.of} couplings of its mesh conduct with the wrong sign, "
                     f"the worst by {100.0 * worst.share:.2g} % of its nodes' own at ({worst.at[0]:.4g}, "
                     f"{worst.at[1]:.4g}) m, in a cell with an angle of {worst.angle:.0f} degrees: beside a jump "
                     f"temperatures may leave their data by a part of that; {shape} have none")
    return notes


def _tensor(thermal: Model, interface: Interface, part: str) -> Floats:
    """The conductivity of a body or region at the body's T0 while solid, (2, 2) [W/mK]."""
    body, _, region = part.partition(".")
    of = thermal["bodies"][body]
    T0 = np.array([_body_start(interface, body, of["T0"])])
    k = thermal["materials"][(of["regions"][region] if region else of)["material"]]["k"]
    axes = k if isinstance(k, Mapping) and "k_2" in k else {"k_1": k, "k_2": k}
    solid = (v["solid"] if isinstance(v, Mapping) and "solid" in v else v for v in (axes["k_1"], axes["k_2"]))
    k_1, k_2 = (float(property_from(v)(T0)[0]) for v in solid)
    angle = axes.get("angle", 0.0)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return np.diag([k_1, k_2]) if k_1 == k_2 else np.asarray(turn @ np.diag([k_1, k_2]) @ turn.T)
