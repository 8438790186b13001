"""Conductivity tensors at quadrature points, with their derivatives by temperature and by solid fraction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermal_fmu.material import Conductivity

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Tensors:
    """K, dK, dK_f : (ne, nq, 3), components xx, xy, yy of k [W/mK], dk/dT, dk/df_s.  principal : values of k_1, k_2."""

    K: Floats
    dK: Floats
    dK_f: Floats
    principal: tuple[Floats, ...]


def tensors(k: Conductivity, T: Floats, f_s: Floats | None, turn: Floats | None) -> Tensors:
    """At T, f_s and the turn of the material : (ne, nq) [K, 1, rad]; None: solid, and not turned.

    K = k_1 a a' + k_2 b b' with a at angle + turn to x and b across it.
    """
    first = k.k_1(T, f_s)
    by_T, by_f = k.k_1.slope(T, f_s), k.k_1.phase_slope(T)
    if k.k_2 is None:
        K, dK, dK_f = (np.stack([v, np.zeros(v.shape), v], axis=-1) for v in (first, by_T, by_f))
        return Tensors(K, dK, dK_f, (first,))
    second = k.k_2(T, f_s)
    # fault: axes turn the other way -> angle = k.angle if turn is None else k.angle - turn |
    #   thermal_fmu/test_thermal_anisotropy::test_axes_turn_with_the_material
    angle = k.angle if turn is None else k.angle + turn
    c, s = np.cos(angle), np.sin(angle)
    pairs = ((first, second), (by_T, k.k_2.slope(T, f_s)), (by_f, k.k_2.phase_slope(T)))
    # fault: skewed axes without their skew -> K, dK, dK_f = (np.stack([v * c * c + w * s * s, -(v - w) * c * s, v * s *
    #   s + w * c * c], axis=-1) | thermal_fmu/test_thermal_anisotropy::test_a13_patch_with_skewed_axes
    K, dK, dK_f = (np.stack([v * c * c + w * s * s, (v - w) * c * s, v * s * s + w * c * c], axis=-1)
                   for v, w in pairs)
    return Tensors(K, dK, dK_f, (first, second))
