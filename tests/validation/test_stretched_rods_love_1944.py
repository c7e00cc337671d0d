"""Rods that stretch: a bar under its own weight, a heavy beam under tension, and the elastic catenary as its limit.

Source: Love 1944, "A treatise on the mathematical theory of elasticity", 4th ed., secs. 86, 261 and 273; Timoshenko 1956, "Strength of
materials", part II, 3rd ed., ch. II (ties with lateral load); Irvine 1981, "Cable structures", MIT Press, ch. 1.

Claims, for EA (stretched length over length - 1) as the tension:
- a bar that hangs with the weight w L and a mass at its end is longer by (w L / 2 + W) L / EA, its place
  s + ((w L + W) s - w s^2 / 2) / EA at s;
- a level beam between clamps that are drawn apart sags by w / 2T (x (L - x) - L (cosh(k L / 2) - cosh(k (x - L / 2))) / (k sinh(k L / 2)))
  with k^2 = T / EI, while slopes are small. Checked with solve_bvp on EI y'''' - T y'' = -w;
- with any slopes the rod solves r' = (1 + T / EA) d3, EI theta'' = (1 + T / EA)(n_x sin - n_z cos), here by solve_bvp;
- with next to no bending stiffness between hinges it is the elastic catenary.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from loaded import answer, place, pose, unbalanced
from posed import G, cable, frame, grasps
from scipy.integrate import solve_bvp
from scipy.optimize import root

from protocol.cable import Cable, LumpedMass
from protocol.kinds import Hold, Outcome
from protocol.messages import Grasps

LEVEL = frame((1.0, 0.0, 0.0))
ORIGIN = (0.0, 0.0, 0.0)


def held(end: tuple[float, float], hold: Hold = Hold.CLAMP) -> Grasps:
    return grasps((0.0, ORIGIN, LEVEL, hold), (1.0, (end[0], 0.0, end[1]), LEVEL, hold))


def elastic(bending: float, stretch: float) -> Cable:
    return replace(cable(bending=bending), stretch=stretch)


@pytest.mark.parametrize("upright", [False, True])
@pytest.mark.parametrize("stretch", [10.0, 1e3, 1e6])
@pytest.mark.parametrize("load", [0.0, 2.0])
def test_a_bar_stretches_under_its_weight_and_the_mass_at_its_end(stretch: float, load: float, upright: bool) -> None:
    """Upright it shortens as much, and is stiff enough to stand."""
    sign = 1.0 if upright else -1.0
    way = frame((0.0, 0.0, sign))
    bar = replace(elastic(10.0, stretch), masses=(LumpedMass(1.0, load / G),) if load else ())
    shape = answer(pose(bar, grasps((0.0, ORIGIN, way, Hold.CLAMP))))
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    s = shape.s
    exact = sign * s - ((1 + load) * s - s**2 / 2) / stretch
    assert np.abs(shape.nodes[:, 2] - exact).max() < 1e-12  # m; measured 2e-16
    assert shape.grasp_wrenches[0, 2] == pytest.approx(1 + load, rel=1e-12)
    middle = (s[1:] + s[:-1]) / 2
    assert shape.tension == pytest.approx(-sign * (1 + load - middle), abs=1e-9)


def sag(bending: float, tension: float, x: np.ndarray, span: float, weight: float) -> np.ndarray:
    """[m] Closed form for small slopes between clamps."""
    k = np.sqrt(tension / bending)
    ends = span * (np.cosh(k * span / 2) - np.cosh(k * (x - span / 2))) / (k * np.sinh(k * span / 2))
    return weight / (2 * tension) * (x * (span - x) - ends)


def test_the_closed_form_of_the_tie_solves_its_differential_equation() -> None:
    x = np.linspace(0.0, 1.0, 101)
    found = solve_bvp(
        lambda _, y: np.vstack([y[1], y[2], y[3], 3.0 / 0.1 * y[2] - 0.2 / 0.1]),
        lambda a, b: np.array([a[0], a[1], b[0], b[1]]),
        x,
        np.zeros((4, 101)),
        tol=1e-9,
        max_nodes=20_000,
    )
    assert found.success
    assert np.abs(found.sol(x)[0] + sag(0.1, 3.0, x, 1.0, 0.2)).max() < 1e-11  # m; sag counts down, the equation up


@pytest.mark.parametrize("strain", [1e-3, 1e-2])
@pytest.mark.parametrize("bending", [1.0, 1e-2])
def test_a_stretched_beam_between_clamps_sags_as_a_tie(bending: float, strain: float) -> None:
    """EA = 1e4 N and a weight of 0.01 N: the sag adds 3e-5 to the tension at most."""
    stretch, weight = 1e4, 0.01
    span, tension = 1 + strain, stretch * strain
    shape = answer(pose(replace(elastic(bending, stretch), mass_per_length=weight / G), held((span, 0.0))), tolerance=1e-9)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    exact = sag(bending * span, tension, np.array([span / 2]), span, weight / span)[0]  # EI and w of the stretched length
    assert place(shape, 0.5)[2] == pytest.approx(-exact, rel=3e-3)
    assert shape.grasp_wrenches[1, 0] == pytest.approx(tension, rel=1e-4)  # measured 3.1e-5 (softest), by the sag


@dataclass(frozen=True)
class Case:
    """One metre of elastic rod that weighs 1 N between two level clamps."""

    bending: float  # N m^2
    stretch: float  # N
    end: tuple[float, float]  # m, x and z


CASES = {
    "drawn apart by 5 %": Case(1e-2, 20.0, (1.05, 0.0)),
    "drawn apart by 5 %, rising": Case(1e-3, 20.0, (1.05, 0.1)),
    "drawn apart by a quarter, falling": Case(1e-4, 5.0, (1.2, -0.3)),
    "a little slack": Case(1e-2, 100.0, (0.999, 0.0)),
    "just its length": Case(1e-2, 1e3, (1.0, 0.0)),
    "drawn apart by 0.1 %": Case(1e-2, 1e5, (1.001, 0.0)),
}


def reference(case: Case):  # scipy's PPoly and two numbers
    """States x, z, slope, curvature by s, and the force (2,) [N] at s = 0."""
    unit, load, stiff = case.bending, 1 / case.bending, case.stretch / case.bending
    tension = max(case.stretch * (np.hypot(*case.end) - 1), 0.3)

    def rhs(s: np.ndarray, y: np.ndarray, n: np.ndarray) -> np.ndarray:
        up = n[1] + load * s
        longer = 1 + (n[0] * np.cos(y[2]) + up * np.sin(y[2])) / stiff
        return np.vstack([longer * np.cos(y[2]), longer * np.sin(y[2]), y[3], longer * (n[0] * np.sin(y[2]) - up * np.cos(y[2]))])

    def ends(a: np.ndarray, b: np.ndarray, _: np.ndarray) -> np.ndarray:
        return np.array([a[0], a[1], a[2], b[0] - case.end[0], b[1] - case.end[1], b[2]])

    s = np.linspace(0.0, 1.0, 801)
    low = max(tension, 1.0)
    rough = np.vstack([case.end[0] * s, case.end[1] * s - 0.1 * np.sin(np.pi * s) ** 2 / low, -0.05 * np.sin(2 * np.pi * s) / low, 0 * s])
    found = solve_bvp(rhs, ends, s, rough, p=np.array([tension, -0.5]) / unit, tol=1e-10, max_nodes=200_000)
    assert found.success, found.message
    return found.sol, found.p * unit


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", CASES)
def test_an_elastic_rod_lies_as_the_reference_at_every_tolerance(name: str) -> None:
    case = CASES[name]
    state, force = reference(case)
    for tolerance in (1e-3, 1e-5, 1e-7):
        problem = pose(elastic(case.bending, case.stretch), held(case.end))
        shape = answer(problem, tolerance=tolerance)
        assert shape.outcome is Outcome.CONVERGED, shape.sentence
        x, z = state(shape.s)[:2]
        error = np.hypot(shape.nodes[:, 0] - x, shape.nodes[:, 2] - z).max()
        assert error < tolerance
        assert shape.error is not None
        assert shape.error > error
        assert max(unbalanced(problem, shape)) < 1e-9
    assert shape.grasp_wrenches[0, [0, 2]] == pytest.approx(-force, abs=1e-4)  # N, of 1 N and more


def irvine(stretch: float, end: tuple[float, float], s: np.ndarray) -> np.ndarray:
    """(k, 2) [m] x and z of the elastic catenary of 1 m that weighs 1 N."""

    def at(H: float, V: float, s: np.ndarray) -> np.ndarray:
        up = V + s
        x = H * s / stretch + H * (np.arcsinh(up / H) - np.arcsinh(V / H))
        z = (V * s + s**2 / 2) / stretch + np.hypot(H, up) - np.hypot(H, V)
        return np.stack([x, z], axis=-1)

    chord = np.hypot(*end)
    tension = max(0.5, stretch * (chord - 1))
    guess = [tension * end[0] / chord, tension * end[1] / chord - 0.5]
    found = root(lambda n: at(n[0], n[1], np.array(1.0)) - end, guess, tol=1e-14)
    assert np.abs(found.fun).max() < 1e-12
    return at(*found.x, s)


@pytest.mark.parametrize(("stretch", "end"), [(10.0, (0.7, 0.0)), (3.0, (0.5, -0.7)), (50.0, (0.84, 0.63)), (4.0, (1.2, 1.6))])
def test_a_soft_elastic_rod_between_hinges_is_the_elastic_catenary(stretch: float, end: tuple[float, float]) -> None:
    """The difference falls with EI, by which hinges change nothing but the curvature at the ends."""
    gaps = []
    for bending in (1e-5, 1e-6):
        shape = answer(pose(elastic(bending, stretch), held(end, Hold.HINGE)), tolerance=1e-7)
        assert shape.outcome is Outcome.CONVERGED, shape.sentence
        gaps.append(np.linalg.norm(shape.nodes[:, [0, 2]] - irvine(stretch, end, shape.s), axis=1).max())
    assert gaps[1] < 5e-5  # m; measured 1e-7 to 2.8e-5
    assert gaps[1] < 0.3 * gaps[0]


def test_the_elastic_catenary_is_in_balance_step_by_step() -> None:
    """Second derivation: the tension that stretches every step has one horizontal part and a vertical one that carries the weight."""
    stretch, end, s = 3.0, (0.5, -0.7), np.linspace(0.0, 1.0, 20_001)
    curve = irvine(stretch, end, s)
    steps = np.linalg.norm(np.diff(curve, axis=0), axis=1) / np.diff(s)
    tension = stretch * (steps - 1)
    slope = np.diff(curve, axis=0) / np.linalg.norm(np.diff(curve, axis=0), axis=1)[:, None]
    horizontal = tension * slope[:, 0]
    assert np.ptp(horizontal) < 1e-6  # N; the horizontal force is the same everywhere
    assert np.diff(tension * slope[:, 1]) == pytest.approx(np.diff(s)[1:], rel=1e-3)  # the vertical one grows by the weight
