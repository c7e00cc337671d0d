"""Bodies given by their sizes, for the contact search: exact, and drawn as meshes.

The rows of the shape server take them as they are: a sphere or a point is a vertex, the side of a cylinder or of a capsule an
edge along its axis, each kept at the radius of the body and that of the cable; a plane is a face. The edge of a capsule ends in
the centres of its half spheres, past which the shape server keeps a distance from that point: just what a capsule is.

The flat ends of a cylinder are not built. A cable that touches one is refused with a sentence; make it longer, a capsule or a mesh.
"""

from __future__ import annotations

import math
from collections.abc import Sequence, Set
from typing import Final

import numpy as np

from protocol.errors import SceneError
from protocol.kinds import Primitive
from protocol.scene import Body

from . import bends
from .meshes import Mesh
from .piece_hits import EDGE, FACE
from .round_hits import BALL, PLANE, ROD, TUBE, find_round_hits
from .surface import Surface
from .touch import NEIGHBOURHOOD, Candidates, Touch, keep_normals

KINDS: Final = {
    Primitive.SPHERE: BALL,
    Primitive.POINT: BALL,
    Primitive.CAPSULE: ROD,
    Primitive.CYLINDER: TUBE,
    Primitive.PLANE: PLANE,
}
TOUCHING: Final = 1e-5  # m, gap below which a body is touched
ROOM_HELD: Final = 2e-3  # m that a touched body may move at once; no less is always looked at around a cable
SMALL: Final = 0.2  # of the distance of a contact, by which it may be corrected
ROOM: Final = 1e-6  # m, an end of a cylinder nearer to the cable than its radius and this is touched


class Primitives:
    """Contact search between one cable and exact bodies that move, beside those made of triangles.

    Args:
        bodies: All bodies of the scene; the index in this sequence is the `body` of the candidates.
        meshes: Of all bodies, in the same order; those of exact bodies are not looked at.
        limp: Indices of cables without bending, which do not round their nodes.
    """

    def __init__(self, bodies: Sequence[Body], meshes: Sequence[Mesh], limp: Set[int] = frozenset()) -> None:
        exact = [index for index, body in enumerate(bodies) if body.shape is not None]
        self._exact = np.array(exact, dtype=np.int64)
        self._names = [bodies[index].name for index in exact]
        self._kinds = np.array([KINDS[shape] for index in exact if (shape := bodies[index].shape) is not None])
        self._halves = np.array([0.5 * (bodies[index].length or 0.0) for index in exact])
        self._radii = np.array([bodies[index].radius or 0.0 for index in exact])
        self._meshes = np.array([index for index, body in enumerate(bodies) if body.shape is None], dtype=np.int64)
        self._limp = limp
        self._touch = Touch([Surface(meshes[index].vertices, meshes[index].triangles) for index in self._meshes])

    def search(
        self,
        nodes: np.ndarray,
        poses: np.ndarray,
        radius: float,
        reach: float,
        *,
        cable: int | None = None,
        previous: Candidates | None = None,
    ) -> Candidates:
        """Every place of contact with a gap below `reach`; arguments as for `Touch.search`.

        Raises:
            SceneError: If the cable has come to an end of a cylinder.
        """
        before = _renumbered(previous, self._meshes)
        on_meshes = self._touch.search(nodes, poses[self._meshes], radius, reach, cable=cable, previous=before)
        hits, near, ends = find_round_hits(
            np.ascontiguousarray(nodes), poses[self._exact], self._kinds, self._halves, self._radii, radius + reach
        )
        if ends.min() < radius + ROOM:
            name = self._names[int(np.argmin(ends))]
            raise SceneError(
                f"the cable comes to an end of the cylinder '{name}', and the ends of cylinders are not built; "
                "make it longer, or a capsule, or a mesh",
                key="bodies",
            )
        own = hits["body"].copy()
        hits["body"] = self._exact[own]
        if previous is not None:
            keep_normals(hits, hits["is_crossing"], previous)
            _keep_sides(hits, previous)
        is_thin = (self._radii[own] == 0.0) & (hits["feature"] != FACE)
        _give_room(near, hits, own, hits["distance"] - self._radii[own] - radius, radius, is_thin)
        names = ("segment", "fraction", "body", "feature", "feature_id", "point", "normal", "direction")
        columns = {name: np.concatenate([getattr(on_meshes, name), hits[name]]) for name in names}
        columns["body"][: len(on_meshes.body)] = self._meshes[on_meshes.body]
        columns["is_crossing"] = np.concatenate([on_meshes.is_crossing, hits["is_crossing"] != 0])
        columns["is_beyond"] = np.concatenate([on_meshes.is_beyond, np.zeros(len(hits), dtype=bool)])
        columns["extent"] = np.vstack([on_meshes.extent, self._extents(hits, own, poses)])
        columns["gap"] = np.concatenate([on_meshes.gap, hits["distance"] - self._radii[own] - radius])
        columns["thickness"] = np.concatenate([on_meshes.thickness, self._radii[own]])
        _see_bends(columns, len(on_meshes.body), nodes, radius, is_limp=cable in self._limp)
        found = Candidates(**columns, clearance=np.minimum(on_meshes.clearance, near.min(axis=0)))
        for name in Candidates._fields:
            getattr(found, name).setflags(write=False)
        return found

    def _extents(self, hits: np.ndarray, own: np.ndarray, poses: np.ndarray) -> np.ndarray:
        """How far the axes of cylinders and capsules go on from the points (m, 2) [m]."""
        extent = np.zeros((len(hits), 2))
        for row in np.flatnonzero(hits["feature"] == EDGE):
            pose, half = poses[hits["body"][row]], self._halves[own[row]]
            along = float((hits["point"][row] - pose[:3]) @ hits["direction"][row])
            extent[row] = -half - along, half - along
        return extent


