"""What goes on beyond the end of an edge, so that a contact slides from edge to edge without losing its hold.

A contact that slides along an edge comes to its end, where other edges go on at an angle. The line of the first edge leaves
the surface there by the distance times the sine of the angle. It is followed as long as that is below `OVERSHOOT`, so
that for a moment both edges hold the cable. Beside a vertex, and near the end of an edge, all edges that leave it are
reported too: alone, a point or a finite edge would let the cable slip off to where those edges would catch it.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from .surface import Features

OVERSHOOT: Final = 5e-6  # m that the line of an edge may stand out from the surface
MARGIN_MOST: Final = 2e-3  # m
CLOSE: Final = 1e-3  # m, gap below which the edges beyond are reported
SHARP: Final = np.deg2rad(10.0)  # between faces, above which an edge is reported as one beyond; flatter ones their faces stand for
SLIDE: Final = 25e-3  # m along an edge to its end, within which the edges beyond are reported
NEIGHBOURS: Final = 6  # edges at one vertex that are compared


class EdgeTable(NamedTuple):
    """The edges of joined surfaces, by the vertices that they leave."""

    margins: np.ndarray  # (e, 2) m, how far the line is followed past the first and the last end
    vertex: np.ndarray  # (e, 2) int, vertex at the first and the last end
    leaving: np.ndarray  # (.,) int, edges by vertex
    first_leaving: np.ndarray  # (v+1,) row of every vertex in `leaving`


def edge_table(features: Features) -> EdgeTable:
    """The table for joined surfaces."""
    ends, count = features.edge_ends, len(features.edge_ends)
    bodies = np.arange(len(features.surfaces) - 1)
    body_of_edge = np.repeat(bodies, np.diff(features.surfaces["first_edge"]))
    body_of_vertex = np.repeat(bodies, np.diff(features.surfaces["first_vertex"]))
    corners = ends.transpose(1, 0, 2).reshape(-1, 3)
    places = np.vstack([np.column_stack([body_of_vertex, features.vertices]), np.column_stack([np.tile(body_of_edge, 2), corners])])
    _, number = np.unique(places, axis=0, return_inverse=True)
    # Coincident vertices are joined in the surface, so the first of them is the one that edges name.
    vertices = len(features.vertices)
    of_number = np.zeros(int(number.max()) + 1, dtype=np.int64)
    of_number[number[:vertices][::-1]] = np.arange(vertices)[::-1]
    vertex = of_number[number[vertices:]]
    order = np.argsort(vertex, kind="stable")
    is_sharp = _is_sharp(features)
    order = order[np.tile(is_sharp, 2)[order]]
    first_leaving = np.searchsorted(vertex[order], np.arange(vertices + 1))
    margins = edge_margins(ends, vertex) if count else np.zeros((0, 2))
    return EdgeTable(margins, vertex.reshape(2, count).T, order % max(count, 1), first_leaving)


def _is_sharp(features: Features) -> np.ndarray:
    """Edges (e,) whose faces meet at more than `SHARP`, or that have but one face."""
    first, last = features.edge_first[:-1], features.edge_first[1:]
    is_sharp: np.ndarray = last - first != 2
    pairs = np.flatnonzero(~is_sharp)
    planes = features.edge_planes[:, :3]
    # Both vectors lie in their face and point into it, square to the edge: opposite where the faces are one plane.
    is_sharp[pairs] = np.einsum("ij,ij->i", planes[first[pairs]], planes[first[pairs] + 1]) > -np.cos(SHARP)
    return is_sharp


def edge_margins(ends: np.ndarray, vertex: np.ndarray) -> np.ndarray:
    """Margins (e, 2) [m] past the first and last end of every edge.

    Args:
        ends: (e, 2, 3) [m].
        vertex: (2 e,) number of the vertex at every first end, then at every last end.
    """
    count = len(ends)
    along = ends[:, 1] - ends[:, 0]
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    leaving = np.concatenate([along, -along])
    order = np.argsort(vertex, kind="stable")
    straightest = np.full(2 * count, -1.0)  # largest cosine between going on straight and a neighbour
    for step in range(1, NEIGHBOURS):
        first, second = order[:-step], order[step:]
        together = vertex[first] == vertex[second]
        cosine = np.where(together, -np.einsum("ij,ij->i", leaving[first], leaving[second]), -1.0)
        np.maximum.at(straightest, first, cosine)
        np.maximum.at(straightest, second, cosine)
    sine = np.sqrt(np.maximum(1.0 - straightest**2, 0.0))
    margin = np.where(straightest > 0.0, OVERSHOOT / np.maximum(sine, OVERSHOOT / MARGIN_MOST), OVERSHOOT)
    return margin.reshape(2, count).T
