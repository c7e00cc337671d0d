"""Follows one cable through small motions of its grasps: the inner loop of a planner, without messages in between."""

from __future__ import annotations

from types import ModuleType
from typing import Final

import numpy as np

from protocol.errors import CablecosimError
from protocol.messages import Problem
from protocol.scene import Vector

from . import effects, kernels, pieces
from .descent import settle_or_relax
from .equilibrium import WHY, Settled
from .first_shape import from_grasps
from .following import follow, follow_nested
from .mesh import doubled, even, stops
from .rod import State
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
        self._rods = (system.rod, task.system(doubled(system.mesh)).rod if extrapolate else system.rod)
        framed = np.flatnonzero(system.rod.clamp_of_node[system.mesh.grasp_nodes] >= 0)
        self._held = (system.row_grasp, framed, system.base)
        self._state, self._extrapolate = State(*found.state), extrapolate
        ends = [system.mesh.s[node] for node in (0, -1) if system.rod.clamp_of_node[node] >= 0]
        middles, finer = 0.5 * (system.mesh.s[1:] + system.mesh.s[:-1]), doubled(system.mesh)
        self._between = (np.sort(np.append(middles, ends)), 0.5 * (finer.s[1:] + finer.s[:-1]))
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
        return self._state.frames

    def move(self, position: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
        """Nodes (n, 3) [m] after all grasps have moved to `position` (g, 3) [m] and `quaternion` (g, 4).

        Raises:
            CablecosimError: If Newton's method does not get there: move by less, or `solve` anew. The shape is then as it was.
        """
        if self._extrapolate:
            nodes, verdict, apart = follow_nested(*self._rods, self._held, self._state, self._between, position, quaternion)
            self.error = SAFETY * apart / 3
        else:
            nodes, verdict = follow(self._rods[0], self._held, self._state, position, quaternion)
        if verdict < 0:
            raise CablecosimError("the motion is too large to follow; move the grasps by less, or solve anew")
        self.is_stable = verdict > 0
        out: np.ndarray = nodes
        return out
