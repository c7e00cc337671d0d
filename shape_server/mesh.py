"""The nodes along a cable: at both ends, at every held point, and evenly between them, or closer where it bends sharply."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from protocol.errors import MessageError
from protocol.messages import Problem
from protocol.scene import Cable

LEAST: Final = 4  # segments between two places; fewer could not bow out to the length of their piece
GROWTH: Final = 0.3  # of the distance from a boundary layer, by which segments grow away from it
LAYER_SHARE: Final = 1.5  # segments in a layer are shorter than it by this factor at least


@dataclass(frozen=True)
class Mesh:
    """Nodes by arc length; every held point is a node."""

    s: np.ndarray  # (n,) m, from 0 to the cable's length
    lengths: np.ndarray  # (n-1,) m, of the segments
    grasp_nodes: np.ndarray  # (g,) int

    def locate(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Segment (m,) and fraction along it (m,) of points at arc length s (m,) [m]."""
        # Minimum and maximum: np.clip costs 20 us more on arrays this short.
        segment = np.minimum(np.maximum(np.searchsorted(self.s, s, side="right") - 1, 0), len(self.lengths) - 1)
        return segment, np.minimum(np.maximum((s - self.s[segment]) / self.lengths[segment], 0.0), 1.0)

    def shared(self, s: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Forces (m, 3) [N] at arc lengths s (m,) [m], shared by the two nodes of their segments: (n, 3)."""
        out = np.zeros((len(self.s), 3))
        segment, fraction = self.locate(s)
        for j, share, own in zip(segment.tolist(), fraction.tolist(), force, strict=True):  # few: np.add.at costs more than that
            out[j] += (1.0 - share) * own
            out[j + 1] += share * own
        return out

    def along(self, cable: Cable, name: str) -> np.ndarray:
        """A number of the cable at every segment, (n-1,) or (n-1, 3): its own, or that of the section at the segment's middle."""
        value = getattr(cable, name)
        number = np.zeros(3) if value is None else np.asarray(value, dtype=float)
        out = np.empty((len(self.lengths), *number.shape))
        out[:] = number
        if not cable.sections:
            return out
        middle = 0.5 * (self.s[:-1] + self.s[1:])
        for section in cable.sections:
            own = getattr(section, name)
            if own is not None:
                out[(middle > section.start) & (middle < section.end)] = own
        return out


def stops(problem: Problem) -> np.ndarray:
    """Arc lengths (k,) [m] that must be nodes: ends, held points, point loads, lumped masses, ends of sections."""
    cable = problem.cable
    places = [0.0, cable.length, *(mass.at for mass in cable.masses)]
    for section in cable.sections:
        places += [section.start, section.end]
    if problem.loads is not None:
        places += problem.loads.s.tolist()
    # Two stops closer than this would leave a segment that is too short to tell where it points.
    near, kept = 1e-6 * cable.length, problem.grasps.s.tolist()
    for place in places:
        if min(abs(place - other) for other in kept) > near:
            kept.append(place)
    return np.array([min(max(place, 0.0), cable.length) for place in sorted(kept)])


def even(places: np.ndarray, grasps: np.ndarray, segments: int) -> Mesh:
    """About `segments` segments of nearly the same length, with a node at each of the `places` (k,) [m]."""
    return graded(places, grasps, segments, np.zeros(0), np.zeros(0))


def graded(places: np.ndarray, grasps: np.ndarray, segments: int, centres: np.ndarray, layers: np.ndarray) -> Mesh:
    """About `segments` segments, and more where these would be longer than a boundary layer allows.

    Beside every centre segments are shorter than its layer, and grow with the distance from there. Between two places the
    number of segments per metre, 1 / h(s), is integrated and cut evenly, so that the mesh is a smooth map of an even one.

    Args:
        places: (k,) [m] Must be nodes; from 0 to the length.
        grasps: (g,) [m] Held points, among the places.
        segments: How many, if there were no layers.
        centres: (c,) [m] Where layers are.
        layers: (c,) [m] Length of each layer.
    """
    size = (places[-1] - places[0]) / segments
    pieces = []
    for first, last in pairwise(places.tolist()):
        if not len(centres):
            count = max(LEAST, round((last - first) / size))
            pieces.append(first + (last - first) / count * np.arange(count))
            continue
        s = _fine(first, last, centres, layers)
        wanted = np.full(len(s), size)
        for centre, layer in zip(centres, layers, strict=True):
            wanted = np.minimum(wanted, layer / LAYER_SHARE + GROWTH * np.abs(s - centre))
        density = 1.0 / wanted
        total = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(s))])
        count = max(LEAST, round(float(total[-1])))
        pieces.append(np.interp(np.linspace(0.0, total[-1], count, endpoint=False), total, s))
        pieces[-1][0] = first
    return from_nodes(np.concatenate([*pieces, places[-1:]]), float(places[-1]), grasps)


