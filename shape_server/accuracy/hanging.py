"""Independent reference of a cable without bending between two points: the catenary in its textbook form.

With the horizontal distance d and the difference in height h, sqrt(L^2 - h^2) = 2 a sinh(d / 2 a) gives a, found by bracketing; then
z = a cosh((x - x0) / a) with x0 = d / 2 - a artanh(h / L).

Source: H. M. Irvine, "Cable structures", MIT Press 1981, section 1.2.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq


def hanging(first: np.ndarray, last: np.ndarray, length: float, s: np.ndarray) -> np.ndarray:
    """Points (n, 3) [m] at arc lengths s (n,) [m] between two points (3,) [m] that are not one above the other; gravity along -z."""
    level, rise = last[:2] - first[:2], float(last[2] - first[2])
    distance = float(np.linalg.norm(level))
    slack = math.sqrt(length**2 - rise**2) / distance
    b = brentq(lambda b: math.sinh(b) / b - slack, 1e-8, 500.0, xtol=1e-15, rtol=8.9e-16)
    a = distance / (2.0 * b)
    lowest = 0.5 * distance - a * math.atanh(rise / length)
    start = a * math.sinh(-lowest / a)
    x = lowest + a * np.arcsinh((start + s) / a)
    z = np.hypot(a, start + s) - math.hypot(a, start)
    points: np.ndarray = np.column_stack([np.outer(x, level / distance), z]) + first
    return points
