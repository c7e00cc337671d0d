"""Where surfaces stick: slopes and curvature of a knot against central differences, and what it does to a pair as a whole."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from shape_server import knots, numpy_path
from shape_server.crossing import Strip
from shape_server.knots import Knots

COUNT, STEP = 8, 1e-4  # segments; rad
PULL = np.array([[3.0, -2.0, 5.0, 4.0, -6.0]])  # N


def own() -> Knots:
    """One knot of a cable with itself, at arms of random direction."""
    arm = 0.006 * np.array([[[0.6, 0.8, 0.1], [-0.7, 0.6, 0.3]]])
    upright = np.linalg.svd(arm[0, :1])[2][1:][None]
    beside, share = np.array([[[1, 2], [5, 6]]]), np.array([[[0.3, 0.7], [0.9, 0.1]]])
    give = np.array([[[0.2, 0.3, 0.1], [0.4, 0.1, 0.2]]])
    return Knots(np.zeros((1, 2), dtype=int), np.array([[2.2, 5.6]]), arm, upright, beside, share, give)


def posed() -> tuple[np.ndarray, np.ndarray]:
    """Nodes and directors of a random cable of 0.1 m."""
    rng = np.random.default_rng(4)
    return rng.normal(size=(COUNT + 1, 3)) * 0.02, Rotation.random(COUNT, rng=rng).as_matrix()


def turned(axes: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Directors, rows, after turns (n-1, 3) in their own axes."""
    return np.einsum("nab,nbc->nac", Rotation.from_rotvec(turn).as_matrix().transpose(0, 2, 1), axes)


def work(nodes: np.ndarray, axes: np.ndarray, turn: np.ndarray) -> float:
    return float((PULL * knots.misses(numpy_path, own(), [nodes], [turned(axes, turn)])).sum())


def test_rows_are_the_slopes_of_what_is_missed_by() -> None:
    nodes, axes = posed()
    strips, turns = knots.strips(numpy_path, own(), [axes], 0)
    slope = np.zeros((knots.ROWS, COUNT, 3))
    for segment, row, vector in turns[0]:
        slope[row, segment] += vector
    for segment, axis in np.ndindex(COUNT, 3):
        turn = np.zeros((COUNT, 3))
        turn[segment, axis] = STEP
        ahead, back = (knots.misses(numpy_path, own(), [nodes], [turned(axes, sign * turn)])[0] for sign in (1, -1))
        np.testing.assert_allclose((ahead - back) / (2 * STEP), slope[:, segment, axis], atol=1e-10)
    moved = nodes + np.random.default_rng(5).normal(size=nodes.shape)
    change = knots.misses(numpy_path, own(), [moved], [axes])[0] - knots.misses(numpy_path, own(), [nodes], [axes])[0]
    np.testing.assert_allclose(spread(strips[0], moved - nodes), change, atol=1e-12)


def spread(strip: Strip, shift: np.ndarray) -> np.ndarray:
    """What the rows say of shifts of the nodes."""
    out = np.zeros(knots.ROWS)
    for row, node, coef in zip(strip.row, strip.node, strip.coef, strict=True):
        out[row] += sum(float((coef[side] * shift[node[side] : node[side] + 3]).sum()) for side in range(2))
    return out


def test_couples_and_curvature_are_the_slopes_of_the_work() -> None:
    nodes, axes = posed()
    forces, couples, blocks = np.zeros((COUNT + 1, 3)), np.zeros((COUNT, 3)), np.zeros((COUNT, 3, 3))
    knots.add_forces(numpy_path, own(), PULL, [axes], [forces], [couples])
    knots.curve(own(), PULL, [axes], [blocks])
    hessian = np.zeros((3 * COUNT, 3 * COUNT))
    for segment in range(COUNT):
        hessian[3 * segment : 3 * segment + 3, 3 * segment : 3 * segment + 3] = -blocks[segment]
    turns, stiffness = knots.tilts(own(), PULL, [axes], 0, 1.0)
    rows = np.zeros((len(stiffness), COUNT, 3))
    for segment, row, vector in turns[0]:
        rows[row, segment] += vector
    rows = rows.reshape(len(stiffness), -1)
    hessian -= rows.T @ (stiffness[:, None] * rows)
    rng = np.random.default_rng(6)
    for _ in range(5):
        turn = rng.normal(size=(COUNT, 3))
        there, here, back = (work(nodes, axes, size * turn) for size in (STEP, 0.0, -STEP))
        assert (there - back) / (2 * STEP) == pytest.approx(float((couples * turn).sum()), abs=1e-7)
        flat = turn.ravel()
        assert (there - 2 * here + back) / STEP**2 == pytest.approx(float(flat @ hessian @ flat), abs=1e-5)  # N m, of 0.1


def test_what_a_knot_does_to_both_places_cancels() -> None:
    nodes, axes = posed()
    nodes -= together_shift(nodes, axes)
    forces, couples = np.zeros((COUNT + 1, 3)), np.zeros((COUNT, 3))
    knots.add_forces(numpy_path, own(), PULL, [axes], [forces], [couples])
    np.testing.assert_allclose(forces.sum(axis=0), 0.0, atol=1e-14)
    turning = np.cross(nodes, forces).sum(axis=0) + np.einsum("nk,nkx->x", couples, axes)
    np.testing.assert_allclose(turning, 0.0, atol=1e-14)


def together_shift(nodes: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Shifts of the nodes after which both points are one: a pair that is pulled apart is turned by its force."""
    points = knots.points(numpy_path, own(), [nodes], [axes])[0]
    return np.repeat((points[0] - points[1])[None], COUNT + 1, axis=0) * (np.arange(COUNT + 1) < 4)[:, None]


def test_levers_are_ahead_by_the_turn_that_their_compliance_says() -> None:
    nodes, axes = posed()
    small = 1e-3 * PULL
    change = knots.misses(numpy_path, knots.ahead(own(), small, [axes]), [nodes], [axes])[0]
    change -= knots.misses(numpy_path, own(), [nodes], [axes])[0]
    np.testing.assert_allclose(change, knots.compliance(own(), [axes]) @ small[0], atol=2e-4 * np.abs(change).max())


def test_a_knot_that_gives_way_by_more_than_a_hundredth_of_its_arms_does_not_hold() -> None:
    knot = own()
    arm = float(np.linalg.norm(knot.arm, axis=2).min())
    assert knots.are_joined(knot, np.full((1, knots.ROWS), 0.009 * arm))
    assert not knots.are_joined(knot, np.full((1, knots.ROWS), 0.011 * arm))
