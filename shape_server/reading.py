"""What a solved rod says: positions, tension, curvature, twist, forces and moments at its grasps and contacts."""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType

import numpy as np

from protocol.kinds import Hold
from protocol.messages import Problem, Rubbed

from . import effects
from .balance import balanced, cross_sum
from .border import SOFTNESS
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
    self_places: Array  # (k, 2) m, where the cable touches itself
    self_push: Array  # (k,) N
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
    contacts, loads = problem.contacts, rod.loads.sum(axis=0)
    wrenches, contact_forces = np.zeros((len(problem.grasps.s), 6)), np.zeros((0 if contacts is None else len(contacts.s), 3))
    pulls = state.force[:, None] * rod.held.rows["axis"]
    last = len(system.row_grasp) - rod.held.inclined  # rows of inclination come last, before them those of bonds
    on_grasp = last - 3 * len(system.bond_contact)
    np.add.at(wrenches[:, :3], system.row_grasp[:on_grasp], pulls[:on_grasp])
    if len(contact_forces):
        if on_grasp < last:
            np.add.at(contact_forces, system.bond_contact[rod.held.rows["bond"][on_grasp:last]], pulls[on_grasp:last])
        pushing = slice(0, system.body_rows)
        np.add.at(contact_forces, rod.touch["contact"][pushing], state.push[pushing, None] * view.push[pushing])
        if len(state.drag):
            contact_forces[rod.rub.rows["contact"]] += np.einsum("fa,fax->fx", state.drag, rod.rub.rows["axes"])
    wrenches[[k for k, hold in enumerate(problem.grasps.hold) if hold is not Hold.HINGE], 3:] = moments + more_moments
    # The base has no rows: its force is what is left over from all others.
    wrenches[system.base, :3] = -(loads + wrenches[:, :3].sum(axis=0) + contact_forces.sum(axis=0))
    held, contact_s = view.nodes[system.mesh.grasp_nodes], contact_places(problem, system, found)
    contact_moments, moment = np.zeros((0, 3)), system.couple
    if len(contact_forces):
        places = _on_axis(view.nodes, *system.mesh.locate(contact_s))
        contact_moments = _contact_moments(system, found, len(contact_forces), path) - _crosses(places, contact_forces)
        moment = contact_moments.sum(axis=0) + cross_sum(places, contact_forces) + moment
    wrenches = balanced(problem, held, view.nodes, rod.loads, wrenches, contact_forces, moment)
    energy = float(path.energy(rod, state, view)) + more_energy
    if len(rod.give):
        energy += float((0.5 * rod.give * tension**2).sum())
    return Reading(
        nodes=view.nodes,
        frames=state.frames,
        tension=tension,
        curvature=curvature,
        wrenches=wrenches,
        contact_forces=contact_forces,
        contact_moments=contact_moments,
        contact_s=contact_s,
        self_places=self_places(system, found),
        self_push=state.push[system.body_rows :],
        energy=energy,
        total_twist=float(twist),
    )


def self_places(system: System, found: Settled) -> Array:
    """Where along the cable it touches itself, (k, 2) [m]."""
    mesh = system.mesh
    first, many = len(found.state.push), len(system.rod.strands.distance)
    if not many:
        return np.zeros((0, 2))
    places = found.state.fraction[first : first + 2 * many].reshape(-1, 2)
    return np.asarray(np.interp(places, np.arange(len(mesh.s)), mesh.s))


def _contact_moments(system: System, found: Settled, count: int, path: ModuleType) -> Array:
    """Moments (m, 3) [N m] of all contacts about the world's origin.

    A bond acts at its point of the axis. What pushes acts where it touches: its moment is that of a force at the axis and the couple of
    `contact_geometry`, zero on a face, where the line of the force meets the axis.
    """
    rod, state, view = system.rod, found.state, found.seen
    last = len(rod.held.rows) - rod.held.inclined
    out = np.zeros((count, 3))
    if len(system.bond_contact):
        bonds = np.flatnonzero(rod.held.rows["bond"][:last] >= 0)
        pulls = state.force[bonds, None] * rod.held.rows["axis"][bonds]
        moments = _crosses(_on_axis(view.nodes, rod.held.rows["element"][bonds], rod.held.rows["fraction"][bonds]), pulls)
        np.add.at(out, system.bond_contact[rod.held.rows["bond"][bonds]], moments)
    for row in range(last, len(rod.held.rows)):
        couple = np.zeros_like(view.nodes)
        path.add_couples(couple, rod.held._replace(inclined=1), state.force[: row + 1], state.holds)
        out[system.bond_contact[rod.held.rows["bond"][row]]] += cross_sum(view.nodes, couple)
    element, pushing = rod.touch["element"], slice(0, system.body_rows)
    moments = _crosses(_on_axis(view.nodes, element, state.fraction[: len(element)]), view.push)
    moments += view.numbers[:, 2:3] * _crosses(view.axes[element, 2], view.normal)
    np.add.at(out, rod.touch["contact"][pushing], (state.push[:, None] * moments)[pushing])
    if len(state.drag):
        held = _on_axis(view.nodes, rod.rub.rows["element"], rod.rub.rows["fraction"])
        out[rod.rub.rows["contact"]] += _crosses(held, np.einsum("fa,fax->fx", state.drag, rod.rub.rows["axes"]))
    return out


def rubbed(problem: Problem, system: System, found: Settled, contact_s: Array, path: ModuleType) -> Rubbed | None:
    """Where the contacts with friction are held from now on; None without any.

    What slides is held where it is, less the way by which its spring gives way under the force that it bears at rest.
    """
    contacts, rod, state = problem.contacts, system.rod, found.state
    if contacts is None or contacts.rubbing is None:
        return None
    friction = effects.load("friction")
    rub, normal = rod.rub, path.normal_forces(rod, state.push)
    rest = np.array([path.drag_limit(rub, k, 0.0, normal[k])[0] for k in range(len(normal))])
    size = np.linalg.norm(state.drag, axis=1)
    share = SOFTNESS / rod.force_scale * np.minimum(1.0, rest / np.where(size > 0.0, size, 1.0))
    lag = share[:, None] * np.einsum("fa,fax->fx", state.drag, rub.rows["axes"])
    s = contact_s[rub.rows["contact"]]
    places = _on_axis(found.seen.nodes, *system.mesh.locate(s))
    answer: Rubbed = friction.rubbed(contacts, friction.laws(contacts), rub, s, places, lag, state.sticks)
    return answer


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
    touch, mesh, many = system.rod.touch, system.mesh, system.body_rows
    s, push = np.array(problem.contacts.s), found.state.push[:many]
    element, contact = touch["element"][:many], touch["contact"][:many]
    place = mesh.s[element] + found.state.fraction[:many] * mesh.lengths[element]
    force = np.bincount(contact, weights=push, minlength=len(s))
    moment = np.bincount(contact, weights=push * place, minlength=len(s))
    return np.where(force > 0.0, moment / np.where(force > 0.0, force, 1.0), s)
