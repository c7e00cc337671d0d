"""A run in which a cable without bending is lowered over a wide drum, and lies round it on more and more of its segments."""

from __future__ import annotations

import numpy as np
import pytest
from in_process import steps

from protocol.kinds import Hold, Outcome, Primitive
from protocol.scene import Body, Cable, Gripper, Move, Scene, Target

RADIUS, HALF, WEIGHT = 0.12, 0.0045, 0.09 * 9.81  # m, m, N/m
ACROSS = (0.5**0.5, 0.0, 0.0, 0.5**0.5)

SCENE = Scene(
    title="A chain is lowered over a drum",
    gravity=(0.0, 0.0, -9.81),
    time_step=0.1,
    tolerance=1e-3,
    cables=(Cable("chain", 1.2, 2 * HALF, 0.09),),
    bodies=(Body(name="drum", shape=Primitive.CYLINDER, radius=RADIUS, length=0.6, position=(0.0, 0.0, 0.0), quaternion=ACROSS),),
    grippers=(
        Gripper(name="left", cable="chain", at=0.0, position=(-0.45, 0.0, 0.4), tangent=(1.0, 0.0, -0.3), hold=Hold.HINGE),
        Gripper(name="right", cable="chain", at=1.2, position=(0.45, 0.0, 0.4), tangent=(1.0, 0.0, 0.5), hold=Hold.HINGE),
    ),
    moves=(
        Move(
            name="lower",
            duration=2.0,
            targets=(Target(gripper="right", by=(-0.05, 0.0, -0.5)), Target(gripper="left", by=(0.08, 0.0, -0.6))),
        ),
    ),
)


@pytest.mark.slow
def test_it_lies_round_it_ever_further_with_one_number_for_tension_less_weight_times_height() -> None:
    lying = []
    for _, step in steps(SCENE):
        cable = step.cables[0]
        shape, pushes = cable.shape, cable.boundary.pushes
        assert shape.outcome is Outcome.CONVERGED, shape.sentence
        assert cable.bodies.penetration < 1e-6
        total = pushes.force.sum(axis=0) + shape.grasp_wrenches[:, :3].sum(axis=0)
        assert np.abs(total - [0.0, 0.0, 1.2 * WEIGHT]).max() < 1e-9
        away = np.hypot(shape.nodes[:, 0], shape.nodes[:, 2])
        assert away.min() > RADIUS + HALF - 1e-5
        middle = 0.5 * (shape.nodes[1:, 2] + shape.nodes[:-1, 2])
        kinetic = shape.tension - WEIGHT * middle
        if len(shape.s) > 50:
            assert np.ptp(kinetic) < 0.02 * shape.tension.max()  # measured 0.012: of the polygon's middles
        lying.append(float(np.ptp(pushes.s)) if len(pushes.s) else 0.0)
    assert lying[0] < 0.2
    assert lying[-1] > 2.0 * (RADIUS + HALF)
