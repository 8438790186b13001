"""Laws of the frame: green on right scenes, red under a fault planted for each."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import contact.half.functions
import coupler.scenario.problems
import coupler.scenario.scene
import mechanical_fmu.masses
import thermal_fmu.potentials
from contact.problem import laws
from contact.problem.mechanical import ElasticBoundary, Motion
from contact.problem.part import Part
from coupler.scenario.si import ToSI
from random_scenes.by_hand_frame import disc, heat, pressed, stack
from random_scenes.change import (
    PSEUDOSCALARS,
    VECTORS,
    NotApplicable,
    combined,
    in_other_units,
    moved_profile,
    shifted,
    turned,
)
from random_scenes.declared import Units, powers_of, restated, value_at
from random_scenes.invariant import Invariant
from random_scenes.invariants_frame import (
    BODIES,
    FRAME,
    KELVIN,
    LATER,
    LENGTH,
    MIRROR,
    PAIRS,
    RENUMBER,
    SHIFT,
    SIMILAR,
    TURN,
)
from random_scenes.scene import Scene
from random_scenes.story import COMPLETED, Story, told

SCENES: Mapping[str, Callable[[], Scene]] = {
    "heat": heat, "pressed": lambda: pressed(0.3), "stack": stack, "disc": disc}
LAWS = {law.name: law for law in FRAME}


@cache
def scene_and_story(name: str) -> tuple[Scene, Story]:
    scene = SCENES[name]()
    return scene, told(scene)


def violations(law: Invariant, scene: Scene, story: Story, seed: int = 1) -> list[str]:
    return [f.what for f in law.check(scene, story, np.random.default_rng(seed))]


@pytest.mark.few("stack", "heat")
@pytest.mark.parametrize("name", SCENES)
def test_a_scene_by_hand_says_something(name: str) -> None:
    _, story = scene_and_story(name)
    assert story.outcome == COMPLETED, story.message
    assert np.ptp(story.T) > 1.0


@pytest.mark.few(
    "stack-frame: mirror", "stack-frame: renumber", "stack-frame: order of bodies", "stack-frame: unit of length",
    "stack-frame: physically similar")
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", [pytest.param(n, marks=() if n == "stack" else pytest.mark.slow) for n in SCENES])
def test_right_scenes_keep_the_laws(name: str, law: str) -> None:
    scene, story = scene_and_story(name)
    if LAWS[law].applies(scene):
        assert not violations(LAWS[law], scene, story)
    else:
        assert (name, law) in {("disc", TURN.name), *((n, PAIRS.name) for n in SCENES if n != "stack")}


# Faults, each where such a fault may stand

Patch = pytest.MonkeyPatch


def _profiles_right_of_the_origin_only(patch: Patch) -> None:
    right = contact.half.functions.Profile.__call__
    patch.setattr(contact.half.functions.Profile, "__call__", lambda self, s: right(self, np.maximum(s, 0.0)))


def _weight_along_y_only(patch: Patch) -> None:
    right = mechanical_fmu.masses.dead_forces

    def wrong(interface: Any, loads: Any, *more: Any) -> Any:
        return right(interface, [replace(d, component=1) if d.kind == "gravity" else d for d in loads], *more)

    patch.setattr(mechanical_fmu.masses, "dead_forces", wrong)


def _axes_always_anticlockwise(patch: Patch) -> None:
    right = thermal_fmu.potentials.directions
    patch.setattr(thermal_fmu.potentials, "directions",
                  lambda k, *more: right(replace(k, angle=k.angle % (0.5 * np.pi)), *more))


def _penalty(patch: Patch, factor: Callable[[Any, str, Any, Any], float]) -> None:
    right = coupler.scenario.scene._pair

    def wrong(document: Any, file: Any, name: str, interface: Any, pairs: Any) -> Any:
        pair = right(document, file, name, interface, pairs)
        return replace(pair, eps_N=pair.eps_N * factor(file, name, interface.nodes, interface.surfaces), local=False)

    patch.setattr(coupler.scenario.scene, "_pair", wrong)
    # Multipliers would hide what a penalty is.
    patch.setattr(coupler.scenario.problems, "_augmented", lambda _, pair, __: pair.augmented)


def _edge_of_the_first_line(patch: Patch) -> None:
    def factor(file: Any, name: str, nodes: Any, surfaces: Any) -> float:
        lengths = np.linalg.norm(np.diff(nodes[surfaces[file.contact[name].slave]], axis=1)[:, 0], axis=1)
        return float(lengths.mean() / lengths[0])

    _penalty(patch, factor)


def _stiffness_of_the_first_body(patch: Patch) -> None:
    def factor(file: Any, *_: Any) -> float:
        E = [file.materials[body.material].E for body in file.bodies.values()]
        return float(E[0] / min(E))

    _penalty(patch, factor)


def _penalty_of_the_first_pair(patch: Patch) -> None:
    _penalty(patch, lambda file, name, *_: 1.0 if name == next(iter(file.contact)) else 0.9)


def _temperatures_as_they_are(patch: Patch) -> None:
    patch.setattr(ToSI, "kelvin", lambda self, T, at: T)


def _a_gap_of_ten_microns_more(patch: Patch) -> None:
    right = laws.Gas.conductance
    patch.setattr(laws.Gas, "conductance", lambda self, p, g, T: right(self, p, g + 1.0e-5, T))


def _signals_late_by_a_tenth_of_a_second(patch: Patch) -> None:
    right = contact.half.functions.Signal.at
    patch.setattr(contact.half.functions.Signal, "at", lambda self, t, side=1: right(self, t - 0.1, side))


def _clock_that_goes_fast(patch: Patch) -> None:
    right = contact.half.functions.Signal.at
    patch.setattr(contact.half.functions.Signal, "at", lambda self, t, side=1: right(self, 1.001 * t, side))


FAULTS = [
    (SHIFT, "heat", _profiles_right_of_the_origin_only),
    (TURN, "pressed", _weight_along_y_only),
    (MIRROR, "heat", _axes_always_anticlockwise),
    (RENUMBER, "pressed", _edge_of_the_first_line),
    (BODIES, "pressed", _stiffness_of_the_first_body),
    (PAIRS, "stack", _penalty_of_the_first_pair),
    (KELVIN, "heat", _temperatures_as_they_are),
    (LENGTH, "heat", _a_gap_of_ten_microns_more),
    (SIMILAR, "stack", _signals_late_by_a_tenth_of_a_second),
    (LATER, "stack", _clock_that_goes_fast),
]


@pytest.mark.few(
    "frame: shift", "frame: turn", "frame: unit of temperature")
@pytest.mark.parametrize(("law", "name", "plant"), FAULTS, ids=[law.name for law, _, _ in FAULTS])
def test_a_fault_breaks_its_law(law: Invariant, name: str, plant: Callable[[Patch], None], monkeypatch: Patch) -> None:
    scene = SCENES[name]()
    plant(monkeypatch)
    story = told(scene)
    assert story.outcome == COMPLETED, story.message
    # The first of these goes to the right and up.
    assert any(violations(law, scene, story, seed) for seed in (1, 2))


def test_every_law_has_its_fault() -> None:
    assert {law.name for law, _, _ in FAULTS} == set(LAWS)


# What the changes are made of


def test_a_signal_is_read_as_it_is_meant() -> None:
    table = {"t": [0.0, 1.0, 1.0, 3.0], "value": [0.0, 2.0, 5.0, 1.0]}
    assert [value_at(table, t) for t in (-1.0, 0.5, 1.0, 2.0, 9.0)] == [0.0, 1.0, 5.0, 3.0, 1.0]
    assert value_at(table, 1.0, -1) == 2.0
    both = combined([(2.0, table), (-1.0, {"t": [0.5, 2.0], "value": [0.0, 3.0]})])
    for t in (0.0, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0):
        for side in (-1, 1):
            other = float(np.interp(t, [0.5, 2.0], [0.0, 3.0]))
            assert value_at(both, t, side) == pytest.approx(2.0 * value_at(table, t, side) - other, abs=1e-14)


@pytest.mark.parametrize("profile", [{"at": [0.0, 1.0, 3.0], "value": [1.0, 2.0, -4.0]},
                                     {"polynomial": [1.0, -2.0, 3.0]}])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_profile_moves(profile: dict[str, Any], sign: float) -> None:
    s = np.linspace(-1.0, 4.0, 11)
    old, new = (contact.half.functions.profile_from(p) for p in (profile, moved_profile(profile, sign, 0.7)))
    np.testing.assert_allclose(new(sign * s + 0.7), old(s), rtol=1e-12, atol=1e-12)


def test_units_are_understood() -> None:
    film = next(part for part in _parts(Part) if "exponent" in part.model_fields and "h_factor" in part.model_fields)
    seventh = film.model_validate({"h": 5.0, "T": 300.0, "exponent": 0.25})
    assert [powers_of(unit, seventh) for unit in ("W/mK", "J/kgK", "Pa/m", "N m", "W/m2K^(1 + exponent)", "J/mol")] == [
        (1, 1, -3, -1), (2, 0, -2, -1), (-2, 1, -2, 0), (2, 1, -2, 0), (0, 1, -3, -1.25), (0, 0, 0, 1)]
    assert Units(m=1e3, K=2.0).of("W/m2K") == 0.5
    entries = [part.entry(name) for part in _parts(Part) for name in part.model_fields]
    units = {entry.unit for entry in entries if entry is not None and entry.unit}
    for unit in units - {"1/(Pa^n s)", "Pa s^m", "W/m2K^(1 + exponent)"}:
        powers_of(unit)
    with pytest.raises(NotApplicable):
        powers_of("furlong")


def test_a_layer_of_gas_thinner_than_its_least_has_no_similar_scene() -> None:
    gas = {"law": "sum", "of": [{"law": "gas", "k_g": 0.05, "g_m": 1e-5}]}
    pair = next(iter(heat().pairs))
    scene = heat().edited(**{f"contact__{pair}__conduction__open": gas})
    assert in_other_units(scene, Units(m=0.5)).units.m == 0.5
    with pytest.raises(NotApplicable, match="thinner"):
        in_other_units(scene, Units(m=1e-5))


def _parts(part: type[Part]) -> set[type[Part]]:
    return {part}.union(*(_parts(p) for p in part.__subclasses__()))


def test_every_key_with_a_place_is_moved() -> None:
    """Keys of a component end in x or y, places and velocities are pairs of numbers; each is known to the changes."""
    components = {n for part in (ElasticBoundary, Motion) for n in part.model_fields if n.endswith(("_x", "_y"))}
    assert components == {n for names in VECTORS for n in names}
    assert {n for n in ElasticBoundary.model_fields if n not in components} == {
        "on", "at", "body", "name", "pressure", "rotation", "until", *PSEUDOSCALARS}
    pairs = set()
    for part in _parts(Part):
        if part.__module__.startswith("contact.problem"):
            for name, hint in get_type_hints(part).items():
                for one in (hint, *get_args(hint)):
                    if get_origin(one) is tuple and len(get_args(one)) == 2 and get_args(one)[1] is not Ellipsis:
                        pairs.add(name)
    assert pairs == {"reference", "v0", "about"}


def test_a_roller_turns_by_right_angles_only() -> None:
    scene = stack().edited(mechanical__elastic__boundary__0__u_y=None)
    with pytest.raises(NotApplicable, match="right angles"):
        turned(scene, 30.0)
    quarter = turned(scene, 90.0).scene.doc["mechanical"]["elastic"]["boundary"][0]
    assert {k for k in quarter if k.startswith("u_")} == {"u_y"}


def test_an_axis_stays_where_it_is() -> None:
    with pytest.raises(NotApplicable, match="axis"):
        shifted(disc(), 1.0, 0.0)


@pytest.mark.few("heat")
@pytest.mark.parametrize("name", ["heat", "pressed", "disc"])
def test_writing_defaults_out_changes_nothing(name: str) -> None:
    scene, story = scene_and_story(name)
    again = told(replace(scene, doc=restated(scene)))
    np.testing.assert_array_equal(again.T, story.T)
    np.testing.assert_array_equal(again.x, story.x)
