"""The grippers' path: from rest to rest, frames that stay frames, clips by name."""

from __future__ import annotations

from time import process_time
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from env_server.motion import Path, cable_frames, grasp_frame, quintic
from protocol.errors import SceneError
from protocol.scene import Cable, Gripper, Move, Picture, Scene, Target

CLIPS = {"dash": {"clip_1": (np.array([0.5, 0.1, 0.9]), np.array([0.0, 0.0, 1.0])), "clip_2": (np.zeros(3), np.array([0.0, 0.0, 1.0]))}}
LEFT = Gripper(name="left", cable="c", at=0.0, position=(0.0, 0.3, 1.0), tangent=(0.0, -2.0, 0.0), approach=(0.2, 0.1, -1.0))
RIGHT = Gripper(name="right", cable="c", at=1.0, position=(0.0, -0.3, 1.0), tangent=(0.0, -1.0, 0.0))


def scene(*moves: Move, **options: Any) -> Scene:
    return Scene(
        title="t", cables=(Cable(name="c", length=1.0, diameter=0.01, mass_per_length=0.1),), grippers=(LEFT, RIGHT), moves=moves, **options
    )


def test_the_path_starts_where_the_grippers_are() -> None:
    positions, rotations = Path(scene(), {}).at(0.0)
    assert np.array_equal(positions, [LEFT.position, RIGHT.position])
    assert rotations[0][:, 0] == pytest.approx([0.0, -1.0, 0.0])
    assert rotations[0][:, 2] == pytest.approx(np.array([0.2, 0.0, -1.0]) / np.sqrt(1.04))


def test_a_move_ends_at_its_target_at_rest() -> None:
    path = Path(scene(Move(name="lift", duration=2.0, targets=(Target(gripper="left", by=(0.1, 0.0, 0.2)),))), {})
    step = 1e-4
    end = path.at(2.0)[0]
    assert end[0] == pytest.approx([0.1, 0.3, 1.2], abs=1e-15)
    assert np.array_equal(end[1], RIGHT.position)
    for time in (0.0, 2.0):
        speed = np.abs(path.at(time + step)[0] - path.at(time - step)[0]).max() / (2 * step)
        assert speed < 1e-7  # s(u) leaves as u^3


def test_the_line_is_straight_and_its_share_is_the_quintic() -> None:
    path = Path(scene(Move(name="lift", duration=2.0, targets=(Target(gripper="left", to=(1.0, 1.0, 1.0), offset=(0.0, 0.0, 1.0)),))), {})
    way = np.array([1.0, 1.0, 2.0]) - LEFT.position
    for time in (0.3, 1.0, 1.7):
        u = time / 2.0
        assert path.at(time)[0][0] == pytest.approx(LEFT.position + (10 * u**3 - 15 * u**4 + 6 * u**5) * way, abs=1e-14)


def test_the_quintic_has_no_velocity_or_acceleration_at_its_ends() -> None:
    assert (quintic(0.0), quintic(0.5), quintic(1.0)) == (0.0, 0.5, 1.0)
    assert quintic(1e-3) == pytest.approx(1e-8, rel=2e-3)
    assert 1.0 - quintic(1.0 - 1e-3) == pytest.approx(1e-8, rel=2e-3)


def test_a_turn_takes_the_short_way_about_one_axis() -> None:
    path = Path(scene(Move(name="turn", duration=1.0, targets=(Target(gripper="right", tangent=(1.0, 0.0, 0.0)),))), {})
    start, half, end = (path.at(time)[1][1] for time in (0.0, 0.5, 1.0))
    assert end == pytest.approx(grasp_frame((1.0, 0.0, 0.0), (0.0, 0.0, -1.0)))
    assert Rotation.from_matrix(half @ start.T).as_rotvec() == pytest.approx([0.0, 0.0, np.pi / 4])


