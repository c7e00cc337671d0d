"""The generated bodies: closed, the same every time, and with clips where a harness can reach them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from env_server.dashboard import BEND, GENERATED, THICKNESS, Generated, generate

BODIES = {kind: generate(kind) for kind in GENERATED}


def surface(body: Generated) -> trimesh.Trimesh:
    return trimesh.Trimesh(body.vertices, body.triangles, process=False)


def crossings(body: Generated, start: np.ndarray, direction: np.ndarray, length: float) -> int:
    """How often a segment passes through the surface."""
    corners = body.vertices[body.triangles] - start
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    steep = normal @ direction != 0.0
    corners, normal = corners[steep], normal[steep]
    along = np.einsum("ij,ij->i", normal, corners[:, 0]) / (normal @ direction)
    point = along[:, None] * direction
    sides = [np.einsum("ij,ij->i", np.cross(corners[:, i - 2] - corners[:, i], point - corners[:, i]), normal) for i in range(3)]
    return int(((along >= 0.0) & (along <= length) & (np.min(sides, axis=0) >= 0.0)).sum())


@pytest.mark.parametrize("kind", GENERATED)
def test_a_generated_body_is_one_closed_surface_with_its_outside_out(kind: str) -> None:
    mesh = surface(BODIES[kind])
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.body_count == 1
    assert mesh.volume > 1e-3


@pytest.mark.parametrize("kind", GENERATED)
def test_a_body_is_made_the_same_every_time(kind: str) -> None:
    again = generate(kind)
    assert again.vertices.tobytes() == BODIES[kind].vertices.tobytes()
    assert again.triangles.tobytes() == BODIES[kind].triangles.tobytes()
    assert again.clips == BODIES[kind].clips


@pytest.mark.parametrize("kind", GENERATED)
def test_a_clip_is_a_hole_with_material_around_it(kind: str) -> None:
    body = BODIES[kind]
    for clip in body.clips.values():
        position, axis = np.array(clip.position), np.array(clip.axis)
        beside = np.array([1.0, 0.0, 0.0]) - axis[0] * axis
        beside *= 0.009 / np.linalg.norm(beside)
        assert crossings(body, position + 0.002 * axis, -axis, 0.006) == 0
        assert crossings(body, position + beside + 0.002 * axis, -axis, 0.006) == 2


@pytest.mark.parametrize("kind", GENERATED)
def test_a_clip_lies_on_the_outer_side_of_its_sheet(kind: str) -> None:
    body = BODIES[kind]
    for clip in body.clips.values():
        position, axis = np.array(clip.position), np.array(clip.axis)
        distance = np.linalg.norm(body.vertices - position, axis=1)
        rim = body.vertices[distance < 0.0075]
        heights = (rim - position) @ axis
        assert np.abs(heights).min() < 2e-4  # the flat strips leave the true curve by 0.12 mm
        assert heights.max() < 1e-3
        assert -THICKNESS - 1e-3 < heights.min() < -0.001


def test_the_lip_is_a_sharp_edge_through_the_origin() -> None:
    body = BODIES["dashboard"]
    lip = body.vertices[np.abs(body.vertices[:, 1] - BEND[0] * body.vertices[:, 0] ** 2) < 1e-9]
    lip = lip[np.abs(lip[:, 2] - BEND[1] * lip[:, 0] ** 2) < 1e-9]
    mesh = surface(body)
    pairs = mesh.face_adjacency_edges[mesh.face_adjacency_angles > np.radians(100.0)]
    ends = body.vertices[pairs]
    on_lip = (np.abs(ends[:, :, 1] - BEND[0] * ends[:, :, 0] ** 2) < 2e-4).all(axis=1)
    length = np.linalg.norm(ends[on_lip, 0] - ends[on_lip, 1], axis=1).sum()
    assert len(lip) > 15
    assert length > 0.9  # 1.4 m less the instruments' opening


def test_clips_count_from_left_to_right() -> None:
    for body in BODIES.values():
        for stem in {name.rpartition("_")[0] for name in body.clips}:
            places = [body.clips[f"{stem}_{i + 1}"].position[0] for i in range(sum(name.startswith(stem) for name in body.clips))]
            assert places == sorted(places)


def test_an_unknown_body_is_refused() -> None:
    with pytest.raises(KeyError):
        generate("dashbord")
