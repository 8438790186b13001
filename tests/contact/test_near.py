"""A mistyped word is answered with the word that was meant, or with none."""

from __future__ import annotations

import pytest

from contact.problem.near import nearest
from contact.problem.values import did_you_mean

MATERIAL = ("E", "T_ref", "alpha", "c", "creep", "k", "latent", "liquid", "nu", "plastic", "rho")
MONITORS = ("max_p", "max_T", "max_dT", "window", "contraction", "t")


@pytest.mark.parametrize(("word", "known", "meant"), [
    ("max_temp", MONITORS, "max_T"),
    ("max_temperature", ("max_p", "max_dT", "least"), "max_dT"),
    ("max_pressure", MONITORS, "max_p"),
    ("density", MATERIAL, "rho"),
    ("conductivity", MATERIAL, "k"),
    ("cp", MATERIAL, "c"),
    ("youngs_modulus", MATERIAL, "E"),
    ("poisson", MATERIAL, "nu"),
    ("roh", MATERIAL, "rho"),
    ("Tref", MATERIAL, "T_ref"),
    ("max_temp", MATERIAL, ""),  # none: the keys are listed
    ("max_iter", ("max_iterations", "max_p"), "max_iterations"),
    ("iterations", ("max_iterations", "acceleration"), "max_iterations"),
    ("sheme", ("scheme", "end", "windows"), "scheme"),
    ("end_time", ("scheme", "end", "windows"), "end"),
    ("dt", ("scheme", "end", "windows"), "windows"),
    ("xyz", MATERIAL, ""),
    ("x", (), ""),
])
def test_the_nearest_word_is_that_which_was_meant(word, known, meant):
    assert nearest(word, known) == meant


def test_where_nothing_is_near_all_words_are_listed():
    assert did_you_mean("max_temp", MATERIAL) == f"Known here: {', '.join(sorted(MATERIAL))}."
