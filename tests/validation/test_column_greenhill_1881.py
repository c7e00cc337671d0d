"""How high a column can stand under its own weight: Greenhill 1881.

Source: Greenhill 1881, "Determination of the greatest height consistent with stability that a vertical pole or mast can be made,
and of the greatest height to which a tree of given proportions can grow", Proceedings of the Cambridge Philosophical
Society 4, 65-73.

Claim: a uniform column clamped at its foot and free at its top stands straight up to w L^3 / EI = 9/4 j^2 = 7.8373, with j the first
zero of the Bessel function J_{-1/3}; beyond that it leans over. Checked with the power series of
theta'' + lambda s theta = 0, s from the top, which knows nothing of Bessel functions.
"""

from __future__ import annotations

import numpy as np
import pytest
from heavy_elastica import planar
from posed import ask, cable, frame, grasps
from scipy.optimize import brentq
from scipy.special import jv

from protocol.kinds import Hold, Outcome
from protocol.messages import Grasps, Start

CRITICAL = 9 / 4 * brentq(lambda x: jv(-1 / 3, x), 1.5, 2.2, xtol=1e-14) ** 2
UP = frame((0.0, 0.0, 1.0))


def foot() -> Grasps:
    return grasps((0.0, (0.0, 0.0, 0.0), UP, Hold.CLAMP))


def straight(segments: int) -> Start:
    s = np.linspace(0.0, 1.0, segments + 1)
    return Start(s=s, frames=np.tile(UP, (segments, 1)), grasp_forces=np.array([[0.0, 0.0, 1.0]]))


def test_the_bessel_function_and_the_power_series_agree() -> None:
    def slope_at_the_foot(load: float) -> float:
        term, total = 1.0, 1.0
        for k in range(1, 40):
            term *= -load / (3 * k * (3 * k - 1))
            total += term
        return total

    assert pytest.approx(brentq(slope_at_the_foot, 5.0, 10.0, xtol=1e-13), abs=1e-10) == CRITICAL
    assert pytest.approx(7.8373, abs=5e-5) == CRITICAL


@pytest.mark.parametrize("ratio", [0.5, 0.9, 0.98, 0.995])
def test_a_column_below_the_critical_height_stands_straight(ratio: float) -> None:
    shape = ask(cable(bending=1 / (ratio * CRITICAL)), foot(), start=straight(100))
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert shape.is_stable
    assert shape.nodes[-1] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)


@pytest.mark.parametrize("ratio", [0.5, 0.9])
def test_a_cold_start_finds_the_straight_column(ratio: float) -> None:
    shape = ask(cable(bending=1 / (ratio * CRITICAL)), foot())
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert shape.is_stable
    assert shape.nodes[-1] == pytest.approx([0.0, 0.0, 1.0], abs=1e-6)


@pytest.mark.parametrize("ratio", [1.005, 1.02, 1.1, 1.5])
def test_a_column_above_the_critical_height_is_never_reported_as_standing(ratio: float) -> None:
    """Straight up is an equilibrium still, but no longer a stable one."""
    shape = ask(cable(bending=1 / (ratio * CRITICAL)), foot(), start=straight(100))
    assert shape.outcome is Outcome.UNSTABLE or np.linalg.norm(shape.nodes[-1] - [0.0, 0.0, 1.0]) > 1e-2, shape.sentence


@pytest.mark.parametrize("ratio", [1.1, 1.5, 3.0])
def test_a_column_above_the_critical_height_leans_over_as_the_elastica(ratio: float) -> None:
    bending = 1 / (ratio * CRITICAL)
    bent = planar(
        bending=bending,
        weight=1.0,
        length=1.0,
        start=(0.0, 0.0, np.pi / 2),
        end=(None, None, None),
        slope=lambda s: np.pi / 2 - 2.5 * np.sqrt(min(1.0, ratio - 1)) * np.sin(np.pi * s / 2),
        force=(0.0, -1.0),
    )
    x, _, z = bent.positions(np.array([1.0]))[0]
    assert abs(x) > 0.1  # the bent branch, not the straight one
    shape = ask(cable(bending=bending), foot(), tolerance=1e-4)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert shape.is_stable
    assert np.hypot(*shape.nodes[-1, :2]) == pytest.approx(abs(x), abs=1e-4)  # m; measured 1.5e-5 to 3.5e-5
    assert shape.nodes[-1, 2] == pytest.approx(z, abs=1e-4)  # m; measured 1.6e-5 to 7.9e-5
