"""How large a scene is: its lengths, temperatures, heats and pressures, and the absolute tolerances that follow.

A fixed number of kelvin or metres is nothing in one scene and all of it in another.  What a file does not state of
`atol` is therefore a share of the scene's own scales, so that physically similar scenes are solved alike.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import property_from
from contact.half.interface import Interface
from contact.half.start import start_coordinates, start_temperature
from contact.laws import open_conductance, parse_law
from coupler.scenario.document import Document, Key
from coupler.scenario.options import ErrorTolerances, Tolerances
from coupler.scenario.probes import cell_volumes
from coupler.scenario.thermal_data import TemperatureData
from coupler.scenario.timing import CouplingOptions

Array = NDArray[np.float64]
AnyTolerances = TypeVar("AnyTolerances", ErrorTolerances, Tolerances)

# Shares of a scale.  Of the span of temperatures where nothing makes heat, for then it bounds them all; else of the
# highest one.  In a scene of 0.1 m at 330 K they are 0.01 K and 1e-7 m.
OF_SPAN, OF_T = 1e-4, 3e-5
OF_LENGTH = 1e-6  # thermal expansion is some thousand times as much
# Of the gap over which conductance changes by as much as it is: what a gap is off by is felt as heat, too, and that
# has a tolerance of its own.  A hundredth of it takes two thirds more solver calls for no better temperatures.
OF_LAYER = 1.0
OF_HEAT = 0.1  # of the heat that warms the smallest body by the tolerance of temperature
OF_E = 1e-9
# An iteration is to leave so much less of T and x than a window may err by: all that follows is measured beside it.
FINER_T, FINER_X = 0.003, 0.01
MOST_LEFT = 0.3  # of what a window may err by; beyond it windows become short for what iterations leave
# What rounding leaves, of the length and of the highest temperature: no tolerance is less.
ROUND_OFF = 1e-11
# What solvers leave of what is 0, of the modulus, of it times a length, of the length: a stress of 20 Pa in steel.  Of
# heat that of a body: 3e-8 K.
OF_NOTHING = 1e-10
# Gaps at which laws are looked at, of the length.
GAPS = np.concatenate([[0.0], np.geomspace(1e-8, 1.0, 200)])
# Of a scene that does not say, in K, m, J and Pa: of 0 K alone, of one node, without heat capacity or modulus.
NO_T, NO_LENGTH, NO_HEAT, NO_PRESSURE = 300.0, 0.1, 1e-3, 100.0


@dataclass(frozen=True)
class Scales:
    """Absolute tolerances by the scales of a scene: of windows, that of pressure of iterations; none is 0.

    temperature [K], displacement [m], gap [m], heat [J], pressure [Pa].  least_T [K], least_x [m]: above rounding.
    """

    temperature: float
    displacement: float
    gap: float
    heat: float
    pressure: float
    least_T: float
    least_x: float


def scales_of(interface: Interface, models: Mapping[str, Mapping[str, Any]], end: float) -> Scales:
    """Return the scales of a scene.  models : role -> model.json, SI and kelvin.  end [s]: of the run."""
    thermal = models["thermal"]
    length = length_of(interface)
    low, high = _temperatures(interface, thermal, end)
    highest = max(abs(low), abs(high)) or NO_T
    T = OF_T * highest
    # fault: temperatures that span little are held to a share of how high they are -> if False: | coupler/test_scales
    if high > low and not _makes_heat(models):
        T = min(T, OF_SPAN * (high - low))
    T = max(T, ROUND_OFF * highest)
    gap = min(OF_LENGTH * length, OF_LAYER * _layer(thermal, length))
    heat = min((OF_HEAT * T * C for C in _heat_capacities(interface, thermal)), default=NO_HEAT)
    pressure = min((OF_E * E for E in _moduli(models["mechanical"])), default=NO_PRESSURE)
    return Scales(T, OF_LENGTH * length, gap, heat, pressure, ROUND_OFF * highest, ROUND_OFF * length)


def scaled(options: CouplingOptions, scales: Scales, document: Document) -> CouplingOptions:
    """Return the options with every `atol` that the file does not state as the scene needs it."""
    T, x, adaptive = scales.temperature, scales.gap, options.adaptive
    if adaptive is not None:
        window = _filled(adaptive.tolerance, {
            "temperature": (scales.temperature, scales.least_T), "gap": (scales.gap, scales.least_x),
            "displacement": (scales.displacement, scales.least_x), "heat": (scales.heat, 0.0)},
            document, ("coupling", "adaptive", "tolerance"))
        adaptive = replace(adaptive, tolerance=window)
        # What iterating leaves counts as error of a window: above its tolerance no window would be short enough.
        # fault: windows are held to less than their iterations leave -> pass | coupler/test_scales
        T, x = min(T, window.temperature.atol), min(x, window.gap.atol, window.displacement.atol)
    iteration = _filled(options.iteration.tolerance, {
        "temperature": (FINER_T * T, scales.least_T), "gap": (FINER_X * x, scales.least_x),
        "pressure": (scales.pressure, 0.0)}, document, ("coupling", "iteration", "tolerance"))
    return replace(options, iteration=options.iteration.changed(tolerance=iteration), adaptive=adaptive)


def slight_temperature(interface: Interface, models: Mapping[str, Mapping[str, Any]],
                       options: CouplingOptions) -> float:
    """Return by how much temperatures may be wrong without harm [K]: what windows may err by, stated or by the scene.

    Who states more for the sake of speed does not say that it means nothing.
    """
    of_scene = scales_of(interface, models, options.end).temperature
    if options.adaptive is None:
        return of_scene
    # fault: an error that a file states to matter does not -> return of_scene | coupler/test_scales
    return min(of_scene, options.adaptive.tolerance.temperature.atol)


def slight_errors(interface: Interface, models: Mapping[str, Mapping[str, Any]],
                  options: CouplingOptions) -> dict[str, float]:
    """Return by unit [SI] how far off what a run tells may be without harm.

    Temperatures by what windows may err by.  Places and pressures by what iterations may leave of them: all of a stiff
    body's strain may be less than what windows are allowed.
    """
    left = options.iteration.tolerance
    return {"K": slight_temperature(interface, models, options), "m": left.gap.atol, "Pa": left.pressure.atol}


def loose_iterations(options: CouplingOptions) -> list[str]:
    """Return a note where iterations may leave so much that hardly a window is within its tolerance."""
    if options.adaptive is None:
        return []
    left, may = options.iteration.tolerance.temperature.atol, options.adaptive.tolerance.temperature.atol
    # fault: iterations that leave more than a window may err by are not told -> if True: | coupler/test_scales
    if left <= MOST_LEFT * may:
        return []
    return [f"iterations may leave {left:.3g} K (coupling.iteration.tolerance.temperature.atol), which counts as error "
            f"of a window, and a window may err by {may:.3g} K at rest (coupling.adaptive.tolerance.temperature.atol): "
            "windows become far too short. Leave the first out, or make it a hundredth of the second"]


def _filled(given: AnyTolerances, scales: Mapping[str, tuple[float, float]], document: Document,
            at: Key) -> AnyTolerances:
    """The tolerances with what the file leaves out.  scales : quantity -> its `atol` by the default `rtol`, the least.

    Who asks for a tenth of the default `rtol` means a tenth of the absolute part too.
    """
    made = {}
    for name, (atol, least) in scales.items():
        # fault: what a file leaves out is a fixed number -> if True: |
        #   coupler/test_scales::test_scenes_that_are_physically_similar_are_solved_alike
        if document.value((*at, name, "atol")) is not None:
            continue
        tolerance, default = getattr(given, name), getattr(type(given)(), name)
        # fault: a tighter rtol leaves the absolute part as it is -> finer = 1.0 | coupler/test_scales
        finer = tolerance.rtol / default.rtol or 1.0
        made[name] = tolerance.changed(atol=max(atol * finer, least))
    return given.changed(**made)


def left_of_nothing(interface: Interface, models: Mapping[str, Mapping[str, Any]]) -> dict[str, float]:
    """Return by unit [SI] what solvers and rounding may leave of a quantity that is 0 by symmetry or statics.

    models : role -> model.json.  A unit of which the scene does not say how large it is has no entry.
    """
    length, turn = length_of(interface), 2.0 * math.pi if interface.axisymmetric else 1.0
    moduli = list(_moduli(models["mechanical"]))
    conducts = [_largest(m["k"]) for m in models["thermal"].get("materials", {}).values() if m.get("k") is not None]
    left = {"m": length, "1": 1.0}
    if moduli:
        # Per metre of depth; in a scene around an axis for the whole turn.
        depth = turn * length if interface.axisymmetric else 1.0
        left |= {"Pa": max(moduli), "N": max(moduli) * length * depth, "N m": max(moduli) * length**2 * depth}
    if conducts:
        left["W/m2"] = max(conducts) * NO_T / length
    # fault: heat that is 0 by symmetry is off by what rounding leaves -> capacity = 0.0 | coupler/test_trust_nothing
    capacity = max(_heat_capacities(interface, models["thermal"]), default=0.0)
    if capacity:
        left["J"] = capacity * NO_T
    return {unit: OF_NOTHING * size for unit, size in left.items()}


def _parts(model: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Each body and each of its regions, with the name of the body."""
    for name, body in model.get("bodies", {}).items():
        yield from ((name, part) for part in (body, *(body.get("regions") or {}).values()))


