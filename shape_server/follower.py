"""Follows one cable through small motions of its grasps: the inner loop of a planner, without messages in between."""

from __future__ import annotations

from types import ModuleType
from typing import Final

import numpy as np

from protocol.errors import CablecosimError
from protocol.kinds import Hold
from protocol.messages import Problem
from protocol.scene import Vector

from . import effects, kernels, pieces
from .chain import cubic_weights
from .clamped import Chain, follow_clamped, follow_clamped_nested
from .descent import settle_or_relax
from .equilibrium import WHY, Settled
from .first_shape import from_grasps
from .following import SHORT, STEPS, follow, follow_nested
from .mesh import doubled, even, stops
from .rod import Rod, State
from .system import System
from .task import Task

SAFETY: Final = 1.3  # times the estimated error


class Follower:
    """The shape of one cable, kept up with its grasps as they move by a little.

    It has a memory, unlike `solve`: every motion starts from the shape before it, and so keeps to its branch. Compiled only.
    """

    def __init__(self, problem: Problem, gravity: Vector, *, segments: int = 40, extrapolate: bool = False) -> None:
        """Find the first shape.

        Args:
            problem: Cable, grasps, loads and a start shape on any mesh, which says which branch is meant; without contacts, and
                without clamps inside the cable.
            gravity: [m/s^2].
            segments: Of the mesh.
            extrapolate: Combine with a mesh of twice as many segments, to fourth order.

        Raises:
            CablecosimError: If the problem cannot be followed, or has no first shape.
        """
        path: ModuleType = kernels
        if problem.contacts is not None or len(pieces.cuts(problem)) > 2 or problem.cable.bending is None:
            raise CablecosimError("a Follower takes a cable with 'bending', without contacts and clamps inside it; use solve() for others")
        used = effects.asked_for(problem, gravity)
        task = Task(problem, gravity, 1.0, None, False, False, used, path, lambda iteration, residual: None)
        system = task.system(even(stops(problem), problem.grasps.s, segments))
        found = self._first(task, system)
        if not (found.is_converged and found.is_stable):
            raise CablecosimError(f"no first shape to follow: {WHY[found.why]}")
        finer = doubled(system.mesh)
        self._rods = (system.rod, task.system(finer).rod if extrapolate else system.rod)
        framed = np.flatnonzero(system.rod.clamp_of_node[system.mesh.grasp_nodes] >= 0)
        self._held = (system.row_grasp, framed, system.base)
        self._state, self._extrapolate = State(*found.state), extrapolate
        ends = [system.mesh.s[node] for node in (0, -1) if system.rod.clamp_of_node[node] >= 0]
        middles = 0.5 * (system.mesh.s[1:] + system.mesh.s[:-1])
        self._between = (np.sort(np.append(middles, ends)), 0.5 * (finer.s[1:] + finer.s[:-1]))
        self._clamped = _Clamped(self._rods, found.state, self._between, extrapolate) if is_clamped(problem) else None
        self.s = system.mesh.s  # (n,) m
        self.is_stable = True  # whether the last equilibrium is
        self.error = np.inf  # m, estimated error of the last nodes before they were combined; not finite without `extrapolate`

    def _first(self, task: Task, system: System) -> Settled:
        start = task.problem.start
        if start is None:
            return from_grasps(task, system)
        there, here = 0.5 * (start.s[1:] + start.s[:-1]), 0.5 * (system.mesh.s[1:] + system.mesh.s[:-1])
        begin = system.start(task.path.interpolate_frames(there, np.array(start.frames), here))
        return settle_or_relax(task.path, system.rod, begin, task.progress)

    @property
    def frames(self) -> np.ndarray:
        """Quaternions (n-1, 4) of the segments."""
        return self._state.frames if self._clamped is None else self._clamped.frames[1:-1]

    def move(self, position: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
        """Nodes (n, 3) [m] after all grasps have moved to `position` (g, 3) [m] and `quaternion` (g, 4).

        Raises:
            CablecosimError: If Newton's method does not get there: move by less, or `solve` anew. The shape is then as it was.
        """
        if self._clamped is not None:
            nodes, verdict, apart = self._clamped.move(position, quaternion)
        elif self._extrapolate:
            nodes, verdict, apart = follow_nested(*self._rods, self._held, self._state, self._between, position, quaternion)
        else:
            nodes, verdict = follow(self._rods[0], self._held, self._state, position, quaternion)
            apart = np.inf
        self.error = SAFETY * apart / 3
        if verdict < 0:
            raise CablecosimError("the motion is too large to follow; move the grasps by less, or solve anew")
        self.is_stable = verdict > 0
        out: np.ndarray = nodes
        return out


class _Clamped:
    """A cable clamped at both ends, without stretch and micro-structure length: the faster kernels of `clamped`."""

    def __init__(self, rods: tuple[Rod, Rod], state: State, between: tuple[np.ndarray, np.ndarray], extrapolate: bool) -> None:
        self._chains = (chain_of(rods[0]), chain_of(rods[1]))
        self._blend = cubic_weights(*between) if extrapolate else None
        self.frames = np.vstack([rods[0].clamp_frames[:1], state.frames, rods[0].clamp_frames[1:]])
        self._force = state.force.copy()

    def move(self, position: np.ndarray, quaternion: np.ndarray) -> tuple[np.ndarray, int, float]:
        """Nodes, verdict, and how far two meshes are apart [m]; not finite on one mesh."""
        if self._blend is None:
            nodes, verdict = follow_clamped(self._chains[0], self.frames, self._force, position, quaternion, SHORT, STEPS)
            return nodes, verdict, np.inf
        found: tuple[np.ndarray, int, float] = follow_clamped_nested(
            *self._chains, self._blend, self.frames, self._force, position, quaternion, SHORT, STEPS
        )
        return found


def is_clamped(problem: Problem) -> bool:
    """Whether a cable is clamped at both ends, and free of contact, stretch and micro-structure length between them."""
    held, cable = problem.grasps, problem.cable
    at_ends = held.hold == (Hold.CLAMP, Hold.CLAMP) and held.s[0] == 0.0 and held.s[1] == cable.length
    is_simple = cable.stretch is None and cable.micro_length is None and cable.bending is not None
    return at_ends and problem.contacts is None and is_simple


def chain_of(rod: Rod) -> Chain:
    """What `clamped` and `lanes` take of a rod that is clamped at both ends; the cell of a clamp is half a segment."""
    h, elastic = rod.lengths, rod.elastic
    cells = 0.5 * np.concatenate([h[:1], h[1:] + h[:-1], h[-1:]])
    law, bent = elastic.node_law.copy(), elastic.node_bent.copy()
    law[[0, -1]], bent[[0, -1]] = elastic.law[[0, -1]], elastic.bent[[0, -1]]
    weight = np.cumsum(rod.loads[::-1], axis=0)[::-1][1:]
    return Chain(np.column_stack([cells, law, bent]), h, np.ascontiguousarray(weight))
