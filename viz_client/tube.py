"""Surface of a cable: a polygon swept along its nodes without twisting.

The ring at node i is spanned by u_i and t_i x u_i, where t_i bisects the two edges that meet there. From node to node u
is carried along by two reflections, first in the plane that halves the edge, then in the one that maps the reflected
tangent onto the next. This approximates the rotation-minimising frame to fourth order in the edge length; the twist of
the cable itself is not drawn.

Source:
    Wang, Juettler, Zheng, Liu 2008, "Computation of rotation minimizing frames", table I (double reflection).
"""

from __future__ import annotations

import numpy as np

from .surface import Floats, Integers, Surface


def tube(nodes: Floats, radius: float, *, sides: int = 12) -> Surface:
    """Closed surface at `radius` around the polyline, with `sides` corners a ring and a flat cap at either end.

    The corners lie on the radius, so the faces between them lie inside it, by radius (1 - cos(pi / sides)).

    Args:
        nodes: (n, 3) [m] Positions along the cable; n >= 2. Neighbours may coincide.
        radius: [m] Of the cable.
        sides: Corners of a ring; 3 or more.

    Returns:
        A surface of n * sides + 2 vertices: the rings in the order of the nodes, then the middles of the two caps.
    """
    tangents = _tangents(nodes)
    first = _carried(nodes, tangents)
    second = np.cross(tangents, first)
    angle = 2 * np.pi * np.arange(sides) / sides
    normals = np.cos(angle)[:, None] * first[:, None, :] + np.sin(angle)[:, None] * second[:, None, :]  # (n, sides, 3)
    rings = nodes[:, None, :] + radius * normals
    return Surface(
        vertices=np.concatenate([rings.reshape(-1, 3), nodes[[0, -1]]]),
        normals=np.concatenate([normals.reshape(-1, 3), -tangents[:1], tangents[-1:]]),
        triangles=tube_triangles(len(nodes), sides),
    )


def tube_triangles(node_count: int, sides: int) -> Integers:
    """Triangles of `tube` for so many nodes, (t, 3): two for every side of every edge, and the two caps."""
    here = np.arange(sides)
    after = (here + 1) % sides
    quad = np.concatenate(
        [np.stack([here, after, after + sides], axis=1), np.stack([here, after + sides, here + sides], axis=1)]
    )  # (2 sides, 3)
    walls = (quad[None, :, :] + sides * np.arange(node_count - 1)[:, None, None]).reshape(-1, 3)
    last = sides * (node_count - 1)
    middle = np.full(sides, sides * node_count)
    caps = np.concatenate([np.stack([after, here, middle], axis=1), np.stack([here + last, after + last, middle + 1], axis=1)])
    return np.concatenate([walls, caps]).astype(np.int64)


def resampled(nodes: Floats, count: int) -> Floats:
    """The polyline as (count, 3) points at equal distances along it."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(nodes, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], count)
    return np.stack([np.interp(at, length, nodes[:, axis]) for axis in range(3)], axis=1)


def _tangents(nodes: Floats) -> Floats:
    """Unit tangents at the nodes, (n, 3); a node where the cable folds back takes that of the edge before."""
    edges = np.diff(nodes, axis=0)
    length = np.linalg.norm(edges, axis=1)
    if not length.any():
        edges[:] = (0.0, 0.0, 1.0)
        length[:] = 1.0
    # An edge without length takes the direction of the last one that has some.
    known = np.maximum.accumulate(np.where(length > 0, np.arange(len(edges)), 0))
    known[: np.argmax(length > 0)] = np.argmax(length > 0)
    edges = edges[known] / length[known, None]
    both = np.concatenate([edges[:1], edges[:-1] + edges[1:], edges[-1:]])
    size = np.linalg.norm(both, axis=1)
    folded = size < 1e-9
    both[folded] = edges[np.flatnonzero(folded) - 1]
    size[folded] = 1.0
    return np.asarray(both / size[:, None])


def _carried(nodes: Floats, tangents: Floats) -> Floats:
    """First axis of every ring, (n, 3), square to the tangents, carried from the first node to the last."""
    axes = np.empty_like(nodes)
    across = np.eye(3)[np.argmin(np.abs(tangents[0]))]
    axis = np.cross(tangents[0], across)
    axes[0] = axis / np.linalg.norm(axis)
    for i in range(len(nodes) - 1):
        axis, tangent = _reflected(axes[i], nodes[i + 1] - nodes[i]), _reflected(tangents[i], nodes[i + 1] - nodes[i])
        axis = _reflected(axis, tangents[i + 1] - tangent)
        axis -= tangents[i + 1] * (axis @ tangents[i + 1])  # rounding, and edges without length
        axes[i + 1] = axis / np.linalg.norm(axis)
    return axes


def _reflected(vector: Floats, normal: Floats) -> Floats:
    """`vector` mirrored in the plane square to `normal`; unchanged where `normal` is zero."""
    square = normal @ normal
    return vector - (2.0 * (normal @ vector) / square) * normal if square > 1e-30 else vector
