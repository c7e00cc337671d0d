"""From a stiff strip to a rope with boundary layers: the heavy elastica over eight decades of stiffness.

Source: Wang 1986, "A critical review of the heavy elastica", International Journal of Mechanical Sciences 28, 549-559; Kierzenka & Shampine
2001, ACM Transactions on Mathematical Software 27, 299-316 (algorithm of the reference, solve_bvp).

Claim: clamped or hinged at its far end, with w L^3 / EI from 1e-2 to 1e6, a cold start finds an equilibrium within the tolerance
asked for. Which one is left to the solver, since stiff strips have several: the reference starts from the answer's slope, rounded
to 0.01, and is refined to 1e-9 by itself. It keeps n.d3 + EI kappa^2 / 2 - w z constant, an integral that it does not use.
At EI / (w L^3) = 1e-6 all bending is within sqrt(EI / H), 2 mm, of the clamps.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from loaded import answer, pose
from posed import cable, frame, grasps
from scipy.integrate import solve_bvp
from scipy.spatial.transform import Rotation

from protocol.kinds import Hold, Outcome
from protocol.messages import Problem, Shape

LEVEL = frame((1.0, 0.0, 0.0))
LOADS = tuple(10.0**power for power in range(-2, 7))  # w L^3 / EI
ENDS = ((0.7, 0.1), (0.9, 0.0), (0.3, -0.2))  # m, x and z
PLANE = {(Hold.CLAMP, (0.7, 0.1)): 10.0, (Hold.CLAMP, (0.3, -0.2)): 100.0}  # from which load on the shape found is plane
CASES = tuple(
    (load, hold, end) for hold in (Hold.CLAMP, Hold.HINGE) for end in ENDS for load in LOADS if load >= PLANE.get((hold, end), 0.0)
)

each_case = pytest.mark.parametrize(("load", "hold", "end"), CASES)


def posed(load: float, hold: Hold, end: tuple[float, float]) -> Problem:
    held = grasps((0.0, (0.0, 0.0, 0.0), LEVEL, Hold.CLAMP), (1.0, (end[0], 0.0, end[1]), LEVEL, hold))
    return pose(cable(bending=1 / load), held)


@cache
def found(load: float, hold: Hold, end: tuple[float, float], tolerance: float) -> Shape:
    shape = answer(posed(load, hold, end), tolerance=tolerance)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    return shape


def slopes(shape: Shape) -> np.ndarray:
    """(n,) [rad] Slope of the tangent at the nodes, unwrapped."""
    d3 = Rotation.from_quat(shape.frames).as_matrix()[:, :, 2]
    assert np.abs(d3[:, 1]).max() < 1e-4  # plane
    middle = (shape.s[1:] + shape.s[:-1]) / 2
    return np.interp(shape.s, middle, np.unwrap(np.arctan2(d3[:, 2], d3[:, 0])))


@cache
def reference(load: float, hold: Hold, end: tuple[float, float]):  # scipy's PPoly and two numbers
    """States x, z, slope and moment over EI, by s, and the force (2,) at s = 0 over w L, on the branch of the answer."""
    shape = found(load, hold, end, 1e-3)
    angle = np.round(slopes(shape), 2)
    angle[0] = 0.0
    push = np.round(-shape.grasp_wrenches[0, [0, 2]], 2 if load > 1 else 0)
    scale = max(1.0, load)

    # the force is scaled by EI / L^2 below one, by the weight above
    def rhs(s: np.ndarray, y: np.ndarray, n: np.ndarray) -> np.ndarray:
        bend = scale * (n[0] * np.sin(y[2]) - (n[1] + load / scale * s) * np.cos(y[2]))
        return np.vstack([np.cos(y[2]), np.sin(y[2]), np.sqrt(scale) * y[3], bend / np.sqrt(scale)])

    def ends(a: np.ndarray, b: np.ndarray, n: np.ndarray) -> np.ndarray:
        return np.array([a[0], a[1], a[2], b[0] - end[0], b[1] - end[1], b[2] if hold is Hold.CLAMP else b[3]])

    guess = np.vstack([shape.nodes[:, 0], shape.nodes[:, 2], angle, np.gradient(angle, shape.s) / np.sqrt(scale)])
    solved = solve_bvp(rhs, ends, shape.s, guess, p=push * load / scale, tol=1e-9, max_nodes=50_000)
    assert solved.success, solved.message
    return solved.sol, solved.p * scale / load


def true_error(shape: Shape, load: float, hold: Hold, end: tuple[float, float]) -> float:
    x, z = reference(load, hold, end)[0](shape.s)[:2]
    return float(np.linalg.norm(shape.nodes - np.column_stack([x, np.zeros_like(x), z]), axis=1).max())


@pytest.mark.sampled(3)
@each_case
def test_the_reference_keeps_its_integral(load: float, hold: Hold, end: tuple[float, float]) -> None:
    state, force = reference(load, hold, end)
    s = np.linspace(0.0, 1.0, 57)
    _, z, slope, bend = state(s)
    energy = force[0] * np.cos(slope) + (force[1] + s) * np.sin(slope) + bend**2 * max(1.0, load) / load / 2 - z
    assert np.ptp(energy) < 1e-7 * max(1.0, 1 / load)  # N


@each_case
@pytest.mark.parametrize("tolerance", [1e-3, 1e-5, 1e-7])
def test_the_error_is_below_the_tolerance(load: float, hold: Hold, end: tuple[float, float], tolerance: float) -> None:
    assert true_error(found(load, hold, end, tolerance), load, hold, end) < tolerance


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5, 1e-7])
def test_the_error_estimate_covers_the_error_and_not_much_more(tolerance: float) -> None:
    estimates = np.array([found(*case, tolerance).error for case in CASES])
    ratio = estimates / [true_error(found(*case, tolerance), *case) for case in CASES]
    assert np.mean(ratio >= 1.0) >= 0.95, ratio.min()
    assert np.median(ratio) <= 3.0
