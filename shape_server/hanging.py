"""A cable without bending under its boundary conditions: catenaries between held points."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from protocol.kinds import Hold, Outcome
from protocol.messages import Problem
from protocol.scene import Vector

from . import numpy_path
from .catenary import Piece, hang, hang_elastic
from .clock import Clock
from .mesh import Mesh, even, from_nodes, stops

if TYPE_CHECKING:
    from .arcs import Laid

CLOSED_FORM = "closed form"
SEGMENTS = (25, 50, 100, 200, 400)
STEEPER = 1.02  # times the curvature at its ends, inside a segment: 0.2 % more deviation were seen in 24 random catenaries


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
    contact_s: np.ndarray  # (m,) m, where along the cable each contact is
    sag: float  # m, largest distance of a straight segment from its catenary


def solve_hanging(
    problem: Problem, gravity: Vector, tolerance: float, clock: Clock | None = None, path: ModuleType = numpy_path
) -> Hanging:
    """The catenaries of a cable without bending; what touches it is the matter of `touching`.

    With a clock on the finest mesh that fits into its budget, whatever the tolerance.
    """
    load = problem.cable.mass_per_length * np.asarray(gravity)
    sentence = not_built(problem, float(np.linalg.norm(load)))
    touched = problem.contacts
    if touched is not None and touched.inclination is not None and touched.inclination.any():
        sentence = "a cable without bending has no inclination to fix; give the cable 'bending' and 'twist', or leave the inclination free"
    if sentence:
        return nothing(problem, Outcome.UNSUPPORTED, sentence)
    if touched is not None:
        from .touching import solve_touching

        return solve_touching(problem, load, tolerance, clock, path)
    grasps = problem.grasps
    for first, last in pairwise(range(len(grasps.s))):
        span, chord = grasps.s[last] - grasps.s[first], float(np.linalg.norm(grasps.position[last] - grasps.position[first]))
        if chord > span * (1 + 1e-12) and problem.cable.stretch is None:
            sentence = (
                f"the points held at s = {grasps.s[first]:.4g} m and {grasps.s[last]:.4g} m are {chord:.6g} m apart, "
                f"further than the {span:.6g} m of cable between them"
            )
            return nothing(problem, Outcome.UNREACHABLE, sentence)
    if problem.start is not None:
        mesh = from_nodes(np.array(problem.start.s), problem.cable.length, grasps.s)
        return pieces_of(problem, load, mesh, grasps.s, grasps.position, path)
    meshes = [even(stops(problem), grasps.s, segments) for segments in SEGMENTS]
    return on_finer(lambda mesh: pieces_of(problem, load, mesh, grasps.s, grasps.position, path), meshes, tolerance, clock)


def on_finer(made: Callable[[Mesh], Hanging], meshes: Sequence[Mesh], tolerance: float, clock: Clock | None) -> Hanging:
    """The shape on the first mesh that is fine enough; with a clock on the finest one that fits into its budget, whatever the tolerance."""
    for mesh in meshes:
        if clock is not None:
            clock.begin()
        hanging = made(mesh)
        if clock is not None:
            clock.level(len(mesh.lengths))
            if not clock.fits(2 * len(mesh.lengths)):
                return hanging
        elif hanging.sag <= tolerance:
            return hanging
    return hanging if clock is not None else replace(hanging, sentence=too_coarse(hanging.sag, tolerance))


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


def too_coarse(sag: float, tolerance: float) -> str:
    """What to say where no mesh is fine enough."""
    return f"closed form; a straight segment is {sag:.2g} m from the curve, above the tolerance of {tolerance:.2g} m"


def pieces_of(
    problem: Problem,
    load: np.ndarray,
    mesh: Mesh,
    s: np.ndarray,
    points: np.ndarray,
    path: ModuleType = numpy_path,
    arcs: Sequence[Laid] = (),
) -> Hanging:
    """Catenaries through points (k, 3) [m] at arc lengths s (k,) [m]: the grasps, then what else holds the cable.

    Between the two points at which an arc begins and ends the cable lies in that. Forces of what comes after the grasps are the first
    rows of `contact_forces`.
    """
    order = np.argsort(s, kind="stable")
    nodes, tension, curvature = np.empty((len(mesh.s), 3)), np.empty((len(mesh.lengths), 2)), np.zeros(len(mesh.s))
    forces = np.zeros((len(s), 3))
    first, last = order[0], order[-1]
    for end, tail in ((first, mesh.s <= s[first]), (last, mesh.s >= s[last])):
        nodes[tail], pulls, pull = _tail(problem, load, points[end], np.abs(mesh.s[tail] - s[end]))
        tension[_segments(tail)] = _pairs(pulls)
        forces[end] += pull
    lies = np.zeros(len(mesh.lengths), dtype=bool)
    for first, last in pairwise(order):
        inside = (mesh.s >= s[first]) & (mesh.s <= s[last])
        laid = next((arc for arc in arcs if arc.s[0] == s[first]), None)
        if laid is not None:
            nodes[inside], pulls, curvature[inside] = laid.at(mesh.s[inside])
            tension[_segments(inside)] = _pairs(pulls)
            forces[first] -= laid.force[0]
            forces[last] += laid.force[-1]
            lies |= (mesh.s[:-1] >= s[first]) & (mesh.s[1:] <= s[last])
            continue
        ends = (points[first], points[last], float(s[last] - s[first]), load)
        own, stretch = mesh.s[inside] - s[first], problem.cable.stretch
        piece: Piece = hang(*ends, own) if stretch is None else hang_elastic(*ends, stretch, own)
        nodes[inside], curvature[inside] = piece.nodes, np.maximum(curvature[inside], piece.curvature)
        tension[_segments(inside)] = _pairs(piece.tension)
        forces[first] += piece.start_force
        forces[last] += piece.end_force
    grasp_count = len(problem.grasps.s)
    hung = float(np.linalg.norm(load)) * mesh.lengths
    sag = _sag(tension, curvature, mesh.lengths, hung)
    sag[lies] = (0.125 * np.maximum(curvature[1:], curvature[:-1]) * mesh.lengths**2)[lies]
    chords = np.diff(nodes, axis=0)
    tangents = chords / np.maximum(np.linalg.norm(chords, axis=1), 1e-300)[:, None]
    return Hanging(
        outcome=Outcome.CONVERGED,
        sentence=CLOSED_FORM,
        mesh=mesh,
        nodes=nodes,
        frames=path.frames_along(tangents, np.array(problem.grasps.quaternion[0]), int(mesh.grasp_nodes[0])),
        tension=np.where(lies, tension.mean(axis=1), middle_tension(tension, hung)),
        curvature=curvature,
        grasp_forces=forces[:grasp_count],
        contact_forces=forces[grasp_count:],
        contact_s=s[grasp_count:],
        energy=-float(np.vdot(load, 0.5 * mesh.lengths @ (nodes[1:] + nodes[:-1]))),
        sag=float(sag.max()),
    )


def _tail(problem: Problem, load: np.ndarray, top: np.ndarray, below: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A free end below a point (3,) [m]: nodes (k, 3) [m] and tension (k,) [N] so far along it (k,) [m], and what holds it (3,) [N]."""
    weight, length, stretch = float(np.linalg.norm(load)), float(below.max()), problem.cable.stretch
    down = below if stretch is None else below + (below * length - 0.5 * below**2) * weight / stretch
    return top + np.outer(down, load / weight), weight * (length - below), -length * load


