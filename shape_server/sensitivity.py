"""Jacobians for planners: how nodes and grasp wrenches change with the poses of the grasps, at a shape that is known."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import msgspec
import numpy as np

from protocol.errors import CablecosimError
from protocol.kinds import Outcome
from protocol.messages import Problem, Shape, Start
from protocol.scene import Vector

from . import effects, kernels, pieces
from .equilibrium import WHY, Settled
from .mesh import from_nodes
from .response import response
from .system import System, build

REPEATS: Final = 50
AT_REST: Final = 1e-12  # of the length; a repeat that moves the nodes by less is the last one
WEAK: Final = 1e-6  # of the typical force, and of the length; a contact with less of both is about to open or to close


@dataclass(frozen=True)
class Sensitivities:
    """First derivatives at a shape; a pose is a position [m] and a turn about the world's axes [rad].

    The turn of a hinge moves nothing. The wrench of a guide is that at the point that it has let slide.
    """

    nodes: np.ndarray  # (n, 3, g, 6) m per m and m per rad
    wrenches: np.ndarray  # (g, 6, g, 6) N and N m, per m and per rad
    sentence: str  # which contacts are about to open or to close; empty where the shape has derivatives on both sides


def sensitivities(problem: Problem, gravity: Vector, shape: Shape) -> Sensitivities:
    """Jacobian of nodes and grasp wrenches with respect to the poses of all grasps.

    Contacts stay where they are in the world. Those that push stay closed and those that are open stay open, as for any motion that is
    small enough. Where one neither pushes nor is open, the shape has derivatives on one side only: those given are for motions that
    keep the contacts which now push, and `sentence` names the contacts that may not.

    Args:
        problem: What the shape is the answer to.
        gravity: [m/s^2].
        shape: Converged, of a rod, as `solve` answered; on its mesh.

    Raises:
        CablecosimError: If the shape is not that of a rod, or no equilibrium of the problem, or a contact has friction.
    """
    if shape.outcome is not Outcome.CONVERGED:
        raise CablecosimError(f"sensitivities need a converged shape; this one is {shape.outcome.value}")
    if shape.model != "rod":
        raise CablecosimError(f"sensitivities are built for a rod; this shape is of the model {shape.model}")
    if effects.rubs(problem):
        raise CablecosimError(f"sensitivities are not built {effects.WITH_FRICTION}")
    if problem.self_contacts is not None or problem.cable.bend_radius is not None:
        raise CablecosimError("sensitivities are not built for self-contacts and 'bend_radius'; take differences of solve()")
    if problem.contacts is not None and problem.contacts.inclination is not None and problem.contacts.inclination.any():
        raise CablecosimError("sensitivities are not built for a fixed inclination; take differences of solve()")
    begun = Start(s=shape.s, frames=shape.frames, grasp_forces=np.ascontiguousarray(shape.grasp_wrenches[:, :3]))
    touched = problem.contacts
    if touched is not None:
        touched = msgspec.structs.replace(touched, force=shape.contact_forces)
    problem = msgspec.structs.replace(problem, start=begun, contacts=touched)
    grasps, ends = len(problem.grasps.s), pieces.cuts(problem)
    places = [pieces.of_piece(problem, first, last) for first, last in pairwise(ends)]
    parts = pieces.split(problem, gravity) if len(ends) > 2 else [problem]
    nodes, wrenches = [np.zeros((0, 3, grasps, 6))], np.zeros((grasps, 6, grasps, 6))
    weak: list[int] = []
    for part, (held, contacts) in zip(parts, places, strict=True):
        system, found = _settled(part, gravity)
        moved, felt = response(system, part.grasps, found.state, found.seen)
        own = np.zeros((len(moved), 3, grasps, 6))
        own[:, :, held] = moved.reshape(-1, 3, len(held), 6)
        # The node at a clamp between two pieces is in both.
        nodes = [*nodes[:-1], nodes[-1][:-1], own]
        wrenches[np.ix_(held, np.arange(6), held)] += felt.reshape(len(held), 6, len(held), 6)
        weak += contacts[_weak(system, found)].tolist()
    return Sensitivities(np.concatenate(nodes), wrenches, _sentence(weak))


def _settled(problem: Problem, gravity: Vector) -> tuple[System, Settled]:
    """The equations of one piece, and the start shape settled until nothing moves: the derivatives are as exact as the equilibrium."""
    start = problem.start
    assert start is not None
    mesh = from_nodes(np.array(start.s), problem.cable.length, problem.grasps.s)
    system = build(problem, gravity, effects.asked_for(problem, gravity), mesh)
    found = Settled(*kernels.settle(system.rod, system.start(np.array(start.frames)), 0.0))
    for _ in range(REPEATS):
        if not (found.is_converged and found.is_stable):
            raise CablecosimError(f"the shape given is no stable equilibrium of the problem: {WHY[found.why]}")
        before = found.seen.nodes
        found = Settled(*kernels.settle(system.rod, found.state, 0.0))
        if np.abs(found.seen.nodes - before).max() < AT_REST * problem.cable.length:
            break
    return system, found


def _weak(system: System, found: Settled) -> np.ndarray:
    """Contacts of the problem that are about to open, to close, or to be dropped."""
    rod, state = system.rod, found.state
    force, distance = WEAK * rod.force_scale, WEAK * rod.length
    rows = np.where(state.push > 0.0, state.push < force, found.seen.gap < distance)
    own = rod.held.rows["bond"] >= 0
    bond, axis = rod.held.rows["bond"][own], rod.held.rows["axis"][own]
    bonds, stray = np.zeros((len(state.holds), 3)), np.zeros((len(state.holds), 3))
    np.add.at(bonds, bond, state.force[own, None] * axis)
    np.add.at(stray, bond, found.seen.miss[own, None] * axis)
    push = np.einsum("bx,bx->b", bonds, rod.held.normal)
    loose = np.where(state.holds, push < force, np.linalg.norm(stray, axis=1) < distance)  # or just dropped, and where it was
    return np.unique(np.concatenate([rod.touch["contact"][rows], system.bond_contact[loose]]))


def _sentence(weak: list[int]) -> str:
    if not weak:
        return ""
    names = ", ".join(str(contact) for contact in sorted(weak))
    return f"contacts about to open or to close: {names}; the derivatives hold for motions that leave open and closed contacts as they are"
