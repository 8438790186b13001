"""Sets up a run: the plan of a scenario, the outputs asked of the halves, and their state before the first window."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.start import start_coordinates
from coupler.control.auto import chooses, schemes_under
from coupler.control.body_strain import body_cells
from coupler.control.contact_status import Branch, PairNodes, branches_of, pair_nodes_of, reaches_of, status_monitors
from coupler.control.flutter import Torn
from coupler.control.plan import Locate, Plan
from coupler.errors import HalfError
from coupler.fmu.bounds import scenario_border
from coupler.fmu.half import Half
from coupler.fmu.held import HeldHalf, check_scene
from coupler.fmu.launch import Launched
from coupler.rules.engine import schemes_of, unfit, wanted
from coupler.scenario import Scenario
from coupler.scenario.notes import crossing_at_reach, mean_T0, torn_pairs
from coupler.scenario.rule_model import outputs
from coupler.scenario.scales import OF_LENGTH, latent_span, length_of
from coupler.scenario.timing import has_inertia, is_steady, varies
from coupler.schemes.accounts import HEATS, EnergyAccount
from coupler.schemes.levels import Level
from coupler.schemes.schedule import schedule
from coupler.schemes.schemes import scheme_of
from coupler.schemes.state import ELASTIC_STRAIN, CoupledState, Halves, wanted_outputs
from coupler.trust.surfaces.skipped import PlacedData
from coupler.trust.surfaces.ways import Ways

Array = NDArray[np.float64]

NO_HEAT = 1e-12  # J: round-off


def held_halves(launched: Launched, scenario: Scenario) -> Launched:
    """Return the halves held to what any half must keep to (coupler.fmu.bounds).

    Raises HalfError for one of another scene, and for blocks that no run can use.
    """
    for half in (launched.thermal, launched.mechanical):
        check_scene(half, scenario.interface)
    scene = scenario_border(scenario)

    def held(role: str, half: Half) -> Half:
        # One on a mesh of its own is held to that (coupler.schemes.mapped).
        return half if role in scenario.own_meshes else HeldHalf(half, role, scene)

    return replace(launched, thermal=held("thermal", launched.thermal),
                   mechanical=held("mechanical", launched.mechanical))


def check_halves(thermal: Half, mechanical: Half, scenario: Scenario) -> None:
    """Check the halves.  Raises HalfError for one that lacks what a scheme or rule needs."""
    if lacks := unfit(scenario.rules, {"thermal": thermal.blocks, "mechanical": mechanical.blocks}):
        raise HalfError("; ".join(lacks))
    named = {scenario.coupling.scheme, *schemes_of(scenario.rules)}
    for scheme in (scheme_of(name) for name in sorted(named, key=lambda n: n.value) if not chooses(name)):
        if (lack := scheme.lacking(thermal, mechanical, scenario.coupling.substeps)) is not None:
            raise lack
    for half in (thermal, mechanical):
        if half.can_save:
            continue
        if any(scheme.needs_states for name in named for scheme in schemes_under(name)):
            raise HalfError("cannot save its state, so its windows cannot be iterated; give another coupling.scheme",
                            half=half.name)
        if scenario.coupling.adaptive is not None or scenario.coupling.locate:
            raise HalfError("cannot save its state, so no window can be repeated; give coupling.windows instead of "
                            "coupling.adaptive, and leave coupling.events.locate false", half=half.name)


def halves_of(thermal: Half, mechanical: Half, plan: Plan, interface: Interface) -> Halves:
    """Join both halves with the outputs to ask for after every substep: exchanged, recorded, of events and rules."""
    more = status_monitors(interface) if plan.locate.on else ()
    halves = wanted_outputs(thermal, mechanical, {*outputs(wanted(plan.rules)), *more})
    # Around an axis nothing turns: what looks like it is bodies that deform.
    # fault: rings turn in their plane -> return replace(halves, bodies=interface.node_body) |
    #   scenarios/test_aluminium_can::test_the_first_minute_is_as_it_was
    return replace(halves, bodies=None if interface.axisymmetric else interface.node_body)


def first_state(launched: Launched, halves: Halves, interface: Interface, end: float,
                loads: Mapping[str, Mapping[str, float]] | None = None) -> CoupledState:
    """Initialise both halves for a run of `end` seconds, and return the state they exchange then.

    loads : half -> name of an input -> value at the start, where it is not the half's own.
    Raises HalfError where a half refuses to start.
    """
    thermal, mechanical = launched.thermal, launched.mechanical
    n_q = len(interface.pair_nodes)
    own = {side: {n: np.array(v) for n, v in (loads or {}).get(side, {}).items()} for side in ("thermal", "mechanical")}
    x = {"x": start_coordinates(interface)}
    first = thermal.initialise(0.0, end, _parameters(thermal, launched.link), x | own["thermal"], [
        "T", *(n for n in ("f_s",) if n in halves.thermal_outputs)])
    given = {n: v for n, v in first.items() if n in mechanical.blocks}
    # fault: a half starts under all of a driven load -> out = mechanical.initialise(0.0, end, _parameters(mechanical,
    #   launched.link), given, [ | scenarios/test_superplastic_bulge
    out = mechanical.initialise(0.0, end, _parameters(mechanical, launched.link), given | own["mechanical"], [
        n for n in ("x", "contact.t_N", "contact.gap", "contact.covered", ELASTIC_STRAIN)
        if n in halves.mechanical_outputs])
    now = Level(0.0, first["T"], out["x"], out.get("contact.t_N", np.zeros(n_q)),
                out.get("contact.gap", np.full(n_q, np.nan)), out.get("contact.covered", np.zeros(n_q)),
                first.get("f_s"), elastic_strain=out.get(ELASTIC_STRAIN))
    return CoupledState(now, (), 0, accounts_of(mechanical, len(interface.quads) + len(interface.triangles)))


def _parameters(half: Half, link: str) -> dict[str, str]:
    """How a half reaches contact; one of another tool may have no use for it."""
    # fault: a half without a link to contact cannot start -> return {"contact.link": link} |
    #   coupler/test_bind::test_it_runs_as_its_own_law_says_in_units_of_ours
    return {"contact.link": link} if "contact.link" in half.blocks else {}


def heat_of_the_start(mechanical: Half) -> list[str]:
    """Return a note of the heat that the mechanical half made while it found its start, in no time; none where none."""
    names = [n for n in _made_by(mechanical) if n != "E_S"]
    # fault: the heat of the start is not told -> made = {} | coupler/test_load_at_the_start
    made = {n: float(np.abs(value).sum()) for n, value in mechanical.read(names, finite=False).items()}
    parts = " and ".join(f"{J:.3g} J of {HEATS[n]}" for n, J in made.items() if J > NO_HEAT)
    if not parts:
        return []
    return [f"the start was found in equilibrium under the loads and fits there: {parts} from this is not in the heat "
            "balance. A load written {t: [0, 0], value: [0, ...]} acts just after the start; a fit always acts at it"]


def what_is_missing(thermal: Half, mechanical: Half, touches: bool) -> list[str]:
    """Return what the halves lack and what it costs, a sentence each.  touches : the scene has contact pairs."""
    notes = [f"{half.name} cannot save its state: a window that fails cannot be repeated"
             for half in (thermal, mechanical) if not half.can_save]
    if touches and "contact.t_N" not in mechanical.blocks:
        notes.append(f"{mechanical.name} gives no contact.t_N: conductance sees no pressure")
    if touches and "contact.gap" not in mechanical.blocks:
        notes.append(f"{mechanical.name} gives no contact.gap: gaps are not recorded")
    notes += [f"{thermal.name} takes no {n}: the heat {mechanical.name} makes is counted but not delivered"
              for n in _made_by(mechanical) if n not in thermal.blocks]
    return notes


def not_told(launched: Launched, foreign: Mapping[str, bool]) -> list[str]:
    """Return what halves do not say of themselves, or say oddly, a sentence each, once they have started.

    foreign : role -> whether the half is of another package: what ours begin with is known to be the scene.
    """
    halves = {"thermal": launched.thermal, "mechanical": launched.mechanical}
    notes = [f"{half.name} does not say of which mesh it is (mesh.hash): that its nodes are those of the scene is seen "
             "from its first values alone" for half in halves.values() if "mesh.hash" not in half.blocks]
    return notes + [f"{half.name}: {half.off_the_mesh}" for role, half in halves.items()
                    if foreign[role] and isinstance(half, HeldHalf) and half.off_the_mesh]


def without_checkpoints(halves: Mapping[str, Half], every: float | None) -> list[str]:
    """Return why no checkpoints can be written, a sentence a half.  every : output.checkpoint [s], None: never."""
    if every is None:
        return []
    return [f"{half.name} cannot write its state down (canSerializeFMUstate): there are no checkpoints to resume from"
            # fault: a run without checkpoints does not say so -> for half in halves.values() if False] |
            #   coupler/test_coupling
            for half in halves.values() if not half.can_serialise]


def accounts_of(mechanical: Half, n_cells: int) -> dict[str, EnergyAccount]:
    """Return an empty account for E_M, (n_cells,) [J], and for each other heat that the mechanical half makes."""
    shapes = {"E_M": (n_cells,)} | {n: mechanical.blocks[n].shape for n in _made_by(mechanical)}
    return {n: EnergyAccount(np.zeros(shape), at_end=mechanical.strings.get(f"{n}.at") == "end")
            for n, shape in shapes.items()}


def _made_by(half: Half) -> list[str]:
    return [n for n in HEATS if n in half.blocks and half.blocks[n].causality == "output"]


def plan_of(scenario: Scenario) -> Plan:
    """Return the plan of a scenario, from its first window to its last."""
    c = scenario.coupling
    interface = scenario.interface
    nodes = pair_nodes_of(interface) if c.locate else ()
    locate = Locate(c.locate, c.event_tolerance, nodes, _branches(scenario, nodes) if c.locate else ())
    steady_data = not (c.kinks or varies(scenario.models["thermal"]) or varies(scenario.models["mechanical"])
                       or any(rule.changes_loads for rule in scenario.rules))
    return Plan(schedule(c.end, c.windows, c.kinks, c.bends), c.scheme, c.substeps, c.iteration, c.adaptive, locate,
                c.on_cycle, c.on_unstable, c.steady, scenario.rules, cells=body_cells(interface),
                pairs=tuple(pair.nodes for pair in pair_nodes_of(interface) if not pair.tied),
                steady_data=steady_data, steady_T=is_steady(scenario.models), torn=_torn(scenario),
                inertia=has_inertia(scenario.models["mechanical"]),
                placed=PlacedData(interface, scenario.models["thermal"]),
                # fault: what melts is steady while it melts -> latent=0.0) | coupler/test_stop_steady
                latent=latent_span(scenario.models["thermal"]), ways=Ways(interface, scenario.models["mechanical"]))


def _branches(scenario: Scenario, nodes: tuple[PairNodes, ...]) -> tuple[Branch, ...]:
    thermal, interface = scenario.models["thermal"], scenario.interface
    ends = crossing_at_reach(thermal, interface.pairs, mean_T0(thermal, interface))
    bends = branches_of(thermal, interface.pairs, nodes) if scenario.coupling.branches else ()
    return *bends, *reaches_of(ends, interface, nodes)


def _torn(scenario: Scenario) -> Torn:
    thermal, interface = scenario.models["thermal"], scenario.interface
    return Torn(torn_pairs(thermal, interface.pairs, mean_T0(thermal, interface)),
                OF_LENGTH * length_of(interface), scenario.coupling.end,
                {pair.name: pair for pair in pair_nodes_of(interface)})