def middle_tension(tension: np.ndarray, hung: np.ndarray) -> np.ndarray:
    """Tension (n-1,) [N] in the middle of segments that hang freely, by that at both their ends (n-1, 2) [N] and their weights (n-1,) [N].

    The force is linear along the cable, so that T^2 in the middle is the mean of T^2 at the ends less the weight squared over four.
    """
    return np.asarray(np.sqrt(np.maximum(0.5 * (tension**2).sum(axis=1) - 0.25 * hung**2, 0.0)))


def _segments(nodes: np.ndarray) -> np.ndarray:
    """Which segments (n-1,) lie between nodes (n,) of a part."""
    return np.asarray(nodes[:-1] & nodes[1:])


def _pairs(values: np.ndarray) -> np.ndarray:
    """Values (k,) at nodes as those at both ends of the segments between them, (k-1, 2)."""
    return np.stack([values[:-1], values[1:]], axis=1)


def _sag(tension: np.ndarray, curvature: np.ndarray, lengths: np.ndarray, hung: np.ndarray) -> np.ndarray:
    """Distance (n-1,) [m] that the curve may have from the segments between its nodes: largest curvature times length squared over eight.

    Curvature is w H / T^2. Inside a segment at whose ends the vertical force V, which grows by w l, is of different signs, it is w / H.

    Args:
        tension: (n-1, 2) [N] At both ends of the segments, T^2 = H^2 + V^2.
        curvature: (n,) [1/m] At the nodes.
        lengths: (n-1,) [m].
        hung: (n-1,) [N] Weights of the segments.
    """
    first, last = tension.T
    upright = 0.5 * ((last**2 - first**2) / hung - hung)
    level = np.sqrt(np.maximum(first**2 - upright**2, 0.0))
    turns = (upright < 0.0) & (upright + hung > 0.0)
    steepest = np.where(turns, hung / (lengths * np.maximum(level, 1e-300)), STEEPER * np.maximum(curvature[:-1], curvature[1:]))
    sag: np.ndarray = np.minimum(steepest * lengths**2 / 8, 0.5 * lengths)
    return sag


def nothing(problem: Problem, outcome: Outcome, sentence: str) -> Hanging:
    """No shape, and why."""
    mesh, count = even(stops(problem), problem.grasps.s, 1), len(problem.contacts.s) if problem.contacts is not None else 0
    nodes = len(mesh.s)
    return Hanging(
        outcome=outcome,
        sentence=sentence,
        mesh=mesh,
        nodes=np.zeros((nodes, 3)),
        frames=np.tile([0.0, 0.0, 0.0, 1.0], (nodes - 1, 1)),
        tension=np.zeros(nodes - 1),
        curvature=np.zeros(nodes),
        grasp_forces=np.zeros((len(problem.grasps.s), 3)),
        contact_forces=np.zeros((count, 3)),
        contact_s=np.zeros(count),
        energy=0.0,
        sag=math.inf,
    )
