"""Where a cable touches itself or another one, or may do so soon: local minima of the distance of segments from each other.

Two places x < y of one polyline axis, or x of one and y of another, with D = r(x) - r(y), d = |D|, gap = d less both radii and normal
n = D / d. For the cell of every node, from half a segment before it to half a segment after, is reported the place x within it and the
place y for which d is least, for every local minimum along y (D . t >= 0 before y, <= 0 after it). At the ends of its cell x need be no
minimum along the cable: the shape server's row of a cell takes over from that of the next as two strands slide on each other, and strands
that lie side by side need them all.

Within each pair of half a segment and a segment d^2 is convex, so that no minimum is missed.

Left out is what lies nearer along one cable than pi radius. An axis that bends no tighter than its own radius has a chord of at least
2 r sin(a / 2 r) over an arc a up to pi r (Schur 1921): up to there it is a bend, and only beyond it can two places be a contact.

Segments are looked at in blocks with bounding spheres; the oracle in the tests looks at all pairs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from .distances import POINT, kernel, leaf

BLOCK: Final = 8  # segments
ONE: Final = 1.0  # segments, within which two places along y are one
INSIDE: Final = 1e-9  # segments
SLACK: Final = 1e-9  # of a cosine, within which a place at a node counts as a minimum


@dataclass(frozen=True, slots=True, eq=False)
class SelfCandidates:
    """Places where a cable may touch itself, in order along it; arrays are read-only."""

    place: np.ndarray  # (m, 2) segments from the start of the cable
    normal: np.ndarray  # (m, 3) unit, from the second place to the first
    gap: np.ndarray  # (m,) m
    clearance: np.ndarray  # (n-1,) m, distance of the axis of every segment to that of others, at most room and both radii
    other_clearance: np.ndarray  # (k-1,) m, that of every segment of the other cable; the same as `clearance` for one cable

    @property
    def penetration(self) -> float:
        """Deepest penetration [m] of the cable into itself."""
        return float(max(0.0, -self.gap.min(initial=0.0)))


def search(nodes: np.ndarray, s: np.ndarray, radius: float, reach: float, room: float) -> SelfCandidates:
    """Every place where a cable meets itself with a gap below `reach`.

    Args:
        nodes: (n, 3) [m] Polyline axis.
        s: (n,) [m] Arc length of the nodes.
        radius: [m] Of the cable.
        reach: [m] Largest gap that is reported.
        room: [m] Largest gap for which the clearance is known, no less than `reach`.
    """
    return _search(nodes, s, nodes, s, math.pi * radius, 2.0 * radius, reach, room)


def search_two(nodes: np.ndarray, others: np.ndarray, distance: float, reach: float, room: float) -> SelfCandidates:
    """Every place where a cable meets another one with a gap below `reach`.

    Args:
        nodes: (n, 3) [m] Polyline axis of the first.
        others: (k, 3) [m] Of the second.
        distance: [m] Of their axes when they touch: both radii.
        reach: [m] Largest gap that is reported.
        room: [m] Largest gap for which the clearance is known, no less than `reach`.
    """
    return _search(nodes, np.zeros(len(nodes)), others, np.ones(len(others)), 0.0, distance, reach, room)


def _search(
    nodes: np.ndarray, s: np.ndarray, others: np.ndarray, z: np.ndarray, apart: float, distance: float, reach: float, room: float
) -> SelfCandidates:
    is_own = others is nodes
    nodes, s = np.ascontiguousarray(nodes, dtype=np.float64), np.ascontiguousarray(s, dtype=np.float64)
    others, z = np.ascontiguousarray(others, dtype=np.float64), np.ascontiguousarray(z, dtype=np.float64)
    near, limit, most = distance + reach, distance + room, 64 + 4 * len(nodes)
    while True:
        place, away = np.empty((most, 2)), np.empty((most, 3))
        clearance = np.full(len(nodes) - 1, limit)
        beyond = clearance if is_own else np.full(len(others) - 1, limit)
        count = find_pairs(nodes, s, others, z, is_own, apart, near, limit, place, away, clearance, beyond)
        if count <= most:
            break
        most = 2 * count
    order = _one_of_each(place[:count], np.einsum("ij,ij->i", away[:count], away[:count]))
    size = np.sqrt(np.einsum("ij,ij->i", away[order], away[order]))
    normal = away[order] / np.maximum(size, 1e-300)[:, None]
    normal[size < 1e-12] = (0.0, 0.0, 1.0)
    found = SelfCandidates(place[order], normal, size - distance, clearance, beyond)
    for name in SelfCandidates.__slots__:
        getattr(found, name).setflags(write=False)
    return found


def _one_of_each(place: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Indices of the pairs in order along the cable; of those in one cell with places y within a segment of each other the nearest.

    A strand that winds about another one has a minimum in every segment beside the place where it is nearest.
    """
    cell, kept = np.round(place[:, 0]), list[int]()
    for row in np.argsort(size, kind="stable").tolist():
        if not any(cell[k] == cell[row] and abs(place[k, 1] - place[row, 1]) < ONE for k in kept):
            kept.append(row)
    order = np.array(kept, dtype=np.int64)
    return order[np.lexsort((place[order, 1], place[order, 0]))]


