"""The robot's kinematics against PyBullet, against differences and against a second way to compute them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pybullet
import pytest
from scipy.spatial.transform import Rotation

from env_server.motion import grasp_frame
from env_server.robot import ANGLE_OK, POSITION_OK, Robot
from env_server.urdf import check_urdf
from protocol import scene
from protocol.errors import SceneError

ROBOT = Robot.load(scene.Robot(position=(0.1, -0.2, 0.3), quaternion=(0.1, -0.2, 0.3, 0.9)))
INERTIA = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'


def random_joints(count: int) -> np.ndarray:
    return np.random.default_rng(3).uniform(ROBOT.lower, ROBOT.upper, size=(count, len(ROBOT.home)))


def urdf(folder: Path, *, joints: str = "", mesh: str = "") -> Path:
    shape = f'<collision><geometry><mesh filename="{mesh}"/></geometry></collision>' if mesh else ""
    path = folder / "robot.urdf"
    path.write_text(f'<robot name="x"><link name="a">{INERTIA}{shape}</link><link name="b">{INERTIA}</link>{joints}</robot>')
    return path


def slider(limit: str = '<limit lower="-1" upper="1" effort="5" velocity="1"/>', kind: str = "prismatic") -> str:
    return f'<joint name="j" type="{kind}"><parent link="a"/><child link="b"/><axis xyz="0 3 4"/>{limit}</joint>'


def said(robot: scene.Robot) -> str:
    with pytest.raises(SceneError) as caught:
        Robot.load(robot)
    assert caught.value.key.startswith("robot.")
    return str(caught.value)


def test_every_link_is_where_pybullet_puts_it(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(ROBOT.text)
    client = pybullet.connect(pybullet.DIRECT)
    try:
        base = ROBOT.link_poses(ROBOT.home)[0]
        model = pybullet.loadURDF(str(path), base[:3], base[3:], useFixedBase=True, physicsClientId=client)
        infos = [
            pybullet.getJointInfo(model, i, physicsClientId=client) for i in range(pybullet.getNumJoints(model, physicsClientId=client))
        ]
        index_of = {info[1].decode(): info[0] for info in infos}
        for joints in random_joints(30):
            for name, value in zip(ROBOT.joint_names, joints, strict=True):
                pybullet.resetJointState(model, index_of[name], value, physicsClientId=client)
            poses = ROBOT.link_poses(joints)
            for info in infos:
                state = pybullet.getLinkState(model, info[0], computeForwardKinematics=True, physicsClientId=client)
                own = poses[ROBOT.link_names.index(info[12].decode())]
                assert np.abs(own[:3] - state[4]).max() < 5e-7  # measured 3e-7: getLinkState is rounded to float32
                assert np.abs(own[3:] - np.sign(own[3:] @ state[5]) * np.array(state[5])).max() < 5e-7
    finally:
        pybullet.disconnect(physicsClientId=client)


def test_links_are_where_composing_rotations_puts_them() -> None:
    for joints in random_joints(10):
        x, y, z, w = 0.1, -0.2, 0.3, 0.9
        frames = {ROBOT.description.root: (Rotation.from_quat([x, y, z, w]), np.array([0.1, -0.2, 0.3]))}
        for joint in ROBOT.description.joints:
            turn, place = frames[joint.parent]
            value = joints[ROBOT.joint_names.index(joint.name)] if joint.name in ROBOT.joint_names else 0.0
            place = place + turn.apply(joint.origin[3])
            turn = turn * Rotation.from_matrix(joint.origin[:3])
            if joint.kind == 1:
                turn = turn * Rotation.from_rotvec(value * joint.axis)
            if joint.kind == 2:
                place = place + turn.apply(value * joint.axis)
            frames[joint.child] = turn, place
        for name, pose in zip(ROBOT.link_names, ROBOT.link_poses(joints), strict=True):
            turn, place = frames[name]
            assert np.abs(pose[:3] - place).max() < 1e-13
            assert np.abs(Rotation.from_quat(pose[3:]).as_matrix() - turn.as_matrix()).max() < 1e-13


@pytest.mark.parametrize("arm", ["left", "right"])
def test_the_grasp_frame_is_that_of_the_grasp_link(arm: str) -> None:
    for joints in random_joints(10):
        pose = ROBOT.link_poses(joints)[ROBOT.link_names.index(f"{arm}_grasp")]
        position, rotation = ROBOT.grasp_pose(arm, joints)
        assert np.abs(position - pose[:3]).max() < 1e-14
        assert np.abs(rotation - Rotation.from_quat(pose[3:]).as_matrix()).max() < 1e-14


@pytest.mark.parametrize("arm", ["left", "right"])
def test_the_jacobian_is_the_derivative_of_the_pose(arm: str) -> None:
    step = 1e-6
    for joints in random_joints(10):
        jacobian = ROBOT.jacobian(arm, joints)
        for number, column in enumerate(ROBOT.arms[arm].columns):
            ends = []
            for sign in (1.0, -1.0):
                moved = joints.copy()
                moved[column] += sign * step
                ends.append(ROBOT.grasp_pose(arm, moved))
            turn = Rotation.from_matrix(ends[0][1] @ ends[1][1].T).as_rotvec()
            assert np.abs(jacobian[:3, number] - (ends[0][0] - ends[1][0]) / (2 * step)).max() < 1e-9
            assert np.abs(jacobian[3:, number] - turn / (2 * step)).max() < 1e-9


@pytest.mark.parametrize("arm", ["left", "right"])
def test_a_nearby_pose_is_reached_within_the_limits(arm: str) -> None:
    random = np.random.default_rng(5)
    for goal in random_joints(200):
        columns = ROBOT.arms[arm].columns
        start = np.clip(goal + random.uniform(-0.03, 0.03, len(goal)), ROBOT.lower, ROBOT.upper)
        reached = ROBOT.reach(arm, *ROBOT.grasp_pose(arm, goal), start)
        position, rotation = ROBOT.grasp_pose(arm, reached.joints)
        assert reached.ok
        assert reached.iterations < 40  # measured: 4 as a rule, 20 at most, near a stretched elbow
        assert np.linalg.norm(position - ROBOT.grasp_pose(arm, goal)[0]) < POSITION_OK
        assert Rotation.from_matrix(rotation @ ROBOT.grasp_pose(arm, goal)[1].T).magnitude() < ANGLE_OK
        assert (reached.joints >= ROBOT.lower).all()
        assert (reached.joints <= ROBOT.upper).all()
        assert np.array_equal(np.delete(reached.joints, columns), np.delete(start, columns))


@pytest.mark.thorough
def test_any_reachable_pose_is_found_by_searching() -> None:
    for goal in random_joints(200):
        found = ROBOT.search("left", *ROBOT.grasp_pose("left", goal), ROBOT.home)
        assert found.ok
        assert (found.joints >= ROBOT.lower).all()
        assert (found.joints <= ROBOT.upper).all()


def test_limits_hold_when_the_pose_is_out_of_reach() -> None:
    random = np.random.default_rng(6)
    for start in random_joints(200):
        reached = ROBOT.reach("right", random.normal(scale=10.0, size=3), Rotation.random(rng=random).as_matrix(), start)
        assert not reached.ok
        assert np.isfinite(reached.joints).all()
        assert (reached.joints >= ROBOT.lower).all()
        assert (reached.joints <= ROBOT.upper).all()


def test_an_arm_whose_hand_rests_does_not_move() -> None:
    for joints in random_joints(10):
        reached = ROBOT.reach("left", *ROBOT.grasp_pose("left", joints), joints)
        assert reached.iterations == 0
        assert np.array_equal(reached.joints, joints)


def test_an_arm_stays_off_its_limits_on_a_long_way() -> None:
    """Ten rounds over a lip; with the smallest steps alone a joint ends up on its limit (measured: 0, against 0.056 of its range)."""
    robot = Robot.load(scene.Robot())
    frame, columns = grasp_frame((0.0, -1.0, 0.0), (0.2, 0.0, -1.0)), robot.arms["left"].columns
    joints = robot.search("left", (0.56, 0.28, 0.85), frame, robot.home).joints
    room = 1.0
    for angle in np.linspace(0.0, 20.0 * np.pi, 1000):
        position = (0.48 + 0.08 * np.cos(angle), 0.28 + 0.25 * np.sin(angle), 0.85 + 0.1 * np.sin(2.0 * angle))
        reached = robot.reach("left", position, frame, joints)
        assert reached.ok
        joints = reached.joints
        share = (joints - robot.lower)[columns] / (robot.upper - robot.lower)[columns]
        room = min(room, share.min(), 1.0 - share.max())
    assert room > 0.03


def test_half_a_turn_away_is_reached_too() -> None:
    position, rotation = ROBOT.grasp_pose("left", ROBOT.home)
    assert ROBOT.search("left", position, rotation @ np.diag([-1.0, -1.0, 1.0]), ROBOT.home).ok


def test_searching_gives_the_same_posture_every_time_and_skips_colliding_ones() -> None:
    goal = ROBOT.grasp_pose("left", ROBOT.home)
    first, second = (ROBOT.search("left", *goal, ROBOT.home) for _ in range(2))
    other = ROBOT.search("left", *goal, ROBOT.home, collision_free=lambda joints: not np.array_equal(joints, first.joints))
    stuck = ROBOT.search("left", *goal, ROBOT.home, collision_free=lambda joints: False)
    assert np.array_equal(first.joints, second.joints)
    assert other.ok
    assert other.clear
    assert not np.array_equal(other.joints, first.joints)
    assert stuck.ok
    assert not stuck.clear


@pytest.mark.thorough
def test_grasps_over_a_lip_in_front_are_all_in_reach() -> None:
    robot = Robot.load(scene.Robot())
    for arm, side in (("left", 1.0), ("right", -1.0)):
        for height in (0.85, 0.92, 1.0):
            for tilt in (0.0, 0.6):
                for yaw in (-0.6, -0.2, 0.2, 0.6):
                    frame = grasp_frame((np.sin(yaw), -np.cos(yaw), 0.0), (np.sin(tilt), 0.0, -np.cos(tilt)))
                    assert robot.search(arm, (0.45, 0.25 * side, height), frame, robot.home).ok, (arm, height, tilt, yaw)


def test_the_fingers_close_on_the_cable_along_the_grasp_frames_y() -> None:
    joints = ROBOT.hold("right", 0.012, ROBOT.home)
    poses = dict(zip(ROBOT.link_names, ROBOT.link_poses(joints), strict=True))
    gap = poses["right_leftfinger"][:3] - poses["right_rightfinger"][:3]
    closing = ROBOT.grasp_pose("right", joints)[1][:, 1]
    assert abs(gap @ closing) == pytest.approx(0.012, abs=1e-12)
    assert np.linalg.norm(gap) == pytest.approx(0.012, abs=1e-12)
    assert ROBOT.hold("left", 1.0, ROBOT.home)[ROBOT.arms["left"].fingers] == pytest.approx([0.04, 0.04])


def test_a_urdf_of_ones_own_moves(tmp_path: Path) -> None:
    path = urdf(tmp_path, joints=slider())
    robot = Robot.load(scene.Robot(model=str(path), arms=(scene.Arm(name="only", tip="b"),)))
    position, _ = robot.grasp_pose("only", np.array([0.5]))
    assert position == pytest.approx([0.0, 0.3, 0.4], abs=1e-15)
    assert robot.reach("only", (0.0, 0.6, 0.8), np.eye(3), robot.home).joints == pytest.approx([1.0])


def test_a_urdf_that_crashes_pybullet_is_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "bad.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 900000000\n")
    sentence = said(scene.Robot(model=str(urdf(tmp_path, joints=slider(), mesh="bad.obj")), arms=(scene.Arm(name="a", tip="b"),)))
    assert "makes PyBullet crash (signal 11)" in sentence


@pytest.mark.parametrize("content", ["", "hello", "<robot name='x'><link", "<robot name='x'/>"])
def test_a_corrupt_urdf_is_a_sentence(tmp_path: Path, content: str) -> None:
    (tmp_path / "robot.urdf").write_text(content)
    assert "robot.model: " in said(scene.Robot(model=str(tmp_path / "robot.urdf")))


def test_a_missing_mesh_and_a_missing_urdf_are_sentences(tmp_path: Path) -> None:
    assert "whose meshes exist" in said(scene.Robot(model=str(urdf(tmp_path, joints=slider(), mesh="none.obj"))))
    assert "does not exist; give 'dual_panda'" in said(scene.Robot(model=str(tmp_path / "none.urdf")))


def test_a_urdf_that_takes_too_long_is_a_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("env_server.urdf.CHECK_SECONDS", 0.01)
    with pytest.raises(SceneError, match="takes longer than"):
        check_urdf(urdf(tmp_path, joints=slider()))


def test_arms_that_do_not_fit_the_urdf_are_sentences(tmp_path: Path) -> None:
    path = str(urdf(tmp_path, joints=slider()))
    assert "name at least one arm" in said(scene.Robot(model=path))
    assert "there is no link 'c'; there are a, b" in said(scene.Robot(model=path, arms=(scene.Arm(name="x", tip="c"),)))
    assert "no movable joint carries 'a'" in said(scene.Robot(model=path, arms=(scene.Arm(name="x", tip="a"),)))


def test_a_joint_of_a_kind_that_is_not_built_is_a_sentence(tmp_path: Path) -> None:
    assert "of type 'planar'" in said(scene.Robot(model=str(urdf(tmp_path, joints=slider(kind="planar")))))
