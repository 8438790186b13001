"""First contact under a force: a body that nothing holds yet is damped until contact holds it, and then no longer."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array

from mechanical_fmu.enforcement import solve_step, with_found_multipliers
from mechanical_fmu.masses import Inertia
from mechanical_fmu.newton import Equilibrium, NoEquilibriumError, SolverSettings
from mechanical_fmu.system import ForceBalance, Loading, System
from mechanical_fmu.tangent import LooseBodyError, refuse_loose

Floats = NDArray[np.float64]

# Increments k = 1, 2 ... of one step, all under the load of its end:
#     r(u_k) + W (u_k - u_{k-1}) = 0,   W = w times each node's share of its body's volume [N/m],
# which is a viscous force over a time of one increment.  w is so large that what pushes the body carries it no farther
# than its gap, or a share of an edge.  Once contact holds every loose body the step is solved as it stands: what is
# found is an equilibrium of the scene itself, with no viscous force in it.  Where that fails w goes down by RELIEF.
# The work of the viscous forces, sum of (u_k - u_{k-1}) W (u_k - u_{k-1}) [J], is what would have become motion.

# A body goes as far as its gap in its first increment, but no more and no less than these shares of an edge.
FIRST_WAY, LEAST_WAY = 0.25, 1e-5
# As long as nothing touches, increments grow so, up to this share of the body's size: a wide gap is crossed soon.
GROWTH, LONGEST_WAY = 2.0, 0.1
RELIEF = 0.1
# fault: one increment, whatever is left -> MOST_INCREMENTS = 0 | mechanical_fmu/test_first_contact
MOST_INCREMENTS = 30
# An increment only leads on: it need not be solved to the last digit, and one that is not solved soon goes less far.
# Four blocks on each other, warm from below, that slip on both edges at once: a tenth of the way after 25 iterations
# takes 0.77 of the CPU of half the way after 25, a tenth after 12 takes 0.38, after 8 0.30.
ROUGH, SOON, LESS = 1e-4, 12, 0.1
# The least damping [N/m] of a body that nothing pushes, as a share of E L: enough for its matrix to be regular.
LEAST = 1e-9
# What nothing pushes when an increment begins is flung away where contact lets go of it within the increment.  One that
# takes a body so many times its way is not taken: it is tried again, with so many times the least damping.
TOO_FAR, FIRMER = 100.0, 1e3
# A gap of less than this share of a way was gone past.
PAST = 0.9
# A body that went no farther than this share of its size stayed where it was.
STILL = 1e-12
# One that went as many times as far as the whole scene is wide has nothing left to meet.
BEYOND = 1.0
# What presses a body where it was would drive it at least so much of the way that it went: it was pushed there, and a
# second solve would only find that again.
PUSHED = 0.5


@dataclass(frozen=True)
class _Loose:
    """Bodies that conditions leave loose.  share : (n_loose, 2 n) of each degree of freedom in its body's volume.

    motions : of each, (2 n, k) [1], those that are left.  way : (n_loose,) [m] of the first increment.
    """

    bodies: tuple[int, ...]
    share: Floats
    motions: tuple[Floats, ...]
    way: Floats


def stabilised(system: System, loading: Loading, first: ForceBalance, settings: SolverSettings) -> Equilibrium:
    """Find the equilibrium of loading in which contact holds the bodies that nothing holds at `first`.

    Its work : [J] of the viscous forces.  Raises LooseBodyError where no contact comes to hold a body, and
    what solve_step does.
    """
    loose, found = _loose(system, first), first
    ways, relief = loose.way.copy(), 1.0
    rough = replace(settings, method="newton", tolerance=max(settings.tolerance, ROUGH), leads_on=True,
                    max_iterations=min(settings.max_iterations, SOON))
    fine = replace(rough, tolerance=settings.tolerance, leads_on=False, max_iterations=settings.max_iterations)
    floor = system.floor(loading, settings.tolerance)
    least = LEAST * float(floor.usual.max())
    extent = float(np.ptp(system.interface.nodes, axis=0).max())
    history, work, loosest = [0.0], 0.0, None
    for _ in range(MOST_INCREMENTS):
        pushes = _pushes(loose, found)
        unpushed = bool((pushes <= settings.tolerance * floor.usual[list(loose.bodies)]).all())
        damping = relief * np.maximum(pushes, least) / ways
        W = csr_matrix(diags_array(damping @ loose.share, format="csr"))
        inertia = Inertia(W, found.u, np.zeros_like(found.u))
        damped = replace(loading, inertia=inertia)
        used = fine if unpushed else rough
        try:
            step = solve_step(system, damped, system.balance(found.u, damped, True), None, used)
        except NoEquilibriumError:
            # What went far past its gap is sent to where that just closes: a tenth of the way, and twice as far again,
            # would come nearer for ever and end in the same overlap.
            # fault: what overshoots its gap is sent a tenth as far -> gaps = ways | coupler/test_first_contact_run
            gaps = np.array([_first_way(system, found, body) for body in loose.bodies])
            ways = np.where(gaps < PAST * ways, gaps, LESS * ways)
            continue
        # fault: a body that was flung away is looked for where it went -> if False: | mechanical_fmu/test_first_contact
        if _flung(system, loose, step.balance.u - found.u, ways / relief):
            ways, least = LESS * ways, FIRMER * least
            continue
        # fault: a body that stays where it is goes on being damped -> stays = False |
        #   mechanical_fmu/test_first_contact::test_a_block_on_one_that_bends_by_heat_is_not_flung_away
        stays = step.iterations == 0
        if stays:
            rough = fine  # it would stay where it is, roughly
        history += step.history[1:]
        du = (step.balance.u - found.u).ravel()
        # fault: work of the last increment alone -> work = float(du @ (W @ du)) | mechanical_fmu/test_first_contact
        work += float(du @ (W @ du))
        loading = with_found_multipliers(system, loading, step.balance)
        found = system.balance(step.balance.u, loading, True)
        error = float(system.error(found, floor).max())
        # fault: a body that nothing pushes is sent on its way -> if False: | mechanical_fmu/test_first_contact
        if (unpushed or (stays and used is fine)) and error <= settings.tolerance:
            # Wherever it is would be an equilibrium, or it is in one to the tolerance: it stays.
            return Equilibrium(found, error, tuple(history), True, work)
        # fault: a body that left the scene flies on -> if False: | mechanical_fmu/test_first_contact
        if loosest is not None and float(np.abs(found.u - first.u).max()) > BEYOND * extent:
            break
        try:
            refuse_loose(system, found)
            end = solve_step(system, loading, found, None, settings)
        except LooseBodyError as exc:
            loosest = exc
            if exc.together or not _touches(found):
                # A body that nothing pushes or touches only takes its own shape, and damping would hinder it.
                # fault: what takes its own shape is hindered -> free = 0.0 | mechanical_fmu/test_left_behind
                free = loose.way if unpushed and not _touches(found) else 0.0
                ways = np.minimum(np.maximum(GROWTH * ways, free), LONGEST_WAY * _sizes(system, loose))
                continue
        except NoEquilibriumError:
            pass
        else:
            return replace(end, history=(*history, *end.history[1:]), fresh=True, work=work)
        relief *= RELIEF
    # fault: a pull that is too much for friction is not told -> pulled = "" | coupler/test_obstacle
    pulled = ". It touched when the step began: the loads may be more than friction can hold"
    if not (system.contact.slips and _touches(first)):
        pulled = ""
    went = f"{float(np.abs(found.u - first.u).max()):.3g} m"
    if loosest is not None:
        raise LooseBodyError(f"{loosest}; damped, it went {went} and met nothing that holds it{pulled}")
    # fault: nobody knows which body only contact holds -> who = "" | mechanical_fmu/test_first_contact
    who = " and ".join(system.interface.bodies[body] for body in loose.bodies)
    raise LooseBodyError(f"only contact holds {who}, and {MOST_INCREMENTS} damped increments, by {went}, found no "
                         "place where it does: prescribe one more displacement of it until it presses (`until:`), let "
                         "the load begin smaller, or give its pair friction")


def left_behind(system: System, loading: Loading, u: Floats, found: ForceBalance, tolerance: float
                ) -> tuple[Loading, ForceBalance] | None:
    """Return where a step from u : (n_nodes, 2) [m] would leave bodies that nothing pushed; None where all is as found.

    A body that only contact holds, and contact without force, is in equilibrium wherever there is room for it.
    Newton's method takes it along with what it lay on when that draws back: the first iterate closes the gap.  It
    stays where it was as far as that leaves it room.
    """
    if found.tractions is None or loading.inertia is not None or not system.can_be_loose:
        return None
    least = tolerance * system.floor(loading, tolerance).usual
    loose = [(body, Z) for body, Z in system.constraints.loose_motions(system.interface.nodes + u)
             if _pressed(system, found, body) <= least[body]]
    at, loading = found, with_found_multipliers(system, loading, found) if loose else loading
    for body, Z in loose:
        motions = system.constraints.rigid_motions(system.interface.nodes + u, body) @ Z
        way = motions @ np.linalg.lstsq(motions, (at.u - u).ravel(), rcond=None)[0]
        if np.abs(way).max() <= STILL * system.size[body]:
            continue
        moved = at.u - way.reshape(-1, 2)
        trial = system.balance(moved if system.rigid is None else system.rigid.placed(moved), loading, True)
        if _driven_off(system, trial, way) < PUSHED:
            at = trial
    return None if at is found else (loading, at)


def _pressed(system: System, balance: ForceBalance, body: int) -> float:
    """[N] what contact does to a body."""
    assert balance.tractions is not None
    return float(np.linalg.norm(system.contact.force(balance.tractions)[system.constraints.node_body == body]))


def _driven_off(system: System, trial: ForceBalance, way: Floats) -> float:
    """Estimate the share of way : (2 n_nodes,) [m] that contact at its beginning drives a body along it."""
    assert trial.tractions is not None
    push = float(system.contact.force(trial.tractions).ravel() @ way)
    held = system.contact.against(trial.tractions, way[system.contact.dofs, None]) if push > 0.0 else None
    return push / float(held[0, 0]) if held is not None and held[0, 0] > 0.0 else 0.0


def _loose(system: System, first: ForceBalance) -> _Loose:
    x, constraints = system.interface.nodes + first.u, system.constraints
    found = constraints.loose_motions(x)
    bodies = tuple(body for body, _ in found)
    share, volume = np.zeros((len(bodies), 2 * len(x))), system.masses.volume
    for k, body in enumerate(bodies):
        share[k] = np.repeat(volume[body] / volume[body].sum(), 2)
    if system.rigid is not None:
        for k, body in enumerate(bodies):
            for number in np.flatnonzero(system.rigid.body == body):
                nodes = system.rigid.owner == number
                weights = volume[body][system.rigid.nodes[nodes]] / volume[body].sum()
                turning = float(weights @ (system.rigid.arm[nodes] ** 2).sum(axis=1)) / system.rigid.size[number] ** 2
                share[k] = 0.0
                share[k, system.rigid.dofs[number]] = [1.0, 1.0, turning]
    share *= constraints.free
    motions = tuple(constraints.rigid_motions(x, body) @ Z for body, Z in found)
    ways = np.array([_first_way(system, first, body) for body in bodies])
    return _Loose(bodies, share, motions, ways)


def _first_way(system: System, first: ForceBalance, body: int) -> float:
    """[m] what a body goes in its first increment."""
    name = system.interface.bodies[body]
    sides = [side for side in system.contact.sides if name in (side.other, side.surface.partition(".")[0])]
    if first.tractions is None or not sides:
        return FIRST_WAY * float(np.ptp(system.interface.nodes[system.interface.node_body == body], axis=0).max())
    edge = min(side.edge for side in sides)
    gap = min(float(first.tractions.node_gap[side.at].min()) for side in sides)
    return float(np.clip(gap, LEAST_WAY * edge, FIRST_WAY * edge))


def _pushes(loose: _Loose, balance: ForceBalance) -> Floats:
    """(n_loose,) [N] what drives each loose body along the motions left to it."""
    return np.array([float(np.abs(motions.T @ balance.r.ravel()).max()) for motions in loose.motions])


def _sizes(system: System, loose: _Loose) -> Floats:
    return np.array([np.ptp(system.interface.nodes[system.interface.node_body == body], axis=0).max()
                     for body in loose.bodies])


def _flung(system: System, loose: _Loose, du: Floats, ways: Floats) -> bool:
    """Say whether an increment du : (n_nodes, 2) [m] took a body much farther than its way : (n_loose,) [m].

    A way that was cut short counts as the first: what lies under the body may carry it as far as that, warm or bent.
    """
    went = [np.abs(du[system.constraints.node_body == body]).max() for body in loose.bodies]
    # fault: what lies under a body may not carry it -> return bool((np.array(went) > TOO_FAR * ways).any()) |
    #   mechanical_fmu/test_first_contact::test_a_block_on_one_that_bends_by_heat_is_not_flung_away
    return bool((np.array(went) > TOO_FAR * np.maximum(ways, loose.way)).any())


def _touches(balance: ForceBalance) -> bool:
    return balance.tractions is not None and balance.tractions.n_touching > 0
