"""Surfaces that stick together, against boundary value problems of the plane elastica with the forces of the joint as unknowns.

Between clamps and joints EI theta' = m, m' = F sin theta - G cos theta, with F and G constant. A joint shares a point and the normal of
both surfaces: the axes stay a diameter D apart along the normal n of both, which turn together. With f and M on the first at its axis,

    f = -[F, G],    M = -[m],    both jumps along the first;    -f and -M - D n x f on the second.

1. A loop whose strands are stuck to each other at a neck, and whose clamps are apart: by symmetry theta = -pi / 2 there, and x half a
   diameter from the middle; unknown are F, f and M of each half.
2. Two cables side by side, stuck together off their middles and pulled apart by their clamps: four pieces, in which nothing is
   symmetric.

A section a hundred times as stiff across keeps the rods in their plane.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from planar import BENDING, DIAMETER, planar
from scipy.integrate import solve_bvp
from scipy.spatial.transform import Rotation

from protocol.kinds import Hold, Outcome, SelfInteraction, SelfTouch
from protocol.messages import CrossingReactions, Crossings, Grasps, Problem, Shape, ShapeRequest, Start
from shape_server import numpy_path
from shape_server.hard_cases.posing import ALONG_X
from shape_server.together import answers

HALF, NECK = 0.15, 0.2  # m, of the distance of the loop's clamps; m, arc length of what sticks
ENDS = np.array([[[-0.38, 0.16], [0.38, 0.12]], [[-0.37, -0.15], [0.4, -0.12]]])  # m, clamps of two cables, x and z
STUCK = (0.45, 0.525)  # m, arc lengths on the two
CABLE = planar("first", SelfInteraction.BOND)


def frames(angle: np.ndarray) -> np.ndarray:
    """Quaternions of segments at angles (n-1,) [rad] to x, in the plane of x and z."""
    quaternions: np.ndarray = (Rotation.from_rotvec(np.outer(-angle, [0.0, 1.0, 0.0])) * Rotation.from_quat(ALONG_X)).as_quat()
    return quaternions


def arm(side: float) -> np.ndarray:
    """From the axis to the surface [m], in the directors, on the left of the cable as it goes, or on its right (-1)."""
    up: np.ndarray = Rotation.from_quat(ALONG_X).inv().apply([0.0, 0.0, 0.5 * side * DIAMETER])
    return up


def problem(name: str, clamps: np.ndarray, angle: np.ndarray) -> Problem:
    """A cable between clamps (2, 2) [m] along x that starts at these angles."""
    s, places = np.linspace(0.0, 1.0, len(angle) + 1), np.column_stack([clamps[:, 0], np.zeros(2), clamps[:, 1]])
    grasps = Grasps(s=np.array([0.0, 1.0]), position=places, quaternion=np.array([ALONG_X, ALONG_X]), hold=(Hold.CLAMP, Hold.CLAMP))
    return Problem(cable=replace(CABLE, name=name), grasps=grasps, start=Start(s=s, frames=frames(angle), grasp_forces=np.zeros((2, 3))))


def asked(problems: tuple[Problem, ...], s: tuple[float, float], sides: tuple[float, float]) -> ShapeRequest:
    """About cables of which two places stick, on these sides of them."""
    crossings = Crossings(
        cable=np.array([[0, len(problems) - 1]]),
        s=np.array([s]),
        kind=np.array([int(SelfTouch.BOND)]),
        normal=np.array([[0.0, 0.0, 1.0]]),
        distance=np.zeros(1),
        force=np.zeros((1, 3)),
        arm=np.concatenate([arm(side) for side in sides])[None],
        mu=np.zeros(1),
        held=np.zeros((1, 2)),
        drag=np.zeros((1, 3)),
    )
    return ShapeRequest(
        session="s", step=0, round=0, gravity=(0.0, 0.0, 0.0), tolerance=1e-3, problems=problems, extrapolate=False, crossings=crossings
    )


def stuck(request: ShapeRequest) -> tuple[tuple[Shape, ...], CrossingReactions]:
    """What is answered, which must be stable."""
    shapes, reactions = answers(request, numpy_path)
    for shape in shapes:
        assert shape.outcome is Outcome.CONVERGED, shape.sentence
        assert shape.is_stable
    assert reactions is not None
    assert reactions.gap[0] < 1e-7  # m, between the points that stick; measured 2e-8, what a joint gives way
    return shapes, reactions


def slopes(y: np.ndarray, force: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Of pieces (k, 4, t) over their shares: x, z, theta, m; `force` (k, 2) [N]."""
    angle, moment = y[:, 2], y[:, 3]
    turning = force[:, :1] * np.sin(angle) - force[:, 1:] * np.cos(angle)
    return np.asarray(lengths[:, None, None] * np.stack([np.cos(angle), np.sin(angle), moment / BENDING, turning], axis=1))


