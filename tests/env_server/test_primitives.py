"""Exact bodies against brute force, PyBullet and trimesh; and in runs, where the cable lies on them."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pybullet
import pytest
import trimesh
from in_process import steps
from scipy.spatial.transform import Rotation

from env_server.meshes import load_body
from env_server.primitives import Primitives, extent
from env_server.touch import Candidates
from protocol.errors import SceneError
from protocol.kinds import Feature, Primitive
from protocol.scene import Body, Cable, Gripper, Move, Scene, Target, check_scene

RADIUS, REACH = 0.004, 0.02  # m
BODIES = (
    Body(name="ball", shape=Primitive.SPHERE, radius=0.03),
    Body(name="rod", shape=Primitive.CAPSULE, radius=0.02, length=0.06),
    Body(name="tube", shape=Primitive.CYLINDER, radius=0.02, length=0.06),
    Body(name="line", shape=Primitive.CYLINDER, radius=0.0, length=0.06),
    Body(name="point", shape=Primitive.POINT),
    Body(name="floor", shape=Primitive.PLANE),
)


def search(nodes: np.ndarray, bodies: tuple[Body, ...], poses: np.ndarray, previous: Candidates | None = None) -> Candidates:
    meshes = [load_body(body, "bodies") for body in bodies]
    return Primitives(bodies, meshes).search(nodes, poses, RADIUS, REACH, previous=previous)


def distance_to(body: Body, points: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Distance of points (..., 3) from an exact body, by its definition; below zero inside."""
    local = Rotation.from_quat(pose[3:]).inv().apply((points - pose[:3]).reshape(-1, 3)).reshape(points.shape)
    if body.shape is Primitive.PLANE:
        return np.asarray(local[..., 2])
    half, radius, beside = 0.5 * (body.length or 0.0), body.radius or 0.0, np.hypot(local[..., 0], local[..., 1])
    over = np.abs(local[..., 2]) - half
    if body.shape is Primitive.CYLINDER:
        return np.where(over <= 0.0, beside - radius, np.hypot(np.maximum(over, 0.0), np.maximum(beside - radius, 0.0)))
    return np.hypot(beside, np.maximum(over, 0.0)) - radius


def is_beside(body: Body, pose: np.ndarray, ends: np.ndarray) -> bool:
    """Whether a segment is all beside the length of a body, where Bullet's rounded rim of a cylinder does not matter."""
    high = np.abs(Rotation.from_quat(pose[3:]).inv().apply(ends - pose[:3])[:, 2])
    return body.shape is not Primitive.CYLINDER or bool((high < 0.5 * (body.length or 0.0) - 0.005).all())


