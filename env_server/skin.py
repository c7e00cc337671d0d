"""Lists of what is near each segment of a cable, valid while nothing moved further than a skin (Verlet 1967).

Most of a search is spent on triangles that have nothing to say: a walk down the tree finds all within the limit, and few of
them hold a place that a segment is closest to. The lists keep, for each segment and surface, the triangles that may have something to
say as long as the segment stays inside a box, by a skin larger than the segment was when the list was made. The box is in the
frame of the body, so it does not matter whether cable or body moves. With each triangle stands which of its features may be
touched from inside the box, where

    g(p) = n . p - o   is between g(middle) - r and g(middle) + r,   r = sum_i |n_i| half_i     [m]

A feature is ruled out if a plane of its normal cone, or of its sides, says no in the whole box, or if it is further away than
the limit. The search itself would have said no to it for every segment inside the box; what is kept is tested there as ever, in the same
order. So a list changes no bit of a result, only how long it takes to get there.

There are two lists. The wide one is made by a walk down the tree. The next search that finds it still good makes a narrow one out of
it, for a smaller skin: it names half as many features, and holds for the rounds of one step, in which little moves.

A segment that leaves its box, or that is looked at further than before, gets a new list; so has every segment of a cable with
another number of nodes. Where more triangles are near than a list has room for, the walk is done every time.

Source:
    Verlet 1967, "Computer experiments on classical fluids. I", Phys. Rev. 159, 98 (the list of neighbours).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from .distances import Triple, ahead, dot, leaf, length, minus, point_box, row
from .surface import Features, edge_end, plane_normal
from .tree import gather

SKIN: Final = 1e-3  # m, of the wide lists
NARROW: Final = 2e-4  # m, of the narrow ones
ROOM: Final = 128  # triangles in a list
SLACK: Final = 1e-8  # m, by which a test must fail to rule out anything; rounding, and the tolerances of the search, are far below
FACE_BIT, FIRST_EDGE, FIRST_VERTEX = 1, 2, 16  # features of a triangle; twice as much for the next side or corner
ALL: Final = 127


LIST: Final = np.dtype([("box", np.float64, (6,)), ("limit", np.float64), ("count", np.int64)])
"""Whether the list of a segment holds: box [m] in the frame of the body, empty where nothing is listed, and distance [m]; how many
triangles, -1 if they are too many."""


class Lists(NamedTuple):
    """Both lists for every surface and segment, in arrays that the search writes to; which triangles, and which of their features."""

    wide: np.ndarray  # (b, n-1) of `LIST`
    narrow: np.ndarray  # (b, n-1) of `LIST`
    wide_names: np.ndarray  # (b, n-1, ROOM, 2) int, triangle and mask
    narrow_names: np.ndarray  # (b, n-1, ROOM, 2) int


class Tree(NamedTuple):
    """The tree of one surface, and room for what is found in it."""

    boxes: np.ndarray  # (., 6) m
    depth: int
    triangles: tuple[int, int]  # the first, and how many
    near: np.ndarray  # (t,) int, triangles found
    masks: np.ndarray  # (ROOM,) int, which of their features may be touched, where they come from a list
    stack: np.ndarray  # (64,) int


def lists(bodies: int, segments: int) -> Lists:
    """Lists in which nothing stands yet."""
    empty = np.zeros((bodies, segments), dtype=LIST)
    empty["box"] = [np.inf, np.inf, np.inf, -np.inf, -np.inf, -np.inf]
    # Not filled, so that they cost nothing until they are written to.
    names = (np.empty((bodies, segments, ROOM, 2), dtype=np.int32) for _ in range(2))
    return Lists(empty.copy(), empty, *names)


def no_lists() -> Lists:
    """A search that keeps none."""
    return lists(0, 0)


@leaf
def holds(known: np.ndarray, body: int, segment: int, start: Triple, end: Triple, limit: float) -> bool:
    """Does the list of a segment hold for the segment from start to end?"""
    # No view of an array where a number does: views count references with atomic instructions.
    if limit > known[body, segment].limit:
        return False
    for axis in range(3):
        low, high = known[body, segment].box[axis], known[body, segment].box[axis + 3]
        if low > min(start[axis], end[axis]) or max(start[axis], end[axis]) > high:
            return False
    return True


@leaf
def recalled(known: np.ndarray, names: np.ndarray, body: int, segment: int, near: np.ndarray, masks: np.ndarray) -> int:
    """Copy the list of a segment, with its masks, and return how long it is; -1 where there is none."""
    found = known[body, segment].count
    for place in range(found):
        near[place], masks[place] = names[body, segment, place, 0], names[body, segment, place, 1]
    return int(found)


@leaf
def renew(known: Lists, features: Features, tree: Tree, body: int, segment: int, start: Triple, end: Triple, limit: float) -> int:
    """Make a list of a segment anew, the narrow one if the wide one holds, and copy it as `recalled` does."""
    wide = known.wide
    is_narrow = holds(wide, body, segment, start, end, limit)
    made, names, skin = (known.narrow, known.narrow_names, NARROW) if is_narrow else (wide, known.wide_names, SKIN)
    for axis in range(3):
        low, high = min(start[axis], end[axis]) - skin, max(start[axis], end[axis]) + skin
        made[body, segment].box[axis] = max(low, wide[body, segment].box[axis]) if is_narrow else low
        made[body, segment].box[axis + 3] = min(high, wide[body, segment].box[axis + 3]) if is_narrow else high
    if is_narrow:
        made[body, segment].limit = min(limit + skin, wide[body, segment].limit)
        found = recalled(wide, known.wide_names, body, segment, tree.near, tree.masks)
    else:
        made[body, segment].limit = limit + skin
        # Around the segment by skin and limit: all leaves that a walk from inside the box can find.
        found = gather(tree.boxes, tree.depth, start, end, limit + 2.0 * skin + SLACK, tree.triangles, tree.near, tree.stack)
    made[body, segment].count = _list(made, names, features, tree, body, segment, found) if found > 0 else found
    return recalled(made, names, body, segment, tree.near, tree.masks)


@leaf
def _list(known: np.ndarray, names: np.ndarray, features: Features, tree: Tree, body: int, segment: int, found: int) -> int:
    """Write those of the triangles found that may matter; return how many, -1 if there is no room for them."""
    box, limit, count = known[body, segment].box, known[body, segment].limit + SLACK, 0
    middle = (0.5 * (box[0] + box[3]), 0.5 * (box[1] + box[4]), 0.5 * (box[2] + box[5]))
    half = (0.5 * (box[3] - box[0]), 0.5 * (box[4] - box[1]), 0.5 * (box[5] - box[2]))
    for triangle in tree.near[:found]:
        is_over = True
        low, high = _range(plane_normal(features.planes, triangle, 0), features.planes[triangle, 0, 3], middle, half)
        may_matter, is_crossed = low < limit and high > -limit, low <= SLACK and high >= -SLACK
        for side in range(1, 4):
            _, highest = _range(plane_normal(features.planes, triangle, side), features.planes[triangle, side, 3], middle, half)
            may_matter &= highest > -limit
            is_over &= highest >= -SLACK
        if not may_matter:
            continue
        mask = FACE_BIT if is_over or is_crossed else 0
        for side in range(3):
            edge, vertex = features.own_edges[triangle, side], features.own_vertices[triangle, side]
            if edge >= 0 and _may_touch_edge(features, edge, box, middle, half, limit):
                mask |= FIRST_EDGE << side
            if vertex >= 0 and _may_touch_vertex(features, vertex, box, middle, half, limit):
                mask |= FIRST_VERTEX << side
        if mask == 0:
            continue
        if count == ROOM:
            return -1
        names[body, segment, count, 0], names[body, segment, count, 1] = triangle, mask
        count += 1
    return count


@leaf
def _range(normal: Triple, offset: float, middle: Triple, half: Triple) -> tuple[float, float]:
    """Least and greatest height [m] over a plane inside a box."""
    at, spread = dot(normal, middle) - offset, abs(normal[0]) * half[0] + abs(normal[1]) * half[1] + abs(normal[2]) * half[2]
    return at - spread, at + spread


@leaf
def _may_touch_edge(features: Features, edge: int, box: np.ndarray, middle: Triple, half: Triple, limit: float) -> bool:
    """Whether a point of the box may be within the limit of an edge, and in its normal cone.

    Besides each plane of the cone their sum is tested: it rules out the edges of a hollow.
    """
    low, high = edge_end(features.edge_ends, edge, 0), edge_end(features.edge_ends, edge, 1)
    apart = 0.0
    for axis in range(3):
        apart += max(min(low[axis], high[axis]) - box[axis + 3], box[axis] - max(low[axis], high[axis]), 0.0) ** 2
    if apart > limit**2:
        return False
    # Between the planes square to it at its ends, see `is_beside`.
    along, away = minus(high, low), minus(middle, low)
    size, at = length(along), dot(away, along)
    spread = abs(along[0]) * half[0] + abs(along[1]) * half[1] + abs(along[2]) * half[2]
    if at + spread < -SLACK * size or at - spread > (size + SLACK) * size:
        return False
    normal, offset, first, last = (0.0, 0.0, 0.0), 0.0, features.edge_first[edge], features.edge_first[edge + 1]
    for index in range(first, last):
        plane, at = row(features.edge_planes, index), features.edge_planes[index, 3]
        if _range(plane, at, middle, half)[0] > SLACK:
            return False
        normal, offset = ahead(normal, plane, 1.0), offset + at
    return bool(_range(normal, offset, middle, half)[0] <= (last - first) * SLACK)


@leaf
def _may_touch_vertex(features: Features, vertex: int, box: np.ndarray, middle: Triple, half: Triple, limit: float) -> bool:
    """Whether a point of the box may be within the limit of a vertex, and in its normal cone."""
    point = row(features.vertices, vertex)
    if point_box(point, box) > limit:
        return False
    arm = minus(middle, point)
    for index in range(features.vertex_first[vertex], features.vertex_first[vertex + 1]):
        along = row(features.vertex_along, index)
        spread = abs(along[0]) * half[0] + abs(along[1]) * half[1] + abs(along[2]) * half[2]
        if along[0] * arm[0] + along[1] * arm[1] + along[2] * arm[2] - spread > SLACK:
            return False
    return True
