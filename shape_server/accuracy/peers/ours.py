"""The program under test, `shape_server.Follower`, in the form of a peer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from protocol.kinds import Hold
from protocol.messages import Grasps, Problem, Start
from protocol.scene import Cable

from ...catenary_kernels import hanging_nodes
from ...follower import Follower
from .collocation import Solved
from .motions import G, Hanging, Motions

NAME = "cablecosim"
REMEMBERS = True
ORIGIN = np.zeros(3)


@dataclass(frozen=True)
class Setting:
    """Mesh, and whether two meshes are extrapolated to fourth order."""

    segments: int
    extrapolate: bool

    def __str__(self) -> str:
        return f"n={self.segments}{' and twice that, extrapolated' if self.extrapolate else ''}"


def sweep(_motions: Motions) -> tuple[Setting, ...]:
    """Settings from coarse to fine."""
    coarse = [Setting(segments, extrapolate=False) for segments in (8, 12, 20, 30, 40, 80)]
    return (*coarse, *(Setting(segments, extrapolate=True) for segments in (10, 20, 40, 80, 120, 160, 240, 320)))


def prepare(motions: Motions, first: Solved, setting: Setting) -> Follower:
    """A follower at the shape where the motions start, from the reference: it tells the branch."""
    rod, s = motions.rod, np.linspace(0.0, motions.rod.length, setting.segments + 1)
    cable = Cable(name="rod", length=rod.length, diameter=5e-3, mass_per_length=rod.weight / G, bending=rod.bending, twist=rod.twist)
    held = Grasps(
        s=np.array([0.0, rod.length]),
        position=motions.position[0].copy(),
        quaternion=motions.quaternion[0].copy(),
        hold=(Hold.CLAMP, Hold.CLAMP),
    )
    start = Start(s=s, frames=first.frames((s[1:] + s[:-1]) / 2), grasp_forces=first.forces())
    problem = Problem(cable=cable, grasps=held, start=start)
    return Follower(problem, (0.0, 0.0, -G), segments=setting.segments, extrapolate=setting.extrapolate)


def hang(hanging: Hanging, end: np.ndarray, load: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Nodes (n, 3) [m] of the cable without bending, from the origin to an end (3,) [m] under a load (3,) [N/m]."""
    nodes, _tension = hanging_nodes(ORIGIN, end, hanging.length, load, s)
    return np.asarray(nodes)
