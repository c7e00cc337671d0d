"""What a solved rod says: positions, tension, curvature, twist, forces and moments at its grasps and contacts."""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType

import numpy as np

from protocol.kinds import Hold
from protocol.messages import Problem

from .balance import balanced
from .equilibrium import Settled
from .numpy_path import Array, Vertices, vertices
from .rod import State
from .system import System


@dataclass(frozen=True)
class Reading:
    """Everything that a shape says in numbers, on one mesh."""

    nodes: Array  # (n, 3) m
    tension: Array  # (n-1,) N, at the middle of every segment
    curvature: Array  # (n,) 1/m
    wrenches: Array  # (g, 6) N and N m, on the cable at every grasp
    contact_forces: Array  # (m, 3) N
    energy: float  # J
    total_twist: float  # rad


def read(problem: Problem, system: System, found: Settled, path: ModuleType) -> Reading:
    """Read a settled rod."""
    rod, state, view = system.rod, found.state, found.seen
    forces = path.node_forces(rod, state, view)
    carried = path.carried_forces(forces, rod.base)
    tension = np.einsum("ij,ij->i", carried, view.axes[:, 2])
    at = vertices(state.frames, rod.lengths, rod.elastic, rod.clamp_of_node, rod.clamp_frames)
    node = np.where(at.first >= 0, at.first + 1, at.second)
    whole = 4 * at.relative[:, :3] / ((1 + at.relative[:, 3:]) * at.cells[:, None])
    curvature = np.zeros(len(view.nodes))
    np.maximum.at(curvature, node, np.hypot(whole[:, 0], whole[:, 1]))
    wrenches = np.zeros((len(problem.grasps.s), 6))
    on_grasp = system.row_grasp >= 0
    pulls = state.force[:, None] * rod.held.axis
    np.add.at(wrenches[:, :3], system.row_grasp[on_grasp], pulls[on_grasp])
    framed = [k for k, hold in enumerate(problem.grasps.hold) if hold is not Hold.HINGE]
    wrenches[framed, 3:] = _clamp_moments(at, node, rod.clamp_of_node, len(framed))
    contact_forces = np.zeros((0 if problem.contacts is None else len(problem.contacts.s), 3))
    np.add.at(contact_forces, system.bond_contact[rod.held.bond[~on_grasp]], pulls[~on_grasp])
    np.add.at(contact_forces, rod.touch.contact, state.push[:, None] * view.push)
    # The base has no rows: its force is what is left over from all others.
    wrenches[system.base, :3] = -(rod.loads.sum(axis=0) + wrenches[:, :3].sum(axis=0) + contact_forces.sum(axis=0))
    wrenches = balanced(problem, view.nodes, rod.loads, wrenches, contact_forces)
    energy = float(path.energy(rod, state, view)) + float((0.5 * rod.give * tension**2).sum() if len(rod.give) else 0.0)
    return Reading(view.nodes, tension, curvature, wrenches, contact_forces, energy, _twist(at))


def twist_of(system: System, state: State) -> float:
    """Twist [rad] of the section about the tangent, from the first node to the last."""
    rod = system.rod
    return _twist(vertices(state.frames, rod.lengths, rod.elastic, rod.clamp_of_node, rod.clamp_frames))


def _twist(at: Vertices) -> float:
    return float(4 * np.arctan(at.relative[:, 2] / (1 + at.relative[:, 3])).sum())


def contact_places(problem: Problem, system: System, found: Settled) -> Array:
    """Where along the cable every contact is (m,) [m]: the middle of its rows, by their forces; where it was if it is open."""
    if problem.contacts is None:
        return np.zeros(0)
    touch, mesh, state = system.rod.touch, system.mesh, found.state
    s = np.array(problem.contacts.s)
    place = mesh.s[touch.element] + state.fraction * mesh.lengths[touch.element]
    force = np.bincount(touch.contact, weights=state.push, minlength=len(s))
    moment = np.bincount(touch.contact, weights=state.push * place, minlength=len(s))
    return np.where(force > 0.0, moment / np.where(force > 0.0, force, 1.0), s)


def _clamp_moments(at: Vertices, node: Array, clamp_of_node: Array, count: int) -> Array:
    """Moment (c, 3) [N m] on the cable at every clamp."""
    moments = np.zeros((count, 3))
    for vertex in np.flatnonzero((at.first < 0) | (at.second < 0)):
        clamp = clamp_of_node[node[vertex]]
        sigma = at.relative[vertex, :3] / (1 + at.relative[vertex, 3])
        turned = _moment(sigma, at.law[vertex] * at.strain[vertex], at.after[vertex])
        moments[clamp] += turned if at.second[vertex] < 0 else -turned
    return moments


def _moment(sigma: Array, moment: Array, frame: Array) -> Array:
    """Moment (3,) [N m], world frame, that the part after a vertex exerts on the part before it.

    The gradient of the vertex energy with respect to a turn of the later frame, in that frame's axes, turned to the world.
    """
    s0, s1, s2 = sigma.tolist()
    m0, m1, m2 = moment.tolist()
    x, y, z, w = frame.tolist()
    plain, along = 1.0 - s0 * s0 - s1 * s1 - s2 * s2, 2.0 * (s0 * m0 + s1 * m1 + s2 * m2)
    # 4 B^T moment with B as in `vertices`, then turned by the frame.
    u = plain * m0 - 2.0 * (s1 * m2 - s2 * m1) + along * s0
    v = plain * m1 - 2.0 * (s2 * m0 - s0 * m2) + along * s1
    t = plain * m2 - 2.0 * (s0 * m1 - s1 * m0) + along * s2
    a, b, c = y * t - z * v + w * u, z * u - x * t + w * v, x * v - y * u + w * t
    return np.array([u + 2.0 * (y * c - z * b), v + 2.0 * (z * a - x * c), t + 2.0 * (x * b - y * a)])
