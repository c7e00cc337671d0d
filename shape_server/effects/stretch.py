"""Stretch: a segment grows by its tension over EA per metre.

Hooke's law, e = n.d3 / EA with n the force carried (Irvine 1981, "Cable Structures", ch. 1); what that adds to the system stands
in `axial`. The section keeps its size, so bending and twist stay as they are.

Its size: a span is longer by d = integral of |T| / EA ds, and moves by `grown(d)` of `seen`; its tension, which goes with one over the
square root of the slack, by the share 1 - sqrt((L - c) / (L - c + d)).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from protocol.messages import Problem
from protocol.scene import Cable, Vector

from ..mesh import Mesh
from ..seen import Seen, Size

MARGIN: Final = 1.25  # times the formula


def give(cable: Cable, mesh: Mesh) -> np.ndarray:
    """Growth of every segment under a unit of tension, (n-1,) [m/N]."""
    return np.asarray(mesh.lengths / mesh.along(cable, "stretch"))


def size(problem: Problem, gravity: Vector, seen: Seen) -> Size:
    """What leaving stretch out could change: `grown` by the elongation of every span, and tension that goes with its slack."""
    cable, tension = problem.cable, np.abs(seen.tension)
    longer = tension * seen.mesh.lengths / seen.mesh.along(cable, "stretch")
    most, eased = 0.0, 0.0
    for span in seen.spans:
        more = MARGIN * float(longer[span.first : span.last].sum())
        most = max(most, span.grown(more))
        eased = max(eased, 1.0 - math.sqrt(max(span.length - span.chord, 0.0) / max(span.length - span.chord + more, 1e-300)))
    moved = seen.moved(most)
    return Size(most, eased * seen.force_most + (0.0 if most == 0.0 else moved.force), moved.curvature)