def length_of(interface: Interface) -> float:
    """The longest side of the box around any one body [m]; of a scene of single nodes, what they are apart."""
    x = start_coordinates(interface)
    longest = max(float(np.ptp(x[interface.node_body == k], axis=0).max()) for k in range(len(interface.bodies)))
    return longest or float(np.ptp(x, axis=0).max()) or NO_LENGTH


def _temperatures(interface: Interface, thermal: Mapping[str, Any], end: float) -> tuple[float, float]:
    """The lowest and the highest temperature [K] that anything states, over the whole run."""
    starts = [start_temperature(part["T0"], interface, np.flatnonzero(
        interface.node_body == interface.bodies.index(body))) for body, part in _parts(thermal)]
    low, high = TemperatureData(thermal).between(0.0, end, interface.nodes, {})
    return min(low, *(float(T.min()) for T in starts)), max(high, *(float(T.max()) for T in starts))


def _makes_heat(models: Mapping[str, Mapping[str, Any]]) -> bool:
    """Whether temperatures may leave what is stated of them: heat comes in by a flux, a source or from mechanics."""
    thermal, mechanical = models["thermal"], models["mechanical"]
    return (any("flux" in b for b in thermal.get("boundary", ())) or any(part.get("Q_T") for _, part in _parts(thermal))
            or any(pair.get("friction") for pair in thermal.get("pairs", {}).values())
            or bool(mechanical.get("thermoelastic_heat") or mechanical.get("adiabatic"))
            or any("plastic" in m or "creep" in m for m in mechanical.get("materials", {}).values()))


