"""The gradient cable against its own equation, against its energy, and against the rod that it stands for.

Sources: Papargyri-Beskou, Tsepoura, Polyzos and Beskos 2003, "Bending and stability analysis of gradient elastic beams", Int. J. Solids
Struct. 40, 385-400 (the equation of sixth order with its classical and double moments); Papacharalampopoulos, Makris, Bitzios and
Chryssolouris 2016 (the cable with a micro-structure length); Kierzenka & Shampine 2001 (the algorithm of `solve_bvp`).

Claim: with the horizontal force that makes it as long as it is, the cable solves H y'' - EI y'''' + EI l^2 y^(6) = w L / span with clamps
(y, y' given, y''' = 0), hinges (y given, no moment, y''' = 0) or one of each. The conditions that are not given are those that make the
energy least: the method of Ritz, which knows only y and y', finds the same curve. Against the geometrically exact rod with
the energy EI/2 (kappa^2 + l^2 kappa_s^2) it is off by what it predicts, in second order of the slope.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from heavy_elastica import planar
from numpy.polynomial import Legendre
from scipy.integrate import solve_bvp

from shape_server.gradient_cable import GradientShape, NotCovered, lay

TOLERANCE = 1e-10  # of solve_bvp, relative residual per interval
WEIGHT = np.array([0.0, 0.0, -1.0])  # N/m, on 1 m of cable
HOLDS = {"clamped": (0.1, -0.25), "hinged": (None, None), "mixed": (0.2, None), "mixed, the other way": (None, 0.3)}  # slopes [rad]
MICRO = (0.0, 0.02, 0.03, 0.2)  # m; g is 0.06, so that these are exponentials, waves, and a layer as long as the cable
S = np.linspace(0.0, 1.0, 101)
each_hold = pytest.mark.parametrize("hold", HOLDS)
each_micro = pytest.mark.parametrize("micro", MICRO)


@dataclass(frozen=True)
class Held:
    """One metre of cable that weighs 1 N, in the plane x-z from the origin."""

    bending: float  # N m^2
    micro: float  # m
    end: tuple[float, float]  # m
    slopes: tuple[float | None, float | None]  # rad, None at a hinge

    def laid(self, s: np.ndarray = S) -> GradientShape:
        tangents = [None if a is None else np.array([math.cos(a), 0.0, math.sin(a)]) for a in self.slopes]
        return lay(np.zeros(3), np.array([self.end[0], 0.0, self.end[1]]), 1.0, WEIGHT, self.bending, self.micro, *tangents, s)


def level(hold: str, micro: float, bending: float = 3e-3) -> Held:
    return Held(bending, micro, (0.95, 0.0), HOLDS[hold])


@pytest.mark.sampled(3)
@each_hold
@each_micro
def test_the_curve_solves_the_equation_under_its_conditions(hold: str, micro: float) -> None:
    """On a level chord, where EI and l are those of the equation; unknowns y, y' .. scaled by powers of g."""
    held, shape = level(hold, micro), level(hold, micro).laid()
    g, bar = math.sqrt(held.bending / shape.horizontal), 1 / held.end[0]
    count, ratio = 4 if micro == 0 else 6, (micro / g) ** 2

    def rhs(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        load = bar * g / shape.horizontal
        last = y[2] - load if micro == 0 else (load - y[2] + y[4]) / ratio
        return np.vstack([*y[1:], last]) / g

    def at_end(y: np.ndarray, slope: float | None) -> list[float]:
        moment = y[2] - ratio * y[4] if micro else y[2]
        return [y[0], moment if slope is None else y[1] - math.tan(slope), *([y[3]] if micro else [])]

    found = solve_bvp(
        rhs,
        lambda a, b: np.array(at_end(a, held.slopes[0]) + at_end(b, held.slopes[1])),
        np.linspace(0.0, held.end[0], 3001),
        np.zeros((count, 3001)),
        tol=TOLERANCE,
        max_nodes=100_000,
    )
    assert found.success, found.message
    x, y = shape.nodes[:, 0], found.sol(shape.nodes[:, 0])
    assert np.abs(shape.nodes[:, 2] - g * y[0]).max() < 1e-13  # m; measured 2e-16 to 2e-15
    moment = held.bending / g * (y[2] - ratio * y[4] if micro else y[2])
    assert np.abs(shape.moment - moment).max() < 1e-13  # N m; measured 1e-16 to 1e-15
    points, weights = np.polynomial.legendre.leggauss(400)
    slope = found.sol(held.end[0] / 2 * (1 + points))[1]
    assert held.end[0] / 2 * (np.sqrt(1 + slope**2) @ weights) == pytest.approx(1.0, abs=1e-13)  # measured 2e-15
    assert np.all(np.diff(x) > 0)


@each_hold
@each_micro
def test_the_curve_has_the_least_energy_of_all_that_meet_the_ends(hold: str, micro: float) -> None:
    """Ritz: polynomials up to degree 40, subject to y and, at clamps, y' only; the natural conditions come out by themselves."""
    held, shape, degree = level(hold, micro), level(hold, micro).laid(), 40
    span, H = held.end[0], shape.horizontal
    basis = [Legendre.basis(j, domain=[0.0, span]) for j in range(degree + 1)]
    nodes, weights = np.polynomial.legendre.leggauss(60)
    x, w = span / 2 * (1 + nodes), span / 2 * weights
    table = [np.array([p.deriv(order)(x) if order else p(x) for p in basis]) for order in range(4)]
    stiffness = sum(c * (t * w) @ t.T for c, t in ((H, table[1]), (held.bending, table[2]), (held.bending * micro**2, table[3])))
    load = -(table[0] @ w) / span
    rows, values = [], []
    for at, slope in ((0.0, held.slopes[0]), (span, held.slopes[1])):
        rows.append([p(at) for p in basis])
        values.append(0.0)
        if slope is not None:
            rows.append([p.deriv()(at) for p in basis])
            values.append(math.tan(slope))
    border = np.array(rows)
    system = np.block([[stiffness, border.T], [border, np.zeros((len(rows), len(rows)))]])
    scale = 1 / np.sqrt(np.append(np.diag(stiffness) + 1.0, np.ones(len(rows))))
    sizes = scale * np.linalg.solve(system * np.outer(scale, scale), scale * np.concatenate([load, values]))
    curve = sum(size * p(shape.nodes[:, 0]) for size, p in zip(sizes, basis, strict=False))
    assert np.abs(curve - shape.nodes[:, 2]).max() < 1e-10  # m; measured 1e-15, and 8e-12 where degree 40 is just enough


def exact(held: Held, shape: GradientShape, s: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes (k, 2), tension (k,) and moments (2,) at the ends of the geometrically exact rod.

    M = EI (kappa - l^2 kappa_ss), M' = n_x sin - n_z cos.
    """
    EI, l, scale = held.bending, held.micro, min(math.sqrt(held.bending / shape.horizontal), 0.3)

    def rhs(s: np.ndarray, y: np.ndarray, n: np.ndarray) -> np.ndarray:
        turn = (n[0] * np.sin(y[2]) - (n[1] + s) * np.cos(y[2])) / EI
        rows = [np.cos(y[2]), np.sin(y[2]), y[3] / scale]
        return np.vstack(
            [*rows, *((y[4] / scale, y[5] / scale, (y[4] / scale - scale * turn) * (scale / l) ** 2) if l else (scale * turn,))]
        )

    def at_end(y: np.ndarray, slope: float | None) -> list[float]:
        moment = y[3] - (l / scale) ** 2 * y[5] if l else y[3]
        return [moment if slope is None else y[2] - slope, *([y[4]] if l else [])]

    def ends(a: np.ndarray, b: np.ndarray, n: np.ndarray) -> np.ndarray:
        return np.array([*a[:2], b[0] - held.end[0], b[1] - held.end[1], *at_end(a, held.slopes[0]), *at_end(b, held.slopes[1])])

    slope = np.arctan2(np.gradient(shape.nodes[:, 2], s), np.gradient(shape.nodes[:, 0], s))
    rows = [shape.nodes[:, 0], shape.nodes[:, 2], slope, scale * shape.curvature]
    for _ in range(2 if l else 0):
        rows.append(scale * np.gradient(rows[-1], s))
    force = np.array([shape.horizontal, -shape.start_force[2]])
    found = solve_bvp(rhs, ends, s, np.array(rows), p=force, tol=tolerance, max_nodes=50_000)
    assert found.success, found.message
    x, z, slope, *bend = found.sol(s)
    moment = EI / scale * (bend[0] - (l / scale) ** 2 * bend[2] if l else bend[0])
    return np.column_stack([x, z]), found.p[0] * np.cos(slope) + (found.p[1] + s) * np.sin(slope), moment[[0, -1]]


def graded(layer: float) -> np.ndarray:
    """Arc lengths that resolve layers of that width at both ends of one metre."""
    count = max(2, math.ceil(math.log2(1 / layer)))
    panels = np.append(0.0, 0.5 * 2.0 ** np.arange(-count, 1))
    half = np.concatenate([np.linspace(a, b, 12, endpoint=False) for a, b in pairwise(panels)])
    return np.concatenate([half, [0.5], 1 - half[::-1]])


@dataclass(frozen=True)
class Errors:
    """True errors of a shape."""

    nodes: float  # m
    tension: float  # N
    moments: float  # N m, at the ends
    plain_moments: float  # N m, of the moments at the ends that the equation gives


def errors(held: Held, tolerance: float = 1e-8) -> tuple[GradientShape, Errors]:
    """The shape, and its true errors."""
    g = math.sqrt(held.bending / held.laid().horizontal)
    s = graded(min(g, held.micro or g, 0.5 * math.sqrt(g * (held.micro or g))))
    shape = held.laid(s)
    nodes, tension, moments = exact(held, shape, s, tolerance)
    return shape, Errors(
        nodes=float(np.linalg.norm(shape.nodes[:, [0, 2]] - nodes, axis=1).max()),
        tension=float(np.abs(shape.tension - tension).max()),
        moments=float(np.abs(np.array([shape.start_moment, shape.end_moment]) - moments).max()),
        plain_moments=float(np.abs(shape.moment[[0, -1]] - moments).max()),
    )


@pytest.mark.parametrize("hold", ["clamped", "mixed"])
def test_the_rod_solved_here_is_the_elastica_of_the_other_tests(hold: str) -> None:
    held = level(hold, 0.0)
    shape = held.laid()
    slopes = HOLDS[hold]
    other = planar(
        bending=held.bending, weight=1.0, length=1.0, start=(0.0, 0.0, slopes[0] or 0.0), end=(0.95, 0.0, slopes[1]),
        slope=lambda s: np.interp(s, S, np.arctan2(np.gradient(shape.nodes[:, 2]), np.gradient(shape.nodes[:, 0]))),
        force=(shape.horizontal, -shape.start_force[2]),
    )  # fmt: skip
    assert np.abs(exact(held, shape, S, TOLERANCE)[0] - other.positions(S)[:, [0, 2]]).max() < 1e-9


@each_hold
@pytest.mark.parametrize("micro", [0.0, 0.03])
def test_the_error_against_the_rod_is_the_predicted_one(hold: str, micro: float) -> None:
    for held in (level(hold, micro), Held(1e-4, micro, (0.8, 0.5), (0.4, 0.7) if hold == "clamped" else (None, None))):
        shape, true = errors(held)
        assert true.nodes < shape.error < 10 * true.nodes  # measured 1.2 where it hangs, to 8.1 where clamps bend it
        assert true.tension < shape.tension_error < 15 * true.tension  # measured 2.1 to 12


@pytest.mark.parametrize("micro", [0.0, 0.02])
def test_the_error_is_of_third_order_in_the_slope(micro: float) -> None:
    """All slopes halved, and so the slack quartered: the share of the sag that the nodes are off falls to a quarter."""
    found = []
    for share in (1.0, 0.5, 0.25):
        held = Held(3e-3 / share, micro, (1 / (1 + 0.04 * share**2), 0.0), (-0.2 * share, 0.2 * share))  # H grows as 1 / share
        shape, true = errors(held, TOLERANCE)
        found.append((true.nodes, shape.error))
    for first, second in ((0, 1), (1, 2)):
        assert found[first][0] / found[second][0] == pytest.approx(8.0, rel=0.1)  # measured 7.5 and 7.9
        assert found[first][1] / found[second][1] == pytest.approx(8.0, rel=0.1)


@cache
def audited() -> np.ndarray:
    """(k, 6) Predicted and true error of nodes [m], of tension [N], errors of moments at clamps [N m], random cables; seeded."""
    rng, found = np.random.default_rng(41), []
    while len(found) < 150:
        excess, incline = 10 ** rng.uniform(-4, -0.8), rng.choice([0.0, rng.uniform(-1.04, 1.04)])
        bending, chord = 10 ** rng.uniform(-7, -1), 1 / (1 + excess)
        hang = 4 * math.sqrt(0.375 * excess) * math.cos(incline)
        slopes = [None if rng.random() < 0.3 else incline + sign * hang + rng.choice([0.0, 0.5 * rng.normal()]) for sign in (-1, 1)]
        micro = rng.choice([0.0, 10 ** rng.uniform(-1.5, 0.5) * math.sqrt(bending * math.sqrt(24 * excess))])
        if any(slope is not None and abs(slope) > 1.3 for slope in slopes):
            continue
        held = Held(bending, micro, (chord * math.cos(incline), chord * math.sin(incline)), (slopes[0], slopes[1]))
        try:
            shape, true = errors(held, 1e-6)
        except NotCovered:
            continue
        found.append((shape.error, true.nodes, shape.tension_error, true.tension, true.moments, true.plain_moments))
    return np.array(found)


@pytest.mark.slow
@pytest.mark.parametrize(("predicted", "true"), [(0, 1), (2, 3)], ids=["nodes", "tension"])
def test_over_random_cables_the_prediction_is_seldom_below_the_truth_and_not_far_above(predicted: int, true: int) -> None:
    ratio = audited()[:, predicted] / audited()[:, true]
    assert (ratio >= 1).mean() >= 0.95  # measured 1.00 both
    assert np.median(ratio) < 3.0  # measured 1.55 and 2.05


@pytest.mark.thorough
def test_what_the_ends_bear_of_what_is_left_out_makes_their_moments_more_exact() -> None:
    """Of those cables that a moment holds; hinges have none."""
    moments, plain = audited()[:, 4:].T
    held = plain > 0
    ratio = moments[held] / plain[held]
    assert np.median(ratio) < 0.4  # measured 0.24; the 90th percentile of the error falls from 4.3e-3 to 1.1e-3 N m
    assert (ratio > 1.0).mean() < 0.15  # measured 0.09
