"""What the paper says of a cable without bending and a point obstacle: Figs. 5 to 7, as phenomena.

"Simulating robotic manipulation of cabling and interaction with surroundings", section 3. A length unit of the paper is
0.1 m here: a cable of 12 units held 5 units apart. Postures are in the x-z plane; the paper prints no coordinates of its obstacles.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from catenaries import tension_at_ends
from in_process import steps
from scipy.optimize import brentq

from env_server.stepped import Stepped
from protocol.kinds import Friction, Hold, Outcome, Primitive
from protocol.scene import Body, Cable, Gripper, Move, Scene, Target

UNIT = 0.1  # m
P = (3.2, -2.5)  # x and z, units
CABLE = Cable(name="c", length=12 * UNIT, diameter=2e-4, mass_per_length=0.1)
WEIGHT = 0.1 * 9.81 * 12 * UNIT  # N


def scene(obstacle: tuple[float, float], friction: Friction, *moves: Move, diameter: float = CABLE.diameter) -> Scene:
    """Grippers at x = 0 and x = 5 units; the obstacle at (x, z) units; z counts from a metre above the ground; diameter in m."""
    grippers = tuple(
        Gripper(name=name, cable="c", at=at, position=(x * UNIT, 0.0, 1.0), tangent=(1.0, 0.0, 0.0), hold=Hold.HINGE)
        for name, at, x in (("left", 0.0, 0.0), ("right", 12 * UNIT, 5.0))
    )
    body = Body(name="o", shape=Primitive.POINT, position=(obstacle[0] * UNIT, 0.0, 1.0 + obstacle[1] * UNIT), friction=friction)
    return Scene(title="t", cables=(replace(CABLE, diameter=diameter),), grippers=grippers, bodies=(body,), moves=moves)


def go(name: str, duration: float, **ways: tuple[float, float]) -> Move:
    """Grippers and the obstacle displaced by (x, z) units."""
    targets = tuple(
        Target(**{"body" if which == "o" else "gripper": which}, by=(x * UNIT, 0.0, z * UNIT)) for which, (x, z) in ways.items()
    )
    return Move(name=name, duration=duration, targets=targets)


def slacks(step: Stepped) -> tuple[float, float]:
    """Slack of both parts of a bonded cable, over their length."""
    cable = step.cables[0]
    (bond,) = cable.boundary.bonds
    ends, place = cable.shape.nodes[[0, -1]], step.posture.surfaces[0, :3]
    spans = np.array([bond.s, CABLE.length - bond.s])
    first, last = (spans - np.linalg.norm(ends - place, axis=1)) / spans
    return float(first), float(last)


def balance(s: float) -> float:
    """Tension before less tension after the obstacle at P [N], of two catenaries that meet there."""
    left, place, right = np.array([0.0, 0.0]), np.array(P) * UNIT, np.array([5 * UNIT, 0.0])
    return tension_at_ends(left, place, s, 0.981)[1] - tension_at_ends(place, right, CABLE.length - s, 0.981)[0]


@pytest.mark.slow
def test_fig_5_without_friction_the_shape_is_a_matter_of_history() -> None:
    """The obstacle comes to P from below or from the left: the slack hangs on one side or on the other. There and back, it stays."""
    below = (go("to P", 0.2, o=(0.0, 4.5)),)
    left = (go("up", 0.2, o=(0.0, 3.0)), go("over", 0.2, o=(0.8, 1.0)), go("to P", 0.2, o=(0.6, 0.5)))
    there_and_back = (go("to Q", 0.2, o=(0.0, -0.4)), go("back to P", 0.2, o=(0.0, 0.4)))
    found = []
    for start, moves in (((3.2, -7.0), below), ((1.8, -7.0), left)):
        for _, step in steps(scene(start, Friction.NONE, *moves, *there_and_back)):
            cable = step.cables[0]
            assert cable.shape.outcome is Outcome.CONVERGED, cable.shape.sentence
            if np.abs(step.posture.surfaces[0, [0, 2]] - [P[0] * UNIT, 1.0 + P[1] * UNIT]).max() < 1e-9:
                found.append(cable)
    exact = [brentq(balance, 0.88, 0.8915), brentq(balance, 0.41, 0.425)]
    for cable, s in zip((found[0], found[1], found[2], found[3]), (exact[0], exact[0], exact[1], exact[1]), strict=True):
        assert cable.boundary.pushes.s[0] == pytest.approx(s, abs=1e-4)  # measured 2.7e-5: the cable of the reference has no thickness
        total = cable.shape.grasp_wrenches[:, :3].sum(axis=0) + cable.boundary.pushes.force.sum(axis=0)
        assert np.abs(total - [0.0, 0.0, WEIGHT]).max() < 1e-9 * WEIGHT
    assert len(found) == 4


@pytest.mark.slow
def test_fig_5_straight_across_the_cable_runs_over_the_obstacle_where_its_posture_ends() -> None:
    """The posture with the right part nearly straight ends in a fold on the way; until there it is followed."""
    start, way = np.array([2.8, -4.2]), np.array([-0.9, 0.2])
    path = scene((2.8, -7.0), Friction.NONE, go("to P", 0.1, o=(0.0, 2.8)), go("across", 0.2, o=tuple(way)))
    assert _of_right_part(start + 0.85 * way) is not None
    assert _of_right_part(start + 0.87 * way) is None  # the fold is in between
    places = []
    for _, step in steps(replace(path, time_step=0.02, tolerance=2e-3)):
        cable = step.cables[0]
        assert cable.shape.outcome is Outcome.CONVERGED, cable.shape.sentence
        place = (step.posture.surfaces[0, [0, 2]] - [0.0, 1.0]) / UNIT
        if step.posture.time < 0.1 + 1e-9:
            continue
        places.append((float((place - start) @ way / (way @ way)), float(cable.boundary.pushes.s.mean()) / UNIT))
    assert all(s > 6.4 if share < 0.85 else s < 5.0 for share, s in places if not 0.85 <= share < 0.87)
    assert max(before[1] - after[1] for before, after in pairwise(places)) > 1.5  # in one step
    left = start + way
    exact = brentq(lambda s: _difference(left, s), float(np.linalg.norm(left)) + 1e-3, 5.0)
    assert places[-1][1] == pytest.approx(exact, abs=2e-3)  # measured less than 2e-3 of a unit: the cable of the reference has no thickness


def _of_right_part(place: np.ndarray) -> float | None:
    """Where [units] the obstacle touches when the right part is nearly straight; None if there is no such posture."""
    grid = np.linspace(6.3, 12.0 - float(np.linalg.norm(place - [5.0, 0.0])) - 1e-3, 200)
    found = [(a, b) for a, b in pairwise(grid.tolist()) if _difference(place, a) < 0.0 <= _difference(place, b)]
    return found[-1][1] if found else None


def _difference(place: np.ndarray, s: float) -> float:
    """Tension after less tension before the obstacle [units of weight], of two catenaries that meet there."""
    return tension_at_ends(place, np.array([5.0, 0.0]), 12.0 - s, 1.0)[0] - tension_at_ends(np.zeros(2), place, s, 1.0)[1]


@pytest.mark.thorough
def test_fig_6_a_bond_holds_until_one_part_and_then_both_are_straight() -> None:
    """From first touch: (b) two catenaries, (c) a straight part and a catenary, (d) both straight; one step further there is no shape."""
    lower, outwards = (0.0, -7.0), (-6.95, 0.0)  # past the obstacle to one unit below it; then the left gripper moves on
    path = scene((2.5, -6.0), Friction.BOND, go("lower", 1.0, left=lower, right=lower), go("outwards", 1.0, left=outwards), diameter=2e-3)
    pairs, outcomes = [], []
    for _, step in steps(path):
        outcomes.append(step.cables[0].shape.outcome)
        if outcomes[-1] is Outcome.CONVERGED and step.posture.time > 1.0 - 1e-9:
            pairs.append(slacks(step))
    slack = np.array(pairs)
    assert (slack[0] > 0.3).all()  # (b)
    assert np.abs(slack[0, 0] - slack[0, 1]) < 1e-4  # it touched in the middle
    straight = slack[:, 0] < 4e-4  # measured 2.6e-4 and less: its end is its radius off the point
    assert slack[straight][0, 1] > 0.1  # (c)
    assert straight.sum() > 10  # material is drawn through the bond, and the left part stays straight
    assert slack[-1, 1] < 0.02  # (d), at the last step before
    assert set(outcomes[:-1]) == {Outcome.CONVERGED}
    assert outcomes[-1] is Outcome.UNREACHABLE
    assert "further than the" in step.cables[0].shape.sentence


def test_fig_7_the_path_decides_whether_contact_is_kept() -> None:
    """A cable that just touches: the right gripper goes down and it stays, or up and aside and it leaves."""
    ends = {}
    for name, way in (("b1", (0.0, -1.0)), ("b2", (1.5, 3.0))):
        touch = go("touch", 0.2, o=(0.0, 0.12))
        for _, step in steps(scene((2.5, -5.15), Friction.BOND, touch, go(name, 0.3, right=way))):
            assert step.cables[0].shape.outcome is Outcome.CONVERGED, step.cables[0].shape.sentence
        ends[name] = step.cables[0].boundary
    assert len(ends["b1"].bonds) == 1
    assert not ends["b2"].bonds
    assert not len(ends["b2"].pushes.s)


@pytest.mark.thorough
def test_a_bonding_point_is_never_passed_without_a_bond() -> None:
    """It comes from beside, below and across, fast and slowly; whenever it has gone through where the cable hung, there is a bond."""
    for start, way in (((3.5, -7.0), (0.0, 3.5)), ((1.0, -6.0), (0.0, 3.0)), ((4.5, -6.0), (-0.5, 2.5))):
        for duration in (0.1, 0.4):
            *_, (_, step) = steps(scene(start, Friction.BOND, go("up", duration, o=way), diameter=2e-3))
            cable = step.cables[0]
            assert cable.shape.outcome is Outcome.CONVERGED, cable.shape.sentence
            assert len(cable.boundary.bonds) == 1
            force = cable.shape.grasp_wrenches[:, :3].sum(axis=0) + cable.boundary.pushes.force.sum(axis=0)
            assert np.abs(force - [0.0, 0.0, WEIGHT]).max() < 1e-9 * WEIGHT


def test_a_cable_that_starts_within_a_bonding_body_is_refused() -> None:
    floor = Body(name="o", shape=Primitive.PLANE, position=(0.0, 0.0, 0.6), friction=Friction.BOND)
    *_, (_, step) = steps(replace(scene((0.0, 0.0), Friction.BOND, diameter=2e-3), bodies=(floor,)))
    assert step.cables[0].shape.outcome is Outcome.NOT_CONVERGED
    assert "start it beside the body" in step.cables[0].shape.sentence
