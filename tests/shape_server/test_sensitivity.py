"""Jacobians against differences of the solver's own shapes, and against what statics says of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import msgspec
import numpy as np
import pytest
from rods import ALONG_X, GRAVITY, KERNELS, RADIUS, Row, cable, contacts, frame, grasps, random_spans, span, start_from
from scipy.spatial.transform import Rotation

from protocol.errors import CablecosimError
from protocol.kinds import Feature, Friction, Hold, Model, Outcome
from protocol.messages import Grasps, PointLoads, Problem, Shape
from protocol.scene import LumpedMass, Section
from shape_server import Sensitivities, sensitivities, solve

STEP = 1e-5  # m and rad; differences of fourth order
TURNED = frame((1.0, 0.4, 0.3), (0.0, 0.5, 1.0))
SPAN_3D = grasps((0.0, (0.0, 0.0, 0.0), ALONG_X), (1.0, (0.6, 0.1, 0.2), TURNED))
GUIDED = grasps((0.0, (0.0, 0.0, 0.0), ALONG_X), (1.0, (0.6, 0.1, 0.2), TURNED), hold=Hold.GUIDE)


def held(*rows: tuple[float, object, np.ndarray, Hold]) -> Grasps:
    """Grasps of several kinds."""
    made = grasps(*(row[:3] for row in rows))
    return msgspec.structs.replace(made, hold=tuple(row[3] for row in rows))


def posed(where: Grasps, *rows: Row, stretch: float | None = None) -> Problem:
    return Problem(cable=replace(cable(bending=5e-3), stretch=stretch), grasps=where, contacts=contacts(*rows) if rows else None)


def smoothed(problem: Problem) -> Problem:
    """The problem with a rod that resists a change of curvature."""
    return msgspec.structs.replace(problem, cable=replace(problem.cable, micro_length=0.05), model=Model.ROD)


def pressed(problem: Problem, s: float, feature: Feature = Feature.EDGE, *, by: float, distance: float = RADIUS) -> Problem:
    """The problem with an edge aslant or a vertex that lifts the cable at `s` by so many metres."""
    free = settled(problem)
    node = int(np.searchsorted(free.s, s))
    along, edge = free.nodes[node] - free.nodes[node - 1], np.array([0.3, 0.9, 0.1]) / np.linalg.norm([0.3, 0.9, 0.1])
    normal = np.cross(along, edge if feature is Feature.EDGE else np.cross((0.0, 0.0, 1.0), along))
    normal *= np.sign(normal[2]) / np.linalg.norm(normal)
    at = free.nodes[node] - (distance - by) * normal
    row = Row(s=free.s[node], point=at, normal=normal, direction=edge, feature=feature, distance=distance)
    return msgspec.structs.replace(problem, contacts=contacts(row if feature is Feature.EDGE else replace(row, direction=(0.0, 0.0, 0.0))))


def settled(problem: Problem, start: Shape | None = None) -> Shape:
    """Cold, or from a shape until nothing moves: the iteration's own error is then far below the differences."""
    shape = solve(problem, GRAVITY, extrapolate=False, path=KERNELS, tolerance=1e-2) if start is None else start
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    for _ in range(60 if start is not None else 0):
        before, touched = shape, problem.contacts
        if touched is not None:
            touched = msgspec.structs.replace(touched, force=before.contact_forces)
        again = msgspec.structs.replace(problem, start=start_from(before), contacts=touched)
        shape = solve(again, GRAVITY, extrapolate=False, path=KERNELS)
        assert shape.outcome is Outcome.CONVERGED
        assert "relaxed" not in shape.sentence
        if np.abs(shape.nodes - before.nodes).max() < 1e-13:
            break
    return shape


