"""Finds the known word that a mistyped one was meant to be: by its letters, its beginning, or its meaning."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

# What engineers write for a key, in full words; a symbol stands for its first meaning inside of a longer key (max_T).
MEANINGS = {
    "rho": ("density", "mass_density"),
    "k": ("conductivity", "thermal_conductivity", "lambda"),
    "c": ("heat_capacity", "specific_heat", "specific_heat_capacity", "cp", "c_p"),
    "E": ("young", "youngs_modulus", "young_modulus", "modulus", "elastic_modulus"),
    "nu": ("poisson", "poissons_ratio", "poisson_ratio"),
    "alpha": ("expansion", "thermal_expansion", "cte"),
    "mu": ("friction_coefficient", "coefficient", "coulomb"),
    "L": ("latent_heat",),
    "H": ("hardening_modulus", "hardness"),
    "s_y": ("yield", "yield_stress", "yield_strength"),
    "h": ("film_coefficient", "htc", "heat_transfer_coefficient"),
    "T": ("temperature",),
    "dT": ("temperature",),
    "T0": ("temperature", "initial_temperature", "start_temperature"),
    "T_ref": ("reference_temperature",),
    "T_m": ("melting_temperature", "melting_point"),
    "T_s": ("solidus",),
    "T_l": ("liquidus",),
    "p": ("pressure",),
    "t": ("time",),
    "u_x": ("displacement_x", "ux"),
    "u_y": ("displacement_y", "uy"),
    "Q_T": ("heat_source", "source", "power"),
    "emissivity": ("epsilon",),
    "temperature": ("T",),
    "flux": ("heat_flux", "q"),
    "friction": ("mu",),
    "conduction": ("conductance",),
    "end": ("end_time", "t_end", "duration"),
    "windows": ("dt", "time_step", "timestep", "step"),
    "size": ("step", "dt", "time_step", "length"),
}
BEGINNING = 3  # letters of a word that say which one is meant
NEAR = 0.6  # of the ratio of difflib: two letters of five may be wrong
BEGUN = 0.9  # how near a word is that was cut short


def nearest(word: str, known: Iterable[str]) -> str:
    """Return the known word that is nearest to another, "" if none is near."""
    # fault: max_temp is taken for max_p -> found = [(_ratio(word, name), name) for name in known] |
    #   contact/test_near
    found = [(_nearness(word, name), name) for name in known]
    score, name = max(found, key=lambda one: (one[0], -len(one[1])), default=(0.0, ""))
    return name if score >= NEAR else ""


def _nearness(word: str, name: str) -> float:
    """How near a word is to a known one, 0 to 1: to its letters or to one of its meanings."""
    return max(_likeness(word, name), *(0.99 * _likeness(word, said) for said in MEANINGS.get(name, ())), 0.0)


def _likeness(word: str, name: str) -> float:
    """How alike two words are; of compound words as alike as their parts that differ most."""
    parts, named = word.split("_"), name.split("_")
    if len(parts) == len(named) > 1:
        return min(max(_ratio(a, b), *(_ratio(a, said) for said in MEANINGS.get(b, ("",))))
                   for a, b in zip(parts, named, strict=True))
    return _ratio(word.replace("_", ""), name.replace("_", ""))


def _ratio(a: str, b: str) -> float:
    if a == b:
        return 1.0
    low, other = a.lower(), b.lower()
    begun = BEGUN if min(len(a), len(b)) >= BEGINNING and (low.startswith(other) or other.startswith(low)) else 0.0
    # Letters of one case are alike, but a little less so than the same ones: T is not t.
    return max(begun, difflib.SequenceMatcher(None, a, b).ratio(),
               0.98 * difflib.SequenceMatcher(None, low, other).ratio())
