"""The gradient cable: its ends, its balance, its limits, and what it refuses."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shape_server.catenary import hang
from shape_server.gradient_cable import GradientShape, NotCovered, lay
from shape_server.gradient_curve import Posed, balanced, bent, derivatives, places, slope_at

LOAD = np.array([0.0, 0.0, -1.0])  # N/m
END = np.array([0.95, 0.0, 0.1])  # m, for a cable of one metre
S = np.linspace(0.0, 1.0, 2001)
HOLDS = {"clamped": (0.0, -0.2), "hinged": (None, None), "mixed": (0.3, None)}  # slope at both ends [rad], None at a hinge
MICRO = {"without l": 0.0, "small l": 0.01, "l near g / 2": 0.0196, "large l": 0.2}
each_hold = pytest.mark.parametrize("hold", HOLDS)
each_micro = pytest.mark.parametrize("micro", MICRO)


def tangent(slope: float | None) -> np.ndarray | None:
    return None if slope is None else np.array([math.cos(slope), 0.0, math.sin(slope)])


def laid(hold: str = "clamped", *, bending: float = 1e-3, micro: float = 0.0, end: np.ndarray = END, s: np.ndarray = S) -> GradientShape:
    start_tangent, end_tangent = (tangent(slope) for slope in HOLDS[hold])
    return lay(np.zeros(3), end, 1.0, LOAD, bending, micro, start_tangent, end_tangent, s)


@each_hold
@each_micro
def test_the_cable_meets_its_ends_and_its_clamps_and_is_as_long_as_it_is(hold: str, micro: str) -> None:
    shape = laid(hold, micro=MICRO[micro])
    np.testing.assert_allclose(shape.nodes[[0, -1]], [np.zeros(3), END], atol=1e-12)
    steps = np.diff(shape.nodes, axis=0)
    np.testing.assert_allclose(np.linalg.norm(steps, axis=1), np.diff(S), rtol=1e-5)
    for index, slope in ((0, HOLDS[hold][0]), (-1, HOLDS[hold][1])):
        if slope is None:
            assert abs(shape.moment[index]) < 1e-12 * np.abs(shape.moment).max() + 1e-14
        else:
            ahead = math.atan2(steps[index, 2], steps[index, 0])
            assert ahead == pytest.approx(slope, abs=np.abs(shape.curvature).max() * np.diff(S)[0])


@each_hold
@each_micro
@pytest.mark.parametrize("rise", [0.1, 0.5, -0.6])
def test_forces_and_moments_balance_the_weight_where_the_cable_is(rise: float, hold: str, micro: str) -> None:
    """The centre of weight by Gauss-Legendre quadrature, in panels that resolve the layers, over the arc length of the curve."""
    end = 0.955 * np.array([math.sqrt(1 - rise * rise), 0.0, rise])
    points, weights = np.polynomial.legendre.leggauss(20)
    half = np.append(0.0, 0.5 * 2.0 ** np.arange(-9.0, 1.0))
    panels = np.append(half, 1 - half[-2::-1])
    s = (0.5 * (panels[1:] + panels[:-1])[:, None] + 0.5 * np.diff(panels)[:, None] * points).ravel()
    tilt, held = math.atan2(end[2], end[0]), HOLDS[hold]
    tangents = [tangent(None if slope is None else slope + tilt) for slope in held]
    shape = lay(np.zeros(3), end, 1.0, LOAD, 1e-3, MICRO[micro], *tangents, s)
    middle = float((0.5 * np.diff(panels)[:, None] * weights).ravel() @ shape.nodes[:, 0])
    assert abs(middle - end[0] / 2) > 1e-4  # the weight is not in the middle of the span
    np.testing.assert_allclose(shape.start_force + shape.end_force, -LOAD, atol=1e-12)
    assert shape.end_force[0] == pytest.approx(shape.horizontal)
    lever = shape.end_force[2] * end[0] - shape.end_force[0] * end[2] - 1.0 * middle
    # About the first end: M turns the end of the cable up by what the forces turn it.
    assert shape.end_moment - shape.start_moment + lever == pytest.approx(0.0, abs=1e-11)  # measured 1e-12


@each_hold
def test_the_tension_at_an_end_is_the_force_there_along_the_cable(hold: str) -> None:
    shape = laid(hold, s=np.array([0.0, 1e-7, 1 - 1e-7, 1.0]))
    first, last = (shape.nodes[[1, 3]] - shape.nodes[[0, 2]]) / 1e-7
    assert [-shape.start_force @ first, shape.end_force @ last] == pytest.approx(shape.tension[[0, 3]], rel=1e-5)


@each_hold
def test_a_load_in_any_direction_gives_the_same_shape_turned(hold: str) -> None:
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turned = [None if t is None else turn @ t for t in map(tangent, HOLDS[hold])]
    away = np.array([1.0, 2.0, 3.0])
    shape = lay(turn @ away, turn @ (END + away), 1.0, turn @ LOAD, 1e-3, 0.01, *turned, S)
    np.testing.assert_allclose((shape.nodes - shape.nodes[0]) @ turn, laid(hold, micro=0.01).nodes, atol=1e-12)


def test_a_mirrored_cable_has_the_mirrored_shape() -> None:
    shape = laid("mixed", micro=0.01)
    back = lay(END, np.zeros(3), 1.0, LOAD, 1e-3, 0.01, None, -np.array(tangent(0.3)), S)
    np.testing.assert_allclose(back.nodes[::-1], shape.nodes, atol=1e-12)
    np.testing.assert_allclose(back.moment[::-1], shape.moment, atol=1e-13)
    assert back.error == pytest.approx(shape.error, rel=1e-6)


def test_only_ratios_count() -> None:
    """Lengths times 3, weights times 2: bending times 2 * 3^3."""
    small, slopes = laid("clamped", micro=0.01), map(tangent, HOLDS["clamped"])
    large = lay(np.zeros(3), 3 * END, 3.0, 2 * LOAD, 54e-3, 0.03, *slopes, 3 * S)
    np.testing.assert_allclose(large.nodes, 3 * small.nodes, atol=1e-12)
    assert large.horizontal == pytest.approx(6 * small.horizontal)
    assert (large.error, large.tension_error) == pytest.approx((3 * small.error, 6 * small.tension_error), rel=1e-6)


@each_hold
@pytest.mark.parametrize("bending", [1e-6, 1e-12, 1e-18, 1e-24])
def test_the_softest_cable_overflows_nothing_and_nears_the_catenary(hold: str, bending: float) -> None:
    shape = laid(hold, bending=bending, micro=1e-7)
    assert np.isfinite(shape.moment).all()
    distance = np.abs(shape.nodes - hang(np.zeros(3), END, 1.0, LOAD, S).nodes).max()
    assert distance < shape.error + 1.5 * math.sqrt(bending / shape.horizontal)
    assert distance > 0.5 * shape.error


@pytest.mark.parametrize("micro", [1e-200, 1e-12, 1e-9, 1e-6])
def test_a_vanishing_micro_length_gives_the_fourth_order_cable(micro: float) -> None:
    """The second layer is (l / g)^2 of the first, and moves the cable by (l / g)^2 g."""
    difference = np.abs(laid("clamped", micro=micro).nodes - laid("clamped").nodes).max()
    assert difference < 1e-13 + micro**2 / 0.04
    assert np.abs(laid("clamped", micro=micro).moment - laid("clamped").moment).max() < 1e-12 + 0.1 * micro


def test_the_layers_pass_smoothly_where_their_rates_meet_and_turn_complex() -> None:
    gradient = 0.1
    micros = gradient * np.array([0.4899999, 0.4900001, 0.4999999, 0.5, 0.5000001])
    x = np.linspace(0.0, 1.0, 11)
    curves = [derivatives(bent(Posed(1.0, 0.05, 0.01, 0.5, gradient**2, micro, 0.3, math.nan), 1.0), x) for micro in micros]
    np.testing.assert_allclose(curves[1], curves[0], rtol=1e-5, atol=1e-6)  # up to the fifth derivative; l differs by 4e-7
    np.testing.assert_allclose(curves[3], curves[2], rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(curves[3], curves[4], rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("micro", [0.0, 0.02, 0.07])
def test_each_derivative_is_the_slope_of_the_one_before(micro: float) -> None:
    curve, step = bent(Posed(1.0, 0.05, 0.01, 0.5, 0.01, micro, 0.3, math.nan), 1.0), 1e-5
    x = np.array([0.02, 0.3, 0.5, 0.97])
    table = derivatives(curve, x)
    slopes = (derivatives(curve, x + step) - derivatives(curve, x - step)) / (2 * step)
    np.testing.assert_allclose(slopes[:5], table[1:], rtol=1e-6, atol=1e-6)
    assert [slope_at(curve, at) for at in x] == pytest.approx(table[1], rel=1e-14)


def test_the_compiled_functions_equal_the_same_in_plain_python() -> None:
    posed, s = Posed(1.0, 0.05, 0.01, 0.5, 0.001, 0.01, 0.1, math.nan), np.linspace(0.0, 1.0, 7)
    force = balanced(posed, 1e-6)
    assert balanced.py_func(posed, 1e-6) == pytest.approx(force, rel=1e-13)
    curve = bent(posed, force)
    np.testing.assert_allclose(bent.py_func(posed, force).sizes, curve.sizes, rtol=1e-9)
    np.testing.assert_allclose(derivatives.py_func(curve, s), derivatives(curve, s), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(places.py_func(curve, s), places(curve, s), atol=1e-14)


@pytest.mark.parametrize("slack", [1e-6, 1e-9, 1e-12])
def test_a_taut_cable_keeps_finite_tension(slack: float) -> None:
    shape = laid("hinged", end=np.array([1 - slack, 0.0, 0.0]))
    assert np.isfinite(shape.tension).all()
    assert shape.horizontal == pytest.approx(1 / math.sqrt(24 * slack), rel=2e-3 + 2e-16 / slack)


def test_a_micro_length_widens_the_layer_beside_a_clamp() -> None:
    soft, stiff = laid("clamped"), laid("clamped", micro=0.1)
    beside = S < 0.1
    assert np.abs(stiff.curvature[beside]).max() < 0.8 * np.abs(soft.curvature[beside]).max()


REFUSED = {
    "push the cable together": {"bending": 0.5},
    "turns by .* degrees from its chord": {"slopes": (0.9, 0.0)},
    "its slack is misjudged": {"slopes": (0.7, -0.7), "bending": 1e-4, "end": np.array([0.9998, 0.0, 0.0])},
    "leaves the plane": {"out": 1e-6},
    "points away": {"slopes": (2.5, 0.0)},
    "rises by 80": {"end": 0.9 * np.array([math.cos(math.radians(80)), 0.0, math.sin(math.radians(80))])},
    "rises by 90": {"end": np.array([0.0, 0.0, 0.5])},
    "chord rises": {"end": np.zeros(3)},
    "apart, further than": {"end": np.array([1.1, 0.0, 0.0])},
    "without weight": {"load": np.zeros(3)},
    "bending is 0": {"bending": 0.0},
    "micro_length -0.1": {"micro": -0.1},
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_what_it_does_not_cover_is_refused_with_the_reason(sentence: str) -> None:
    asked = {"bending": 1e-3, "micro": 0.0, "end": END, "slopes": (0.0, 0.0), "load": LOAD, "out": 0.0} | REFUSED[sentence]
    first, last = (tangent(slope) for slope in asked["slopes"])
    sideways = np.array([0.0, asked["out"], 0.0])
    with pytest.raises(NotCovered, match=sentence):
        lay(np.zeros(3), asked["end"], 1.0, asked["load"], asked["bending"], asked["micro"], first + sideways, last, S)


def test_a_plane_within_rounding_is_plane_enough() -> None:
    tilted = np.array([1.0, 5e-10, 0.0])
    shape = lay(np.zeros(3), END, 1.0, LOAD, 1e-3, 0.0, tilted, None, S)
    assert np.abs(shape.nodes[:, 1]).max() == 0.0


@pytest.mark.thorough
def test_an_absurd_cable_gets_numbers_or_a_reason() -> None:
    """Lengths, weights, stiffnesses and slacks over many powers of ten; seeded."""
    rng, answered = np.random.default_rng(5), 0
    for _ in range(500):
        length, weight, incline = 10 ** rng.uniform(-3, 3), 10 ** rng.uniform(-6, 6), rng.uniform(-1.1, 1.1)
        bending, micro = 10 ** rng.uniform(-25, 2) * weight * length**3, rng.choice([0.0, 10 ** rng.uniform(-12, 2)]) * length
        end = length * (1 - 10 ** rng.uniform(-12, -0.3)) * np.array([math.cos(incline), 0.0, math.sin(incline)])
        first, last = (None if rng.random() < 0.3 else tangent(incline + rng.uniform(-0.2, 0.2)) for _ in range(2))
        try:
            shape = lay(np.zeros(3), end, length, weight * LOAD, bending, micro, first, last, length * S[::200])
        except NotCovered:
            continue
        answered += 1
        assert np.isfinite([shape.tension, shape.moment, shape.curvature]).all()
        assert 0 < shape.error < math.inf
        np.testing.assert_allclose(shape.nodes[-1], end, atol=2e-12 * length)  # measured 1e-12, at the least slack
    assert answered > 250
