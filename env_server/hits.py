"""The kernels of the contact search: every pair of a place on the cable and a feature of a surface, see `touch`."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from protocol.kinds import Feature

from .distances import (
    PARALLEL,
    ROUNDING,
    Triple,
    ahead,
    cross,
    dot,
    enters_cone,
    is_in_cone,
    kernel,
    length,
    minus,
    point_box,
    point_segment,
    rotation,
    row,
    segment_segment,
    turned,
    turned_back,
)
from .pairs import PAIR, measure, report, sorted_along, triple
from .skin import ALL, EDGE_BITS, FACE_BIT, ROOM, VERTEX_BITS, Lists, Tree, gather_listed, renew
from .surface import Features, height, hides
from .tree import gather

BLOCK: Final = 8  # segments that share a bounding sphere
CORE: Final = 1e-9  # m, distance below which the axis touches the surface
SNAP: Final = 1e-9  # fraction of a segment within which a point counts as its node
FACE, EDGE, VERTEX = (int(feature) for feature in Feature)
NO_DIRECTION: Final = (0.0, 0.0, 0.0)


class Piece(NamedTuple):
    """A segment of the cable in the frame of a body."""

    start: Triple
    end: Triple
    segment: int
    body: int
    limit: float  # m, distance below which a pair is reported
    owns_end: bool  # no later segment takes care of its last node


@kernel
def find_hits(
    features: Features, known: Lists, nodes: np.ndarray, poses: np.ndarray, radius: float, limit: float, excluded: np.ndarray, capacity: int
) -> tuple[int, np.ndarray, np.ndarray]:
    """Search all bodies, with lists that are kept up or with `no_lists`; a count beyond the capacity says how much room is needed."""
    count, found, hits, spheres = len(nodes) - 1, 0, np.empty(capacity, PAIR), _bounding_spheres(nodes)
    clearance, local = np.full(count, limit), np.empty((count + 1, 3))
    for body in range(len(poses)):
        axes, origin, begin = rotation(poses[body]), row(poses, body), found
        in_reach = np.zeros(count, np.bool_)
        for block in range(len(spheres)):
            centre = turned_back(axes, minus(row(spheres, block), origin))
            if point_box(centre, features.boxes[features.first_box[body]]) < spheres[block, 3] + limit:
                first, last = block * BLOCK, min((block + 1) * BLOCK, count)
                in_reach[first:last] = True
                for node in range(first, last + 1):
                    local[node, 0], local[node, 1], local[node, 2] = turned_back(axes, minus(row(nodes, node), origin))
        if not in_reach.any():
            continue
        if excluded.size > 0:
            in_reach &= ~excluded[:, body]
        found = _search_body(features, known, body, local, in_reach, radius, limit, clearance, hits, found)
        if found > capacity:
            break
        _to_world(hits, begin, found, axes, origin)
    return found, hits, clearance


@kernel
def _search_body(
    features: Features,
    known: Lists,
    body: int,
    local: np.ndarray,
    in_reach: np.ndarray,
    radius: float,
    limit: float,
    clearance: np.ndarray,
    hits: np.ndarray,
    found: int,
) -> int:
    """All pairs between the segments in reach and one body, in its frame."""
    triangles = (features.first_triangle[body], features.first_triangle[body + 1] - features.first_triangle[body])
    boxes, depth = features.boxes[features.first_box[body] : features.first_box[body + 1]], features.depths[body]
    stack, near, masks = np.empty(64, np.int64), np.empty(triangles[1], np.int64), np.empty(ROOM, np.int32)
    tree = Tree(boxes, depth, triangles, near, masks, stack)
    raw, count = np.empty(len(hits), PAIR), 0
    for segment in range(len(in_reach)):
        if not in_reach[segment]:
            continue
        start, end, begin = row(local, segment), row(local, segment + 1), count
        owns_end = segment + 1 == len(in_reach) or not in_reach[segment + 1]
        is_listed = renew(known, features, tree, body, segment, start, end, limit)
        if is_listed:
            near_count = gather_listed(known, tree, body, segment, start, end, limit)
        else:
            near_count = gather(boxes, depth, start, end, limit, triangles, near, stack)
        if near_count == 0:
            continue
        count = _search_near(
            features,
            near[:near_count],
            masks[: near_count if is_listed else 0],
            Piece(start, end, segment, body, limit, owns_end),
            raw,
            count,
        )
        if count > len(raw):
            return found + 2 * count
        shortest = limit
        for hit in range(begin, count):
            shortest = min(shortest, raw[hit].distance)
        kept = begin
        for hit in range(begin, count):
            point, distance = triple(raw[hit].point), raw[hit].distance
            if distance > shortest + CORE:
                eye = ahead(point, triple(raw[hit].normal), distance)
                near_count = gather(boxes, depth, eye, point, 0.0, triangles, near, stack)
                if hides(features.planes, near[:near_count], eye, point):
                    continue
            raw[kept] = raw[hit]
            kept += 1
        count = kept
    if found + count > len(hits):
        return found + 2 * count
    if count > 0:
        measure(raw[:count], in_reach, clearance)
        found = report(raw, sorted_along(raw[:count]), radius, hits, found)
    return found


@kernel
def _search_near(features: Features, near: np.ndarray, masks: np.ndarray, piece: Piece, hits: np.ndarray, count: int) -> int:
    """Pairs of one segment with the features that the triangles `near` look after, those of the masks if there are any."""
    # Calls in this loop cost more than arithmetic: what most triangles fail is tested here.
    planes, own_edges, own_vertices, edge_planes = features.planes, features.own_edges, features.own_vertices, features.edge_planes
    edge_first, vertices, (start, end, limit) = features.edge_first, features.vertices, (piece.start, piece.end, piece.limit)
    vertex_first, vertex_along, slack = features.vertex_first, features.vertex_along, 1e-9 * limit + ROUNDING
    for place, triangle in enumerate(near):
        mask = masks[place] if len(masks) > 0 else ALL
        high_start, high_end = height(planes, triangle, 0, start), height(planes, triangle, 0, end)
        if min(high_start, high_end) >= limit or max(high_start, high_end) <= -limit:
            continue
        starts = (height(planes, triangle, 1, start), height(planes, triangle, 2, start), height(planes, triangle, 3, start))
        ends = (height(planes, triangle, 1, end), height(planes, triangle, 2, end), height(planes, triangle, 3, end))
        if max(starts[0], ends[0]) <= -limit or max(starts[1], ends[1]) <= -limit or max(starts[2], ends[2]) <= -limit:
            continue
        if mask & FACE_BIT and (min(starts) >= -ROUNDING or min(ends) >= -ROUNDING or high_start * high_end <= 0.0):
            count = _search_face(features, triangle, (high_start, high_end), starts, ends, piece, hits, count)
        for side in range(3):
            edge, vertex = own_edges[triangle, side], own_vertices[triangle, side]
            if edge >= 0 and mask & EDGE_BITS[side] and enters_cone(start, end, slack, edge_planes, edge_first[edge], edge_first[edge + 1]):
                count = _search_edge(features, edge, triangle, piece, hits, count)
            if vertex >= 0 and mask & VERTEX_BITS[side]:
                point = row(vertices, vertex)
                fraction = point_segment(point, start, end)
                away = minus(ahead(start, minus(end, start), fraction), point)
                distance = length(away)
                if distance < limit and is_in_cone(away, distance, vertex_along, vertex_first[vertex], vertex_first[vertex + 1]):
                    upward, vertex_id = _upward(planes, triangle, piece), vertex - features.first_vertex[piece.body]
                    count = _record(hits, count, piece, fraction, VERTEX, vertex_id, point, upward, NO_DIRECTION)
    return count


@kernel
def _search_face(
    features: Features, triangle: int, highs: tuple[float, float], starts: Triple, ends: Triple, piece: Piece, hits: np.ndarray, count: int
) -> int:
    """Nodes over a triangle and crossings of it, from the heights of both nodes over its plane and inside its sides."""
    start, end, (high_start, high_end), name = piece.start, piece.end, highs, features.triangle_ids[triangle]
    normal, upward = triple(features.planes[triangle, 0]), _upward(features.planes, triangle, piece)
    if min(starts) >= -ROUNDING:
        count = _record(hits, count, piece, 0.0, FACE, name, ahead(start, normal, -high_start), upward, NO_DIRECTION)
    if min(ends) >= -ROUNDING and piece.owns_end:
        count = _record(hits, count, piece, 1.0, FACE, name, ahead(end, normal, -high_end), upward, NO_DIRECTION)
    if min(abs(high_start), abs(high_end)) > CORE and (high_start > 0.0) != (high_end > 0.0):
        fraction = high_start / (high_start - high_end)
        if min(ahead(starts, minus(ends, starts), fraction)) >= -ROUNDING:
            point = ahead(start, minus(end, start), fraction)
            count = _record(hits, count, piece, fraction, FACE, name, point, upward, NO_DIRECTION)
    return count


@kernel
def _upward(planes: np.ndarray, triangle: int, piece: Piece) -> Triple:
    """Normal of a triangle, to the side of the segment's first node, or of its second if the first is in the plane."""
    high = height(planes, triangle, 0, piece.start)
    high = high if abs(high) > CORE else height(planes, triangle, 0, piece.end)
    return ahead(NO_DIRECTION, triple(planes[triangle, 0]), 1.0 if high >= 0.0 else -1.0)


