"""Forces and moments at the ends of a gradient cable, in balance with a weight that is spread along the cable and not along the horizontal.

The curve is that of a cable with w_bar per horizontal metre and the moment EI (y'' - l^2 y''''), whose end forces and moments balance
a weight in the middle of the span. The cable that it stands for weighs w sqrt(1 + y'^2) per horizontal metre, more where it is steeper,
which on an inclined chord has its centre elsewhere, by up to 1e-2 of the length. What the curve leaves out, a load q [N/m], a moment mu
[N m] and a third derivative d [1/m^2] (`gradient_error.left_over`), is borne by the ends. By how much follows without a further solution
from Betti's reciprocity (Mueller-Breslau's lines of influence): let f be the curve of the same cable without weight, one end of
which is moved or turned by one, all others held. Then the force or moment there grows by

    int q f dx  +  int mu f'' dx  -  EI l^2 [d f'']_0^span.

A cable moved or turned as a whole has f'' = 0, so that the ends take up exactly the force and the moment of q: the answer
balances the weight of the cable where it is. H stays, for the length of the curve is right.

Measured against the geometrically exact rod over 150 random cables: `test_gradient_beam.py`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from .gradient_curve import Curve, Posed, bent, derivatives
from .gradient_error import Along, left_over


class Ends(NamedTuple):
    """What the ends bear, seen from the part of the cable before each place."""

    start_vertical: float  # N, upwards, of the part beyond on the part before
    end_vertical: float  # N
    start_moment: float  # N m, positive where it bends the cable upwards
    end_moment: float  # N m


def ends(posed: Posed, horizontal: float, curve: Curve) -> Ends:
    """Forces and moments at both ends for the horizontal force H [N]."""
    along = Along(curve)
    here, at_ends = derivatives(curve, along.x), derivatives(curve, along.ends)
    load, moment, third = left_over(posed, here, at_ends)
    _, slope, second, third_own, fourth, fifth = at_ends
    vertical = horizontal * slope - posed.bending * (third_own - posed.micro_length**2 * fifth)
    bend = posed.bending * (second - posed.micro_length**2 * fourth)

    def borne(rise: float, start_slope: float, end_slope: float) -> float:
        """Work of what is left over on the curve whose end is moved by `rise` and whose clamps are turned by these slopes."""
        line = bent(_unloaded(posed, rise, start_slope, end_slope), horizontal)
        inside, outside = derivatives(line, along.x), derivatives(line, along.ends)
        double = posed.bending * posed.micro_length**2 * (third[1] * outside[2, 1] - third[0] * outside[2, 0])
        return along.integral(load * inside[0]) + along.integral(moment * inside[2]) - float(double)

    moved = borne(1.0, 0.0, 0.0)
    is_hinge = math.isnan(posed.start_slope), math.isnan(posed.end_slope)
    return Ends(
        start_vertical=float(vertical[0]) + moved - along.integral(load),
        end_vertical=float(vertical[1]) + moved,
        start_moment=0.0 if is_hinge[0] else float(bend[0]) - borne(0.0, 1.0, 0.0),
        end_moment=0.0 if is_hinge[1] else float(bend[1]) + borne(0.0, 0.0, 1.0),
    )


def _unloaded(posed: Posed, rise: float, start_slope: float, end_slope: float) -> Posed:
    return posed._replace(
        rise=rise,
        bar=0.0,
        start_slope=posed.start_slope if math.isnan(posed.start_slope) else start_slope,
        end_slope=posed.end_slope if math.isnan(posed.end_slope) else end_slope,
    )
