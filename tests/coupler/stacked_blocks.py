"""A block of steel on another one, pressed and with friction: the scene of several tests, each with its own numbers."""

from __future__ import annotations


def rectangle(origin: str, size: str, cells: str, T0: float) -> str:
    """A body of steel; T0 [K]."""
    return (f"{{mesh: {{rectangle: {{origin: [{origin}], size: [{size}], cells: [{cells}]}}}}, material: steel, "
            f"T0: {T0}}}")


def stacked(lower: str, upper: str, *, T_ref: float, mu: float, h: float, end: int, elastic: str,
            more_bodies: str = "") -> str:
    """The scene.  lower, upper, more_bodies : bodies (rectangle).  elastic : lines below `mechanical.elastic`.

    T_ref [K].  h : of contact [W/m2K].  end [s] : of windows of 1 s.
    """
    return f"""
slideline: 2
title: Blocks on each other
units: {{temperature: K}}
geometry: plane
materials:
  steel: {{rho: 8000, c: 500, k: 30, E: 2.0e9, nu: 0.3, alpha: 1.2e-5, T_ref: {T_ref}}}
bodies:
  lower: {lower}
  upper: {upper}
{more_bodies}contact:
  joint:
    slave: upper.bottom
    master: lower.top
    gap_max: 0.002
    penalty: 1.0e13
    friction: {{mu: {mu}}}
    conduction: {{closed: {{law: constant, h: {h}}}, open: null}}
thermal: {{}}
mechanical:
  half: elastic
  elastic:
{elastic}coupling: {{scheme: staggered, end: {end}, windows: [{{until: {end}, size: 1}}]}}
"""