@kernel
def find_pairs(
    nodes: np.ndarray,
    s: np.ndarray,
    others: np.ndarray,
    z: np.ndarray,
    is_own: bool,
    apart: float,
    near: float,
    limit: float,
    place: np.ndarray,
    away: np.ndarray,
    clearance: np.ndarray,
    beyond: np.ndarray,
) -> int:
    """Pairs into `place` and `away` (D [m]) as far as there is room; how many there are. Lowers `clearance` and `beyond`.

    The second axis, `others` at arc lengths `z`, is the first where `is_own`: then each pair is looked at once.
    """
    first_middle, first_size = _blocks(nodes)
    second_middle, second_size = _blocks(others)
    count, more, found = len(nodes) - 1, len(others) - 1, 0
    for b in range(len(first_size)):
        for c in range(b if is_own else 0, len(second_size)):
            if _distance(first_middle[b], second_middle[c]) - first_size[b] - second_size[c] > limit:
                continue
            for i in range(BLOCK * b, min(BLOCK * (b + 1), count)):
                for j in range(max(BLOCK * c, i + 2) if is_own else BLOCK * c, min(BLOCK * (c + 1), more)):
                    if z[j + 1] - s[i] > apart:
                        found = _look_at(nodes, s, others, z, i, j, apart, near, limit, place, away, clearance, beyond, found)
    return found


@kernel
def _blocks(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centres (b, 3) and radii (b,) [m] of spheres about every few segments."""
    count = len(nodes) - 1
    blocks = (count + BLOCK - 1) // BLOCK
    centre, size = np.zeros((blocks, 3)), np.zeros(blocks)
    for b in range(blocks):
        first, last = BLOCK * b, min(BLOCK * (b + 1), count)
        for k in range(3):
            centre[b, k] = 0.5 * (nodes[first, k] + nodes[last, k])
        for node in range(first, last + 1):
            size[b] = max(size[b], _distance(centre[b], nodes[node]))
    return centre, size


@leaf
def _look_at(
    nodes: np.ndarray,
    s: np.ndarray,
    others: np.ndarray,
    z: np.ndarray,
    i: int,
    j: int,
    apart: float,
    near: float,
    limit: float,
    place: np.ndarray,
    away: np.ndarray,
    clearance: np.ndarray,
    beyond: np.ndarray,
    found: int,
) -> int:
    """Look at one pair of segments; how many pairs are found by now."""
    for half in range(2):
        t, u = nearest(nodes, i, 0.5 * half, 0.5 + 0.5 * half, others, j)
        d = between(nodes, i, t, others, j, u)
        size = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        arc = (1.0 - u) * z[j] + u * z[j + 1] - (1.0 - t) * s[i] - t * s[i + 1]
        if size > limit or arc <= apart:
            continue
        clearance[i], beyond[j] = min(clearance[i], size), min(beyond[j], size)
        if size < near and _is_least(others, j, u, d):
            if found < len(place):
                # Rounding may not take a place at the end of its cell to the next one.
                place[found, 0] = i + (max(t, 0.5 + INSIDE) if half else min(t, 0.5 - INSIDE))
                place[found, 1] = j + u
                away[found, 0], away[found, 1], away[found, 2] = d[0], d[1], d[2]
            found += 1
    return found


@leaf
def nearest(nodes: np.ndarray, i: int, low: float, high: float, others: np.ndarray, j: int) -> tuple[float, float]:
    """Fractions of the closest points of segment i, from `low` to `high` of it, and segment j of the others (Ericson 2005, 5.1.9)."""
    p0, p1, p2 = nodes[i + 1, 0] - nodes[i, 0], nodes[i + 1, 1] - nodes[i, 1], nodes[i + 1, 2] - nodes[i, 2]
    q0, q1, q2 = others[j + 1, 0] - others[j, 0], others[j + 1, 1] - others[j, 1], others[j + 1, 2] - others[j, 2]
    r0, r1, r2 = nodes[i, 0] - others[j, 0], nodes[i, 1] - others[j, 1], nodes[i, 2] - others[j, 2]
    pp, qq, pq = p0 * p0 + p1 * p1 + p2 * p2, q0 * q0 + q1 * q1 + q2 * q2, p0 * q0 + p1 * q1 + p2 * q2
    pr, qr = p0 * r0 + p1 * r1 + p2 * r2, q0 * r0 + q1 * r1 + q2 * r2
    if pp < POINT or qq < POINT:
        return low, min(max((qr + low * pq) / qq, 0.0), 1.0) if qq >= POINT else 0.0
    square = pp * qq - pq * pq
    t = min(max((pq * qr - pr * qq) / square, low), high) if square > 1e-12 * pp * qq else low
    u = (pq * t + qr) / qq
    if u < 0.0:
        return min(max(-pr / pp, low), high), 0.0
    if u > 1.0:
        return min(max((pq - pr) / pp, low), high), 1.0
    return t, u


@leaf
def between(nodes: np.ndarray, i: int, t: float, others: np.ndarray, j: int, u: float) -> tuple[float, float, float]:
    """D [m], from the second place to the first."""
    return (
        (1.0 - t) * nodes[i, 0] + t * nodes[i + 1, 0] - (1.0 - u) * others[j, 0] - u * others[j + 1, 0],
        (1.0 - t) * nodes[i, 1] + t * nodes[i + 1, 1] - (1.0 - u) * others[j, 1] - u * others[j + 1, 1],
        (1.0 - t) * nodes[i, 2] + t * nodes[i + 1, 2] - (1.0 - u) * others[j, 2] - u * others[j + 1, 2],
    )


@leaf
def _is_least(nodes: np.ndarray, i: int, t: float, d: tuple[float, float, float]) -> bool:
    """Whether a place on segment i, nearest there, is so on the neighbour too that begins at it."""
    if 0.0 < t < 1.0:
        return True
    other = i - 1 if t == 0.0 else i + 1
    if other < 0 or other >= len(nodes) - 1:
        return True
    along, square = 0.0, 0.0
    for k in range(3):
        step = nodes[other + 1, k] - nodes[other, k]
        along -= d[k] * step
        square += step * step
    slack = SLACK * math.sqrt(square * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]))
    return along <= slack if t == 0.0 else along >= -slack


@leaf
def _distance(a: np.ndarray, b: np.ndarray) -> float:
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)