def test_frames_stay_rotations_all_along() -> None:
    turn = Target(gripper="left", tangent=(1.0, -1.0, 0.3), approach=(0.5, 0.2, -1.0))
    path = Path(scene(Move(name="turn", duration=1.0, targets=(turn,))), {})
    for time in np.linspace(-0.5, 1.5, 41):
        for rotation in path.at(float(time))[1]:
            assert np.abs(rotation.T @ rotation - np.eye(3)).max() < 1e-14
            assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_the_cable_frame_has_d3_along_the_grasps_x() -> None:
    grasp = grasp_frame((0.3, -1.0, 0.2), (0.1, 0.0, -1.0))
    frame = cable_frames(grasp[None])[0]
    assert np.array_equal(frame[:, 2], grasp[:, 0])
    assert np.linalg.det(frame) == pytest.approx(1.0)


def test_a_clip_is_reached_with_its_offset() -> None:
    path = Path(scene(Move(name="m", duration=1.0, targets=(Target(gripper="left", clip="dash.clip_1", offset=(0.0, 0.0, 0.05)),))), CLIPS)
    assert path.at(1.0)[0][0] == pytest.approx([0.5, 0.1, 0.95])


def test_an_unknown_clip_lists_the_known_ones() -> None:
    with pytest.raises(SceneError, match=r"'dash.clip_9' unknown; there are 'dash.clip_1', 'dash.clip_2'") as caught:
        Path(scene(Move(name="m", duration=1.0, targets=(Target(gripper="left", clip="dash.clip_9"),))), CLIPS)
    assert caught.value.key == "moves[0].targets[0].clip"


def test_two_targets_for_one_gripper_are_refused() -> None:
    with pytest.raises(SceneError, match="has a target already"):
        Path(scene(Move(name="m", duration=1.0, targets=(Target(gripper="left", by=(0, 0, 1)), Target(gripper="left", by=(0, 0, 1))))), {})


def test_a_tangent_along_the_approach_is_refused() -> None:
    with pytest.raises(SceneError, match="square to each other; give both"):
        Path(scene(Move(name="m", duration=1.0, targets=(Target(gripper="right", tangent=(0.0, 0.0, 1.0)),))), {})


def test_moves_end_on_steps_and_pictures_fall_on_them() -> None:
    moves = (Move(name="one", duration=0.3), Move(name="two", duration=0.25))
    pictures = (Picture(name="b", after="two"), Picture(name="s"), Picture(name="a", after="one"))
    path = Path(scene(*moves, pictures=pictures, time_step=0.1), {})
    assert path.steps == 6
    assert path.times == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.3 + 0.25 / 3, 0.3 + 0.5 / 3, 0.55])
    assert path.keys == (6, 0, 3)
    assert [path.move_at(float(time)) for time in path.times] == ["start", "one", "one", "one", "two", "two", "two"]


def test_moves_join_without_a_jump() -> None:
    moves = tuple(
        Move(name=name, duration=0.7, targets=(Target(gripper="left", by=by),)) for name, by in (("a", (0.1, 0, 0)), ("b", (0, 0.1, 0)))
    )
    path = Path(scene(*moves), {})
    assert path.at(0.7 + 1e-12)[0][0] == pytest.approx(path.at(0.7)[0][0], abs=1e-14)
    assert path.at(5.0)[0][0] == pytest.approx([0.1, 0.4, 1.0], abs=1e-14)


def test_a_place_late_on_a_path_of_many_moves_is_found_as_fast_as_on_one_of_two() -> None:
    def seconds(count: int) -> float:
        moves = [Move(f"{k}", 1.0, (Target(gripper="left", by=(0.0, 0.0, 0.1 * (-1) ** k)),)) for k in range(count)]
        path, best = Path(scene(*moves), {}), np.inf
        for _ in range(5):
            begun = process_time()
            for _ in range(50):
                path.at(count - 0.5)
            best = min(best, process_time() - begun)
        return best

    assert seconds(5000) < 3 * seconds(2)  # measured 1.0; 6.5 when every move before was looked at
