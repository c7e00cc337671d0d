"""Catenaries in the x-z plane by scipy's root finding: what cables without bending are compared with."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq


def catenary(start: np.ndarray, end: np.ndarray, length: float, s: np.ndarray) -> np.ndarray:
    """Places (n, 2) [m] at arc lengths s of a catenary between two points (2,) [m]: sqrt(L^2 - v^2) = 2 a sinh(u / 2a)."""
    across, rise = end - start
    side = 1.0 if across >= 0.0 else -1.0
    across = abs(across)
    shape = brentq(lambda q: np.sinh(q) / q - np.sqrt(length**2 - rise**2) / across, 1e-9, 500.0, xtol=1e-15, rtol=1e-14)
    a = across / (2 * shape)
    first = a * np.arctanh(rise / length) - across / 2  # of the start, from the lowest place
    along = a * np.arcsinh(np.sinh(first / a) + s / a)
    return start + np.column_stack([side * (along - first), a * (np.cosh(along / a) - np.cosh(first / a))])


def tension_at_ends(start: np.ndarray, end: np.ndarray, length: float, weight: float) -> tuple[float, float]:
    """Tensions [N] at both ends, from weight per length [N/m]."""
    across, rise = abs(end[0] - start[0]), end[1] - start[1]
    shape = brentq(lambda q: np.sinh(q) / q - np.sqrt(length**2 - rise**2) / across, 1e-9, 500.0, xtol=1e-15, rtol=1e-14)
    a = across / (2 * shape)
    first = a * np.arctanh(rise / length) - across / 2
    return weight * a * float(np.cosh(first / a)), weight * a * float(np.cosh((first + across) / a))
