"""Friction between cables in the loop of the environment: what is held from step to step, of strands and of cables on a rough floor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from in_process import Direct, steps
from test_self_boundary import wound

from env_server.held import NOT_YET, Held, Knot
from protocol.kinds import Friction, Primitive, SelfInteraction, SelfTouch
from protocol.messages import Shape
from protocol.scene import Body, Cable, Gripper, Move, Scene, Target

MU, FLOOR = 0.3, 0.4


def straight(shift: float) -> Shape:
    """The first shape of a straight cable along x, aside by a distance [m]."""
    own = Cable("c", 1.0, 0.01, 1e-6, 1e-2, 8e-3)
    ends = (Gripper("a", "c", 0.0, (0.0, shift, 0.0), (1.0, 0.0, 0.0)), Gripper("b", "c", 1.0, (0.9999, shift, 0.0), (1.0, 0.0, 0.0)))
    ((_, step),) = steps(Scene("t", (own,), ends, ()))
    return step.cables[0].shape


def test_nothing_is_held_before_the_first_step_and_each_place_has_its_own_points_after() -> None:
    s = np.array([[0.2, 0.2], [0.5, 0.5], [0.8, 0.8]])
    assert not NOT_YET.rows((0, 1), 0.5, MU, s).mu.any()
    past = (straight(0.0), straight(0.01))
    spacing = float(np.diff(past[0].s).max())
    near = Knot((0, 1), (0.5 + 0.3 * spacing, 0.5 - 0.2 * spacing), np.full((2, 3), 2e-3), np.array([0.1, 0.0, 0.0]))
    far = Knot((0, 1), (0.8 + 0.6 * spacing, 0.8), np.full((2, 3), 3e-3), np.zeros(3))
    rows = Held((near, far), past).rows((0, 1), 0.5, MU, s)
    assert (rows.mu == MU).all()
    np.testing.assert_allclose(rows.s[1], near.s)
    np.testing.assert_allclose(rows.drag, [[0.0] * 3, [0.1, 0.0, 0.0], [0.0] * 3])
    # Places that nothing held are held where the surfaces were nearest: half way between the axes.
    for row in (0, 2):
        np.testing.assert_allclose(rows.s[row], s[row])
        np.testing.assert_allclose(np.linalg.norm(rows.arm[row].reshape(2, 3), axis=1), 0.005, atol=1e-6)


@pytest.mark.slow
def test_strands_of_a_wound_cable_rub_and_keep_the_law() -> None:
    scene = wound(SelfInteraction.CONTACT)
    scene = replace(scene, cables=(replace(scene.cables[0], friction_coefficient=MU),))
    pressed = 0
    for _, step in steps(scene, Direct()):
        assert step.crossed is not None
        force = step.crossed.pushes.force
        np.testing.assert_allclose(step.cables[0].shape.grasp_wrenches[:, :3].sum(axis=0), [0.0, 0.0, 0.02 * 9.81], atol=1e-8)
        assert len(step.crossed.held.points) == len(force) or step.crossed.held.points == ()
        for point, total in zip(step.crossed.held.points, force, strict=False):
            pressed += 1
            assert np.linalg.norm(point.force) <= MU * np.linalg.norm(total - point.force) * (1.0 + 1e-9)
    assert pressed > 5


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_cables_that_cross_on_a_rough_floor_rub_on_it_and_on_each_other() -> None:
    """The upper one comes down on the lower and is drawn over it: all of the twenty steps settle."""

    def cable(name: str) -> Cable:
        return Cable(name, 1.0, 0.01, 0.1, 1e-2, 8e-3, self_interaction=SelfInteraction.CONTACT, friction_coefficient=MU)

    grippers = []
    for name, along, half, height in (("lower", 0, 0.45, 0.03), ("upper", 1, 0.49, 0.12)):
        for sign, at in ((-1.0, 0.0), (1.0, 1.0)):
            tangent = np.eye(3)[along]
            x, y, z = (sign * half * tangent + [0.02 * along, 0.0, height]).tolist()
            grippers.append(Gripper(f"{name} {at:g}", name, at, (x, y, z), (float(along == 0), float(along == 1), 0.0)))
    floor = Body("floor", shape=Primitive.PLANE, position=(0.0, 0.0, -0.03), friction=Friction.SIGNUM, friction_coefficient=FLOOR)
    down = Move("down", 0.5, tuple(Target(gripper=f"upper {at}", by=(0.0, 0.0, -0.07)) for at in (0, 1)))
    drawn = Move("drawn", 0.5, tuple(Target(gripper=f"upper {at}", by=(0.03, 0.01, 0.0)) for at in (0, 1)))
    scene = Scene("t", (cable("lower"), cable("upper")), tuple(grippers), (down, drawn), bodies=(floor,), time_step=0.05, tolerance=2e-3)
    asker, crossed, count = Direct(), 0, 0
    for _, step in steps(scene, asker):
        count += 1
        total = np.zeros(3)
        for hanging in step.cables:
            shape = hanging.shape
            assert shape.outcome.value == "converged", shape.sentence
            force = shape.contact_forces
            total += shape.grasp_wrenches[:, :3].sum(axis=0) + force.sum(axis=0)
            assert (np.linalg.norm(force[:, :2], axis=1) <= FLOOR * force[:, 2] * (1.0 + 1e-6) + 1e-9).all()
        np.testing.assert_allclose(total, [0.0, 0.0, 2 * 0.1 * 9.81], atol=1e-9)
        assert step.crossed is not None
        for point, push in zip(step.crossed.held.points, step.crossed.pushes.force, strict=True):
            crossed += 1
            assert np.linalg.norm(point.force) <= MU * np.linalg.norm(push - point.force) * (1.0 + 1e-9)
    asked = asker.requests[-1].crossings
    assert asked is not None
    assert (asked.kind == SelfTouch.CONTACT).all()
    assert count == 21
    assert crossed >= 10
