"""The cantilever with a load at its tip: Bisshopp & Drucker 1945.

Source: Bisshopp & Drucker 1945, "Large deflection of cantilever beams", Quarterly of Applied Mathematics 3, 272-275;
numbers to five digits in Mattiasson 1981, "Numerical results from large deflection beam and frame problems analysed by
means of elliptic integrals", International Journal for Numerical Methods in Engineering 17, 145-153.

Claim: with alpha^2 = P L^2 / EI, 2 k^2 = 1 + sin(tip slope) and sin(delta) = 1 / (k sqrt 2), the modulus follows from
alpha = K(k) - F(delta, k), the tip sinks by L (1 - 2 (E(k) - E(delta, k)) / alpha) and stands out by
L sqrt(2 sin(tip slope)) / alpha.

A problem cannot name a load. It can name the place of the tip: hinged there, without gravity, the cantilever must answer with
the load, straight down and without a moment. The closed form is checked with Mattiasson's table and with solve_bvp.
"""

from __future__ import annotations

import numpy as np
import pytest
from heavy_elastica import Planar, planar
from posed import ask, cable, frame, grasps
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

from protocol.kinds import Hold, Outcome
from protocol.messages import Shape, Start

LEVEL = frame((1.0, 0.0, 0.0))
TABLE = {1.0: (0.30172, 0.05643), 2.0: (0.49346, 0.16064), 5.0: (0.71379, 0.38763), 10.0: (0.81061, 0.55500)}  # Mattiasson 1981

each_load = pytest.mark.parametrize("load", TABLE)  # N, on 1 m with EI = 1 N m^2


def tip(load: float) -> tuple[float, float, float]:
    """How far the tip stands out [m], how far it has sunk [m], and its slope downwards [rad]."""
    alpha = np.sqrt(load)

    def delta(k: float) -> float:
        return float(np.arcsin(1 / (k * np.sqrt(2))))

    k = brentq(lambda k: ellipk(k * k) - ellipkinc(delta(k), k * k) - alpha, np.sqrt(0.5) + 1e-12, 1 - 1e-12, xtol=1e-15)
    slope = float(np.arcsin(2 * k * k - 1))
    return float(np.sqrt(2 * np.sin(slope)) / alpha), float(1 - 2 * (ellipe(k * k) - ellipeinc(delta(k), k * k)) / alpha), slope


def numerical(load: float) -> Planar:
    x, sunk, slope = tip(load)
    return planar(
        bending=1.0,
        weight=0.0,
        length=1.0,
        start=(0.0, 0.0, 0.0),
        end=(x, -sunk, None),
        slope=lambda s: -slope * (2 * s - s * s),
        force=(0.0, -load),
    )


def hinged_at_the_tip(load: float, segments: int) -> Shape:
    x, sunk, slope = tip(load)
    s = np.linspace(0.0, 1.0, segments + 1)
    middle = (s[1:] + s[:-1]) / 2
    frames = np.array([frame((np.cos(a), 0.0, -np.sin(a))) for a in slope * (2 * middle - middle**2)])
    start = Start(s=s, frames=frames, grasp_forces=np.array([[0.0, 0.0, load], [0.0, 0.0, -load]]))
    held = grasps((0.0, (0.0, 0.0, 0.0), LEVEL, Hold.CLAMP), (1.0, (x, 0.0, -sunk), LEVEL, Hold.HINGE))
    shape = ask(cable(bending=1.0, weight=0.0), held, start=start)
    assert shape.outcome is Outcome.CONVERGED
    assert shape.is_stable
    return shape


@each_load
def test_the_closed_form_is_that_of_the_table(load: float) -> None:
    x, sunk, _ = tip(load)
    assert (sunk, 1 - x) == pytest.approx(TABLE[load], abs=6e-6)  # five digits


@each_load
def test_the_closed_form_solves_the_differential_equation(load: float) -> None:
    found = numerical(load)
    assert found.force == pytest.approx([0.0, -load], abs=1e-9)  # N; measured 4e-11
    assert found.state(np.array([1.0]))[2] == pytest.approx([-tip(load)[2]], abs=1e-9)


@each_load
def test_the_answer_approaches_the_load_and_the_shape_with_order_two(load: float) -> None:
    exact, shapes = numerical(load), [hinged_at_the_tip(load, segments) for segments in (50, 100, 200, 400)]
    wanted = np.array([[0, 0, load, 0, -load * tip(load)[0], 0], [0, 0, -load, 0, 0, 0]])
    places = [np.linalg.norm(shape.nodes - exact.positions(shape.s), axis=1).max() for shape in shapes]
    wrenches = [np.abs(shape.grasp_wrenches - wanted).max() for shape in shapes]
    for errors in (places, wrenches):
        assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(2.0, abs=0.05)  # measured 1.99 to 2.02
    assert places[-1] < 3e-6  # m; measured 3.9e-7 at 1 N to 2.2e-6 at 10 N
    assert wrenches[-1] < 1e-3  # N, N m; measured 2.5e-4 at 1 N to 7.6e-4 at 10 N


@each_load
def test_a_cold_start_finds_the_cantilever(load: float) -> None:
    x, sunk, _ = tip(load)
    held = grasps((0.0, (0.0, 0.0, 0.0), LEVEL, Hold.CLAMP), (1.0, (x, 0.0, -sunk), LEVEL, Hold.HINGE))
    shape = ask(cable(bending=1.0, weight=0.0), held, tolerance=1e-4)
    assert shape.outcome is Outcome.CONVERGED
    assert shape.grasp_wrenches[1, :3] == pytest.approx([0.0, 0.0, -load], abs=3e-2)  # N; measured 2.5e-2 on 50 segments
