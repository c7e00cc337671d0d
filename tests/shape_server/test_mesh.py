"""Nodes along a cable."""

from __future__ import annotations

import numpy as np
import pytest

from protocol.errors import MessageError
from shape_server import mesh as meshes
from shape_server.mesh import Mesh, doubled, from_nodes, graded, halved


def even(length: float, held: np.ndarray, segments: int) -> Mesh:
    return meshes.even(np.unique([0.0, *held, length]), held, segments)


def test_every_held_point_and_both_ends_are_nodes() -> None:
    held = np.array([0.0, 0.123, 0.777])
    mesh = even(1.0, held, 50)
    np.testing.assert_array_equal(mesh.s[mesh.grasp_nodes], held)
    assert mesh.s[0] == 0.0
    assert mesh.s[-1] == 1.0


@pytest.mark.parametrize("segments", [12, 25, 400])
def test_segments_are_about_as_many_and_as_long_as_asked(segments: int) -> None:
    mesh = even(2.0, np.array([0.3, 1.1]), segments)
    assert abs(len(mesh.lengths) - segments) <= 2
    assert mesh.lengths.sum() == pytest.approx(2.0, abs=1e-15)
    if segments >= 25:
        assert mesh.lengths.max() / mesh.lengths.min() < 1.2


def test_held_points_very_near_each_other_keep_a_segment_between_them() -> None:
    mesh = even(1.0, np.array([0.5, 0.5 + 1e-6]), 20)
    assert len(np.unique(mesh.grasp_nodes)) == 2
    assert (mesh.lengths > 0).all()


def test_a_point_lies_in_the_segment_that_it_is_located_in() -> None:
    mesh = even(1.0, np.array([0.0, 1.0]), 10)
    s = np.random.default_rng(1).uniform(0, 1, 100)
    segment, fraction = mesh.locate(s)
    np.testing.assert_allclose(mesh.s[segment] + fraction * mesh.lengths[segment], s, atol=1e-15)


@pytest.mark.parametrize(("s", "expected"), [(0.0, (0, 0.0)), (1.0, (9, 1.0)), (0.5, (5, 0.0))])
def test_a_point_at_a_node_is_located_at_an_end_of_its_segment(s: float, expected: tuple[int, float]) -> None:
    segment, fraction = even(1.0, np.array([0.0, 1.0]), 10).locate(np.array([s]))
    assert segment[0] == expected[0]
    assert fraction[0] == pytest.approx(expected[1], abs=1e-14)


def test_nodes_that_do_not_reach_the_end_are_refused_by_name() -> None:
    with pytest.raises(MessageError, match=r"start\.s: runs from 0 to 0\.9 m; must run from 0 to the length, 1 m") as caught:
        from_nodes(np.linspace(0, 0.9, 10), 1.0, np.array([0.0]))
    assert caught.value.key == "start.s"


def test_a_held_point_between_nodes_is_refused_by_name() -> None:
    with pytest.raises(MessageError, match=r"no node at the held point 0\.55 m"):
        from_nodes(np.linspace(0, 1, 11), 1.0, np.array([0.0, 0.55]))


def test_rounding_in_the_arc_length_of_a_held_point_is_forgiven() -> None:
    mesh = from_nodes(np.linspace(0, 1, 11), 1.0, np.array([0.1 + 2e-16, 1.0 - 1e-12]))
    np.testing.assert_array_equal(mesh.grasp_nodes, [1, 10])


@pytest.mark.parametrize("count", [1, 2, 3, 10, 11])
def test_a_halved_mesh_keeps_ends_and_held_points(count: int) -> None:
    fine = even(1.0, np.array([0.0, 1.0]) if count < 3 else np.array([0.0, 0.3, 1.0]), count)
    coarse = halved(fine)
    assert set(coarse.s) <= set(fine.s)
    np.testing.assert_array_equal(coarse.s[coarse.grasp_nodes], fine.s[fine.grasp_nodes])
    assert coarse.s[0] == 0.0
    assert coarse.s[-1] == 1.0
    assert len(coarse.lengths) <= max(1, len(fine.lengths) // 2 + len(fine.grasp_nodes))


def test_a_doubled_mesh_has_every_segment_cut_into_two() -> None:
    coarse = even(1.0, np.array([0.0, 0.3, 1.0]), 11)
    fine = doubled(coarse)
    np.testing.assert_array_equal(fine.s[::2], coarse.s)
    np.testing.assert_array_equal(fine.s[fine.grasp_nodes], coarse.s[coarse.grasp_nodes])
    np.testing.assert_allclose(halved(fine).s, coarse.s, atol=1e-16)


@pytest.mark.parametrize("layer", [1e-2, 1e-4, 1e-6])
def test_a_graded_mesh_is_as_fine_as_each_layer_asks_and_no_finer_elsewhere(layer: float) -> None:
    places = np.array([0.0, 0.4, 1.0])
    mesh = graded(places, places[[0, 2]], 24, np.array([0.0, 0.4]), np.array([layer, 3 * layer]))
    for centre, own in ((0.0, layer), (0.4, 3 * layer)):
        beside = np.abs(0.5 * (mesh.s[1:] + mesh.s[:-1]) - centre) < own
        assert mesh.lengths[beside].max() < own / 1.2  # asked: 1.5 times shorter at the centre, a little more beside it
    assert mesh.lengths.max() < 1.2 / 24
    assert len(mesh.lengths) < 24 + 16 * np.log(1 / layer)  # grows with the logarithm
    growth = mesh.lengths[1:] / mesh.lengths[:-1]
    assert np.maximum(growth, 1 / growth).max() < 2.0
