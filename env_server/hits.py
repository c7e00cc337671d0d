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
    leaf,
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
from .pairs import PAIR, measure, report, sort_along, triple
from .skin import ALL, FACE_BIT, FIRST_EDGE, FIRST_VERTEX, ROOM, Lists, Tree, holds, recalled, renew
from .surface import Features, edge_end, height, hides, is_beside, plane_normal
from .tree import BLOCK, bounding_spheres, gather

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


class Room(NamedTuple):
    """Room to work in, made once for all bodies."""

    near: np.ndarray  # for all triangles of a surface
    masks: np.ndarray  # (ROOM,)
    stack: np.ndarray  # (64,)
    raw: np.ndarray  # as long as the pairs
    order: np.ndarray  # of these


class Rim(NamedTuple):
    """An edge of a surface in the frame of its body."""

    low: Triple
    high: Triple
    name: int
    first: int  # row in the planes of edges
    last: int  # after its last row


@kernel
def find_hits(
    features: Features, known: Lists, nodes: np.ndarray, poses: np.ndarray, radius: float, limit: float, excluded: np.ndarray, capacity: int
) -> tuple[int, np.ndarray, np.ndarray]:
    """Search all bodies, with lists that are kept up or with `no_lists`; a count beyond the capacity says how much room is needed."""
    count, found, hits, spheres = len(nodes) - 1, 0, np.empty(capacity, PAIR), bounding_spheres(nodes)
    clearance, local, most = np.full(count, limit), np.empty((count + 1, 3)), 0
    for body in range(len(poses)):
        most = max(most, features.surfaces[body + 1].first_triangle - features.surfaces[body].first_triangle)
    rows = (np.empty(most, np.int64), np.empty(ROOM, np.int32), np.empty(64, np.int64))
    room = Room(*rows, np.empty(capacity, PAIR), np.empty(capacity, np.int64))
    for body in range(len(poses)):
        axes, origin, begin = rotation(poses[body]), row(poses, body), found
        in_reach = np.zeros(count, np.bool_)
        for block in range(len(spheres)):
            centre = turned_back(axes, minus(row(spheres, block), origin))
            if point_box(centre, features.boxes[features.surfaces[body].first_box]) < spheres[block, 3] + limit:
                first, last = block * BLOCK, min((block + 1) * BLOCK, count)
                in_reach[first:last] = True
                for node in range(first, last + 1):
                    local[node, 0], local[node, 1], local[node, 2] = turned_back(axes, minus(row(nodes, node), origin))
        if not in_reach.any():
            continue
        if excluded.size > 0:
            in_reach &= ~excluded[:, body]
        found = _search_body(features, known, room, body, local, in_reach, radius, limit, clearance, hits, found)
        if found > capacity:
            break
        _to_world(hits, begin, found, axes, origin)
    return found, hits, clearance


