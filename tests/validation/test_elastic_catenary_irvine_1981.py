"""The elastic cable without stiffness, against its differential equation and against Irvine's closed form as printed.

Source: Irvine 1981, "Cable structures", MIT Press, ch. 1, the elastic catenary.

Claim: with the horizontal force H, the vertical force V at the far end, the whole weight W and the unstretched length L, the
material point at s, here counted from the far end, is at
x(s) = H s / EA + (H L / W) (asinh(V / H) - asinh((V - W s / L) / H)) towards the near end, and
z(s) = (W s / EA) (V / W - s / 2L) + (H L / W) (sqrt(1 + (V / H)^2) - sqrt(1 + ((V - W s / L) / H)^2)) below the far one.

Three derivations that share nothing but Hooke's law and the weight: those equations, solved here with 50 digits by Newton's
method on both unknowns; `scipy.integrate.solve_bvp` on r' = (1 / T + 1 / EA) n, n' = w e_z; and the energy, whose derivatives by
the place of an end are the forces there (Castigliano).
"""

from __future__ import annotations

import math
from decimal import Decimal, localcontext
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from shape_server.catenary import Piece, hang_elastic

DIGITS = 50
WEIGHT = 1.0  # N/m, on 1 m of cable
LOAD = np.array([0.0, 0.0, -WEIGHT])
TOLERANCE = 1e-10  # of solve_bvp, relative residual per interval
CASES = {  # place of the far end [m] in the plane x-z, stretch EA [N]
    "slack": ((0.7, 0.0), 10.0),
    "slack, unequal heights": ((0.6, 0.4), 3.0),
    "slack, falling": ((0.5, -0.7), 3.0),
    "50 times as long as its chord": ((0.02, 0.0), 20.0),
    "taut": ((1.0, 0.0), 1e3),
    "taut, rising": ((0.8, 0.6), 1e5),
    "taut but for 1e-8": ((0.8 / (1 + 1e-8), -0.6 / (1 + 1e-8)), 1e4),
    "stretched by 1e-6": ((1 + 1e-6, 0.0), 1e6),
    "stretched by 5 %": ((0.84, 0.63), 50.0),
    "stretched by 100 %": ((1.2, 1.6), 4.0),
    "softer than its weight": ((0.5, 0.3), 0.2),
}
each_case = pytest.mark.parametrize("name", CASES)
S = np.linspace(0.0, 1.0, 41)


def hung(name: str, s: np.ndarray = S) -> Piece:
    (x, z), stretch = CASES[name]
    return hang_elastic(np.zeros(3), np.array([x, 0.0, z]), 1.0, LOAD, stretch, s)


def asinh(x: Decimal) -> Decimal:
    size = abs(x)
    return ((size + (size * size + 1).sqrt()).ln()).copy_sign(x)


def printed(H: Decimal, V: Decimal, stretch: Decimal, s: Decimal) -> tuple[Decimal, Decimal]:
    """Irvine's x(s) and z(s) [m] for L = 1 m and W = 1 N, s from the far end."""
    below = V - s
    x = H * s / stretch + H * (asinh(V / H) - asinh(below / H))
    z = s / stretch * (V - s / 2) + H * ((1 + (V / H) ** 2).sqrt() - (1 + (below / H) ** 2).sqrt())
    return x, z


@cache
def irvine(name: str) -> tuple[Decimal, Decimal]:
    """H and V [N] that meet the ends, to 30 digits: Newton's method, its derivatives by differences, from the shape under test."""
    (x, z), stretch = CASES[name]
    EA, d, r = Decimal(stretch), Decimal(x), Decimal(z)
    H, V = (Decimal(float(hung(name).end_force[axis])) for axis in (0, 2))
    with localcontext() as digits:
        digits.prec = DIGITS
        for _ in range(8):
            here, step = printed(H, V, EA, Decimal(1)), H * Decimal("1e-22")
            by_H, by_V = (printed(H + step, V, EA, Decimal(1)), printed(H, V + step, EA, Decimal(1)))
            a, b, c, e = ((other[i] - here[i]) / step for i in (0, 1) for other in (by_H, by_V))
            left, up = d - here[0], r - here[1]
            H, V = H + (e * left - b * up) / (a * e - b * c), V + (a * up - c * left) / (a * e - b * c)
        assert max(abs(left), abs(up)) < Decimal("1e-30")
    return H, V


@each_case
def test_the_forces_are_those_of_the_printed_equations(name: str) -> None:
    H, V = irvine(name)
    assert hung(name).end_force == pytest.approx([float(H), 0.0, float(V)], rel=conditioned(name))  # measured 0 to 6e-14