def _fine(first: float, last: float, centres: np.ndarray, layers: np.ndarray) -> np.ndarray:
    """Arc lengths at which to look how long a segment may be: evenly, and ever closer to every centre."""
    around = np.geomspace(1e-2, 1e4, 120)
    s = np.concatenate(
        [
            np.linspace(first, last, 400),
            *(centre + sign * layer * around for centre, layer in zip(centres, layers, strict=True) for sign in (-1, 1)),
        ]
    )
    return np.unique(np.clip(np.concatenate([s, centres]), first, last))


def from_nodes(s: np.ndarray, length: float, grasps: np.ndarray) -> Mesh:
    """The mesh with the given nodes.

    Raises:
        MessageError: If the nodes do not run from 0 to `length`, or a held point is no node.
    """
    near = 1e-9 * length
    if abs(s[0]) > near or abs(s[-1] - length) > near:
        raise MessageError(f"start.s: runs from {s[0]:g} to {s[-1]:g} m; must run from 0 to the length, {length:g} m", key="start.s")
    nodes = np.minimum(s.searchsorted(grasps - near), len(s) - 1)
    away = np.abs(s[nodes] - grasps)
    if away.max(initial=0.0) > near:
        grasp = grasps[away > near][0]
        raise MessageError(f"start.s: has no node at the held point {grasp:g} m; every held point must be a node", key="start.s")
    return Mesh(s=s, lengths=s[1:] - s[:-1], grasp_nodes=nodes)


def halved(mesh: Mesh) -> Mesh:
    """The mesh with every second node left out, the ends and held points kept."""
    keep = np.zeros(len(mesh.s), dtype=bool)
    keep[::2] = True
    keep[-1] = True
    keep[mesh.grasp_nodes] = True
    return Mesh(s=mesh.s[keep], lengths=np.diff(mesh.s[keep]), grasp_nodes=(np.cumsum(keep) - 1)[mesh.grasp_nodes])


def doubled(mesh: Mesh) -> Mesh:
    """The mesh with every segment cut into two."""
    s = np.empty(2 * len(mesh.s) - 1)
    s[::2], s[1::2] = mesh.s, 0.5 * (mesh.s[1:] + mesh.s[:-1])
    return Mesh(s=s, lengths=np.diff(s), grasp_nodes=2 * mesh.grasp_nodes)


def with_nodes_at(mesh: Mesh, places: np.ndarray) -> Mesh:
    """The mesh with the node nearest to each place moved there; held points and ends stay."""
    s, free = mesh.s.copy(), np.ones(len(mesh.s), dtype=bool)
    free[[0, -1, *mesh.grasp_nodes.tolist()]] = False
    for place in np.sort(places):
        away = np.where(free, np.abs(mesh.s - place), np.inf)
        node = int(np.argmin(away))
        if s[node - 1] < place < s[node + 1]:
            s[node], free[node] = place, False
    return Mesh(s=s, lengths=np.diff(s), grasp_nodes=mesh.grasp_nodes)
