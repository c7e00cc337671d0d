"""The height of a column from its stability margin: Greenhill 1881, to a thousandth.

Source: Greenhill 1881, "Determination of the greatest height consistent with stability that a vertical pole or mast can be made",
Proceedings of the Cambridge Philosophical Society 4, 65-73.

Claim: the margin of a straight column falls to zero at w L^3 / EI = 9/4 j^2 = 7.8373, with j the first zero of J_{-1/3}. Below that
it is the smallest eigenvalue of -EI theta'' - w (L - s) theta = mu theta with theta(0) = 0 and theta'(L) = 0, here by
`solve_ivp`; `test_column_greenhill_1881` derives the threshold a second time, from a power series.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from loaded import answer, pose, straight
from posed import cable, frame, grasps
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import jv

from protocol.kinds import Hold, Outcome
from protocol.messages import Shape

CRITICAL = 9 / 4 * brentq(lambda x: jv(-1 / 3, x), 1.5, 2.2, xtol=1e-14) ** 2
UP = frame((0.0, 0.0, 1.0))
SEGMENTS = 200


def standing(part: float) -> Shape:
    foot = grasps((0.0, (0.0, 0.0, 0.0), UP, Hold.CLAMP))
    start = straight(1.0, SEGMENTS, UP, np.array([[0.0, 0.0, 1.0]]))
    return answer(pose(cable(bending=1 / (part * CRITICAL)), foot, start=start), extrapolate=False, margin=True)


def eigenvalue(part: float) -> float:
    """[N] For a column of 1 m that weighs 1 N."""
    bending = 1 / (part * CRITICAL)

    def slope_at_the_top(mu: float) -> float:
        return float(
            solve_ivp(lambda s, y: [y[1], -(1 - s + mu) / bending * y[0]], (0.0, 1.0), [0.0, 1.0], rtol=1e-11, atol=1e-13).y[1, -1]
        )

    return float(brentq(slope_at_the_top, -0.3, 0.5, xtol=1e-12))


def test_the_eigenvalue_is_zero_at_the_height_of_greenhill() -> None:
    assert eigenvalue(1.0) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("part", [0.7, 0.9, 0.99, 0.999])
def test_the_margin_is_the_smallest_eigenvalue(part: float) -> None:
    shape = standing(part)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert shape.is_stable
    assert shape.margin == pytest.approx(eigenvalue(part), abs=2e-5)  # N, of 1 N


def test_the_margins_below_lead_to_the_threshold_within_a_thousandth() -> None:
    parts = np.array([0.99, 0.995])
    margins = [standing(part).margin for part in parts]
    threshold = parts[1] - margins[1] * (parts[1] - parts[0]) / (margins[1] - margins[0])
    assert threshold == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("is_warm", [True, False])
@pytest.mark.parametrize("stretch", [None, 1e5])
@pytest.mark.parametrize("part", [0.99, 0.999, 1.0005, 1.001, 1.01])
def test_a_column_half_a_thousandth_too_heavy_does_not_stand(part: float, stretch: float | None, is_warm: bool) -> None:
    """Straight below the height of Greenhill, leaning over above it; a cold start refines its mesh, as the lean asks for."""
    foot = grasps((0.0, (0.0, 0.0, 0.0), UP, Hold.CLAMP))
    rod = replace(cable(bending=1 / (part * CRITICAL)), stretch=stretch)
    start = straight(1.0, SEGMENTS, UP, np.array([[0.0, 0.0, 1.0]])) if is_warm else None
    shape = answer(pose(rod, foot, start=start), tolerance=1e-4, extrapolate=False)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert shape.is_stable
    lean = float(np.hypot(*shape.nodes[-1, :2]))
    assert lean < 1e-6 if part < 1.0 else lean > 1.5 * np.sqrt(part - 1.0)  # m; measured 2.1 times the root
