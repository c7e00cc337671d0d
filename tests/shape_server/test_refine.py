"""Any accuracy asked for, by tolerance or by time, and an estimate that holds."""

from __future__ import annotations

import numpy as np
import pytest
from rods import GRAVITY, KERNELS, Row, cable, contacts, random_spans, span

from protocol.kinds import Outcome
from protocol.messages import Problem, Shape
from shape_server import Follower, solve

FINE = 1e-9


def true_error(shape: Shape, exact: Shape) -> float:
    """Largest distance [m] at the nodes that both have."""
    at = np.searchsorted(exact.s, shape.s - 1e-9)
    assert np.abs(exact.s[at] - shape.s).max() < 1e-9
    return float(np.linalg.norm(exact.nodes[at] - shape.nodes, axis=1).max())


@pytest.mark.parametrize("bending", [1e-2, 1e-3])
def test_the_tolerance_asked_for_is_kept_and_the_estimate_covers_the_error(bending: float) -> None:
    """Against the solver's own finest answer, which `tests/validation` holds against other programs."""
    ratios = []
    for problem in random_spans(12, bending, 21):
        exact = solve(problem, GRAVITY, tolerance=FINE, path=KERNELS)
        assert exact.error is not None
        assert exact.error <= FINE
        for tolerance in (1e-3, 1e-5, 1e-7):
            shape = solve(problem, GRAVITY, tolerance=tolerance, path=KERNELS)
            assert shape.error is not None
            assert shape.error <= tolerance
            ratios.append(true_error(shape, exact) / shape.error)
    assert np.mean(np.array(ratios) <= 1.0) >= 0.95
    assert np.median(ratios) > 1 / 3  # the median over-estimate is at most three


def test_a_tolerance_out_of_reach_is_said_with_what_was_reached() -> None:
    touched = contacts(Row(s=0.5, point=(0.3, 0.0, -0.2)))
    shape = solve(Problem(cable=cable(), grasps=span(), contacts=touched), GRAVITY, tolerance=1e-9, path=KERNELS)
    assert shape.outcome is Outcome.CONVERGED
    assert "above the tolerance of 1e-09 m" in shape.sentence
    assert shape.error is not None
    assert 1e-9 < shape.error < 1e-5


def test_more_time_gives_a_smaller_error() -> None:
    problem = random_spans(1, 1e-3, 5)[0]
    solve(problem, GRAVITY, tolerance=1e-6, path=KERNELS)
    errors = [solve(problem, GRAVITY, budget=budget, path=KERNELS).error for budget in (0.02, 0.4)]
    assert errors[0] is not None
    assert errors[1] is not None
    assert errors[1] < 0.3 * errors[0]  # measured 1e-2 and less


def test_a_shape_on_one_mesh_keeps_its_segments_and_one_of_two_meshes_is_nearer() -> None:
    problem = random_spans(1, 1e-2, 6)[0]
    one, two = (solve(problem, GRAVITY, tolerance=1e-5, extrapolate=extrapolate, path=KERNELS) for extrapolate in (False, True))
    np.testing.assert_allclose(np.linalg.norm(np.diff(one.nodes, axis=0), axis=1), np.diff(one.s), atol=1e-14)
    assert len(two.s) < len(one.s) / 3  # measured 97 and 385 nodes


@pytest.mark.parametrize(("extrapolate", "order"), [(False, 2.0), (True, 4.0)])
def test_a_follower_is_of_second_order_and_of_fourth_on_two_meshes(extrapolate: bool, order: float) -> None:
    problem = random_spans(1, 1e-2, 7)[0]
    exact = solve(problem, GRAVITY, tolerance=FINE, path=KERNELS)
    errors = []
    for segments in (48, 96):
        follower = Follower(problem, GRAVITY, segments=segments, extrapolate=extrapolate)
        nodes = follower.move(problem.grasps.position, problem.grasps.quaternion)
        at = np.searchsorted(exact.s, follower.s - 1e-9)
        assert np.abs(exact.s[at] - follower.s).max() < 1e-9
        errors.append(np.linalg.norm(exact.nodes[at] - nodes, axis=1).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.3)
