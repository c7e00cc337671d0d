"""Lists of what is near each segment of a cable, valid while nothing moved further than a skin (Verlet 1967).

Most of a search is spent on triangles that have nothing to say: a walk down the tree finds all within the limit, and few of
them hold a place that a segment is closest to. The lists keep, for each segment and surface, the triangles that may have something to
say as long as both ends of the segment stay in their boxes, cubes around where they were when the list was made, a skin from middle
to side. The boxes are in the frame of the body, so it does not matter whether cable or body moves. With each triangle stands which
of its features may be touched by a segment whose ends are in the boxes, where

    g(p) = n . p - o   is between min g(m) - r and max g(m) + r over both middles m,   r = sum_i |n_i| half_i     [m]

A feature is ruled out if a plane of its normal cone, or of its sides, says no for all such segments, or if it is further away than
the limit. The search itself would have said no to it for every one of them; what is kept is tested there as ever, in the same
order. So a list changes no bit of a result, only how long it takes to get there.

There are two lists. The wide one is made by a walk down the tree. The next search that finds it still good makes a narrow one out of
it, for a smaller skin: it names half as many features, and holds for the rounds of one step, in which little moves.

A segment that leaves its boxes, or that is looked at further than before, gets a new list; so has every segment of a cable with
another number of nodes. Where more triangles are near than a list has room for, the walk is done every time.

Source:
    Verlet 1967, "Computer experiments on classical fluids. I", Phys. Rev. 159, 98 (the list of neighbours).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from .distances import Triple, ahead, dot, leaf, length, minus, row
from .surface import Features, edge_end, plane_normal
from .tree import gather

WIDE, NARROW = 0, 1
SKINS: Final = (1e-3, 2e-4)  # m, of both
LOW, HIGH, LIMIT = 0, 3, 12  # rows of `Lists.boxes`: the first end's, 6 more are the second's; and the distance looked at
ROOM: Final = 128  # triangles in a list
SLACK: Final = 1e-8  # m, by which a test must fail to rule out anything; rounding, and the tolerances of the search, are far below
FACE_BIT, FIRST_EDGE, FIRST_VERTEX = 1, 2, 16  # features of a triangle; twice as much for the next side or corner
ALL: Final = 127


class Lists(NamedTuple):
    """Both lists, wide and narrow, for every surface and segment, in arrays that the search writes to."""

    boxes: np.ndarray  # (2, b, 13, n-1) m, least and greatest place of both ends in the frame of the body, and the limit
    counts: np.ndarray  # (2, b, n-1) int, how many triangles; -1 if they are too many
    names: np.ndarray  # (2, b, n-1, 2, ROOM) int, the triangles, and which of their features


class Tree(NamedTuple):
    """The tree of one surface, and room for what is found in it."""

    boxes: np.ndarray  # (., 6) m
    depth: int
    triangles: tuple[int, int]  # the first, and how many
    near: np.ndarray  # (t,) int, triangles found
    stack: np.ndarray  # (64,) int


class Region(NamedTuple):
    """Where a segment may be."""

    start: Triple  # m, middle of the box of its first end
    start_half: Triple  # m, from there to the sides
    end: Triple
    end_half: Triple
    low: Triple  # m, least corner of what holds both boxes
    high: Triple
    limit: float  # m


def lists(bodies: int, segments: int) -> Lists:
    """Lists in which nothing stands yet."""
    boxes, counts = np.full((2, bodies, LIMIT + 1, segments), -np.inf), np.zeros((2, bodies, segments), dtype=np.int64)
    # Not filled, so that they cost nothing until they are written to.
    return Lists(boxes, counts, np.empty((2, bodies, segments, 2, ROOM), dtype=np.int32))


def no_lists() -> Lists:
    """A search that keeps none."""
    return lists(0, 0)


@leaf
def which_hold(
    boxes: np.ndarray, level: int, body: int, places: np.ndarray, limit: float, first: int, last: int, holds: np.ndarray
) -> None:
    """Write to `holds` (n-1,) of the segments from first to last whether their lists hold for nodes at `places` (3, n) [m]."""
    for segment in range(first, last):
        is_in = limit <= boxes[level, body, LIMIT, segment]
        for axis in range(3):
            start, end = places[axis, segment], places[axis, segment + 1]
            is_in &= (boxes[level, body, axis, segment] <= start) & (start <= boxes[level, body, HIGH + axis, segment])
            is_in &= (boxes[level, body, 6 + axis, segment] <= end) & (end <= boxes[level, body, 6 + HIGH + axis, segment])
        holds[segment] = is_in


@leaf
def renew(
    known: Lists, features: Features, tree: Tree, body: int, segment: int, places: np.ndarray, limit: float, holds: np.ndarray
) -> tuple[int, int]:
    """Make a list of a segment anew, the narrow one if the wide one holds; return which, and how many triangles stand in it."""
    boxes, counts = known.boxes, known.counts
    which_hold(boxes, WIDE, body, places, limit, segment, segment + 1, holds)
    is_narrow = holds[segment]
    level, skin, far = (NARROW, SKINS[NARROW], limit + SKINS[NARROW]) if is_narrow else (WIDE, SKINS[WIDE], limit + SKINS[WIDE])
    for tip in range(2):
        for axis in range(3):
            low, high = 6 * tip + axis, 6 * tip + HIGH + axis
            place = places[axis, segment + tip]
            boxes[level, body, low, segment] = max(place - skin, boxes[WIDE, body, low, segment]) if is_narrow else place - skin
            boxes[level, body, high, segment] = min(place + skin, boxes[WIDE, body, high, segment]) if is_narrow else place + skin
    boxes[level, body, LIMIT, segment] = min(far, boxes[WIDE, body, LIMIT, segment]) if is_narrow else far
    near = tree.near
    if is_narrow:
        found = counts[WIDE, body, segment]
        for place in range(found):
            near[place] = known.names[WIDE, body, segment, 0, place]
    else:
        # Around the segment by skin and limit: all leaves that a walk from inside the boxes can find.
        start, end = column(places, segment), column(places, segment + 1)
        found = gather(tree.boxes, tree.depth, start, end, limit + 2.0 * skin + SLACK, tree.triangles, near, tree.stack)
    region = _region(boxes, level, body, segment)
    counts[level, body, segment] = _list(known.names, level, features, near, body, segment, region, found) if found > 0 else found
    return level, int(counts[level, body, segment])


@leaf
def column(places: np.ndarray, index: int) -> Triple:
    """Column of a (3, n) array as a triple."""
    return (places[0, index], places[1, index], places[2, index])


@leaf
def _region(boxes: np.ndarray, level: int, body: int, segment: int) -> Region:
    low_start, high_start = _corner(boxes, level, body, segment, LOW), _corner(boxes, level, body, segment, HIGH)
    low_end, high_end = _corner(boxes, level, body, segment, 6 + LOW), _corner(boxes, level, body, segment, 6 + HIGH)
    start_half, end_half = minus(high_start, low_start), minus(high_end, low_end)
    return Region(
        ahead(low_start, start_half, 0.5),
        (0.5 * start_half[0], 0.5 * start_half[1], 0.5 * start_half[2]),
        ahead(low_end, end_half, 0.5),
        (0.5 * end_half[0], 0.5 * end_half[1], 0.5 * end_half[2]),
        (min(low_start[0], low_end[0]), min(low_start[1], low_end[1]), min(low_start[2], low_end[2])),
        (max(high_start[0], high_end[0]), max(high_start[1], high_end[1]), max(high_start[2], high_end[2])),
        boxes[level, body, LIMIT, segment] + SLACK,
    )


@leaf
def _corner(boxes: np.ndarray, level: int, body: int, segment: int, first: int) -> Triple:
    return (boxes[level, body, first, segment], boxes[level, body, first + 1, segment], boxes[level, body, first + 2, segment])


@leaf
def _list(names: np.ndarray, level: int, features: Features, near: np.ndarray, body: int, segment: int, region: Region, found: int) -> int:
    """Write those of the triangles found that may matter; return how many, -1 if there is no room for them."""
    count = 0
    for triangle in near[:found]:
        mask = _mask(features, triangle, region)
        if mask == 0:
            continue
        if count == ROOM:
            return -1
        names[level, body, segment, 0, count], names[level, body, segment, 1, count] = triangle, mask
        count += 1
    return count


@leaf
def _mask(features: Features, triangle: int, region: Region) -> int:
    """Which features of a triangle may be touched from a region."""
    planes, limit = features.planes, region.limit
    start_low, start_high = _range(planes, triangle, 0, region.start, region.start_half)
    end_low, end_high = _range(planes, triangle, 0, region.end, region.end_half)
    low, high = min(start_low, end_low), max(start_high, end_high)
    if low >= limit or high <= -limit:
        return 0
    is_under_start, is_under_end = start_low < limit and start_high > -limit, end_low < limit and end_high > -limit
    is_crossed = low <= SLACK and high >= -SLACK
    for side in range(1, 4):
        _, at_start = _range(planes, triangle, side, region.start, region.start_half)
        _, at_end = _range(planes, triangle, side, region.end, region.end_half)
        if max(at_start, at_end) <= -limit:
            return 0
        is_under_start &= at_start >= -SLACK
        is_under_end &= at_end >= -SLACK
        is_crossed &= max(at_start, at_end) >= -SLACK
    mask = FACE_BIT if is_under_start or is_under_end or is_crossed else 0
    for side in range(3):
        edge, vertex = features.own_edges[triangle, side], features.own_vertices[triangle, side]
        if edge >= 0 and _may_touch_edge(features, edge, region):
            mask |= FIRST_EDGE << side
        if vertex >= 0 and _may_touch_vertex(features, vertex, region):
            mask |= FIRST_VERTEX << side
    return mask


@leaf
def _range(planes: np.ndarray, triangle: int, side: int, middle: Triple, half: Triple) -> tuple[float, float]:
    """Least and greatest height [m] over a plane of a triangle inside a box."""
    normal = plane_normal(planes, triangle, side)
    at, spread = dot(normal, middle) - planes[triangle, side, 3], _spread(normal, half)
    return at - spread, at + spread


@leaf
def _spread(normal: Triple, half: Triple) -> float:
    return abs(normal[0]) * half[0] + abs(normal[1]) * half[1] + abs(normal[2]) * half[2]


@leaf
def _least(normal: Triple, offset: float, region: Region) -> float:
    """Least n . p - o [m] of a segment in the region."""
    at_start = dot(normal, region.start) - _spread(normal, region.start_half)
    return min(at_start, dot(normal, region.end) - _spread(normal, region.end_half)) - offset


@leaf
def _may_touch_edge(features: Features, edge: int, region: Region) -> bool:
    """Whether a point of a segment in the region may be within the limit of an edge, and in its normal cone.

    Besides each plane of the cone their sum is tested: it rules out the edges of a hollow.
    """
    low, high = edge_end(features.edge_ends, edge, 0), edge_end(features.edge_ends, edge, 1)
    apart = 0.0
    for axis in range(3):
        apart += max(min(low[axis], high[axis]) - region.high[axis], region.low[axis] - max(low[axis], high[axis]), 0.0) ** 2
    if apart > region.limit**2:
        return False
    # Between the planes square to it at its ends.
    along = minus(high, low)
    back, size = (-along[0], -along[1], -along[2]), length(along)
    if _least(along, dot(along, high), region) > SLACK * size or _least(back, dot(back, low), region) > SLACK * size:
        return False
    normal, offset, first, last = (0.0, 0.0, 0.0), 0.0, features.edge_first[edge], features.edge_first[edge + 1]
    for index in range(first, last):
        plane, at = row(features.edge_planes, index), features.edge_planes[index, 3]
        if _least(plane, at, region) > SLACK:
            return False
        normal, offset = ahead(normal, plane, 1.0), offset + at
    return bool(_least(normal, offset, region) <= (last - first) * SLACK)


@leaf
def _may_touch_vertex(features: Features, vertex: int, region: Region) -> bool:
    """Whether a point of a segment in the region may be within the limit of a vertex, and in its normal cone."""
    point, apart = row(features.vertices, vertex), 0.0
    for axis in range(3):
        apart += max(point[axis] - region.high[axis], region.low[axis] - point[axis], 0.0) ** 2
    if apart > region.limit**2:
        return False
    for index in range(features.vertex_first[vertex], features.vertex_first[vertex + 1]):
        along = row(features.vertex_along, index)
        if _least(along, dot(along, point), region) > SLACK:
            return False
    return True
