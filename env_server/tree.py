"""The tree of bounding boxes over the triangles of a surface, the walk down it, and spheres around a cable.

It is complete and binary, split at the median of the longest side. Node i has the children 2i+1 and 2i+2, and leaf j of
2^depth holds the triangles from j t >> depth to (j+1) t >> depth: no pointers.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from .distances import Triple, ahead, kernel, leaf, length, minus, row

LEAF_SIZE: Final = 4  # triangles in a leaf of the tree, at most
BLOCK: Final = 8  # segments of a cable that share a bounding sphere


def grown(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Sort boxes (t, 3) into a tree: their order, the boxes of its nodes (., 6), and its depth."""
    count = len(low)
    depth = max(0, int(np.ceil(np.log2(count / LEAF_SIZE))))
    order, middles = np.arange(count), low + high
    for level in range(depth):
        first = _group_starts(count, level)
        group = np.repeat(np.arange(2**level), np.diff(first, append=count))
        here = middles[order]
        least, most = np.minimum.reduceat(here, first), np.maximum.reduceat(here, first)
        axis = np.argmax(most - least, axis=1)
        start = least[np.arange(2**level), axis]
        extent = np.maximum((most - least).max(axis=1), 1e-300)
        within = (here[np.arange(count), axis[group]] - start[group]) / extent[group]
        order = order[np.argsort(group + 0.5 * within, kind="stable")]
    first = _group_starts(count, depth)
    levels = [np.hstack([np.minimum.reduceat(low[order], first), np.maximum.reduceat(high[order], first)])]
    while len(levels[0]) > 1:
        left, right = levels[0][::2], levels[0][1::2]
        levels.insert(0, np.hstack([np.minimum(left[:, :3], right[:, :3]), np.maximum(left[:, 3:], right[:, 3:])]))
    return order, np.vstack(levels), depth


def _group_starts(count: int, level: int) -> np.ndarray:
    return (np.arange(2**level) * count) >> level


@leaf
def meets(boxes: np.ndarray, node: int, low: Triple, high: Triple) -> bool:
    """Does a node of the tree share a point with the box from corner `low` to corner `high`?"""
    if boxes[node, 0] > high[0] or boxes[node, 1] > high[1] or boxes[node, 2] > high[2]:
        return False
    return bool(boxes[node, 3] >= low[0] and boxes[node, 4] >= low[1] and boxes[node, 5] >= low[2])


@leaf
def fill(leaf: int, depth: int, triangles: tuple[int, int], near: np.ndarray, found: int) -> int:
    """Write the triangles of a leaf after the first `found`; return how many there are now."""
    for triangle in range((leaf * triangles[1]) >> depth, ((leaf + 1) * triangles[1]) >> depth):
        near[found] = triangles[0] + triangle
        found += 1
    return found


@leaf
def gather(
    boxes: np.ndarray, depth: int, start: Triple, end: Triple, limit: float, triangles: tuple[int, int], near: np.ndarray, stack: np.ndarray
) -> int:
    """Write the triangles of all leaves closer than `limit` to a segment into `near` (t,); return how many.

    `boxes` is the tree of one surface, `triangles` the number of its first triangle and their count, `stack` (64,) room to work.
    """
    stack[0], waiting, found, leaf_count = 0, 1, 0, 1 << depth
    low = (min(start[0], end[0]) - limit, min(start[1], end[1]) - limit, min(start[2], end[2]) - limit)
    high = (max(start[0], end[0]) + limit, max(start[1], end[1]) + limit, max(start[2], end[2]) + limit)
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        if not meets(boxes, node, low, high):
            continue
        if node < leaf_count - 1:
            stack[waiting], stack[waiting + 1] = 2 * node + 1, 2 * node + 2
            waiting += 2
            continue
        found = fill(node - leaf_count + 1, depth, triangles, near, found)
    return found


@kernel
def bounding_spheres(nodes: np.ndarray) -> np.ndarray:
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
