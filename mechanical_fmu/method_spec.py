"""How the mechanical half solves, as model.json says it, checked: methods, inertia, skipping."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from contact.half.checks import keys, known, number

# control.method n > 0 is METHODS[n - 1]; 0 is that of model.json.
METHODS = ("newton", "modified_newton", "bfgs", "explicit")
MASSES = ("consistent", "lumped")
# A step that fails is halved inside the half this often before it is discarded.
DEFAULT_CUTS = 4


@dataclass(frozen=True)
class Dynamics:
    """Inertia by the generalised-alpha method (Chung & Hulbert 1993); alpha_m = alpha_f = 0 is Newmark's.

    M ((1 - alpha_m) a_{n+1} + alpha_m a_n) + (1 - alpha_f) f_{n+1} + alpha_f f_n = 0, f internal less external,
    u_{n+1} = u_n + dt v_n + dt2 ((1/2 - beta) a_n + beta a_{n+1}),
    v_{n+1} = v_n + dt ((1 - gamma) a_n + gamma a_{n+1}).
    lumped : whether the mass matrix is diagonal.
    """

    beta: float = 0.25
    gamma: float = 0.5
    alpha_m: float = 0.0
    alpha_f: float = 0.0
    lumped: bool = False


@dataclass(frozen=True)
class Skip:
    """A step is skipped while what it would change is estimated below u [m], at most `most` times in a row."""

    u: float
    most: int


def parse_dynamics(spec: Any, where: str) -> Dynamics:
    """Raises ValueError naming the key, the value and what would do."""
    keys(spec, where, set(), {"beta", "gamma", "rho_inf", "alpha", "mass"})
    lumped = known(spec.get("mass", MASSES[0]), f"{where}.mass", MASSES) == "lumped"
    given = [k for k in ("beta", "rho_inf", "alpha") if k in spec or (k == "beta" and "gamma" in spec)]
    if len(given) > 1:
        raise ValueError(f"model.json: {where}: one of beta and gamma, rho_inf, alpha, not several")
    if "rho_inf" in spec:
        return damped_by_radius(_closed(spec["rho_inf"], f"{where}.rho_inf", 0.0, 1.0), lumped)
    if "alpha" in spec:
        # Hilber, Hughes & Taylor 1977.
        alpha = _closed(spec["alpha"], f"{where}.alpha", -1.0 / 3.0, 0.0)
        return Dynamics(0.25 * (1.0 - alpha) ** 2, 0.5 - alpha, 0.0, -alpha, lumped)
    beta, gamma = (number(spec.get(k, d), f"{where}.{k}", 0.0) for k, d in (("beta", 0.25), ("gamma", 0.5)))
    if gamma < 0.5 or beta < 0.5 * gamma:
        raise ValueError(f"model.json: {where}: beta {beta:g}, gamma {gamma:g} is stable for small steps only; "
                         "take gamma >= 1/2 and beta >= gamma/2, or method explicit")
    return Dynamics(beta, gamma, 0.0, 0.0, lumped)


def damped_by_radius(rho_inf: float, lumped: bool) -> Dynamics:
    """The method whose spectral radius at infinite frequency is rho_inf; order 2 whatever it is."""
    alpha_m, alpha_f = (2.0 * rho_inf - 1.0) / (rho_inf + 1.0), rho_inf / (rho_inf + 1.0)
    return Dynamics(0.25 * (1.0 - alpha_m + alpha_f) ** 2, 0.5 - alpha_m + alpha_f, alpha_m, alpha_f, lumped)


def parse_skip(spec: Any, where: str) -> Skip:
    """Raises ValueError naming the key, the value and what would do."""
    keys(spec, where, {"u", "most"})
    most = spec["most"]
    if isinstance(most, bool) or not isinstance(most, int) or most < 1:
        raise ValueError(f"model.json: {where}.most must be a whole number, 1 or more, not {most!r}")
    return Skip(number(spec["u"], f"{where}.u", 0.0), most)


def _closed(value: Any, where: str, low: float, high: float) -> float:
    found = number(value, where)
    if not low <= found <= high:
        raise ValueError(f"model.json: {where} must lie between {low:g} and {high:g}, not {value!r}")
    return found
