"""A cable without bending under a whole request: several holds, tails, bonds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rods import ALONG_X, GRAVITY, RADIUS, WEIGHTLESS, Row, cable, contacts, grasps, is_honest, span

from protocol.kinds import Friction, Outcome
from protocol.messages import Problem
from shape_server import solve

SOFT = cable(bending=None)
WEIGHT = 0.1 * 9.81  # N


def bond(s: float, point: tuple[float, float, float], **changes: object) -> Row:
    """A bonded contact whose axis is held at `point`."""
    return Row(s=s, point=np.asarray(point) - [0.0, 0.0, RADIUS], friction=Friction.BOND, **changes)


def test_forces_of_grasps_and_bonds_carry_the_weight() -> None:
    held = grasps((0.1, (0.0, 0.0, 0.0), ALONG_X), (0.9, (0.5, 0.1, 0.2), ALONG_X))
    shape = solve(Problem(cable=SOFT, grasps=held, contacts=contacts(bond(0.5, (0.25, 0.05, 0.0)))), GRAVITY)
    assert shape.outcome is Outcome.CONVERGED
    total = shape.grasp_wrenches[:, :3].sum(axis=0) + shape.contact_forces.sum(axis=0)
    np.testing.assert_allclose(total, [0.0, 0.0, WEIGHT], atol=1e-12)
    assert not shape.grasp_wrenches[:, 3:].any()


def test_tails_hang_straight_down() -> None:
    shape = solve(Problem(cable=SOFT, grasps=grasps((0.3, (0.0, 0.0, 1.0), ALONG_X))), GRAVITY)
    np.testing.assert_allclose(shape.nodes[0], [0.0, 0.0, 0.7], atol=1e-12)
    np.testing.assert_allclose(shape.nodes[-1], [0.0, 0.0, 0.3], atol=1e-12)
    assert shape.tension[0] == pytest.approx(0.0, abs=WEIGHT / 20)
    np.testing.assert_allclose(shape.grasp_wrenches[0, :3], [0.0, 0.0, WEIGHT], atol=1e-12)


@pytest.mark.parametrize("stretch", [None, 40.0])
def test_tension_is_that_in_the_middle_of_every_segment_on_either_side_of_a_held_point(stretch: float | None) -> None:
    """The force at s is that of the grasps before, less the weight so far, exactly."""
    held = grasps((0.1, (0.0, 0.0, 0.0), ALONG_X), (0.5, (0.3, 0.1, 0.2), ALONG_X), (0.9, (0.5, 0.1, 0.1), ALONG_X))
    shape = solve(Problem(cable=replace(SOFT, stretch=stretch), grasps=held), GRAVITY)
    middle = 0.5 * (shape.s[1:] + shape.s[:-1])
    given = (middle[:, None] > held.s) @ shape.grasp_wrenches[:, :3]
    carried = -given + np.outer(middle, [0.0, 0.0, WEIGHT])
    np.testing.assert_allclose(shape.tension, np.linalg.norm(carried, axis=1), atol=1e-11 * WEIGHT)


def test_a_bond_that_would_pull_is_dropped() -> None:
    free = solve(Problem(cable=SOFT, grasps=span()), GRAVITY)
    low = float(free.nodes[:, 2].min())
    pulled = solve(Problem(cable=SOFT, grasps=span(), contacts=contacts(bond(0.5, (0.3, 0.0, low - 0.02)))), GRAVITY)
    pushed = solve(Problem(cable=SOFT, grasps=span(), contacts=contacts(bond(0.5, (0.3, 0.0, low + 0.02)))), GRAVITY)
    np.testing.assert_allclose(pulled.nodes, free.nodes, atol=1e-12)
    assert not pulled.contact_forces.any()
    assert pushed.contact_forces[0, 2] > 0
    np.testing.assert_allclose(pushed.nodes[np.argmin(np.abs(pushed.s - 0.5))], [0.3, 0.0, low + 0.02], atol=1e-9)


def test_a_bond_out_of_reach_is_answered_with_both_places() -> None:
    shape = solve(Problem(cable=SOFT, grasps=span(), contacts=contacts(bond(0.1, (0.5, 0.0, 0.0)))), GRAVITY)
    assert shape.outcome is Outcome.UNREACHABLE
    assert "s = 0 m and 0.1 m" in shape.sentence


@pytest.mark.parametrize(
    ("problem", "gravity", "word"),
    [
        (Problem(cable=SOFT, grasps=span()), WEIGHTLESS, "weight"),
        (Problem(cable=cable(bending=None, mass=0.0), grasps=span()), GRAVITY, "weight"),
    ],
)
def test_what_this_model_cannot_do_is_answered_as_unsupported(problem: Problem, gravity: tuple[float, float, float], word: str) -> None:
    shape = solve(problem, gravity)
    assert shape.outcome is Outcome.UNSUPPORTED
    assert word in shape.sentence


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4])
def test_the_polygon_is_as_near_to_the_curve_as_asked(tolerance: float) -> None:
    shape = solve(Problem(cable=SOFT, grasps=span(0.3)), GRAVITY, tolerance=tolerance)
    fine = solve(Problem(cable=SOFT, grasps=span(0.3)), GRAVITY, tolerance=1e-9)
    assert shape.error is not None
    assert shape.error <= tolerance
    middles = 0.5 * (shape.nodes[1:] + shape.nodes[:-1])
    s = 0.5 * (shape.s[1:] + shape.s[:-1])
    truth = np.column_stack([np.interp(s, fine.s, fine.nodes[:, k]) for k in range(3)])
    assert np.linalg.norm(middles - truth, axis=1).max() < 1.2 * shape.error + 1e-5


@pytest.mark.parametrize("row", [bond(0.5, (0.3, 0.0, -0.2)), bond(0.0, (0.0, 0.0, 0.0)), bond(1.0, (0.6, 0.0, 0.0))])
def test_bonds_at_one_point_or_at_a_grasp_give_no_nonsense(row: Row) -> None:
    assert is_honest(solve(Problem(cable=SOFT, grasps=span(), contacts=contacts(row, row)), GRAVITY))
