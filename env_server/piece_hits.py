"""The kernels for one segment of the cable: its pairs with the faces, edges and vertices of triangles that are near."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from protocol.kinds import Feature

from .distances import (
    PARALLEL,
    POINT,
    ROUNDING,
    Triple,
    ahead,
    cross,
    dot,
    inlined,
    is_in_cone,
    leaf,
    length,
    minus,
    row,
    segment_segment,
)
from .skin import ALL, FACE_BIT, FIRST_EDGE, FIRST_VERTEX
from .surface import Features, edge_end, height, plane_normal

CORE: Final = 1e-9  # m, distance below which the axis touches the surface
SNAP: Final = 1e-9  # fraction of a segment within which a point counts as its node
FACE, EDGE, VERTEX = (int(feature) for feature in Feature)
NO_DIRECTION: Final = (0.0, 0.0, 0.0)


class Piece(NamedTuple):
    """A segment of the cable in the frame of a body."""

    start: Triple
    end: Triple
    along: Triple  # from start to end
    square: float  # m^2, its length
    segment: int
    body: int
    limit: float  # m, distance below which a pair is reported
    owns_end: bool  # no later segment takes care of its last node


class Rim(NamedTuple):
    """An edge of a surface in the frame of its body."""

    low: Triple
    high: Triple
    name: int
    owner: int  # triangle that looks after it
    first: int  # row in the planes of edges
    last: int  # after its last row


@inlined
def search_near(features: Features, near: np.ndarray, masks: np.ndarray, piece: Piece, hits: np.ndarray, count: int) -> int:
    """Pairs of one segment with the features that the triangles `near` look after, those of the masks if there are any."""
    planes, edge_first, edge_ends, start, end, limit = (
        features.planes,
        features.edge_first,
        features.edge_ends,
        piece.start,
        piece.end,
        piece.limit,
    )
    first_edge, first_vertex = features.surfaces[piece.body].first_edge, features.surfaces[piece.body].first_vertex
    inverse = 1.0 / piece.square if piece.square > POINT else 0.0
    for place, triangle in enumerate(near):
        mask = masks[place] if len(masks) > 0 else ALL
        if mask & FACE_BIT:
            highs = (height(planes, triangle, 0, start), height(planes, triangle, 0, end))
            if min(highs) >= limit or max(highs) <= -limit:
                continue
            starts = (height(planes, triangle, 1, start), height(planes, triangle, 2, start), height(planes, triangle, 3, start))
            ends = (height(planes, triangle, 1, end), height(planes, triangle, 2, end), height(planes, triangle, 3, end))
            if max(starts[0], ends[0]) <= -limit or max(starts[1], ends[1]) <= -limit or max(starts[2], ends[2]) <= -limit:
                continue
            if min(starts) >= -ROUNDING or min(ends) >= -ROUNDING or highs[0] * highs[1] <= 0.0:
                count = _search_face(planes, triangle, features.triangle_ids[triangle], highs, starts, ends, piece, hits, count)
        for side in range(3):
            edge = features.own_edges[triangle, side] if mask & FIRST_EDGE << side else -1
            vertex = features.own_vertices[triangle, side] if mask & FIRST_VERTEX << side else -1
            if edge >= 0:
                low, high = edge_end(edge_ends, edge, 0), edge_end(edge_ends, edge, 1)
                rim = Rim(low, high, edge - first_edge, triangle, edge_first[edge], edge_first[edge + 1])
                count = _search_edge(rim, features.edge_planes, planes, piece, hits, count)
            if vertex >= 0:
                point = row(features.vertices, vertex)
                fraction = min(max(dot(minus(point, start), piece.along) * inverse, 0.0), 1.0)
                away = minus(ahead(start, piece.along, fraction), point)
                distance, first, last = length(away), features.vertex_first[vertex], features.vertex_first[vertex + 1]
                if distance < limit and is_in_cone(away, distance, features.vertex_along, first, last):
                    count = _record(hits, count, piece, fraction, VERTEX, vertex - first_vertex, point, planes, triangle, NO_DIRECTION)
    return count


@inlined
def _search_face(
    planes: np.ndarray,
    triangle: int,
    name: int,
    highs: tuple[float, float],
    starts: Triple,
    ends: Triple,
    piece: Piece,
    hits: np.ndarray,
    count: int,
) -> int:
    """Nodes over a triangle and crossings of it, from the heights of both nodes over its plane and inside its sides."""
    start, end, normal, (high_start, high_end) = piece.start, piece.end, plane_normal(planes, triangle, 0), highs
    if min(starts) >= -ROUNDING:
        count = _record(hits, count, piece, 0.0, FACE, name, ahead(start, normal, -high_start), planes, triangle, NO_DIRECTION)
    if min(ends) >= -ROUNDING and piece.owns_end:
        count = _record(hits, count, piece, 1.0, FACE, name, ahead(end, normal, -high_end), planes, triangle, NO_DIRECTION)
    if min(abs(high_start), abs(high_end)) > CORE and (high_start > 0.0) != (high_end > 0.0):
        fraction = high_start / (high_start - high_end)
        if min(ahead(starts, minus(ends, starts), fraction)) >= -ROUNDING:
            point = ahead(start, piece.along, fraction)
            count = _record(hits, count, piece, fraction, FACE, name, point, planes, triangle, NO_DIRECTION)
    return count


@inlined
def _search_edge(rim: Rim, edge_planes: np.ndarray, planes: np.ndarray, piece: Piece, hits: np.ndarray, count: int) -> int:
    start, along, low, edge_along = piece.start, piece.along, rim.low, minus(rim.high, rim.low)
    apart, normal, square, mixed = minus(start, low), cross(along, edge_along), dot(edge_along, edge_along), dot(along, edge_along)
    sine = dot(normal, normal)
    is_parallel = sine <= PARALLEL * piece.square * square
    if is_parallel:
        fraction, _ = segment_segment(start, piece.end, low, rim.high)
    else:
        # Where the edge's own point is not between its ends, a vertex is closer, and `segment_segment` need not say where.
        fraction = min(max((mixed * dot(edge_along, apart) - dot(along, apart) * square) / sine, 0.0), 1.0)
    # Beside a parallel edge every point is closest, so both nodes are looked at as well.
    for choice in range(3 if is_parallel else 1):
        fraction = fraction if choice == 0 else choice - 1.0
        place = ahead(start, along, fraction)
        part = dot(minus(place, low), edge_along)
        if not 0.0 < part < square:
            continue
        point = ahead(low, edge_along, part / square)
        away = minus(place, point)
        if is_in_cone(away, length(away), edge_planes, rim.first, rim.last):
            direction = ahead(NO_DIRECTION, edge_along, 1.0 / square**0.5)
            count = _record(hits, count, piece, fraction, EDGE, rim.name, point, planes, rim.owner, direction)
    return count


@leaf
def _upward(planes: np.ndarray, triangle: int, piece: Piece) -> Triple:
    """Normal of a triangle, to the side of the segment's first node, or of its second if the first is in the plane."""
    high = height(planes, triangle, 0, piece.start)
    high = high if abs(high) > CORE else height(planes, triangle, 0, piece.end)
    return ahead(NO_DIRECTION, plane_normal(planes, triangle, 0), 1.0 if high >= 0.0 else -1.0)


