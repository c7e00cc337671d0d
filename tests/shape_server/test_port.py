"""A branch condensed to its end: stiffness against differences of the solver's wrenches, and a junction of three branches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from types import ModuleType

import msgspec
import numpy as np
import pytest
from rods import ALONG_X, GRAVITY, Row, cable, contacts, frame, grasps, start_from
from scipy.spatial.transform import Rotation

from protocol.errors import CablecosimError
from protocol.kinds import Friction, Hold, Outcome
from protocol.messages import Problem, Shape
from shape_server import effects, kernels, numpy_path, solve
from shape_server.equilibrium import Settled
from shape_server.mesh import from_nodes
from shape_server.port import Port, port
from shape_server.rod import State
from shape_server.system import System, build

FAR = frame((1.0, 0.5, 0.6), (0.2, 1.0, 0.1))
BENT = grasps((0.0, (0.0, 0.0, 0.0), ALONG_X), (1.0, (0.6, 0.2, 0.1), FAR))
UNDER = contacts(Row(s=0.4, point=(0.3, 0.1, -0.15)), Row(s=0.6, point=(0.3, 0.1, -0.9)))
PROBLEMS = {
    "two clamps": Problem(cable=cable(), grasps=BENT),
    "elliptic and bent beforehand": Problem(cable=replace(cable(), bending_2=3e-2, natural_curvature=(0.5, 1.0, 0.3)), grasps=BENT),
    "stretched": Problem(cable=replace(cable(), stretch=30.0), grasps=BENT),
    "a hinge between": Problem(
        cable=cable(),
        grasps=msgspec.structs.replace(
            grasps((0.0, (0.0, 0.0, 0.0), ALONG_X), (0.5, (0.3, 0.1, -0.2), ALONG_X), (1.0, (0.6, 0.2, 0.1), FAR)),
            hold=(Hold.CLAMP, Hold.HINGE, Hold.CLAMP),
        ),
    ),
    "on a face, with another far below": Problem(cable=cable(), grasps=BENT, contacts=UNDER),
    "bonded": Problem(cable=cable(), grasps=BENT, contacts=contacts(Row(s=0.4, point=(0.3, 0.1, -0.15), friction=Friction.BOND))),
}
JUNCTION_LOAD = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0])  # N and N m
STEP_MAX = 0.1  # m and rad, of the junction in one step
UP = np.array([0.0, 0.0, 1.0])
each_problem = pytest.mark.parametrize("problem", PROBLEMS.values(), ids=PROBLEMS)


def at_rest(problem: Problem) -> Problem:
    """The problem with its shape and its contact forces to start from."""
    shape, touching = shape_of(problem), problem.contacts
    if touching is not None:
        touching = msgspec.structs.replace(touching, force=shape.contact_forces, s=shape.contact_s)
    return msgspec.structs.replace(problem, start=start_from(shape), contacts=touching)


def shape_of(problem: Problem) -> Shape:
    shape = solve(problem, GRAVITY, tolerance=3e-3, extrapolate=False, path=kernels)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    return shape


def settled(problem: Problem, path: ModuleType = kernels) -> tuple[System, State]:
    """Its equations on the mesh of its start shape, and where they are at rest."""
    assert problem.start is not None
    mesh = from_nodes(problem.start.s, problem.cable.length, problem.grasps.s)
    system = build(problem, GRAVITY, effects.asked_for(problem, GRAVITY), mesh)
    state = system.start(np.array(problem.start.frames))
    for _ in range(2):  # the second time to rounding
        found = Settled(*path.settle(system.rod, state, 0.0))
        assert found.is_converged
        assert found.is_stable
        state = State(*found.state)
    return system, state


def port_of(problem: Problem, path: ModuleType = kernels) -> Port:
    return port(*settled(problem, path), path)


def posed(problem: Problem, change: np.ndarray) -> Problem:
    """The problem with its last clamp moved by a change (6,), a rotation vector of the world frame among it."""
    held = problem.grasps
    position, quaternion = held.position.copy(), held.quaternion.copy()
    position[-1] += change[:3]
    quaternion[-1] = (Rotation.from_rotvec(change[3:]) * Rotation.from_quat(quaternion[-1])).as_quat()
    return msgspec.structs.replace(problem, grasps=msgspec.structs.replace(held, position=position, quaternion=quaternion))


def last_wrench(problem: Problem) -> np.ndarray:
    """(6,) Of the last clamp, from `solve`, which goes on twice from its own shape so as to come to rest to rounding."""
    for _ in range(2):
        problem = at_rest(problem)
    return shape_of(problem).grasp_wrenches[-1]


def slopes(quantity: Callable[[np.ndarray], np.ndarray], step: float) -> np.ndarray:
    """(6, 6) Central differences of fourth order of a quantity (6,) by a change (6,)."""
    out = np.empty((6, 6))
    for k, direction in enumerate(np.eye(6)):
        near, far = (quantity(size * direction) - quantity(-size * direction) for size in (step, 2 * step))
        out[:, k] = (8 * near - far) / (12 * step)
    return out


@each_problem
def test_a_port_is_the_slope_of_the_wrench_that_solve_finds_at_the_clamp(problem: Problem) -> None:
    problem = at_rest(problem)
    seen = port_of(problem)
    expected = seen.stiffness.copy()
    expected[3:, 3:] -= 0.5 * np.cross(np.eye(3), seen.force[3:])
    found = slopes(lambda change: last_wrench(posed(problem, change)), 2e-3)
    assert np.abs(found - expected).max() < 1e-5 * np.abs(expected).max()  # measured 1e-9, with contacts 1e-7
    np.testing.assert_allclose(seen.force, last_wrench(problem), atol=1e-6 * np.abs(seen.force).max())


@each_problem
def test_a_port_is_symmetric(problem: Problem) -> None:
    stiffness = port_of(at_rest(problem)).stiffness
    assert np.abs(stiffness - stiffness.T).max() < 1e-12 * np.abs(stiffness).max()  # measured 2e-14


@each_problem
def test_both_paths_see_the_same_port(problem: Problem) -> None:
    problem = at_rest(problem)
    compiled, plain = port_of(problem), port_of(problem, numpy_path)
    np.testing.assert_allclose(plain.stiffness, compiled.stiffness, atol=1e-8 * np.abs(compiled.stiffness).max())
    np.testing.assert_allclose(plain.force, compiled.force, atol=1e-8 * np.abs(compiled.force).max())


def test_a_junction_of_three_branches_comes_to_rest_by_newtons_method_on_its_pose() -> None:
    """A Y of a harness: three clamped chains end in a rigid body with a weight; six unknowns, whatever the number of segments."""
    branches = [at_rest(problem) for problem in y_of_a_harness()]
    unbalanced, shortest = [], np.inf
    while shortest > 1e-9 and len(unbalanced) < 40:
        ports = [port_of(branch) for branch in branches]
        stiffness, missing = sum(seen.stiffness for seen in ports), JUNCTION_LOAD - sum(seen.force for seen in ports)
        stiffnesses, directions = np.linalg.eigh(stiffness)
        change = directions @ (directions.T @ missing / np.abs(stiffnesses))  # away from saddles; Newton's where all are positive
        unbalanced.append(float(np.linalg.norm(missing)))
        shortest = float(np.linalg.norm(change))
        change *= min(1.0, STEP_MAX / shortest)
        branches = [at_rest(posed(branch, change)) for branch in branches]
    assert shortest < 1e-9
    assert stiffnesses.min() > 0.0
    constants = [after / before**2 for before, after in pairwise(unbalanced) if before < 1.0 and after > 1e-11]
    assert len(constants) >= 2
    assert max(constants) < 1.0  # 1/N; measured 0.23, 0.09, 0.15
    total = sum(last_wrench(branch) for branch in branches)
    np.testing.assert_allclose(total, JUNCTION_LOAD, atol=1e-8)
    places = np.array([branch.grasps.position[-1] for branch in branches])
    assert np.abs(places - places[0]).max() < 1e-12


def y_of_a_harness() -> list[Problem]:
    """Three chains from clamps around, which point inwards, to a junction that is not yet where it will rest."""
    problems = []
    for angle, length, bending in ((0.0, 0.5, 5e-2), (2.2, 0.55, 6e-2), (4.0, 0.48, 4e-2)):
        inwards = -np.array([np.cos(angle), np.sin(angle), 0.0])
        held = grasps((0.0, -0.3 * inwards, frame(inwards - UP)), (length, (0.0, 0.0, -0.2), frame(inwards)))
        problems.append(Problem(cable=cable(length=length, bending=bending), grasps=held))
    return problems


def test_a_free_end_has_no_port() -> None:
    problem = at_rest(Problem(cable=cable(), grasps=grasps((0.0, (0.0, 0.0, 0.0), ALONG_X))))
    with pytest.raises(CablecosimError, match="the clamp at the end of a cable"):
        port_of(problem)
