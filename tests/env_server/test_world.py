"""The rigid scene: collisions that are there, torques that hold, solids that move with the links."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from env_server.meshes import Mesh, load_body
from env_server.motion import grasp_frame
from env_server.robot import Robot
from env_server.world import World
from protocol import scene

TURNED = (0.0, 0.0, -(0.5**0.5), 0.5**0.5)
BODIES = (
    scene.Body(name="dashboard", generate="dashboard", position=(0.45, 0.2, 0.92), quaternion=TURNED),
    scene.Body(name="beam", generate="beam", position=(0.67, 0.2, 0.77), quaternion=TURNED),
)
MESHES = tuple(load_body(body, body.name) for body in BODIES)
ROBOT = Robot.load(scene.Robot())
GRAVITY = (0.0, 0.0, -9.81)


@pytest.fixture(scope="module")
def world() -> Iterator[World]:
    with World(ROBOT, BODIES, MESHES, GRAVITY) as made:
        yield made


def with_hand_at(arm: str, position: tuple[float, float, float]) -> np.ndarray:
    reached = ROBOT.search(arm, position, grasp_frame((0.0, -1.0, 0.0), (0.0, 0.0, -1.0)), ROBOT.home)
    assert reached.ok
    return reached.joints


def test_nothing_collides_at_home(world: World) -> None:
    world.set_joints(ROBOT.home)
    assert world.collisions() == ()


def test_a_hand_in_the_dashboard_is_named(world: World) -> None:
    world.set_joints(with_hand_at("left", (0.52, 0.25, 0.86)))
    assert ("left_hand", "dashboard") in world.collisions()


def test_a_body_in_the_torso_is_named_though_both_stand_still() -> None:
    body = scene.Body(name="beam", generate="beam", position=(-0.05, 0.0, 0.6), quaternion=TURNED)
    with World(ROBOT, (body,), (MESHES[1],), GRAVITY) as world:
        assert ("torso", "beam") in world.collisions()


def test_every_body_collides_with_its_own_surface() -> None:
    """PyBullet remembers meshes by file name; two bodies must not become one."""
    boxes = []
    for size in (0.04, 0.30):
        signs = np.array(np.meshgrid(*3 * [[-0.5, 0.5]])).reshape(3, -1).T * size
        triangles = [
            [0, 1, 3],
            [0, 3, 2],
            [4, 7, 5],
            [4, 6, 7],
            [0, 4, 5],
            [0, 5, 1],
            [2, 3, 7],
            [2, 7, 6],
            [0, 2, 6],
            [0, 6, 4],
            [1, 5, 7],
            [1, 7, 3],
        ]
        boxes.append(Mesh(signs, np.array(triangles)))
    bodies = (
        scene.Body(name="small", generate="beam", position=(0.42, 0.55, 1.14)),
        scene.Body(name="large", generate="beam", position=(0.42, -0.45, 1.14)),
    )
    with World(ROBOT, bodies, tuple(boxes), GRAVITY) as world:
        world.set_joints(ROBOT.home)
        named = {second for _, second in world.collisions()}
    assert named == {"large"}


def test_the_hollow_behind_the_dashboard_is_free(world: World) -> None:
    hollow = (0.62, 0.0, 0.70)
    body = Mesh(MESHES[0].vertices, MESHES[0].triangles)
    inside = Rotation.from_quat(TURNED).inv().apply(np.array(hollow) - BODIES[0].position)
    assert (body.vertices.min(axis=0) < inside).all()
    assert (inside < body.vertices.max(axis=0)).all()
    shift = np.array([0.42, 0.28, 1.14]) - hollow  # brings the hollow to where the left hand is at home
    x, y, z = (np.array(BODIES[0].position) + shift).tolist()
    moved = (scene.Body(name="dashboard", generate="dashboard", position=(x, y, z), quaternion=TURNED),)
    with World(ROBOT, moved, (body,), GRAVITY) as other:
        other.set_joints(ROBOT.home)
        touching = other.collisions()
    assert ("left_leftfinger", "dashboard") not in touching


def test_arms_that_run_into_each_other_are_named(world: World) -> None:
    joints = with_hand_at("left", (0.42, 0.0, 1.14))
    joints = ROBOT.search("right", (0.42, 0.02, 1.14), grasp_frame((0.0, -1.0, 0.0), (0.0, 0.0, -1.0)), joints).joints
    world.set_joints(joints)
    pairs = world.collisions()
    assert any({first.split("_")[0], second.split("_")[0]} == {"left", "right"} for first, second in pairs)


def test_neighbours_and_closed_fingers_do_not_count(world: World) -> None:
    for joints in np.random.default_rng(1).uniform(ROBOT.lower, ROBOT.upper, size=(50, len(ROBOT.home))):
        world.set_joints(ROBOT.hold("left", 0.0, joints))
        for first, second in world.collisions():
            assert not (first.endswith("link7") and second.endswith("hand") and first[:4] == second[:4])
            assert not ("finger" in first and "finger" in second and first[:4] == second[:4])


def test_positions_that_are_not_finite_are_refused(world: World) -> None:
    with pytest.raises(ValueError, match="finite"):
        world.set_joints(np.full(len(ROBOT.home), np.nan))


def test_torques_hold_what_hangs_at_the_hand(world: World) -> None:
    """A weight as a force at the grasp frame adds what the principle of virtual work says."""
    weight = np.array([0.0, 0.0, -20.0, 0.0, 0.0, 0.0])
    step, columns = 1e-6, ROBOT.arms["left"].columns
    lifted = np.empty(len(columns))
    for number, column in enumerate(columns):
        up, down = ROBOT.home.copy(), ROBOT.home.copy()
        up[column] += step
        down[column] -= step
        lifted[number] = (ROBOT.grasp_pose("left", up)[0][2] - ROBOT.grasp_pose("left", down)[0][2]) / (2 * step)
    heavy = 1e6 * weight  # so that the links' own weight does not count
    expected = (np.abs(20e6 * lifted) / ROBOT.effort[columns]).max()
    assert world.torque_ratio(ROBOT.home, {"left": heavy}) == pytest.approx(expected, rel=1e-5)
    assert 0.05 < world.torque_ratio(ROBOT.home, {}) < 1.0


def test_torques_vanish_without_gravity_and_load() -> None:
    with World(ROBOT, (), (), (0.0, 0.0, 0.0)) as world:
        assert world.torque_ratio(ROBOT.home, {}) == pytest.approx(0.0, abs=1e-12)


def test_solids_have_a_pose_each_and_few_triangles(world: World) -> None:
    solids = world.solids()
    links = ROBOT.link_poses(ROBOT.home)
    poses = world.poses(links, world.body_poses)
    assert poses.shape == (len(solids), 7)
    assert [solid.name for solid in solids][-2:] == ["dashboard", "beam"]
    for solid, pose in zip(solids[:-2], poses, strict=False):
        assert np.array_equal(pose, links[ROBOT.link_names.index(solid.name)])
    assert poses[-2][:3] == pytest.approx(BODIES[0].position)
    assert sum(len(solid.triangles) for solid in solids) < 160_000


def test_surfaces_of_links_are_closed_and_within_what_is_drawn(world: World) -> None:
    drawn = {solid.name: solid for solid in world.solids()}
    surfaces = world.surfaces()
    assert [surface.name for surface in surfaces[:2]] == ["dashboard", "beam"]
    for surface in surfaces[2:]:
        corners = surface.vertices[surface.triangles]
        volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
        assert volume > 0.0
        assert ROBOT.link_names[surface.link] == surface.name
        assert np.abs(np.ptp(surface.vertices, axis=0) - np.ptp(drawn[surface.name].vertices, axis=0)).max() < 0.05


def test_a_scene_without_a_robot_does_not_load_pybullet() -> None:
    program = (
        "import sys; from env_server.world import World; w = World(None, (), (), (0, 0, -9.81));"
        "assert w.collisions() == () and w.torque_ratio(None, {}) == 0.0 and w.solids() == ();"
        "assert 'pybullet' not in sys.modules and 'trimesh' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", program], check=False, timeout=60, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_loading_prints_nothing() -> None:
    program = (
        "from env_server.robot import Robot; from env_server.world import World; from protocol import scene;"
        "World(Robot.load(scene.Robot()), (), (), (0, 0, -9.81)).close()"
    )
    done = subprocess.run([sys.executable, "-c", program], check=True, timeout=60, capture_output=True)
    assert done.stdout + done.stderr == b""


def test_closing_twice_is_allowed() -> None:
    world = World(ROBOT, (), (), GRAVITY)
    assert world.torque_ratio(ROBOT.home, {}) > 0.0
    for _ in range(2):
        world.close()
        assert world.torque_ratio(ROBOT.home, {}) == 0.0
