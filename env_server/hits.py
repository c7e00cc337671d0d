"""The kernels of the contact search: every pair of a place on the cable and a feature of a surface, see `touch`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .distances import Triple, ahead, dot, inlined, kernel, leaf, minus, point_box, rotation, row, turned, turned_back
from .pairs import PAIR, measure, report, sort_along, triple
from .piece_hits import CORE, Piece, search_near
from .skin import NARROW, Lists, Tree, column, renew, which_hold
from .surface import Features, hides
from .tree import BLOCK, bounding_spheres, gather


class Room(NamedTuple):
    """Room to work in, made once for all bodies."""

    near: np.ndarray  # for all triangles of a surface
    stack: np.ndarray  # (64,)
    holds: np.ndarray  # for all segments
    raw: np.ndarray  # as long as the pairs
    order: np.ndarray  # of these


@kernel
def find_hits(
    features: Features, known: Lists, nodes: np.ndarray, poses: np.ndarray, radius: float, limit: float, excluded: np.ndarray, capacity: int
) -> tuple[int, np.ndarray, np.ndarray]:
    """Search all bodies, with lists that are kept up or with `no_lists`; a count beyond the capacity says how much room is needed."""
    count, found, hits, spheres = len(nodes) - 1, 0, np.empty(capacity, PAIR), bounding_spheres(nodes)
    clearance, places, most = np.full(count, limit), np.empty((3, count + 1)), 0
    for body in range(len(poses)):
        most = max(most, features.surfaces[body + 1].first_triangle - features.surfaces[body].first_triangle)
    rows = (np.empty(most, np.int32), np.empty(64, np.int64), np.empty(count, np.bool_))
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
                    places[0, node], places[1, node], places[2, node] = turned_back(axes, minus(row(nodes, node), origin))
        if not in_reach.any():
            continue
        if excluded.size > 0:
            in_reach &= ~excluded[:, body]
        found = _search_body(features, known, room, body, places, in_reach, radius, limit, clearance, hits, found)
        if found > capacity:
            break
        _to_world(hits, begin, found, axes, origin)
    return found, hits, clearance


@inlined
def _search_body(
    features: Features,
    known: Lists,
    room: Room,
    body: int,
    places: np.ndarray,
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
    raw, holds, names, count = room.raw, room.holds, known.names, 0
    tree, keeps_lists = Tree(boxes, depth, triangles, room.near, room.stack), known.counts.size > 0
    if keeps_lists:
        which_hold(known.boxes, NARROW, body, places, limit, 0, len(in_reach), holds)
    for segment in range(len(in_reach)):
        if not in_reach[segment]:
            continue
        level, near_count = NARROW, -1
        if keeps_lists:
            if holds[segment]:
                near_count = known.counts[NARROW, body, segment]
            else:
                level, near_count = renew(known, features, tree, body, segment, places, limit, holds)
            if near_count == 0:
                continue
        start, end, begin = column(places, segment), column(places, segment + 1), count
        if near_count >= 0:
            near, masks = names[level, body, segment, 0, :near_count], names[level, body, segment, 1, :near_count]
        else:
            near_count = gather(boxes, depth, start, end, limit, triangles, room.near, room.stack)
            near, masks = room.near[:near_count], room.near[:0]
        owns_end = segment + 1 == len(in_reach) or not in_reach[segment + 1]
        along = minus(end, start)
        piece = Piece(start, end, along, dot(along, along), segment, body, limit, owns_end)
        count = search_near(features, near, masks, piece, raw, count)
        if count > len(raw):
            return found + 2 * count
        count = _in_sight(features.planes, tree, limit, raw, begin, count, near)
    if found + count > len(hits):
        return found + 2 * count
    if count > 0:
        measure(raw[:count], in_reach, clearance)
        sort_along(raw, room.order[:count])
        found = report(raw, room.order[:count], radius, hits, found)
    return found


@inlined
def _in_sight(planes: np.ndarray, tree: Tree, limit: float, hits: np.ndarray, begin: int, count: int, near: np.ndarray) -> int:
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
                    found = gather(tree.boxes, tree.depth, eye, point, 0.0, tree.triangles, tree.near, tree.stack)
                    near = tree.near[:found]
                if hides(planes, near, eye, point):
                    continue
            if kept < hit:
                hits[kept] = hits[hit]
            kept += 1
        count = kept
    return count


@leaf
def _to_world(hits: np.ndarray, first: int, last: int, axes: tuple[Triple, Triple, Triple], origin: Triple) -> None:
    for hit in hits[first:last]:
        point = ahead(turned(axes, triple(hit.point)), origin, 1.0)
        hit.point[0], hit.point[1], hit.point[2] = point
        hit.normal[0], hit.normal[1], hit.normal[2] = turned(axes, triple(hit.normal))
        hit.direction[0], hit.direction[1], hit.direction[2] = turned(axes, triple(hit.direction))
