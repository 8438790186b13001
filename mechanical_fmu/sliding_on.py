"""A body that slips on all it rests on slides on as it is, until some of its points stick.

Where friction is at its bound everywhere the tangent does not say how far a body goes along m, the motion that nothing
hinders.  What pulls on it does: m . r stays while its points slip, and falls as those that are pushed back unload.  The
way at which it vanishes is looked for between ways that grow from what points would yield if they stuck; there some
do stick, and Newton's method goes on from there.  A block on a floor that bends is so: at both of its ends all points
are held at the bound, and which of them go on to slip is a matter of the last digits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root_scalar

from mechanical_fmu.system import ForceBalance, Loading, System
from mechanical_fmu.tangent import LooseBodyError

Floats = NDArray[np.float64]

# Ways grow by so much, up to a share of the shortest edge: what goes farther meets other edges.
GROWTH, FARTHEST = 4.0, 0.25
# A pull counts for no less than this share of what else is out of balance.
LEAST = 0.01
# It is drawn back by so much of itself, or up to nearly twice that, where a way is known: then points do stick.
BACK, NEARLY = 0.1, 0.9
# So often one search for an equilibrium may have a body slide on.
# fault: what slips at all of its points is looked for by springs -> MOST_SLIDES = 0 | mechanical_fmu/test_carrying
MOST_SLIDES = 4


def slid_on(system: System, loading: Loading, balance: ForceBalance, loose: LooseBodyError, slides: int
            ) -> ForceBalance:
    """Return the balance where a loose body has slid on until friction holds it.

    slides : how often one did so before in this search.  loose : tells the body and its motion, and is raised where
    friction does not come to hold it.  Raises what System.balance does, too.
    """
    query, before, m = loading.query, balance.tractions, loose.motion
    if (slides >= MOST_SLIDES or query is None or before is None or before.n_slipping == 0
            or loading.inertia is not None):
        raise loose
    x, along = system.interface.nodes + balance.u, m[system.contact.dofs]
    springs = float(system.contact.against(query.softened(query.sticking)(x), along[:, None])[0, 0])
    r = balance.r.ravel()
    pull = -float(m @ r)
    # fault: what hardly pulls is drawn nowhere -> size = abs(pull) or 1.0 | mechanical_fmu/test_carrying
    size = max(abs(pull), LEAST * float(np.linalg.norm(m) * np.linalg.norm(r * system.constraints.free)))
    if not springs > 0.0 or size == 0.0:
        raise loose
    forth = float(np.copysign(1.0, pull))

    def at(way: float) -> Floats:
        u = balance.u + (way * m).reshape(-1, 2)
        return u if system.rigid is None else system.rigid.placed(u)

    def left(way: float) -> float:
        """Return the share of the pull that is left after a way, and BACK; 0 where it is nearly that."""
        then = query(system.interface.nodes + at(way))
        # fault: what a body slid leaves its pull as it was -> now = pull | mechanical_fmu/test_carrying
        now = pull + float(along @ (then.force - before.force).ravel())
        share = forth * now / size + BACK
        return 0.0 if abs(share) <= NEARLY * BACK else share

    farthest = FARTHEST * min(side.edge for side in system.contact.sides) / float(np.abs(along).max())
    behind, ahead = 0.0, forth * size / springs
    while abs(ahead) <= farthest:
        if left(ahead) <= 0.0:
            way = root_scalar(left, bracket=sorted((behind, ahead)), method="toms748").root
            return system.balance(at(way), loading)
        behind, ahead = ahead, GROWTH * ahead
    raise loose
