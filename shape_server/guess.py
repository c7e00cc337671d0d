"""A first guess of shape and forces, from the grasps alone: good for orders of magnitude, and for no more.

The shape is the curve that a cold start begins from. Its forces are those of a parabola with the slack of the span,

    H = W c / 8 f,   f = sqrt(3 c (L - c) / 8),   n(s) = H chord / c + w (L / 2 - s)   [N]

(Irvine 1981, "Cable Structures", ch. 2), with W = w L the weight of the span and c its chord.
"""

from __future__ import annotations

from itertools import pairwise
from types import ModuleType
from typing import Final

import numpy as np

from protocol.messages import Problem
from protocol.scene import Vector

from .cold import curve_frames
from .mesh import even, stops
from .seen import Seen, see

SEGMENTS: Final = 16
FLAT: Final = 1e-3  # of the length, the least sag counted with


def guess(problem: Problem, gravity: Vector, path: ModuleType) -> Seen:
    """What a problem without a start shape may look like."""
    grasps, pull = problem.grasps, np.asarray(gravity)
    mesh = even(stops(problem), grasps.s, SEGMENTS)
    frames = curve_frames(mesh, problem, pull, path)
    weights = np.outer(mesh.lengths * mesh.along(problem.cable, "mass_per_length"), pull)
    forces = np.zeros((len(grasps.s), 3))
    held = mesh.grasp_nodes
    forces[0] -= weights[: held[0]].sum(axis=0)
    forces[-1] -= weights[held[-1] :].sum(axis=0)
    for k, (first, last) in enumerate(pairwise(held.tolist())):
        weight, chord = weights[first:last].sum(axis=0), grasps.position[k + 1] - grasps.position[k]
        length, distance = float(mesh.s[last] - mesh.s[first]), max(float(np.linalg.norm(chord)), 1e-300)
        sag = max(np.sqrt(0.375 * distance * max(length - distance, 0.0)), FLAT * length)
        along = float(np.linalg.norm(weight)) * distance / (8.0 * sag) * chord / distance
        forces[k] -= along + 0.5 * weight
        forces[k + 1] += along - 0.5 * weight
    return see(problem, gravity, mesh.s, frames, forces, np.zeros((0, 3)), path)
