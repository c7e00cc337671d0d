"""Bending: moment EI times curvature, about one axis of the section or with a stiffness of its own about each.

Energy (EI_1 kappa_1^2 + EI_2 kappa_2^2) / 2 per metre (Euler-Bernoulli; Antman 2005, "Nonlinear Problems of Elasticity",
ch. 8); EI_2 = EI_1 for a round section. Shear and the slip of wires inside a bundle are left out; a bundle of loose wires is
softer than its bonded section by a factor that the scene's number must already hold.

Its size: a cable without it bends sharply where a clamp holds it at an angle theta to its tension T, and one with it takes a layer of
g = sqrt(EI / T). The layer is an elastica, tan(theta / 4) = tan(theta_0 / 4) exp(-s / g), whose curvature is 2 sin(theta / 2) / g; it
moves what comes after it across by 2 g sin(theta_0 / 2) and back by 2 g (1 - cos(theta_0 / 2)), together

    4 g sin(theta_0 / 4)   [m],

and the span by what it lacks in length then (`grown` of `seen`). Between layers the moment EI kappa moves the cable by EI kappa / T. A
micro-structure length l widens the layer to (g + l) / sqrt(1 + 2 l / g), a bend radius r to 2 r sin(theta / 2). The layer as in Love
1944, "Mathematical Theory of Elasticity", art. 262, for a rod without end.
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
SHORT: Final = 0.15  # of a span; a boundary layer longer than this is none


def stiffness(cable: Cable, mesh: Mesh) -> np.ndarray:
    """Share of the diagonal law of every segment for (curvature, curvature, twist), (n-1, 3) [N m^2]."""
    out = np.zeros((len(mesh.lengths), 3))
    out[:, 0] = mesh.along(cable, "bending")
    out[:, 1] = out[:, 0] if cable.bending_2 is None else mesh.along(cable, "bending_2")
    return out


def size(problem: Problem, gravity: Vector, seen: Seen) -> Size:
    """What leaving bending out could change; a bound of no use (the cable's length) where layers are no longer short."""
    cable = problem.cable
    most, micro, radius = seen.bending[1], cable.micro_length or 0.0, cable.bend_radius or 0.0
    used, aside, sharpest = np.zeros(len(seen.spans)), np.zeros(len(seen.spans)), 0.0
    for clamp in seen.clamps:
        span = seen.spans[clamp.span]
        layer = math.sqrt(most / max(clamp.force, 1e-300))
        layer = (layer + micro) / math.sqrt(1.0 + 2.0 * micro / layer)
        layer = max(layer, 2.0 * radius * math.sin(0.5 * clamp.angle))
        if layer > SHORT * span.length:
            return Size(cable.length, seen.force_most, 1.0 / layer)
        away = 4.0 * layer * math.sin(0.25 * clamp.angle)
        used[clamp.span] += away
        aside[clamp.span] = max(aside[clamp.span], away)
        sharpest = max(sharpest, 2.0 / layer * math.sin(0.5 * clamp.angle))
    moved = 0.0
    for span, length, away in zip(seen.spans, MARGIN * used, MARGIN * aside, strict=True):
        own = slice(span.first, span.last)
        pull = np.maximum(seen.tension[own], 1e-300)
        turned = seen.tangents[own][1:] - seen.tangents[own][:-1]
        sharp = np.sqrt(np.einsum("ij,ij->i", turned, turned)) / seen.mesh.lengths[own][1:]
        inside = float((most / pull[1:] * sharp).max(initial=0.0))
        moved = max(moved, away + MARGIN * inside + span.grown(float(length)) - float(length))
    moved = min(moved, cable.length)
    return Size(moved, seen.moved(moved).force, MARGIN * (sharpest + seen.bend_most))
