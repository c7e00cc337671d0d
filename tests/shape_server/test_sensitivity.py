"""Jacobians against differences of the solver's own shapes, and against what statics says of them."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from rods import ALONG_X, GRAVITY, KERNELS, Row, cable, contacts, frame, grasps, random_spans, span, start_from
from scipy.spatial.transform import Rotation

from protocol.errors import CablecosimError
from protocol.kinds import Hold, Outcome
from protocol.messages import Grasps, Problem, Shape
from shape_server import Sensitivities, sensitivities, solve

STEP = 1e-5  # m and rad; differences of fourth order
POSTURES = {
    "two clamps": grasps((0.0, (0.0, 0.0, 0.0), ALONG_X), (1.0, (0.6, 0.1, 0.2), frame((1.0, 0.4, 0.3), (0.0, 0.5, 1.0)))),
    "clamp and hinge": Grasps(
        s=np.array([0.0, 1.0]),
        position=np.array([[0.0, 0, 0], [0.6, 0.1, 0.2]]),
        quaternion=np.array([ALONG_X, ALONG_X]),
        hold=(Hold.CLAMP, Hold.HINGE),
    ),
    "a hinge between, tails at both ends": Grasps(
        s=np.array([0.1, 0.5, 0.9]),
        position=np.array([[0.0, 0, 0], [0.3, 0.05, 0.0], [0.6, 0.1, 0.1]]),
        quaternion=np.array([ALONG_X, ALONG_X, ALONG_X]),
        hold=(Hold.HINGE, Hold.HINGE, Hold.HINGE),
    ),
}


def settled(held: Grasps, start: Shape | None = None) -> Shape:
    problem = Problem(cable=cable(bending=5e-3), grasps=held, start=start_from(start) if start is not None else None)
    shape = solve(problem, GRAVITY, extrapolate=False, path=KERNELS)
    assert shape.outcome is Outcome.CONVERGED
    # Twice more, so that the iteration's own error is far below the differences.
    for _ in range(2 if start is not None else 0):
        shape = solve(msgspec.structs.replace(problem, start=start_from(shape)), GRAVITY, extrapolate=False, path=KERNELS)
    return shape


def moved(held: Grasps, grasp: int, axis: int, size: float) -> Grasps:
    position, quaternion = held.position.copy(), held.quaternion.copy()
    if axis < 3:
        position[grasp, axis] += size
    else:
        turn = Rotation.from_rotvec(size * np.eye(3)[axis - 3])
        quaternion[grasp] = (turn * Rotation.from_quat(quaternion[grasp])).as_quat()
    return msgspec.structs.replace(held, position=position, quaternion=quaternion)


def at(name: str) -> tuple[Grasps, Shape, Sensitivities]:
    held = POSTURES[name]
    shape = settled(held, settled(held))
    return held, shape, sensitivities(Problem(cable=cable(bending=5e-3), grasps=held), GRAVITY, shape)


@pytest.mark.parametrize("name", list(POSTURES))
def test_jacobians_are_the_slopes_of_nodes_and_wrenches(name: str) -> None:
    held, shape, found = at(name)
    for grasp in range(len(held.s)):
        for axis in range(6 if held.hold[grasp] is Hold.CLAMP else 3):
            sides = [settled(moved(held, grasp, axis, k * STEP), shape) for k in (1, -1, 2, -2)]
            for what, jacobian in (("nodes", found.nodes), ("grasp_wrenches", found.wrenches)):
                one, other, far, farther = (getattr(side, what) for side in sides)
                slope = (8 * (one - other) - (far - farther)) / (12 * STEP)
                scale = max(1.0, np.abs(jacobian).max())
                np.testing.assert_allclose(jacobian[..., grasp, axis], slope, atol=2e-5 * scale)  # measured 1e-6


@pytest.mark.parametrize("name", list(POSTURES))
def test_moving_all_grasps_together_moves_the_nodes_and_changes_no_wrench(name: str) -> None:
    _, shape, found = at(name)
    together = found.nodes[..., :3].sum(axis=2)
    np.testing.assert_allclose(together, np.tile(np.eye(3), (len(shape.s), 1, 1)), atol=1e-9)  # measured 1e-12
    np.testing.assert_allclose(found.wrenches[..., :3].sum(axis=2), 0.0, atol=1e-7)  # measured 2e-11


def test_what_one_grasp_feels_of_another_is_what_the_other_feels_of_it() -> None:
    """The stiffness is the second derivative of an energy: symmetric in the positions, and up to half the moments in the turns."""
    _, _, found = at("two clamps")
    stiffness = found.wrenches.reshape(12, 12)
    places = [0, 1, 2, 6, 7, 8]
    np.testing.assert_allclose(stiffness[np.ix_(places, places)], stiffness[np.ix_(places, places)].T, atol=1e-9)
    np.testing.assert_allclose(stiffness[:3, 9:], stiffness[9:, :3].T, atol=1e-9)


def test_a_held_point_moves_with_its_grasp_and_with_no_other() -> None:
    _, _, found = at("two clamps")
    np.testing.assert_allclose(found.nodes[-1, :, 1, :3], np.eye(3), atol=1e-9)
    np.testing.assert_allclose(found.nodes[-1, :, 0, :3], 0.0, atol=1e-9)
    np.testing.assert_allclose(found.nodes[0, :, 1], 0.0, atol=1e-12)


def test_what_it_is_not_built_for_is_refused() -> None:
    shape = settled(span())
    with pytest.raises(CablecosimError, match="without contacts"):
        sensitivities(Problem(cable=cable(), grasps=span(), contacts=contacts(Row(s=0.5, point=(0.3, 0.0, -1.0)))), GRAVITY, shape)
    problem = random_spans(1, 1e-2, 3)[0]
    with pytest.raises(CablecosimError, match="no stable equilibrium"):
        sensitivities(problem, GRAVITY, msgspec.structs.replace(shape, frames=shape.frames[::-1].copy()))
