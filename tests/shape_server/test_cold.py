"""The curve that a cold start begins with."""

from __future__ import annotations

import numpy as np
import pytest
from rods import ALONG_X, GRAVITY, cable, frame, grasps, random_spans
from scipy.spatial.transform import Rotation

from protocol.kinds import Hold
from protocol.messages import Grasps, Problem
from shape_server import cold, kernels
from shape_server.kernels import frames_along
from shape_server.mesh import Mesh
from shape_server.mesh import even as evenly


def even(length: float, s: np.ndarray, segments: int) -> Mesh:
    return evenly(np.unique([0.0, *s, length]), s, segments)


def curve_frames(mesh: Mesh, held: Grasps, gravity: np.ndarray, turns: tuple[int, ...] = ()) -> np.ndarray:
    problem = Problem(cable=cable(length=float(mesh.s[-1])), grasps=held, turns=turns)
    return cold.curve_frames(mesh, problem, gravity, kernels)


def directions(frames: np.ndarray) -> np.ndarray:
    """Tangents (n-1, 3)."""
    return Rotation.from_quat(frames).apply([0.0, 0.0, 1.0])


@pytest.mark.parametrize("seed", [1, 2])
def test_the_curve_has_the_right_length_and_nearly_reaches_the_other_end(seed: int) -> None:
    misses = []
    for problem in random_spans(20, 1e-2, seed):
        mesh = even(1.0, problem.grasps.s, 50)
        frames = curve_frames(mesh, problem.grasps, np.asarray(GRAVITY))
        np.testing.assert_allclose(np.linalg.norm(frames, axis=1), 1.0, atol=1e-12)
        end = (mesh.lengths[:, None] * directions(frames)).sum(axis=0)
        misses.append(float(np.linalg.norm(end - problem.grasps.position[1])))
    assert max(misses) < 0.05  # measured 0.009 m


def test_the_curve_leaves_and_arrives_along_the_clamps() -> None:
    for problem in random_spans(20, 1e-2, 3):
        mesh = even(1.0, problem.grasps.s, 100)
        tangents = directions(curve_frames(mesh, problem.grasps, np.asarray(GRAVITY)))
        clamped = directions(problem.grasps.quaternion)
        assert tangents[0] @ clamped[0] > 0.9  # measured 0.994
        assert tangents[-1] @ clamped[1] > 0.9


def test_the_roll_asked_for_is_spread_evenly() -> None:
    first, last = ALONG_X, (Rotation.from_quat(ALONG_X) * Rotation.from_rotvec([0.0, 0.0, 2.0])).as_quat()
    held = grasps((0.0, (0.0, 0.0, 0.0), first), (1.0, (0.999, 0.0, 0.0), last))
    frames = curve_frames(even(1.0, held.s, 50), held, np.asarray(GRAVITY))
    rolls = (Rotation.from_quat(frames[:-1]).inv() * Rotation.from_quat(frames[1:])).as_rotvec()[:, 2]
    np.testing.assert_allclose(rolls, 2.0 / 50, atol=1e-3)


def test_frames_without_twist_turn_about_no_tangent() -> None:
    angle = np.linspace(0, 5, 200)
    tangents = np.column_stack([np.cos(angle), np.sin(angle), 0.3 * np.ones(200)])
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    frames = frames_along(tangents, frame(tangents[0]), 0)
    np.testing.assert_allclose(directions(frames), tangents, atol=1e-12)
    steps = (Rotation.from_quat(frames[:-1]).inv() * Rotation.from_quat(frames[1:])).as_rotvec()
    assert np.abs(steps[:, 2]).max() < 1e-4  # measured 3e-16


def test_a_tangent_that_turns_straight_back_still_gives_frames() -> None:
    tangents = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 0, 1.0], [0, 0, -1.0]])
    frames = frames_along(tangents, ALONG_X, 0)
    np.testing.assert_allclose(directions(frames), tangents, atol=1e-12)


@pytest.mark.parametrize("hold", list(Hold))
@pytest.mark.parametrize("end", [(0.0, 0.0, 0.0), (0.0, 0.0, -0.5), (0.0, 0.0, 1.0), (-0.9, 0.0, 0.0)])
def test_awkward_ends_give_finite_frames(end: tuple[float, float, float], hold: Hold) -> None:
    held = grasps((0.0, (0.0, 0.0, 0.0), ALONG_X), (1.0, end, ALONG_X), hold=hold)
    frames = curve_frames(even(1.0, held.s, 25), held, np.asarray(GRAVITY))
    assert np.isfinite(frames).all()
    np.testing.assert_allclose(np.linalg.norm(frames, axis=1), 1.0, atol=1e-12)


@pytest.mark.parametrize("at", [0.0, 0.4, 1.0])
def test_a_cable_held_at_one_point_starts_straight(at: float) -> None:
    held = grasps((at, (1.0, 2.0, 3.0), ALONG_X))
    tangents = directions(curve_frames(even(1.0, held.s, 25), held, np.asarray(GRAVITY)))
    np.testing.assert_allclose(tangents, np.tile([1.0, 0.0, 0.0], (len(tangents), 1)), atol=1e-12)
