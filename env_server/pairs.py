"""Pairs that a contact search has found: in order along the cable, and only those that say something new."""

from __future__ import annotations

from typing import Final

import numpy as np

from .distances import ROUNDING, Triple, ahead, dot, kernel, leaf, length, minus

SAME_NORMAL: Final = float(np.cos(np.deg2rad(1.0)))
TOGETHER: Final = 0.01  # radii, distance within which two points inside a segment count as one place
PAIR: Final = np.dtype(
    [(name, np.int64) for name in ("segment", "body", "feature", "feature_id")]
    + [(name, np.float64) for name in ("fraction", "distance")]
    + [(name, np.float64, (3,)) for name in ("point", "normal", "direction")]
    + [("is_crossing", np.int64)]
)
"""A pair found, with the fields of `touch.Candidates`; in the frame of the body until all of that body are found."""


@leaf
def measure(hits: np.ndarray, in_reach: np.ndarray, clearance: np.ndarray) -> None:
    """Lower the clearance of every segment to its nearest pair; a node counts for both of its segments."""
    for hit in range(len(hits)):
        segment, fraction = hits[hit].segment, hits[hit].fraction
        for other in range(segment - (fraction == 0.0), segment + 1 + (fraction == 1.0)):
            if 0 <= other < len(in_reach) and in_reach[other]:
                clearance[other] = min(clearance[other], hits[hit].distance)


@leaf
def _place(hits: np.ndarray, hit: int) -> int:
    """Twice the node, or the odd number between two nodes."""
    return int(2 * hits[hit].segment + (0 if hits[hit].fraction == 0.0 else (2 if hits[hit].fraction == 1.0 else 1)))


@leaf
def sort_along(hits: np.ndarray, order: np.ndarray) -> None:
    """Write the order (m,) of the first m pairs along the cable, the nearest first; of equals the face. Quick because they nearly are."""
    for hit in range(len(order)):
        place, distance, slot = _place(hits, hit), hits[hit].distance + ROUNDING * hits[hit].feature, hit
        while slot > 0:
            other = order[slot - 1]
            behind = _place(hits, other)
            if behind < place or (behind == place and hits[other].distance + ROUNDING * hits[other].feature <= distance):
                break
            order[slot] = other
            slot -= 1
        order[slot] = hit


@leaf
def report(raw: np.ndarray, order: np.ndarray, radius: float, hits: np.ndarray, found: int) -> int:
    """Copy the pairs that say something new."""
    first, place = found, -1
    for hit in order:
        if _place(raw, hit) != place:
            first, place = found, _place(raw, hit)
        is_new = True
        for other in range(first, found):
            is_new = is_new and not _is_double(raw, hit, hits, other, place, radius)
        if is_new:
            hits[found] = raw[hit]
            found += 1
    return found


@kernel
def columns(hits: np.ndarray, own: int, radius: float, clearance: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The fields of `touch.Candidates`, of m pairs; those from `own` on are beyond an edge. Few arrays, for each costs a microsecond.

    Returns:
        Segment, body, feature and its name (4, m); whether they are crossings, and beyond (2, m); and one after the other fraction,
        gap and thickness (3, m), point, normal and direction (3, m, 3), extent (m, 2), which is zero, and clearance (n-1,).
    """
    count = len(hits)
    names, flags, numbers = np.empty((4, count), np.int64), np.empty((2, count), np.bool_), np.empty(14 * count + len(clearance))
    singles, vectors = numbers[: 3 * count].reshape(3, count), numbers[3 * count : 12 * count].reshape(3, count, 3)
    numbers[12 * count : 14 * count], numbers[14 * count :] = 0.0, clearance
    for hit in range(count):
        names[0, hit], names[1, hit], names[2, hit], names[3, hit] = (
            hits[hit].segment,
            hits[hit].body,
            hits[hit].feature,
            hits[hit].feature_id,
        )
        singles[0, hit], singles[1, hit], singles[2, hit] = hits[hit].fraction, hits[hit].distance - radius, 0.0
        for axis in range(3):
            vectors[0, hit, axis], vectors[1, hit, axis] = hits[hit].point[axis], hits[hit].normal[axis]
            vectors[2, hit, axis] = hits[hit].direction[axis]
        flags[0, hit], flags[1, hit] = hits[hit].is_crossing != 0, hit >= own
    return names, flags, numbers


@leaf
def _is_double(raw: np.ndarray, hit: int, hits: np.ndarray, other: int, place: int, radius: float) -> bool:
    """Do two pairs at one node, or close together inside a segment, say the same?"""
    if place % 2 == 1:
        here = ahead(triple(raw[hit].point), triple(raw[hit].normal), raw[hit].distance)
        there = ahead(triple(hits[other].point), triple(hits[other].normal), hits[other].distance)
        if length(minus(here, there)) > TOGETHER * radius:
            return False
    if raw[hit].is_crossing and hits[other].is_crossing:
        return True
    return dot(triple(raw[hit].normal), triple(hits[other].normal)) > SAME_NORMAL


@leaf
def triple(values: np.ndarray) -> Triple:
    """The first three numbers of an array."""
    return (values[0], values[1], values[2])
