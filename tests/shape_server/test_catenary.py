"""The closed form of a cable without bending, against its own differential equation."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shape_server.catenary import hang, parameter

LOAD = np.array([0.0, 0.0, -2.0])
S = np.linspace(0.0, 1.0, 2001)


@pytest.mark.parametrize("excess", [1e-300, 1e-16, 1e-12, 1e-6, 1e-3, 0.1, 1.0, 3.0, 10.0, 1e3, 1e6, 1e100])
def test_the_parameter_solves_its_equation(excess: float) -> None:
    x = parameter(excess)
    value = x + math.log(-math.expm1(-2 * x) / (2 * x)) if x > 0.5 else math.log1p(x**2 / 6 + x**4 / 120 + x**6 / 5040 + x**8 / 362880)
    assert value == pytest.approx(math.log1p(excess), rel=1e-12)


ENDS = [(0.5, 0.0, 0.0), (0.9, 0.2, 0.1), (0.3, -0.1, 0.8), (0.01, 0.0, -0.9), (0.9999, 0.0, 0.0), (1e-6, 0.0, 0.2), (0.0, 0.0, 0.3)]


@pytest.mark.parametrize("end", ENDS)
def test_the_piece_ends_where_it_is_held_and_does_not_stretch(end: tuple[float, float, float]) -> None:
    start = np.array([0.1, -0.3, 2.0])
    piece = hang(start, start + end, 1.0, LOAD, S)
    np.testing.assert_allclose(piece.nodes[0], start, atol=1e-12)
    np.testing.assert_allclose(piece.nodes[-1], start + end, atol=1e-9)
    lengths = np.linalg.norm(np.diff(piece.nodes, axis=0), axis=1)
    assert lengths.max() < 5e-4 * (1 + 1e-9)
    assert lengths.sum() == pytest.approx(1.0, abs=1e-3)  # chords; the fold itself is cut by one


@pytest.mark.parametrize("end", [*ENDS[:3], ENDS[4]])
def test_the_tension_balances_the_weight_at_every_point(end: tuple[float, float, float]) -> None:
    """d(T t)/ds = -load, by differences of the tangents."""
    piece = hang(np.zeros(3), np.array(end), 1.0, LOAD, S)
    tangents = np.diff(piece.nodes, axis=0) / np.diff(S)[:, None]
    middle = 0.5 * (piece.tension[1:] + piece.tension[:-1])
    change = np.diff(middle[:, None] * tangents, axis=0) / (S[1] - S[0])
    np.testing.assert_allclose(change, np.tile(-LOAD, (len(change), 1)), atol=2e-2 * max(1.0, middle.max() / 50))


@pytest.mark.parametrize("end", ENDS)
def test_the_forces_at_the_ends_carry_the_weight(end: tuple[float, float, float]) -> None:
    piece = hang(np.zeros(3), np.array(end), 1.0, LOAD, S)
    np.testing.assert_allclose(piece.start_force + piece.end_force, -LOAD, atol=1e-8 * piece.tension.max())
    assert np.linalg.norm(piece.end_force) == pytest.approx(piece.tension[-1], rel=1e-9)
    assert np.linalg.norm(piece.start_force) == pytest.approx(piece.tension[0], rel=1e-9)


def test_a_shallow_cable_is_a_parabola() -> None:
    """Irvine 1981: sag = w d^2 / 8 H, to a share of (sag / span)^2."""
    length = 1.0001
    piece = hang(np.zeros(3), np.array([1.0, 0.0, 0.0]), length, LOAD, np.linspace(0, length, 201))
    horizontal = piece.end_force[0]
    assert -piece.nodes[:, 2].min() == pytest.approx(2.0 / (8 * horizontal), rel=1e-3)


@pytest.mark.parametrize("excess", [1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 0.0])
def test_a_taut_cable_keeps_finite_tension_and_is_straight(excess: float) -> None:
    piece = hang(np.zeros(3), np.array([1.0, 0.0, 0.0]) / (1 + excess), 1.0, LOAD, S)
    assert np.isfinite(piece.tension).all()
    assert -piece.nodes[:, 2].min() == pytest.approx(math.sqrt(3 / 8 * max(excess, 1e-12)), rel=0.02)
    assert piece.tension.max() == pytest.approx(2.0 / math.sqrt(24 * max(excess, 1e-12)), rel=0.05)


def test_load_in_any_direction_gives_the_same_shape_turned() -> None:
    aside = hang(np.zeros(3), np.array([0.0, 0.5, 0.2]), 1.0, np.array([2.0, 0.0, 0.0]), S)
    down = hang(np.zeros(3), np.array([0.5, 0.2, 0.0]), 1.0, LOAD, S)
    np.testing.assert_allclose(aside.nodes[:, [1, 2]], down.nodes[:, [0, 1]], atol=1e-12)
    np.testing.assert_allclose(-aside.nodes[:, 0], down.nodes[:, 2], atol=1e-12)
