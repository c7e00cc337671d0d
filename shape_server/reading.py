"""What a solved rod says: positions, tension, curvature, twist, forces and moments at its grasps and contacts."""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType

import numpy as np

from protocol.kinds import Hold
from protocol.messages import Problem

from .balance import balanced, cross_sum
from .equilibrium import Settled
from .rod import State
from .system import System

Array = np.ndarray


@dataclass(frozen=True)
class Reading:
    """Everything that a shape says in numbers, on one mesh."""

    nodes: Array  # (n, 3) m
    frames: Array  # (n-1, 4)
    tension: Array  # (n-1,) N, at the middle of every segment
    curvature: Array  # (n,) 1/m
    wrenches: Array  # (g, 6) N and N m, on the cable at every grasp
    contact_forces: Array  # (m, 3) N
    contact_moments: Array  # (m, 3) N m, about the axis at `contact_s`
    contact_s: Array  # (m,) m
    energy: float  # J
    total_twist: float  # rad


def read(problem: Problem, system: System, found: Settled, path: ModuleType) -> Reading:
    """Read a settled rod."""
    return _read(problem, system, found, path, 0.0, 0.0)


def read_mended(problem: Problem, system: System, found: Settled, path: ModuleType) -> Reading:
    """Read a settled rod with what its half cells at clamps lack, see `half_cells`."""
    if not len(system.rod.clamp_frames):
        return read(problem, system, found, path)
    rod, state = system.rod, State(*found.state)
    turn, force, moments, energy = path.mend(rod, state, found.seen)
    mended = state._replace(frames=path.retract(state.frames, turn), force=state.force + force)
    state, view = path.look(rod, mended, found.seen.push)
    return _read(problem, system, found._replace(state=state, seen=view), path, moments, float(energy))


def _read(problem: Problem, system: System, found: Settled, path: ModuleType, more_moments: Array | float, more_energy: float) -> Reading:
    """Read a rod whose clamps bear moments (c, 3) [N m], and which stores energy, that its cells do not tell of."""
    rod, state, view = system.rod, found.state, found.seen
    tension, curvature, twist, moments = path.section_forces(rod, state, view)
    wrenches = np.zeros((len(problem.grasps.s), 6))
    contact_forces = np.zeros((0 if problem.contacts is None else len(problem.contacts.s), 3))
    pulls = state.force[:, None] * rod.held.axis
    on_grasp = len(system.row_grasp) - 3 * len(system.bond_contact)  # rows of bonds come last
    np.add.at(wrenches[:, :3], system.row_grasp[:on_grasp], pulls[:on_grasp])
    if len(contact_forces):
        np.add.at(contact_forces, system.bond_contact[rod.held.bond[on_grasp:]], pulls[on_grasp:])
        np.add.at(contact_forces, rod.touch.contact, state.push[:, None] * view.push)
    wrenches[[k for k, hold in enumerate(problem.grasps.hold) if hold is not Hold.HINGE], 3:] = moments + more_moments
    # The base has no rows: its force is what is left over from all others.
    wrenches[system.base, :3] = -(rod.loads.sum(axis=0) + wrenches[:, :3].sum(axis=0) + contact_forces.sum(axis=0))
    held = view.nodes[system.mesh.grasp_nodes]
    contact_s = contact_places(problem, system, found)
    places = _on_axis(view.nodes, *system.mesh.locate(contact_s))
    contact_moments = _contact_moments(system, found, len(contact_forces)) - _crosses(places, contact_forces)
    moment = contact_moments.sum(axis=0) + cross_sum(places, contact_forces)
    wrenches = balanced(problem, held, view.nodes, rod.loads, wrenches, contact_forces, moment)
    energy = float(path.energy(rod, state, view)) + more_energy
    if len(rod.give):
        energy += float((0.5 * rod.give * tension**2).sum())
    return Reading(view.nodes, state.frames, tension, curvature, wrenches, contact_forces, contact_moments, contact_s, energy, float(twist))


def _contact_moments(system: System, found: Settled, count: int) -> Array:
    """Moments (m, 3) [N m] of all contacts about the world's origin.

    A bond acts at its point of the axis. What pushes acts where it touches: its moment is that of a force at the axis and the couple of
    `contact_geometry`, zero on a face, where the line of the force meets the axis.
    """
    rod, state, view = system.rod, found.state, found.seen
    out, bonds = np.zeros((count, 3)), np.flatnonzero(rod.held.bond >= 0)
    if len(bonds):
        pulls = state.force[bonds, None] * rod.held.axis[bonds]
        moments = _crosses(_on_axis(view.nodes, rod.held.element[bonds], rod.held.fraction[bonds]), pulls)
        np.add.at(out, system.bond_contact[rod.held.bond[bonds]], moments)
    moments = _crosses(_on_axis(view.nodes, rod.touch.element, state.fraction), view.push)
    moments += view.numbers[:, 2:3] * _crosses(view.axes[rod.touch.element, 2], view.normal)
    np.add.at(out, rod.touch.contact, state.push[:, None] * moments)
    return out


def _crosses(first: Array, second: Array) -> Array:
    """Vector products (k, 3) of rows; for a few of them np.cross takes five times as long."""
    after, before = [1, 2, 0], [2, 0, 1]
    return np.asarray(first[:, after] * second[:, before] - first[:, before] * second[:, after])


def _on_axis(nodes: Array, element: Array, fraction: Array) -> Array:
    """Points (k, 3) [m] at fractions (k,) of segments (k,)."""
    return np.asarray((1.0 - fraction)[:, None] * nodes[element] + fraction[:, None] * nodes[element + 1])


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