def _layer(thermal: Mapping[str, Any], length: float) -> float:
    """The shortest gap [m] over which an open law changes by as much as it is at most; inf where none changes."""
    shortest = np.inf
    g = GAPS * length
    for pair in thermal.get("pairs", {}).values():
        law = (pair.get("conduction") or {}).get("open")
        if law is None:
            continue
        h, _ = open_conductance(parse_law(law), g, np.full(g.shape, NO_T))
        steepest = float(np.abs(np.diff(h) / np.diff(g)).max())
        if steepest > 0.0:
            shortest = min(shortest, float(h.max()) / steepest)
    return float(shortest)


def _heat_capacities(interface: Interface, thermal: Mapping[str, Any]) -> Iterator[float]:
    """Of each body of which density and heat capacity are known [J/K]."""
    volumes = cell_volumes(interface)
    of = np.concatenate([interface.quad_body, interface.triangle_body])
    for name, body in thermal.get("bodies", {}).items():
        material = thermal.get("materials", {}).get(body.get("material"), {})
        volume = float(volumes[of == interface.bodies.index(name)].sum())
        if volume > 0.0 and material.get("rho") and material.get("c") is not None:
            yield volume * material["rho"] * _largest(material["c"])


def latent_span(thermal: Mapping[str, Any]) -> float:
    """By how much the latent heat of a body would warm it [K], the largest of all; 0: nothing melts."""
    materials = thermal.get("materials", {})
    used = [materials.get(part.get("material"), {}) for _, part in _parts(thermal)]
    return max((m["latent"]["L"] / _at_solidus(m["c"], m["latent"]) for m in used if m.get("latent")), default=0.0)


def _at_solidus(c: Any, latent: Mapping[str, Any]) -> float:
    """The heat capacity of the solid where it begins to melt [J/kgK]."""
    solid = property_from(c["solid"] if isinstance(c, Mapping) and "solid" in c else c)
    return float(solid(np.array([latent["T_m"] if latent.get("T_m") is not None else latent["T_s"]]))[0])


def _moduli(mechanical: Mapping[str, Any]) -> Iterator[float]:
    """Young's modulus of each material of a body [Pa], where it has one."""
    materials = mechanical.get("materials", {})
    for _, part in _parts(mechanical):
        E = materials.get(part.get("material"), {}).get("E")
        if E is not None:
            yield _largest(E)


def _largest(spec: Any) -> float:
    """The largest value of a property [its unit], of both axes; of a polynomial that at its T_ref."""
    if isinstance(spec, Mapping) and "k_1" in spec:
        return max(_largest(spec["k_1"]), _largest(spec["k_2"]))
    if isinstance(spec, Mapping) and "solid" in spec:
        return max(_largest(spec["solid"]), _largest(spec["liquid"]))
    if isinstance(spec, Mapping) and "value" in spec:
        return float(np.max(spec["value"]))
    if isinstance(spec, Mapping):
        return float(property_from(spec)(np.array([spec.get("T_ref", 0.0)]))[0])
    return float(spec)
