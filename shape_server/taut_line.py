"""The taut line: a cable almost as long as its chord, laid on the chord, with an error that no load can exceed.

Equation. Let c be the chord, L the length and e = (L - c) / c the relative slack. Under a weight of w per metre, w_n of it across
the chord, the cable hangs as a parabola, f below the chord in its middle. The length of the parabola is c (1 + (8/3) (f/c)^2) to
fourth order in f / c, and it carries the tension w_n c^2 / 8 f, so that

    f = sqrt(3 e / 8) c   [m],        T = w_n c / sqrt(24 e)   [N]

(Irvine 1981, "Cable structures", MIT Press, ch. 2). Along the cable the force changes by the weight,
n(s) = T (direction of the chord) - w (s - L/2), so that the forces at the ends carry it exactly.

Error of the nodes. A point at arc length s of any inextensible cable, whatever loads it and however it bends, is within s of one end
and within L - s of the other. These two balls meet in a lens around the chord, in which nothing is further from its place on the
chord than

    sqrt(L^2 - c^2) / 2 = sqrt(e / 2) c (1 + e/4 ...)   [m],

reached by a cable folded at its middle; a parabola reaches sqrt(3/4) = 87 % of it. A slack of 1e-6 moves the middle of 1 m of cable by
0.61 mm, so this model is for a slack below 2 (error asked for / length)^2.

Error of the tension. The next term of the expansion, with t the slope of the chord against the horizontal: the tension is
too low by the share (0.15 + 2.4 t^2) e, derived for t and measured for the rest; and never by more than w L / 2, where a steep cable
hangs double instead. Stretch is left out: where T is above e EA, the elastic catenary holds instead.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

TAUT = 1e-12  # relative slack; with less, as with the catenary, the tension is that of this slack
TOO_LONG = 1e-9  # of the length; a chord longer by more than this is a wrong request


@dataclass(frozen=True)
class TautLine:
    """A straight cable at given arc lengths."""

    nodes: np.ndarray  # (n, 3) m
    tension: np.ndarray  # (n,) N
    start_force: np.ndarray  # (3,) N, on the cable at its first end
    end_force: np.ndarray  # (3,) N, on the cable at its last end
    sag: float  # m, of the parabola that uniform weight makes of it; sqrt(3 e / 8) c
    error: float  # m, bound on the distance of every node from its true place
    tension_error: float  # N, bound on the error of the tension under uniform weight


def lay_taut(start: np.ndarray, end: np.ndarray, length: float, load: np.ndarray, s: np.ndarray) -> TautLine:
    """The straight line between two points almost as far apart as the cable is long.

    Args:
        start: (3,) m.
        end: (3,) m, not in the same place.
        length: [m].
        load: (3,) [N/m] Weight per metre; without any the tension is given as zero.
        s: (n,) [m] Arc lengths asked for.

    Raises:
        ValueError: If the ends are further apart than the cable is long.
    """
    chord = end - start
    size = math.sqrt((chord * chord).sum())
    if size > length * (1 + TOO_LONG):
        raise ValueError(f"the ends are {size:.9g} m apart, further than the {length:.9g} m of cable between them")
    along = chord / size
    slack = max(length - size, 0.0)
    lengthwise = float((load * along).sum())
    crosswise = math.sqrt(((load - lengthwise * along) ** 2).sum())
    pull = crosswise * size / math.sqrt(24 * max(slack / size, TAUT))
    # (0.5 + 2.4 t^2) e T with t = lengthwise / crosswise, over crosswise, which may be zero; 0.5 covers the term after next
    left_out = (0.5 * crosswise**2 + 2.4 * lengthwise**2) * math.sqrt(max(slack / size, TAUT) / 24) * size
    force = pull * along - np.outer(s - 0.5 * length, load)  # (n, 3)
    return TautLine(
        nodes=start + np.outer(s / length, chord),
        tension=np.sqrt((force * force).sum(1)),
        start_force=-pull * along - 0.5 * length * load,
        end_force=pull * along - 0.5 * length * load,
        sag=math.sqrt(0.375 * slack * size),
        error=0.5 * math.sqrt(slack * (length + size)),
        tension_error=_lesser(left_out, crosswise, 0.5 * length * math.hypot(crosswise, lengthwise)),
    )


def _lesser(over: float, under: float, most: float) -> float:
    """The quotient over / under, or `most` where it is larger, also where `under` is zero."""
    return over / under if over < most * under else most
