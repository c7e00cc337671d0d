"""The gradient cable: a cable that accepts moments, in the plane of gravity and chord, with moderate slopes, in closed form.

Equation. Let x run horizontally and y upwards, H be the horizontal force, EI the bending stiffness, l the micro-structure length and
w_bar = w L / span the weight per horizontal metre. Of all curves between its ends the cable takes that of least energy

    int  H y'^2 / 2  +  EI (y''^2 + l^2 y'''^2) / 2  +  w_bar y   dx   [J],        H y'' - EI y'''' + EI l^2 y^(6) = w_bar   [N/m],

and H is what makes it as long as it is: int sqrt(1 + y'^2) dx = L. The variation leaves at an end (vertical force) dy + M dy' + D dy''
with the moment M = EI (y'' - l^2 y'''') [N m] and the double moment D = EI l^2 y''' [N m^2]. So

    clamp:  y and y' given, D = 0        hinge:  y given, M = 0, D = 0        (l = 0: no D, and the equation is of fourth order).

Two lengths. Divided by H the fourth-order equation reads y'' - g^2 y'''' = w_bar / H with g = sqrt(EI / H): a string whose energy has
the gradient term H g^2 y''^2 / 2. This g is the micro-structure length of a cable in Papacharalampopoulos, Makris, Bitzios and
Chryssolouris 2016, "Prediction of cabling shape during robotic manipulation", Int. J. Adv. Manuf. Technol. 82, 123-132; it
falls with the tension, and is the width of the layer in which a clamp is felt. The l here belongs to the cross-section: the gradient
length of a beam in bending (Papargyri-Beskou, Tsepoura, Polyzos and Beskos 2003, "Bending and stability analysis of gradient
elastic beams", Int. J. Solids Struct. 40, 385-400). It stiffens the layer once l is of the size of g, and is not felt where l << g.

Solution: `gradient_curve.py` for a given H, and a root of one increasing function for H. A chord at the angle phi to the horizontal is
allowed for to first order: curvature is y'' cos(phi)^3 and d/ds is cos(phi) d/dx, so EI cos(phi)^3 and l cos(phi) stand for EI and l.

Left out: the rest of the curvature and of the weight per x, of second order in the angle between cable and chord, of third on a
level chord; `gradient_error.py` predicts what they move, and `gradient_ends.py` adds to the ends what they bear of it, so that forces and
moments there balance the weight where it is. Stretch, and all that leaves the plane, are left out without prediction. A
cable whose ends push it together (H <= 0) is refused, as are angles and clamps beyond those for which the error is known: the rod
covers them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .gradient_curve import Posed, balanced, bent, derivatives, places
from .gradient_ends import ends
from .gradient_error import Prediction, predict

TAUT = 1e-12  # of the length; a cable with less slack is given this much, so that its tension stays finite
PLANAR = 1e-9  # sine of the angle by which a tangent may leave the plane
SOFTEST_PULL = 1e-3  # EI / span^2; with a smaller H the ends as good as push
STEEPEST = math.pi / 3  # of the chord
TURN_MAX = math.pi / 4  # of the cable against its chord; up to here, and not beyond, the predicted error was calibrated
SHARE_MAX = 0.2  # of the slack, misjudged beside the clamps; beyond, the tension may be off by a factor


class NotCovered(ValueError):
    """This cable does not cover the problem; the sentence says why, and the rod covers it."""


@dataclass(frozen=True)
class GradientShape:
    """The shape at given arc lengths from the first end."""

    nodes: np.ndarray  # (n, 3) m
    tension: np.ndarray  # (n,) N
    moment: np.ndarray  # (n,) N m, positive where it bends the cable upwards; of the equation, as the curve is
    curvature: np.ndarray  # (n,) 1/m, positive upwards
    horizontal: float  # N, H
    start_force: np.ndarray  # (3,) N, on the cable at its first end
    end_force: np.ndarray  # (3,) N, on the cable at its last end
    start_moment: float  # N m, as `moment`; with the forces it balances the cable's weight where that is, see `gradient_ends`
    end_moment: float  # N m
    error: float  # m, of the nodes, predicted
    tension_error: float  # N, predicted


def lay(
    start: np.ndarray,
    end: np.ndarray,
    length: float,
    load: np.ndarray,
    bending: float,
    micro_length: float,
    start_tangent: np.ndarray | None,
    end_tangent: np.ndarray | None,
    s: np.ndarray,
) -> GradientShape:
    """The shape of a cable that accepts moments, between two ends.

    Args:
        start: (3,) m.
        end: (3,) m.
        length: [m].
        load: (3,) [N/m] Weight per metre, not zero.
        bending: [N m^2] EI, above zero.
        micro_length: [m] l; zero for the fourth-order cable.
        start_tangent: (3,) Direction of growing s at a clamp, in the plane of load and chord; None at a hinge.
        end_tangent: (3,) The same at the last end.
        s: (n,) [m] Arc lengths asked for.

    Raises:
        NotCovered: If the problem is not plane, too steep, or the ends would have to push the cable together.
    """
    up, side = _axes(start, end, load)
    posed = _posed(end - start, up, side, length, float(np.linalg.norm(load)), bending, micro_length, (start_tangent, end_tangent))
    softest = SOFTEST_PULL * posed.bending / posed.span**2
    horizontal = balanced(posed, softest)
    if horizontal <= softest:
        raise NotCovered("the ends push the cable together, or nearly so: its weight cannot take up the slack against its stiffness")
    curve = bent(posed, horizontal)
    predicted = predict(posed, horizontal, curve)
    _check(predicted)
    x = places(curve, s)
    y, slope, second, _, fourth, _ = derivatives(curve, x)
    borne = ends(posed, horizontal, curve)
    vertical = borne.start_vertical + (borne.end_vertical - borne.start_vertical) / length * s  # on the part before s
    slant = np.sqrt(1 + slope * slope)
    return GradientShape(
        nodes=start + np.outer(x, side) + np.outer(y, up),
        tension=(horizontal + vertical * slope) / slant,
        moment=posed.bending * (second - posed.micro_length**2 * fourth),
        curvature=second / slant**3,
        horizontal=horizontal,
        start_force=-horizontal * side - borne.start_vertical * up,
        end_force=horizontal * side + borne.end_vertical * up,
        start_moment=borne.start_moment,
        end_moment=borne.end_moment,
        error=predicted.error,
        tension_error=predicted.tension_error,
    )


def _axes(start: np.ndarray, end: np.ndarray, load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors up and sideways, towards the end."""
    if not load.any():
        raise NotCovered("a cable without weight has no plane of its own; give it weight, or use the rod")
    up, chord = -load / np.linalg.norm(load), end - start
    across = chord - (chord @ up) * up
    steepness = math.atan2(float(chord @ up), float(np.linalg.norm(across)))
    if not abs(steepness) <= STEEPEST or not chord.any():
        found, most = math.degrees(steepness), math.degrees(STEEPEST)
        raise NotCovered(f"the chord rises by {found:.4g} degrees, which may be {most:.4g} at most either way")
    return up, across / np.linalg.norm(across)


