"""A cable drawn over another one, against a boundary value problem of a Kirchhoff rod that knows neither the push nor where it acts.

The lower cable reaches out along y from a clamp; the upper, a hundred thousand times as stiff and along x, comes down on it and is then
drawn along itself. Once it slides, the lower one stands still under N n + mu N e_x, with n from the upper axis to the lower at right angles
to both, at its surface: at its axis that is the force and the couple -r n x mu N e_x, which twists it. Between the clamp and that place

    r' = d3,   m' = -d3 x F,   m = sum_k B_k kappa_k d_k,   F = N n + mu N e_x,

with the place c, N and the angle of n unknown; at c the axes are a diameter apart, and n is square to d3.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from env_server.crossed import crossed_of
from env_server.stepped import Stepped
from protocol.errors import SceneError
from protocol.kinds import SelfInteraction
from protocol.scene import Cable, Gripper, Move, Scene, Target, check_scene

sys.path.insert(0, str(Path(__file__).parents[1] / "env_server"))

from in_process import Direct, steps

MU, DIAMETER, OUT, DOWN = 0.3, 0.01, 0.3, 0.028  # -, m, m along y, m below a diameter above the lower axis
BENDING, TWIST = 1e-2, 8e-3  # N m^2
LOWER = Cable("lower", 0.5, DIAMETER, 1e-6, BENDING, TWIST, self_interaction=SelfInteraction.CONTACT, friction_coefficient=MU)
UPPER = replace(LOWER, name="upper", length=0.4, bending=1e3, twist=1e3)


def scene(*ways: tuple[float, int], lift: float = 0.0, tolerance: float = 1e-4) -> Scene:
    """Down in ten steps, up again by a lift [m] in four, then along x by these ways [m] in so many steps each; next to no weight."""
    grippers = (
        Gripper("root", "lower", 0.0, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        Gripper("hand", "upper", 0.0, (-0.2, OUT, DIAMETER + 0.002), (1.0, 0.0, 0.0)),
    )
    down = Move("down", 0.5, (Target("hand", by=(0.0, 0.0, -DOWN - 0.002)),))
    along = (Move(f"way {k}", 0.05 * count, (Target("hand", by=(way, 0.0, 0.0)),)) for k, (way, count) in enumerate(ways))
    up = (Move("up", 0.2, (Target("hand", by=(0.0, 0.0, lift)),)),) if lift else ()
    return Scene("t", (LOWER, UPPER), grippers, (down, *up, *along), time_step=0.05, tolerance=tolerance, gravity=(0.0, 0.0, -1e-3))


@cache
def played(*ways: tuple[float, int], lift: float = 0.0, tolerance: float = 1e-4) -> tuple[Stepped, ...]:
    return tuple(step for _, step in steps(scene(*ways, lift=lift, tolerance=tolerance), Direct()))


def turned(q: np.ndarray) -> np.ndarray:
    """Directors as columns (3, 3, n) of quaternions (4, n)."""
    x, y, z, w = q
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows)


@cache
def reference() -> Any:
    """The solution over the share of the way to the place; its parameters are c [m], N [N] and the angle of n."""
    begin = np.array([-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])

    def normal(angle: float) -> np.ndarray:
        return np.array([0.0, np.sin(angle), -np.cos(angle)])

    def force(p: np.ndarray) -> np.ndarray:
        return np.asarray(p[1] * normal(p[2]) + np.array([MU * p[1], 0.0, 0.0]))

    def slopes(_: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        frame = turned(y[3:7])
        tangent = frame[:, 2]
        a, b, c = np.einsum("ijk,ik->jk", frame, y[7:10]) / np.array([BENDING, BENDING, TWIST])[:, None]
        x, u, v, w = y[3:7]
        turning = 0.5 * np.array([w * a + u * c - v * b, w * b + v * a - x * c, w * c + x * b - u * a, -x * a - u * b - v * c])
        moment = -np.cross(tangent, force(p)[:, None], axis=0)
        return np.asarray(p[0] * np.concatenate([tangent, turning, moment]))

    def ends(a: np.ndarray, b: np.ndarray, p: np.ndarray) -> np.ndarray:
        n = normal(p[2])
        upper = np.array([OUT, DIAMETER - DOWN])
        meets = b[1:3] - upper - DIAMETER * n[1:]
        couple = np.cross(-0.5 * DIAMETER * n, force(p))
        return np.concatenate([a[:3], a[3:7] - begin, b[7:10] - couple, meets, [turned(b[3:7])[:, 2] @ n]])

    share = np.linspace(0.0, 1.0, 41)
    guess = np.zeros((10, 41))
    guess[1], guess[3:7], guess[7] = OUT * share, begin[:, None], -0.03 * OUT * (1.0 - share)
    solved = solve_bvp(slopes, ends, share, guess, p=np.array([OUT, 0.03, 0.1]), tol=1e-9, max_nodes=20_000)
    assert solved.status == 0, solved.message
    return solved


def friction(step: Stepped) -> tuple[np.ndarray, float]:
    """Friction on the lower cable (3,) [N], and the push [N]."""
    assert step.crossed is not None
    (point,) = step.crossed.held.points
    (total,) = step.crossed.pushes.force
    return point.force, float(np.linalg.norm(total - point.force))


@pytest.mark.parametrize(
    ("tolerance", "force_error", "shape_error"), [(1e-4, 2e-4, 1.1e-6), pytest.param(2e-5, 1.6e-5, 1e-7, marks=pytest.mark.slow)]
)
def test_what_slides_pulls_and_twists_as_the_boundary_value_problem_has_it(
    tolerance: float, force_error: float, shape_error: float
) -> None:
    solved, last = reference(), played((0.02, 10), tolerance=tolerance)[-1]
    place, push, _ = solved.p
    pull, pressed = friction(last)
    assert pressed == pytest.approx(push, rel=force_error)  # measured 1.5e-4 on 96 segments, 1.2e-5 on 384: second order
    assert pull[0] == pytest.approx(MU * push, rel=force_error)
    shape = last.cables[0].shape
    inside = shape.s[shape.s <= place]
    assert (
        np.linalg.norm(shape.nodes[: len(inside)] - solved.sol(inside / place)[:3].T, axis=1).max() < shape_error
    )  # m, measured 8.3e-7, 6.9e-8


def test_friction_never_exceeds_mu_times_the_push_and_both_cables_balance() -> None:
    for step in played((0.02, 10), tolerance=1e-4):
        if step.crossed is None or not len(step.crossed.held.points):
            continue
        pull, push = friction(step)
        assert np.linalg.norm(pull) <= MU * push * (1.0 + 1e-9)
        for hanging, sign in zip(step.cables, (1.0, -1.0), strict=True):
            shape = hanging.shape
            weight = np.array([0.0, 0.0, -1e-3 * 1e-6 * shape.s[-1]])
            total = shape.grasp_wrenches[:, :3].sum(axis=0) + weight + sign * step.crossed.pushes.force.sum(axis=0)
            assert np.abs(total).max() < 1e-12


@pytest.mark.slow
def test_what_sticks_does_not_creep_and_slides_when_drawn_further() -> None:
    """Coming down it slides along y all the time; what it bears after a little way back is below the limit."""
    out = played((1e-5, 1), (0.0, 200), (0.02, 10), lift=1e-3)
    held, rested, slid = out[15], out[215], out[-1]
    pull, push = friction(held)
    assert 0.5 < np.linalg.norm(pull) / (MU * push) < 0.99  # it sticks
    for before, after in zip(held.cables, rested.cables, strict=True):
        assert np.abs(before.shape.nodes - after.shape.nodes).max() < 1e-12  # m; measured 4e-14
    np.testing.assert_allclose(friction(rested)[0], pull, atol=1e-9)  # N; measured 2.5e-10
    pull, push = friction(slid)
    assert np.linalg.norm(pull) == pytest.approx(MU * push, rel=1e-9)


def test_of_two_cables_the_smaller_coefficient_counts_and_a_body_like_kind_needs_contact() -> None:
    own = crossed_of((replace(LOWER, friction_coefficient=0.5), replace(UPPER, friction_coefficient=0.2)))
    assert own is not None
    assert {(pair.first, pair.second): pair.mu for pair in own.pairs} == {(0, 0): 0.5, (1, 1): 0.2, (0, 1): 0.2}
    loose = replace(LOWER, self_interaction=SelfInteraction.TRANSPARENT)
    with pytest.raises(SceneError, match="friction_coefficient: given with self_interaction 'transparent'"):
        check_scene(replace(scene(), cables=(loose, UPPER)))
