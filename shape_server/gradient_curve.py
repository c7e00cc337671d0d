"""The curve of a gradient cable under a given horizontal force: a parabola, and layers that decay from both ends.

H y'' - EI y'''' + EI l^2 y^(6) = w_bar [N/m] has the solutions 1, x, w_bar x^2 / 2H and exp(-+ r x) with

    l^2 r^4 - r^2 + 1 / g^2 = 0,        g = sqrt(EI / H) [m]

(`gradient_cable.py` says where the equation comes from, and what the lengths g and l are). Without l one r = 1 / g is left. With it
there are two, which meet at l = g / 2 and are complex beyond: then the layers oscillate. Each end has layers of its own, which
decay from it: nothing grows, so nothing overflows, for EI / H from 1e-24 to 1e4 times the span squared.

Conditions at the ends: y, and y' at a clamp or the moment EI (y'' - l^2 y'''') = 0 at a hinge; with l also y''' = 0. They give
the four or six constants. Measured against the same conditions in 80 digits: 1e-15 of the span up to g = span, and 2e-10 at
g = 100 spans, where the layers look much like the parabola.

Plain functions on numbers and arrays, compiled by numba; numpy runs them too.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .jitted import kernel

ONE, TWO, WAVES = 1, 2, 3  # layers of an end: exp(-r t); two of these; exp(-p t) cosh(q p t) and exp(-p t) sinh(q p t) / q
UNFELT = 1e-9  # l / g; below, the second layer is smaller than rounding, as its square
NEARLY_ALIKE = 0.49  # l / g; above, the two rates are too near to each other, or complex, to be told apart by exponentials
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(16)  # on each panel of quadrature
STEPS_MAX = 100


class Posed(NamedTuple):
    """A gradient cable in its plane, linearised about the chord."""

    span: float  # m, along the horizontal x
    rise: float  # m, along y
    slack: float  # m, length less chord
    bar: float  # N/m, weight per horizontal length
    bending: float  # N m^2, EI
    micro_length: float  # m, l
    start_slope: float  # y' at the first end; nan at a hinge
    end_slope: float  # y' at the last end


class Curve(NamedTuple):
    """A curve y(x) made of 1, x, x (x - span) / 2 and two layers at each end."""

    span: float  # m
    kind: int  # of the layers
    fastest: float  # 1/m, r of the layer that decays fastest, or p
    other: float  # 1/m, r of the other one; or q^2, negative where the layers oscillate
    sizes: np.ndarray  # (7,) of these parts; of the layers those of their first derivatives, so that all but two are like slopes


@kernel
def bent(posed, horizontal):  # type: ignore[no-untyped-def]
    """The curve of the cable for a horizontal force H [N]."""
    span, micro = posed.span, posed.micro_length
    kind, fastest, other = _layers(math.sqrt(posed.bending / horizontal), micro)
    bend = posed.bar / horizontal
    table, wanted, parts = np.empty((6, 6)), np.zeros(6), np.empty((6, 7))
    for end in range(2):
        x, y, slope = (0.0, 0.0, posed.start_slope) if end == 0 else (span, posed.rise, posed.end_slope)
        _fill(kind, fastest, other, span, x, parts)
        if math.isnan(slope):
            parts[1], slope = parts[2] - micro * micro * parts[4], 0.0
        parts[2] = parts[3]  # no double moment
        if kind == ONE:  # nor a second layer to bear it
            parts[2] = 0.0
            parts[2, 4 + 2 * end] = 1.0
        wanted[3 * end], wanted[3 * end + 1] = y, slope
        for row in range(3):
            scale = np.abs(parts[row]).max()
            table[3 * end + row, :2], table[3 * end + row, 2:] = parts[row, :2] / scale, parts[row, 3:] / scale
            wanted[3 * end + row] = (wanted[3 * end + row] - bend * parts[row, 2]) / scale
    found = np.linalg.solve(table, wanted)
    sizes = np.empty(7)
    sizes[:2], sizes[2], sizes[3:] = found[:2], bend, found[2:]
    return Curve(span, kind, fastest, other, sizes)


@kernel
def derivatives(curve, x):  # type: ignore[no-untyped-def]
    """All derivatives (6, n), orders 0 to 5, at the places x (n,) [m]."""
    out, parts = np.empty((6, len(x))), np.empty((6, 7))
    for i in range(len(x)):
        _fill(curve.kind, curve.fastest, curve.other, curve.span, x[i], parts)
        for order in range(6):
            out[order, i] = 0.0
            for part in range(7):
                out[order, i] += curve.sizes[part] * parts[order, part]
    return out


@kernel
def slope_at(curve, x):  # type: ignore[no-untyped-def]
    """The first derivative at one place x [m]."""
    near, next_near = _decay(curve.kind, curve.fastest, curve.other, x)
    far, next_far = _decay(curve.kind, curve.fastest, curve.other, curve.span - x)
    sizes = curve.sizes
    line = sizes[1] + sizes[2] * (x - 0.5 * curve.span)
    return line + sizes[3] * near + sizes[4] * next_near - sizes[5] * far - sizes[6] * next_far


@kernel
def _fill(kind, fastest, other, span, x, parts):  # type: ignore[no-untyped-def]
    """Derivatives of all parts (6, 7) at x, orders 0 to 5."""
    parts[:, :3] = 0.0
    parts[0, 0], parts[0, 1], parts[1, 1], parts[2, 2] = 1.0, x, 1.0, 1.0
    parts[0, 2], parts[1, 2] = 0.5 * x * (x - span), x - 0.5 * span
    for end in range(2):
        first, second = _decay(kind, fastest, other, x if end == 0 else span - x)
        sign = 1.0 if end == 0 else -1.0
        if kind == WAVES:
            scale = fastest * (1.0 - other)
            parts[0, 3 + 2 * end], parts[0, 4 + 2 * end] = -(first + other * second) / scale, -(first + second) / scale
        else:
            parts[0, 3 + 2 * end], parts[0, 4 + 2 * end] = -first / fastest, -second / other
        factor = sign
        for order in range(1, 6):
            parts[order, 3 + 2 * end], parts[order, 4 + 2 * end] = factor * first, factor * second
            if kind == WAVES:
                first, second = fastest * (other * second - first), fastest * (first - second)
            else:
                first, second = -fastest * first, -other * second
            factor *= sign


@kernel
def _decay(kind, fastest, other, t):  # type: ignore[no-untyped-def]
    """Both layers of an end at the distance t from it."""
    if kind != WAVES:
        return math.exp(-fastest * t), math.exp(-other * t) if kind == TWO else 0.0
    size = min(fastest * t, 600.0)  # exp(-600) cosh(60) is zero enough
    decay, q = math.exp(-size), math.sqrt(abs(other))
    if other > 0.0:
        return decay * math.cosh(q * size), decay * math.sinh(q * size) / q
    return decay * math.cos(q * size), decay * (math.sin(q * size) / q if q > 0.0 else size)


@kernel
def _layers(gradient, micro):  # type: ignore[no-untyped-def]
    """Kind and rates of the layers for the lengths g and l [m]."""
    ratio = micro / gradient
    if ratio < UNFELT:
        return ONE, 1.0 / gradient, 1.0 / gradient
    if ratio < NEARLY_ALIKE:
        share = math.sqrt(0.5 + 0.5 * math.sqrt(1.0 - 4.0 * ratio * ratio))
        return TWO, share / micro, 1.0 / (share * gradient)
    # r = p (1 +- q): what the two functions span does not change where q passes zero and turns imaginary.
    return WAVES, 0.5 * math.sqrt(1.0 + 2.0 * ratio) / micro, (1.0 - 2.0 * ratio) / (1.0 + 2.0 * ratio)


@kernel
def panel_ends(curve):  # type: ignore[no-untyped-def]
    """Ends of panels (p+1,) [m] that double in width from the layers inwards."""
    count = 1
    while curve.span * curve.fastest > 4.0 * 2.0 ** (count - 1):
        count += 1
    ends = np.zeros(2 * count + 3)
    for i in range(count + 1):
        ends[i + 1] = 0.5 * curve.span * 2.0 ** (i - count)
        ends[2 * count + 2 - i] = curve.span - ends[i]
    return ends


@kernel
def excess_length(curve, steepness):  # type: ignore[no-untyped-def]
    """Length of a curve less that of its chord [m], above zero."""
    ends, flat, total = panel_ends(curve), math.hypot(1.0, steepness), 0.0
    for panel in range(len(ends) - 1):
        half = 0.5 * (ends[panel + 1] - ends[panel])
        for i in range(len(POINTS)):
            slope = slope_at(curve, ends[panel] + half * (1.0 + POINTS[i]))
            # sqrt(1 + y'^2) - sqrt(1 + m^2) - m (y' - m) / sqrt(1 + m^2), whose last term integrates to zero, without cancellation
            both = math.hypot(1.0, slope) + flat
            total += half * WEIGHTS[i] * (slope - steepness) ** 2 * (1.0 - steepness * (slope + steepness) / (flat * both)) / both
    return max(total, 1e-300)


@kernel
def balanced(posed, softest):  # type: ignore[no-untyped-def]
    """The horizontal force [N] that makes the curve as long as the cable; `softest` if even that is too much.

    The logarithm of the excess length falls with that of H, nearly in a straight line: by the secant, kept between bounds.
    """
    steepness = posed.rise / posed.span
    goal, low = math.log(posed.slack), math.log(softest)
    miss_low = math.log(excess_length(bent(posed, softest), steepness)) - goal
    if miss_low <= 0.0:
        return softest
    high, miss_high = max(low, math.log(posed.bar * posed.span / math.sqrt(24.0 * posed.slack / posed.span))), 1.0
    while miss_high > 0.0:
        high += 1.0 + 0.5 * max(miss_high - 1.0, 0.0)
        miss_high = math.log(excess_length(bent(posed, math.exp(high)), steepness)) - goal
    last, miss_last, here, miss_here = low, miss_low, high, miss_high
    for _ in range(STEPS_MAX):
        step = -miss_here * (here - last) / (miss_here - miss_last) if miss_here != miss_last else 0.0
        last, miss_last = here, miss_here
        here += step
        if not low < here < high:
            here = 0.5 * (low + high)
        if abs(here - last) < 1e-15 * max(1.0, abs(here)):
            break
        miss_here = math.log(excess_length(bent(posed, math.exp(here)), steepness)) - goal
        if miss_here > 0.0:
            low = here
        else:
            high = here
    return math.exp(here)


@kernel
def places(curve, s):  # type: ignore[no-untyped-def]
    """The x (n,) [m] at which the arc lengths s (n,) [m] are, by Newton's method within their panels."""
    ends = panel_ends(curve)
    arcs, x = np.zeros(len(ends)), np.empty(len(s))
    for panel in range(len(ends) - 1):
        arcs[panel + 1] = arcs[panel] + _arc(curve, ends[panel], ends[panel + 1])
    for i in range(len(s)):
        panel = min(max(np.searchsorted(arcs, s[i], side="right") - 1, 0), len(ends) - 2)
        here = ends[panel] + (s[i] - arcs[panel]) / (arcs[panel + 1] - arcs[panel]) * (ends[panel + 1] - ends[panel])
        for _ in range(STEPS_MAX):
            step = (arcs[panel] + _arc(curve, ends[panel], here) - s[i]) / math.hypot(1.0, slope_at(curve, here))
            here = min(max(here - step, 0.0), curve.span)
            if abs(step) < 1e-14 * curve.span:
                break
        x[i] = here
    return x


@kernel
def _arc(curve, first, last):  # type: ignore[no-untyped-def]
    half, total = 0.5 * (last - first), 0.0
    for i in range(len(POINTS)):
        total += half * WEIGHTS[i] * math.hypot(1.0, slope_at(curve, first + half * (1.0 + POINTS[i])))
    return total