A_HINGE_AND_INNER_CLAMPS = held(
    (0.0, (0, 0, 0), ALONG_X, Hold.HINGE), (0.3, (0.2, 0, 0), ALONG_X, Hold.CLAMP), (0.7, (0.45, 0.1, 0.1), TURNED, Hold.CLAMP)
)
TWO_GUIDES_AND_A_HINGE = held(
    (0.1, (0, 0, 0), ALONG_X, Hold.GUIDE), (0.5, (0.3, 0.05, 0), TURNED, Hold.GUIDE), (0.9, (0.7, 0.1, 0.1), ALONG_X, Hold.HINGE)
)
A_CLAMP_BETWEEN_HINGES = held(
    (0.0, (0, 0, 0), ALONG_X, Hold.HINGE), (0.6, (0.4, 0.05, -0.1), ALONG_X, Hold.CLAMP), (1.0, (0.7, 0.1, 0.1), TURNED, Hold.HINGE)
)
A_HINGE_AND_A_GUIDE = held((0.0, (0, 0, 0), ALONG_X, Hold.HINGE), (1.0, (0.6, 0.1, 0.2), TURNED, Hold.GUIDE))


def with_everything() -> Problem:
    """Two stiffnesses, natural curvature, a stiff part, a mass, a load, stretch; a clamp, a hinge, a guide; an edge."""
    where = held(
        (0.0, (0, 0, 0), ALONG_X, Hold.CLAMP), (0.6, (0.4, 0.05, -0.1), ALONG_X, Hold.HINGE), (1.0, (0.7, 0.1, 0.1), TURNED, Hold.GUIDE)
    )
    made = replace(
        posed(where, stretch=20.0).cable,
        bending_2=8e-3,
        natural_curvature=(0.5, -1.0, 1.0),
        sections=(Section(start=0.7, end=0.8, bending=2e-2),),
        masses=(LumpedMass(at=0.85, mass=0.02),),
    )
    load = PointLoads(s=np.array([0.2]), force=np.array([[0.0, 0.1, 0.05]]))
    return pressed(Problem(cable=made, grasps=where, loads=load), 0.3, by=0.01)


FREE: dict[str, Callable[[], Problem]] = {
    "two clamps": lambda: posed(SPAN_3D),
    "clamp and hinge": lambda: posed(held((0.0, (0, 0, 0), ALONG_X, Hold.CLAMP), (1.0, (0.6, 0.1, 0.2), ALONG_X, Hold.HINGE))),
    "a hinge between, tails at both ends": lambda: posed(
        grasps((0.1, (0, 0, 0), ALONG_X), (0.5, (0.3, 0.05, 0), ALONG_X), (0.9, (0.6, 0.1, 0.1), ALONG_X), hold=Hold.HINGE)
    ),
    "a guide": lambda: posed(GUIDED),
    "a guide in the plane": lambda: posed(span(hold=Hold.GUIDE)),
    "guides before the base, a cable that stretches": lambda: posed(TWO_GUIDES_AND_A_HINGE, stretch=20.0),
    "a cable that stretches": lambda: posed(SPAN_3D, stretch=20.0),
    "a micro-structure length": lambda: smoothed(posed(SPAN_3D)),
    "a micro-structure length, a guide, stretch": lambda: smoothed(posed(GUIDED, stretch=20.0)),
    "clamps inside": lambda: posed(A_HINGE_AND_INNER_CLAMPS),
    "clamps inside, a micro-structure length": lambda: smoothed(posed(A_HINGE_AND_INNER_CLAMPS)),
    "clamps inside a cable that stretches": lambda: posed(A_HINGE_AND_INNER_CLAMPS, stretch=20.0),
}
TOUCHING: dict[str, Callable[[], Problem]] = {
    "one of two planes": lambda: posed(span(), Row(s=0.5, point=(0.3, 0, -0.25)), Row(s=0.55, point=(0.3, 0, -0.255))),
    "two planes, a guide, stretch": lambda: posed(
        A_HINGE_AND_A_GUIDE,
        Row(s=0.4, point=(0.31, 0.023, -0.3), normal=(0, 0.6, 0.8)),
        Row(s=0.5, point=(0.4, 0.048, -0.25)),
        stretch=20.0,
    ),
    "a bond and a plane": lambda: posed(
        SPAN_3D, Row(s=0.4, point=(0.31, 0.023, -0.22), friction=Friction.BOND), Row(s=0.7, point=(0.49, 0.048, -0.065))
    ),
    "an edge, a micro-structure length": lambda: pressed(smoothed(posed(SPAN_3D)), 0.4, by=0.01),
    "an edge in the plane": lambda: posed(span(), Row(s=0.41, point=(0.24, 0, -0.3), direction=(0, 1, 0), feature=Feature.EDGE)),
    "an edge": lambda: pressed(posed(SPAN_3D), 0.4, by=0.01),
    "an edge, stretch": lambda: pressed(posed(SPAN_3D, stretch=20.0), 0.6, by=0.01),
    "an edge, a guide, stretch": lambda: pressed(posed(GUIDED, stretch=20.0), 0.4, by=0.01),
    "an edge beside an inner clamp": lambda: pressed(posed(A_CLAMP_BETWEEN_HINGES), 0.3, by=0.005),
    "everything at once": with_everything,
    "a vertex": lambda: pressed(posed(SPAN_3D), 0.4, Feature.VERTEX, by=0.01, distance=0.02),
}
POSTURES = FREE | TOUCHING


