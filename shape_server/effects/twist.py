"""Twist: torque GJ times the rate of turn of the section about the tangent.

Energy GJ/2 kappa_3^2 per metre (Saint-Venant; Antman 2005, "Nonlinear Problems of Elasticity", ch. 8). Warping is left
out; it vanishes for a round section.

Its size: a torque M along a cable of curvature kappa loads it with the moment M kappa per metre, which reaches g = sqrt(EI / T), or
half the span L where that is less: it moves by (M g / EI) kappa g^2. It is left out together with bending only.
"""

from __future__ import annotations

import math

import numpy as np

from protocol.messages import Problem
from protocol.scene import Cable, Vector

from ..mesh import Mesh
from ..seen import Seen, Size


def stiffness(cable: Cable, mesh: Mesh) -> np.ndarray:
    """Share of the diagonal law of every segment for (curvature, curvature, twist), (n-1, 3) [N m^2]."""
    out = np.zeros((len(mesh.lengths), 3))
    out[:, 2] = mesh.along(cable, "twist")
    return out


def size(problem: Problem, gravity: Vector, seen: Seen) -> Size:
    """What leaving twist out could change: that of a torque GJ times the rate of turn, up to half a turn between clamps."""
    cable = problem.cable
    assert cable.twist is not None
    least, most = 0.0, 0.0
    for span in seen.spans:
        rate = math.pi / span.length + abs(0.0 if cable.natural_curvature is None else cable.natural_curvature[2])
        torque = max(cable.twist, *(section.twist or 0.0 for section in cable.sections), 0.0) * rate
        reach = seen.reach(span)
        sharp = float(seen.bend[max(span.first - 1, 0) : span.last].max(initial=0.0))
        ratio = min(torque * reach / max(seen.bending[0], 1e-300), 1.0)
        least = max(least, span.grown(ratio * sharp * reach**2))
        most = max(most, ratio * seen.force_most)
    return Size(min(least, cable.length), most, seen.moved(least).curvature)
