"""The contact search against brute force over all pairs, and in scenes whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_distances import distance_segments_triangles, distance_to_triangles
from trimesh import creation

from env_server.surface import Surface
from env_server.touch import Candidates, Touch, is_compiled, warm_up
from protocol.errors import SceneError
from protocol.kinds import Feature

RADIUS, REACH = 0.004, 0.008  # m
AT_REST = np.array([[0.0, 0, 0, 0, 0, 0, 1]])
ROUND_OFF = 1e-12  # m, measured 7e-17 on clean meshes
Mesh = tuple[np.ndarray, np.ndarray]


def plate(thickness: float = 0.002) -> Mesh:
    box = creation.box((0.1, 0.1, thickness))
    return box.vertices, box.faces


def square() -> Mesh:
    return np.array([[-0.05, -0.05, 0], [0.05, -0.05, 0], [0.05, 0.05, 0], [-0.05, 0.05, 0]]), np.array([[0, 1, 2], [0, 2, 3]])


def corner() -> Mesh:
    """Open concave corner of the floor z = 0 and the wall x = 0."""
    vertices = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0], [0, 0, 0.1], [0, 0.1, 0.1]])
    return vertices, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 5], [0, 5, 4]])


def random_mesh(random: np.random.Generator, kind: int) -> Mesh:
    """Thin plate, sphere, cylinder, triangle soup with shared vertices, corner, ring, or slivers."""
    if kind == 0:
        return plate()
    if kind in (1, 2, 5):
        solid = {1: creation.icosphere(2, 0.03), 2: creation.cylinder(0.02, 0.1, sections=48), 5: creation.annulus(0.02, 0.03, 0.04)}[kind]
        return solid.vertices, solid.faces
    if kind == 3:
        return random.uniform(-0.05, 0.05, (60, 3)), np.argsort(random.random((40, 60)), axis=1)[:, :3]
    if kind == 4:
        return corner()
    vertices = random.uniform(-0.05, 0.05, (90, 3))
    middle = vertices[::3] + random.uniform(0, 1, (30, 1)) * (vertices[1::3] - vertices[::3])
    vertices[2::3] = middle + 10.0 ** random.uniform(-8, -4, (30, 1)) * random.normal(size=(30, 3))
    return vertices, np.arange(90).reshape(-1, 3)


def random_cable(random: np.random.Generator, count: int = 13) -> np.ndarray:
    steps = random.normal(size=(count - 1, 3))
    steps = 0.4 * steps / np.linalg.norm(steps, axis=1, keepdims=True) + [1, 0.3, 0]
    nodes = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)]) * random.choice([0.003, 0.01, 0.03])
    return nodes - nodes.mean(axis=0)


def random_poses(random: np.random.Generator, count: int) -> np.ndarray:
    return np.hstack([random.uniform(-0.08, 0.08, (count, 3)), Rotation.random(count, rng=random).as_quat()])


def in_world(mesh: Mesh, pose: np.ndarray) -> np.ndarray:
    """Corners (t, 3, 3) of the triangles in the world."""
    return (mesh[0] @ Rotation.from_quat(pose[3:]).as_matrix().T + pose[:3])[mesh[1]]


def axis_points(found: Candidates, nodes: np.ndarray) -> np.ndarray:
    """Points of the axis (m, 3) that the candidates are about."""
    return nodes[found.segment] + found.fraction[:, None] * (nodes[found.segment + 1] - nodes[found.segment])


def search(mesh: Mesh, nodes: np.ndarray, pose: np.ndarray = AT_REST, **options: object) -> Candidates:
    return Touch([Surface(*mesh)]).search(nodes, pose, RADIUS, REACH, **options)


def straight(start: tuple[float, float, float], end: tuple[float, float, float], segments: int) -> np.ndarray:
    return np.linspace(start, end, segments + 1)


@pytest.mark.sampled(6)
@pytest.mark.parametrize("seed", range(8))
def test_the_nearest_place_of_every_segment_is_among_the_candidates(seed: int) -> None:
    random = np.random.default_rng(seed)
    checked = 0
    for _ in range(60):
        meshes = [random_mesh(random, kind) for kind in random.integers(0, 7, 3)]
        nodes, poses = random_cable(random), random_poses(random, 3)
        found = Touch([Surface(*mesh) for mesh in meshes]).search(nodes, poses, RADIUS, REACH)
        clearance = np.full(12, RADIUS + REACH)
        for body, mesh in enumerate(meshes):
            nearest = distance_segments_triangles(nodes[:-1, None], nodes[1:, None], in_world(mesh, poses[body])[None]).min(axis=1)
            clearance = np.minimum(clearance, nearest)
            for segment in np.flatnonzero(nearest < RADIUS + REACH - ROUND_OFF):
                place = found.segment + found.fraction
                mine = (found.body == body) & (place >= segment) & (place <= segment + 1)
                # 1e-9: axis closer than that counts as touching. Slivers of 1e-8 m have normals with few digits.
                assert found.gap[mine].min() + RADIUS == pytest.approx(nearest[segment], abs=1e-9)
                checked += 1
        assert np.abs(found.clearance - clearance).max() < 1e-9
    assert checked > 100


def test_a_candidate_is_a_pair_of_points_with_a_normal_between_them() -> None:
    random = np.random.default_rng(20)
    for _ in range(50):
        mesh, pose, nodes = random_mesh(random, int(random.integers(0, 6))), random_poses(random, 1), random_cable(random)
        found = search(mesh, nodes, pose)
        away = axis_points(found, nodes) - found.point
        assert np.abs(np.linalg.norm(found.normal, axis=1) - 1).max(initial=0) < 1e-12
        apart = ~found.is_crossing & ~found.is_beyond
        assert np.abs(away - (found.gap + RADIUS)[:, None] * found.normal)[apart].max(initial=0) < 1e-12
        assert np.abs((found.direction * away).sum(axis=1)[~found.is_beyond]).max(initial=0) < 1e-12
        assert np.allclose(np.linalg.norm(found.direction, axis=1), found.feature == Feature.EDGE)
        corners = in_world(mesh, pose[0])
        assert distance_to_triangles(found.point[:, None], corners[None]).min(axis=1).max(initial=0) < 1e-12


def test_moving_everything_alike_moves_the_candidates_along() -> None:
    random = np.random.default_rng(21)
    for kind in (0, 2, 4, 5):
        mesh, poses, nodes = random_mesh(random, kind), random_poses(random, 1) * [0.2, 0.2, 0.2, 1, 1, 1, 1], random_cable(random)
        turn, shift = Rotation.random(rng=random), random.uniform(-1, 1, 3)
        moved = np.hstack([turn.apply(poses[:, :3]) + shift, (turn * Rotation.from_quat(poses[:, 3:])).as_quat()])
        one, other = search(mesh, nodes, poses), search(mesh, turn.apply(nodes) + shift, moved)
        assert np.array_equal(one.segment, other.segment)
        assert np.array_equal(one.feature, other.feature)
        assert np.allclose(one.gap, other.gap, atol=1e-12)
        assert np.allclose(turn.apply(one.normal.copy()), other.normal, atol=1e-9)
        assert np.allclose(turn.apply(one.point.copy()) + shift, other.point, atol=1e-12)


def test_turning_triangles_over_changes_no_candidate() -> None:
    random = np.random.default_rng(22)
    for _ in range(30):
        (vertices, faces), pose, nodes = random_mesh(random, 5), random_poses(random, 1), random_cable(random)
        over = np.where(random.random((len(faces), 1)) < 0.5, faces[:, ::-1], faces)
        one, other = search((vertices, faces), nodes, pose), search((vertices, over), nodes, pose)
        apart = ~one.is_crossing
        assert np.allclose(one.gap, other.gap, atol=1e-12)
        assert np.allclose(one.normal[apart], other.normal[apart], atol=1e-9)


def test_a_cable_on_a_square_of_two_triangles_touches_faces_at_its_nodes_only() -> None:
    found = search(square(), straight((-0.03, -0.011, RADIUS), (0.03, 0.012, RADIUS), 6))
    assert (found.feature == Feature.FACE).all()
    assert list(found.segment + found.fraction) == [0, 1, 2, 3, 4, 5, 6]
    assert np.abs(found.gap).max() < 1e-15
    assert np.allclose(found.normal, [0, 0, 1])


def test_duplicate_triangles_are_touched_once() -> None:
    vertices, faces = square()
    doubled = (np.vstack([vertices, vertices]), np.vstack([faces, faces[:, ::-1] + 4]))
    assert len(search(doubled, straight((-0.03, 0, RADIUS), (0.03, 0, RADIUS), 6)).gap) == 7


def test_a_sharp_edge_between_two_nodes_is_seen() -> None:
    found = search(plate(0.08), np.array([[-0.09, 0.0, 0.02], [-0.01, 0.0, 0.0645]]))
    edge = found.feature == Feature.EDGE
    assert edge.sum() == 1
    assert 0 < found.fraction[edge][0] < 1
    assert np.allclose(np.abs(found.direction[edge]), [0, 1, 0])
    assert np.allclose(found.point[edge], [-0.05, 0, 0.04])


def test_a_concave_corner_holds_a_node_from_both_walls() -> None:
    found = search(corner(), np.array([[0.006, 0.03, 0.007], [0.006, 0.06, 0.007]]))
    for node in (0.0, 1.0):
        here = found.fraction == node
        assert np.allclose(found.gap[here], [0.002, 0.003])
        assert np.allclose(found.normal[here], [[1, 0, 0], [0, 0, 1]])
    assert (found.feature == Feature.FACE).all()


def test_the_far_side_of_a_thin_wall_is_not_reported() -> None:
    found = search(plate(0.002), straight((-0.03, 0, 0.003), (0.03, 0, 0.003), 6))
    assert np.allclose(found.normal, [0, 0, 1])
    assert np.allclose(found.point[:, 2], 0.001)
    assert np.allclose(found.gap, 0.002 - RADIUS)
    assert found.penetration == pytest.approx(0.002)


def test_a_ridge_behind_a_sheet_is_not_reported() -> None:
    sheet, faces = square()
    foot, top = [0.03, 0.01, -0.01], [0.03, 0, -0.002]
    mirror = np.array([[-1, 1, 1], [1, 1, 1]])
    ridge = np.vstack([foot * mirror, (top * mirror)[::-1], foot * mirror * [1, -1, 1]])
    both = (np.vstack([sheet, ridge]), np.vstack([faces, np.array([[0, 1, 2], [0, 2, 3], [3, 2, 5], [3, 5, 4]]) + 4]))
    across = straight((0.001, -0.02, 0.003), (0.001, 0.02, 0.003), 3)
    assert np.allclose(search(both, across).point[:, 2], 0.0)
    assert (search((ridge, both[1][2:] - 4), across).feature == Feature.EDGE).any()


def test_a_cable_across_a_tessellated_cylinder_is_its_radius_away() -> None:
    cylinder = creation.cylinder(0.02, 0.1, sections=360)
    found = search((cylinder.vertices, cylinder.faces), straight((-0.03, 0.0245, 0.0), (0.03, 0.0245, 0.004), 5))
    sagitta = 0.02 * (1 - np.cos(np.pi / 360))
    assert -1e-12 <= found.gap.min() - 0.0005 <= sagitta + 1e-5  # 1e-5: the cable is inclined
    assert np.allclose(found.normal[np.argmin(found.gap)], [0, 1, 0], atol=0.02)


def test_a_cable_along_a_cylinder_touches_it_at_every_node() -> None:
    cylinder = creation.cylinder(0.02, 0.1, sections=36)
    for angle in np.deg2rad([0.0, 3.0, 5.0, 10.0]):
        foot = np.array([np.cos(angle), np.sin(angle), 0]) * (0.02 + RADIUS)
        found = search((cylinder.vertices, cylinder.faces), foot + straight((0, 0, -0.04), (0, 0, 0.04), 8))
        assert sorted(set(found.segment + found.fraction)) >= list(range(9))
        assert found.gap.max() < 1e-4  # sagitta 8e-5
        assert np.allclose(found.normal[:, 2], 0)


def test_a_vertex_is_touched_by_a_segment_that_passes_it() -> None:
    found = search(plate(0.1), np.array([[0.03, 0.08, 0.055], [0.08, 0.03, 0.055]]))
    assert list(found.feature) == [Feature.VERTEX]
    assert found.gap[0] == pytest.approx(np.sqrt(2 * 0.005**2 + 0.005**2) - RADIUS)
    assert np.allclose(found.point, 0.05)


def test_excluded_pairs_are_not_reported_and_take_no_clearance() -> None:
    nodes = straight((-0.03, 0, RADIUS), (0.03, 0, RADIUS), 6)
    excluded = np.zeros((6, 1), dtype=bool)
    excluded[2:4] = True
    found = search(square(), nodes, excluded=excluded)
    assert list(found.segment + found.fraction) == [0, 1, 2, 4, 5, 6]
    assert np.allclose(found.clearance, [RADIUS, RADIUS, RADIUS + REACH, RADIUS + REACH, RADIUS, RADIUS])
    assert len(search(square(), nodes, excluded=np.ones((6, 1), dtype=bool)).gap) == 0


def test_a_segment_through_a_sheet_is_marked_and_pushed_back_to_its_earlier_node() -> None:
    for side in (1.0, -1.0):
        found = search(square(), np.array([[0.01, 0, 0.01 * side], [0.012, 0.001, -0.01 * side]]))
        assert found.is_crossing.sum() == 1
        hit = int(np.argmax(found.is_crossing))
        assert found.gap[hit] == -RADIUS
        assert np.allclose(found.normal[hit], [0, 0, side])
        assert found.clearance[0] == 0
        assert found.penetration == RADIUS


def test_a_crossing_keeps_the_side_it_came_from() -> None:
    before = search(square(), straight((-0.01, 0, 0.003), (0.01, 0, 0.003), 2))
    through = straight((-0.01, 0, -0.001), (0.01, 0, 0.003), 2)
    for previous, side in ((None, -1), (before, 1)):
        found = search(square(), through, previous=previous)
        assert np.allclose(found.normal[found.is_crossing], [0, 0, side])


def test_bodies_keep_apart() -> None:
    poses = np.array([[0.0, 0, 0, 0, 0, 0, 1], [0, 0, 0.012, 0, 0, 0, 1]])
    found = Touch([Surface(*square()), Surface(*plate())]).search(straight((-0.02, 0, 0.005), (0.02, 0, 0.005), 4), poses, RADIUS, REACH)
    assert np.allclose(found.normal[found.body == 0], [0, 0, 1])
    assert np.allclose(found.normal[found.body == 1], [0, 0, -1])
    assert (found.body == 1).sum() == (found.body == 0).sum() == 5


def test_more_candidates_than_expected_are_all_reported() -> None:
    spikes = np.concatenate([np.array([[x, 0, 0], [x, 0.01, -0.01], [x, -0.01, -0.01]]) for x in np.linspace(-0.05, 0.05, 800)])
    found = search((spikes, np.arange(2400).reshape(-1, 3)), straight((-0.06, 0, 0.005), (0.06, 0.0, 0.005), 1))
    assert len(found.gap) == len(set(found.feature_id)) == 800


def test_no_bodies_and_no_contacts_are_allowed() -> None:
    nodes = straight((0, 0, 5), (1, 0, 5), 10)
    nothing = Touch([]).search(nodes, np.zeros((0, 7)), RADIUS, REACH)
    far = search(square(), nodes)
    assert len(nothing.gap) == len(far.gap) == 0
    assert (np.append(nothing.clearance, far.clearance) == RADIUS + REACH).all()
    assert nothing.penetration == far.penetration == 0.0


def test_the_same_search_gives_the_same_bits() -> None:
    random = np.random.default_rng(23)
    mesh, pose, nodes = random_mesh(random, 3), random_poses(random, 1), random_cable(random)
    one, other = search(mesh, nodes, pose), search(mesh, nodes, pose)
    for name in Candidates._fields:
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes()


@pytest.mark.parametrize(
    ("nodes", "poses", "excluded", "sentence"),
    [
        (np.zeros((1, 3)), AT_REST, None, "n >= 2"),
        (np.full((2, 3), np.nan), AT_REST, None, "finite"),
        (np.eye(2, 3), np.zeros((2, 7)), None, "one row for each surface"),
        (np.eye(2, 3), np.zeros((1, 7)), None, "quaternion"),
        (np.eye(2, 3), AT_REST, np.zeros((2, 1), bool), "excluded"),
    ],
)
def test_a_wrong_request_is_refused_with_a_sentence(
    nodes: np.ndarray, poses: np.ndarray, excluded: np.ndarray | None, sentence: str
) -> None:
    with pytest.raises(SceneError, match=sentence):
        search(square(), nodes, poses, excluded=excluded)


def test_after_warming_up_the_search_is_compiled() -> None:
    warm_up()
    assert is_compiled()