@kernel
def _search_edge(features: Features, edge: int, triangle: int, piece: Piece, hits: np.ndarray, count: int) -> int:
    start, end, low, high = piece.start, piece.end, row(features.edge_ends[edge], 0), row(features.edge_ends[edge], 1)
    first, last, edge_id = features.edge_first[edge], features.edge_first[edge + 1], edge - features.first_edge[piece.body]
    along, edge_along = minus(end, start), minus(high, low)
    sine, square = cross(along, edge_along), dot(edge_along, edge_along)
    is_parallel = dot(sine, sine) <= PARALLEL * dot(along, along) * square
    fraction, _ = segment_segment(start, end, low, high)
    # Beside a parallel edge every point is closest, so both nodes are looked at as well.
    for choice in range(3 if is_parallel else 1):
        fraction = fraction if choice == 0 else choice - 1.0
        place = ahead(start, along, fraction)
        part = dot(minus(place, low), edge_along) / square
        point = ahead(low, edge_along, part)
        away = minus(place, point)
        if 0.0 < part < 1.0 and is_in_cone(away, length(away), features.edge_planes, first, last):
            direction, upward = ahead(NO_DIRECTION, edge_along, 1.0 / square**0.5), _upward(features.planes, triangle, piece)
            count = _record(hits, count, piece, fraction, EDGE, edge_id, point, upward, direction)
    return count