@leaf
def _search_body(
    features: Features,
    known: Lists,
    room: Room,
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
    surface, next_surface = features.surfaces[body], features.surfaces[body + 1]
    triangles = (surface.first_triangle, next_surface.first_triangle - surface.first_triangle)
    boxes, depth = features.boxes[surface.first_box : next_surface.first_box], surface.depth
    near, masks, stack, raw, count = room.near, room.masks, room.stack, room.raw, 0
    tree, keeps_lists, narrow = Tree(boxes, depth, triangles, near, masks, stack), len(known.narrow) > 0, known.narrow
    for segment in range(len(in_reach)):
        if not in_reach[segment]:
            continue
        start, end, begin = row(local, segment), row(local, segment + 1), count
        owns_end = segment + 1 == len(in_reach) or not in_reach[segment + 1]
        near_count = -1
        if keeps_lists:
            if holds(narrow, body, segment, start, end, limit):
                near_count = recalled(narrow, known.narrow_names, body, segment, near, masks)
            else:
                near_count = renew(known, features, tree, body, segment, start, end, limit)
        is_listed = near_count >= 0
        if not is_listed:
            near_count = gather(boxes, depth, start, end, limit, triangles, near, stack)
        if near_count == 0:
            continue
        piece, known_masks = Piece(start, end, segment, body, limit, owns_end), masks[: near_count if is_listed else 0]
        count = _search_near(features, near[:near_count], known_masks, piece, raw, count)
        if count > len(raw):
            return found + 2 * count
        count = _in_sight(features.planes, tree, limit, raw, begin, count, near_count)
    if found + count > len(hits):
        return found + 2 * count
    if count > 0:
        measure(raw[:count], in_reach, clearance)
        sort_along(raw, room.order[:count])
        found = report(raw, room.order[:count], radius, hits, found)
    return found


@leaf
def _in_sight(planes: np.ndarray, tree: Tree, limit: float, hits: np.ndarray, begin: int, count: int, near_count: int) -> int:
    """Of the pairs of a segment, from `begin` on, keep the nearest and those whose line of sight nothing cuts."""
    shortest = limit
    for hit in range(begin, count):
        shortest = min(shortest, hits[hit].distance)
    # What is at hand cuts most of those that are cut, and saves the walk; the walk then overwrites it.
    for is_walked in (False, True):
        kept = begin
        for hit in range(begin, count):
            point, distance = triple(hits[hit].point), hits[hit].distance
            if distance > shortest + CORE:
                eye = ahead(point, triple(hits[hit].normal), distance)
                if is_walked:
                    near_count = gather(tree.boxes, tree.depth, eye, point, 0.0, tree.triangles, tree.near, tree.stack)
                if hides(planes, tree.near, near_count, eye, point):
                    continue
            if kept < hit:
                hits[kept] = hits[hit]
            kept += 1
        count = kept
    return count


@leaf
def _search_near(features: Features, near: np.ndarray, masks: np.ndarray, piece: Piece, hits: np.ndarray, count: int) -> int:
    """Pairs of one segment with the features that the triangles `near` look after, those of the masks if there are any."""
    # Calls in this loop cost more than arithmetic: what most triangles fail is tested here.
    planes, own_edges, own_vertices, edge_planes = features.planes, features.own_edges, features.own_vertices, features.edge_planes
    edge_first, vertices, (start, end, limit) = features.edge_first, features.vertices, (piece.start, piece.end, piece.limit)
    edge_ends, first_edge = features.edge_ends, features.surfaces[piece.body].first_edge
    vertex_first, vertex_along, slack = features.vertex_first, features.vertex_along, 1e-9 * limit + ROUNDING
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
                count = _search_face(features, triangle, highs, starts, ends, piece, hits, count)
        for side in range(3):
            edge = own_edges[triangle, side] if mask & FIRST_EDGE << side else -1
            vertex = own_vertices[triangle, side] if mask & FIRST_VERTEX << side else -1
            if edge >= 0 and is_beside(edge_ends, edge, start, end):
                first, last = edge_first[edge], edge_first[edge + 1]
                if enters_cone(start, end, slack, edge_planes, first, last):
                    rim = Rim(edge_end(edge_ends, edge, 0), edge_end(edge_ends, edge, 1), edge - first_edge, first, last)
                    count = _search_edge(rim, edge_planes, _upward(planes, triangle, piece), piece, hits, count)
            if vertex >= 0:
                point = row(vertices, vertex)
                fraction = point_segment(point, start, end)
                away = minus(ahead(start, minus(end, start), fraction), point)
                distance = length(away)
                if distance < limit and is_in_cone(away, distance, vertex_along, vertex_first[vertex], vertex_first[vertex + 1]):
                    upward, vertex_id = _upward(planes, triangle, piece), vertex - features.surfaces[piece.body].first_vertex
                    count = _record(hits, count, piece, fraction, VERTEX, vertex_id, point, upward, NO_DIRECTION)
    return count


@leaf
def _search_face(
    features: Features, triangle: int, highs: tuple[float, float], starts: Triple, ends: Triple, piece: Piece, hits: np.ndarray, count: int
) -> int:
    """Nodes over a triangle and crossings of it, from the heights of both nodes over its plane and inside its sides."""
    start, end, (high_start, high_end), name = piece.start, piece.end, highs, features.triangle_ids[triangle]
    normal, upward = plane_normal(features.planes, triangle, 0), _upward(features.planes, triangle, piece)
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


@leaf
def _upward(planes: np.ndarray, triangle: int, piece: Piece) -> Triple:
    """Normal of a triangle, to the side of the segment's first node, or of its second if the first is in the plane."""
    high = height(planes, triangle, 0, piece.start)
    high = high if abs(high) > CORE else height(planes, triangle, 0, piece.end)
    return ahead(NO_DIRECTION, plane_normal(planes, triangle, 0), 1.0 if high >= 0.0 else -1.0)


@leaf
def _search_edge(rim: Rim, edge_planes: np.ndarray, upward: Triple, piece: Piece, hits: np.ndarray, count: int) -> int:
    start, end, low, high = piece.start, piece.end, rim.low, rim.high
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
        if 0.0 < part < 1.0 and is_in_cone(away, length(away), edge_planes, rim.first, rim.last):
            direction = ahead(NO_DIRECTION, edge_along, 1.0 / square**0.5)
            count = _record(hits, count, piece, fraction, EDGE, rim.name, point, upward, direction)
    return count


@leaf
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


@leaf
def _to_world(hits: np.ndarray, first: int, last: int, axes: tuple[Triple, Triple, Triple], origin: Triple) -> None:
    for hit in hits[first:last]:
        point = ahead(turned(axes, triple(hit.point)), origin, 1.0)
        hit.point[0], hit.point[1], hit.point[2] = point
        hit.normal[0], hit.normal[1], hit.normal[2] = turned(axes, triple(hit.normal))
        hit.direction[0], hit.direction[1], hit.direction[2] = turned(axes, triple(hit.direction))
