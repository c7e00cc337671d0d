"""How far a cable and what it touches disagree when a step ends: what one more round of Fig. 9 would change.

A round solves the cable against rows, the planes and lines where the round before has touched, and looks where it touches then. At the
place x of the axis where a row pushes, the row and the place that would take its turn say different gaps; one more round would move
the cable there, along the normal, by

    d = g_row(x) - g_place(x)   [m]

and where the cable has got into a body that no row knew of, out by as much. Between and beyond those places it goes along like a beam,
whose deflection w has w'''' = 0 between supports: w(s_k) = d_k, w = 0 where it is held, w' = 0 in a clamp, w'' = 0 where it is free to
turn. The largest |w| is what the round would change: a support that shifts beside another one turns the cable there, and swings the free
spans by far more. Left out is tension, which stiffens against that, and that supports may lift off.

A cable without bending hangs in parts between its bends. A part of chord c that is longer by e sags by sqrt(3 c e / 8); where a bend
shifts, or cable is drawn through it, e changes by as much, and a taut part by far more than the bend.

What the iteration of the shape server leaves is in its residual r, a force: a cable of length L that carries F gives way by no more than
`GIVES` r L / F, and by no more than `LEFT` of its length, for the last step was short (measured; see `tests/env_server/test_coupling.py`).
Strands and cables that touch each other have no rows of their own here: only the residual speaks for them.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import numpy as np

from protocol.kinds import FRICTION_CODES, Friction, Hold
from protocol.messages import Contacts, Grasps, Shape

from .boundary import Boundary, at_place
from .piece_hits import FACE
from .polyline import points_at
from .poses import outside, turn_outside
from .touch import Candidates

BONDED: Final = FRICTION_CODES.index(Friction.BOND)
ALIKE: Final = 0.9  # cosine between the normals of a row and of the place that takes its turn
BESIDE: Final = 1.5  # segments, within which it is
SAME: Final = 0.2  # of a segment; a row this near to a place keeps the cable out of it
MERGED: Final = 0.5  # of a segment; supports nearer to each other are one
SWING: Final = 2.0  # times the beam, for the supports that come and go
GIVES, LEFT = 0.1, 5e-6
SEEN: Final = np.linspace(0.0, 1.0, 9)[1:-1, None]  # of a span, where its deflection is looked at


def change(shape: Shape, boundary: Boundary, near: Candidates, asked: Contacts | None, grasps: Grasps, poses: np.ndarray) -> float:
    """How far at most any point of a cable would go in one more round [m]; estimated.

    Args:
        shape: As the last round left it.
        boundary: The same, before a step is accepted.
        near: What the shape is near to.
        asked: The rows that it was solved with.
        grasps: What holds it.
        poses: (surfaces, 7) Poses of all surfaces.
    """
    if boundary.is_limp:
        return _by_sag(shape, boundary, near, asked, grasps, poses)
    segment = float((shape.s[1:] - shape.s[:-1]).max())
    s, shift = _pushed(shape, boundary, near, asked, segment)
    entered = _entered(shape, near, asked, segment)
    s, shift = np.concatenate([s, entered[0]]), np.concatenate([shift, entered[1]])
    return SWING * _swing(shape, grasps, s, shift) + _left(shape)


def _pushed(shape: Shape, boundary: Boundary, near: Candidates, asked: Contacts | None, segment: float) -> tuple[np.ndarray, np.ndarray]:
    """Where one-sided rows push (p,) [m], and by how much the place that would take their turn shifts the cable there (p,) [m]."""
    if asked is None:
        return np.zeros(0), np.zeros(0)
    on = np.flatnonzero(np.einsum("ij,ij->i", shape.contact_forces, shape.contact_forces) > 0.0)
    on = on[asked.friction[on] != BONDED]
    s = shape.contact_s[on]
    if not len(on) or not len(near.gap):
        return s, np.zeros(len(on))
    x, radius = points_at(shape, s), boundary.radius
    normal = boundary.pushes.normal[~boundary.pushes.is_bond]
    own = _gap(x, asked.feature[on], asked.point[on], asked.normal[on], asked.direction[on]) - asked.distance[on]
    new = _gap(x[:, None], near.feature, near.point, near.normal, near.direction) - (radius + near.thickness)  # (p, m)
    fits = (near.body == asked.body[on, None]) & (normal @ near.normal.T > (0.0 if boundary.is_limp else ALIKE))
    away = np.where(fits, np.abs(at_place(near, shape.s) - s[:, None]), np.inf)
    nearest = away.min(axis=1, keepdims=True)
    shift = own[:, None] - new
    chosen = np.argmin(np.where(away <= nearest + 1e-3 * segment, np.abs(shift), np.inf), axis=1)
    rows = np.arange(len(on))
    return s, np.where(nearest[:, 0] < BESIDE * segment, shift[rows, chosen], 0.0)


def _entered(shape: Shape, near: Candidates, asked: Contacts | None, segment: float) -> tuple[np.ndarray, np.ndarray]:
    """Where the cable is in a body without a row that says so (p,) [m], and how deep (p,) [m]."""
    within = np.flatnonzero(near.gap < 0.0)
    s, depth = at_place(near, shape.s)[within] if len(within) else np.zeros(0), -near.gap[within]
    if asked is None or not len(within):
        return s, depth
    x = points_at(shape, s)
    own = _gap(x[:, None], asked.feature, asked.point, asked.normal, asked.direction) - asked.distance  # (p, rows)
    same = (asked.body == near.body[within, None]) & (np.abs(shape.contact_s - s[:, None]) < SAME * segment)
    unlike = np.where(same, np.abs(own + depth[:, None]), np.inf).min(axis=1, initial=np.inf)
    return s, np.minimum(depth, unlike)


def _gap(x: np.ndarray, feature: np.ndarray, point: np.ndarray, normal: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Distance [m] of points of the axis from planes, lines and points; all broadcast."""
    away = x - point
    flat = (away * normal).sum(axis=-1)
    across = away - (away * direction).sum(axis=-1, keepdims=True) * direction
    distance: np.ndarray = np.where(feature == FACE, flat, np.linalg.norm(across, axis=-1))
    return distance


