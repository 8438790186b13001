"""What error a window may make: one tolerance a quantity, for windows that find their own size."""

from __future__ import annotations

from dataclasses import dataclass

from coupler.iteration import Tolerance


@dataclass(frozen=True)
class ErrorTolerances:
    """Of the error of one window.  temperature [K], gap [m], heat through contact [J], displacement [m]."""

    temperature: Tolerance = Tolerance(0.1, 1e-3)
    gap: Tolerance = Tolerance(1e-8, 1e-3)
    heat: Tolerance = Tolerance(1.0, 1e-3)
    displacement: Tolerance = Tolerance(1e-8, 1e-3)
