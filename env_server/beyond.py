"""The kernels for edges beyond the one that is touched, see `edges`: pairs that a contact could slide on to, and how far edges go on.

`find` is the whole search in one call.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from .distances import dot, kernel, leaf, length, minus, rotation, row, turned, turned_back
from .edges import CLOSE, SLIDE, EdgeTable
from .hits import find_hits
from .pairs import columns, triple
from .piece_hits import EDGE, FACE, VERTEX
from .skin import Lists
from .surface import Features, edge_end

STRAIGHT: Final = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))  # axes of a body that is not turned


@kernel
def find(
    features: Features,
    table: EdgeTable,
    known: Lists,
    nodes: np.ndarray,
    poses: np.ndarray,
    radius: float,
    reach: float,
    excluded: np.ndarray,
    capacity: int,
) -> tuple[int, np.ndarray, np.ndarray, np.ndarray]:
    """All pairs within reach: how many, and the arrays of `pairs.columns`.

    Arguments as for `find_hits`; more pairs than the capacity say how much room is needed, and nothing else.
    """
    own, hits, clearance = find_hits(features, known, nodes, poses, radius, radius + reach, excluded, capacity)
    count = add_edges_beyond(features, table, hits, own, poses, radius + CLOSE) if own <= capacity else own
    found = hits[: count if count <= capacity else 0]
    names, flags, numbers = columns(found, own, radius, clearance)
    write_extents(features, table, found, poses, numbers[12 * len(found) : 14 * len(found)].reshape(len(found), 2))
    return count, names, flags, numbers


@leaf
def add_edges_beyond(features: Features, table: EdgeTable, hits: np.ndarray, found: int, poses: np.ndarray, close: float) -> int:
    """Write a pair for every edge that leaves a vertex touched, or an end of the edge touched within `SLIDE` of the place.

    Args:
        features: All surfaces.
        table: Their edges.
        hits: Pairs; the first `found` are given, by body and along the cable, and there may be room for more.
        found: How many.
        poses: (b, 7) of the surfaces.
        close: [m] Distance of pairs that nearly touch; the others are left alone.

    Returns:
        How many pairs there are now; beyond the length of `hits`, how much room is needed at most.
    """
    total, ends, surfaces = found, features.edge_ends, features.surfaces
    for touched in range(found):
        if hits[touched].feature == FACE or hits[touched].is_crossing != 0 or hits[touched].distance >= close:
            continue
        is_vertex, name, body = hits[touched].feature == VERTEX, hits[touched].feature_id, hits[touched].body
        own = -1 if is_vertex else surfaces[body].first_edge + name
        place = turned_back(rotation(poses[body]), minus(triple(hits[touched].point), row(poses, body)))
        for end in range(1 if is_vertex else 2):
            if not is_vertex and length(minus(edge_end(ends, own, end), place)) >= SLIDE:
                continue
            vertex = surfaces[body].first_vertex + name if is_vertex else table.vertex[own, end]
            for edge in table.leaving[table.first_leaving[vertex] : table.first_leaving[vertex + 1]]:
                if edge == own or _is_known(hits, found, min(total, len(hits)), touched, edge - surfaces[body].first_edge):
                    continue
                if total < len(hits):
                    hits[total] = hits[touched]
                    _put_on_edge(ends, surfaces[body].first_edge, hits, total, edge, 0 if table.vertex[edge, 0] == vertex else 1, poses)
                total += 1
    return total


@leaf
def _put_on_edge(ends: np.ndarray, first_edge: int, hits: np.ndarray, pair: int, edge: int, end: int, poses: np.ndarray) -> None:
    """Move a pair to an end of an edge of the same surface."""
    body = hits[pair].body
    axes, low, high = rotation(poses[body]), edge_end(ends, edge, 0), edge_end(ends, edge, 1)
    along, size = minus(high, low), length(minus(high, low))
    point = turned(axes, low if end == 0 else high)
    hits[pair].feature, hits[pair].feature_id = EDGE, edge - first_edge
    hits[pair].point[0], hits[pair].point[1], hits[pair].point[2] = (
        poses[body, 0] + point[0],
        poses[body, 1] + point[1],
        poses[body, 2] + point[2],
    )
    hits[pair].direction[0], hits[pair].direction[1], hits[pair].direction[2] = turned(
        axes, (along[0] / size, along[1] / size, along[2] / size)
    )


@leaf
def _is_known(hits: np.ndarray, found: int, total: int, touched: int, name: int) -> bool:
    """Does the segment of a pair have one with that edge already? Pairs are in order, so that only its neighbours are looked at."""
    segment, body = hits[touched].segment, hits[touched].body
    for first, last, step in ((touched, -1, -1), (touched, found, 1), (total - 1, found - 1, -1)):
        for other in range(first, last, step):
            if hits[other].body != body or abs(hits[other].segment - segment) > 1:
                break
            if hits[other].segment == segment and hits[other].feature == EDGE and hits[other].feature_id == name:
                return True
    return False


@leaf
def write_extents(features: Features, table: EdgeTable, hits: np.ndarray, poses: np.ndarray, out: np.ndarray) -> None:
    """Write to `out` (m, 2) how far the edges of pairs go on from their points, back and ahead [m]; other features are left alone."""
    ends, surfaces, turned_by, axes = features.edge_ends, features.surfaces, -1, STRAIGHT
    for pair in range(len(hits)):
        if hits[pair].feature == EDGE:
            body = hits[pair].body
            if body != turned_by:
                turned_by, axes = body, rotation(poses[body])
            edge = surfaces[body].first_edge + hits[pair].feature_id
            low, high = edge_end(ends, edge, 0), edge_end(ends, edge, 1)
            apart = minus(turned(axes, low), minus(triple(hits[pair].point), row(poses, body)))
            back = dot(apart, triple(hits[pair].direction))
            out[pair, 0] = back - table.margins[edge, 0]
            out[pair, 1] = back + length(minus(high, low)) + table.margins[edge, 1]
