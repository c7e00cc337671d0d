"""The closed form of a cable without bending, rigid and elastic, against its own differential equation and its limits."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from shape_server.catenary import Piece, hang, hang_elastic, parameter
from shape_server.catenary_kernels import hanging_nodes

Compiled = Callable[..., tuple[np.ndarray, np.ndarray]]
LOAD = np.array([0.0, 0.0, -2.0])
S = np.linspace(0.0, 1.0, 2001)
SHARES = (1 / 50, 0.3, 0.9, 1 - 1e-4, 1 - 1e-8, 1.0, 1 + 1e-8, 1 + 1e-4, 1.1, 2.0)  # chord over length


@pytest.mark.parametrize("excess", [1e-300, 1e-16, 1e-12, 1e-6, 1e-3, 0.1, 1.0, 3.0, 10.0, 1e3, 1e6, 1e100])
def test_the_parameter_solves_its_equation(excess: float) -> None:
    x = parameter(excess)
    series = math.fsum(x**j / math.factorial(j + 1) for j in range(2, 16, 2))
    value = x + math.log(-math.expm1(-2 * x) / (2 * x)) if x > 0.5 else math.log1p(series)
    assert value == pytest.approx(math.log1p(excess), rel=1e-14)  # measured 1.1e-15


ENDS = [(0.5, 0.0, 0.0), (0.9, 0.2, 0.1), (0.3, -0.1, 0.8), (0.01, 0.0, -0.9), (0.9999, 0.0, 0.0), (1e-6, 0.0, 0.2), (0.0, 0.0, 0.3)]
NEARLY_TAUT = [(0.8 / (1 + 1e-8), 0.0, 0.6 / (1 + 1e-8)), (1 - 1e-11, 0.0, 0.0), (1e-11, 0.0, 0.5), (2e-5, 0.0, 1 - 1e-9)]


@pytest.mark.parametrize("end", ENDS)
def test_the_piece_ends_where_it_is_held_and_does_not_stretch(end: tuple[float, float, float]) -> None:
    start = np.array([0.1, -0.3, 2.0])
    piece = hang(start, start + end, 1.0, LOAD, S)
    np.testing.assert_allclose(piece.nodes[0], start, atol=1e-15)
    np.testing.assert_allclose(piece.nodes[-1], start + end, atol=1e-14)  # measured 4.4e-16
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


@pytest.mark.parametrize("path", [hanging_nodes, hanging_nodes.py_func], ids=["compiled", "interpreted"])
@pytest.mark.parametrize("end", [*ENDS, *NEARLY_TAUT])
def test_the_compiled_nodes_are_those_of_the_clear_version(path: Compiled, end: tuple[float, float, float]) -> None:
    start, s = np.array([0.1, -0.3, 2.0]), np.linspace(0.0, 1.0, 100)
    for load in (LOAD, np.array([0.3, -1.2, 0.5])):
        piece = hang(start, start + end, 1.0, load, s)
        nodes, tension = path(start, start + end, 1.0, load, s)
        np.testing.assert_allclose(nodes, piece.nodes, rtol=1e-12, atol=1e-15)  # measured 4.4e-16 m
        np.testing.assert_allclose(tension, piece.tension, rtol=1e-12, atol=1e-15)  # measured 4e-16, the same sums in the same order


ELASTIC = [
    *((share * math.cos(angle), 0.0, share * math.sin(angle)) for share in SHARES for angle in (0.0, 0.7, -1.5, math.pi / 2)),
    *((1e-11, 0.0, rise) for rise in (-1.4, -0.2, 0.0, 0.999999, 2.0)),
]


@pytest.mark.parametrize("stretch", [0.5, 20.0, 1e3, 1e6, 1e9, 1e15])
@pytest.mark.parametrize("end", ELASTIC)
def test_the_elastic_piece_meets_its_ends_and_carries_its_weight(end: tuple[float, float, float], stretch: float) -> None:
    """From 50 times as long as its chord to stretched by 100 %, and softer than its own weight allows."""
    start = np.array([0.1, -0.3, 2.0])
    piece = hang_elastic(start, start + end, 1.0, LOAD, stretch, S)
    size = max(1.0, float(np.abs(piece.nodes - start).max()))
    np.testing.assert_allclose(piece.nodes[-1], start + end, atol=1e-12 * size)  # measured 1.1e-14
    np.testing.assert_allclose(piece.start_force + piece.end_force, -LOAD, atol=1e-15 * max(1.0, piece.tension.max()))
    assert np.linalg.norm(piece.end_force) == pytest.approx(piece.tension[-1], rel=1e-13)
    np.testing.assert_allclose(piece.strain, piece.tension / stretch, rtol=1e-15)


@pytest.mark.parametrize("end", ELASTIC)
def test_every_small_part_is_as_long_as_its_tension_makes_it(end: tuple[float, float, float]) -> None:
    piece = hang_elastic(np.zeros(3), np.array(end), 1.0, LOAD, 7.0, S)
    lengths = np.linalg.norm(np.diff(piece.nodes, axis=0), axis=1)
    wanted = (1 + 0.5 * (piece.strain[1:] + piece.strain[:-1])) * np.diff(S)
    turning = piece.curvature * np.gradient(S) > 0.01
    is_fold = (turning[1:] | turning[:-1]) | (np.minimum(piece.tension[1:], piece.tension[:-1]) < 2e-3)  # cut short by one chord
    np.testing.assert_allclose(lengths[~is_fold], wanted[~is_fold], rtol=1e-5)  # measured 4.2e-6; theory: (turn per part)^2 / 24
    assert is_fold.sum() <= 120


@pytest.mark.parametrize("end", [*ENDS, *NEARLY_TAUT[:1]])
def test_a_very_stiff_elastic_piece_is_the_rigid_one(end: tuple[float, float, float]) -> None:
    rigid = hang(np.zeros(3), np.array(end), 1.0, LOAD, S)
    for stretch, allowed in ((1e40, 1e-13), (math.inf, 0.0)):
        elastic = hang_elastic(np.zeros(3), np.array(end), 1.0, LOAD, stretch, S)
        np.testing.assert_allclose(elastic.nodes, rigid.nodes, atol=allowed)  # measured 5e-15 m
        np.testing.assert_allclose(elastic.tension, rigid.tension, atol=allowed * rigid.tension.max())


def test_the_elastic_piece_nears_the_rigid_one_in_proportion_to_its_compliance() -> None:
    def distance(stretch: float) -> float:
        end = np.array([0.6, 0.3, 0.4])
        return float(np.abs(hang_elastic(np.zeros(3), end, 1.0, LOAD, stretch, S).nodes - hang(np.zeros(3), end, 1.0, LOAD, S).nodes).max())

    assert distance(1e6) / distance(1e7) == pytest.approx(10.0, rel=1e-4)
    assert distance(1e7) / distance(1e8) == pytest.approx(10.0, rel=1e-4)


def hanging_down(rise: float, stretch: float) -> Piece:
    return hang_elastic(np.zeros(3), np.array([0.0, 0.0, rise]), 1.0, LOAD, stretch, S)


def test_an_elastic_cable_pulled_straight_down_stretches_by_hooke() -> None:
    """Held at the top, 1.7 m below pulled with F: L + F L / EA + w L^2 / 2 EA."""
    piece = hanging_down(-1.7, 5.0)
    pull = 5.0 * 0.7 - 2.0 / 2
    assert piece.end_force == pytest.approx([0.0, 0.0, -pull], rel=1e-14)
    assert piece.nodes[:, 2] == pytest.approx(-(S + (pull + 2.0) * S / 5 - S**2 / 5), abs=1e-14)


def test_an_elastic_cable_that_hangs_double_stretches_in_both_strands_by_their_own_weight() -> None:
    end = np.array([0.0, 0.0, 0.3])
    down = hanging_down(0.3, 10.0).tension[0] / 2.0  # m, arc length of the fold
    lowest = hang_elastic(np.zeros(3), end, 1.0, LOAD, 10.0, np.array([down])).nodes[0, 2]
    strands = [part + 2.0 * part**2 / 20 for part in (down, 1 - down)]
    assert strands == pytest.approx([-lowest, 0.3 - lowest], abs=1e-15)


@pytest.mark.parametrize("rise", [0.3, -1.4])
def test_vertical_is_the_limit_of_nearly_vertical(rise: float) -> None:
    folded, nearly = (hang_elastic(np.zeros(3), np.array([span, 0.0, rise]), 1.0, LOAD, 10.0, S) for span in (0.9e-12, 1.1e-12))
    np.testing.assert_allclose(folded.nodes, nearly.nodes, atol=2e-12)  # measured 1.1e-12, the span itself
    np.testing.assert_allclose(folded.tension, nearly.tension, atol=1e-13)


def test_without_weight_a_stretched_cable_is_straight_and_a_slack_one_has_no_shape() -> None:
    end = np.array([0.9, 0.0, 1.2])
    piece = hang_elastic(np.zeros(3), end, 1.0, np.zeros(3), 6.0, S)
    np.testing.assert_allclose(piece.nodes, np.outer(S, end), atol=1e-15)
    assert piece.tension == pytest.approx(6.0 * 0.5)
    assert piece.end_force == pytest.approx(3.0 * end / 1.5)
    light = hang_elastic(np.zeros(3), end, 1.0, 1e-20 * LOAD, 6.0, S)
    np.testing.assert_allclose(light.nodes, piece.nodes, atol=1e-14)
    with pytest.raises(ValueError, match="no definite shape without weight"):
        hang_elastic(np.zeros(3), 0.5 * end, 1.0, np.zeros(3), 6.0, S)


def test_an_absurd_elastic_cable_still_answers() -> None:
    rng = np.random.default_rng(1)
    for _ in range(2000):
        angle = rng.choice([0.0, rng.uniform(-math.pi / 2, math.pi / 2), math.pi / 2 - 10 ** rng.uniform(-16, -1)])
        end = 10 ** rng.uniform(-13, 3) * np.array([math.cos(angle), 0.0, math.sin(angle)])
        piece = hang_elastic(np.zeros(3), end, 1.0, LOAD, 10 ** rng.uniform(-3, 60), S[::200])
        assert np.isfinite(piece.tension).all()
        assert np.abs(piece.nodes[-1] - end).max() < 1e-12 * max(1.0, np.abs(piece.nodes).max())
