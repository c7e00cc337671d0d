"""The catenary: a cable without bending, hanging between two points, rigid or elastic, in closed form.

The part beyond arc length s pulls on the part before it with a horizontal force H [N], the same everywhere, and with a
vertical force V = V_0 + w s [N] that carries the weight w [N/m]; the tension is T = sqrt(H^2 + V^2). The cable stretches by
T / EA, so that (Irvine 1981, "Cable structures", MIT Press, ch. 1, with s counted from the other end)

    x(s) = H s / EA + (H / w) (asinh(V / H) - asinh(V_0 / H))                                 [m]
    y(s) = (V^2 - V_0^2) / 2 w EA + (sqrt(H^2 + V^2) - sqrt(H^2 + V_0^2)) / w                 [m]

Written here so that nothing cancels: a taut cable, a slack one and one that hangs double (H = 0) share `_piece`.

Two unknowns, H and V_0, meet the span d and the rise r of the ends. Let lengths be in units of L and forces of w L, e = w L / EA,
and call asinh(V_1 / H), asinh(V_0 / H) = m +- u at the two ends. V_1 - V_0 = 1 gives H = 1 / (2 cosh m sinh u), the mean
vertical force is tanh m / (2 tanh u), and the equations above become

    d = (u + e/2) / (cosh m sinh u),      r = c tanh m,      c = 1 + (e/2) coth u.

m drops out, and one equation is left for u; its left side falls with u, so that there is exactly one shape:

    (1 + e/2u) sqrt(c^2 - r^2) / (c sinh(u) / u) = d       rigid (e = 0):  sinh(u) / u = sqrt(1 - r^2) / d

Moments are left out, which moves a cable that bends by 1.2 sqrt(EI / T) beside a clamp. The rigid cable leaves out that it is longer
by T L / EA, which counts like slack and so matters first where there is little of it. Tails beyond the outermost held points hang
straight down.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from . import catenary_kernels
from .interpreted import interpreted

TAUT = 1e-12  # of the length; a rigid cable with less slack is given this much, so that its tension stays finite
FOLDED = 1e-12  # of the length; ends nearer to one vertical than this hang double, or straight down
STEPS_MAX = 200  # of Newton's method; measured 5 to 12, and up to 54 for a stretched cable beside the vertical
_plain = interpreted({"parameter": catenary_kernels.parameter, "sinh_over": catenary_kernels.sinh_over}, {})
parameter, _sinh_over = _plain["parameter"], _plain["sinh_over"]


@dataclass(frozen=True)
class Piece:
    """One hanging piece of cable at given arc lengths from its first end."""

    nodes: np.ndarray  # (n, 3) m
    tension: np.ndarray  # (n,) N
    start_force: np.ndarray  # (3,) N, on the piece at its first end
    end_force: np.ndarray  # (3,) N, on the piece at its last end
    curvature: np.ndarray  # (n,) 1/m
    strain: np.ndarray  # (n,) share by which the cable is longer than unstretched; zero where it is rigid


@dataclass(frozen=True)
class _Plane:
    """The plane of gravity and chord."""

    weight: float  # N/m
    up: np.ndarray  # (3,)
    side: np.ndarray  # (3,) horizontal, towards the end; zero where the ends lie on one vertical
    span: float  # m, along `side`
    rise: float  # m, along `up`
    chord: float  # m


def hang(start: np.ndarray, end: np.ndarray, length: float, load: np.ndarray, s: np.ndarray) -> Piece:
    """The shape of a rigid piece between two points.

    Args:
        start: (3,) m.
        end: (3,) m, no further from `start` than `length`.
        length: [m].
        load: (3,) [N/m] Weight per metre, not zero.
        s: (n,) [m] Arc lengths asked for.
    """
    plane = _plane(start, end, load)
    span, rise, weight = plane.span, plane.rise, plane.weight
    if span < FOLDED * length:
        return _piece(start, plane, 0.0, -0.5 * weight * (length - rise), length, math.inf, s)
    left = max(length - plane.chord, TAUT * length) * (length + plane.chord)  # L^2 - chord^2
    root = math.sqrt(left + span * span)  # sqrt(L^2 - rise^2)
    u = parameter(left / (span * (span + root)))
    horizontal = weight * span / (2 * u)
    lean = math.asinh(rise / root)  # atanh(rise / length), exact near 1
    return _piece(start, plane, horizontal, horizontal * math.sinh(lean - u), length, math.inf, s)


def hang_elastic(start: np.ndarray, end: np.ndarray, length: float, load: np.ndarray, stretch: float, s: np.ndarray) -> Piece:
    """The shape of an elastic piece between two points, which may be further apart than it is long.

    Args:
        start: (3,) m.
        end: (3,) m.
        length: [m] Unstretched.
        load: (3,) [N/m] Weight per unstretched metre; may be zero where the chord is no shorter than the length.
        stretch: [N] EA; infinity gives the rigid piece.
        s: (n,) [m] Unstretched arc lengths asked for.

    Raises:
        ValueError: If the piece is slack and weighs nothing: it has no definite shape then.
    """
    if math.isinf(stretch):
        return hang(start, end, length, load, s)
    if not load.any():
        return _weightless(start, end, length, stretch, s)
    plane = _plane(start, end, load)
    total = plane.weight * length
    span, rise, e = plane.span / length, plane.rise / length, total / stretch
    if span < FOLDED:
        middle = rise / (2 + e) if abs(rise) <= 1 + e / 2 else (rise - math.copysign(1.0, rise)) / e
        return _piece(start, plane, 0.0, total * (middle - 0.5), length, stretch, s)
    u = _elastic_parameter(span, rise, plane.chord / length, e)
    horizontal = total * span / (2 * u + e)
    lean = math.asinh(rise * (u + e / 2) / (span * (math.sinh(u) + e / 2 * math.cosh(u))))
    return _piece(start, plane, horizontal, horizontal * math.sinh(lean - u), length, stretch, s)


def straight(start: np.ndarray, end: np.ndarray, length: float, s: np.ndarray) -> np.ndarray:
    """Nodes (n, 3) of a taut piece."""
    return start + np.outer(s / length, end - start)


def _plane(start: np.ndarray, end: np.ndarray, load: np.ndarray) -> _Plane:
    # Sums, not dot products: the compiled twin adds in the same order, and 1 - chord / length magnifies the last bit.
    weight = math.sqrt((load * load).sum())
    up = -load / weight
    chord = end - start
    rise = float((chord * up).sum())
    across = chord - rise * up
    span = math.sqrt((across * across).sum())
    side = across / span if span > 0.0 else across
    return _Plane(weight, up, side, span, rise, math.sqrt((chord * chord).sum()))


def _piece(start: np.ndarray, plane: _Plane, horizontal: float, first: float, length: float, stretch: float, s: np.ndarray) -> Piece:
    """The curve with horizontal force H and vertical force V_0 = `first` [N] at its beginning."""
    H, weight = horizontal, plane.weight
    V, last = first + weight * s, first + weight * length
    T, T_0 = np.hypot(H, V), math.hypot(H, first)
    pull = np.maximum(T, 1e-300)  # zero at a fold
    y = s * (V + first) * (1 / (pull + T_0) + 0.5 / stretch)
    x = H / stretch * s
    if H > 0.0:
        # sinh(asinh(V / H) - asinh(V_0 / H)) two ways: each cancels where the other does not.
        is_same = V * first > 0.0
        sum_ = np.where(is_same, V * T_0 + first * T, 1.0)
        x = x + H / weight * np.arcsinh(np.where(is_same, weight * s * (V + first) / sum_, (V * T_0 - first * T) / H / H))
    return Piece(
        nodes=start + x[:, None] * plane.side + y[:, None] * plane.up,
        tension=T,
        start_force=-H * plane.side - first * plane.up,
        end_force=H * plane.side + last * plane.up,
        curvature=weight / pull * (H / pull) / (1 + T / stretch),
        strain=T / stretch,
    )


def _elastic_parameter(d: float, r: float, chord: float, e: float) -> float:
    """The u of the module's one equation, by Newton's method on logarithms kept between bounds.

    Squared, and with k = e/2u, the equation says (k - chord + 1)(k + chord + 1) + r^2 (1 - (1 + k)^2 / c^2) = d^2 (sinh(u)^2 / u^2 - 1).
    No term of it cancels, so that a cable taut to 1e-12 and one stretched by 1e-12 keep all their digits.
    """
    slack = 1 - chord
    u = math.sqrt(6 * max(slack, 0.0)) + (3 * e) ** (1 / 3) if -2 * slack < e ** (2 / 3) else -e / (2 * slack)
    u, low, high = min(u, 2 + math.log1p(1 / d)), 0.0, math.inf
    for _ in range(STEPS_MAX):
        k = e / (2 * u)
        grown, over = _sinh_over(u)  # sinh(u)/u - 1, and u coth(u) - 1
        c = 1 + k * (1 + over)
        kept = k * over * (2 * (1 + k) + k * over) / (c * c)  # 1 - (1 + k)^2 / c^2
        residual = (k + slack) * (1 + k + chord) + r * r * kept - d * d * grown * (2 + grown)
        ratio = residual / (d * (1 + grown)) ** 2
        low, high = (u, high) if residual > 0 else (low, u)
        step = math.inf
        if ratio > -1:
            left = max(c * c - r * r, 1e-300)
            slope = -k / (1 + k) - over - k / (1 + grown) ** 2 * r * r / (c * left)
            step = -0.5 * math.log1p(ratio) / slope
        following = u * math.exp(max(min(step, 2.0), -2.0))
        if not low < following < high:
            following = 0.25 * u if low == 0.0 else (4 * u if math.isinf(high) else math.sqrt(low * high))
        if abs(step) < 1e-15 or high < low * (1 + 1e-15):
            break
        u = following
    return u


def _weightless(start: np.ndarray, end: np.ndarray, length: float, stretch: float, s: np.ndarray) -> Piece:
    chord = end - start
    size = math.sqrt((chord * chord).sum())
    if size < length * (1 - TAUT):
        raise ValueError(f"a slack cable of {length:.6g} m between points {size:.6g} m apart has no definite shape without weight")
    strain = max(size / length - 1, 0.0)
    force, ones = stretch * strain * chord / size, np.ones(len(s))
    return Piece(straight(start, end, length, s), stretch * strain * ones, -force, force, 0.0 * ones, strain * ones)
