"""Tables of a results file: their names, columns and types."""

from __future__ import annotations

FORMAT, FORMAT_VERSION = "slideline.run", 3

WINDOW_FIELDS: tuple[tuple[str, str], ...] = (
    ("t", "f8"), ("H", "f8"), ("verdict", "S24"), ("scheme", "S16"), ("solves", "i4"),
    ("thermal_solves", "i4"), ("mechanical_solves", "i4"), ("thermal_iterations", "i4"),
    ("mechanical_iterations", "i4"), ("thermal_seconds", "f8"), ("mechanical_seconds", "f8"),
    ("fmi_seconds", "f8"), ("seconds", "f8"), ("recording_seconds", "f8"), ("values", "i8"),
    ("touching", "i4"), ("max_T", "f8"), ("max_p", "f8"), ("imbalance", "f8"), ("taken", "?"),
    ("iterations", "i4"), ("misfit", "f8"), ("contraction", "f8"), ("error", "f8"),
)
"""Columns of the windows table, one row a window tried, rejected too; times [s], max_T [K], max_p [Pa].

taken : the run went on from its end.  iterations : of the window, 0 where the scheme does not iterate; misfit : the
largest difference left, in tolerances; contraction : measured ratio of successive residuals of plain iteration;
error : the largest estimated error, in tolerances, nan where none is known.
"""

ITERATE_FIELDS: tuple[tuple[str, str], ...] = (
    ("window", "i4"), ("iterate", "i4"), ("temperature", "f8"), ("gap", "f8"), ("pressure", "f8"),
    ("solid_fraction", "f8"), ("factor", "f8"),
)
"""Columns of the iterates table, one row an iterate: row of the windows table (from 0), number in the window (from
1), differences in units of their tolerances, factor of the step that led to it."""

ERROR_FIELDS: tuple[tuple[str, str], ...] = (
    ("window", "i4"), ("temperature", "f8"), ("gap", "f8"), ("heat", "f8"), ("displacement", "f8"))
"""Columns of the errors table, one row a window whose error is known: row of the windows table (from 0), then the
largest error that the window made [K, m, J, m], at any node; nan where unknown."""

ESTIMATE_FIELDS: tuple[tuple[str, str], ...] = (("window", "i4"), *(
    (f"{quantity}{part}", "f8") for quantity in ("temperature", "gap", "heat", "displacement")
    for part in ("", "_splitting", "_own")))
"""Columns of the estimates table, one row a window tried whose error is known: row of the windows table (from
0), then of each quantity the error, its part from the exchange and that from the halves' own steps, all in tolerances;
nan where unknown."""
