"""How near two cables come to each other; those of different kinds pass through each other, and a run has to tell where they overlap."""

from __future__ import annotations

import numpy as np


def distance(first: np.ndarray, second: np.ndarray, enough: float) -> float:
    """Least distance [m] between two polylines (n, 3) and (m, 3) [m]; `enough` [m] where they are further apart than that.

    Two segments a + t u and b + v w, t and v from 0 to 1, are closest at inner places of both or where one of them ends.
    """
    own, other = _in_reach(first, second, enough), _in_reach(second, first, enough)
    if not len(own) or not len(other):
        return enough
    i, j = (index.ravel() for index in np.meshgrid(own, other, indexing="ij"))
    a, b = first[i], second[j]
    u, w = first[i + 1] - a, second[j + 1] - b
    least = min(_inner(a, u, b, w), *(_to_point(*pair) for pair in ((a, b, w), (a + u, b, w), (b, a, u), (b + w, a, u))))
    return min(least, enough)


def _in_reach(nodes: np.ndarray, others: np.ndarray, reach: float) -> np.ndarray:
    """Segments whose boxes come within reach of the box of the others."""
    low, high = np.minimum(nodes[1:], nodes[:-1]), np.maximum(nodes[1:], nodes[:-1])
    return np.flatnonzero(((low < others.max(axis=0) + reach) & (high > others.min(axis=0) - reach)).all(axis=1))


def _to_point(point: np.ndarray, start: np.ndarray, along: np.ndarray) -> float:
    """Least distance of points (k, 3) from their segments."""
    share = np.einsum("ij,ij->i", point - start, along) / np.maximum(np.einsum("ij,ij->i", along, along), 1e-300)
    return float(np.linalg.norm(point - start - np.clip(share, 0.0, 1.0)[:, None] * along, axis=1).min())


def _inner(a: np.ndarray, u: np.ndarray, b: np.ndarray, w: np.ndarray) -> float:
    """Least distance of segments that are closest at inner places of both; infinite if none are."""
    normal = np.cross(u, w)
    square = np.einsum("ij,ij->i", normal, normal)
    apart = b - a
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.einsum("ij,ij->i", np.cross(apart, w), normal) / square
        v = np.einsum("ij,ij->i", np.cross(apart, u), normal) / square
        gap = np.abs(np.einsum("ij,ij->i", apart, normal)) / np.sqrt(square)
    inside = (t >= 0.0) & (t <= 1.0) & (v >= 0.0) & (v <= 1.0)
    return float(gap[inside].min(initial=np.inf))
