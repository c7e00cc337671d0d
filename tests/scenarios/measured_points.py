"""Makes `scenarios/paper/fig_12_points.csv`: points on a cable as a photo would give them, by scipy's `solve_bvp` and not by our solver.

The photos of the paper are not to be had. In their place stands a cable in its plane, with M = EI (theta' - k(s)) and a natural curvature k
that it was given by plastic bending beside the left gripper, which the simulation knows nothing of:

    x' = cos theta,   z' = sin theta,   theta' = M / EI + k(s),   M' = H sin theta - (V + w s) cos theta

with (H, V + w s) the force [N] of what follows. Position and inclination are given at both ends of each part. To each of 25 places along
the curve noise of half a millimetre is added. Run this file to make the points anew; `test_paper_fig_12.py` compares.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.integrate import solve_bvp

FILE = Path(__file__).parents[2] / "scenarios" / "paper" / "fig_12_points.csv"
BENDING, WEIGHT = 0.02, 0.09 * 9.81  # N m^2, N/m
PLASTIC = 2.7  # 1/m, most of the curvature that is left where it was bent too far
PLACE, WIDTH = 0.18, 0.06  # m, where that is along the cable
NOISE = 5e-4  # m
COUNT = 25  # points of a curve
LEFT, RIGHT, OBSTACLE = (0.0, 0.0), (0.95, 0.0), (0.62, -0.25)  # x and z, m
LENGTH, TOUCHED = 1.2, 0.76  # m


def part(first: tuple[float, float], last: tuple[float, float], start: float, end: float, s: np.ndarray, plastic: float) -> np.ndarray:
    """Places (n, 2) [m] at arc lengths s of the part between two, level at both of its ends."""
    span, across = end - start, last[0] - first[0]

    def slopes(u: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        along = span * u
        bent = plastic * np.exp(-(((start + along - PLACE) / WIDTH) ** 2))
        turn = p[0] * np.sin(y[2]) - (p[1] + WEIGHT * along) * np.cos(y[2])
        return span * np.vstack([np.cos(y[2]), np.sin(y[2]), y[3] / BENDING + bent, turn])

    def ends(a: np.ndarray, b: np.ndarray, _: np.ndarray) -> np.ndarray:
        return np.array([a[0] - first[0], a[1] - first[1], a[2], b[0] - last[0], b[1] - last[1], b[2]])

    u = np.linspace(0.0, 1.0, 400)
    size = 2.0 * np.sqrt(1.0 - across / span)  # of the slope, -size sin(2 pi u)
    slope = -size * np.sin(2 * np.pi * u)
    guess = np.vstack([first[0] + across * u, first[1] + (last[1] - first[1]) * u, slope, BENDING * np.gradient(slope, span * u)])
    found = solve_bvp(slopes, ends, u, guess, p=[1.0, -0.5 * WEIGHT * span], tol=1e-9, max_nodes=100_000)
    assert found.status == 0, found.message
    return np.asarray(found.sol((s - start) / span)[:2].T)


def curves(plastic: float = PLASTIC, noise: float = NOISE) -> dict[str, np.ndarray]:
    """Points (n, 3) of curve a, held at its ends, and of curve b, with the obstacle: x [m], z [m] and where along the cable [m]."""
    random = np.random.default_rng(12)
    s = np.linspace(0.0, LENGTH, COUNT + 2)[1:-1]
    before = s <= TOUCHED
    simple = part(LEFT, RIGHT, 0.0, LENGTH, s, plastic)
    first = part(LEFT, OBSTACLE, 0.0, TOUCHED, s[before], plastic)
    last = part(OBSTACLE, RIGHT, TOUCHED, LENGTH, s[~before], plastic)
    exact = {"a": simple, "b": np.vstack([first, last])}
    return {name: np.column_stack([places + noise * random.standard_normal(places.shape), s]) for name, places in exact.items()}


def text() -> str:
    """The file."""
    rows = [f"{name},{x:.5f},{z:.5f},{s:.4f}" for name, points in curves().items() for x, z, s in points]
    return "\n".join(["curve,x [m],z [m],s [m]", *rows]) + "\n"


if __name__ == "__main__":
    FILE.write_text(text(), encoding="utf-8")
