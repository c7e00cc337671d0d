from __future__ import annotations

import numpy as np
import pytest
import trimesh

from env_server.surface import Surface, join
from env_server.tree import gather
from protocol.errors import SceneError

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
TWO = np.array([[0, 1, 2], [0, 2, 3]])


def box_surface(*, turned_over: bool = False) -> Surface:
    box = trimesh.creation.box((0.1, 0.2, 0.3))
    return Surface(box.vertices, box.faces[:, ::-1] if turned_over else box.faces)


def active(owned: np.ndarray) -> int:
    return int((owned >= 0).sum())


def test_a_box_has_twelve_edges_and_eight_vertices_to_touch() -> None:
    features = box_surface().features
    assert active(features.own_edges) == 12
    assert active(features.own_vertices) == 8


def test_turning_triangles_over_changes_no_feature() -> None:
    one, other = box_surface().features, box_surface(turned_over=True).features
    assert active(other.own_edges) == active(one.own_edges)
    assert active(other.own_vertices) == active(one.own_vertices)


def test_planes_of_edges_point_into_their_triangles() -> None:
    features = box_surface().features
    vertices = features.vertices
    for edge in range(len(features.edge_ends)):
        planes = features.edge_planes[features.edge_first[edge] : features.edge_first[edge + 1]]
        heights = features.edge_ends[edge] @ planes[:, :3].T - planes[:, 3]
        assert np.abs(heights).max() < 1e-15
        assert len(planes) == 2
        assert (vertices @ planes[:, :3].T - planes[:, 3]).max() > 0.05


def test_the_diagonal_of_a_square_is_no_edge_and_its_rim_is() -> None:
    features = Surface(SQUARE, TWO).features
    assert active(features.own_edges) == 4
    assert active(features.own_vertices) == 4
    assert len(features.edge_ends) == 5


def test_coincident_vertices_are_joined() -> None:
    soup = SQUARE[TWO].reshape(-1, 3)
    features = Surface(soup, np.arange(6).reshape(2, 3)).features
    assert len(features.edge_ends) == 5
    assert active(features.own_edges) == 4


def test_duplicate_and_degenerate_triangles_are_left_out() -> None:
    triangles = np.vstack([TWO, TWO[:, ::-1], [[0, 0, 1], [2, 2, 2]]])
    features = Surface(SQUARE, triangles).features
    assert sorted(features.triangle_ids) == [0, 1]


def test_an_edge_may_be_shared_by_three_triangles() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.5, -1, 1], [0.5, -1, -1]])
    features = Surface(vertices, np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]])).features
    assert sorted(np.diff(features.edge_first)) == [1, 1, 1, 1, 1, 1, 3]


def test_the_tree_finds_every_triangle_whose_box_is_in_reach() -> None:
    sphere = trimesh.creation.icosphere(3, 0.1)
    features = Surface(sphere.vertices, sphere.faces).features
    corners = sphere.vertices[sphere.faces[features.triangle_ids]]
    near, stack, random = np.empty(len(corners), np.int64), np.empty(64, np.int64), np.random.default_rng(1)
    for _ in range(200):
        start, end = random.uniform(-0.12, 0.12, (2, 3))
        count = gather(features.boxes, int(features.surfaces["depth"][0]), tuple(start), tuple(end), 0.01, (0, len(corners)), near, stack)
        low, high = np.minimum(start, end) - 0.01, np.maximum(start, end) + 0.01
        overlaps = ((corners.min(axis=1) <= high) & (corners.max(axis=1) >= low)).all(axis=1)
        assert set(np.flatnonzero(overlaps)) <= set(near[:count])
        assert len(set(near[:count])) == count


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 7, 9, 16, 17, 33])
def test_every_triangle_is_in_the_tree_once(count: int) -> None:
    soup = np.random.default_rng(count).uniform(-1, 1, (3 * count, 3))
    features = Surface(soup, np.arange(3 * count).reshape(-1, 3)).features
    near, stack = np.empty(count, np.int64), np.empty(64, np.int64)
    everywhere = gather(
        features.boxes, int(features.surfaces["depth"][0]), (-2.0, -2.0, -2.0), (2.0, 2.0, 2.0), 0.0, (0, count), near, stack
    )
    assert everywhere == count
    assert sorted(features.triangle_ids) == list(range(count))
    assert np.allclose(features.boxes[0], [*soup.min(axis=0), *soup.max(axis=0)])


def test_joined_surfaces_keep_their_features() -> None:
    parts = [Surface(SQUARE, TWO), box_surface()]
    joined = join(parts)
    assert active(joined.own_edges) == 16
    edge = joined.own_edges[joined.own_edges >= 0].max()
    assert np.array_equal(joined.edge_ends[edge], parts[1].features.edge_ends[edge - joined.surfaces["first_edge"][1]])
    rows = slice(joined.edge_first[edge], joined.edge_first[edge + 1])
    assert np.abs(joined.edge_ends[edge] @ joined.edge_planes[rows, :3].T - joined.edge_planes[rows, 3]).max() < 1e-15


def test_a_surface_does_not_change() -> None:
    surface = box_surface()
    with pytest.raises(AttributeError, match="does not change"):
        surface.features = surface.features
    with pytest.raises(ValueError, match="read-only"):
        surface.features.planes[0] = 0


@pytest.mark.parametrize(
    ("vertices", "triangles", "sentence"),
    [
        (SQUARE, [[0, 1, 4]], "outside 0 to 3"),
        (SQUARE * np.nan, TWO, "not finite"),
        (SQUARE, [[0, 1, 1]], "has an area"),
        (SQUARE[:, :2], TWO, "must be"),
        (SQUARE, TWO.astype(float), "must be integers"),
    ],
)
def test_a_wrong_mesh_is_refused_with_a_sentence(vertices: np.ndarray, triangles: object, sentence: str) -> None:
    with pytest.raises(SceneError, match=sentence):
        Surface(vertices, np.asarray(triangles))
