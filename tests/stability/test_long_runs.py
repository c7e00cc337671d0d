"""Many steps: a cable at rest does not drift, one that goes back and forth comes back, and neither memory nor error grows."""

from __future__ import annotations

import gc
from pathlib import Path

import numpy as np
import pytest
from in_process import Direct
from rods import GRAVITY, span
from rods import cable as rod

from env_server.hard_cases.laying import RADIUS, cable, gripper, move, plane, rough, scene, straight
from env_server.hard_cases.meeting import hanging
from env_server.hard_cases.playing import Played, playing
from protocol.kinds import Friction, Hold
from protocol.messages import Problem
from protocol.scene import Scene, Target
from shape_server import Follower

GROWTH = 20_000  # kB; measured 20 from step 10 000 to 95 000


class Forgetful(Direct):
    """Keeps the last request only."""

    def receive(self):  # type: ignore[no-untyped-def]
        self.requests = self.requests[-1:]
        return super().receive()


def resident() -> int:
    """Physical memory of this process [kB]."""
    gc.collect()
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return int(next(line for line in lines if line.startswith("VmRSS")).split()[1])


def resting(kind: Friction, steps: int) -> Scene:
    """A cable on a floor, held at one end by a gripper that stays where it is; without friction it would be free to go round a hinge."""
    held = gripper(1.0, (1.0, 0.0, RADIUS), hold=Hold.CLAMP if kind is Friction.NONE else Hold.HINGE)
    law = {} if kind is Friction.NONE else rough(kind, 0.3)
    return scene(cable(), (held,), (plane(**law),), (move(seconds=0.1 * steps),), tolerance=1.0)


def lasting(played: Played, steps: int) -> int:
    """Growth of the memory [kB] over the last two thirds of so many steps."""
    played.to(steps // 3)
    early = resident()
    played.to(steps - 2 * (steps // 3))
    played.to(steps // 3)
    return resident() - early


@pytest.mark.parametrize("steps", [300, pytest.param(100_000, marks=[pytest.mark.slow, pytest.mark.timeout(3600)])])
@pytest.mark.parametrize("kind", [Friction.NONE, Friction.SIGNUM])
def test_a_cable_at_rest_on_a_floor_does_not_drift(kind: Friction, steps: int) -> None:
    with playing(resting(kind, steps), Forgetful(), straight(16)) as played:
        first = played.to(2)
        assert lasting(played, steps - 2) < GROWTH
        off = np.abs(played.shape.nodes - first.nodes)
        assert off[:, :2].max() < 1e-12  # m; measured 1e-15; 6e-17 after 95 000 steps, and with friction after 60 000
        assert off[:, 2].max() < 1e-7  # m; measured 5e-14 after 95 000 steps, with friction 1.1e-9 after 60 000; both passed whole
        assert played.deepest < 5e-6


@pytest.mark.parametrize("steps", [400, pytest.param(1_000_000, marks=[pytest.mark.slow, pytest.mark.timeout(9000)])])
def test_a_gripper_that_goes_back_and_forth_for_a_million_steps_comes_back_to_the_same_shape(steps: int) -> None:
    """Thirty steps out by 5 cm and thirty back. A step takes 3.1 ms of processor time; a million of them took 1 h 14 min and passed."""
    ways = [
        move(Target("right", by=(sign * 0.05, 0.0, 0.0)), name=f"{k} {sign}", seconds=0.6) for k in range(steps // 60) for sign in (-1, 1)
    ]
    with playing(hanging((), *ways), Forgetful()) as played:
        first = played.to(60)
        assert lasting(played, (steps // 60 - 1) * 60) < GROWTH
        assert np.abs(played.shape.nodes - first.nodes).max() < 1e-8  # m; measured 3e-16 after 30 000 steps
        assert played.shape.total_twist == pytest.approx(first.total_twist, abs=1e-8)


@pytest.mark.parametrize("rounds", [500, pytest.param(10_000, marks=pytest.mark.slow)])
def test_a_planner_that_goes_round_for_a_million_motions_comes_back_to_the_same_shape(rounds: int) -> None:
    """A hundred motions a round, on a circle of 1 mm; a million of them take 7.5 s."""
    held = span(0.7)
    follower = Follower(Problem(cable=rod(), grasps=held), GRAVITY, segments=40)
    turn = 2.0 * np.pi * np.arange(100) / 100
    way = 1e-3 * np.column_stack([np.cos(turn), np.zeros(100), np.sin(turn)])
    places = [held.position + np.array([[0.0], [1.0]]) * off for off in way]
    for _ in range(2):
        first = [follower.move(place, held.quaternion).copy() for place in places][-1]
    early = resident()
    for _ in range(rounds):
        last = [follower.move(place, held.quaternion) for place in places][-1]
        assert np.abs(last - first).max() < 1e-12  # m; measured 3.3e-16 after each of 10 000 rounds
    assert follower.is_stable
    assert resident() - early < GROWTH  # measured 0 kB
