"""Triangles as they are drawn: round where the solid is round, sharp where it is sharp.

A vertex is split where two of its triangles meet at a crease, an edge whose faces enclose more than 45 degrees; every
part gets the mean normal of its triangles, weighted by area. Without this either everything looks faceted or every edge
looks melted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

CREASE: Final = np.cos(np.radians(45.0))
WELD: Final = 1e-6  # m; vertices closer than this on every axis are one


@dataclass(frozen=True)
class Surface:
    """Triangles with a normal at every vertex."""

    vertices: Floats  # (v, 3) m
    normals: Floats  # (v, 3) unit, outwards
    triangles: Integers  # (t, 3) anticlockwise seen from outside


def smoothed(vertices: Floats, triangles: Integers) -> Surface:
    """The same triangles with vertices welded, then split at creases.

    Triangles without area are dropped. Where more than two triangles share an edge, it is a crease.

    Args:
        vertices: (v, 3) [m]
        triangles: (t, 3) Indices of vertices.
    """
    points, index = np.unique(np.round(vertices / WELD).astype(np.int64), axis=0, return_inverse=True)
    triangles = index.reshape(-1)[triangles]
    corners = points[triangles] * WELD  # (t, 3, 3)
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])  # (t, 3) m^2, twice the area
    size = np.linalg.norm(areas, axis=1)
    kept = size > 1e-16
    triangles, areas, size = triangles[kept], areas[kept], size[kept]
    group = _corner_groups(triangles, areas / size[:, None])  # (3 t,)
    count = int(group.max(initial=-1)) + 1
    normals = np.stack([np.bincount(group, np.repeat(areas[:, axis], 3), count) for axis in range(3)], axis=1)
    length = np.linalg.norm(normals, axis=1)
    split = np.empty((count, 3))
    split[group] = points[triangles.reshape(-1)] * WELD
    return Surface(split, normals / np.where(length > 0, length, 1.0)[:, None], group.reshape(-1, 3).astype(np.int64))


def _corner_groups(triangles: Integers, normals: Floats) -> Integers:
    """Number of the drawn vertex that every corner of every triangle belongs to, (3 t,)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    corner = np.arange(3 * len(triangles)).reshape(-1, 3)
    starts, ends = corner.reshape(-1), np.roll(corner, -1, axis=1).reshape(-1)  # corners at either end of every half-edge
    flat = triangles.reshape(-1)
    ends_of_edge = np.sort(np.stack([flat[starts], flat[ends]], axis=1), axis=1)
    order = np.lexsort((ends_of_edge[:, 1], ends_of_edge[:, 0]))
    _, first, uses = np.unique(ends_of_edge[order], axis=0, return_index=True, return_counts=True)
    one, other = order[first[uses == 2]], order[first[uses == 2] + 1]
    smooth = np.einsum("ij,ij->i", normals[one // 3], normals[other // 3]) > CREASE
    one, other = one[smooth], other[smooth]
    # Neighbours run along their common edge in opposite directions, unless a triangle is turned over.
    same = flat[starts[one]] == flat[starts[other]]
    across = np.where(same, starts[other], ends[other])
    along = np.where(same, ends[other], starts[other])
    rows, columns = np.concatenate([starts[one], ends[one]]), np.concatenate([across, along])
    graph = coo_array((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(len(flat), len(flat)))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def bisected(surface: Surface, edge_max: float) -> Surface:
    """The same surface with every triangle halved at its longest edge until no edge is longer than `edge_max` [m]."""
    vertices, normals, triangles = surface.vertices, surface.normals, surface.triangles
    while True:
        corners = vertices[triangles]  # (t, 3, 3)
        length = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)  # (t, 3)
        long = length.max(axis=1) > edge_max
        if not long.any():
            return Surface(vertices, normals, triangles)
        turn = (length[long].argmax(axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.take_along_axis(triangles[long], turn, axis=1).T  # the longest edge runs from a to b
        middle = len(vertices) + np.arange(len(a))
        mean = normals[a] + normals[b]
        vertices = np.concatenate([vertices, 0.5 * (vertices[a] + vertices[b])])
        normals = np.concatenate([normals, mean / np.maximum(np.linalg.norm(mean, axis=1), 1e-12)[:, None]])
        halves = (np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1))
        triangles = np.concatenate([triangles[~long], *halves])
