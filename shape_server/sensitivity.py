"""Jacobians for planners: how nodes and grasp wrenches change with the poses of the grasps, at a shape that is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from protocol.errors import CablecosimError
from protocol.kinds import Hold, Outcome
from protocol.messages import Problem, Shape
from protocol.scene import Vector

from . import effects, kernels, pieces
from .equilibrium import WHY, Settled
from .mesh import from_nodes
from .response import response
from .system import build


@dataclass(frozen=True)
class Sensitivities:
    """First derivatives at a shape; a pose is a position [m] and a turn about the world's axes [rad]."""

    nodes: np.ndarray  # (n, 3, g, 6) m per m and m per rad
    wrenches: np.ndarray  # (g, 6, g, 6) N and N m, per m and per rad


def sensitivities(problem: Problem, gravity: Vector, shape: Shape) -> Sensitivities:
    """Jacobian of nodes and grasp wrenches with respect to the poses of all grasps.

    Args:
        problem: What the shape is the answer to; without contacts, guides, stretch, micro-structure length and clamps inside
            the cable.
        gravity: [m/s^2].
        shape: Converged, as `solve` answered; on its mesh.

    Raises:
        CablecosimError: If the problem has what this is not built for, or the shape is no equilibrium of it.
    """
    used = effects.asked_for(problem, gravity)
    has_more = problem.contacts is not None or Hold.GUIDE in problem.grasps.hold or problem.cable.stretch is not None
    has_more = has_more or "micro_length" in used
    if has_more or "bending" not in used or len(pieces.cuts(problem)) > 2:
        raise CablecosimError("sensitivities are built for a rod without contacts, guides, stretch, 'micro_length' and clamps inside it")
    if shape.outcome is not Outcome.CONVERGED:
        raise CablecosimError(f"sensitivities need a converged shape; this one is {shape.outcome.value}")
    mesh = from_nodes(np.array(shape.s), problem.cable.length, problem.grasps.s)
    system = build(problem, gravity, used, mesh)
    state = system.start(np.array(shape.frames))
    force = np.einsum("ij,ij->i", system.rod.held.axis, shape.grasp_wrenches[system.row_grasp, :3])
    found = Settled(*kernels.settle(system.rod, state._replace(force=force), 0.0))
    if not (found.is_converged and found.is_stable):
        raise CablecosimError(f"the shape given is no stable equilibrium of the problem: {WHY[found.why]}")
    # Once more: the derivatives are as exact as the equilibrium.
    found = Settled(*kernels.settle(system.rod, found.state, 0.0))
    framed = np.array([k for k, hold in enumerate(problem.grasps.hold) if hold is not Hold.HINGE], dtype=np.int64)
    nodes, wrenches = response(system.rod, (system.row_grasp, framed, system.base), found.state, found.seen)
    count, grasps = len(shape.s), len(problem.grasps.s)
    return Sensitivities(nodes.reshape(count, 3, grasps, 6), wrenches.reshape(grasps, 6, grasps, 6))
