"""Where a cable touches rigid surfaces, or may do so soon: every local minimum of the distance within reach.

The cable is a tube of one radius around a polyline axis. A place of contact is a pair of points, c on the axis and q on a
surface, with distance d = |c - q|, gap = d - radius and normal n = (c - q) / d. Pairs that are reported:

    face     c is a node and lies straight over q, inside a triangle
    edge     q is inside an edge and the point of the edge's line closest to the segment; c inside the segment, or a node
    vertex   q is a vertex and c the point of the segment closest to it

and n must lie in the normal cone of the feature (surface.py), which makes q a local minimum over the surface. The
closest pair of all is one of these, so nothing within reach is missed. Left out are pairs whose line of sight from c to q
is cut by the same surface (the far side of a wall), and of pairs at one node with normals within one degree of each other
all but the nearest. A concave corner keeps one pair for each of its walls.

Where the axis is closer than 1e-9 m to the surface or crosses it, n is undefined and the cable has tunnelled: such a pair
is marked as crossing, has gap = -radius, and gets the normal that the same place had in the previous search, or else that
of the face, towards the side of the segment's earlier node. No sign is ever taken from a face otherwise.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple, final

import numpy as np

from protocol.errors import SceneError

from . import edges
from .beyond import find
from .distances import fixed, total_and_shortest
from .piece_hits import FACE
from .skin import Lists, lists, no_lists
from .surface import Surface, join

COMPILED: Final = (
    "hits",
    "piece_hits",
    "pairs",
    "distances",
    "surface",
    "tree",
    "skin",
    "beyond",
    "edges",
    "round_hits",
)  # files with what numba compiles of the search
STAMP: Final = "search.stamp"  # beside numba's cache: what the code in it was compiled from
NOTHING: Final = fixed(np.zeros((0, 0)), np.bool_)  # is excluded
NEIGHBOURHOOD: Final = 1.5  # segments along the cable within which a previous normal still holds


class Candidates(NamedTuple):
    """Places of contact within reach, by body, then along the cable, the nearest first; arrays are read-only."""

    segment: np.ndarray  # (m,) int, of the cable
    fraction: np.ndarray  # (m,) along that segment, 0 to 1; exactly 0 or 1 at a node
    body: np.ndarray  # (m,) int, index of the surface
    feature: np.ndarray  # (m,) int, a `Feature`
    feature_id: np.ndarray  # (m,) int, of the triangle or vertex in the mesh as given, or a number of the edge
    point: np.ndarray  # (m, 3) m, on the body
    normal: np.ndarray  # (m, 3) unit, from the body to the axis of the cable
    direction: np.ndarray  # (m, 3) unit, along the edge; zero for faces and vertices
    extent: np.ndarray  # (m, 2) m, from point back and on along direction to where the edge's line leaves the surface
    gap: np.ndarray  # (m,) m, between body and cable; negative where it penetrates
    is_crossing: np.ndarray  # (m,) bool, the axis itself touches or crosses the surface
    thickness: np.ndarray  # (m,) m, radius of an exact body about `point`; zero on triangles
    is_beyond: np.ndarray  # (m,) bool, an edge that the contact beside it can slide on to; point is where it begins
    clearance: np.ndarray  # (n-1,) m, distance from axis to the nearest body per segment, at most reach + radius

    @property
    def penetration(self) -> float:
        """Deepest penetration [m] of the cable into any body; its radius where the axis crosses."""
        return float(max(0.0, -self.gap.min(initial=0.0)))


@final
class Touch:
    """Contact search between one cable and a fixed set of rigid surfaces that move.

    Args:
        surfaces: One for each body; the index in this sequence is the `body` of the candidates.
    """

    __slots__ = ("_edges", "_features", "_listed", "_unlisted", "body_count")

    def __init__(self, surfaces: Sequence[Surface]) -> None:
        self.body_count: Final = len(surfaces)
        self._features: Final = join(surfaces or [_tetrahedron()])
        self._edges: Final = edges.edge_table(self._features)
        self._unlisted: Final = no_lists()
        self._listed: Final[dict[int, Lists]] = {}

    def search(
        self,
        nodes: np.ndarray,
        poses: np.ndarray,
        radius: float,
        reach: float,
        *,
        cable: int | None = None,
        excluded: np.ndarray | None = None,
        previous: Candidates | None = None,
    ) -> Candidates:
        """Find every place of contact with a gap below `reach`.

        Args:
            nodes: (n, 3) [m] Polyline axis of the cable; n >= 2.
            poses: (b, 7) [m, -] Position and quaternion of every surface.
            radius: [m] Of the cable.
            reach: [m] Largest gap that is reported.
            cable: Which cable this is, for whom to remember what is near; that makes the next search quicker and changes no result.
            excluded: (n-1, b) True where a segment may pass through a body, as near a gripper that holds it. A node
                is left out only with both of its segments.
            previous: Candidates of the last step, whose normals are kept where the axis crosses a surface.

        Raises:
            SceneError: If an array has a wrong shape or a value that is not finite.
        """
        nodes, poses = fixed(nodes, np.float64), fixed(poses, np.float64)
        mask = NOTHING if excluded is None else fixed(excluded, np.bool_)
        self._check(nodes, poses, radius, reach, excluded)
        known, capacity = self._lists(cable, len(nodes) - 1), 64 + 8 * len(nodes)
        while True:
            count, names, flags, numbers = find(self._features, self._edges, known, nodes, poses, radius, reach, mask, capacity)
            if count <= capacity:
                break
            capacity = 2 * count
        return _candidates(names, flags, numbers, previous)

    def _lists(self, cable: int | None, segments: int) -> Lists:
        """The lists of a cable, new ones if it has other segments than before."""
        if cable is None:
            return self._unlisted
        known = self._listed.get(cable)
        if known is None or known.counts.shape[2] != segments:
            known = self._listed[cable] = lists(self.body_count, segments)
        return known

    def _check(self, nodes: np.ndarray, poses: np.ndarray, radius: float, reach: float, excluded: np.ndarray | None) -> None:
        if nodes.ndim != 2 or nodes.shape[1] != 3 or len(nodes) < 2:
            raise SceneError(f"nodes: shape {nodes.shape} must be (n, 3) with n >= 2", key="nodes")
        if poses.shape != (self.body_count, 7):
            raise SceneError(f"poses: shape {poses.shape} must be ({self.body_count}, 7), one row for each surface", key="poses")
        if excluded is not None and excluded.shape != (len(nodes) - 1, self.body_count):
            raise SceneError(f"excluded: shape {excluded.shape} must be ({len(nodes) - 1}, {self.body_count})", key="excluded")
        total, shortest = total_and_shortest(nodes, poses)
        # A sum is finite only where all its terms are.
        if not math.isfinite(total + radius + reach):
            raise SceneError("nodes, poses, radius and reach: must be finite", key="nodes")
        # A zero quaternion would put the body nowhere, and its contacts would vanish without a word.
        if not shortest > 0.7:
            raise SceneError("poses: every quaternion must have length 1", key="poses")


def warm_up() -> None:
    """Compile or load everything that a search runs."""
    compiled = is_compiled()
    if not compiled:
        # numba sees a change of a function's own file, but not of one that it calls.
        for name in COMPILED:
            for path in _cache().glob(f"{name}.*.nb[ic]"):
                path.unlink(missing_ok=True)
    Touch([_tetrahedron()]).search(np.eye(2, 3), np.array([[0.0, 0, 0, 0, 0, 0, 1]]), 0.1, 0.1)
    if not compiled:
        (_cache() / STAMP).write_text(_fingerprint(), encoding="ascii")


def is_compiled() -> bool:
    """Is the search ready, in this process or on disk, so that `warm_up` takes less than a second?"""
    dispatcher: Any = find
    stamp = _cache() / STAMP
    return bool(dispatcher.signatures) or (stamp.is_file() and stamp.read_text(encoding="ascii") == _fingerprint())


def _cache() -> Path:
    dispatcher: Any = find
    return Path(dispatcher.stats.cache_path)


def _fingerprint() -> str:
    """Hash of all that the search is compiled from."""
    here = Path(__file__).parent
    return hashlib.sha256(b"".join((here / f"{name}.py").read_bytes() for name in COMPILED)).hexdigest()


def _tetrahedron() -> Surface:
    return Surface(np.vstack([np.zeros(3), np.eye(3)]), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))


def keep_normals(found: Mapping[str, np.ndarray] | np.ndarray, is_crossing: np.ndarray, previous: Candidates) -> None:
    """Give crossings the normal that the nearest place on the same body had in the previous search; `found` are columns or pairs."""
    places = previous.segment + previous.fraction
    segment, fraction, body, feature, normals = (found[name] for name in ("segment", "fraction", "body", "feature", "normal"))
    for index in np.flatnonzero(is_crossing):
        away = np.where(previous.body == body[index], np.abs(places - segment[index] - fraction[index]), np.inf)
        if away.min(initial=np.inf) > NEIGHBOURHOOD:
            continue
        normal = previous.normal[np.argmin(away)]
        if feature[index] == FACE:
            # The plane of a face has two sides; only which of them is a matter of history.
            normals[index] *= 1.0 if normals[index] @ normal >= 0.0 else -1.0
        else:
            normals[index] = normal


def _candidates(names: np.ndarray, flags: np.ndarray, numbers: np.ndarray, previous: Candidates | None) -> Candidates:
    """Candidates from the arrays of `pairs.columns`."""
    count = names.shape[1]
    if previous is not None and flags[0].any():
        normals = numbers[6 * count : 9 * count].reshape(count, 3)
        found = {"segment": names[0], "body": names[1], "feature": names[2], "fraction": numbers[:count], "normal": normals}
        keep_normals(found, flags[0], previous)
    for array in (names, flags, numbers):
        array.setflags(write=False)  # and so are all views that are made of it from here on
    singles, vectors = numbers[: 3 * count].reshape(3, count), numbers[3 * count : 12 * count].reshape(3, count, 3)
    # Rows by their number: to unpack an array takes three times as long.
    return Candidates(
        segment=names[0],
        fraction=singles[0],
        body=names[1],
        feature=names[2],
        feature_id=names[3],
        point=vectors[0],
        normal=vectors[1],
        direction=vectors[2],
        extent=numbers[12 * count : 14 * count].reshape(count, 2),
        gap=singles[1],
        is_crossing=flags[0],
        thickness=singles[2],
        is_beyond=flags[1],
        clearance=numbers[14 * count :],
    )
