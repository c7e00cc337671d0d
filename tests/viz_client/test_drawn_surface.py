from __future__ import annotations

import numpy as np
import pytest
import trimesh
from synthetic import block

from viz_client.surface import bisected, smoothed


def test_a_box_keeps_its_sharp_edges():
    solid = block("box", (1.0, 2.0, 3.0))
    surface = smoothed(solid.vertices, solid.triangles)
    assert len(surface.vertices) == 24
    assert sorted(np.abs(surface.normals).max(axis=1)) == pytest.approx([1.0] * 24)


def test_a_ball_stays_round():
    ball = trimesh.creation.icosphere(subdivisions=3, radius=2.0)
    surface = smoothed(np.array(ball.vertices), np.array(ball.faces))
    assert len(surface.vertices) == len(ball.vertices)
    assert np.einsum("ij,ij->i", surface.normals, surface.vertices / 2.0).min() > 0.999


def test_vertices_given_once_per_triangle_are_welded():
    ball = trimesh.creation.icosphere(subdivisions=2)
    soup = np.array(ball.vertices[ball.faces].reshape(-1, 3))
    surface = smoothed(soup, np.arange(len(soup)).reshape(-1, 3))
    assert len(surface.vertices) == len(ball.vertices)


def test_a_cylinder_is_round_along_its_wall_and_sharp_at_its_rim():
    cylinder = trimesh.creation.cylinder(1.0, 2.0, sections=24)
    surface = smoothed(np.array(cylinder.vertices), np.array(cylinder.faces))
    assert set(np.round(np.abs(surface.normals[:, 2]), 6)) == {0.0, 1.0}


def test_triangles_without_area_and_torn_surfaces_do_no_harm():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0], [0, 0, 1]])
    triangles = np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4], [1, 0, 2], [2, 2, 2]])
    surface = smoothed(vertices, triangles)
    assert len(surface.triangles) == 3
    assert np.isfinite(surface.normals).all()
    assert len(smoothed(vertices, triangles[:0]).triangles) == 0


def test_bisecting_shortens_the_edges_and_keeps_the_surface():
    solid = block("box", (1.0, 2.0, 3.0))
    surface = bisected(smoothed(solid.vertices, solid.triangles), 0.3)
    corners = surface.vertices[surface.triangles]
    assert np.linalg.norm(np.roll(corners, 1, axis=1) - corners, axis=2).max() <= 0.3
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert 0.5 * np.linalg.norm(areas, axis=1).sum() == pytest.approx(22.0)
    assert np.einsum("ij,ij->i", areas, surface.normals[surface.triangles[:, 0]]).min() > 0
