"""What the paper says of a cable without bending and a point obstacle: Figs. 5 to 7, as phenomena.

"Simulating robotic manipulation of cabling and interaction with surroundings", section 3. A length unit of the paper is
0.1 m here: a cable of 12 units held 5 units apart. Postures are in the x-z plane; the paper prints no coordinates of its obstacles.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from in_process import steps

from env_server.boundary import Bond, Boundary
from env_server.stepped import Stepped
from env_server.touch import Candidates
from protocol.kinds import Friction, Hold, Outcome, Primitive
from protocol.messages import Grasps, Problem
from protocol.scene import Body, Cable, Gripper, Move, Scene, Target
from shape_server import solve

UNIT = 0.1  # m
CABLE = Cable(name="c", length=12 * UNIT, diameter=2e-4, mass_per_length=0.1)
REST = np.array([[0.0, 0, 0, 0, 0, 0, 1]])
WEIGHT = 0.1 * 9.81 * 12 * UNIT  # N


def scene(obstacle: tuple[float, float], friction: Friction, *moves: Move, height: float = 0.0) -> Scene:
    """Grippers at x = 0 and x = 5 units; the obstacle at (x, z) units; z counts from a metre above the ground."""
    grippers = tuple(
        Gripper(name=name, cable="c", at=at, position=(x * UNIT, 0.0, 1.0 + height * UNIT), tangent=(1.0, 0.0, 0.0), hold=Hold.HINGE)
        for name, at, x in (("left", 0.0, 0.0), ("right", 12 * UNIT, 5.0))
    )
    body = Body(name="o", shape=Primitive.POINT, position=(obstacle[0] * UNIT, 0.0, 1.0 + obstacle[1] * UNIT), friction=friction)
    return Scene(title="t", cables=(CABLE,), grippers=grippers, bodies=(body,), moves=moves)


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


def test_fig_5_without_friction_the_shape_is_a_matter_of_history() -> None:
    """The obstacle goes down from P to Q and back: all slack has run to the other side on the way, and stays there."""
    path = scene(
        (3.5, -7.0), Friction.NONE, go("to P", 0.2, o=(0.0, 2.2)), go("to Q", 0.2, o=(0.0, 0.8)), go("back to P", 0.2, o=(0.0, -0.8))
    )
    at_p = []
    for _, step in steps(path):
        assert step.cables[0].shape.outcome is Outcome.CONVERGED, step.cables[0].shape.sentence
        if abs(step.posture.surfaces[0, 2] - (1.0 - 4.8 * UNIT)) < 1e-9:
            at_p.append(step.cables[0])
    for cable in (at_p[0], at_p[-1]):
        total = cable.shape.grasp_wrenches[:, :3].sum(axis=0) + cable.boundary.pushes.force.sum(axis=0)
        assert np.abs(total - [0.0, 0.0, WEIGHT]).max() < 1e-9 * WEIGHT


def test_fig_6_a_bond_holds_until_one_part_and_then_both_are_straight() -> None:
    """(b) two catenaries, (c) one straight part and one catenary, (d) both straight; one step further there is no shape."""
    place = np.array([2.5 * UNIT, 0.0, 1.0 + UNIT])  # the grippers have been lowered below it
    up = np.array([0.0, 0.0, 1.0])
    bond = Bond(surface=0, s=6 * UNIT, point=place - 1e-4 * up, normal=up, force=up)
    boundary = Boundary(radius=1e-4, length=12 * UNIT, bonding=np.array([True]), bonds=(bond,))
    nothing = Candidates(**{name: np.zeros((0, 3) if name in ("point", "normal", "direction") else 0) for name in Candidates.__slots__})
    whole = {name: np.zeros(0, dtype=np.int64) for name in ("segment", "body", "feature", "feature_id")}
    nothing = replace(nothing, extent=np.zeros((0, 2)), **whole)
    pairs, outcome = [], Outcome.CONVERGED
    for x in np.linspace(0.0, -0.7, 281):
        ends = np.array([[x, 0.0, 1.0], [5 * UNIT, 0.0, 1.0]])
        held = Grasps(s=np.array([0.0, 12 * UNIT]), position=ends, quaternion=np.tile([0.0, 0, 0, 1], (2, 1)), hold=(Hold.HINGE,) * 2)
        boundary = boundary.drawn_through(held, REST)
        rows = boundary.contacts(nothing, np.array([0.0, 12 * UNIT]), REST, 0.0)
        shape = solve(Problem(cable=CABLE, grasps=held, contacts=rows), (0.0, 0.0, -9.81))
        outcome = shape.outcome
        if outcome is not Outcome.CONVERGED:
            break
        spans = np.array([boundary.bonds[0].s, 12 * UNIT - boundary.bonds[0].s])
        pairs.append((spans - np.linalg.norm(ends - place, axis=1)) / spans)
        boundary = boundary.after(rows, shape, REST)
    slack = np.array(pairs)
    assert (slack[0] > 0.3).all()  # (b)
    straight = slack[:, 0] < 2e-5
    assert slack[straight][0, 1] > 0.1  # (c)
    assert straight.sum() > 20  # material is drawn through the bond, and the left part stays straight
    assert slack[-1, 1] < 0.02  # (d), at the last step before
    assert outcome is Outcome.UNREACHABLE
    assert "further than the" in shape.sentence


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
