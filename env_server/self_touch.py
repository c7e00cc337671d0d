"""Where a cable touches itself, or may do so soon: local minima of the distance of its segments from each other.

Two places x < y of one polyline axis, with D = r(x) - r(y), d = |D|, gap = d - 2 radius and normal n = D / d, are reported as

    crossing    both places are local minima over the polyline (D . t <= 0 before x, >= 0 after it; the reverse at y), and the
                segments do not run side by side (sine of the angle between them above 0.1)
    alongside   x is a node, y the nearest place for it on the other strand, a local minimum along y alone; both strands run side by
                side (sine below 0.3). Strands in line have no one nearest pair, and a row at every node of the earlier one

Within each pair of segments d^2 is convex, so the conditions at corners are exact, and no minimum is missed. Between 0.1 and 0.3 both
kinds are reported: what the nodes miss of the distance of strands that cross at 0.1 between two of them is (0.05 h)^2 / 2 d.

Left out is what lies nearer along the cable than pi radius. An axis that bends no tighter than its own radius has a chord of at least
2 r sin(a / 2 r) over an arc a up to pi r (Schur 1921): up to there it is a bend, and only beyond it can two places be a contact.

Segments are looked at in blocks with bounding spheres; the oracle in the tests looks at all pairs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from protocol.kinds import SelfTouch

from .distances import POINT, kernel

BLOCK: Final = 8  # segments
CROSSES, RUNS_ALONG = 0.1, 0.3  # sine of the angle between two segments
SLACK: Final = 1e-9  # of a cosine, within which a place at a node counts as a minimum


@dataclass(frozen=True, slots=True, eq=False)
class SelfCandidates:
    """Places where a cable may touch itself, in order along it; arrays are read-only."""

    place: np.ndarray  # (m, 2) segments from the start of the cable
    kind: np.ndarray  # (m,) int, a `SelfTouch`
    normal: np.ndarray  # (m, 3) unit, from the second place to the first
    gap: np.ndarray  # (m,) m
    clearance: np.ndarray  # (n-1,) m, distance of the axis of every segment to that of others, at most reach + 2 radius

    @property
    def penetration(self) -> float:
        """Deepest penetration [m] of the cable into itself."""
        return float(max(0.0, -self.gap.min(initial=0.0)))


def search(nodes: np.ndarray, s: np.ndarray, radius: float, reach: float) -> SelfCandidates:
    """Every place where a cable meets itself with a gap below `reach`.

    Args:
        nodes: (n, 3) [m] Polyline axis.
        s: (n,) [m] Arc length of the nodes.
        radius: [m] Of the cable.
        reach: [m] Largest gap that is reported.
    """
    nodes, s = np.ascontiguousarray(nodes, dtype=np.float64), np.ascontiguousarray(s, dtype=np.float64)
    apart, limit, room = math.pi * radius, 2.0 * radius + reach, 64 + 4 * len(nodes)
    while True:
        place, kind, away = np.empty((room, 2)), np.empty(room, dtype=np.int64), np.empty((room, 3))
        clearance = np.full(len(nodes) - 1, limit)
        count = find_pairs(nodes, s, apart, limit, place, kind, away, clearance)
        if count <= room:
            break
        room = 2 * count
    order = np.lexsort((place[:count, 1], place[:count, 0]))
    size = np.sqrt(np.einsum("ij,ij->i", away[order], away[order]))
    normal = away[order] / np.maximum(size, 1e-300)[:, None]
    normal[size < 1e-12] = (0.0, 0.0, 1.0)
    found = SelfCandidates(place[order], kind[order], normal, size - 2.0 * radius, clearance)
    for name in SelfCandidates.__slots__:
        getattr(found, name).setflags(write=False)
    return found


@kernel
def find_pairs(
    nodes: np.ndarray,
    s: np.ndarray,
    apart: float,
    limit: float,
    place: np.ndarray,
    kind: np.ndarray,
    away: np.ndarray,
    clearance: np.ndarray,
) -> int:
    """Pairs into `place`, `kind` and `away` (D [m]) as far as there is room; how many there are. Lowers `clearance`."""
    count, found = len(nodes) - 1, 0
    blocks = (count + BLOCK - 1) // BLOCK
    centre, size = np.zeros((blocks, 3)), np.zeros(blocks)
    for b in range(blocks):
        first, last = BLOCK * b, min(BLOCK * (b + 1), count)
        for k in range(3):
            centre[b, k] = 0.5 * (nodes[first, k] + nodes[last, k])
        for node in range(first, last + 1):
            size[b] = max(size[b], _distance(centre[b], nodes[node]))
    for b in range(blocks):
        for c in range(b, blocks):
            if _distance(centre[b], centre[c]) - size[b] - size[c] > limit:
                continue
            for i in range(BLOCK * b, min(BLOCK * (b + 1), count)):
                for j in range(max(BLOCK * c, i + 2), min(BLOCK * (c + 1), count)):
                    if s[j + 1] - s[i] > apart:
                        found = _look_at(nodes, s, i, j, apart, limit, place, kind, away, clearance, found)
    return found


@kernel
def _look_at(
    nodes: np.ndarray,
    s: np.ndarray,
    i: int,
    j: int,
    apart: float,
    limit: float,
    place: np.ndarray,
    kind: np.ndarray,
    away: np.ndarray,
    clearance: np.ndarray,
    found: int,
) -> int:
    """Look at one pair of segments; how many pairs are found by now."""
    t, u = nearest(nodes[i], nodes[i + 1], nodes[j], nodes[j + 1])
    d = _between(nodes, i, t, j, u)
    size = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    if size > limit:
        return found
    sine = _sine(nodes, i, j)
    arc = (1.0 - u) * s[j] + u * s[j + 1] - (1.0 - t) * s[i] - t * s[i + 1]
    last = len(nodes) - 2
    is_own = (t < 1.0 or i == last) and (u < 1.0 or j == last)
    if arc > apart:
        clearance[i], clearance[j] = min(clearance[i], size), min(clearance[j], size)
        if is_own and sine > CROSSES and _is_least(nodes, i, t, d, 1.0) and _is_least(nodes, j, u, d, -1.0):
            found = _report(place, kind, away, found, i + t, j + u, 0, d)
    if sine < RUNS_ALONG:
        for end in range(2 if i == last else 1):
            node = i + end
            u = _on_segment(nodes[node], nodes[j], nodes[j + 1])
            d = _between(nodes, i, float(end), j, u)
            size = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
            arc = (1.0 - u) * s[j] + u * s[j + 1] - s[node]
            if size < limit and arc > apart and (u < 1.0 or j == last) and _is_least(nodes, j, u, d, -1.0):
                found = _report(place, kind, away, found, float(node), j + u, 1, d)
    return found


@kernel
def _report(
    place: np.ndarray, kind: np.ndarray, away: np.ndarray, found: int, x: float, y: float, code: int, d: tuple[float, float, float]
) -> int:
    if found < len(kind):
        place[found, 0], place[found, 1], kind[found] = x, y, code
        away[found, 0], away[found, 1], away[found, 2] = d[0], d[1], d[2]
    return found + 1


@kernel
def nearest(a: np.ndarray, b: np.ndarray, c: np.ndarray, e: np.ndarray) -> tuple[float, float]:
    """Fractions of the closest points of the segments a-b and c-e (Ericson 2005, 5.1.9)."""
    p0, p1, p2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    q0, q1, q2 = e[0] - c[0], e[1] - c[1], e[2] - c[2]
    r0, r1, r2 = a[0] - c[0], a[1] - c[1], a[2] - c[2]
    pp, qq, pq = p0 * p0 + p1 * p1 + p2 * p2, q0 * q0 + q1 * q1 + q2 * q2, p0 * q0 + p1 * q1 + p2 * q2
    pr, qr = p0 * r0 + p1 * r1 + p2 * r2, q0 * r0 + q1 * r1 + q2 * r2
    if pp < POINT or qq < POINT:
        return 0.0, min(max(qr / qq, 0.0), 1.0) if qq >= POINT else 0.0
    square = pp * qq - pq * pq
    t = min(max((pq * qr - pr * qq) / square, 0.0), 1.0) if square > 1e-12 * pp * qq else 0.0
    u = (pq * t + qr) / qq
    if u < 0.0:
        return min(max(-pr / pp, 0.0), 1.0), 0.0
    if u > 1.0:
        return min(max((pq - pr) / pp, 0.0), 1.0), 1.0
    return t, u


@kernel
def _on_segment(point: np.ndarray, a: np.ndarray, b: np.ndarray) -> float:
    along, square = 0.0, 0.0
    for k in range(3):
        along += (point[k] - a[k]) * (b[k] - a[k])
        square += (b[k] - a[k]) ** 2
    return min(max(along / square, 0.0), 1.0) if square >= POINT else 0.0


@kernel
def _between(nodes: np.ndarray, i: int, t: float, j: int, u: float) -> tuple[float, float, float]:
    """D [m], from the second place to the first."""
    return (
        (1.0 - t) * nodes[i, 0] + t * nodes[i + 1, 0] - (1.0 - u) * nodes[j, 0] - u * nodes[j + 1, 0],
        (1.0 - t) * nodes[i, 1] + t * nodes[i + 1, 1] - (1.0 - u) * nodes[j, 1] - u * nodes[j + 1, 1],
        (1.0 - t) * nodes[i, 2] + t * nodes[i + 1, 2] - (1.0 - u) * nodes[j, 2] - u * nodes[j + 1, 2],
    )


@kernel
def _is_least(nodes: np.ndarray, i: int, t: float, d: tuple[float, float, float], sign: float) -> bool:
    """Whether a place on segment i, nearest there, is so on the neighbour too that begins at it."""
    if 0.0 < t < 1.0:
        return True
    other = i - 1 if t == 0.0 else i + 1
    if other < 0 or other >= len(nodes) - 1:
        return True
    along, square = 0.0, 0.0
    for k in range(3):
        step = nodes[other + 1, k] - nodes[other, k]
        along += sign * d[k] * step
        square += step * step
    slack = SLACK * math.sqrt(square * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]))
    return along <= slack if t == 0.0 else along >= -slack


@kernel
def _sine(nodes: np.ndarray, i: int, j: int) -> float:
    pp, qq, pq = 0.0, 0.0, 0.0
    for k in range(3):
        p, q = nodes[i + 1, k] - nodes[i, k], nodes[j + 1, k] - nodes[j, k]
        pp, qq, pq = pp + p * p, qq + q * q, pq + p * q
    return math.sqrt(max(1.0 - pq * pq / max(pp * qq, 1e-300), 0.0))


@kernel
def _distance(a: np.ndarray, b: np.ndarray) -> float:
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


KINDS: Final = (SelfTouch.CROSSING, SelfTouch.ALONGSIDE)
"""The meaning of the codes that `find_pairs` reports."""