def _keep_sides(hits: np.ndarray, previous: Candidates) -> None:
    """Leave the cable on the side of a thin body on which it touched it, however far that has moved through it since.

    The side is the mean normal of all places nearby: those of the two pieces beside a sharp bend may be far apart.
    """
    is_touched = previous.gap < TOUCHING
    places = previous.segment + previous.fraction
    for row in np.flatnonzero(np.isin(hits["body"], previous.body[is_touched])):
        hit = hits[row]
        near = (previous.body == hit["body"]) & (np.abs(places - hit["segment"] - hit["fraction"]) < NEIGHBOURHOOD)
        if (near & is_touched).any() and hit["normal"] @ previous.normal[near].sum(axis=0) < 0.0:
            hits["normal"][row] *= -1.0
            hits["distance"][row] *= -1.0


def _give_room(near: np.ndarray, hits: np.ndarray, own: np.ndarray, gap: np.ndarray, radius: float, is_thin: np.ndarray) -> None:
    """Let a point or a line that is touched move by `ROOM_HELD` at once: the side on which it is touched is remembered."""
    for row in np.flatnonzero((gap < TOUCHING) & is_thin):
        node = hits["fraction"][row]
        for segment in range(hits["segment"][row] - (node == 0.0), hits["segment"][row] + 1 + (node == 1.0)):
            if 0 <= segment < near.shape[1]:
                near[own[row], segment] = max(near[own[row], segment], ROOM_HELD + radius)


def _see_bends(columns: dict[str, np.ndarray], first: int, nodes: np.ndarray, radius: float, *, is_limp: bool) -> None:
    """Change rows at nodes, from `first` on, so that the shape server keeps the node where the search found it (bends.py).

    A cable without bending does not round its nodes about what is wider than its segments.
    """
    at_node = (columns["fraction"] == 0.0) | (columns["fraction"] == 1.0)
    rows = np.flatnonzero(at_node & (columns["feature"] != FACE) & ~columns["is_crossing"])
    rows = rows[rows >= first]
    if not len(rows):
        return
    node = columns["segment"][rows] + columns["fraction"][rows].astype(np.int64)
    thickness = columns["thickness"][rows]
    is_straight = is_limp & (thickness + radius > np.linalg.norm(np.diff(nodes, axis=0), axis=1).max())
    nearer, beyond = bends.seen_from_segments(nodes, node, nodes[node] - columns["point"][rows], columns["direction"][rows], is_straight)
    is_small = np.abs(nearer) < SMALL * (thickness + radius)  # larger only at a kink, where the cable is no rod
    columns["thickness"][rows] -= np.where((beyond > 0.0) & is_small, nearer, 0.0)
    is_flat = (beyond > bends.FOLLOWED) & (thickness > radius)
    flat = rows[is_flat]
    columns["thickness"][flat] = 0.0
    columns["point"][flat] = (nodes[node] - (columns["gap"][rows] + radius)[:, None] * columns["normal"][rows])[is_flat]
    columns["feature"][flat], columns["direction"][flat], columns["extent"][flat] = FACE, 0.0, 0.0


def _renumbered(previous: Candidates | None, meshes: np.ndarray) -> Candidates | None:
    """Candidates of an earlier search of all bodies, as the search of the meshes alone counts them."""
    if previous is None or not len(meshes):
        return None
    number = np.full(max(int(previous.body.max(initial=-1)), int(meshes.max())) + 1, -1, dtype=np.int64)
    number[meshes] = np.arange(len(meshes))
    columns = {name: getattr(previous, name) for name in Candidates._fields}
    return Candidates(**columns | {"body": number[previous.body]})


def extent(body: Body) -> float:
    """Distance [m] of the furthest point of an exact body from its position."""
    if body.shape is Primitive.PLANE:
        return math.inf
    half, radius = 0.5 * (body.length or 0.0), body.radius or 0.0
    return half + radius if body.shape is Primitive.CAPSULE else math.hypot(half, radius)
