"""A rigid surface of triangles, made ready for the contact search.

The search wants to know at once, of every triangle, edge and vertex, from which directions it can be touched. A point c
is closest to the surface at q only if n = c - q lies in the normal cone of the feature that q is on:

    face     n is square to the face
    edge     n . m <= 0 for every triangle that shares the edge; m lies in the triangle, square to the edge, and points into it
    vertex   n . e <= 0 for every edge direction e that leaves the vertex

These cones need no outside, so open, folded, duplicate and inverted triangles do no harm. An edge between coplanar
triangles (to 1e-6 rad) is never closest alone, its faces are; treating it as flat moves the surface by less than 1e-6 of
the size of the triangles. Each remaining edge and vertex is looked after by one of its triangles, so a search that
visits triangles meets it once (Curtis, Tamstorf and Manocha 2008, "Fast collision detection for deformable models using
representative-triangles").

Triangles are sorted into a tree of bounding boxes (tree.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple, final

import numpy as np

from protocol.errors import SceneError

from .distances import ROUNDING, Triple, ahead, dot, inlined, leaf, minus
from .tree import grown

FLAT: Final = 1e-6  # rad, an edge with a smaller dihedral angle is part of its faces
SLIVER: Final = 1e-9  # height over length below which a triangle counts as having no area
SKIN: Final = 1e-6  # part of a line of sight next to the point looked at that nothing can cut
SURFACE: Final = np.dtype([(name, np.int64) for name in ("first_box", "first_triangle", "first_edge", "first_vertex", "depth")])
"""Where a surface begins in the arrays of `Features`, and how many levels its tree has below its root."""


class Features(NamedTuple):
    """Surfaces one after the other, as flat arrays for kernels; t triangles, e edges, v vertices, b surfaces."""

    planes: np.ndarray  # (t, 4, 4) unit normal and offset: of the triangle, and of its sides, inward, from corner k to k+1
    triangle_ids: np.ndarray  # (t,) index in the mesh as given
    own_edges: np.ndarray  # (t, 3) edge that the triangle looks after, per side; -1 for none
    own_vertices: np.ndarray  # (t, 3) vertex that the triangle looks after, per corner; -1 for none
    edge_ends: np.ndarray  # (e, 2, 3) m
    edge_first: np.ndarray  # (e+1,) first row in edge_planes
    edge_planes: np.ndarray  # (., 4) unit normal and offset of the planes through the edge, square to each of its triangles
    vertices: np.ndarray  # (v, 3) m
    vertex_first: np.ndarray  # (v+1,) first row in vertex_along
    vertex_along: np.ndarray  # (., 3) unit, along each edge that leaves the vertex
    boxes: np.ndarray  # (., 6) m, least and greatest corner of every tree node
    surfaces: np.ndarray  # (b+1,) of `SURFACE`; the last says where all end


@final
class Surface:
    """An immutable rigid surface.

    Attributes:
        features: What the contact search reads.

    Args:
        vertices: (v, 3) [m] In the frame of the body. Coincident vertices are joined.
        triangles: (t, 3) Indices of vertices. Those without area, and duplicates, are left out.

    Raises:
        SceneError: If the mesh names vertices that do not exist, is not finite, or has no triangle with an area.
    """

    __slots__ = ("features",)
    features: Features

    def __init__(self, vertices: np.ndarray, triangles: np.ndarray) -> None:
        vertices = np.ascontiguousarray(vertices, dtype=np.float64)
        triangles = np.asarray(triangles)
        _check(vertices, triangles)
        triangles = _first_of_coincident(vertices)[triangles.astype(np.int64)]
        kept = _with_area(vertices, triangles)
        if kept.size == 0:
            raise SceneError(f"surface: none of its {len(triangles)} triangles has an area; give one that does")
        corners = vertices[triangles[kept]]  # (t, 3, 3)
        order, boxes, depth = grown(corners.min(axis=1), corners.max(axis=1))
        kept = kept[order]
        object.__setattr__(self, "features", _features(vertices, triangles[kept], kept, boxes, depth))

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a Surface does not change; make a new one instead of setting '{name}'")


def join(surfaces: Sequence[Surface]) -> Features:
    """Lay surfaces one after the other, indices shifted."""
    parts = [surface.features for surface in surfaces]
    columns: dict[str, np.ndarray] = {"surfaces": np.zeros(len(parts) + 1, dtype=SURFACE)}
    counted = {"first_box": "boxes", "first_triangle": "triangle_ids", "first_edge": "edge_ends", "first_vertex": "vertices"}
    for name, rows in counted.items():
        columns["surfaces"][name] = np.cumsum([0, *(len(getattr(part, rows)) for part in parts)])
    columns["surfaces"]["depth"][:-1] = [part.surfaces["depth"][0] for part in parts]
    for name, first in (("own_edges", "first_edge"), ("own_vertices", "first_vertex")):
        shifts = columns["surfaces"][first]
        shifted = [np.where(getattr(p, name) < 0, -1, getattr(p, name) + shift) for p, shift in zip(parts, shifts, strict=False)]
        columns[name] = np.concatenate(shifted)
    for name in ("edge_first", "vertex_first"):
        ends = np.cumsum([0, *(getattr(part, name)[-1] for part in parts)])
        columns[name] = np.concatenate([np.zeros(1, np.int64), *(getattr(p, name)[1:] + end for p, end in zip(parts, ends, strict=False))])
    for name in Features._fields:
        if name not in columns:
            columns[name] = np.concatenate([getattr(part, name) for part in parts])
    return Features(**columns)


@leaf
def height(planes: np.ndarray, triangle: int, side: int, point: Triple) -> float:
    """Signed distance in m of a point from plane `side` of a triangle: 0 the triangle's own, then its three sides'."""
    return float(dot(plane_normal(planes, triangle, side), point) - planes[triangle, side, 3])


@leaf
def plane_normal(planes: np.ndarray, triangle: int, side: int) -> Triple:
    """Unit normal of plane `side` of a triangle."""
    return (planes[triangle, side, 0], planes[triangle, side, 1], planes[triangle, side, 2])


@leaf
def edge_end(ends: np.ndarray, edge: int, end: int) -> Triple:
    """First or second end [m] of an edge."""
    return (ends[edge, end, 0], ends[edge, end, 1], ends[edge, end, 2])


@inlined
def hides(planes: np.ndarray, near: np.ndarray, eye: Triple, point: Triple) -> bool:
    """Does one of the triangles `near` cut the line of sight from `eye` to a point on one of them?"""
    point = ahead(point, minus(eye, point), SKIN)
    for triangle in near:
        height_eye, height_point = height(planes, triangle, 0, eye), height(planes, triangle, 0, point)
        if (height_eye > 0.0) != (height_point > 0.0):
            crossing = ahead(eye, minus(point, eye), height_eye / (height_eye - height_point))
            inside = min(
                height(planes, triangle, 1, crossing), height(planes, triangle, 2, crossing), height(planes, triangle, 3, crossing)
            )
            if inside >= -ROUNDING:
                return True
    return False


def _check(vertices: np.ndarray, triangles: np.ndarray) -> None:
    if vertices.ndim != 2 or vertices.shape[1] != 3 or triangles.ndim != 2 or triangles.shape[1] != 3:
        raise SceneError(f"surface: vertices {vertices.shape} and triangles {triangles.shape} must be (v, 3) and (t, 3)")
    if not np.isfinite(vertices).all():
        raise SceneError("surface: a vertex is not finite; repair the mesh")
    if triangles.dtype.kind not in "iu":
        raise SceneError(f"surface: triangles of type {triangles.dtype} must be integers")
    if triangles.size and not 0 <= triangles.min() <= triangles.max() < len(vertices):
        raise SceneError(f"surface: a triangle names a vertex outside 0 to {len(vertices) - 1}; repair the mesh")


def _first_of_coincident(vertices: np.ndarray) -> np.ndarray:
    """(v,) index of the first vertex at the same place."""
    order = np.lexsort(vertices.T)
    is_new = np.ones(len(vertices), dtype=bool)
    is_new[1:] = (np.diff(vertices[order], axis=0) != 0).any(axis=1)
    first = np.empty(len(vertices), dtype=np.int64)
    first[order] = order[is_new][np.cumsum(is_new) - 1]
    return first


def _with_area(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Indices of the triangles that have an area and are the first with their three vertices."""
    corners = vertices[triangles]
    sides = np.roll(corners, -1, axis=1) - corners  # (t, 3, 3)
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)  # twice the area
    solid = np.flatnonzero(area > SLIVER * np.einsum("tki,tki->tk", sides, sides).max(axis=1))
    named = np.sort(triangles[solid], axis=1)
    order = np.lexsort(named.T)
    is_new = np.ones(len(solid), dtype=bool)
    is_new[1:] = (np.diff(named[order], axis=0) != 0).any(axis=1)
    return np.sort(solid[order[is_new]])