@cache
def at(name: str) -> tuple[Problem, Shape, Sensitivities]:
    problem = POSTURES[name]()
    shape = settled(problem, settled(problem))
    return problem, shape, sensitivities(problem, GRAVITY, shape)


def moved(where: Grasps, grasp: int, axis: int, size: float) -> Grasps:
    position, quaternion = where.position.copy(), where.quaternion.copy()
    if axis < 3:
        position[grasp, axis] += size
    else:
        turn = Rotation.from_rotvec(size * np.eye(3)[axis - 3])
        quaternion[grasp] = (turn * Rotation.from_quat(quaternion[grasp])).as_quat()
    return msgspec.structs.replace(where, position=position, quaternion=quaternion)


@pytest.mark.sampled(6)
@pytest.mark.parametrize("name", list(POSTURES))
def test_jacobians_are_the_slopes_of_nodes_and_wrenches(name: str) -> None:
    problem, shape, found = at(name)
    where = problem.grasps
    assert found.sentence == ""
    assert (name in TOUCHING) == bool(np.any(shape.contact_forces))
    for grasp in range(len(where.s)):
        for axis in range(3 if where.hold[grasp] is Hold.HINGE else 6):
            steps = (1, -1, 2, -2)
            sides = [settled(msgspec.structs.replace(problem, grasps=moved(where, grasp, axis, k * STEP)), shape) for k in steps]
            for what, jacobian in (("nodes", found.nodes), ("grasp_wrenches", found.wrenches)):
                one, other, far, farther = (getattr(side, what) for side in sides)
                slope = (8 * (one - other) - (far - farther)) / (12 * STEP)
                scale = max(1.0, np.abs(jacobian).max())
                # Measured 7e-11 without edges, 4e-7 with them, where the shapes themselves are found less exactly.
                np.testing.assert_allclose(jacobian[..., grasp, axis], slope, atol=2e-6 * scale)


@pytest.mark.parametrize("name", list(POSTURES))
def test_the_turn_of_a_hinge_moves_nothing(name: str) -> None:
    problem, _, found = at(name)
    hinges = [k for k, hold in enumerate(problem.grasps.hold) if hold is Hold.HINGE]
    assert not found.nodes[:, :, hinges, 3:].any()
    assert not found.wrenches[:, :, hinges, 3:].any()
    assert not found.wrenches[hinges, 3:].any()


@pytest.mark.parametrize("name", list(FREE))
def test_moving_all_grasps_together_moves_the_nodes_and_changes_no_wrench(name: str) -> None:
    _, shape, found = at(name)
    together = found.nodes[..., :3].sum(axis=2)
    np.testing.assert_allclose(together, np.tile(np.eye(3), (len(shape.s), 1, 1)), atol=1e-9)  # measured 1e-12
    np.testing.assert_allclose(found.wrenches[..., :3].sum(axis=2), 0.0, atol=1e-7)  # measured 2e-11


