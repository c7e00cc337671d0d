"""What the sizes of effects are predicted from: a shape, as the last one is known from a request or as an answer has it.

    n(s) = -(sum of all forces at points up to s, and of the weight up to s)   [N], the force carried, by statics alone,
    T = n . t, Q = |n x t|: its parts along and across the tangent t,
    kappa = 2 |t_i+1 - t_i| / (l_i + l_i+1): turn of the tangent from segment to segment over their distance [1/m].

Between two held points a chord of c [m] is spanned by a length L [m] of cable: the slack L - c is what the shape lives on. A shallow
shape, catenary or arch, sags by sqrt(3 c (L - c) / 8) (the parabola's series, Irvine 1981, "Cable Structures", ch. 2), so that
a length that grows by d moves nodes by up to

    grown(d) = sqrt(3 c / 8) (sqrt(L - c + d) - sqrt(L - c)) + d   [m],

which for a nearly taut cable is much more than d.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from types import ModuleType
from typing import NamedTuple

import numpy as np

from protocol.kinds import Hold
from protocol.messages import Problem, Shape
from protocol.scene import Cable, Section, Vector

from . import numpy_path
from .cold import tangent_of
from .mesh import Mesh, from_nodes


class Size(NamedTuple):
    """What leaving an effect out could change."""

    length: float  # m, of the position of any node
    force: float  # N, of a force
    curvature: float  # 1/m


@dataclass(frozen=True)
class Span:
    """A part of the cable between neighbouring held points, or a tail from the last of them to a free end."""

    first: int  # node
    last: int  # node
    length: float  # m
    chord: float  # m; of a tail its length, for it can swing but not sag
    is_tail: bool

    def grown(self, more: float) -> float:
        """What nodes move by [m] when the span grows, or seems to grow, by `more` [m]."""
        if self.is_tail:
            return more
        slack = max(self.length - self.chord, 0.0)
        return more + math.sqrt(0.375 * self.chord) * (math.sqrt(slack + more) - math.sqrt(slack))


@dataclass(frozen=True)
class Clamp:
    """One side of a held point: what a span does there."""

    span: int
    node: int
    force: float  # N, carried there
    angle: float  # rad, between the force and the clamp's tangent; half the kink at a hinge inside the cable, zero at its ends


@dataclass(frozen=True)
class Seen:
    """A shape, and what it carries."""

    mesh: Mesh
    tangents: np.ndarray  # (n-1, 3)
    force: np.ndarray  # (n-1, 3) N, carried in the middle of every segment
    weight: np.ndarray  # (n-1,) N, of every segment
    bend: np.ndarray  # kappa (n-2,) 1/m, at every inner node
    spans: tuple[Span, ...]
    clamps: tuple[Clamp, ...]
    bending: tuple[float, float]  # N m^2, least and largest EI of the cable

    @cached_property
    def tension(self) -> np.ndarray:
        """T (n-1,) [N]; negative where the cable is pressed."""
        tension: np.ndarray = np.einsum("ij,ij->i", self.force, self.tangents)
        return tension

    @cached_property
    def shear(self) -> np.ndarray:
        """Q (n-1,) [N]."""
        across = np.einsum("ij,ij->i", self.force, self.force) - self.tension**2
        shear: np.ndarray = np.sqrt(np.maximum(across, 0.0))
        return shear

    @cached_property
    def bend_most(self) -> float:
        """Largest curvature of bending [1/m], carried on to the ends along its slope."""
        bend = self.bend
        if len(bend) < 2:
            return float(bend.max(initial=0.0))
        return float(max(bend.max(), 1.5 * bend[0] - 0.5 * bend[1], 1.5 * bend[-1] - 0.5 * bend[-2]))

    def least_tension(self, span: Span) -> float:
        """Least T of a span [N]."""
        return self._least_tensions[span.first]

    @cached_property
    def _least_tensions(self) -> dict[int, float]:
        """The same by the first node of the span."""
        return {span.first: float(self.tension[span.first : span.last].min()) for span in self.spans}

    def reach(self, span: Span) -> float:
        """How far a moment is felt [m]: sqrt(EI / T) where a span is pulled, half of it at most; of a tail, the cube root of EI / w."""
        stiff, pull = self.bending[1], max(self.least_tension(span), 1e-300)
        if not span.is_tail:
            return min(0.5 * span.length, math.sqrt(stiff / pull))
        weight = float(np.abs(self.tension[span.first : span.last]).max()) / span.length
        return min(span.length, 1.5 * math.cbrt(stiff / max(weight, 1e-300)))

    def pushed(self, at: float, force: float) -> float:
        """How far a force [N] across the cable at an arc length [m] moves it [m]: string and beam together."""
        node = int(np.searchsorted(self.mesh.s, at * (1 - 1e-9)))
        span = next((span for span in self.spans if span.first <= node <= span.last), self.spans[-1])
        pull, stiff, length = max(self.least_tension(span), 0.0), self.bending[0], span.length
        give = pull / length + 3.0 * stiff / length**3 if span.is_tail else 4.0 * pull / length + 48.0 * stiff / length**3
        return min(force / max(give, 1e-300), length)

    @cached_property
    def force_most(self) -> float:
        """Largest force carried [N]."""
        return float(np.sqrt(np.einsum("ij,ij->i", self.force, self.force).max()))

    def moved(self, by: float) -> Size:
        """What goes with nodes that move by a length [m]: a sag changes its tension in proportion, a beam 192 EI / L^3 times as much."""
        shortest, sag = self._least
        share = min(by / max(sag, 0.1 * shortest, 1e-300), 1.0)
        most = self.bending[1]
        return Size(by, share * self.force_most + 192.0 * most * by / shortest**3, share * self.bend_most + 8.0 * by / shortest**2)

    @cached_property
    def _least(self) -> tuple[float, float]:
        """Least length and least sag of a span [m]."""
        sags = [math.sqrt(max(0.375 * span.chord * (span.length - span.chord), 0.0)) for span in self.spans]
        return min(span.length for span in self.spans), min(sags)


def bending_of(cable: Cable) -> tuple[float, float]:
    """Least and largest EI of a cable [N m^2], of all its sections and about both axes; zeros without bending."""
    if cable.bending is None:
        return 0.0, 0.0
    parts: list[Cable | Section] = [cable, *cable.sections]
    values = [value for part in parts for value in (part.bending, part.bending_2) if value is not None]
    return min(values), max(values)


def seen_in(problem: Problem, gravity: Vector, shape: Shape, path: ModuleType = numpy_path) -> Seen:
    """An answer to a problem."""
    mesh = from_nodes(shape.s, problem.cable.length, problem.grasps.s)
    return see(problem, gravity, mesh, path.directors(shape.frames)[:, 2], shape.grasp_wrenches[:, :3], shape.contact_forces)


def seen_at_start(problem: Problem, gravity: Vector, path: ModuleType = numpy_path) -> Seen | None:
    """The shape that a problem starts from; None without one."""
    start = problem.start
    if start is None:
        return None
    pushes = np.zeros((0, 3)) if problem.contacts is None else problem.contacts.force
    mesh = from_nodes(start.s, problem.cable.length, problem.grasps.s)
    return see(problem, gravity, mesh, path.directors(np.array(start.frames))[:, 2], start.grasp_forces, pushes)


def see(
    problem: Problem,
    gravity: Vector,
    mesh: Mesh,
    tangents: np.ndarray,
    grasp_forces: np.ndarray,
    contact_forces: np.ndarray,
) -> Seen:
    """A shape by its nodes, its tangents (n-1, 3) and the forces on grasps (g, 3) and contacts (m, 3) [N]."""
    cable, grasps = problem.cable, problem.grasps
    forces = mesh.shared(grasps.s, grasp_forces)
    if problem.contacts is not None and len(contact_forces):
        forces += mesh.shared(problem.contacts.s, contact_forces)
    if problem.self_contacts is not None:
        forces += mesh.shared(problem.self_contacts.s[:, 0], problem.self_contacts.force)
        forces -= mesh.shared(problem.self_contacts.s[:, 1], problem.self_contacts.force)
    if problem.loads is not None:
        forces += mesh.shared(problem.loads.s, problem.loads.force)
    if cable.masses:
        forces += mesh.shared(np.array([mass.at for mass in cable.masses]), np.outer([mass.mass for mass in cable.masses], gravity))
    mass = mesh.lengths * mesh.along(cable, "mass_per_length")
    weight = mass[:, None] * np.asarray(gravity)
    carried = 0.5 * weight - (forces[:-1] + weight).cumsum(axis=0)
    turned = tangents[1:] - tangents[:-1]
    return Seen(
        mesh,
        tangents,
        carried,
        math.hypot(*gravity) * mass,
        2.0 * np.sqrt(np.einsum("ij,ij->i", turned, turned)) / (mesh.lengths[:-1] + mesh.lengths[1:]),
        _spans(problem, mesh),
        _clamps(problem, mesh, carried, weight),
        bending_of(cable),
    )


def _spans(problem: Problem, mesh: Mesh) -> tuple[Span, ...]:
    held, places, last = mesh.grasp_nodes.tolist(), problem.grasps.position.tolist(), len(mesh.s) - 1
    spans = []
    if held[0] > 0:
        spans.append(Span(0, held[0], float(mesh.s[held[0]]), float(mesh.s[held[0]]), is_tail=True))
    for k, (one, two) in enumerate(pairwise(held)):
        chord = math.dist(places[k + 1], places[k])
        spans.append(Span(one, two, float(mesh.s[two] - mesh.s[one]), chord, is_tail=False))
    if held[-1] < last:
        length = float(mesh.s[-1] - mesh.s[held[-1]])
        spans.append(Span(held[-1], last, length, length, is_tail=True))
    return tuple(spans)


def _clamps(problem: Problem, mesh: Mesh, carried: np.ndarray, weight: np.ndarray) -> tuple[Clamp, ...]:
    """Both sides of every held point."""
    out = []
    offset = 1 if mesh.grasp_nodes[0] > 0 else 0
    for k, node in enumerate(mesh.grasp_nodes.tolist()):
        sides = []
        if node > 0:
            sides.append((k + offset - 1, carried[node - 1] - 0.5 * weight[node - 1]))
        if node < len(mesh.s) - 1:
            sides.append((k + offset, carried[node] + 0.5 * weight[node]))
        kink = _angle(sides[0][1], sides[1][1]) if len(sides) == 2 else 0.0
        for span, force in sides:
            angle = _angle(force, tangent_of(problem.grasps.quaternion[k])) if problem.grasps.hold[k] is not Hold.HINGE else 0.5 * kink
            out.append(Clamp(span, node, math.hypot(*force.tolist()), angle))
    return tuple(out)


def _angle(one: np.ndarray, other: np.ndarray) -> float:
    (a, b, c), (x, y, z) = one.tolist(), other.tolist()
    return math.atan2(math.hypot(b * z - c * y, c * x - a * z, a * y - b * x), a * x + b * y + c * z)
