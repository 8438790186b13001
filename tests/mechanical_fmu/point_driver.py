"""One material point driven through strains, stretches or a uniaxial test."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mechanical_fmu.laws.catalogue import POINT
from mechanical_fmu.laws.law import history_size
from mechanical_fmu.material import moduli
from mechanical_fmu.point import update
from mechanical_fmu.problem import parse_material

ONE_CELL = np.zeros(1, dtype=np.intp)


@dataclass(frozen=True)
class Point:
    """A point at its last accepted step.  h : history; E : (4,) strain; S : (4,) stress with its pressure [Pa].

    heat : [J/m3] of the last step; errors : of the search for the free strains.
    """

    material: object
    h: np.ndarray
    E: np.ndarray
    S: np.ndarray
    heat: float = 0.0
    errors: tuple[float, ...] = ()


def material(**spec):
    """A material of model.json, elastic constants of steel unless said."""
    return parse_material("m", {"E": 2e11, "nu": 0.3, **spec})


def virgin(m):
    return Point(m, np.zeros(history_size(m.kind)), np.zeros(4), np.zeros(4))


def parameters(m, T=300.0, f_s=None):
    """(p, tables, kappa, e_th) of the material at T."""
    found = moduli((m,), ONE_CELL, np.array([float(T)]), None if f_s is None else np.array([float(f_s)]))
    points = found.p if len(found.p) else np.zeros(1, POINT)
    if not m.kind:
        points["shear_modulus"] = found.mu
    return points[0], found.tables, float(found.kappa[0]), float(found.e_th[0, 0])


def strained(point, E, dt=1.0, T=300.0, f_s=None, p=None):
    """The point at total strain E after dt; p : parameters instead of the material's own."""
    return _answer(point, np.asarray(E, float), dt, p or parameters(point.material, T, f_s))[0]


def uniaxial(point, axial, dt=1.0, T=300.0, p=None, e_th=None):
    """The point at axial strain E11 = axial with nothing on its sides, found by Newton's method."""
    p = p or parameters(point.material, T)
    if e_th is not None:
        p = (*p[:3], e_th)
    E, errors = point.E.copy(), []
    E[0] = axial
    for _ in range(60):
        new, D = _answer(point, E, dt, p)
        r = new.S[1:]
        errors.append(float(np.abs(r).max()))
        if errors[-1] <= 1e-9 * max(np.abs(new.S).max(), 1e3):
            return replace(new, errors=tuple(errors))
        E = E.copy()
        E[1:] -= np.linalg.solve(D[1:, 1:], r)
    raise AssertionError(f"no uniaxial state: {errors}")


def _answer(point, E, dt, p):
    values, tables, kappa, e_th = p
    h, S, D = np.zeros_like(point.h), np.empty(4), np.empty((4, 4))
    code, heat = update(point.material.kind, values, tables, E, dt, point.h, h, S, D)
    assert code == 0
    normal = np.array([1.0, 1.0, 0.0, 1.0])
    S += kappa * (E @ normal - e_th) * normal
    D += kappa * np.outer(normal, normal)
    return Point(point.material, h, E.copy(), S, heat), D
