"""SciPy: the rod as a boundary value problem, collocated by `solve_bvp` from the last shape.

The setting is the number of nodes of a uniform mesh, and the tolerance. Allowed no more nodes than it starts with, `solve_bvp` cannot
refine, and its tolerance only says when the iteration stops: it factorises once a motion and takes one step at 1e6, more at 1e-3 and 1e-6.
Left to itself it would hand on finer meshes without end. Jacobians are given; with differences it takes 1.2 to 1.5 times as long.
SciPy knows no contact, and does not tell a stable shape from an unstable one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .collocation import Plane, Solved, Space, collocate
from .motions import Motions, Rod

NAME = "SciPy solve_bvp"
DISTRIBUTION, VERSION = "scipy", (1, 15)
INSTALL = "SciPy comes with cablecosim."
REMEMBERS = True
FROM_STRAIGHT = False


@dataclass(frozen=True)
class Setting:
    """Mesh and accuracy."""

    nodes: int
    tolerance: float  # of solve_bvp
    nodes_max: int = 0  # to which the mesh may be refined; none unless more than `nodes`

    def __str__(self) -> str:
        return f"{self.nodes} nodes, tol {self.tolerance:g}"


def sweep(_motions: Motions) -> tuple[Setting, ...]:
    """Settings from coarse to fine."""
    return tuple(Setting(*row) for row in ((7, 1e6), (9, 1e6), (15, 1e6), (25, 1e6), (41, 1e-3), (81, 1e-3), (161, 1e-6)))


def careful(_rod: Rod) -> Setting:
    """The setting for a single hard problem."""
    return Setting(101, 1e-3, 5000)


def prepare(motions: Motions, first: Solved, setting: Setting) -> Collocation:
    """Collocation at the shape where the motions start."""
    mesh = np.linspace(0.0, 1.0, setting.nodes)
    return Collocation(motions.rod, Plane if motions.is_planar else Space, setting, mesh, first.found.sol(mesh), first.found.p)


@dataclass
class Collocation:
    """The states on a mesh, from motion to motion."""

    rod: Rod
    kind: type[Plane | Space]
    setting: Setting
    mesh: np.ndarray  # (n,) arc lengths over the length
    states: np.ndarray  # (4 or 10, n) scaled
    force: np.ndarray  # (2 or 3,) scaled

    @property
    def s(self) -> np.ndarray:
        """(n,) [m] Arc lengths of the nodes."""
        return self.mesh * self.rod.length

    def move(self, position: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
        """Nodes (n, 3) [m] after the clamps have moved; not a number where the mesh may be refined and the tolerance is not met."""
        problem = self.kind.of(self.rod, position, quaternion)
        most = max(self.setting.nodes, self.setting.nodes_max)
        found = collocate(problem, self.mesh, self.states, self.force, self.setting.tolerance, nodes_max=most)
        self.mesh, self.states, self.force = found.x, found.y, found.p
        if self.setting.nodes_max and not found.success:
            return np.full((len(self.mesh), 3), np.nan)
        if self.kind is Space:
            return self.states[:3].T * self.rod.length
        return np.column_stack([self.states[0], np.zeros_like(self.mesh), self.states[1]]) * self.rod.length