def _posed(
    chord: np.ndarray,
    up: np.ndarray,
    side: np.ndarray,
    length: float,
    weight: float,
    bending: float,
    micro_length: float,
    tangents: tuple[np.ndarray | None, np.ndarray | None],
) -> Posed:
    size = float(np.linalg.norm(chord))
    if size > length * (1 + PLANAR):
        raise NotCovered(f"the ends are {size:.9g} m apart, further than the {length:.9g} m of cable between them")
    if not bending > 0 or not micro_length >= 0:
        raise NotCovered(
            f"bending is {bending:.6g} N m^2 and micro_length {micro_length:.6g} m; above zero, and not below it, would be right"
        )
    span, slack = float(chord @ side), max(length - size, TAUT * length)
    cosine = span / size
    return Posed(
        span=span,
        rise=float(chord @ up),
        slack=slack,
        bar=weight * (size + slack) / span,
        bending=bending * cosine**3,
        micro_length=micro_length * cosine,
        start_slope=_slope(tangents[0], up, side),
        end_slope=_slope(tangents[1], up, side),
    )


def _slope(tangent: np.ndarray | None, up: np.ndarray, side: np.ndarray) -> float:
    if tangent is None:
        return math.nan
    unit = tangent / np.linalg.norm(tangent)
    out = abs(float(unit @ np.cross(up, side)))
    if not out <= PLANAR:
        raise NotCovered(f"a tangent leaves the plane of load and chord by {out:.3g}, where {PLANAR:.0e} is allowed")
    if unit @ side <= 0:
        raise NotCovered("a tangent points away from the other end, where a moderate slope would be right")
    return float(unit @ up) / float(unit @ side)


def _check(predicted: Prediction) -> None:
    if predicted.turn > TURN_MAX:
        found, most = math.degrees(predicted.turn), math.degrees(TURN_MAX)
        raise NotCovered(f"the cable turns by {found:.4g} degrees from its chord, more than the {most:.4g} of moderate slopes")
    if predicted.share > SHARE_MAX:
        raise NotCovered(f"the clamps bend the cable so much that {100 * predicted.share:.0f} % of its slack is misjudged beside them")
