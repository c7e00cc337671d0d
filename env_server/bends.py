"""What the shape server makes of a contact at a bend of the polyline, so that it keeps the cable just where the search looks.

Where the cable bends away from a thin feature, the place nearest to it is a node over a whole range of positions, and the feet of
the feature on the lines of both segments lie beyond that node. The shape server measures to these feet, and less the
bulge of the axis between the nodes (docstring of `shape_server.contact_geometry`); for a feature at distance d from a node that turns by
alpha this differs from the distance of the node itself by some alpha^2 d / 8. The difference is added to the distance asked for.
It tends to zero with the square of the segments. A row whose feet lie further beyond than the shape server follows them is
better given as a plane at the node.
"""

from __future__ import annotations

from typing import Final

import numpy as np

FOLLOWED: Final = 0.08  # of a segment beyond its node; the shape server follows a foot up to 0.1
SLANTING: Final = 0.02  # sine between a segment and an edge below which the shape server counts them as parallel


def seen_from_segments(
    nodes: np.ndarray, node: np.ndarray, away: np.ndarray, direction: np.ndarray, is_straight: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """How much nearer than the node itself the shape server sees features (m,) [m], and how far beyond it in segments (m,).

    Args:
        nodes: (n, 3) [m] of the cable.
        node: (m,) int, that is nearest to each feature.
        away: (m, 3) [m] from the feature to the node.
        direction: (m, 3) unit along edges, zero for vertices.
        is_straight: (m,) which are measured without a bulge (`shape_server.system`).
    """
    chords = np.diff(nodes, axis=0)
    lengths = np.linalg.norm(chords, axis=1)
    tangents = chords / lengths[:, None]
    far = np.linalg.norm(away, axis=1)
    normal = away / far[:, None]
    nearest, beyond = np.full(len(node), np.inf), np.full(len(node), np.inf)
    for after in (0, 1):  # the segment before the node, and the one after it
        segment = node - 1 + after
        is_there = (segment >= 0) & (segment < len(lengths))
        segment = np.clip(segment, 0, len(lengths) - 1)
        across = tangents[segment] - np.einsum("ij,ij->i", tangents[segment], direction)[:, None] * direction
        square = np.maximum(np.einsum("ij,ij->i", across, across), 1e-300)
        foot = -np.einsum("ij,ij->i", away, across) / square
        seen = np.linalg.norm(away + foot[:, None] * across, axis=1)
        size = lengths[segment]
        share = foot / size + (1 - after)
        seen -= np.where(is_straight, 0.0, 1.0) * _bulge(
            share, size, _turns(tangents, segment, normal), _turns(tangents, segment + 1, normal)
        )
        is_there &= square > SLANTING**2
        nearest = np.where(is_there, np.minimum(nearest, seen), nearest)
        past = np.maximum(-share, share - 1.0)
        beyond = np.where(is_there, np.minimum(beyond, past), beyond)
    is_known = np.isfinite(nearest)
    return np.where(is_known, far - nearest, 0.0), np.where(is_known, beyond, 0.0)


def _turns(tangents: np.ndarray, node: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Turn (m,) [rad] of the axis at nodes towards the feature; none at the ends."""
    before, after = np.clip(node - 1, 0, len(tangents) - 1), np.clip(node, 0, len(tangents) - 1)
    turn: np.ndarray = -np.einsum("ij,ij->i", normal, tangents[after] - tangents[before])
    return turn


def _bulge(share: np.ndarray, size: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Bulge (m,) [m] at shares of segments, from the turns at their ends."""
    begin, end = 0.125 * size * np.maximum(first, 0.0), 0.125 * size * np.maximum(last, 0.0)
    slope_begin, slope_end = -0.5 * first * size, 0.5 * last * size
    square, cube = 3 * (end - begin) - 2 * slope_begin - slope_end, 2 * (begin - end) + slope_begin + slope_end
    bulge: np.ndarray = begin + share * (slope_begin + share * (square + share * cube))
    return bulge
