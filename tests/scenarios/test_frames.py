"""Frames of held points, from tangents and rolls."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from scenarios import frames
from scenarios.held_points import HeldPoint, grasps_of

DOWN = HeldPoint(at=0.0, position=(0.0, 0.0, 0.0), tangent=(0.0, 0.0, -1.0))
UP = HeldPoint(at=1.0, position=(0.6, 0.0, 0.0), tangent=(0.0, 0.0, 2.0))


def directors(quaternion: np.ndarray) -> list[list[float]]:
    x, y, z, w = (float(part) for part in quaternion)
    return [
        [round(part, 9) + 0.0 for part in frames.turn((x, y, z, w), axis)] for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    ]


def test_a_planar_loop_between_opposite_tangents_is_free_of_twist() -> None:
    first, last = grasps_of((UP, DOWN)).quaternion  # in the order of arc length

    assert directors(first) == [[1, 0, 0], [0, -1, 0], [0, 0, -1]]
    assert directors(last) == [[-1, 0, 0], [0, -1, 0], [0, 0, 1]]  # the second director, square to the plane, is the same


def test_roll_turns_the_frame_about_its_tangent_by_the_right_hand() -> None:
    _, last = grasps_of((DOWN, replace(UP, roll=0.5 * math.pi))).quaternion

    assert directors(last) == [[0, -1, 0], [1, 0, 0], [0, 0, 1]]


@pytest.mark.parametrize("tangent", [(1, 0, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1), (1, 2, -3), (-1e-7, 0, 1)])
def test_an_upright_frame_has_its_third_director_along_the_tangent_and_its_first_up(tangent: tuple[float, float, float]) -> None:
    frame = frames.upright(tangent)

    assert math.hypot(*frame) == pytest.approx(1.0)
    assert np.allclose(frames.turn(frame, (0.0, 0.0, 1.0)), np.array(tangent) / np.linalg.norm(tangent))
    assert frames.turn(frame, (0.0, 1.0, 0.0))[2] == pytest.approx(0.0, abs=1e-12)
    assert frames.turn(frame, (1.0, 0.0, 0.0))[2] >= -1e-12


def test_carrying_a_frame_around_a_planar_polygon_brings_it_back() -> None:
    start = frames.upright((1.0, 0.0, 0.0))
    frame = start
    for angle in range(45, 405, 45):
        tangent = (math.cos(math.radians(angle)), math.sin(math.radians(angle)), 0.0)
        frame = frames.carried(frame, tangent, tangent)

    assert abs(sum(a * b for a, b in zip(start, frame, strict=True))) == pytest.approx(1.0)
