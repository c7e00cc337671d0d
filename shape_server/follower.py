"""Follows one cable through small motions of its grasps: the inner loop of a planner, without messages in between."""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np

from protocol.errors import CablecosimError
from protocol.kinds import Hold
from protocol.messages import Contacts, Problem
from protocol.scene import Vector

from . import effects, kernels, pieces
from .chain import cubic_weights
from .clamped import Chain, follow_clamped, follow_clamped_nested
from .contact_geometry import FACE
from .descent import settle_or_relax
from .equilibrium import DONE, WHY, Settled
from .first_shape import from_grasps
from .following import SHORT, STEPS, follow, follow_nested, follow_touching
from .mesh import doubled, even, stops
from .reading import contact_places, read
from .rod import Rod, State
from .system import System
from .task import Task

SAFETY: Final = 1.3  # times the estimated error
INSIDE: Final = 1e-3  # of the distance of a contact, by which a body may enter the cable: axis and polygon differ
FIRST: Final = 48  # segments on which a first shape is looked for


class Follower:
    """The shape of one cable, kept up with its grasps as they move by a little.

    It has a memory, unlike `solve`: every motion starts from the shape before it, and so keeps to its branch. Compiled only.
    """

    def __init__(self, problem: Problem, gravity: Vector, *, segments: int = 40, extrapolate: bool = False) -> None:
        """Find the first shape.

        Args:
            problem: Cable, grasps, loads, contacts, and a start shape on any mesh, which says which branch is meant; without clamps inside
                the cable. What is touched stays where it is in the world, and the cable slides on it; `touch` gives other contacts.
            gravity: [m/s^2].
            segments: Of the mesh.
            extrapolate: Combine with a mesh of twice as many segments, to fourth order; not with contacts.

        Raises:
            CablecosimError: If the problem cannot be followed, or has no first shape.
        """
        if len(pieces.cuts(problem)) > 2 or problem.cable.bending is None:
            raise CablecosimError("a Follower takes a cable with 'bending', without clamps inside it; use solve() for others")
        if effects.rubs(problem):
            raise CablecosimError(f"a Follower is not built {effects.WITH_FRICTION}")
        if problem.self_contacts is not None or problem.cable.bend_radius is not None:
            raise CablecosimError("a Follower is not built for self-contacts and 'bend_radius'; use solve() from the last shape")
        if problem.contacts is not None and problem.contacts.inclination is not None and problem.contacts.inclination.any():
            raise CablecosimError("a Follower is not built for a fixed inclination; use solve() from the last shape")
        self._problem, self._gravity, self._extrapolate = problem, gravity, extrapolate
        self._state: State
        self._mesh = even(stops(problem), problem.grasps.s, segments)
        task = self._task(problem)
        system = task.system(self._mesh)
        found = self._first(task, system)
        if not (found.is_converged and found.is_stable):
            raise CablecosimError(f"no first shape to follow: {WHY[found.why]}")
        self._follow(problem, system, found.state)
        self.s = self._mesh.s  # (n,) m
        self.is_stable = True  # whether the last equilibrium is
        self.error = np.inf  # m, estimated error of the last nodes before they were combined; not finite without `extrapolate`

    @property
    def frames(self) -> np.ndarray:
        """Quaternions (n-1, 4) of the segments."""
        return self._state.frames if self._clamped is None else self._clamped.frames[1:-1]

    @property
    def contact_forces(self) -> np.ndarray:
        """Forces (m, 3) [N] on the cable at the contacts, in their order."""
        return read(self._problem, self._system, self._settled(), kernels).contact_forces

    def _settled(self) -> Settled:
        state, seen = kernels.look(self._rod, self._state, np.ascontiguousarray(self._rod.touch["normal"]))
        return Settled(state, seen, True, True, 0, 0.0, DONE)

    def move(self, position: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
        """Nodes (n, 3) [m] after all grasps have moved to `position` (g, 3) [m] and `quaternion` (g, 4).

        Raises:
            CablecosimError: If Newton's method does not get there, or the cable slides over an edge or a vertex by more than a segment:
                move by less, or `solve` anew. The shape is then as it was.
        """
        apart = np.inf
        if self._clamped is not None:
            nodes, verdict, apart = self._clamped.move(position, quaternion)
        elif self._finer is not None:
            nodes, verdict, apart = follow_nested(self._rod, self._finer, self._held, self._state, self._between, position, quaternion)
        elif self._problem.contacts is None:
            nodes, verdict = follow(self._rod, self._held, self._state, position, quaternion)
        else:
            nodes, verdict = self._move_touching(position, quaternion)
        self.error = SAFETY * apart / 3
        if verdict < 0:
            raise CablecosimError("the motion is too large to follow; move the grasps by less, or solve anew")
        self.is_stable = verdict > 0
        out: np.ndarray = nodes
        return out

    def _move_touching(self, position: np.ndarray, quaternion: np.ndarray) -> tuple[np.ndarray, int]:
        """Nodes and verdict, as from `follow`, with contacts."""
        nodes, verdict, is_lost, has_slid, changed = follow_touching(
            self._rod, self._held, self._state, position, quaternion, self._segments
        )
        if verdict >= 0:
            if is_lost and self._passes(nodes, changed[3]):
                raise CablecosimError("the cable slides over an edge or a vertex by more than a segment; move the grasps by less")
            self._state = State(*changed, *self._state[len(changed) :])
            if has_slid:
                self._keep_up()
        return nodes, verdict

    def _passes(self, nodes: np.ndarray, push: np.ndarray) -> bool:
        """Whether an edge or a vertex that pushed until now, and not by `push`, is inside the cable or beyond it, where it has no rows."""
        contacts = self._problem.contacts
        assert contacts is not None
        contact, pushed = self._rod.touch["contact"], self._state.push > 0.0
        gone = set(contact[pushed].tolist()).difference(contact[push > 0.0].tolist())
        if not gone:
            return False
        directions = kernels.look(self._rod, self._state, np.ascontiguousarray(self._rod.touch["normal"]))[1].push
        for k in sorted(gone):
            if contacts.feature[k] == FACE:
                continue
            along, arms = contacts.direction[k], nodes - contacts.point[k]
            flat = arms - np.outer(arms @ along, along)
            sides = np.diff(flat, axis=0)
            share = np.clip(-np.einsum("ij,ij->i", flat[:-1], sides) / np.maximum(np.einsum("ij,ij->i", sides, sides), 1e-300), 0.0, 1.0)
            away = flat[:-1] + share[:, None] * sides
            place = (arms[:-1] + share[:, None] * np.diff(arms, axis=0)) @ along
            nearest = np.argmin(np.linalg.norm(away, axis=1))
            height = float(away[nearest] @ directions[(contact == k) & pushed][0])
            if contacts.extent[k, 0] <= place[nearest] <= contacts.extent[k, 1] and height < (1 - INSIDE) * contacts.distance[k]:
                return True
        return False

    def _keep_up(self) -> None:
        """Let the rows of edges and vertices go along with the places where they are touched, one segment at a time."""
        contacts = self._problem.contacts
        assert contacts is not None
        found = self._settled()
        s = np.where(contacts.feature == FACE, contacts.s, contact_places(self._problem, self._system, found))
        self.touch(msgspec.structs.replace(contacts, s=s, force=read(self._problem, self._system, found, kernels).contact_forces))

    def touch(self, contacts: Contacts | None) -> None:
        """Give other contacts, with the forces to start from; the next motion finds out which of them push."""
        force = self._state.force if self._clamped is None else self._clamped.force
        problem = msgspec.structs.replace(self._problem, contacts=contacts, start=None)
        if effects.rubs(problem):
            raise CablecosimError(f"a Follower is not built {effects.WITH_FRICTION}")
        system = self._task(problem).system(self._mesh)
        state = system.start(self.frames.copy())
        on_grasps = len(system.row_grasp) - 3 * len(system.bond_contact)  # rows of bonds come last
        state.force[:on_grasps] = force[:on_grasps]
        self._follow(problem, system, state)

    def _task(self, problem: Problem) -> Task:
        used = effects.asked_for(problem, self._gravity)
        return Task(problem, self._gravity, 1.0, None, False, False, used, kernels, lambda iteration, residual: None)

    def _first(self, task: Task, system: System) -> Settled:
        """Settled from the start shape, or from a first shape on few segments."""
        start, mesh = task.problem.start, self._mesh
        if start is not None:
            s, frames = start.s, np.array(start.frames)
        else:
            coarse = task.system(even(stops(task.problem), task.problem.grasps.s, min(len(mesh.lengths), FIRST)))
            found = from_grasps(task, coarse)
            if not found.is_converged or len(coarse.mesh.lengths) == len(mesh.lengths):
                return found
            s, frames = coarse.mesh.s, found.state.frames
        there, here = 0.5 * (s[1:] + s[:-1]), 0.5 * (mesh.s[1:] + mesh.s[:-1])
        return settle_or_relax(task.path, system.rod, system.start(task.path.interpolate_frames(there, frames, here)), task.progress)

    def _follow(self, problem: Problem, system: System, state: State) -> None:
        """Follow a problem from now on, from a state on its mesh."""
        if self._extrapolate and problem.contacts is not None:
            raise CablecosimError("extrapolate: meshes are not combined with contacts; give more segments instead")
        rod, mesh, finer = system.rod, self._mesh, doubled(self._mesh)
        self._problem, self._system, self._rod = problem, system, rod
        self._state = State(*state)
        self._finer = self._task(problem).system(finer).rod if self._extrapolate else None
        framed = np.flatnonzero(rod.clamp_of_node[mesh.grasp_nodes] >= 0)
        rows = system.row_grasp[system.row_grasp >= 0]
        is_guide = np.array([hold is Hold.GUIDE for hold in problem.grasps.hold])
        # A guide has two rows in line, along the first two directors of its frame.
        along = np.where(is_guide[rows], np.arange(len(rows)) - np.searchsorted(rows, rows), -1)
        self._held = (rows, along, framed, system.base)
        ends = [mesh.s[node] for node in (0, -1) if rod.clamp_of_node[node] >= 0]
        self._between = (np.sort(np.append(0.5 * (mesh.s[1:] + mesh.s[:-1]), ends)), 0.5 * (finer.s[1:] + finer.s[:-1]))
        contacts = problem.contacts
        self._segments = mesh.locate(contacts.s)[0] if contacts is not None else np.zeros(0, dtype=np.int64)  # of every contact
        self._clamped = _Clamped(rod, self._finer, state, self._between) if is_clamped(problem) else None


class _Clamped:
    """A cable clamped at both ends, without stretch and micro-structure length: the faster kernels; `finer` to combine two meshes."""

    def __init__(self, rod: Rod, finer: Rod | None, state: State, between: tuple[np.ndarray, np.ndarray]) -> None:
        self._chain, self._finer = chain_of(rod), None if finer is None else (chain_of(finer), cubic_weights(*between))
        self.frames = np.vstack([rod.clamp_frames[:1], state.frames, rod.clamp_frames[1:]])
        self.force = state.force.copy()  # (3,) N, of the last clamp

    def move(self, position: np.ndarray, quaternion: np.ndarray) -> tuple[np.ndarray, int, float]:
        """Nodes, verdict, and how far two meshes are apart [m]; not finite on one mesh."""
        if self._finer is None:
            nodes, verdict = follow_clamped(self._chain, self.frames, self.force, position, quaternion, SHORT, STEPS)
            return nodes, verdict, np.inf
        found: tuple[np.ndarray, int, float] = follow_clamped_nested(
            self._chain, *self._finer, self.frames, self.force, position, quaternion, SHORT, STEPS
        )
        return found


def is_clamped(problem: Problem) -> bool:
    """Whether a cable is clamped at both ends, and free of contact, stretch and micro-structure length between them."""
    held, cable = problem.grasps, problem.cable
    at_ends = held.hold == (Hold.CLAMP, Hold.CLAMP) and held.s[0] == 0.0 and held.s[1] == cable.length
    is_simple = cable.stretch is None and cable.micro_length is None and cable.bend_radius is None and cable.bending is not None
    return at_ends and problem.contacts is None and is_simple


def chain_of(rod: Rod) -> Chain:
    """What `clamped` and `lanes` take of a rod that is clamped at both ends; the cell of a clamp is half a segment."""
    h, elastic = rod.lengths, rod.elastic
    cells = 0.5 * np.concatenate([h[:1], h[1:] + h[:-1], h[-1:]])
    law, bent = elastic.node_law.copy(), elastic.node_bent.copy()
    law[[0, -1]], bent[[0, -1]] = elastic.law[[0, -1]], elastic.bent[[0, -1]]
    weight = np.cumsum(rod.loads[::-1], axis=0)[::-1][1:]
    return Chain(np.column_stack([cells, law, bent]), h, np.ascontiguousarray(weight))