def random_case(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A cable (13, 3) of segments of 8 mm, and a pose (1, 7) near it."""
    steps_of = random.normal(size=(12, 3)) * 0.5 + [1.0, 0.2, 0.0]
    nodes = np.vstack([np.zeros(3), np.cumsum(0.008 * steps_of / np.linalg.norm(steps_of, axis=1)[:, None], axis=0)])
    return nodes, np.array([[*(nodes[6] + random.uniform(-0.05, 0.05, 3)), *Rotation.random(rng=random).as_quat()]])


@pytest.mark.sampled(2)
@pytest.mark.parametrize("body", BODIES, ids=lambda body: body.name)
def test_the_nearest_place_of_every_segment_is_found_as_by_brute_force(body: Body) -> None:
    random, checked = np.random.default_rng(7), 0
    share = np.linspace(0.0, 1.0, 4001)[:, None]
    for _ in range(60):
        nodes, pose = random_case(random)
        points = nodes[:-1, None] + share * np.diff(nodes, axis=0)[:, None]  # (12, 4001, 3)
        truth = distance_to(body, points, pose[0]).min(axis=1)
        try:
            found = search(nodes, (body,), pose)
        except SceneError:  # has come to an end of the cylinder
            assert body.shape is Primitive.CYLINDER
            assert truth.min() < RADIUS + 1e-6
            continue
        outside = truth > 0.0
        # What may be gone without passing it: to the middle of a solid, and any way where there is but one side.
        beyond = {Primitive.PLANE: np.inf, Primitive.CYLINDER: 0.0}.get(body.shape or Primitive.POINT, body.radius or 0.0)
        clearance = np.minimum(truth + beyond, RADIUS + REACH)
        # Measured 5.3e-11: the samples are 2e-6 m apart, and miss a point by their distance squared over twice its own.
        assert np.abs(found.clearance - clearance)[outside].max(initial=0.0) < 1e-8
        place = found.segment + found.fraction
        for segment in np.flatnonzero(outside & (truth < RADIUS + REACH - 1e-6)):
            mine = (place >= segment) & (place <= segment + 1)
            if body.shape is not Primitive.CYLINDER:
                assert found.gap[mine].min() + RADIUS == pytest.approx(truth[segment], abs=1e-8)
                checked += 1
    assert checked > 30 or body.shape is Primitive.CYLINDER


@pytest.mark.parametrize("body", BODIES, ids=lambda body: body.name)
def test_a_place_is_a_pair_of_points_with_a_normal_between_them(body: Body) -> None:
    random = np.random.default_rng(8)
    for _ in range(30):
        nodes, pose = random_case(random)
        try:
            found = search(nodes, (body,), pose)
        except SceneError:
            continue
        axis = nodes[found.segment] + found.fraction[:, None] * (nodes[found.segment + 1] - nodes[found.segment])
        away = axis - found.point
        # Nodes at which the cable bends away are planes where the shape server would lose an edge or a vertex (bends.py).
        kind = np.where(found.feature == Feature.FACE, 0.0, body.radius or 0.0)
        assert np.abs(away - (found.gap + RADIUS + kind)[:, None] * found.normal).max(initial=0.0) < 1e-15
        assert np.abs(np.linalg.norm(found.normal, axis=1) - 1.0).max(initial=0.0) < 1e-14
        inside = (found.fraction > 0.0) & (found.fraction < 1.0)
        assert np.array_equal(found.thickness[inside], kind[inside])
        kinds = {Primitive.PLANE: Feature.FACE, Primitive.SPHERE: Feature.VERTEX, Primitive.POINT: Feature.VERTEX}
        assert body.shape is not None
        assert (found.feature[inside] == kinds.get(body.shape, Feature.EDGE)).all()


def test_ends_of_the_extent_are_the_ends_of_the_axis() -> None:
    random = np.random.default_rng(9)
    pose = np.array([[0.01, 0.02, 0.03, *Rotation.random(rng=random).as_quat()]])
    axis = Rotation.from_quat(pose[0, 3:]).apply([0.0, 0.0, 1.0])
    nodes = pose[0, :3] + np.array([0.02, 0.01, 0.026]) * np.linspace(-1.0, 1.0, 5)[:, None] + 0.03 * np.cross(axis, [1.0, 0.0, 0.0])
    found = search(nodes, (BODIES[1],), pose)
    assert (found.feature == Feature.EDGE).any()
    for row in np.flatnonzero(found.feature == Feature.EDGE):
        ends = found.point[row] + np.outer(found.extent[row], found.direction[row])
        assert ends == pytest.approx(pose[0, :3] + np.outer([-0.03, 0.03], axis), abs=1e-15)


@pytest.mark.parametrize("body", BODIES[:3], ids=lambda body: body.name)
def test_gaps_are_those_of_pybullet(body: Body) -> None:
    """The segments as capsules of the cable's radius; Bullet's own shapes, in single precision and with GJK."""
    assert body.shape is not None
    client, random, checked = pybullet.connect(pybullet.DIRECT), np.random.default_rng(10), 0
    try:
        kind = {
            Primitive.SPHERE: pybullet.GEOM_SPHERE,
            Primitive.CAPSULE: pybullet.GEOM_CAPSULE,
            Primitive.CYLINDER: pybullet.GEOM_CYLINDER,
        }
        shape = pybullet.createCollisionShape(kind[body.shape], radius=body.radius, height=body.length or 1.0, physicsClientId=client)
        model = pybullet.createMultiBody(0.0, shape, physicsClientId=client)
        tube = pybullet.createCollisionShape(pybullet.GEOM_CAPSULE, radius=RADIUS, height=0.008, physicsClientId=client)
        piece = pybullet.createMultiBody(0.0, tube, physicsClientId=client)
        for _ in range(25):
            nodes, pose = random_case(random)
            pybullet.resetBasePositionAndOrientation(model, pose[0, :3].tolist(), pose[0, 3:].tolist(), physicsClientId=client)
            try:
                found = search(nodes, (body,), pose)
            except SceneError:
                continue
            for segment in range(12):
                middle = 0.5 * (nodes[segment] + nodes[segment + 1])
                turn = Rotation.align_vectors([(nodes[segment + 1] - nodes[segment]) / 0.008], [[0.0, 0.0, 1.0]])[0].as_quat()
                pybullet.resetBasePositionAndOrientation(piece, middle.tolist(), turn.tolist(), physicsClientId=client)
                points = pybullet.getClosestPoints(model, piece, REACH, physicsClientId=client)
                gap = min((point[8] for point in points), default=np.inf)
                place = found.segment + found.fraction
                mine = (place >= segment) & (place <= segment + 1)
                if 1e-3 < gap < REACH - 1e-3 and mine.any() and is_beside(body, pose[0], nodes[segment : segment + 2]):
                    # Measured: sphere and capsule 1.4e-17, cylinder 3.4e-5, whose gap Bullet iterates for.
                    assert found.gap[mine].min() == pytest.approx(gap, abs=1e-4)
                    checked += 1
    finally:
        pybullet.disconnect(physicsClientId=client)
    assert checked > 10


@pytest.mark.parametrize("body", [body for body in BODIES if body.radius], ids=lambda body: body.name)
def test_drawn_triangles_are_closed_and_lie_on_the_exact_shape(body: Body) -> None:
    mesh = load_body(body, "bodies")
    drawn = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
    assert drawn.is_watertight
    assert drawn.volume > 0.0
    at = np.array([0.0, 0, 0, 0, 0, 0, 1])
    assert np.abs(distance_to(body, mesh.vertices[np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1]) > 1e-6], at)).max() < 1e-15
    assert np.linalg.norm(mesh.vertices, axis=1).max() == pytest.approx(extent(body), abs=1e-12)
    points = np.array([[0.05, 0.01, 0.02], [0.04, -0.05, -0.01]])
    nearest = [trimesh.triangles.closest_point(drawn.triangles, np.tile(point, (len(drawn.faces), 1))) for point in points]
    far = np.array([np.linalg.norm(found - point, axis=1).min() for found, point in zip(nearest, points, strict=True)])
    exact = distance_to(body, points, at)
    assert (far - exact >= -1e-12).all()
    assert (far - exact < 0.0043 * (body.radius or 0.0)).all()  # twice R (1 - cos(pi/48))


def test_meshes_and_exact_bodies_are_found_together(tmp_path: Path) -> None:
    path = tmp_path / "box.stl"
    trimesh.creation.box((0.02, 0.02, 0.02)).export(path)
    bodies = (BODIES[0], Body(name="box", mesh=str(path)), BODIES[5])
    poses = np.array([[0.0, 0, -0.038, 0, 0, 0, 1], [0.05, 0, -0.016, 0, 0, 0, 1], [0, 0, -0.01, 0, 0, 0, 1]])
    nodes = np.linspace((-0.02, 0.0, 0.0), (0.06, 0.0, 0.0), 9)
    found = search(nodes, bodies, poses)
    assert set(found.body) == {0, 1, 2}
    assert [found.gap[found.body == body].min() for body in range(3)] == pytest.approx(
        [0.004, 0.002, 0.006], abs=1e-9
    )  # STL is in single precision
    again = search(nodes, bodies, poses, previous=found)
    assert np.array_equal(again.normal, found.normal)


def test_a_scene_of_triangles_alone_loads_nothing_of_exact_bodies() -> None:
    program = """
import sys
from env_server.stage import Stage
from protocol.scene import Body, Cable, Gripper, Scene
cable = Cable(name="c", length=1.0, diameter=0.01, mass_per_length=0.1)
gripper = Gripper(name="g", cable="c", at=0.0, position=(0.0, 0.0, 1.0), tangent=(1.0, 0.0, 0.0))
Stage(Scene(title="t", cables=(cable,), grippers=(gripper,), bodies=(Body(name="b", generate="beam"),)), lambda _: None)
print([name for name in ("primitives", "round_hits", "tessellation", "bends", "body_path") if f"env_server.{name}" in sys.modules])
"""
    assert subprocess.run([sys.executable, "-c", program], capture_output=True, check=True, text=True).stdout == "[]\n"


CABLE = Cable(name="c", length=0.8, diameter=0.006, mass_per_length=0.05, bending=2e-3, twist=2e-3)
GRIPPERS = (
    Gripper(name="left", cable="c", at=0.0, position=(0.0, -0.3, 1.0), tangent=(0.0, 1.0, -0.5)),
    Gripper(name="right", cable="c", at=0.8, position=(0.0, 0.3, 1.0), tangent=(0.0, 1.0, 0.5)),
)
ACROSS = (0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5))  # the axis along x


def risen(body: Body, beside: float) -> Scene:
    """The top of a body comes from below the cable to 3 cm above where the cable hung, `beside` [m] to the side of it."""
    top = body.radius or 0.0
    move = Move(name="rise", duration=0.5, targets=(Target(body="peg", by=(0.0, 0.0, 0.085)),))
    bodies = (replace(body, position=(beside, 0.0, 0.70 - top)),)
    return Scene(title="t", cables=(CABLE,), grippers=GRIPPERS, bodies=bodies, moves=(move,), tolerance=5e-4)


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "body",
    [
        Body(name="peg", shape=Primitive.CYLINDER, radius=0.03, length=0.2, quaternion=ACROSS),
        Body(name="peg", shape=Primitive.CAPSULE, radius=0.03, length=0.3, quaternion=ACROSS),
        Body(name="peg", shape=Primitive.CYLINDER, radius=0.0, length=0.2, quaternion=ACROSS),
        Body(name="peg", shape=Primitive.PLANE),
    ],
    ids=["cylinder", "capsule", "line", "plane"],
)
def test_an_exact_body_that_rises_lifts_the_cable(body: Body) -> None:
    """The cable lies on top of it, to the bulge of a segment; pushes and grasps carry the weight at every step."""
    weight = 0.8 * 0.05 * 9.81
    for _, step in steps(risen(body, 0.0)):
        cable = step.cables[0]
        assert cable.shape.outcome.value == "converged", cable.shape.sentence
        assert cable.bodies.penetration < 2e-6
        total = cable.boundary.pushes.force.sum(axis=0) + cable.shape.grasp_wrenches[:, :3].sum(axis=0)
        assert total == pytest.approx([0.0, 0.0, weight], abs=1e-9 * weight)
    middle = np.interp(0.4, cable.shape.s, cable.shape.nodes[:, 2])
    assert middle == pytest.approx(0.785 + 0.003, abs=3e-4)  # measured within 5.6e-8
    assert cable.boundary.pushes.force[:, 2].sum() > 0.05


@pytest.mark.parametrize("body", [BODIES[0], BODIES[4]], ids=["sphere", "point"])
def test_a_cable_slips_off_a_round_top(body: Body) -> None:
    """Without friction it lies on a sphere or a point as a ball on a hill: it goes round it and hangs beside, or free."""
    for _, step in steps(risen(replace(body, name="peg"), 0.001)):
        cable = step.cables[0]
        assert cable.shape.outcome.value == "converged", cable.shape.sentence
        assert cable.bodies.penetration < 2e-6
    assert cable.boundary.pushes.force[:, 2].sum() < 0.02
    assert cable.shape.nodes[:, 2].min() < 0.765


def test_a_cable_that_comes_to_an_end_of_a_cylinder_is_refused_with_a_sentence() -> None:
    body = Body(name="peg", shape=Primitive.CYLINDER, radius=0.02, length=0.1, position=(0.0, 0.0, 0.64))
    move = Move(name="rise", duration=0.5, targets=(Target(body="peg", by=(0.0, 0.0, 0.1)),))
    scene = Scene(title="t", cables=(CABLE,), grippers=GRIPPERS, bodies=(body,), moves=(move,), tolerance=5e-4)
    with pytest.raises(SceneError, match="comes to an end of the cylinder 'peg', and the ends of cylinders are not built; make it longer"):
        list(steps(scene))


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        (Body(name="b", shape=Primitive.SPHERE), "the sphere 'b' needs a 'radius' in m"),
        (Body(name="b", shape=Primitive.CYLINDER, radius=0.1), "the cylinder 'b' needs a 'length' in m"),
        (Body(name="b", shape=Primitive.POINT, radius=0.1), "the point 'b' has no 'radius'; leave it out"),
        (Body(name="b", generate="beam", radius=0.1), "'b', which has no 'shape', has no 'radius'; leave it out"),
        (Body(name="b", shape=Primitive.SPHERE, radius=0.0), "the radius of 'b' must be above 0 m"),
        (Body(name="b", shape=Primitive.POINT, mesh="b.stl"), "needs either 'generate', 'mesh' or 'shape', one of the three"),
    ],
)
def test_sizes_that_are_missing_or_mean_nothing_are_refused(body: Body, sentence: str) -> None:
    with pytest.raises(SceneError, match=sentence):
        check_scene(Scene(title="t", cables=(CABLE,), grippers=GRIPPERS, bodies=(body,)))


def test_a_plane_moves_but_does_not_turn() -> None:
    for target, ok in ((Target(body="floor", by=(0.0, 0.0, 0.1)), True), (Target(body="floor", turn=(0.1, 0.0, 0.0)), False)):
        scene = Scene(
            title="t", cables=(CABLE,), grippers=GRIPPERS, bodies=(BODIES[5],), moves=(Move(name="m", duration=1.0, targets=(target,)),)
        )
        if ok:
            check_scene(scene)
        else:
            with pytest.raises(SceneError, match="the plane 'floor' is without end and does not turn; use a mesh"):
                check_scene(scene)