@leaf
def _record(
    hits: np.ndarray,
    count: int,
    piece: Piece,
    fraction: float,
    feature: int,
    name: int,
    point: Triple,
    planes: np.ndarray,
    triangle: int,
    direction: Triple,
) -> int:
    """Add a pair if it is within reach; beyond the capacity only count it."""
    fraction = 0.0 if fraction < SNAP else (1.0 if fraction > 1.0 - SNAP else fraction)
    away = minus(ahead(piece.start, piece.along, fraction), point)
    distance = length(away)
    if distance >= piece.limit:
        return count
    if count < len(hits):
        is_crossing = distance < CORE
        hits[count].segment, hits[count].fraction, hits[count].body = piece.segment, fraction, piece.body
        hits[count].feature, hits[count].feature_id, hits[count].is_crossing = feature, name, is_crossing
        hits[count].distance = 0.0 if is_crossing else distance
        hits[count].point[0], hits[count].point[1], hits[count].point[2] = point
        normal = _upward(planes, triangle, piece) if is_crossing else ahead(NO_DIRECTION, away, 1.0 / distance)
        hits[count].normal[0], hits[count].normal[1], hits[count].normal[2] = normal
        hits[count].direction[0], hits[count].direction[1], hits[count].direction[2] = direction
    return count + 1
