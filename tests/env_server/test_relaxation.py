"""The motion after a snap: smooth at both ends, on time, marked; and no cost where it is off."""

from __future__ import annotations

import math
import subprocess
import sys
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from env_server.boundary import Boundary
from env_server.hanging import Hanging
from env_server.relaxation import between, restoration_time, share_of_way
from env_server.stage import Posture, Stage
from env_server.stepped import Stepped
from protocol.kinds import Hold
from protocol.messages import Bill, Problem, Start
from protocol.scene import Cable, Gripper, Move, Relaxation, Scene, Target
from shape_server import solve

CABLE = Cable(name="c", length=1.2, diameter=0.01, mass_per_length=0.1)
GRIPPERS = (
    Gripper(name="left", cable="c", at=0.0, position=(0.0, 0.0, 1.0), tangent=(1.0, 0.0, 0.0), hold=Hold.HINGE),
    Gripper(name="right", cable="c", at=1.2, position=(0.5, 0.0, 1.0), tangent=(1.0, 0.0, 0.0), hold=Hold.HINGE),
)
NUDGE = Move(name="m", duration=0.05, targets=(Target(gripper="left", by=(1e-4, 0.0, 0.0)),))
STILL = Scene(title="t", cables=(CABLE,), grippers=GRIPPERS, time_step=0.05, moves=(NUDGE,))
FREE = Bill(solve=0.0, search=0.0, robot=0.0, encode=0.0, wire=0.0, wait=0.0, total=0.0)


def posture_of(stage: Stage, step: int, gravity: tuple[float, float, float]) -> Stepped:
    """A step whose cable hangs along `gravity`, on 18 nodes."""
    posture = stage.at_step(step)
    held = stage.grasps("c", posture)
    nodes = np.linspace(0.0, 1.2, 18)
    start = Start(s=nodes, frames=np.tile([0.0, 0.0, 0.0, 1.0], (17, 1)), grasp_forces=np.zeros((2, 3)))
    shape = solve(Problem(cable=CABLE, grasps=held, start=start), gravity)
    nothing = stage.touch_bodies.search(shape.nodes, posture.surfaces[:0], 0.005, 0.01)
    boundary = Boundary(radius=0.005, length=1.2, bonding=np.zeros(0, dtype=bool))
    return Stepped(posture, (Hanging(shape, boundary, nothing, nothing),), 1, (), FREE)


def where_it_was(posture: Posture, before: Stepped) -> Stepped:
    """A cable that stays on its branch in however short a step, in the place of a loop: what comes at the end is a jump."""
    return replace(before, posture=posture)


@pytest.mark.parametrize("overshoot", [0.0, 0.1, 0.5])
def test_velocity_and_acceleration_vanish_at_both_ends(overshoot: float) -> None:
    assert share_of_way(0.0, overshoot) == pytest.approx(0.0, abs=1e-15)
    assert share_of_way(1.0, overshoot) == pytest.approx(1.0, abs=1e-15)
    for end, inward in ((0.0, 1.0), (1.0, -1.0)):
        here = share_of_way(end, overshoot)
        for step in (1e-2, 1e-3, 1e-4):
            # A third derivative is left, or a fourth: the way goes with the third power of the time.
            assert abs(share_of_way(end + inward * step, overshoot) - here) < 5e4 * step**3


def test_without_overshoot_it_is_the_polynomial_of_the_paper() -> None:
    u = np.linspace(0.0, 1.0, 11)
    assert np.array([share_of_way(x, 0.0) for x in u]) == pytest.approx(10 * u**3 - 15 * u**4 + 6 * u**5, abs=1e-14)


@pytest.mark.parametrize("overshoot", [0.05, 0.3])
def test_an_overshoot_is_as_large_as_asked_for_and_dies_away(overshoot: float) -> None:
    way = np.array([share_of_way(u, overshoot) for u in np.linspace(0.0, 1.0, 4001)])
    peaks = np.abs(way[1:-1] - 1.0)[(np.diff(way)[:-1] * np.diff(way)[1:]) < 0.0]
    assert way.max() - 1.0 == pytest.approx(overshoot, rel=1e-3)  # M = exp(-pi a), Ogata
    assert (np.diff(peaks) < 0.0).all()


