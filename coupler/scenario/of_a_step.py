"""Outputs of halves that tell what one step moved or took."""

from __future__ import annotations

# They hang on how long it is (docs/design.md).  Of some the sum since the start is told, too.
OF_A_STEP = ("heat", "surface.E", "E_M", "E_S", "contact.E_friction", "contact.slip", "max_dT", "max_strain_increment",
             "heat_moved", "heat_rounding", "iterations", "residual", "substeps", "rejected", "cuts", "program.runs",
             "program.tolerance", "across.iterations", "across.off")
_BY_CONDITION = "`heat.NAME` of a named condition, `heat.source.BODY` and `heat.pair.NAME[1]` are"
SINCE_START = {"heat": _BY_CONDITION, "surface.E": _BY_CONDITION, "contact.E_friction": _BY_CONDITION,
               "contact.slip": "`mechanical.contact.slip_path` is", "E_M": "`mechanical.flow.BODY` is"}


def step_output(quantity: str) -> str:
    """Return the one of OF_A_STEP that HALF.OUTPUT is, or is a part of; empty of any other quantity."""
    half, _, output = quantity.partition(".")
    bare = output.partition("[")[0]
    return next((name for name in OF_A_STEP if bare == name or (name == "heat" and bare.startswith("heat."))), "") \
        if half in ("thermal", "mechanical") else ""
