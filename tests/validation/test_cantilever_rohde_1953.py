"""The cantilever under its own weight: Rohde 1953.

Source: Rohde 1953, "Large deflections of a cantilever beam with a uniformly distributed load", Quarterly of Applied
Mathematics 11, 337-338.

Claim: with the arc length s counted from the free tip and the slope phi downwards, EI phi'' = -w s cos(phi), phi' = 0 at the tip
and phi = 0 at the clamp. Rohde solves it by a power series whose one unknown is the slope of the tip; so does the
reference here by marching from the tip, checked with solve_bvp. A rod held at one end hangs so; a rod hinged as well where
its tip would be feels no force there.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from heavy_elastica import Planar, planar
from posed import ask, cable, frame, grasps, unbalance
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from protocol.kinds import Hold, Outcome
from protocol.messages import Start

LEVEL = frame((1.0, 0.0, 0.0))
STIFFNESSES = (1.0, 0.3, 0.1, 0.03, 0.01)  # N m^2, on 1 m of rod that weighs 1 N

each_stiffness = pytest.mark.parametrize("bending", STIFFNESSES)


@cache
def reference(bending: float) -> Planar:
    stiffer = [b for b in STIFFNESSES if b > bending]
    return planar(
        bending=bending,
        weight=1.0,
        length=1.0,
        start=(0.0, 0.0, 0.0),
        end=(None, None, None),
        guess=reference(min(stiffer)) if stiffer else None,
        slope=lambda s: -0.1 * s,
        force=(0.0, -1.0),
    )


def marched_tip(bending: float) -> tuple[float, float, float]:
    """Place [m] and downward slope [rad] of the tip, by marching from the tip to the clamp."""

    def march(slope: float) -> np.ndarray:
        def rhs(s: float, y: np.ndarray) -> list[float]:
            return [y[1], -s * np.cos(y[0]) / bending, np.cos(y[0]), np.sin(y[0])]

        return solve_ivp(rhs, (0.0, 1.0), [slope, 0.0, 0.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]

    slope = brentq(lambda slope: march(slope)[0], 0.0, np.pi / 2 - 1e-12, xtol=1e-14)
    return march(slope)[2], -march(slope)[3], slope


@each_stiffness
def test_marching_and_collocation_find_the_same_tip(bending: float) -> None:
    x, z, slope, _ = reference(bending).state(np.array([1.0]))[:, 0]
    assert (x, z, -slope) == pytest.approx(marched_tip(bending), abs=1e-10)  # measured 1.1e-12


@each_stiffness
def test_a_hinge_where_the_tip_would_be_carries_nothing(bending: float) -> None:
    exact = reference(bending)
    s = np.linspace(0.0, 1.0, 401)
    frames = np.array([frame((np.cos(a), 0.0, np.sin(a))) for a in exact.state((s[1:] + s[:-1]) / 2)[2]])
    start = Start(s=s, frames=frames, grasp_forces=np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]))
    place = exact.positions(np.array([1.0]))[0]
    held = grasps((0.0, (0.0, 0.0, 0.0), LEVEL, Hold.CLAMP), (1.0, place, LEVEL, Hold.HINGE))
    shape = ask(cable(bending=bending), held, start=start)
    assert shape.outcome is Outcome.CONVERGED
    assert np.abs(shape.grasp_wrenches[1]).max() < 1e-3  # of the weight; measured 9.1e-5 (EI = 0.1) to 7.4e-4 (EI = 1)
    assert np.linalg.norm(shape.nodes - exact.positions(s), axis=1).max() < 3e-5  # m; measured 2.6e-7 to 1.4e-5


@each_stiffness
def test_a_rod_held_at_one_end_hangs_as_the_reference(bending: float) -> None:
    exact = reference(bending)
    held = grasps((0.0, (0.0, 0.0, 0.0), LEVEL, Hold.CLAMP))
    shape = ask(cable(bending=bending), held, tolerance=1e-4)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert shape.is_stable
    error = np.linalg.norm(shape.nodes - exact.positions(shape.s), axis=1).max()
    assert error < 1e-4  # m; measured 2.7e-5 to 6.2e-5; what was asked for
    assert shape.error is not None
    assert 1.1 < shape.error / error < 1.5  # measured 1.30 to 1.35; the factor of safety is 1.3
    assert shape.grasp_wrenches[0, :3] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)  # N
    assert shape.grasp_wrenches[0, 4] == pytest.approx(
        bending * exact.state(np.array([0.0]))[3, 0], abs=2e-5
    )  # N m; measured 2.3e-6 to 1.03e-5
    assert unbalance(cable(bending=bending), shape, held) == pytest.approx((0.0, 0.0), abs=1e-9)  # measured 1e-15 and 1.3e-10
