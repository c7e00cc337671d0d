"""A first guess of shape and forces, from the grasps alone: good for orders of magnitude, and for no more.

The shape is the curve that a cold start begins from. Its forces are those of a parabola with the slack of the span,

    H = W c / 8 f,   f = sqrt(3 c (L - c) / 8),   n(s) = H chord / c + w (L / 2 - s)   [N]

(Irvine 1981, "Cable Structures", ch. 2), with W = w L the weight of the span and c its chord. Where a clamp holds the cable at an angle
theta to its force F, it bends by 2 sin(theta / 2) sqrt(F / EI) at least, the curvature of the layer (`effects.bending`).
"""

from __future__ import annotations

import math
from itertools import pairwise
from types import ModuleType
from typing import Final

import numpy as np

from protocol.messages import Problem
from protocol.scene import Vector

from .cold import curve_tangents
from .mesh import even, stops
from .seen import Seen, see

SEGMENTS: Final = 16
FLAT: Final = 1e-3  # of the length, the least sag counted with


def guess(problem: Problem, gravity: Vector, path: ModuleType) -> Seen:
    """What a problem without a start shape may look like."""
    grasps, acceleration = problem.grasps, np.asarray(gravity)
    mesh = even(stops(problem), grasps.s, SEGMENTS)
    tangents = curve_tangents(mesh, problem, acceleration, path)
    count, held, s = len(grasps.s), mesh.grasp_nodes.tolist(), mesh.s.tolist()
    mass = [0.0, *(mesh.lengths * mesh.along(problem.cable, "mass_per_length")).cumsum().tolist()]  # kg, up to every node
    shares, along = [0.0] * count, [(0.0, 0.0, 0.0)] * (count + 1)
    shares[0], shares[-1] = mass[held[0]], mass[-1] - mass[held[-1]]
    places = grasps.position.tolist()
    for k, (first, last) in enumerate(pairwise(held)):
        (x, y, z), (u, v, w) = places[k], places[k + 1]
        weight, length = mass[last] - mass[first], s[last] - s[first]
        distance = max(math.hypot(u - x, v - y, w - z), 1e-300)
        sag = max(math.sqrt(0.375 * distance * max(length - distance, 0.0)), FLAT * length)
        pull = weight * math.hypot(*gravity) / (8.0 * sag)
        along[k + 1] = (pull * (u - x), pull * (v - y), pull * (w - z))
        shares[k] += 0.5 * weight
        shares[k + 1] += 0.5 * weight
    pulls = np.array(along)
    forces = pulls[:-1] - pulls[1:] - np.array(shares)[:, None] * acceleration
    seen = see(problem, gravity, mesh, tangents, forces, np.zeros((0, 3)))
    if seen.bending[0] > 0.0:
        _add_layers(seen)
    return seen


def _add_layers(seen: Seen) -> None:
    """Let it bend, beside every clamp, at least as the layer does that the curve is too smooth to show."""
    for clamp in seen.clamps:
        sharp = 2.0 * math.sqrt(clamp.force / seen.bending[0]) * math.sin(0.5 * clamp.angle)
        row = min(max(clamp.node - 1, 0), len(seen.bend) - 1)
        seen.bend[row] = max(seen.bend[row], sharp)
