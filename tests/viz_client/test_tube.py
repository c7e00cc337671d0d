from __future__ import annotations

import numpy as np
import pytest

from viz_client.tube import resampled, tube


def helix(count: int) -> np.ndarray:
    angle = np.linspace(0.0, 4 * np.pi, count)
    return np.stack([0.2 * np.cos(angle), 0.2 * np.sin(angle), 0.02 * angle], axis=1)


def volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@pytest.mark.parametrize("sides", [3, 8, 16])
def test_a_tube_is_closed_and_turned_outwards(sides):
    surface = tube(helix(50), 0.01, sides=sides)
    edges = np.concatenate([surface.triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    assert len(np.unique(edges, axis=0)) == len(edges)
    assert {tuple(edge) for edge in edges.tolist()} == {(b, a) for a, b in edges.tolist()}
    assert volume(surface.vertices, surface.triangles) > 0


def test_every_corner_lies_on_the_radius_square_to_the_tangent():
    nodes = helix(200)
    surface = tube(nodes, 0.01, sides=12)
    spokes = surface.vertices[:-2].reshape(200, 12, 3) - nodes[:, None, :]
    assert np.abs(np.linalg.norm(spokes, axis=2) - 0.01).max() < 1e-12
    tangents = nodes[2:] - nodes[:-2]
    along = np.einsum("ijk,ik->ij", spokes[1:-1], tangents / np.linalg.norm(tangents, axis=1)[:, None])
    assert np.abs(along).max() < 1e-6


def test_the_volume_is_that_of_the_swept_polygon():
    nodes = helix(2000)
    length = np.linalg.norm(np.diff(nodes, axis=0), axis=1).sum()
    surface = tube(nodes, 0.01, sides=12)
    polygon = 0.5 * 12 * 0.01**2 * np.sin(2 * np.pi / 12)
    # Pappus: a sweep without twist along the middle of the section; measured 2e-6 off at 2000 nodes.
    assert volume(surface.vertices, surface.triangles) == pytest.approx(polygon * length, rel=1e-4)


def test_the_rings_do_not_turn_about_the_cable():
    """Between neighbours, the first corner moves only as the tangent tilts: dU/ds has no part along t x u."""
    nodes = helix(400)
    surface = tube(nodes, 1.0, sides=4)
    spokes = surface.vertices[:-2].reshape(400, 4, 3) - nodes[:, None, :]
    turn = np.einsum("ij,ij->i", np.diff(spokes[:, 0], axis=0), 0.5 * (spokes[1:, 1] + spokes[:-1, 1]))
    assert np.abs(turn[1:-1]).max() < 1e-5  # a frame that follows the curve's binormal turns by 3e-3 a node


@pytest.mark.parametrize(
    "nodes",
    [
        [[0, 0, 0], [0, 0, 1]],
        [[0, 0, 0], [0, 0, 0], [1, 0, 0]],
        [[0, 0, 0], [1, 0, 0], [1, 0, 0]],
        [[0, 0, 0], [1, 0, 0], [0, 0, 0]],
        [[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 0, 0]],
        [[1, 1, 1], [1, 1, 1]],
    ],
)
def test_straight_folded_and_coinciding_nodes_give_finite_tubes(nodes):
    surface = tube(np.array(nodes, dtype=float), 0.1, sides=6)
    assert np.isfinite(surface.vertices).all()
    spokes = surface.vertices[:-2].reshape(len(nodes), 6, 3) - np.array(nodes)[:, None, :]
    assert np.linalg.norm(spokes, axis=2) == pytest.approx(0.1)


def test_resampling_keeps_the_ends_and_spaces_evenly():
    points = resampled(helix(300), 50)
    assert points[[0, -1]] == pytest.approx(helix(300)[[0, -1]])
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert np.ptp(step) < 1e-3 * step.mean()
