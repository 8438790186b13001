"""A body that slips on all it rests on at a first guess: its points stick softly first, then as they do.

Between points that all slip nothing says how far a body goes: the tangent is singular, though where some of them come
to stick there is an equilibrium.  A plate on a slope that warms by much in a step is so: at its next length all of it
has slipped but a spot.  With a share s of the penalty eps_T of sticking, and with no shear to begin with,
    tau = -s eps_T slip, bounded by mu p_N,
few points slip where s is small, and the body rests on springs.  s grows to 1 in factors, each from the equilibrium of
the one before: as fewer points stick, those that do are near.  Then the shear of before counts as well, which is the
scene's own law.

Where s grows to s' the same slip makes more shear, and what stuck would slip, too.  So a loose body is moved first, by
q of its rigid motions, until the springs pull on it as they did:
    (s'/s) (f - K q) = f:   q = (1 - s/s') K^-1 f,
f what they pull with along its motions and K their stiffness.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mechanical_fmu.contact import ContactQuery
from mechanical_fmu.enforcement import solve_step, with_found_multipliers
from mechanical_fmu.newton import Equilibrium, NoEquilibriumError, SolverSettings
from mechanical_fmu.stabilisation import stabilised
from mechanical_fmu.system import ForceBalance, Loading, System
from mechanical_fmu.tangent import LooseBodyError

Floats = NDArray[np.float64]

# The first share, and what is tried below it where all slips still.
SOFTEST, SOFTER, LEAST = 1e-6, 1e-2, 1e-12
# s grows by so much; by the root of that where a share was too large, until it is not worth it.
FACTOR, SMALLEST_FACTOR = 10.0, 1.1
MOST_SHARES = 40
# A share that is not done in so few iterations was too large: those that are take one to four.
SOON = 6
# What pulls is seen from a share larger by this: so little that no point comes to slip.
A_LITTLE = 1e-6


def slipped(system: System, loading: Loading, first: ForceBalance, settings: SolverSettings) -> Equilibrium:
    """Find the equilibrium of loading whose bodies slip, or do not touch yet, on all that could hold them at `first`.

    Raises LooseBodyError where no contact comes to hold a body, and what solve_step does.
    """
    rests = rested(system, loading, first, settings)
    # fault: a body that sticks in a spot is damped -> if True: | mechanical_fmu/test_slipping
    if rests is None:
        return stabilised(system, loading, first, settings)
    loading, soft = rests
    query = loading.query
    assert query is not None
    u = _moved(system, soft.balance, query.softened(1.0), query.softened(1.0, A_LITTLE), 1.0)
    there = system.balance(u, loading, True)
    try:
        end = solve_step(system, loading, there, None, settings)
    except (LooseBodyError, NoEquilibriumError):
        # Of the one spot that stuck the shear of before may be just what it could bear: it is near.
        end = stabilised(system, loading, there, settings)
    return replace(end, history=(*soft.history, *end.history[1:]))


def rested(system: System, loading: Loading, first: ForceBalance, settings: SolverSettings
           ) -> tuple[Loading, Equilibrium] | None:
    """Find where the bodies rest whose points stick with all their stiffness, but had no shear to begin with.

    Returns the loading with the multipliers found, too; None where nothing touches with friction, or nothing rests.
    """
    query = loading.query
    if not (query is not None and system.contact.slips and first.tractions is not None
            and first.tractions.n_touching):
        return None
    soon = replace(settings, max_iterations=min(settings.max_iterations, SOON))
    share, done, factor, u, history = SOFTEST, 0.0, FACTOR, first.u, [0.0]
    for _ in range(MOST_SHARES):
        soft = replace(loading, query=query.softened(share))
        try:
            found = solve_step(system, soft, system.balance(u, soft, True), None, soon)
        except (LooseBodyError, NoEquilibriumError) as exc:
            # A body that nothing holds at any share is none that rests.
            if not done:
                if isinstance(exc, NoEquilibriumError):
                    return None
                share *= SOFTER
                if share < LEAST:
                    return None
                continue
            factor = float(np.sqrt(factor))
            if factor < SMALLEST_FACTOR:
                return None
        else:
            history += found.history[1:]
            loading, at, done = with_found_multipliers(system, loading, found.balance), found.balance, share
            query = loading.query
            assert query is not None
            if done == 1.0:
                return loading, replace(found, history=tuple(history))
            factor = min(FACTOR, factor * factor)
        share = min(1.0, factor * done)
        u = _moved(system, at, query.softened(done), query.softened((1.0 + A_LITTLE) * done), 1.0 - done / share)
    return None


def _moved(system: System, at: ForceBalance, now: ContactQuery, more: ContactQuery, share: float) -> Floats:
    """Return u : (n_nodes, 2) [m] where loose bodies have gone along with what would pull on them.

    now, more : contact as it was found at `at`, and with A_LITTLE of what comes.  share : of that, how much is to be
    made up for [1].
    """
    x = system.interface.nodes + at.u
    loose, surface = system.constraints.loose_motions(x), system.contact.dofs
    motions = np.concatenate([system.constraints.rigid_motions(x, body) @ Z for body, Z in loose], axis=1)
    before, after = now(x), more(x)
    pull = motions.T @ (system.contact.force(after) - system.contact.force(before)).ravel() / A_LITTLE
    held = system.contact.against(before, motions[surface])
    # fault: what sticks is not moved along as springs grow stiff -> q = 0.0 * np.linalg.lstsq(held, pull,
    #   rcond=None)[0] | mechanical_fmu/test_slipping
    q = share * np.linalg.lstsq(held, pull, rcond=None)[0]
    u = at.u + (motions @ q).reshape(-1, 2)
    return u if system.rigid is None else system.rigid.placed(u)
