"""A cable without bending under its boundary conditions: catenaries between held and bonded points."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from protocol.kinds import FRICTION_CODES, Friction, Hold, Outcome
from protocol.messages import Problem
from protocol.scene import Vector

from .catenary import Piece, hang, hang_elastic
from .mesh import Mesh, even, from_nodes, stops
from .numpy_path import frames_along

SEGMENTS = (25, 50, 100, 200, 400)


@dataclass(frozen=True)
class Hanging:
    """A shape made of catenaries, or why there is none."""

    outcome: Outcome
    sentence: str
    mesh: Mesh
    nodes: np.ndarray  # (n, 3) m
    frames: np.ndarray  # (n-1, 4)
    tension: np.ndarray  # (n-1,) N
    curvature: np.ndarray  # (n,) 1/m
    grasp_forces: np.ndarray  # (g, 3) N
    contact_forces: np.ndarray  # (m, 3) N
    energy: float  # J, of the weight, which counts from the world's origin
    sag: float  # m, largest distance of a straight segment from its catenary


def solve_hanging(problem: Problem, gravity: Vector, tolerance: float) -> Hanging:
    """The catenaries of a cable without bending.

    Bonded contacts are points that hold the cable; one that would pull it towards its body is dropped, the hardest
    pulling first. Frictionless contacts are not built for this model, and answered as unsupported.
    """
    grasps, contacts = problem.grasps, problem.contacts
    load = problem.cable.mass_per_length * np.asarray(gravity)
    empty = even(stops(problem), grasps.s, 1)
    count = 0 if contacts is None else len(contacts.s)
    if contacts is not None and (contacts.friction != FRICTION_CODES.index(Friction.BOND)).any():
        sentence = "a cable without bending meets only bonded contacts; give the cable 'bending' and 'twist' for frictionless ones"
        return _nothing(Outcome.UNSUPPORTED, sentence, empty, len(grasps.s), count)
    sentence = not_built(problem, float(np.linalg.norm(load)))
    if contacts is not None and contacts.inclination is not None and contacts.inclination.any():
        sentence = "a cable without bending has no inclination to fix; give the cable 'bending' and 'twist', or leave the inclination free"
    if sentence:
        return _nothing(Outcome.UNSUPPORTED, sentence, empty, len(grasps.s), count)
    kept = _separate(problem)
    while True:
        hanging = _with_bonds(problem, load, tolerance, kept, count)
        if contacts is None or hanging.outcome is not Outcome.CONVERGED or not len(kept):
            return hanging
        push = np.einsum("ij,ij->i", hanging.contact_forces[kept], contacts.normal[kept])
        if push.min() >= 0.0:
            return hanging
        kept = np.delete(kept, int(np.argmin(push)))


def not_built(problem: Problem, weight: float) -> str:
    """What the catenary does not know of in a problem, as a sentence; empty if it covers it."""
    cable = problem.cable
    if not weight > 0.0:
        return "a cable without bending and without weight has no definite shape; give it a mass per length and gravity, or bending"
    for name, asked in (("sections", cable.sections), ("masses", cable.masses), ("loads", problem.loads is not None)):
        if asked:
            return f"a catenary is not built for '{name}'; give the cable 'bending' and 'twist', however small, and it is solved as a rod"
    if any(hold is Hold.GUIDE for hold in problem.grasps.hold):
        return "a catenary is not built for guides; give the cable 'bending' and 'twist', however small, and it is solved as a rod"
    return ""


def _separate(problem: Problem) -> np.ndarray:
    """Indices of the bonds that hold a place of their own: no second one, none where a gripper holds."""
    if problem.contacts is None:
        return np.zeros(0, dtype=np.int64)
    taken, kept = list(problem.grasps.s), []
    for index, place in enumerate(problem.contacts.s):
        if np.abs(np.array(taken) - place).min() > 1e-9 * problem.cable.length:
            taken.append(place)
            kept.append(index)
    return np.array(kept, dtype=np.int64)


def _with_bonds(problem: Problem, load: np.ndarray, tolerance: float, kept: np.ndarray, contact_count: int) -> Hanging:
    grasps, contacts = problem.grasps, problem.contacts
    s, points = grasps.s, grasps.position
    if contacts is not None and len(kept):
        s = np.concatenate([s, contacts.s[kept]])
        points = np.concatenate([points, contacts.point[kept] + contacts.distance[kept, None] * contacts.normal[kept]])
    order = np.argsort(s, kind="stable")
    for first, last in pairwise(order):
        span, chord = s[last] - s[first], float(np.linalg.norm(points[last] - points[first]))
        if chord > span * (1 + 1e-12) and problem.cable.stretch is None:
            sentence = (
                f"the points held at s = {s[first]:.4g} m and {s[last]:.4g} m are {chord:.6g} m apart, "
                f"further than the {span:.6g} m of cable between them"
            )
            return _nothing(Outcome.UNREACHABLE, sentence, even(stops(problem), grasps.s, 1), len(grasps.s), contact_count)
    if problem.start is not None:
        mesh = from_nodes(np.array(problem.start.s), problem.cable.length, grasps.s)
        return _pieces(problem, load, mesh, s, points, order, kept, contact_count)
    for segments in SEGMENTS:
        mesh = even(stops(problem), grasps.s, segments)
        hanging = _pieces(problem, load, mesh, s, points, order, kept, contact_count)
        if hanging.sag <= tolerance:
            return hanging
    sentence = f"closed form; a straight segment is {hanging.sag:.2g} m from the curve, above the tolerance of {tolerance:.2g} m"
    return replace(hanging, sentence=sentence)


def _pieces(
    problem: Problem,
    load: np.ndarray,
    mesh: Mesh,
    s: np.ndarray,
    points: np.ndarray,
    order: np.ndarray,
    kept: np.ndarray,
    contact_count: int,
) -> Hanging:
    nodes, tension, curvature = np.empty((len(mesh.s), 3)), np.empty(len(mesh.s)), np.zeros(len(mesh.s))
    forces = np.zeros((len(s), 3))
    first, last = order[0], order[-1]
    for end, tail in ((first, mesh.s <= s[first]), (last, mesh.s >= s[last])):
        below = np.abs(mesh.s[tail] - s[end])
        length = float(below.max())
        down = (
            below
            if problem.cable.stretch is None
            else below + (below * length - 0.5 * below**2) * np.linalg.norm(load) / problem.cable.stretch
        )
        nodes[tail] = points[end] + np.outer(down, load / np.linalg.norm(load))
        tension[tail] = np.linalg.norm(load) * (length - below)
        forces[end] -= length * load
    for first, last in pairwise(order):
        inside = (mesh.s >= s[first]) & (mesh.s <= s[last])
        ends = (points[first], points[last], float(s[last] - s[first]), load)
        own, stretch = mesh.s[inside] - s[first], problem.cable.stretch
        piece: Piece = hang(*ends, own) if stretch is None else hang_elastic(*ends, stretch, own)
        nodes[inside], tension[inside], curvature[inside] = piece.nodes, piece.tension, piece.curvature
        forces[first] += piece.start_force
        forces[last] += piece.end_force
    grasp_count = len(problem.grasps.s)
    contact_forces = np.zeros((contact_count, 3))
    contact_forces[kept] = forces[grasp_count:]
    chords = np.diff(nodes, axis=0)
    tangents = chords / np.maximum(np.linalg.norm(chords, axis=1), 1e-300)[:, None]
    return Hanging(
        outcome=Outcome.CONVERGED,
        sentence="closed form",
        mesh=mesh,
        nodes=nodes,
        frames=frames_along(tangents, problem.grasps.quaternion[0], int(mesh.grasp_nodes[0])),
        tension=0.5 * (tension[:-1] + tension[1:]),
        curvature=curvature,
        grasp_forces=forces[:grasp_count],
        contact_forces=contact_forces,
        energy=-float(np.vdot(load, 0.5 * mesh.lengths @ (nodes[1:] + nodes[:-1]))),
        sag=float((np.maximum(curvature[:-1], curvature[1:]) * mesh.lengths**2 / 8).max()),
    )


def _nothing(outcome: Outcome, sentence: str, mesh: Mesh, grasp_count: int, contact_count: int) -> Hanging:
    count = len(mesh.s)
    frames = np.tile([0.0, 0.0, 0.0, 1.0], (count - 1, 1))
    return Hanging(
        outcome=outcome,
        sentence=sentence,
        mesh=mesh,
        nodes=np.zeros((count, 3)),
        frames=frames,
        tension=np.zeros(count - 1),
        curvature=np.zeros(count),
        grasp_forces=np.zeros((grasp_count, 3)),
        contact_forces=np.zeros((contact_count, 3)),
        energy=0.0,
        sag=math.inf,
    )
