"""Edges beyond the one that is touched, and how far edges go on: the kernels against a plain reading of what they are to find."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation
from test_touch import RADIUS, straight
from trimesh import creation

from env_server.beyond import add_edges_beyond, write_extents
from env_server.edges import CLOSE, SLIDE
from env_server.hits import find_hits
from env_server.pairs import PAIR
from env_server.piece_hits import EDGE, FACE, VERTEX
from env_server.skin import no_lists
from env_server.surface import Surface
from env_server.touch import Touch

Named = tuple[int, int, int]  # segment, body and edge


def turn(pose: np.ndarray) -> np.ndarray:
    return np.asarray(Rotation.from_quat(pose[3:]).as_matrix())


def expected(touch: Touch, hits: np.ndarray, poses: np.ndarray, close: float) -> dict[Named, np.ndarray]:
    """Where every edge begins that leaves a vertex touched, or an end near by of an edge touched; those not found by themselves."""
    found = {(hit["segment"], hit["body"], hit["feature_id"]) for hit in hits if hit["feature"] == EDGE}
    out: dict[Named, np.ndarray] = {}
    table, ends = touch._edges, touch._features.edge_ends
    for hit in hits:
        if hit["feature"] == FACE or hit["is_crossing"] or hit["distance"] >= close:
            continue
        body, pose = hit["body"], poses[hit["body"]]
        first = touch._features.surfaces[body]
        own, vertices = -1, [first["first_vertex"] + hit["feature_id"]]
        if hit["feature"] == EDGE:
            own = first["first_edge"] + hit["feature_id"]
            away = np.linalg.norm(ends[own] @ turn(pose).T + pose[:3] - hit["point"], axis=1)
            vertices = list(table.vertex[own][away < SLIDE])
        for vertex in vertices:
            for edge in table.leaving[table.first_leaving[vertex] : table.first_leaving[vertex + 1]]:
                key = (hit["segment"], body, edge - first["first_edge"])
                if edge != own and key not in found and key not in out:
                    out[key] = turn(pose) @ ends[edge, 0 if table.vertex[edge, 0] == vertex else 1] + pose[:3]
    return out


def bodies(rng: np.random.Generator) -> tuple[Touch, np.ndarray]:
    box, ball = creation.box((0.03, 0.02, 0.01)), creation.icosphere(0, 0.02)
    poses = np.zeros((2, 7))
    poses[:, :3] = [[-0.02, 0.0, -0.008], [0.02, 0.0, -0.02]] + 1e-3 * rng.normal(size=(2, 3))
    poses[:, 3:] = Rotation.from_rotvec(rng.normal(size=(2, 3))).as_quat()
    return Touch([Surface(box.vertices, box.faces), Surface(ball.vertices, ball.faces)]), poses


def test_the_edges_beyond_are_those_that_leave_what_is_touched() -> None:
    rng, more = np.random.default_rng(7), 0
    for _ in range(60):
        touch, poses = bodies(rng)
        nodes = straight((-0.05, 0.0, 0.0), (0.05, 0.0, 0.0), 20) + 1e-4 * rng.normal(size=(21, 3))
        none = np.zeros((0, 0), dtype=np.bool_)
        count, hits, _ = find_hits(touch._features, no_lists(), nodes, poses, RADIUS, RADIUS + 8e-3, none, 2000)
        close = RADIUS + 5 * CLOSE
        wanted = expected(touch, hits[:count], poses, close)
        total = add_edges_beyond(touch._features, touch._edges, hits, count, poses, close)
        named = [(hit["segment"], hit["body"], hit["feature_id"]) for hit in hits[count:total]]
        assert named == list(wanted)
        for hit in hits[count:total]:
            assert hit["feature"] == EDGE
            place = wanted[(hit["segment"], hit["body"], hit["feature_id"])]
            assert np.abs(hit["point"] - place).max() < 1e-15  # measured 1.4e-17
        more += total - count
    assert more > 200


def test_the_lines_of_edges_end_where_their_edges_do() -> None:
    rng = np.random.default_rng(8)
    touch, poses = bodies(rng)
    features, table = touch._features, touch._edges
    hits, first = np.zeros(len(features.edge_ends), dtype=PAIR), features.surfaces["first_edge"]
    body = np.searchsorted(first, np.arange(len(hits)), side="right") - 1
    hits["body"], hits["feature"], hits["feature_id"] = body, EDGE, np.arange(len(hits)) - first[body]
    ends = np.array([corners @ turn(poses[b]).T + poses[b, :3] for corners, b in zip(features.edge_ends, body, strict=True)])
    along = ends[:, 1] - ends[:, 0]
    hits["direction"] = along / np.linalg.norm(along, axis=1, keepdims=True)
    hits["point"] = ends[:, 0] + 0.3 * along
    extent = np.zeros((len(hits), 2))
    write_extents(features, table, hits, poses, extent)
    for end, sign in ((0, 1.0), (1, -1.0)):
        reached = hits["point"] + (extent[:, end] + sign * table.margins[:, end])[:, None] * hits["direction"]
        assert np.abs(reached - ends[:, end]).max() < 1e-15  # measured 7e-18
    hits["feature"] = VERTEX
    extent[:] = 0.0
    write_extents(features, table, hits, poses, extent)
    assert not extent.any()


def test_there_is_room_for_as_many_edges_beyond_as_there_are() -> None:
    rng = np.random.default_rng(9)
    touch, poses = bodies(rng)
    nodes = straight((-0.05, 0.0, 0.0), (0.05, 0.0, 0.0), 20)
    none = np.zeros((0, 0), dtype=np.bool_)
    own, hits, _ = find_hits(touch._features, no_lists(), nodes, poses, RADIUS, RADIUS + 8e-3, none, 2000)
    total = add_edges_beyond(touch._features, touch._edges, hits, own, poses, 0.02)
    assert total > own
    short = hits[:own].copy()
    assert add_edges_beyond(touch._features, touch._edges, short, own, poses, 0.02) == total  # the room that is needed