def _features(vertices: np.ndarray, triangles: np.ndarray, ids: np.ndarray, boxes: np.ndarray, depth: int) -> Features:
    corners = vertices[triangles]
    sides = np.roll(corners, -1, axis=1) - corners
    sides /= np.linalg.norm(sides, axis=2, keepdims=True)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    planes = np.empty((len(triangles), 4, 4))
    planes[:, 0, :3] = normals
    planes[:, 1:, :3] = np.cross(normals[:, None], sides)
    planes[:, 0, 3] = np.einsum("ti,ti->t", normals, corners[:, 0])
    planes[:, 1:, 3] = np.einsum("tki,tki->tk", planes[:, 1:, :3], corners)
    ends, own_edges, edge_first, edge_planes = _edges(triangles, planes[:, 1:])
    is_flat = np.ones(len(ends), dtype=bool)
    is_flat[own_edges[own_edges >= 0]] = False
    own_vertices, vertex_first, vertex_along = _corners(vertices, triangles, ends, is_flat)
    features = Features(
        planes=planes,
        triangle_ids=ids,
        own_edges=own_edges,
        own_vertices=own_vertices,
        edge_ends=vertices[ends],
        edge_first=edge_first,
        edge_planes=edge_planes,
        vertices=vertices.copy(),
        vertex_first=vertex_first,
        vertex_along=vertex_along,
        boxes=boxes,
        surfaces=np.array([(0, 0, 0, 0, depth), (len(boxes), len(triangles), len(ends), len(vertices), 0)], dtype=SURFACE),
    )
    for array in features:
        array.setflags(write=False)
    return features


