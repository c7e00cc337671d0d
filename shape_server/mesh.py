"""The nodes along a cable: at both ends, at every held point, and evenly between them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from protocol.errors import MessageError


@dataclass(frozen=True)
class Mesh:
    """Nodes by arc length; every held point is a node."""

    s: np.ndarray  # (n,) m, from 0 to the cable's length
    lengths: np.ndarray  # (n-1,) m, of the segments
    grasp_nodes: np.ndarray  # (g,) int

    def locate(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Segment (m,) and fraction along it (m,) of points at arc length s (m,) [m]."""
        segment = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.lengths) - 1)
        return segment, np.clip((s - self.s[segment]) / self.lengths[segment], 0.0, 1.0)


def even(length: float, grasps: np.ndarray, segments: int) -> Mesh:
    """About `segments` segments of nearly the same length, with a node at every held point `grasps` (g,) [m]."""
    stops = np.unique(np.concatenate([[0.0], grasps, [length]]))
    pieces = []
    for first, last in pairwise(stops):
        count = max(1, round(segments * (last - first) / length))
        pieces.append(np.linspace(first, last, count, endpoint=False))
    return from_nodes(np.concatenate([*pieces, [length]]), length, grasps)


def from_nodes(s: np.ndarray, length: float, grasps: np.ndarray) -> Mesh:
    """The mesh with the given nodes.

    Raises:
        MessageError: If the nodes do not run from 0 to `length`, or a held point is no node.
    """
    near = 1e-9 * length
    if abs(s[0]) > near or abs(s[-1] - length) > near:
        raise MessageError(f"start.s: runs from {s[0]:g} to {s[-1]:g} m; must run from 0 to the length, {length:g} m", key="start.s")
    nodes = np.clip(np.searchsorted(s, grasps - near), 0, len(s) - 1)
    for node, grasp in zip(nodes, grasps, strict=True):
        if abs(s[node] - grasp) > near:
            raise MessageError(f"start.s: has no node at the held point {grasp:g} m; every held point must be a node", key="start.s")
    return Mesh(s=s, lengths=np.diff(s), grasp_nodes=nodes)


def halved(mesh: Mesh) -> Mesh:
    """The mesh with every second node left out, the ends and held points kept."""
    keep = np.zeros(len(mesh.s), dtype=bool)
    keep[::2] = True
    keep[-1] = True
    keep[mesh.grasp_nodes] = True
    return Mesh(s=mesh.s[keep], lengths=np.diff(mesh.s[keep]), grasp_nodes=(np.cumsum(keep) - 1)[mesh.grasp_nodes])
