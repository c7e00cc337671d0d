"""Closed forms that the solver does not use, or that it solves in another way: catenary, elastica, thresholds.

Catenary: Irvine 1981, "Cable structures", ch. 1. With the horizontal force H and the vertical force V(s) = V_0 + w s,
x(s) = H s / EA + H / w (asinh(V / H) - asinh(V_0 / H)) and z(s) = (V_0 + w s / 2) s / EA + (sqrt(H^2 + V^2) - sqrt(H^2 + V_0^2)) / w.
Elastica between clamps: Love 1944, secs. 262-263, 2 E(m) / K(m) - 1 = c / L, pressed by 16 K(m)^2 EI / L^2.
Column under its own weight: Greenhill 1881, w L^3 / EI = 9/4 j^2 with the first zero j of J_{-1/3}.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.optimize import brentq, root
from scipy.special import ellipe, ellipk, jv


@dataclass(frozen=True)
class Catenary:
    """A cable without bending that hangs from the origin, in the plane x-z."""

    horizontal: float  # N
    vertical: float  # N, at the start, upwards along the cable
    weight: float  # N/m
    stretch: float = math.inf  # N

    def at(self, s: np.ndarray | float) -> np.ndarray:
        """(..., 3) [m] Places at arc lengths."""
        s = np.asarray(s, dtype=float)
        H, V0, V = self.horizontal, self.vertical, self.vertical + self.weight * s
        x = H * s / self.stretch + H / self.weight * (np.arcsinh(V / H) - np.arcsinh(V0 / H))
        z = (V0 + self.weight * s / 2) * s / self.stretch + (V - V0) * (V + V0) / self.weight / (np.hypot(H, V) + np.hypot(H, V0))
        return np.stack([x, np.zeros_like(x), z], axis=-1)


def catenary(span: float, rise: float, length: float, weight: float) -> Catenary:
    """The catenary from the origin to (span, 0, rise) [m], by sinh(a) / a = sqrt(L^2 - h^2) / span with brentq, a = w span / 2H."""
    flat = math.sqrt(length**2 - rise**2)
    excess = (length**2 - rise**2 - span**2) / (span * (flat + span))
    a = brentq(lambda a: _sinh_excess(a) - excess, 1e-8, 60.0, xtol=1e-15, rtol=1e-14)
    H = weight * span / (2 * a)
    mean = rise * math.hypot(H / flat, weight / 2)
    return Catenary(H, mean - weight * length / 2, weight)


def _sinh_excess(a: float) -> float:
    """The value of sinh(a) / a - 1, exact for small a too."""
    return math.sinh(a) / a - 1 if a > 0.1 else a**2 / 6 * (1 + a**2 / 20 * (1 + a**2 / 42 * (1 + a**2 / 72)))


def elastic_catenary(span: float, rise: float, length: float, weight: float, stretch: float) -> Catenary:
    """The elastic catenary from the origin to (span, 0, rise) [m], by scipy's root."""
    chord = math.hypot(span, rise)
    pull = max(stretch * (chord / length - 1), weight * length)
    first = np.array([math.log(pull * span / chord), pull * rise / chord - weight * length / 2])
    if chord < length:
        rigid = catenary(span, rise, length, weight)
        first = np.array([math.log(min(rigid.horizontal, stretch)), rigid.vertical])

    def miss(unknown: np.ndarray) -> np.ndarray:
        end = Catenary(math.exp(unknown[0]), unknown[1], weight, stretch).at(length)
        return np.array([end[0] - span, end[2] - rise])

    solved = root(miss, first, tol=1e-14)
    if not np.abs(solved.fun).max() < 1e-9 * length:
        raise ArithmeticError(f"the reference does not converge: {solved.message}")
    return Catenary(math.exp(solved.x[0]), float(solved.x[1]), weight, stretch)


def elastica_modulus(chord: float) -> float:
    """The parameter m = k^2 of the elastica of 1 m between clamps at a distance `chord` [m]."""
    return float(brentq(lambda m: 2 * ellipe(m) / ellipk(m) - 1 - chord, 1e-15, 0.9, xtol=1e-16))


def elastica_thrust(chord: float) -> float:
    """[N] For EI = 1 N m^2 and L = 1 m."""
    return float(16 * ellipk(elastica_modulus(chord)) ** 2)


def elastica_amplitude(chord: float) -> float:
    """[m] Distance of the middle from the chord, for L = 1 m."""
    modulus = elastica_modulus(chord)
    return float(np.sqrt(modulus) / ellipk(modulus))


@cache
def greenhill() -> float:
    """The value of w L^3 / EI at which a column gives way under its own weight, 7.8373."""
    return float(9 / 4 * brentq(lambda x: jv(-1 / 3, x), 1.5, 2.2, xtol=1e-14) ** 2)