@kernel
def _record(
    hits: np.ndarray, count: int, piece: Piece, fraction: float, feature: int, name: int, point: Triple, upward: Triple, direction: Triple
) -> int:
    """Add a pair if it is within reach; beyond the capacity only count it."""
    fraction = 0.0 if fraction < SNAP else (1.0 if fraction > 1.0 - SNAP else fraction)
    away = minus(ahead(piece.start, minus(piece.end, piece.start), fraction), point)
    distance = length(away)
    if distance >= piece.limit:
        return count
    if count < len(hits):
        is_crossing = distance < CORE
        hits[count].segment, hits[count].fraction, hits[count].body = piece.segment, fraction, piece.body
        hits[count].feature, hits[count].feature_id, hits[count].is_crossing = feature, name, is_crossing
        hits[count].distance = 0.0 if is_crossing else distance
        hits[count].point[0], hits[count].point[1], hits[count].point[2] = point
        hits[count].normal[0], hits[count].normal[1], hits[count].normal[2] = (
            upward if is_crossing else ahead(NO_DIRECTION, away, 1.0 / distance)
        )
        hits[count].direction[0], hits[count].direction[1], hits[count].direction[2] = direction
    return count + 1


@kernel
def _to_world(hits: np.ndarray, first: int, last: int, axes: tuple[Triple, Triple, Triple], origin: Triple) -> None:
    for hit in hits[first:last]:
        point = ahead(turned(axes, triple(hit.point)), origin, 1.0)
        hit.point[0], hit.point[1], hit.point[2] = point
        hit.normal[0], hit.normal[1], hit.normal[2] = turned(axes, triple(hit.normal))
        hit.direction[0], hit.direction[1], hit.direction[2] = turned(axes, triple(hit.direction))


@kernel
def _bounding_spheres(nodes: np.ndarray) -> np.ndarray:
    """Centre and radius (., 4) around every `BLOCK` segments."""
    count = len(nodes) - 1
    spheres = np.zeros(((count + BLOCK - 1) // BLOCK, 4))
    for block in range(len(spheres)):
        first, last = block * BLOCK, min((block + 1) * BLOCK, count)
        middle = ahead(row(nodes, first), minus(row(nodes, last), row(nodes, first)), 0.5)
        spheres[block, 0], spheres[block, 1], spheres[block, 2] = middle
        for node in range(first, last + 1):
            spheres[block, 3] = max(spheres[block, 3], length(minus(row(nodes, node), middle)))
    return spheres