def test_eighteen_nodes_go_from_one_posture_to_the_other_within_a_second() -> None:
    """Fig. 17: a cable that lost its contact, 18 points, 1 s."""
    with closing(Stage(STILL, lambda _: None)) as stage:
        before, after = posture_of(stage, 0, (5.0, 0.0, -9.81)), posture_of(stage, 1, (0.0, 0.0, -9.81))
        found = between(stage, where_it_was, before, after, Relaxation(time=1.0))
        assert found is not None
        moments = list(found[1])
    assert found[0] == 1.0
    assert [moment.time for moment in moments] == pytest.approx(np.arange(1, 20) * 0.05)
    first, last = before.cables[0].shape.nodes, after.cables[0].shape.nodes
    assert len(first) == 18
    for moment in moments:
        share = moment.time**3 * (10 - 15 * moment.time + 6 * moment.time**2)
        shape = moment.stepped.cables[0].shape
        assert np.abs(shape.nodes - (1 - share) * first - share * last).max() < 1e-15
        assert not shape.is_stable
        assert shape.error is None
        assert np.abs(np.linalg.norm(shape.frames, axis=1) - 1.0).max() < 1e-12
        held = moment.stepped.posture.positions
        assert np.abs(shape.nodes[[0, -1]] - held).max() < 1e-4  # the grippers go along, by 0.1 mm in all


def test_the_time_of_a_rod_that_swings_is_a_quarter_of_its_period() -> None:
    """A straight cable hung by one end: w^2 = 3 g / 2 L, for a uniform rod."""
    nodes = np.linspace([0.0, 0, 0], [0.0, 0, -1.0], 4001)
    time = restoration_time(nodes, (nodes[0], nodes[0]), 9.81, 0.0)
    assert time == pytest.approx(0.25 * 2 * math.pi / math.sqrt(1.5 * 9.81), rel=1e-3)


@pytest.mark.parametrize("zeta", [0.05, 0.4])
def test_the_time_of_a_damped_pendulum_is_when_it_first_comes_back(zeta: float) -> None:
    """Against scipy: x'' + 2 zeta w x' + w^2 x = 0 from rest, until x = 0."""
    rate = math.sqrt(1.5 * 9.81)

    def zero(_: float, x: np.ndarray) -> float:
        return float(x[0])

    zero.terminal = True  # type: ignore[attr-defined]
    swing = solve_ivp(
        lambda _, x: [x[1], -2 * zeta * rate * x[1] - rate**2 * x[0]], (0, 5), [1.0, 0.0], events=zero, rtol=1e-10, atol=1e-12
    )
    nodes = np.linspace([0.0, 0, 0], [0.0, 0, -1.0], 4001)
    assert restoration_time(nodes, (nodes[0], nodes[0]), 9.81, zeta) == pytest.approx(swing.t_events[0][0], rel=1e-3)


def test_a_time_that_is_not_given_is_estimated() -> None:
    with closing(Stage(STILL, lambda _: None)) as stage:
        before, after = posture_of(stage, 0, (5.0, 0.0, -9.81)), posture_of(stage, 1, (0.0, 0.0, -9.81))
        plain, swinging = (between(stage, where_it_was, before, after, Relaxation(overshoot=o)) for o in (0.0, 0.2))
    assert plain is not None
    assert swinging is not None
    assert 0.2 < plain[0] < 0.5  # it hangs half a metre deep: a quarter of a period of 1.3 s
    assert swinging[0] == pytest.approx(8 * plain[0])


def test_a_scene_without_relaxation_does_not_load_it() -> None:
    program = "import sys, env_server.server; print('env_server.relaxation' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], capture_output=True, check=True, text=True).stdout == "False\n"