def _swing(shape: Shape, grasps: Grasps, s: np.ndarray, shift: np.ndarray) -> float:
    """Largest deflection [m] of a beam over supports at s (p,) [m] that shift by so much (p,) [m], and over those that hold it."""
    if not np.abs(shift).max(initial=0.0) > 0.0:
        return 0.0
    least = MERGED * float(np.diff(shape.s).min())
    held = [(float(at), 0.0, kind is Hold.CLAMP) for at, kind in zip(grasps.s, grasps.hold, strict=True)]
    supports = list(held)
    for at, by in sorted(zip(s.tolist(), shift.tolist(), strict=True), key=lambda one: -abs(one[1])):
        if min(abs(at - one[0]) for one in supports) > least:
            supports.append((at, by, False))
    supports.sort()
    at, by = (np.array([one[k] for one in supports]) for k in (0, 1))
    return max(_deflection(at, by, [one[2] for one in supports], (float(shape.s[0]), float(shape.s[-1]))), float(np.abs(shift).max()))


def _deflection(at: np.ndarray, by: np.ndarray, is_clamped: list[bool], ends: tuple[float, float]) -> float:
    """Largest magnitude [m] of the cubic spline through shifts (n,) [m] at (n,) [m], straight beyond them to the ends of the cable."""
    span, slope = at[1:] - at[:-1], _slopes(at.tolist(), by.tolist(), is_clamped)
    u, v = SEEN, 1.0 - SEEN
    between = (1.0 + 2.0 * u) * v * v * by[:-1] + (1.0 + 2.0 * v) * u * u * by[1:] + u * v * span * (v * slope[:-1] - u * slope[1:])
    beyond = by[0] + slope[0] * (ends[0] - at[0]), by[-1] + slope[-1] * (ends[1] - at[-1])
    return float(max(np.abs(between).max(initial=0.0), np.abs(beyond).max()))


def _slopes(at: list[float], by: list[float], is_clamped: list[bool]) -> np.ndarray:
    """Slopes (n,) of that spline at its supports, by elimination from the first to the last: no moment is left over where it turns."""
    count = len(at)
    upper, right = [0.0] * count, [0.0] * count
    for k in range(count):
        own, before, after, wanted = 0.0, 0.0, 0.0, 0.0
        for other in (k - 1, k + 1) if not is_clamped[k] else ():
            if 0 <= other < count:
                length = abs(at[other] - at[k])
                own += 4.0 / length
                wanted += 6.0 * (by[max(other, k)] - by[min(other, k)]) / length**2
                before, after = (2.0 / length, after) if other < k else (before, 2.0 / length)
        pivot = own - before * upper[k - 1] if own > 0.0 else 1.0
        upper[k], right[k] = after / pivot, (wanted - before * right[k - 1]) / pivot
    for k in range(count - 2, -1, -1):
        right[k] -= upper[k] * right[k + 1]
    return np.array(right)


def _by_sag(shape: Shape, boundary: Boundary, near: Candidates, asked: Contacts | None, grasps: Grasps, poses: np.ndarray) -> float:
    """The same for a cable without bending."""
    if asked is None:
        return 0.0
    s, shift = _pushed(shape, boundary, near, asked, float((shape.s[1:] - shape.s[:-1]).max()))
    stops = [(float(at), 0.0) for at in grasps.s] + [(float(at), abs(float(by))) for at, by in zip(s, shift, strict=True)]
    bonded = np.flatnonzero((asked.friction == BONDED) & (np.einsum("ij,ij->i", shape.contact_forces, shape.contact_forces) > 0.0))
    for row, bond in zip(bonded, boundary.bonds, strict=True):
        pose = poses[bond.surface]
        place = outside(pose, bond.point) + boundary.radius * turn_outside(pose, bond.normal)
        moved = float(np.linalg.norm(asked.point[row] + asked.distance[row] * asked.normal[row] - place))
        stops.append((bond.s, moved + abs(bond.s - float(asked.s[row]))))
    stops.sort()
    places, most = points_at(shape, np.array([at for at, _ in stops])), 0.0
    for (first, last), (begin, end) in zip(pairwise(stops), pairwise(places), strict=True):
        chord, by = float(np.linalg.norm(end - begin)), first[1] + last[1]
        spare = max(last[0] - first[0] - chord, 0.0)
        most = max(most, by, np.sqrt(0.375 * chord) * (np.sqrt(spare + by) - np.sqrt(spare)))
    return float(most)


def _left(shape: Shape) -> float:
    """What the iteration has left [m]."""
    length = float(shape.s[-1])
    carried = max(np.abs(shape.grasp_wrenches[:, :3]).max(initial=0.0), np.abs(shape.grasp_wrenches[:, 3:]).max(initial=0.0) / length)
    return length * min(LEFT, GIVES * shape.residual / max(float(carried), 1e-300))
