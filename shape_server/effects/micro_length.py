"""Micro_length: the bending of the rod resists a change of curvature along the cable as well as curvature itself.

Energy per metre, with e = kappa - kappa_0 the two parts of curvature about d1 and d2, less the natural ones, in the section's own
axes, K = diag(EI_1, EI_2), l the micro-structure length and ' the derivative along the cable:

    (e . K e + l^2 e' . K e') / 2   [J/m],        twist as without l.

Its variation with a turn theta of the sections (kappa' s variation is theta' + kappa x theta) gives the moment and the balance of

    M = K e - D',   D = l^2 K e' [N m^2],   M_3 = GJ kappa_3;        m' + t x n = 0   [N m/m],   m = M_1 d1 + M_2 d2 + M_3 d3,

with n the force carried, and leaves m . theta + D . (variation of e) at an end. So, as for the plane cable of `gradient_cable`,

    clamp:  position and frame given, D = 0        hinge or free end:  M = 0, D = 0.

A clamp inside the cable is an end for both of its sides, and so is a guide: what grips the cable takes no double moment, and the
curvature may jump within the grip. Where a section ends e and D are continuous; so is e under a point load and at a contact. D = 0 makes
the solution smooth at a clamp when mirrored there, so that the half cell of `vertices` and the ties of `smoothing` keep second order, and
two meshes combine to fourth in a plane; to third where twist varies beside a clamp, as for a section that is not round without l.

Source: Papargyri-Beskou, Tsepoura, Polyzos and Beskos 2003, "Bending and stability analysis of gradient elastic beams", Int. J. Solids
Struct. 40, 385-400, for the energy and the boundary terms of a straight beam; here with the curvature of a rod in space (Antman 2005,
"Nonlinear Problems of Elasticity", ch. 8). Left out: gradients of twist and stretch, and a length of its own for each axis. Against
a cable without l a clamp's layer g = sqrt(EI / T) widens to (g + l) / sqrt(1 + 2 l / g), and the shape moves by this change times the
sine of the angle in which the clamp holds the cable: 0.4 mm for l = 10 mm, g = 0.1 m, at a right angle.

Its size: D = 0 at a clamp lets the curvature differ by l kappa' in a layer of length l, which turns the cable by l^2 kappa', with
kappa' = Q / EI, Q the force across the cable; this reaches g, or half the span where that is less. Elsewhere e differs by l^2 kappa'',
which moves the cable by l^2 kappa. For l << g this is what the widened layer above says.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from protocol.messages import Problem
from protocol.scene import Cable, Vector

from ..mesh import Mesh
from ..seen import Seen, Size

MARGIN: Final = 0.6  # times the formula


def smoothing(cable: Cable, mesh: Mesh) -> np.ndarray:
    """Stiffness of every segment against a difference of curvature between its ends, about d1 and d2, (n-1, 2) [N m^3]."""
    assert cable.micro_length is not None
    first = mesh.along(cable, "bending")
    second = first if cable.bending_2 is None else mesh.along(cable, "bending_2")
    return np.asarray(cable.micro_length**2 * np.column_stack([first, second]) / mesh.lengths[:, None])


def size(problem: Problem, gravity: Vector, seen: Seen) -> Size:
    """What leaving the micro-structure length out could change."""
    cable = problem.cable
    assert cable.micro_length is not None
    square, softest, most = cable.micro_length**2, seen.bending[0], 0.0
    for span in seen.spans:
        own = slice(span.first, span.last)
        kink = square * float(seen.shear[own].max()) / softest
        sharp = square * float(seen.bend[max(span.first - 1, 0) : span.last].max(initial=0.0))
        most = max(most, span.grown(MARGIN * (kink * seen.reach(span) + sharp)))
    most = min(most, cable.length)
    return Size(most, seen.moved(most).force, cable.micro_length * float(seen.shear.max()) / softest + seen.moved(most).curvature)