@cache
def loop() -> tuple[Any, float]:
    """The half of the loop before and after its neck over their shares, and f [N] along x."""
    lengths = np.array([NECK, 0.5 - NECK])

    def derivative(_: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        force = np.array([[p[0], 0.0], [p[1], 0.0]])
        return slopes(y.reshape(2, 4, -1), force, lengths).reshape(8, -1)

    def ends(u: np.ndarray, v: np.ndarray, _: np.ndarray) -> np.ndarray:
        neck = [v[0] + DIAMETER / 2, v[2] + np.pi / 2, *(u[4:7] - v[:3])]
        return np.array([u[0] + HALF, u[1], u[2], *neck, v[4], v[6]])

    t = np.linspace(0.0, 1.0, 60)
    first, second = -np.pi / 2 * t, -np.pi / 2 - 4.0 * t * (1 - t) + np.pi / 2 * t
    guess = [-HALF + (HALF - DIAMETER / 2) * t, -0.15 * t, first, BENDING * np.gradient(first, t) / NECK]
    guess += [-DIAMETER / 2 - 0.15 * np.sin(np.pi * t), -0.15 - 0.2 * t, second, BENDING * np.gradient(second, t) / (0.5 - NECK)]
    solved = solve_bvp(derivative, ends, t, np.array(guess), p=np.array([1.0, -1.0]), tol=1e-9, max_nodes=20_000)
    assert solved.status == 0
    return solved.sol, float(solved.p[0] - solved.p[1])


@cache
def solved_loop(segments: int) -> tuple[Shape, CrossingReactions]:
    middle = (np.arange(segments) + 0.5) / segments
    h = np.minimum(middle, 1.0 - middle)
    angle = -np.pi / 2 * np.minimum(h / NECK, 1.0) - 0.9 * np.clip((h - 0.22) / 0.08, 0.0, 1.0)
    angle += np.clip((h - 0.3) / 0.2, 0.0, 1.0) * (np.pi / 2 + 0.9)
    clamps = np.array([[-HALF, 0.0], [HALF, 0.0]])
    own = problem("first", clamps, np.where(middle <= 0.5, angle, -angle))
    (shape,), reactions = stuck(asked((own,), (NECK, 1.0 - NECK), (1.0, 1.0)))
    return shape, reactions


def halves(s: np.ndarray, at: float, length: float, solution: Any, first: int) -> np.ndarray:
    """Places in x and z (n, 2) [m] of two pieces, the unknowns of which begin at `first`, at arc lengths s [m]; the joint at `at`."""
    before, after = solution(np.clip(s / at, 0.0, 1.0)), solution(np.clip((s - at) / (length - at), 0.0, 1.0))
    return np.where(s <= at, before[first : first + 2], after[first + 4 : first + 6]).T


def test_a_loop_stuck_to_itself_is_where_the_elastica_has_it_to_second_order() -> None:
    errors = []
    for segments in (40, 80):
        shape, _ = solved_loop(segments)
        first = shape.s <= 0.5
        exact = halves(shape.s[first], NECK, 0.5, loop()[0], 0)
        errors.append(float(np.linalg.norm(shape.nodes[first][:, [0, 2]] - exact, axis=1).max()))
    assert errors[1] < 4e-4  # m; measured 2.7e-4, 1.7e-5 on 320 segments
    assert 3.0 < errors[0] / errors[1] < 5.0  # measured 3.8; theory: 4


def test_the_force_of_a_bond_that_pulls_is_that_of_the_elastica() -> None:
    shape, reactions = solved_loop(80)
    _, force = loop()
    assert force > 1.0  # N, on the first strand towards the second
    assert reactions.force[0, 0] == pytest.approx(force, rel=0.02)  # measured 0.9 %, 0.05 % on 320 segments
    np.testing.assert_allclose(reactions.force[0, 1:], 0.0, atol=1e-9)
    held, turning = shape.grasp_wrenches[:, :3], shape.grasp_wrenches[:, 3:]
    np.testing.assert_allclose(held.sum(axis=0), 0.0, atol=1e-9)  # what a bond does to both strands cancels
    np.testing.assert_allclose((turning + np.cross(shape.nodes[[0, -1]], held)).sum(axis=0), 0.0, atol=1e-9)


@cache
def solved_pair(segments: int) -> tuple[tuple[Shape, ...], CrossingReactions]:
    middle = (np.arange(segments) + 0.5) / segments
    angle = 0.9 * np.sin(2 * np.pi * middle)
    problems = (problem("first", ENDS[0], -angle), problem("second", ENDS[1], angle))
    return stuck(asked(problems, STUCK, (-1.0, 1.0)))


@cache
def pair() -> tuple[Any, np.ndarray]:
    """Both cables before and after the joint over their shares, and the forces (4, 2) [N] in the pieces; the guess is a shape of ours."""
    lengths = np.array([STUCK[0], 1.0 - STUCK[0], STUCK[1], 1.0 - STUCK[1]])

    def derivative(_: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        return slopes(y.reshape(4, 4, -1), p.reshape(4, 2), lengths).reshape(16, -1)

    def ends(u: np.ndarray, v: np.ndarray, p: np.ndarray) -> np.ndarray:
        begin, end, force = u.reshape(4, 4), v.reshape(4, 4), p.reshape(4, 2)
        clamped = [*begin[0, :2] - ENDS[0, 0], *end[1, :2] - ENDS[0, 1], *begin[2, :2] - ENDS[1, 0], *end[3, :2] - ENDS[1, 1]]
        level = [begin[0, 2], end[1, 2], begin[2, 2], end[3, 2]]
        along = [*begin[1, :3] - end[0, :3], *begin[3, :3] - end[2, :3]]
        angle = end[0, 2]
        normal = np.array([-np.sin(angle), np.cos(angle)])
        joint = [*end[0, :2] - end[2, :2] - DIAMETER * normal, angle - end[2, 2]]
        jumps, couples = force[[1, 3]] - force[[0, 2]], begin[[1, 3], 3] - end[[0, 2], 3]
        pushed = -jumps[0]
        balance = [*jumps.sum(axis=0), -couples.sum() + DIAMETER * (normal[0] * pushed[1] - normal[1] * pushed[0])]
        return np.array([*clamped, *level, *along, *joint, *balance])

    t, guess, (shapes, _) = np.linspace(0.0, 1.0, 60), [], solved_pair(40)
    for shape, at in zip(shapes, STUCK, strict=True):
        steps = np.diff(shape.nodes, axis=0)
        angle, middle = np.arctan2(steps[:, 2], steps[:, 0]), 0.5 * (shape.s[1:] + shape.s[:-1])
        for s in (at * t, at + (1.0 - at) * t):
            bent = np.interp(s, middle, angle)
            x, z = (np.interp(s, shape.s, shape.nodes[:, axis]) for axis in (0, 2))
            guess += [x, z, bent, BENDING * np.gradient(bent, s)]
    forces = np.concatenate([sign * shape.grasp_wrenches[end, [0, 2]] for shape in shapes for end, sign in ((0, -1.0), (1, 1.0))])
    solved = solve_bvp(derivative, ends, t, np.array(guess), p=forces, tol=1e-8, max_nodes=20_000)
    assert solved.status == 0, solved.message
    return solved.sol, solved.p.reshape(4, 2)


@pytest.mark.thorough
def test_two_cables_stuck_together_are_where_two_elasticas_have_them_to_second_order() -> None:
    solution, errors = pair()[0], []
    for segments in (40, 80):
        away = [
            np.linalg.norm(shape.nodes[:, [0, 2]] - halves(shape.s, at, 1.0, solution, 8 * k), axis=1).max()
            for k, (shape, at) in enumerate(zip(solved_pair(segments)[0], STUCK, strict=True))
        ]
        errors.append(float(max(away)))
    assert errors[1] < 6e-4  # m; measured 4.6e-4
    assert 3.0 < errors[0] / errors[1] < 5.0  # measured 4.1; theory: 4


def test_forces_and_couples_between_two_cables_stuck_together_are_those_of_the_elasticas() -> None:
    solution, forces = pair()
    shapes, reactions = solved_pair(80)
    np.testing.assert_allclose(reactions.force[0], np.insert(forces[0] - forces[1], 1, 0.0), atol=1e-3)  # N, of 0.36; measured 6e-4
    held = np.array([shape.grasp_wrenches for shape in shapes])
    couples = [solution(0.0)[3], -solution(1.0)[7], solution(0.0)[11], -solution(1.0)[15]]
    np.testing.assert_allclose(held[:, :, 4].ravel(), couples, atol=4e-4)  # N m, of 0.1; measured 2e-4
    np.testing.assert_allclose(held[:, :, :3].sum(axis=(0, 1)), 0.0, atol=1e-9)
    turning = held[:, :, 3:] + np.cross([shape.nodes[[0, -1]] for shape in shapes], held[:, :, :3])
    np.testing.assert_allclose(turning.sum(axis=(0, 1)), 0.0, atol=1e-9)


@pytest.mark.slow
def test_cables_that_cannot_reach_each_other_have_no_shape() -> None:
    angle = 0.06 * np.sin(2 * np.pi * (np.arange(8) + 0.5) / 8)
    ends = np.array([[-0.499, 0.08], [0.499, 0.08]])  # m; at most 0.03 m of it can be gone
    far = (problem("first", ends, -angle), problem("second", ends * [1.0, -1.0], angle))
    shapes, reactions = answers(asked(far, (0.5, 0.5), (-1.0, 1.0)), numpy_path)
    assert reactions is None
    for shape in shapes:
        assert shape.outcome is Outcome.NOT_CONVERGED
        assert shape.sentence.startswith("cables 'first' and 'second', which touch each other, together: no minimum found")
