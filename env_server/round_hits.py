"""The kernels of the search on exact bodies: sphere, cylinder, capsule, plane and point, without triangles.

Each but the plane is all that lies within R of a line from a to b; a sphere or a point has a = b, a point R = 0. The nearest place
of a segment to that line is `segment_segment`, exact; the gap is that distance less R and the radius of the cable. A plane is met
at the nodes. The flat ends of a cylinder are not built: what counts there is only how near they are, the least distance along the
segment to the solid cylinder, which is convex along a straight line and found by golden sections.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from .distances import PARALLEL, Triple, ahead, cross, dot, kernel, leaf, length, minus, rotation, row, segment_segment
from .pairs import PAIR
from .piece_hits import CORE, EDGE, FACE, NO_DIRECTION, SNAP, VERTEX

BALL, ROD, TUBE, PLANE = range(4)  # sphere or point; capsule; cylinder; plane
GOLDEN: Final = 0.5 * (5.0**0.5 - 1.0)
SECTIONS: Final = 60  # each leaves 0.618 of the interval: 3e-13 of the segment


@kernel
def find_round_hits(
    nodes: np.ndarray, poses: np.ndarray, kinds: np.ndarray, halves: np.ndarray, radii: np.ndarray, limit: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs on exact bodies whose surface is nearer to the axis than `limit`.

    Args:
        nodes: (n, 3) [m] of the cable.
        poses: (b, 7) of the bodies.
        kinds: (b,) BALL, ROD, TUBE or PLANE.
        halves: (b,) [m] half the length of the line, along the body's z.
        radii: (b,) [m].
        limit: [m].

    Returns:
        Pairs, `point` on the line, `distance` to it; how far (b, n-1) [m] each segment may go without passing a body, at most the
        limit: to the line, for inside a solid its side is still known, and to the surface of a cylinder; and for each body the
        distance (b,) [m] of the axis to the ends of a cylinder, infinite if they are out of reach.
    """
    count = len(nodes) - 1
    clearance, ends = np.full((len(poses), count), limit), np.full(len(poses), np.inf)
    hits, found = np.empty(3 * (count + 1) * len(poses), PAIR), 0
    for body in range(len(poses)):
        axes, centre = rotation(poses[body]), row(poses, body)
        if kinds[body] == PLANE:
            found = _search_plane(nodes, body, centre, axes[2], limit, hits, found)
            continue
        low, high = ahead(centre, axes[2], -halves[body]), ahead(centre, axes[2], halves[body])
        reach = limit + radii[body]
        for segment in range(count):
            start, end = row(nodes, segment), row(nodes, segment + 1)
            if length(minus(ahead(start, minus(end, start), 0.5), centre)) > reach + halves[body] + 0.5 * length(minus(end, start)):
                continue
            kind = kinds[body]
            if kind == TUBE:
                near = _to_tube(start, end, centre, axes[2], halves[body], radii[body])
                clearance[body, segment] = min(limit, near)
            fraction, part = segment_segment(start, end, low, high)
            if kind == TUBE and not 0.0 < part < 1.0:
                ends[body] = min(ends[body], near)
                continue
            distance = _distance(start, end, fraction, low, high, part)
            if distance >= reach:
                continue
            if kind != TUBE:
                clearance[body, segment] = min(limit, distance)
            found = _add_pairs((start, end), (low, high), segment, body, kind, reach, hits, found)
    return hits[:found], clearance, ends


