"""What contact tells of nodes: pressure, shear and slip of its points, as means over what each node faces."""

from __future__ import annotations

import numpy as np

from contact.compiled import kernel
from contact.messages import Floats, Ints
from contact.piece import OPEN


@kernel
def nodal_means(n_q: int, at: Ints, values: Floats, p_N: Floats, tau: Floats,
                heat: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Average pressure and shear to the pair nodes: t_N [Pa], shear [Pa], E_friction [J] and what is faced [m2].

    All are (n_q,).  at : (n_p, 4) pair nodes, the slave edge's two, then the master edge's two.
    values : (n_p, 5) xi_s, xi_m [1], gap [m], area, area_m [m2].  p_N, tau : (n_p,) [Pa].  heat : (n_p,) [J].
    t_N = -sum(A N p_N)/sum(A N) over what each node faces, both sides; the others are of slave nodes:
    shear = sum(A N tau)/sum(A N) over what the node faces as a slave.
    """
    pushed, faced, dragged = np.zeros(n_q), np.zeros(n_q), np.zeros(n_q)
    searched, made = np.zeros(n_q), np.zeros(n_q)
    for i in range(at.shape[0]):
        for side in range(2):
            for end in range(2):
                s = at[i, 2 * side + end]
                N = values[i, side] if end == 1 else 1.0 - values[i, side]
                weight = N * values[i, 3]
                pushed[s] += weight * p_N[i]
                faced[s] += weight
                if side == 0:
                    dragged[s] += weight * tau[i]
                    searched[s] += weight
                    made[s] += N * heat[i]
    for s in range(n_q):
        pushed[s] = -pushed[s] / faced[s] if pushed[s] > 0.0 else 0.0
        dragged[s] = dragged[s] / searched[s] if searched[s] > 0.0 else 0.0
    return pushed, dragged, made, faced


# Of a node of which less than this share faces the other side, the mean pressure over what it faces says more of where
# the other side ends than of the contact: as two blocks part it goes to force over nothing.
SLIVER = 0.05
# The pressure of such a node is told over no less than this share of its part of the side.
LEAST_PART = 0.25


@kernel
def at_slivers(t_N: Floats, t_T: Floats, faced: Floats, covered: Floats, searched: Ints, sides: Ints, start: Ints,
               place: Ints) -> tuple[Floats, Floats]:
    """Return t_N and shear (n_q,) [Pa] in which a node that faces next to nothing has no pressure of its own.

    It has no more than the mean over what it and the next nodes along its side face, and the shear that belongs to it.
    The neighbours count the more the less is covered, from nothing at SLIVER on, so that nothing jumps as bodies slide.
    A pressure that is the same everywhere stays it; where the next nodes, too, face next to nothing (contact about to
    end) force is told over LEAST_PART of the node's part.  Forces and multipliers know nothing of this.

    t_N, t_T : (n_q,) [Pa] as of nodal_means.  faced : (n_q,) [m2].  covered : (n_q,) [1].  searched : (n_q,) 1 where a
    side is searched from.  sides : (n_sides, 2) surface and first pair node.  start : (n_surfaces + 1,) first edges.
    place : (n_edges, 2).
    """
    near_force, near_faced = np.zeros(t_N.size), np.zeros(t_N.size)
    for k in range(sides.shape[0]):
        surface, first = sides[k, 0], sides[k, 1]
        for e in range(start[surface], start[surface + 1]):
            for end in range(2):
                q, other = first + place[e, end], first + place[e, 1 - end]
                near_force[q] += t_N[other] * faced[other]
                near_faced[q] += faced[other]
    told, shear = t_N.copy(), t_T.copy()
    for q in range(t_N.size):
        # fault: a sliver has a pressure of its own -> if False: | contact/test_slivers coupler/test_one_pressure
        if searched[q] == 1 and t_N[q] < 0.0 and covered[q] < SLIVER:
            c = 1.0 - covered[q] / SLIVER
            # fault: contact of a sliver alone is told over nothing -> area = faced[q] + c * near_faced[q] |
            #   contact/test_slivers coupler/test_one_pressure
            area = max(faced[q] + c * near_faced[q], c * LEAST_PART * faced[q] / covered[q])
            # fault: a sliver is told more than it has -> told[q] = (t_N[q] * faced[q] + c * near_force[q]) / area |
            #   contact/test_slivers
            told[q] = max(t_N[q], (t_N[q] * faced[q] + c * near_force[q]) / area)
            # fault: shear of a sliver beyond its pressure -> shear[q] = t_T[q] | contact/test_slivers
            shear[q] = t_T[q] * (told[q] / t_N[q])
    return told, shear


@kernel
def on_masters(t_N: Floats, searched: Ints, at: Ints, values: Floats) -> Floats:
    """Return t_N (n_q,) [Pa] in which nodes of masters have the mean of what slave nodes have where they face them.

    t_N : (n_q,) [Pa].  searched : (n_q,) 1 where a side is searched from.  at, values : as of nodal_means.
    A mean of its own points would tell a node beside the contact, which faces a sliver of the slave's corner, more than
    any slave node: two largest pressures of one pair.  What all nodes of a pair's side press in sum stays the same, and
    no node's pressure jumps as a first point of it comes to press, which round-off may do.
    """
    met, faced = np.zeros(t_N.size), np.zeros(t_N.size)
    for i in range(at.shape[0]):
        between = (1.0 - values[i, 0]) * t_N[at[i, 0]] + values[i, 0] * t_N[at[i, 1]]
        for end in range(2):
            s = at[i, 2 + end]
            weight = values[i, 3] * (values[i, 1] if end == 1 else 1.0 - values[i, 1])
            met[s] += weight * between
            faced[s] += weight
    told = t_N.copy()
    for s in range(t_N.size):
        # fault: nodes of the master have a pressure of their own -> if False: | coupler/test_one_pressure
        # fault: a master's node has a pressure from the first point of it that presses on -> if searched[s] == 0 and
        #   t_N[s] < 0.0 and faced[s] > 0.0: | contact/test_nodes_at_ends
        if searched[s] == 0 and faced[s] > 0.0:
            told[s] = met[s] / faced[s]
    return told


@kernel
def touching_means(n_q: int, at: Ints, values: Floats, doing: Floats, told: Floats) -> Floats:
    """Return sum(A N told)/sum(A N) over what each slave node touches, (n_q,); 0 where nothing touches.

    at : (n_p, 4) pair nodes, the slave edge's two first.
    values : (n_p, 5) xi_s, xi_m [1], gap [m], area, area_m [m2].  doing : (n_p,) state [1].
    told : (n_p,) of the points.
    """
    summed, touches = np.zeros(n_q), np.zeros(n_q)
    for i in range(at.shape[0]):
        if doing[i] == OPEN:
            continue
        for end in range(2):
            weight = (values[i, 0] if end == 1 else 1.0 - values[i, 0]) * values[i, 3]
            summed[at[i, end]] += weight * told[i]
            touches[at[i, end]] += weight
    for s in range(n_q):
        summed[s] = summed[s] / touches[s] if touches[s] > 0.0 else 0.0
    return summed
