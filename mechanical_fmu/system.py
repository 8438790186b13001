"""Balance of forces at a trial displacement: what pushes, what resists, and how far from equilibrium it is."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array

from contact.half.interface import Interface
from contact.half.linalg import JoinedPattern, Pattern, Solve, factorise, joined, pattern_of
from contact.half.nodal_stress import LINEAR, NodalStress, nodal_stress
from contact.half.start import start_temperature
from contact.messages import Tractions
from contact.problem.mechanical import Element, State
from mechanical_fmu.cells import Cells, Treatment, at_points, cells_of
from mechanical_fmu.constraints import Constraints, RigidBodies, constraints_of, rigid_bodies
from mechanical_fmu.contact import ContactQuery, MeshContact
from mechanical_fmu.given import GivenMesh, MechanicalVolume
from mechanical_fmu.laws.law import LIQUID
from mechanical_fmu.loads import pressure_blocks, pressure_forces
from mechanical_fmu.masses import Inertia, Masses
from mechanical_fmu.material import Moduli, moduli, thermal_strain
from mechanical_fmu.named_forces import NamedForces, named_forces
from mechanical_fmu.problem import ElasticSpec, Pressure
from mechanical_fmu.program import MechanicalProgram
from mechanical_fmu.volume import DeformableMesh, PointStep

Floats = NDArray[np.float64]

# A residual is measured against the forces on a body, but never against less than this share of E L: before two
# bodies touch there are no forces, and a purely relative measure would iterate on round-off.
FORCE_FLOOR = 1e-4
# Where there are forces a residual is never measured against more than so many times them, unless that is round-off: of
# what rests on a large body by its weight alone the usual floor would be thousands of times its forces.
LIGHT = 1e3
# Round-off of internal forces as a share of (bulk modulus) L; matters near nu = 1/2, where the bulk modulus dwarfs E.
ROUND_OFF = 2e-15
# Patterns of the tangent that are kept: bodies with what they touch by.
MAX_PATTERNS = 4


@dataclass(frozen=True)
class Loading:
    """What one equilibrium is sought for.

    moduli : one a kind of cell.  target : (n_fixed,) [m].  pressure : one a load [Pa].
    query : of contact; None where nothing can touch.
    step : time and memory of inelastic points, history as System.start_history gives it or the last ForceBalance.
    dead : (n_nodes, 2) [N] forces that do not follow the bodies, None where there are none.
    inertia : None where it is left out.
    """

    moduli: tuple[Moduli, ...]
    target: Floats
    pressure: Floats
    query: ContactQuery | None
    step: PointStep = field(default_factory=PointStep)
    dead: Floats | None = None
    inertia: Inertia | None = None

    @property
    def sticking(self) -> float:
        """Return the share of eps_T by which points stick; 1 but on the way to a solution."""
        return 1.0 if self.query is None else self.query.sticking


@dataclass(frozen=True)
class ForceBalance:
    """Forces at displacement u : (n_nodes, 2) [m].

    r : (n_nodes, 2) [N], internal less external; on prescribed components, what has to hold them.
    external : (n_nodes, 2) [N], pressure and contact.  entries : of the volume tangent where it was asked for.
    history : (n_history,) of points and cells if the step ended here.  heat : (n_cells,) [J] they made in it, empty
        where none can.  turning : (n_rigid,) [N/m] what forces at rigid bodies resist turning by themselves; r and
        external have those forces at the reference rows then.
    """

    u: Floats
    r: Floats
    external: Floats
    tractions: Tractions | None
    entries: Floats | None
    history: Floats = field(default_factory=lambda: np.empty(0))
    heat: Floats = field(default_factory=lambda: np.empty(0))
    turning: Floats | None = None


@dataclass(frozen=True)
class ForceFloor:
    """The least force that the residual of a body is compared with, whatever the forces on it.

    usual, least : (n_bodies,) [N], least where the forces are small; times the tolerance that is round-off.
    loose : (n_bodies,) bool, which only contact may hold.  applied [N] : the largest load that is put on a body.
    """

    usual: Floats
    least: Floats
    tolerance: float
    loose: NDArray[np.bool_]
    applied: float

    @property
    def usually(self) -> ForceFloor:
        """Return the same without heed of light loads."""
        return replace(self, least=self.usual)

    def against(self, forces: Floats) -> Floats:
        """Return (n_bodies,) [N], what residuals are compared with.  forces : (n_bodies,) [N] on the bodies."""
        # What is left of forces between a body that floats and one that it touches is no load: nothing bears it.
        # fault: what is left between bodies that touch is a load -> loads = forces | mechanical_fmu/test_left_behind
        loads = np.where(self.loose, self.applied, forces)
        # fault: light loads are taken for no load -> small = self.usual | mechanical_fmu/test_light_loads
        small = np.clip(LIGHT * loads, self.least, self.usual)
        floor = np.where(loads > self.tolerance * self.least, small, self.usual)
        return np.maximum(forces, floor)


@dataclass(frozen=True)
class System:
    """A scene of elastic bodies, apart from its loading.  program : solves for their inside; None: the cells."""

    interface: Interface
    spec: ElasticSpec
    volume: DeformableMesh
    constraints: Constraints
    contact: MeshContact
    masses: Masses
    program: MechanicalProgram | None = None

    @property
    def rigid(self) -> RigidBodies | None:
        """Return the rigid bodies of the scene, None without any."""
        return self.constraints.rigid

    @cached_property
    def nodal_stress(self) -> NodalStress:
        """How stress at nodes follows from that of cells."""
        return nodal_stress(self.interface, LINEAR)

    @cached_property
    def pattern(self) -> Pattern:
        """Find the pattern of the stiffness matrix, (2 n_nodes, 2 n_nodes), of all cells."""
        # Where all bodies are rigid there is no cell at all.
        dofs = [cells.dofs for cells in self.volume.kinds] or [np.empty((0, 1), np.int64)]
        return pattern_of(2 * self.volume.n_nodes, *dofs)

    @cached_property
    def _with_contact(self) -> list[JoinedPattern]:
        """The last patterns of bodies and contact: points open and close to and fro."""
        return []

    def tangent_matrix(self, entries: Floats, tractions: Tractions | None) -> csr_matrix:
        """Assemble the stiffness (2 n_nodes, 2 n_nodes) [N/m] of bodies and contact.

        entries : (n_entries,) [N/m] of the bodies.  tractions : of contact, whose stiffness counts; None: none.
        """
        if tractions is None or not len(tractions.blocks):
            return self.pattern.matrix(entries)
        starts, columns = self.contact.places(tractions)
        # fault: contact is put where it was before -> found = next(iter(self._with_contact), None) |
        #   mechanical_fmu/test_elastic_contact mechanical_fmu/test_contact_newton
        found = next((p for p in self._with_contact if p.is_of(starts, columns)), None)
        found = found or joined(self.pattern, starts, columns)
        self._with_contact[:] = [found, *(p for p in self._with_contact if p is not found)][:MAX_PATTERNS]
        # fault: contact stiffness left out of the fresh tangent -> return self.pattern.matrix(entries) |
        #   mechanical_fmu/test_elastic_contact
        return found.matrix(entries, tractions.blocks)

    def start_history(self) -> Floats:
        """Return (n_history,) of virgin points, for the PointStep of a first Loading."""
        return self.volume.start_history()

    def without(self, released: Collection[int]) -> System:
        """Return the system in which these displacements of the spec, by number, prescribe nothing any more."""
        return replace(self, constraints=constraints_of(self.interface, self.spec.displacements, self.rigid, released))

    @cached_property
    def can_be_loose(self) -> bool:
        """Say whether a body needs contact to be held."""
        return bool(self._loose.any())

    @cached_property
    def _loose(self) -> NDArray[np.bool_]:
        """(n_bodies,) which bodies need contact to be held."""
        loose = np.zeros(len(self.interface.bodies), dtype=bool)
        loose[[body for body, _ in self.constraints.loose_motions(self.interface.nodes)]] = True
        return loose

    @cached_property
    def moving(self) -> Floats:
        """Say, (2 n_nodes,), 1.0 where a component is free and has mass, else 0.0."""
        dynamics = self.spec.dynamics
        mass = self.masses.matrix(dynamics is not None and dynamics.lumped).diagonal()
        return np.asarray(self.constraints.free * (mass > 0.0))

    @cached_property
    def accelerations(self) -> Solve:
        """Factor the mass matrix of what moves: forces (2 n_nodes,) [N] -> accelerations [m/s2]."""
        dynamics = self.spec.dynamics
        M, moving = self.masses.matrix(dynamics is not None and dynamics.lumped), diags_array(self.moving)
        still = (1.0 - self.moving) * float(M.diagonal().max())
        return factorise(csr_matrix(moving @ M @ moving + diags_array(still)), True)

    @cached_property
    def loads(self) -> tuple[Pressure, ...]:
        """Return the follower pressures."""
        return self.spec.pressures

    @cached_property
    def named(self) -> NamedForces:
        """Find the named conditions."""
        return named_forces(self.interface, self.spec, self.constraints, self.masses.dead if self.spec.dead else None)

    @cached_property
    def size(self) -> Floats:
        """Compute (n_bodies,) L [m], or 2 pi r L [m2] when axisymmetric: what makes a force of a stress, roughly."""
        sizes = []
        for body in range(len(self.interface.bodies)):
            X = self.interface.nodes[self.interface.node_body == body]
            L = float(np.ptp(X, axis=0).max())
            sizes.append(L * (2.0 * np.pi * float(X[:, 0].max()) if self.interface.axisymmetric else 1.0))
        return np.array(sizes)

    def moduli(self, T: Floats, f_s: Floats | None = None) -> tuple[Moduli, ...]:
        """Compute the moduli of all cells at nodal temperatures T : (n_nodes,) [K].  Raises MaterialRangeError.

        f_s : (n_nodes,) [1] solid fraction; None or (0,): what melts takes it from T.
        """
        kinds = self.volume.kinds
        given = f_s if f_s is not None and f_s.size else None
        found = tuple(moduli(self.spec.materials, self.spec.part_material[cells.part], *cell)
                      for cells, cell in zip(kinds, self._warmth(T, given), strict=True))
        if not self.volume.tells_stress or self.program is not None:
            found = tuple(replace(m, T=T) for m in found)
        if not self.volume.tells_stress:
            return found
        if not self._drawn:
            return found
        # fault: a poured body has its mesh's shape when it is solid -> return tuple(replace(m, e_th=m.e_th - 0.0 *
        #   drawn) for drawn, m in zip(self._drawn, found, strict=True)) | mechanical_fmu/test_solution_melting
        return tuple(replace(m, e_th=m.e_th - drawn) for drawn, m in zip(self._drawn, found, strict=True))

    def _warmth(self, T: Floats, f_s: Floats | None
                ) -> list[tuple[Floats, Floats | None, tuple[Floats, Floats | None] | None]]:
        """T, f_s and inside of `moduli`, for each kind, of nodal T : (n_nodes,) [K] and f_s : (n_nodes,) [1].

        Points of cells with enhanced strain expand by their own temperature: the modes follow an expansion that changes
        within the cell.  Other cells would resist it with a stress of their own: they take their mean.
        """
        volume, none = self.volume, (None,) * len(self.volume.kinds)
        solid = none if f_s is None else volume.means(f_s)
        # fault: cells with modes expand by their mean temperature too -> bends = [False for _ in volume.kinds] |
        #   mechanical_fmu/test_thermal_bending
        bends = [cells.treatment.enhanced for cells in volume.kinds]
        points = [_at_points(cells, T, f_s) if with_modes else None
                  for cells, with_modes in zip(volume.kinds, bends, strict=True)]
        return list(zip(volume.means(T), solid, points, strict=True))

    def expansion(self, T: Floats, f_s: Floats) -> tuple[Floats, ...]:
        """Compute e_th/3 at the points of every kind, (n_e, nq) [1], also where cells take its mean.

        T : (n_nodes,) [K], f_s : (n_nodes,) or (0,) as in a StepDrive.  A body drawn at a field of temperatures expands
        from there on.
        """
        materials, material = self.spec.materials, self.spec.part_material
        found = tuple(thermal_strain(materials, material[cells.part], *_at_points(cells, T, f_s if f_s.size else None))
                      / 3.0 for cells in self.volume.kinds)
        for p, drawn_at in enumerate(self.spec.drawn_at):
            if drawn_at is None or isinstance(drawn_at, float):
                continue
            drawn = self._drawn_field(p)
            for cells, free in zip(self.volume.kinds, found, strict=True):
                own = cells.part == p
                then = thermal_strain(materials, material[cells.part[own]], at_points(cells, drawn)[own], None)
                # fault: heat that a body is drawn with counts as dropped -> free[own] -= 0.0 * then |
                #   mechanical_fmu/test_thermal_bending
                free[own] -= then / 3.0
        return found

    @cached_property
    def _drawn(self) -> tuple[Floats, ...]:
        """(n_e, n_th) e_th of each kind in the shape of the mesh; () where every body is drawn at its T_ref."""
        if all(drawn_at is None for drawn_at in self.spec.drawn_at):
            return ()
        e_th = [np.zeros(cells.weight.shape if cells.treatment.enhanced else (len(cells.part), 1))
                for cells in self.volume.kinds]
        for p, drawn_at in enumerate(self.spec.drawn_at):
            if drawn_at is None:
                continue
            T = self._drawn_field(p)
            liquid, one = self.spec.materials[self.spec.part_material[p]].flow.liquid, isinstance(drawn_at, float)
            # What melts is told the solid fraction at nodes, whose mean is not that of the mean temperature.
            # fault: a cell that is half mush is drawn at its mean temperature -> solid = None |
            #   coupler/test_starts::test_a_poured_body_of_uneven_warmth_begins_without_stress
            solid = None if liquid is None or one else liquid.solid_fraction(T)
            for k, (cells, cell) in enumerate(zip(self.volume.kinds, self._warmth(T, solid), strict=True)):
                own, (mean, part, points) = cells.part == p, cell
                # A number as it is: the mean over a cell has its own round-off.
                if one:
                    mean, points = np.full_like(mean, drawn_at), None
                inside = None if points is None else (points[0][own], None if points[1] is None else points[1][own])
                e_th[k][own] = moduli(self.spec.materials, self.spec.part_material[cells.part[own]], mean[own],
                                      None if part is None else part[own], inside).e_th
        return tuple(e_th)

    def _drawn_field(self, p: int) -> Floats:
        """(n_nodes,) [K] at which part p is drawn; T_ref elsewhere."""
        T = np.full(self.volume.n_nodes, self.spec.materials[self.spec.part_material[p]].T_ref)
        nodes = self.interface.part_nodes(p)
        T[nodes] = start_temperature(self.spec.drawn_at[p], self.interface, nodes)
        return T

    @cached_property
    def melts(self) -> bool:
        """Say whether some cell can be liquid."""
        return any(cells.treatment.kind & LIQUID for cells in self.volume.kinds)

    def balance(self, u: Floats, loading: Loading, tangent: bool = False,
                tractions: Tractions | None = None) -> ForceBalance:
        """Compute the forces at u : (n_nodes, 2) [m].  Raises CellInversionError, CellError, ContactRefusedError.

        tractions : of contact there under this loading, where they are known.
        """
        internal = self.volume.evaluate(u, loading.moduli, loading.step, tangent)
        x = self.interface.nodes + u
        external = self._pressed(x, loading)
        if loading.query is not None:
            tractions = loading.query(x) if tractions is None else tractions
            # fault: contact forces halved -> external += 0.5 * self.contact.force(tractions) |
            #   mechanical_fmu/test_elastic_contact
            external += self.contact.force(tractions)
        if loading.dead is not None:
            external += loading.dead
        r, turning = internal.f - external, None
        if self.rigid is not None:
            turning = self.rigid.turning_stiffness(r, u)
            r, external = self.rigid.reduced(r, u), self.rigid.reduced(external, u)
        if loading.inertia is not None:
            r = r + loading.inertia.force(u)
        return ForceBalance(u, r, external, tractions, internal.entries, internal.history, internal.heat, turning)

    def load_matrix(self, u: Floats, loading: Loading) -> csr_matrix:
        """Assemble the stiffness (2 n_nodes, 2 n_nodes) [N/m] of the follower pressures at u : (n_nodes, 2) [m]."""
        n = 2 * self.volume.n_nodes
        total = csr_matrix((n, n))
        for load, p in zip(self.loads, loading.pressure, strict=True):
            if p != 0.0:
                blocks = pressure_blocks(self.interface.nodes + u, load.edges, np.full(len(load.edges), p),
                                         self.interface.axisymmetric)
                dofs = (2 * load.edges[:, :, None].astype(np.int64) + np.arange(2)).reshape(-1, 4)
                where = (np.repeat(dofs, 4, axis=1).ravel(), np.tile(dofs, (1, 4)).ravel())
                total = total + csr_matrix((blocks.ravel(), where), shape=(n, n))
        return total

    def floor(self, loading: Loading, tolerance: float) -> ForceFloor:
        """Compute the least force that the residual of each body is compared with."""
        n = len(self.interface.bodies)
        E, kappa = np.zeros(n), np.zeros(n)
        for cells, m in zip(self.volume.kinds, loading.moduli, strict=True):
            np.maximum.at(E, cells.body, m.E)
            np.maximum.at(kappa, cells.body, m.kappa)
        least = ROUND_OFF * kappa / tolerance * self.size
        usual: Floats = np.maximum(FORCE_FLOOR * E * self.size, least)
        # A rigid body has no stiffness of its own: it is as exact as the softest of the others.
        soft = np.where(usual > 0.0, usual, np.inf).argmin()
        usual, least = (np.where(usual > 0.0, f, f[soft] or np.finfo(float).tiny) for f in (usual, least))
        # fault: of a short step more is asked than places are known to -> if False: | mechanical_fmu/test_short_steps
        if loading.inertia is not None:
            open_ = self._body_norms(loading.inertia.round_off) / tolerance
            usual, least = np.maximum(usual, open_), np.maximum(least, open_)
        return ForceFloor(usual, least, tolerance, self._loose, self._applied(loading) if self.can_be_loose else 0.0)

    def _pressed(self, x: Floats, loading: Loading) -> Floats:
        """(n_nodes, 2) [N] of the pressures of a loading, at x : (n_nodes, 2) [m]."""
        total = np.zeros_like(x)
        for load, p in zip(self.loads, loading.pressure, strict=True):
            if p != 0.0:
                forces = pressure_forces(x, load.edges, np.full(len(load.edges), p), self.interface.axisymmetric)
                np.add.at(total, load.edges, forces)
        return total

    def applied_at(self, u: Floats, pressure: Floats, dead: Floats) -> Floats:
        """Compute (n, 2) [N] of pressures [Pa] and levels of other loads, at u : (n, 2) [m], on what moves freely."""
        force = np.zeros_like(u)
        for load, p in zip(self.loads, pressure, strict=True):
            if p != 0.0:
                np.add.at(force, load.edges, pressure_forces(self.interface.nodes + u, load.edges, np.full(
                    len(load.edges), p), self.interface.axisymmetric))
        if dead.size:
            force += self.masses.dead.at(dead)
        return force if self.rigid is None else self.rigid.reduced(force, u)

    def _applied(self, loading: Loading) -> float:
        """[N] the largest load that is put on a body, contact apart, where it is drawn."""
        force = self._pressed(self.interface.nodes, loading)
        if loading.dead is not None:
            force += loading.dead
        return float(self._body_norms(force if self.rigid is None else self.rigid.reduced(
            force, np.zeros_like(force))).max())

    def error(self, balance: ForceBalance, floor: ForceFloor) -> Floats:
        """Compute (n_bodies,) [1] norm of the out-of-balance force of each body, relative to the forces on it."""
        free = self.constraints.free.reshape(-1, 2)
        norms = [self._body_norms(f) for f in (balance.r * free, balance.r * (1.0 - free), balance.external)]
        against = floor.against(np.maximum(norms[1], norms[2]))
        # fault: more is asked of what sticks far from where it was drawn than places are known to -> if False: |
        #   mechanical_fmu/test_coming_to_rest
        if self.rigid is not None and balance.tractions is not None and len(balance.tractions.blocks):
            against = np.maximum(against, self._contact_round_off(balance) / floor.tolerance)
        return norms[0] / against

    def _contact_round_off(self, balance: ForceBalance) -> Floats:
        """(n_bodies,) [N]: what the springs of contact make of the last digit of the places of a rigid body's nodes.

        Of a body that deforms its cells ask for less.
        """
        assert balance.tractions is not None
        assert self.rigid is not None
        tractions, nodes = balance.tractions, self.interface.contact_nodes
        stiff = np.abs(tractions.blocks).sum(axis=(1, 2))
        rows = np.repeat(np.arange(len(nodes)), np.diff(tractions.starts))
        last = np.spacing(np.abs((self.interface.nodes + balance.u)[nodes]).max(axis=1))
        forces = np.bincount(rows, weights=stiff * np.maximum(last[rows], last[tractions.columns]),
                             minlength=len(nodes))
        of_bodies = np.zeros(len(self.interface.bodies) + 1)
        np.add.at(of_bodies, self.interface.node_body[nodes] + 1, forces)
        of_rigid = np.zeros(of_bodies.size, dtype=np.bool_)
        of_rigid[self.rigid.body + 1] = True
        return np.where(of_rigid, of_bodies, 0.0)[1:]

    def _body_norms(self, f: Floats) -> Floats:
        squares = np.bincount(self.constraints.holder + 1, weights=f[:, 0] * f[:, 0] + f[:, 1] * f[:, 1],
                              minlength=len(self.interface.bodies) + 1)
        # fault: tolerance of a body measured by the other -> return np.sqrt(squares[1:]) * [1.0, 0.0][:len(squares) -
        #   1] | mechanical_fmu/test_elastic_contact
        return np.sqrt(squares[1:])


def _at_points(cells: Cells, T: Floats, f_s: Floats | None) -> tuple[Floats, Floats | None]:
    """T [K] and f_s [1] at the points of cells, (n_e, nq) each, of nodal ones."""
    return at_points(cells, T), None if f_s is None else at_points(cells, f_s)


def system_of(interface: Interface, spec: ElasticSpec, given: MechanicalVolume | None = None) -> System:
    """Make what of a scene does not change while it runs.  Raises ValueError for a bad mesh or constraints.

    given : the solver of another package for the inside of bodies; None: the cells of this half.

    With rigid bodies, the system's interface has their reference rows behind the nodes of the mesh.
    """
    stated = spec.stated
    kinds = cells_of(interface, tuple(
        Treatment(spec.materials[material].kind,
                  (spec.bodies[body].element or stated.element) is Element.ENHANCED, stated.state is State.PLANE_STRESS)
        for material, body in zip(spec.part_material, interface.part_body, strict=True)))
    bodies = np.concatenate([cells.body for cells in kinds]) if kinds else np.empty(0)
    for i, name in enumerate(interface.bodies):
        if i not in bodies:
            raise ValueError(f"mesh: body {name} has no cells")
    rigid = rigid_bodies(interface, spec.rigid, kinds) if spec.rigid else None
    masses = Masses(interface, spec, kinds, rigid)
    if rigid is not None:
        interface, kinds = rigid.extended(interface), rigid.deformable(kinds)
    mesh = DeformableMesh(kinds, len(interface.nodes), bodies.size) if given is None else GivenMesh(
        kinds, len(interface.nodes), bodies.size, given)
    # fault: pairs by their penalty alone do not see corners -> alone = [] | mechanical_fmu/test_groups
    alone = [pair.name for pair in interface.pairs if pair.name not in spec.augmented and not pair.tied]
    of_rigid = [] if rigid is None else [name for name, nodes in interface.surfaces.items()
                                         if np.isin(nodes, rigid.nodes).all()]
    contact = MeshContact(interface, alone, of_rigid, spec.augmented)
    return System(interface, spec, mesh, constraints_of(interface, spec.displacements, rigid), contact, masses)


def mesh_nodes(system: System) -> int:
    """Count the nodes of the mesh, reference rows of rigid bodies apart."""
    return len(system.interface.nodes) if system.rigid is None else system.rigid.first
