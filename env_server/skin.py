"""Lists of what is near each segment of a cable, valid while nothing moved further than a skin (Verlet 1967).

Most of a search is spent on triangles that have nothing to say: a walk down the tree finds all within the limit, and few of
them hold a place that a segment is closest to. The lists keep, for each segment and surface, the triangles that may have something to
say as long as the segment stays inside a box, by a skin larger than the segment was when the list was made. The box is in the
frame of the body, so it does not matter whether cable or body moves. With each triangle stands which of its features may be
touched from inside the box, where

    g(p) = n . p - o   is between g(middle) - r and g(middle) + r,   r = sum_i |n_i| half_i     [m]

A feature is ruled out if a plane of its normal cone, or of its sides, says no in the whole box, or if it is further away than
the limit. The search itself would have said no to it for every segment inside the box; what is kept is tested there as ever, and
the leaf of its triangle by the same comparison as in the walk, in the same order. So a list changes no bit of a result, only how
long it takes to get there.

A segment that leaves its box, or that is looked at further than before, gets a new list; so has every segment of a cable with
another number of nodes. Where more triangles are near than a list has room for, the walk is done every time.

Source:
    Verlet 1967, "Computer experiments on classical fluids. I", Phys. Rev. 159, 98 (the list of neighbours).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from .distances import Triple, kernel, length, minus, point_box, row
from .surface import Features
from .tree import gather, meets

SKIN: Final = 1e-3  # m
FURTHER: Final = 1e-3  # m, by which lists are made for more than the limit, which changes from step to step
ROOM: Final = 128  # triangles in a list
SLACK: Final = 1e-8  # m, by which a test must fail to rule out anything; rounding, and the tolerances of the search, are far below
FACE_BIT, FIRST_EDGE, FIRST_VERTEX = 1, 2, 16  # features of a triangle; twice as much for the next side or corner
ALL: Final = 127


class Lists(NamedTuple):
    """For every surface and segment, in arrays that the search writes to."""

    boxes: np.ndarray  # (b, n-1, 6) m, least and greatest corner in the frame of the body; empty where nothing is listed
    limits: np.ndarray  # (b, n-1) m, distance up to which a list holds
    counts: np.ndarray  # (b, n-1) int, triangles; -1 if they are too many
    triangles: np.ndarray  # (b, n-1, ROOM) int
    leaves: np.ndarray  # (b, n-1, ROOM) int, in which they are
    masks: np.ndarray  # (b, n-1, ROOM) int, which of their features may be touched


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
    each = (bodies, segments)
    boxes = np.concatenate([np.full((*each, 3), np.inf), np.full((*each, 3), -np.inf)], axis=2)
    room = (np.empty((*each, ROOM), dtype=np.int32) for _ in range(3))
    return Lists(boxes, np.zeros(each), np.full(each, -1), *room)


def no_lists() -> Lists:
    """A search that keeps none."""
    return lists(0, 0)


@kernel
def holds(boxes: np.ndarray, limits: np.ndarray, body: int, segment: int, start: Triple, end: Triple, limit: float) -> bool:
    """Does the list of a segment, with its box and limit in `Lists`, hold for the segment from start to end?"""
    # No view of an array where a number does: views count references with atomic instructions.
    if limit > limits[body, segment]:
        return False
    for axis in range(3):
        if boxes[body, segment, axis] > min(start[axis], end[axis]) or max(start[axis], end[axis]) > boxes[body, segment, axis + 3]:
            return False
    return True


@kernel
def renew(known: Lists, features: Features, tree: Tree, body: int, segment: int, start: Triple, end: Triple, limit: float) -> None:
    """Make the list of a segment anew."""
    boxes = known.boxes
    for axis in range(3):
        boxes[body, segment, axis] = min(start[axis], end[axis]) - SKIN
        boxes[body, segment, axis + 3] = max(start[axis], end[axis]) + SKIN
    known.limits[body, segment] = limit + FURTHER
    # Around the segment by skin and limit: all leaves that a walk from inside the box can find.
    found = gather(tree.boxes, tree.depth, start, end, limit + FURTHER + SKIN + SLACK, tree.triangles, tree.near, tree.stack)
    known.counts[body, segment] = _list(known, features, tree, body, segment, found)


@kernel
def _list(known: Lists, features: Features, tree: Tree, body: int, segment: int, found: int) -> int:
    """Write those of the triangles found that may matter; return how many, -1 if there is no room for them."""
    box, limit, count = known.boxes[body, segment], known.limits[body, segment] + SLACK, 0
    middle = (0.5 * (box[0] + box[3]), 0.5 * (box[1] + box[4]), 0.5 * (box[2] + box[5]))
    half = (0.5 * (box[3] - box[0]), 0.5 * (box[4] - box[1]), 0.5 * (box[5] - box[2]))
    for triangle in tree.near[:found]:
        planes, is_over = features.planes[triangle], True
        low, high = _range(planes[0], middle, half)
        may_matter, is_crossed = low < limit and high > -limit, low <= SLACK and high >= -SLACK
        for side in range(1, 4):
            _, highest = _range(planes[side], middle, half)
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
        known.triangles[body, segment, count] = triangle
        # Leaf j holds the triangles from j t >> depth on: the inverse of that.
        known.leaves[body, segment, count] = (((triangle - tree.triangles[0] + 1) << tree.depth) - 1) // tree.triangles[1]
        known.masks[body, segment, count] = mask
        count += 1
    return count


@kernel
def _range(plane: np.ndarray, middle: Triple, half: Triple) -> tuple[float, float]:
    """Least and greatest height [m] over a plane (4,) inside a box."""
    at = plane[0] * middle[0] + plane[1] * middle[1] + plane[2] * middle[2] - plane[3]
    spread = abs(plane[0]) * half[0] + abs(plane[1]) * half[1] + abs(plane[2]) * half[2]
    return at - spread, at + spread


@kernel
def _may_touch_edge(features: Features, edge: int, box: np.ndarray, middle: Triple, half: Triple, limit: float) -> bool:
    """Whether a point of the box may be within the limit of an edge, and in its normal cone.

    Besides each plane of the cone their sum is tested: it rules out the edges of a hollow.
    """
    low, high = row(features.edge_ends[edge], 0), row(features.edge_ends[edge], 1)
    centre = (0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2]))
    if point_box(centre, box) > limit + 0.5 * length(minus(high, low)):
        return False
    total, count = np.zeros(4), 0
    for index in range(features.edge_first[edge], features.edge_first[edge + 1]):
        total += features.edge_planes[index]
        count += 1
        if _range(features.edge_planes[index], middle, half)[0] > SLACK:
            return False
    return _range(total, middle, half)[0] <= count * SLACK


@kernel
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


@kernel
def gather_listed(known: Lists, tree: Tree, body: int, segment: int, start: Triple, end: Triple, limit: float) -> int:
    """What matters of that which `gather` finds, from the list of a segment, with masks."""
    found, leaf, is_met, first_leaf = 0, -1, False, (1 << tree.depth) - 1
    low = (min(start[0], end[0]) - limit, min(start[1], end[1]) - limit, min(start[2], end[2]) - limit)
    high = (max(start[0], end[0]) + limit, max(start[1], end[1]) + limit, max(start[2], end[2]) + limit)
    for place in range(known.counts[body, segment]):
        if known.leaves[body, segment, place] != leaf:
            leaf = known.leaves[body, segment, place]
            is_met = meets(tree.boxes, first_leaf + leaf, low, high)
        if is_met:
            tree.near[found], tree.masks[found] = known.triangles[body, segment, place], known.masks[body, segment, place]
            found += 1
    return found
