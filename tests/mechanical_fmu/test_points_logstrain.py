"""Logarithmic strain and its derivatives against an eigenvalue solver and differences."""

from __future__ import annotations

import numpy as np
import pytest

from mechanical_fmu.strain import log_strain_curvature, log_strain_gradient, piola, piola_tangent, shape

RANDOM = np.random.default_rng(7)
STEP = 1e-5


def rotation(degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s], [s, c]])


def five(plane, F33=1.0):
    return np.array([*np.asarray(plane).ravel(), F33])


def nearly(apart):
    """Principal stretches 1.2 and 1.2 + apart, turned and turned again."""
    return five(rotation(63) @ rotation(20) @ np.diag([1.2, 1.2 + apart]) @ rotation(-20), 0.9)


STATES = {"undeformed": five(np.eye(2)), "sheared": five([[1.3, 0.4], [-0.2, 0.8]], 1.1),
          "drawn to 3": five([[3.0, 1.0], [0.0, 0.4]]), "turned by 170": five(rotation(170) @ np.diag([1.3, 0.7]), 2.0),
          "at the seam of the series": five(np.diag([np.sqrt(1.2236), np.sqrt(0.7764)])),
          **{f"{10.0**-k:g} apart": nearly(10.0**-k) for k in (3, 6, 9, 12)}}


def gradient(F):
    E, L = np.empty(4), np.empty((4, 5))
    log_strain_gradient(F, E, L)
    return E, L


def strain(F):
    return gradient(F)[0]


def differences(f, F):
    return np.stack([(f(F + d) - f(F - d)) / (2 * STEP) for d in STEP * np.eye(5)], axis=-1)


def by_eigenvalues(F):
    full = np.zeros((3, 3))
    full[:2, :2], full[2, 2] = F[:4].reshape(2, 2), F[4]
    w, v = np.linalg.eigh(full.T @ full)
    E = (v * (0.5 * np.log(w))) @ v.T
    return E[[0, 1, 0, 2], [0, 1, 1, 2]]


@pytest.mark.parametrize("name", STATES)
def test_strain_and_its_derivatives(name):
    F = STATES[name]
    E, L = gradient(F)
    assert np.abs(E - by_eigenvalues(F)).max() <= 1e-14 * max(1.0, np.abs(E).max())
    assert np.abs(L - differences(strain, F)).max() <= 1e-8 * np.abs(L).max()
    S, H = RANDOM.standard_normal(4), np.empty((5, 5))
    log_strain_curvature(F, S, H)
    weights = S * [1.0, 1.0, 2.0, 1.0]
    assert np.array_equal(H, H.T)
    assert np.abs(H - differences(lambda F: weights @ gradient(F)[1], F)).max() <= 1e-8 * np.abs(H).max()


@pytest.mark.parametrize("name", ["sheared", "1e-09 apart"])
def test_the_tangent_of_the_nominal_stress(name):
    F, C = STATES[name], RANDOM.standard_normal((4, 4))

    def stress(F):
        E, L = gradient(F)
        P = np.empty(5)
        piola(L, C @ E, P)
        return P

    E, L = gradient(F)
    A = np.empty((5, 5))
    piola_tangent(F, L, C @ E, C, A)
    assert np.abs(A - differences(stress, F)).max() <= 1e-8 * np.abs(A).max()


def test_the_strain_does_not_see_a_rotation_and_the_stress_turns_with_it():
    F, S = STATES["sheared"], np.array([2.0, -1.0, 0.7, 0.3])
    E, L = gradient(F)
    P = np.empty(5)
    piola(L, S, P)
    for degrees in (10.0, 41.0, 116.0, 180.0):
        Q = rotation(degrees)
        turned = five(Q @ F[:4].reshape(2, 2), F[4])
        E_turned, L_turned = gradient(turned)
        P_turned = np.empty(5)
        piola(L_turned, S, P_turned)
        assert np.abs(E_turned - E).max() <= 1e-15
        assert np.abs(P_turned - five(Q @ P[:4].reshape(2, 2), P[4])).max() <= 1e-14


def test_the_trace_is_the_logarithm_of_the_volume():
    for F in STATES.values():
        E = strain(F)
        assert E[0] + E[1] + E[3] == pytest.approx(np.log((F[0] * F[3] - F[1] * F[2]) * F[4]), abs=1e-15)


@pytest.mark.parametrize("y", [1e-3, 0.05])
def test_the_branches_of_the_series_meet(y):
    below, above = np.array(shape(y * (1 - 1e-13))), np.array(shape(y))
    assert np.abs(below / above - 1.0).max() <= 1e-12