def _edges(triangles: np.ndarray, planes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Edges in the order of their owners: ends (e, 2), owned (t, 3), first rows (e+1,), and planes of their triangles (3t, 4)."""
    sides = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)  # (3t, 2)
    _, owner, edge = np.unique(sides[:, 0] * (sides.max() + 1) + sides[:, 1], return_index=True, return_inverse=True)
    edge = np.argsort(np.argsort(owner))[edge]  # neighbours in space become neighbours in memory
    owner = np.sort(owner)
    order = np.argsort(edge, kind="stable")
    first = np.searchsorted(edge[order], np.arange(len(owner) + 1))
    rows, edge_of_row = planes.reshape(-1, 4)[order], edge[order]
    is_flat = np.zeros(len(owner), dtype=bool)
    for step in range(1, int(np.diff(first).max())):  # pairs of triangles `step` rows apart that share an edge
        same = edge_of_row[step:] == edge_of_row[:-step]
        opposed = np.linalg.norm(rows[step:, :3] + rows[:-step, :3], axis=1) < FLAT
        is_flat[edge_of_row[step:][same & opposed]] = True
    owned = np.full(len(sides), -1, dtype=np.int64)
    owned[owner] = np.where(is_flat, -1, np.arange(len(owner)))
    return sides[owner], owned.reshape(-1, 3), first, rows


def _corners(
    vertices: np.ndarray, triangles: np.ndarray, ends: np.ndarray, is_flat: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices: owners (t, 3), first rows (v+1,), and directions of the edges that leave them (2e, 3)."""
    along = vertices[ends[:, 1]] - vertices[ends[:, 0]]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    leaves = ends.T.ravel()
    order = np.argsort(leaves, kind="stable")
    first = np.searchsorted(leaves[order], np.arange(len(vertices) + 1))
    is_sharp = np.zeros(len(vertices), dtype=bool)
    is_sharp[ends[~is_flat]] = True
    used, corner = np.unique(triangles.ravel(), return_index=True)
    own = np.full(triangles.size, -1, dtype=np.int64)
    own[corner] = np.where(is_sharp[used], used, -1)
    return own.reshape(-1, 3), first, np.concatenate([along, -along])[order]