@leaf
def _add_pairs(
    piece: tuple[Triple, Triple],
    line: tuple[Triple, Triple],
    segment: int,
    body: int,
    kind: int,
    reach: float,
    hits: np.ndarray,
    found: int,
) -> int:
    """Pairs of one segment with one line; beside a parallel line both nodes. A node is reported once."""
    start, end = piece
    along, axis = minus(end, start), minus(line[1], line[0])
    sine = cross(along, axis)
    is_parallel = dot(axis, axis) > 0.0 and dot(sine, sine) <= PARALLEL * dot(along, along) * dot(axis, axis)
    fraction, part = segment_segment(start, end, line[0], line[1])
    for choice in range(3 if is_parallel else 1):
        if choice > 0:
            fraction = choice - 1.0
            part = dot(minus(ahead(start, along, fraction), line[0]), axis) / dot(axis, axis)
            part = part if kind == TUBE else min(max(part, 0.0), 1.0)
        fraction = 0.0 if fraction < SNAP else (1.0 if fraction > 1.0 - SNAP else fraction)
        is_beside = 0.0 < part < 1.0 or kind != TUBE
        is_new = not _is_known(hits, found, body, segment, fraction)
        if is_beside and is_new and _distance(start, end, fraction, line[0], line[1], part) < reach:
            place, point = ahead(start, along, fraction), ahead(line[0], axis, part)
            normal = minus(place, point)
            upward = normal if length(normal) >= CORE else _across(along, axis)
            size, feature = length(upward), (VERTEX if kind == BALL else EDGE)
            _write(hits, found, segment, fraction, body, feature, point, ahead(NO_DIRECTION, upward, 1.0 / size))
            hits[found].distance = length(normal) if length(normal) >= CORE else 0.0
            hits[found].is_crossing = length(normal) < CORE
            if feature == EDGE:
                hits[found].direction[0], hits[found].direction[1], hits[found].direction[2] = ahead(NO_DIRECTION, axis, 1.0 / length(axis))
            found += 1
    return found


@leaf
def _is_known(hits: np.ndarray, found: int, body: int, segment: int, fraction: float) -> bool:
    """Is a place among the last pairs of a body: on this segment, or as the last node of the one before?"""
    for other in range(max(found - 6, 0), found):
        if hits[other].body == body and hits[other].segment + hits[other].fraction == segment + fraction:
            return True
    return False


@leaf
def _search_plane(nodes: np.ndarray, body: int, centre: Triple, normal: Triple, limit: float, hits: np.ndarray, found: int) -> int:
    """Every node within reach of a half-space, or inside it. Nothing can pass it: it is known which side is which."""
    for node in range(len(nodes)):
        place = row(nodes, node)
        high = dot(minus(place, centre), normal)
        if high < limit:
            segment = min(node, len(nodes) - 2)
            _write(hits, found, segment, float(node - segment), body, FACE, ahead(place, normal, -high), normal)
            hits[found].distance, hits[found].is_crossing = high, False
            found += 1
    return found


@leaf
def _write(hits: np.ndarray, at: int, segment: int, fraction: float, body: int, feature: int, point: Triple, normal: Triple) -> None:
    hits[at].segment, hits[at].fraction, hits[at].body = segment, fraction, body
    hits[at].feature, hits[at].feature_id = feature, 0
    hits[at].point[0], hits[at].point[1], hits[at].point[2] = point
    hits[at].normal[0], hits[at].normal[1], hits[at].normal[2] = normal
    hits[at].direction[0], hits[at].direction[1], hits[at].direction[2] = NO_DIRECTION


@leaf
def _distance(start: Triple, end: Triple, fraction: float, low: Triple, high: Triple, part: float) -> float:
    return length(minus(ahead(start, minus(end, start), fraction), ahead(low, minus(high, low), part)))


@leaf
def _across(along: Triple, axis: Triple) -> Triple:
    """A direction square to a segment, and to a line where there is one."""
    square = cross(along, axis)
    if dot(square, square) > 0.0:
        return square
    square = cross(along, (0.0, 1.0, 0.0))
    return square if dot(square, square) > 1e-6 * dot(along, along) else cross(along, (1.0, 0.0, 0.0))


@leaf
def _point_tube(point: Triple, centre: Triple, axis: Triple, half: float, radius: float) -> float:
    """Distance of a point to a solid cylinder with flat ends; inside, minus that to its side."""
    away = minus(point, centre)
    high = dot(away, axis)
    beside = length(ahead(away, axis, -high)) - radius
    over = abs(high) - half
    if over <= 0.0:
        return beside
    return float((over * over + max(beside, 0.0) ** 2) ** 0.5)


@leaf
def _to_tube(start: Triple, end: Triple, centre: Triple, axis: Triple, half: float, radius: float) -> float:
    """Least distance of a segment to a solid cylinder with flat ends."""
    along, low, high = minus(end, start), 0.0, 1.0
    least = min(_point_tube(start, centre, axis, half, radius), _point_tube(end, centre, axis, half, radius))
    for _ in range(SECTIONS):
        first, last = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        at_first = _point_tube(ahead(start, along, first), centre, axis, half, radius)
        at_last = _point_tube(ahead(start, along, last), centre, axis, half, radius)
        least = min(least, at_first, at_last)
        if at_first < at_last:
            high = last
        else:
            low = first
    return least
