"""The thermal half at stations as a HalfModel, for rods (one temperature a column) and lumped bodies (one a body)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.contact_client import ContactRefusedError
from contact.half.interface import Interface
from contact.half.linalg import SingularMatrixError
from contact.half.model import Discard, Done, Link, Outputs, Value, Values, Variable
from contact.half.start import start_temperatures
from thermal_fmu import phase_change
from thermal_fmu.boundary import Heat, no_heat
from thermal_fmu.cells import BadPropertyError, InvertedMeshError
from thermal_fmu.conditions import HeatSoFar, n_heats, named_heats, no_heat_yet
from thermal_fmu.contact_quadrature import touching
from thermal_fmu.elsewhere import begun_with, course_of, course_outputs, damps_of
from thermal_fmu.half import contact_at, face_variables, whole
from thermal_fmu.methods import DAMPED_SUBSTEPS, METHOD_NUMBERS, TimeMethod
from thermal_fmu.newton import NotConvergedError
from thermal_fmu.problem import parse_model
from thermal_fmu.sources import calendar_of, factors_of
from thermal_fmu.stations.across import T_OFF, SurfaceState, outlines_of, temperature_off
from thermal_fmu.stations.balance import StationSubstep
from thermal_fmu.stations.scene import StationScene, freeze_stations, stations_with_friction
from thermal_fmu.stations.stations import StationGeometry, Stations, lumped_stations, rod_stations
from thermal_fmu.stations.step import StationContext, StationStep, advance_stations, entropy_stations

Floats = NDArray[np.float64]

RETRY_SHARE = 0.5  # of a step that did not converge


@dataclass(frozen=True)
class StationState:
    """All that evolves.

    s : (n,) [K] of the stations, T itself in bodies that do not melt.  X : (n_nodes, 2) reference coordinates [m], the
    first x: they set the mass.  event : the last count of control.event.  damped : how many substeps are still to be
    damped.  stored : enthalpy gained since the start [J].  given : heat since the start by condition.  rate : (n,) at
    which s moved in the last substep [K/s]; None: in none yet.
    """

    s: Floats
    X: Floats
    event: int
    damped: int
    stored: float
    given: HeatSoFar
    rate: Floats | None = None


class StationHalf:
    """Heat in bodies whose nodes share temperatures, station by station.

    The object caches what follows from constants and from the reference coordinates of the state.
    """

    def __init__(self, interface: Interface, spec: Mapping[str, Any], half: str,
                 stations: Callable[[Interface], Stations]) -> None:
        """Raises ValueError for a model.json or a mesh that is not right."""
        self._scene = StationScene(interface, parse_model(interface, spec, half), stations(interface))
        self._calendar = calendar_of(self._scene.model)
        self._first: tuple[Floats, StationGeometry] | None = None
        self.variables = _variables(self._scene)
        self._named = named_heats(interface, self._scene.model)
        self._contact = self._scene.mapped(interface.contact_nodes)
        self._outlines = outlines_of(self._scene)

    def start(self, inputs: Values, t: float, link: Link) -> tuple[StationState, Mapping[str, Value]]:
        """Set T = T0 everywhere; a prescribed temperature acts from the first substep.  The first x is the reference.

        Raises InvertedMeshError, ContactRefusedError.
        """
        scene = self._scene
        X = np.array(inputs["x"], dtype=np.float64)
        self._shape_of(X)
        T = np.empty(scene.stations.n)
        # Those of a station are alike (contact.half.checks): any of its nodes tells.
        T[scene.stations.of_node] = start_temperatures(scene.interface, [body.T0 for body in scene.model.bodies])
        state = StationState(phase_change.unknown(scene.melting, T), X, whole(inputs, "control.event"), DAMPED_SUBSTEPS,
                             0.0, no_heat_yet(n_heats(scene.interface, scene.model)))
        points = contact_at(scene.surfaces, X, inputs, link)
        touched = touching(points, scene.model.solved)
        told = course_outputs(self._contact, scene.melting, state.s, [(t, state.s)], t, 1.0)
        return state, self._outputs(state, no_heat(len(scene.model.bodies)), touched, None, T) | {T_OFF: 0.0} | (
            told if scene.model.elsewhere.size else {})

    def step(self, state: StationState, inputs: Values, t: float, h: float, link: Link) -> Done | Discard:
        """Take a substep from t to t + h [s] on the coordinates x, whose contact is searched once."""
        number = whole(inputs, "control.method")
        model = self._scene.model
        name = METHOD_NUMBERS.get(number, model.stated.method.value if number == 0 else "")
        if name in ("", "steady"):
            return Discard(f"control.method {number} is none of 0, 1, 2, 3, 4")
        try:
            return self._advance(state, inputs, t, h, link, model.method_of(name))
        except (NotConvergedError, BadPropertyError, SingularMatrixError) as exc:
            return Discard(f"thermal step from {t:.9g} s by {h:.6g} s: {exc}", RETRY_SHARE * h)
        except (InvertedMeshError, ContactRefusedError) as exc:
            # A smaller step of this half changes nothing here: the coordinates came from outside.
            return Discard(f"thermal step from {t:.9g} s by {h:.6g} s: {exc}")

    def _advance(self, state: StationState, inputs: Values, t: float, h: float, link: Link,
                 method: TimeMethod) -> Done:
        scene = self._scene
        x, s = np.array(inputs["x"], dtype=np.float64), np.array(state.s)
        E = np.asarray(inputs.get("contact.E_friction", ()), dtype=np.float64)
        points = contact_at(scene.surfaces, x, inputs, link)
        shape = scene.mesh.shape(x)
        data = freeze_stations(scene, shape, x, np.asarray(inputs["E_M"], dtype=np.float64), points)
        if points is not None:
            data = stations_with_friction(data, scene, points, E, phase_change.fields(scene.melting, s), h)
        # fault: mass of a rod from where it is -> substep = StationSubstep(scene, shape, shape, data) |
        #   thermal_fmu/test_thermal_rod
        substep = StationSubstep(scene, shape, self._shape_of(state.X), data)
        rate = None if state.rate is None else np.array(state.rate)
        context = StationContext(substep, factors_of(scene.model, inputs), self._calendar, data.E_M / h, rate)
        event = whole(inputs, "control.event")
        damped = DAMPED_SUBSTEPS if event != state.event else state.damped
        course = course_of(scene.model, inputs, t, h, scene.columns_elsewhere)
        context = replace(context, elsewhere=course)
        s = begun_with(course, scene.melting, s, scene.mapped(scene.model.elsewhere))
        E_S = np.asarray(inputs["E_S"], dtype=np.float64)
        jump = entropy_stations(context, scene.mesh.spread(E_S, shape), s, t) if E_S.any() else None
        begin = s if jump is None else jump.s
        done, damped = advance_stations(context, method, begin, damped, t, h)
        rate = (done.s - begin) / h
        told = {} if course is None else course_outputs(self._contact, scene.melting, begin, done.path, t, h,
                                                        damps_of(done.damped, done.overshoots))
        done = done if jump is None else jump.then(done)
        new = StationState(done.s, state.X, event, damped, state.stored + float(done.heat.stored.sum()),
                           state.given.plus(done.heat.each), rate)
        outputs = self._outputs(new, done.heat, data.touching, done, phase_change.temperature(scene.melting, s)) | told
        at = phase_change.fields(scene.melting, done.s)
        surfaces = SurfaceState(x, points, context.loads_at(t + h, -1), at, E, h)
        return Done(new, Outputs(outputs, (T_OFF,), lambda: {
            T_OFF: temperature_off(scene, self._outlines, surfaces)}))

    def _shape_of(self, X: Floats) -> StationGeometry:
        if self._first is None or not np.array_equal(self._first[0], X):
            self._first = (np.array(X), self._scene.mesh.shape(X))
        return self._first[1]

    def _outputs(self, state: StationState, heat: Heat, touching: int, done: StationStep | None,
                 T_n: Floats) -> dict[str, Value]:
        scene = self._scene
        T, of_node = phase_change.temperature(scene.melting, state.s), scene.stations.of_node
        melts: dict[str, Value] = {}
        if scene.melting:
            melts["f_s"] = phase_change.solid_fraction(scene.melting, state.s)[of_node]
        return {
            "T": T[of_node], **melts, **heat.outputs(scene.model), **state.given.outputs(self._named),
            "iterations": float(done.iterations) if done else 0.0,
            "residual": done.residual if done else 0.0,
            # fault: prescribed temperatures of a rod bound the window -> "max_dT": float(np.abs(T - T_n).max()), |
            #   thermal_fmu/test_thermal_rod::test_a_prescribed_ramp_is_no_change_that_is_watched
            "max_dT": float(np.abs(T - T_n)[~scene.fixed].max(initial=0.0)),
            "heat_stored": state.stored,
            "heat_moved": heat.moved,
            "contact.touching": float(touching),
        }


def _variables(scene: StationScene) -> tuple[Variable, ...]:
    n = len(scene.interface.nodes)
    f_s = Variable("f_s", (n,), description="solid fraction at the end of the substep", on="nodes")
    melts = (f_s,) if scene.melting else ()
    off = Variable(T_OFF, unit="K", description="how far surfaces differ from the one temperature behind them")
    return (*face_variables(scene.interface, scene.model), *melts, off)


def load_rod(interface: Interface, spec: Mapping[str, Any]) -> StationHalf:
    """Make the half `thermal_rod` of an interface file and the content of its model.json.  Raises ValueError."""
    return StationHalf(interface, spec, "thermal_rod", rod_stations)


def load_lumped(interface: Interface, spec: Mapping[str, Any]) -> StationHalf:
    """Make the half `lumped`, C dT/dt = sum of conductances times differences.  Raises ValueError."""
    return StationHalf(interface, spec, "lumped", lumped_stations)