@pytest.mark.parametrize("name", ["two clamps", "a cable that stretches"])
def test_what_one_grasp_feels_of_another_is_what_the_other_feels_of_it(name: str) -> None:
    """The stiffness is the second derivative of an energy: symmetric in the positions, and up to half the moments in the turns."""
    _, _, found = at(name)
    stiffness = found.wrenches.reshape(12, 12)
    places = [0, 1, 2, 6, 7, 8]
    np.testing.assert_allclose(stiffness[np.ix_(places, places)], stiffness[np.ix_(places, places)].T, atol=1e-9)
    np.testing.assert_allclose(stiffness[:3, 9:], stiffness[9:, :3].T, atol=1e-9)


@pytest.mark.parametrize("name", ["two clamps", "a cable that stretches", "an edge, stretch"])
def test_a_held_point_moves_with_its_grasp_and_with_no_other(name: str) -> None:
    _, _, found = at(name)
    np.testing.assert_allclose(found.nodes[-1, :, 1, :3], np.eye(3), atol=1e-9)
    np.testing.assert_allclose(found.nodes[-1, :, 0, :3], 0.0, atol=1e-9)
    np.testing.assert_allclose(found.nodes[0, :, 1], 0.0, atol=1e-12)


def test_a_guided_point_slides_along_the_tangent_only() -> None:
    problem, _, found = at("a guide")
    axes = Rotation.from_quat(problem.grasps.quaternion[1]).as_matrix().T
    np.testing.assert_allclose(axes[:2] @ found.nodes[-1, :, 0, :3], 0.0, atol=1e-9)
    assert np.abs(axes[2] @ found.nodes[-1, :, 0, :3]).max() > 0.1


def test_what_is_felt_beyond_an_inner_clamp_is_nothing() -> None:
    """Three pieces: the ends do not know of each other, and the clamps between two pieces feel both."""
    _, shape, found = at("clamps inside")
    first, last = shape.s < 0.3, shape.s > 0.7
    assert not found.nodes[first][:, :, 2].any()
    assert not found.nodes[last][:, :, :2].any()
    assert not found.wrenches[0, :, 2].any()
    assert found.wrenches[1, :, 0].any()
    assert found.wrenches[1, :, 2].any()


def test_an_open_contact_changes_nothing() -> None:
    problem, shape, found = at("two clamps")
    far = msgspec.structs.replace(problem, contacts=contacts(Row(s=0.5, point=(0.3, 0.0, -1.0))))
    nothing = np.zeros((1, 3))
    shape = msgspec.structs.replace(shape, contact_forces=nothing, contact_moments=nothing, contact_s=np.array([0.5]))
    open_too = sensitivities(far, GRAVITY, shape)
    np.testing.assert_allclose(open_too.nodes, found.nodes, atol=1e-9)
    np.testing.assert_allclose(open_too.wrenches, found.wrenches, atol=1e-9)


@pytest.mark.parametrize("friction", [Friction.NONE, Friction.BOND])
def test_a_contact_that_is_about_to_open_is_named(friction: Friction) -> None:
    """A plane, and a bond, exactly where the free cable is: no force, no gap, and so derivatives on one side only."""
    problem, shape, _ = at("two clamps")
    node = len(shape.s) // 2
    below = Row(s=shape.s[node], point=shape.nodes[node] - (0.0, 0.0, RADIUS), friction=friction)
    touching = msgspec.structs.replace(problem, contacts=contacts(below))
    begun = msgspec.structs.replace(touching, start=start_from(shape))
    found = sensitivities(touching, GRAVITY, solve(begun, GRAVITY, extrapolate=False, path=KERNELS))
    assert found.sentence.startswith("contacts about to open or to close: 0;")


def test_what_it_is_not_built_for_is_refused() -> None:
    rope = Problem(cable=cable(bending=None), grasps=span())
    with pytest.raises(CablecosimError, match="built for a rod; this shape is of the model catenary"):
        sensitivities(rope, GRAVITY, solve(rope, GRAVITY))
    shape = settled(Problem(cable=cable(), grasps=span()))
    problem = random_spans(1, 1e-2, 3)[0]
    with pytest.raises(CablecosimError, match="no stable equilibrium"):
        sensitivities(problem, GRAVITY, msgspec.structs.replace(shape, frames=shape.frames[::-1].copy()))
