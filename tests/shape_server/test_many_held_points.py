"""Clamps cut a cable into pieces; many hinges are found by way of clamped pieces. A hundred of either have a shape."""

from __future__ import annotations

import time

import numpy as np
import pytest
from rods import ALONG_X, GRAVITY, KERNELS, Row, cable, contacts, frame, grasps, is_honest, largest_moment, start_from, unbalanced_moment

from protocol.errors import MessageError
from protocol.kinds import Hold, Outcome
from protocol.messages import Grasps, PointLoads, Problem, Start
from protocol.scene import Cable, LumpedMass, Section
from shape_server import pieces, solve
from shape_server.solve import solve as plain_solve

LONGEST = 20.0  # s on a busy machine; measured 0.3 to 0.6


def row_of(count: int, hold: Hold, slack: float) -> Grasps:
    return grasps(*[(s, (s / (1 + slack), 0.0, 0.0), ALONG_X) for s in np.linspace(0, 1, count)], hold=hold)


@pytest.mark.sampled(3)
@pytest.mark.parametrize("bending", [1e-2, 1e-4])
@pytest.mark.parametrize("hold", [Hold.CLAMP, Hold.HINGE])
@pytest.mark.parametrize("count", [10, 100])
@pytest.mark.parametrize("slack", [0.05, 0.5])
def test_a_cable_held_at_very_many_points_has_a_stable_shape(count: int, hold: Hold, bending: float, slack: float) -> None:
    problem = Problem(cable=cable(bending=bending), grasps=row_of(count, hold, slack))
    begun = time.perf_counter()
    shape = solve(problem, GRAVITY, extrapolate=False, path=KERNELS)
    assert time.perf_counter() - begun < LONGEST
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert is_honest(shape)
    assert unbalanced_moment(problem, shape, GRAVITY) < 1e-5 * largest_moment(problem, shape)  # measured 6e-8
    held = shape.nodes[np.searchsorted(shape.s, problem.grasps.s - 1e-9)]
    assert np.abs(held - problem.grasps.position).max() < 2e-8  # m; asked: 1e-8 of the length


def three_clamps(**changes: object) -> Problem:
    held = grasps((0.0, (0, 0, 0), ALONG_X), (0.4, (0.3, 0, 0), frame((1.0, 0.3, 0.2))), (1.0, (0.7, 0, 0.1), ALONG_X))
    fields: dict[str, object] = {"cable": cable(), "grasps": held} | changes
    return Problem(**fields)


def test_a_cut_cable_keeps_its_balance_and_its_forces() -> None:
    shape = solve(three_clamps(), GRAVITY, path=KERNELS)
    assert shape.sentence.startswith("2 pieces between clamps")
    total = shape.grasp_wrenches[:, :3].sum(axis=0)
    np.testing.assert_allclose(total, [0.0, 0.0, 0.981], atol=1e-12)
    again = solve(three_clamps(start=start_from(shape)), GRAVITY, extrapolate=False, path=KERNELS)
    assert again.iterations <= 4  # two steps a piece
    np.testing.assert_allclose(again.grasp_wrenches, shape.grasp_wrenches, atol=1e-3)


def test_every_part_of_a_problem_goes_to_the_piece_where_it_is() -> None:
    whole = Cable(
        "c", 1.0, 0.01, 0.1, 0.01, 0.008, sections=(Section(0.3, 0.6, bending=0.02),), masses=(LumpedMass(0.2, 1.0), LumpedMass(0.9, 2.0))
    )
    touched = contacts(Row(s=0.1, point=(0.0, 0, -1)), Row(s=0.7, point=(0.5, 0, -1)))
    loads = PointLoads(s=np.array([0.3, 0.8]), force=np.eye(3)[:2])
    first, second = pieces.split(three_clamps(cable=whole, contacts=touched, loads=loads, turns=(1, -2)), GRAVITY)
    assert [mass.mass for mass in first.cable.masses] == [1.0]
    assert [(part.start, round(part.end, 12)) for part in first.cable.sections + second.cable.sections] == [(0.3, 0.4), (0.0, 0.2)]
    assert second.cable.masses[0].at == pytest.approx(0.5)
    assert (first.turns, second.turns) == ((1,), (-2,))
    assert first.contacts is not None
    assert second.contacts is not None
    assert second.contacts.s[0] == pytest.approx(0.3)
    assert second.loads is not None
    np.testing.assert_allclose(second.loads.s, [0.4])


def test_the_piece_without_a_shape_is_named() -> None:
    held = grasps((0.0, (0, 0, 0), ALONG_X), (0.4, (0.3, 0, 0), ALONG_X), (1.0, (0.7, 0, 0), ALONG_X))
    touched = contacts(Row(s=0.7, point=(0.5, 0.0, 5.0)))
    shape = plain_solve(Problem(cable=cable(), grasps=held, contacts=touched), GRAVITY, path=KERNELS)
    assert shape.outcome is not Outcome.CONVERGED
    assert shape.sentence.startswith("between s = 0.4 and 1 m: ")


def test_a_start_that_misses_a_clamp_is_refused() -> None:
    start = Start(s=np.linspace(0, 1, 12), frames=np.tile(ALONG_X, (11, 1)), grasp_forces=np.zeros((3, 3)))
    with pytest.raises(MessageError, match="held point"):
        solve(three_clamps(start=start), GRAVITY, path=KERNELS)
