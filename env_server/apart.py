"""Whether two strands surely stay apart on their way from one shape to the next: each pair of their segments has a plane between them.

How far a segment may go without a look (`self_boundary`, `crossed`) is bounded by its distance to others, whichever way it goes. Cables
that slide on each other go far along each other, and hardly closer. Nodes go straight, so that of a direction n and two segments

    n . (a(t) - b(t)) = (1 - t) n . (a(0) - b(0)) + t n . (a(1) - b(1)),   a and b being ends of either,

and a height above zero for all four pairs of ends at the start and at the end is one all the way. Tried are the directions between
the nearest places of the segments at the start, at the end, halfway between these, and that at the start square to how they pass.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from protocol.messages import Shape

from .distances import Triple, ahead, dot, fixed, leaf, length, minus, row
from .self_touch import between, nearest


class Way(NamedTuple):
    """A cable before and after, on the same nodes."""

    before: np.ndarray  # (n, 3) m
    after: np.ndarray  # (n, 3) m
    s: np.ndarray  # (n,) m, arc length of the nodes


def way_of(before: Shape, after: Shape) -> Way | None:
    """Of a cable from one shape to another; None if they are on other nodes."""
    if not np.array_equal(before.s, after.s):
        return None
    return Way(fixed(before.nodes), fixed(after.nodes), fixed(before.s))


def may_go(first: Way | None, second: Way | None, radius: float, *, is_own: bool) -> bool:
    """Whether cables, or strands of one, of a mean radius [m] surely come no nearer to each other than half of touching."""
    return first is not None and second is not None and bool(stay_apart(first, second, is_own, math.pi * radius, radius))


@leaf
def stay_apart(first: Way, second: Way, is_own: bool, apart: float, least: float) -> bool:
    """Whether no two segments, one of each cable, come surely nearer than `least` [m] to each other.

    With `is_own` they are of one cable, and those nearer along it than `apart` [m] may be as near as they like.
    """
    for i in range(len(first.s) - 1):
        for j in range(i + 2 if is_own else 0, len(second.s) - 1):
            if is_own and second.s[j + 1] - first.s[i] <= apart:
                continue
            if _may_meet(first.before, first.after, i, second.before, second.after, j, least) and not _has_plane(
                first, second, i, j, least
            ):
                return False
    return True


@leaf
def _may_meet(before: np.ndarray, after: np.ndarray, i: int, others: np.ndarray, others_after: np.ndarray, j: int, least: float) -> bool:
    """Whether two segments may come as near as `least` [m], by how far apart they are and how far each goes."""
    room, square = least, 0.0
    for k in range(3):
        square += (0.5 * (before[i, k] + before[i + 1, k] - others[j, k] - others[j + 1, k])) ** 2
    for nodes, then, at in ((before, after, i), (others, others_after, j)):
        start, end = row(nodes, at), row(nodes, at + 1)
        room += 0.5 * length(minus(end, start)) + max(length(minus(row(then, at), start)), length(minus(row(then, at + 1), end)))
    return square < room * room


@leaf
def _has_plane(first: Way, second: Way, i: int, j: int, least: float) -> bool:
    start, end = _direction(first.before, i, second.before, j), _direction(first.after, i, second.after, j)
    past = minus(between(first.after, i, 0.5, second.after, j, 0.5), between(first.before, i, 0.5, second.before, j, 0.5))
    square = dot(past, past)
    aside = ahead(start, past, -dot(start, past) / square) if square > 0.0 else start
    for trial in range(4):
        n = aside if trial == 0 else (ahead(start, end, 1.0) if trial == 1 else (start if trial == 2 else end))
        size = length(n)
        if size > 0.0 and min(_height(first.before, i, second.before, j, n), _height(first.after, i, second.after, j, n)) >= least * size:
            return True
    return False


@leaf
def _direction(nodes: np.ndarray, i: int, others: np.ndarray, j: int) -> Triple:
    """Unit vector between the nearest places of two segments, to the first; zero where they meet."""
    t, u = nearest(nodes, i, 0.0, 1.0, others, j)
    d = between(nodes, i, t, others, j, u)
    size = length(d)
    return (d[0] / size, d[1] / size, d[2] / size) if size > 0.0 else (0.0, 0.0, 0.0)


@leaf
def _height(nodes: np.ndarray, i: int, others: np.ndarray, j: int, n: Triple) -> float:
    """Least height along n of an end of the first segment over one of the second."""
    least = math.inf
    for a in range(2):
        for b in range(2):
            least = min(least, dot(minus(row(nodes, i + a), row(others, j + b)), n))
    return least
