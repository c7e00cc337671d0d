"""A folded cable that will not bend tighter than a loop 5.7 mm across, after section 5.2 of the paper.

"Simulating robotic manipulation of cabling and interaction with surroundings": a cable of 3.3 mm is folded and drawn through a clip; it
resists, and keeps a loop 5.7 mm across. Here two clamps hold the strands side by side, and the loop between them is made ever shorter.
References: a loop bent nowhere tighter than a radius r, between two parallel strands 2 c apart, is at least 2 r wide and r (pi + 4 alpha)
long with cos alpha = (c + r) / 2 r, three arcs of that radius (Dubins 1957); and scipy's SLSQP on the angles of a plane chain with a bound
on each.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.optimize import minimize

from protocol.kinds import Hold, Outcome, SelfInteraction
from protocol.messages import Grasps, Problem, Shape
from protocol.scene import Cable
from shape_server import solve
from shape_server.hard_cases.posing import frame

RADIUS, HALF, BENDING = 2.85e-3, 1.65e-3, 1e-4  # m, of the loop; m, half of 3.3 mm; N m^2
ALPHA = np.arccos((HALF + RADIUS) / (2 * RADIUS))
SHORTEST = RADIUS * (np.pi + 4 * ALPHA)  # m, 16.5 mm


@cache
def loop(length: float, bend_radius: float | None) -> Shape:
    """The loop of a cable between two strands side by side."""
    kind = SelfInteraction.TRANSPARENT if bend_radius is None else SelfInteraction.FICTITIOUS
    cable = Cable(
        name="c",
        length=length,
        diameter=2 * HALF,
        mass_per_length=0.0,
        bending=BENDING,
        twist=0.8 * BENDING,
        bend_radius=bend_radius,
        self_interaction=kind,
    )
    grasps = Grasps(
        s=np.array([0.0, length]),
        position=np.array([[-HALF, 0.0, 0.0], [HALF, 0.0, 0.0]]),
        quaternion=np.array([frame((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)), frame((0.0, 0.0, -1.0), (0.0, 1.0, 0.0))]),
        hold=(Hold.CLAMP, Hold.CLAMP),
    )
    return solve(Problem(cable=cable, grasps=grasps), (0.0, 0.0, 0.0), tolerance=1e-5, extrapolate=False)


def width(shape: Shape) -> float:
    """How far across a loop is [m]."""
    return float(np.ptp(shape.nodes[:, 0]))


@pytest.mark.thorough
def test_a_loop_that_is_drawn_tight_stays_5_7_mm_across() -> None:
    for length in (0.022, 0.0195):
        shape = loop(length, RADIUS)
        assert shape.outcome is Outcome.CONVERGED
        assert width(shape) > 2 * RADIUS * (1 - 1e-3)  # measured 5.842, 5.715 mm; at 18.5 mm of cable 5.698
        assert shape.curvature.max() * RADIUS < 1.001  # measured 1.0001
    assert width(loop(0.0195, RADIUS)) < 2 * RADIUS * 1.005
    assert pytest.approx(16.5e-3, abs=0.05e-3) == SHORTEST


def test_without_a_least_radius_it_folds_tighter() -> None:
    assert width(loop(0.0195, None)) < 5.2e-3  # measured 5.11 mm


def test_a_loop_wide_enough_does_not_feel_the_least_radius() -> None:
    np.testing.assert_allclose(loop(0.03, RADIUS).nodes, loop(0.03, None).nodes, atol=1e-9)


def test_a_loop_at_its_least_radius_is_that_of_least_energy_with_bounded_angles() -> None:
    shape, count = loop(0.022, RADIUS), 80
    h = 0.022 / count
    cells = np.concatenate([[0.5], np.ones(count - 1), [0.5]]) * h

    def bends(angle: np.ndarray) -> np.ndarray:
        return np.diff(np.concatenate([[np.pi / 2], angle, [-np.pi / 2]]))

    def energy(angle: np.ndarray) -> tuple[float, np.ndarray]:
        moment = bends(angle) / (cells / h)
        return 0.5 * float((bends(angle) * moment).sum()), moment[:-1] - moment[1:]

    def closing(angle: np.ndarray) -> np.ndarray:
        return np.array([h * np.cos(angle).sum() - 2 * HALF, h * np.sin(angle).sum()]) / h

    bound = np.eye(count + 1, count) - np.eye(count + 1, count, -1)
    limit = cells / RADIUS
    fixed = np.zeros(count + 1)
    fixed[0], fixed[-1] = -np.pi / 2, -np.pi / 2
    constraints = [
        {"type": "eq", "fun": closing, "jac": lambda a: np.array([-np.sin(a), np.cos(a)])},
        {"type": "ineq", "fun": lambda a: limit - (bound @ a + fixed), "jac": lambda _: -bound},
        {"type": "ineq", "fun": lambda a: limit + (bound @ a + fixed), "jac": lambda _: bound},
    ]
    s = (np.arange(count) + 0.5) * h
    d3 = np.diff(shape.nodes, axis=0)
    start = np.interp(s, 0.5 * (shape.s[1:] + shape.s[:-1]), np.unwrap(np.arctan2(d3[:, 2], d3[:, 0])))
    found = minimize(energy, start, jac=True, constraints=constraints, method="SLSQP", options={"maxiter": 200, "ftol": 1e-12})
    assert found.success
    nodes = np.vstack([[0.0, 0.0], np.cumsum(h * np.column_stack([np.cos(found.x), np.sin(found.x)]), axis=0)]) - [HALF, 0.0]
    at = np.column_stack([np.interp(shape.s, np.arange(count + 1) * h, column) for column in nodes.T])
    assert np.linalg.norm(at - shape.nodes[:, [0, 2]], axis=1).max() < 2e-5  # m
