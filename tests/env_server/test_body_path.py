"""Bodies that move and turn: along the same smooth profile as the grippers, with clips and drawn solids carried along."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path as FilePath

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from trimesh import creation

from env_server.body_path import BodyPath
from env_server.motion import Path, quintic
from env_server.poses import moves
from env_server.stage import Stage
from protocol.errors import SceneError
from protocol.scene import Body, Cable, Gripper, Move, Scene, Target, check_scene

CABLE = Cable(name="c", length=1.0, diameter=0.01, mass_per_length=0.1, bending=1e-2, twist=1e-2)
GRIPPER = Gripper(name="left", cable="c", at=0.0, position=(0.0, 0.3, 1.0), tangent=(0.0, -1.0, 0.0))
HALF = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))


def scene(*targets: Target, duration: float = 2.0, body: Body | None = None) -> Scene:
    bodies = (Body(name="still", generate="beam"), body or Body(name="b", generate="beam", position=(1.0, 0.0, 0.0), quaternion=HALF))
    move = Move(name="m", duration=duration, targets=targets)
    return Scene(title="t", cables=(CABLE,), grippers=(GRIPPER,), bodies=bodies, moves=(move,))


def test_a_body_moves_and_turns_by_the_quintic() -> None:
    path = BodyPath(scene(Target(body="b", by=(0.2, 0.0, 0.1), turn=(0.0, 0.0, 4.0))))
    for time in (0.0, 0.3, 1.0, 1.7, 2.0, 9.0):
        share = quintic(min(time / 2.0, 1.0))
        pose = path.at(time)[1]
        assert pose[:3] == pytest.approx([1.0 + 0.2 * share, 0.0, 0.1 * share], abs=1e-15)
        turned = Rotation.from_rotvec([0.0, 0.0, 4.0 * share + np.pi / 2])
        assert (Rotation.from_quat(pose[3:]).inv() * turned).magnitude() < 1e-14
        assert np.array_equal(path.at(time)[0], [0, 0, 0, 0, 0, 0, 1])


def test_a_body_goes_to_a_point_and_stays_there() -> None:
    path = BodyPath(scene(Target(body="b", to=(0.0, 1.0, 0.0), offset=(0.0, 0.0, 0.5))))
    assert path.at(5.0)[1] == pytest.approx([0.0, 1.0, 0.5, *HALF])


def test_a_clip_is_met_where_the_body_has_taken_it() -> None:
    """A quarter turn about z through (1, 0, 0) takes a clip at (1.2, 0, 0) to (1, 0.2, 0)."""
    both = scene(Target(body="b", turn=(0.0, 0.0, np.pi / 2)), Target(gripper="left", clip="b.hole"))
    clips = {"b": {"hole": (np.array([1.2, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]))}}
    assert Path(both, clips, BodyPath(both).carried).at(2.0)[0][0] == pytest.approx([1.0, 0.2, 0.0], abs=1e-15)
    assert BodyPath(both).carried(clips, 2.0)["b"]["hole"][1] == pytest.approx([0.0, 1.0, 0.0], abs=1e-15)


def test_poses_of_surfaces_and_of_what_is_drawn_move_alike() -> None:
    with closing(Stage(scene(Target(body="b", by=(0.2, 0.0, 0.1), turn=(1.0, 0.0, 0.0))), lambda _: None)) as stage:
        posture = stage.at_step(stage.path.steps // 2)
        assert np.array_equal(stage.poses(posture), posture.surfaces[:2])
        assert posture.surfaces[1, :3] == pytest.approx([1.1, 0.0, 0.05])


def test_the_robot_meets_a_body_where_it_has_gone(tmp_path: FilePath) -> None:
    """A box that comes from two metres away into the robot's torso collides with it there, and not before."""
    from protocol.scene import Robot

    creation.box((0.3, 0.3, 0.3)).export(tmp_path / "box.stl")
    box = Body(name="b", mesh=str(tmp_path / "box.stl"), position=(3.0, 0.0, 0.5))
    coming = Scene(
        title="t",
        cables=(CABLE,),
        grippers=(GRIPPER,),
        robot=Robot(),
        bodies=(box,),
        moves=(Move(name="m", duration=1.0, targets=(Target(body="b", to=(0.0, 0.0, 0.5)),)),),
    )
    with closing(Stage(coming, lambda _: None)) as stage:
        hit = []
        for step in (0, stage.path.steps):
            stage.put(stage.at_step(step))
            hit.append(any("b" in pair for pair in stage.world.collisions()))
    assert hit == [False, True]


def test_how_far_a_turned_body_moves_is_bounded_and_zero_at_rest() -> None:
    random = np.random.default_rng(4)
    points = random.normal(size=(200, 3))
    extent = np.linalg.norm(points, axis=1).max()
    for angle in (0.0, 1e-9, 0.3, 3.0):
        first = Rotation.random(rng=random)
        last = Rotation.from_rotvec(angle * np.array([0.6, 0.0, 0.8])) * first
        before, after = (np.array([[*shift, *turn.as_quat()]]) for shift, turn in (((0, 0, 0), first), ((0.1 * angle, 0, 0), last)))
        far = np.linalg.norm(last.apply(points) + after[0, :3] - first.apply(points), axis=1).max()
        assert far <= moves(before, after, np.array([extent]))[0] * (1 + 1e-6) + 1e-15
        assert moves(before, before, np.array([extent]))[0] == 0.0


@pytest.mark.parametrize(
    ("target", "sentence"),
    [
        (Target(by=(0.0, 0.0, 1.0)), "needs either 'gripper' or 'body', one of the two"),
        (Target(gripper="left", body="b"), "needs either 'gripper' or 'body', one of the two"),
        (Target(gripper="left", turn=(0.0, 0.0, 1.0)), "'turn' is for a body; turn a gripper by 'tangent' and 'approach'"),
        (Target(body="b", tangent=(0.0, 0.0, 1.0)), "'tangent' is for a gripper; move a body by 'by' or 'to', and turn it by 'turn'"),
        (Target(body="b", clip="b.clip_1"), "'clip' is for a gripper"),
        (Target(body="bb", by=(0.0, 0.0, 1.0)), r"targets\[0\].body: 'bb' unknown; there are 'still', 'b'"),
    ],
)
def test_a_target_that_means_nothing_is_refused(target: Target, sentence: str) -> None:
    with pytest.raises(SceneError, match=sentence):
        check_scene(scene(target))


def test_two_targets_for_one_body_and_a_turn_too_fast_to_follow_are_refused() -> None:
    with pytest.raises(SceneError, match=r"moves\[0\].targets\[1\].body: 'b' has a target already"):
        BodyPath(scene(Target(body="b", by=(0, 0, 1)), Target(body="b", by=(0, 0, 1))))
    with pytest.raises(SceneError, match=r"turns the body by up to 1.2 rad in a time step; give it more time"):
        BodyPath(scene(Target(body="b", turn=(0.0, 0.0, 6.28)), duration=0.2))
