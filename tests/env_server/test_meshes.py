"""Surfaces of bodies: what is read is what can be touched, and what is wrong is said in a sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from env_server.meshes import clean, load_body, place_clips, thin_out
from protocol.errors import SceneError
from protocol.scene import Body


def said(body: Body) -> str:
    with pytest.raises(SceneError) as caught:
        load_body(body, "bodies[0]")
    assert caught.value.key.startswith("bodies[0]")
    return str(caught.value)


def test_an_unknown_name_lists_the_known_ones() -> None:
    assert said(Body(name="a", generate="dashbord")) == "bodies[0].generate: 'dashbord' unknown; there are 'dashboard', 'beam'"


def test_a_missing_file_is_a_sentence(tmp_path: Path) -> None:
    assert "does not exist; give a mesh file" in said(Body(name="a", mesh=str(tmp_path / "none.stl")))


@pytest.mark.parametrize(
    ("name", "content"), [("a.stl", b"no mesh"), ("a.obj", b"v 0 0\nf 1 2 9"), ("a.glb", b"\0" * 40), ("a.xyzzy", b"")]
)
def test_an_unreadable_file_is_a_sentence(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    assert "bodies[0].mesh: " in said(Body(name="a", mesh=str(tmp_path / name)))


def test_a_mesh_without_triangles_is_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    assert "holds no triangles" in said(Body(name="a", mesh=str(tmp_path / "a.obj")))


def test_a_mesh_in_millimetres_is_a_sentence(tmp_path: Path) -> None:
    trimesh.creation.box((1400.0, 500.0, 400.0)).export(tmp_path / "a.stl")
    assert "scale it to metres" in said(Body(name="a", mesh=str(tmp_path / "a.stl")))


def test_a_mesh_that_is_not_finite_is_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n")
    assert "bodies[0].mesh: " in said(Body(name="a", mesh=str(tmp_path / "a.obj")))


@pytest.mark.parametrize("ending", ["stl", "obj", "ply", "glb", "off"])
def test_a_box_keeps_its_size_in_every_format(tmp_path: Path, ending: str) -> None:
    trimesh.creation.box((0.1, 0.2, 0.3)).export(tmp_path / f"box.{ending}")
    mesh = load_body(Body(name="a", mesh=str(tmp_path / f"box.{ending}")), "bodies[0]")
    assert mesh.vertices.shape == (8, 3)
    assert mesh.triangles.shape == (12, 3)
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx([0.1, 0.2, 0.3], abs=1e-7)  # STL holds float32


def test_cleaning_drops_what_has_no_area_or_occurs_twice() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0, 0], [0, 0, 0]])
    triangles = np.array([[0, 1, 2], [1, 2, 4], [0, 3, 1], [0, 4, 2]])
    kept_vertices, kept = clean(vertices, triangles)
    assert kept.shape == (1, 3)
    assert kept_vertices.shape == (3, 3)


def test_cleaning_leaves_generated_bodies_closed() -> None:
    mesh = load_body(Body(name="a", generate="dashboard"), "bodies[0]")
    assert trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False).is_watertight


def test_thinning_out_moves_no_vertex_further_than_a_cell() -> None:
    ball = trimesh.creation.icosphere(4, 0.1)
    vertices, triangles = thin_out(ball.vertices, ball.faces, 0.02)
    assert len(triangles) < 0.3 * len(ball.faces)
    assert np.abs(np.linalg.norm(vertices, axis=1) - 0.1).max() < 0.02


def test_clips_are_placed_with_their_body() -> None:
    body = Body(name="a", generate="beam", position=(1.0, 2.0, 3.0), quaternion=(0.0, 0.0, -1.0, 1.0))
    mesh = load_body(body, "bodies[0]")
    position, axis = place_clips(body, mesh)["tab_1"]
    x, y, z = mesh.clips["tab_1"].position
    assert position == pytest.approx([1.0 + y, 2.0 - x, 3.0 + z], abs=1e-12)
    assert axis == pytest.approx([-(0.5**0.5), 0.0, 0.5**0.5], abs=1e-12)