@each_case
def test_the_cable_lies_where_the_printed_equations_put_it(name: str) -> None:
    H, V = irvine(name)
    (x, z), stretch = CASES[name]
    with localcontext() as digits:
        digits.prec = DIGITS
        rows = [printed(H, V, Decimal(stretch), 1 - Decimal(float(s))) for s in S]
    wanted = np.array([[x - float(row[0]), 0.0, z - float(row[1])] for row in rows])
    assert np.abs(hung(name).nodes - wanted).max() < 1e-14  # m; measured 1.1e-16 to 6.9e-16


@each_case
def test_the_cable_solves_its_differential_equation(name: str) -> None:
    (x, z), stretch = CASES[name]
    piece = hung(name, np.linspace(0.0, 1.0, 401))

    def rhs(s: np.ndarray, y: np.ndarray, n: np.ndarray) -> np.ndarray:
        tension = np.hypot(n[0], n[1] + WEIGHT * s)
        return np.vstack([n[0] * (1 / tension + 1 / stretch), (n[1] + WEIGHT * s) * (1 / tension + 1 / stretch)])

    def ends(a: np.ndarray, b: np.ndarray, n: np.ndarray) -> np.ndarray:
        return np.array([*a, b[0] - x, b[1] - z])

    s = np.linspace(0.0, 1.0, 401)
    rough = np.vstack([x * s, z * s - 0.2 * np.sin(math.pi * s)])
    force = 1.05 * piece.end_force[0], 1.05 * (piece.end_force[2] - WEIGHT)
    found = solve_bvp(rhs, ends, s, rough, p=np.array(force), tol=TOLERANCE, max_nodes=100_000)
    assert found.success, found.message
    assert np.abs(piece.nodes[:, [0, 2]] - found.sol(s).T).max() < 1e-12  # m; measured 5e-16 to 3.3e-14
    assert [piece.end_force[0], piece.end_force[2] - WEIGHT] == pytest.approx(found.p, rel=1e-10)  # measured 6e-15 to 1.5e-12


@each_case
def test_the_stretched_length_is_the_integral_of_the_tension(name: str) -> None:
    """L + (1/EA) int T ds, in closed form from the forces at the ends, against the length of the curve."""
    s = np.linspace(0.0, 1.0, 20_001)
    piece, stretch = hung(name, s), CASES[name][1]
    H, first = piece.end_force[0], piece.end_force[2] - WEIGHT

    def primitive(V: float) -> float:
        return 0.5 * (V * math.hypot(H, V) + H * H * math.asinh(V / H))

    stretched = 1 + (primitive(first + WEIGHT) - primitive(first)) / WEIGHT / stretch
    assert np.linalg.norm(np.diff(piece.nodes, axis=0), axis=1).sum() == pytest.approx(
        stretched, rel=1e-6
    )  # measured 1.1e-7, chords for arcs where it hangs deep


@each_case
def test_the_forces_are_the_derivatives_of_the_energy(name: str) -> None:
    """Castigliano: elastic energy plus that of the weight, by the place of the far end, is the force there."""
    (x, z), stretch = CASES[name]
    points, weights = np.polynomial.legendre.leggauss(12)
    edges = 0.5 - 0.5 * np.cos(np.linspace(0.0, math.pi, 201))
    s = ((edges[:-1] + edges[1:])[:, None] / 2 + np.diff(edges)[:, None] / 2 * points).ravel()
    step = 1e-4 if abs(math.hypot(x, z) - 1) > 1e-2 else 1e-10

    def energy(x: float, z: float) -> float:
        piece = hang_elastic(np.zeros(3), np.array([x, 0.0, z]), 1.0, LOAD, stretch, s)
        density = (piece.tension**2 / (2 * stretch) + WEIGHT * piece.nodes[:, 2]).reshape(-1, 12)
        return float((np.diff(edges) / 2 * (density @ weights)).sum())

    slopes = [(energy(x + a, z + b) - energy(x - a, z - b)) / (2 * step) for a, b in ((step, 0.0), (0.0, step))]
    assert slopes == pytest.approx(list(hung(name).end_force[[0, 2]]), rel=1e-6, abs=1e-8)  # measured 1.3e-7, 1.6e-9; differences


def conditioned(name: str) -> float:
    """Relative accuracy of a tension: the last bit of a place, over the slack or the compliance that gives way to it."""
    (x, z), stretch = CASES[name]
    return 1e-14 + 4e-16 / max(abs(math.hypot(x, z) - 1), stretch ** (-2 / 3))
