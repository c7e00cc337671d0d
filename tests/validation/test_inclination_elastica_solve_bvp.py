"""Figs. 10 and 11 of the paper: two grippers at x = 0 and 5, an obstacle at x = 3.5, its inclination fixed at zero (G_inf) or free (G_0).

"Simulating robotic manipulation of cabling and interaction with surroundings", section 5.1, in the x-z plane with gravity along -z. Both
parts of the cable are plane heavy elasticas, x' = cos a, z' = sin a, EI a' = m, m' = H sin a - (V + w s) cos a, with the horizontal force H
given and the same in both; their lengths are unknowns of a boundary value problem, and so is what the obstacle takes. With the angle
there given, or angle and moment continuous. The rod gets these lengths, a bond at the obstacle, and nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from protocol.errors import SceneError
from protocol.kinds import FRICTION_CODES, INCLINATION_CODES, Feature, Friction, Hold, Inclination, Outcome
from protocol.messages import Contacts, Grasps, Problem, Shape
from protocol.scene import Body, Cable, Gripper, Scene, check_scene
from shape_server import solve
from shape_server.hard_cases.posing import ALONG_X

PULL, WEIGHT, BENDING = 20.0, 0.5, 1.5  # N, N/m, N m^2
FIRST, OBSTACLE, LAST = (0.0, -0.3), (3.5, 0.0), (5.0, -0.6)  # m, x and z
RADIUS = 0.01  # m


@dataclass(frozen=True)
class Reference:
    """Both parts."""

    lengths: tuple[float, float]  # m
    angle: float  # rad, at the obstacle
    jump: float  # N m, of the moment there
    points: np.ndarray  # (k, 2) m, evenly along the first part


@cache
def reference(fixed_at: float | None, bending: float = BENDING) -> Reference:
    """The cable with its inclination at the obstacle given [rad], or free."""

    def slopes(t: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        rows = []
        for k in range(2):
            length, lift = p[2 * k], p[2 * k + 1]
            angle, moment = y[4 * k + 2], y[4 * k + 3]
            turn = PULL * np.sin(angle) - (lift + WEIGHT * length * t) * np.cos(angle)
            rows += [length * np.cos(angle), length * np.sin(angle), length * moment / bending, length * turn]
        return np.array(rows)

    def ends(u: np.ndarray, v: np.ndarray, _: np.ndarray) -> np.ndarray:
        at = [v[2] - u[6], v[3] - u[7]] if fixed_at is None else [v[2] - fixed_at, u[6] - fixed_at]
        start, end = [u[0] - FIRST[0], u[1] - FIRST[1], u[2]], [v[4] - LAST[0], v[5] - LAST[1], v[6]]
        return np.array([*start, *end, v[0] - OBSTACLE[0], v[1] - OBSTACLE[1], u[4] - OBSTACLE[0], u[5] - OBSTACLE[1], *at])

    t = np.linspace(0.0, 1.0, 80)
    guess = np.zeros((8, len(t)))
    guess[0], guess[4] = 3.5 * t, 3.5 + 1.5 * t
    guess[1], guess[5] = FIRST[1] * (1 - t), LAST[1] * t
    solved = solve_bvp(slopes, ends, t, guess, p=np.array([3.6, -5.0, 1.6, -2.0]), tol=1e-8, max_nodes=50_000)
    assert solved.status == 0
    first, last = solved.sol(np.array([1.0]))[:, 0], solved.sol(np.array([0.0]))[:, 0]
    points = solved.sol(np.linspace(0.0, 1.0, 101))[:2].T
    return Reference((float(solved.p[0]), float(solved.p[2])), float(first[2]), float(last[7] - first[3]), points)


@cache
def bonded(inclination: Inclination, first: float, second: float) -> Shape:
    """The rod with a bond at the obstacle, whose normal points up."""
    length = first + second
    cable = Cable(name="c", length=length, diameter=2 * RADIUS, mass_per_length=WEIGHT / 10.0, bending=BENDING, twist=BENDING)
    grasps = Grasps(
        s=np.array([0.0, length]),
        position=np.array([[FIRST[0], 0.0, FIRST[1]], [LAST[0], 0.0, LAST[1]]]),
        quaternion=np.array([ALONG_X, ALONG_X]),
        hold=(Hold.CLAMP, Hold.CLAMP),
    )
    contacts = Contacts(
        s=np.array([first]),
        body=np.array([0]),
        feature=np.array([int(Feature.VERTEX)]),
        point=np.array([[OBSTACLE[0], 0.0, OBSTACLE[1] - RADIUS]]),
        normal=np.array([[0.0, 0.0, 1.0]]),
        direction=np.zeros((1, 3)),
        extent=np.zeros((1, 2)),
        distance=np.array([RADIUS]),
        friction=np.array([FRICTION_CODES.index(Friction.BOND)]),
        force=np.zeros((1, 3)),
        inclination=np.array([INCLINATION_CODES.index(inclination)]),
    )
    problem = Problem(cable=cable, grasps=grasps, contacts=contacts)
    shape = solve(problem, (0.0, 0.0, -10.0), tolerance=2e-4)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    return shape


@pytest.mark.parametrize("inclination", list(Inclination))
def test_the_rod_lies_where_the_two_elasticas_do(inclination: Inclination) -> None:
    exact = reference(0.0 if inclination is Inclination.FIXED else None)
    shape = bonded(inclination, *exact.lengths)
    at = np.linspace(0.0, exact.lengths[0], 101)
    there = np.column_stack([np.interp(at, shape.s, column) for column in shape.nodes.T])
    assert np.abs(there[:, 1]).max() < 1e-6
    assert np.linalg.norm(there[:, [0, 2]] - exact.points, axis=1).max() < 3e-4  # m
    assert shape.grasp_wrenches[1, 0] == pytest.approx(PULL, rel=0.01)


def test_a_fixed_inclination_takes_a_moment_and_a_free_one_none() -> None:
    fixed = reference(0.0)
    shape = bonded(Inclination.FIXED, *fixed.lengths)
    # Seen along y, a moment that turns from x to z is negative; the obstacle makes the jump.
    assert shape.contact_moments[0, 1] == pytest.approx(fixed.jump, rel=0.02)
    free = bonded(Inclination.FREE, *reference(None).lengths)
    np.testing.assert_allclose(free.contact_moments, 0.0, atol=1e-9)


def test_the_cable_is_shortest_where_the_inclination_is_free() -> None:
    """As the paper has it; a stiffer or heavier cable trades length for bending and height, and is shortest somewhat beside it."""
    free = reference(None, 0.1)
    assert free.angle == pytest.approx(-0.15, abs=0.01)  # rad
    for angle in (0.0, free.angle - 0.05, free.angle - 0.02, free.angle + 0.02, free.angle + 0.05):
        assert sum(reference(angle, 0.1).lengths) > sum(free.lengths)  # m; by 8e-4 at zero, 1e-5 to 1e-4 beside it


def test_a_fixed_inclination_without_bending_is_refused() -> None:
    scene = Scene(
        title="t",
        cables=(Cable(name="c", length=1.0, diameter=0.01, mass_per_length=0.1),),
        grippers=(Gripper(name="g", cable="c", at=0.0, position=(0.0, 0.0, 0.0), tangent=(1.0, 0.0, 0.0)),),
        bodies=(Body(name="b", mesh="b.obj", friction=Friction.BOND, inclination=Inclination.FIXED),),
    )
    with pytest.raises(SceneError, match="needs cables with 'bending'"):
        check_scene(scene)
