"""The cheaper rungs below the rod: taut line, catenary, gradient cable; each with what it leaves out, in metres.

| model | leaves out | by how much |
| --- | --- | --- |
| taut line | all sag and bending | no node is further from the chord than sqrt(L^2 - c^2) / 2, however it is loaded |
| catenary | bending | 1.3 sqrt(EI / T) beside a clamp, T the force there (0.98 to 1.23 measured against clamped rods) |
| gradient cable | slopes beyond the third order, all that leaves the plane | predicted by `gradient_error` |

The cheapest whose left-out effects are below the tolerance is taken, unless the problem names one. The gradient cable is taken by itself
only for a cable with a micro-structure length, and only where it covers the problem and its predicted error is within the tolerance.
With a start shape, contacts or clamps inside, a cable with bending is always a rod.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from types import ModuleType
from typing import Final

import numpy as np

from protocol.kinds import Hold, Model, Outcome
from protocol.messages import Cost, Problem, Shape
from protocol.scene import Vector

from . import numpy_path
from .answer import no_shape
from .balance import balanced
from .clock import Clock
from .cold import tangent_of
from .hanging import middle_tension, not_built, solve_hanging
from .mesh import Mesh, even, stops

LAYER: Final = 1.3  # times sqrt(EI / T), what a catenary misses beside a clamp
PART_OF: Final = {"micro_length": "bending", "bend_radius": "bending"}  # counted in its size
SEGMENTS: Final = (24, 48, 96, 192, 384, 768)  # even, for Simpson's rule over pairs of them


def choose(problem: Problem, gravity: Vector, tolerance: float) -> Model:
    """The model to use: the one named, or the cheapest that keeps the tolerance."""
    if problem.model is not Model.AUTO:
        return problem.model
    if problem.cable.bending is None:
        return Model.CATENARY
    model = of_bending(problem, gravity, tolerance)
    return model if model is not Model.AUTO else Model.CATENARY if _is_soft(problem, gravity, tolerance) else Model.ROD


def of_bending(problem: Problem, gravity: Vector, tolerance: float) -> Model:
    """The model for a cable that bends, without a look at whether that matters: then `AUTO`."""
    cable, grasps = problem.cable, problem.grasps
    if problem.start is not None or not _is_plain(problem) or cable.stretch is not None or cable.natural_curvature is not None:
        return Model.ROD
    if any(problem.turns) or problem.branch or cable.bend_radius is not None:
        return Model.ROD
    if cable.micro_length is not None:
        shape = gradient_shape(problem, gravity, tolerance, (), time.perf_counter())
        is_near = shape.outcome is Outcome.CONVERGED and shape.error is not None and shape.error <= tolerance
        return Model.GRADIENT if is_near else Model.ROD
    chord = float(np.linalg.norm(grasps.position[1] - grasps.position[0]))
    if chord < cable.length * (1 - 1e-12) and 0.5 * math.sqrt(cable.length**2 - chord**2) <= tolerance:
        return Model.TAUT
    return Model.AUTO


def _is_soft(problem: Problem, gravity: Vector, tolerance: float) -> bool:
    """Whether a catenary keeps half the tolerance."""
    cable, grasps = problem.cable, problem.grasps
    chord = float(np.linalg.norm(grasps.position[1] - grasps.position[0]))
    weight = cable.mass_per_length * float(np.linalg.norm(gravity))
    assert cable.bending is not None
    # The force at an end is no less than half the weight, so only a cable this soft is worth a catenary.
    if (
        not_built(problem, weight)
        or LAYER * math.sqrt(2 * cable.bending / (weight * cable.length)) > 10 * tolerance
        or chord > cable.length
    ):
        return False
    hanging = solve_hanging(problem, gravity, tolerance)
    return hanging.outcome is Outcome.CONVERGED and _layer(problem, hanging.grasp_forces) <= 0.5 * tolerance


def _is_plain(problem: Problem) -> bool:
    """Whether the cable is held at its two ends and touches and carries nothing."""
    grasps, cable = problem.grasps, problem.cable
    at_ends = len(grasps.s) == 2 and grasps.s[0] == 0.0 and grasps.s[1] == cable.length
    return (
        at_ends
        and problem.contacts is None
        and problem.self_contacts is None
        and problem.loads is None
        and not cable.sections
        and not cable.masses
    )


def _layer(problem: Problem, grasp_forces: np.ndarray) -> float:
    """What bending moves beside the clamps [m]; zero for a cable without."""
    if problem.cable.bending is None:
        return 0.0
    least = float(np.linalg.norm(grasp_forces, axis=1).min())
    layer, micro = math.sqrt(problem.cable.bending / max(least, 1e-300)), problem.cable.micro_length or 0.0
    return LAYER * (layer + micro) / math.sqrt(1.0 + 2.0 * micro / layer)  # see `effects.micro_length`


@dataclass(frozen=True)
class Rung:
    """A shape in closed form, before it is an answer."""

    mesh: Mesh
    nodes: np.ndarray  # (n, 3) m
    frames: np.ndarray  # (n-1, 4)
    tension: np.ndarray  # (n-1,) N
    curvature: np.ndarray  # (n,) 1/m
    wrenches: np.ndarray  # (g, 6)
    contact_forces: np.ndarray  # (m, 3) N
    contact_s: np.ndarray  # (m,) m
    energy: float  # J
    error: float  # m
    error_tension: float | None  # N, None where it is not known
    left_out: dict[str, float]  # m


def answer(problem: Problem, used: tuple[str, ...], rung: Rung, model: Model, sentence: str, begun: float) -> Shape:
    """The answer that a closed form is."""
    return Shape(
        s=rung.mesh.s,
        nodes=rung.nodes,
        frames=rung.frames,
        tension=rung.tension,
        curvature=rung.curvature,
        grasp_wrenches=rung.wrenches,
        contact_forces=rung.contact_forces,
        contact_moments=np.zeros_like(rung.contact_forces),
        contact_s=rung.contact_s,
        outcome=Outcome.CONVERGED,
        sentence=sentence,
        model=model.value,
        effects=tuple(name for name in used if PART_OF.get(name, name) not in rung.left_out),
        left_out=rung.left_out,
        error=rung.error + sum(rung.left_out.values()),
        error_tension=rung.error_tension,
        error_curvature=0.0 if not rung.left_out else None,
        residual=0.0,
        iterations=0,
        energy=rung.energy,
        total_twist=0.0,
        is_stable=True,
        margin=None,
        fold=None,
        cost=Cost(solve=time.perf_counter() - begun, estimate=0.0, certify=0.0, factorisations=0, path="closed form"),
    )


def catenary_shape(
    problem: Problem,
    gravity: Vector,
    tolerance: float,
    used: tuple[str, ...],
    begun: float,
    clock: Clock | None = None,
    path: ModuleType = numpy_path,
) -> Shape:
    """Catenaries between held points, by the tolerance or by the clock."""
    hanging = solve_hanging(problem, gravity, tolerance, clock, path)
    if hanging.outcome is not Outcome.CONVERGED:
        return no_shape(problem, used, hanging.outcome, hanging.sentence, "catenary", time.perf_counter() - begun)
    wrenches = np.zeros((len(problem.grasps.s), 6))
    wrenches[:, :3] = hanging.grasp_forces
    layer = _layer(problem, hanging.grasp_forces)
    rung = Rung(
        mesh=hanging.mesh,
        nodes=hanging.nodes,
        frames=hanging.frames,
        tension=hanging.tension,
        curvature=hanging.curvature,
        wrenches=wrenches,
        contact_forces=hanging.contact_forces,
        contact_s=hanging.contact_s,
        energy=hanging.energy,
        error=hanging.sag,
        error_tension=0.0 if not layer else None,
        left_out={"bending": layer} if layer else {},
    )
    return answer(problem, used, rung, Model.CATENARY, hanging.sentence, begun)


def taut_shape(problem: Problem, gravity: Vector, used: tuple[str, ...], begun: float, path: ModuleType) -> Shape:
    """A straight line between two ends."""
    from .taut_line import lay_taut

    grasps, cable = problem.grasps, problem.cable
    if not _is_plain(problem):
        sentence = "a taut line is a cable held at its two ends that touches and carries nothing"
        return no_shape(problem, used, Outcome.UNSUPPORTED, sentence, "taut", time.perf_counter() - begun)
    mesh, load = even(stops(problem), grasps.s, SEGMENTS[0]), cable.mass_per_length * np.asarray(gravity)
    try:
        line = lay_taut(grasps.position[0], grasps.position[1], cable.length, load, mesh.s)
    except ValueError as error:
        return no_shape(problem, used, Outcome.UNREACHABLE, str(error), "taut", time.perf_counter() - begun)
    sag = {name: line.error for name in ("bending" if cable.bending is not None else "gravity",)}
    rung = Rung(
        mesh=mesh,
        nodes=line.nodes,
        frames=_frames(line.nodes, grasps.quaternion[0], path),
        tension=middle_tension(np.stack([line.tension[:-1], line.tension[1:]], axis=1), math.hypot(*load.tolist()) * mesh.lengths),
        curvature=np.zeros(len(mesh.s)),
        wrenches=np.hstack([[line.start_force, line.end_force], np.zeros((2, 3))]),
        contact_forces=np.zeros((0, 3)),
        contact_s=np.zeros(0),
        energy=-float(np.vdot(load, 0.5 * mesh.lengths @ (line.nodes[1:] + line.nodes[:-1]))),
        error=0.0,
        error_tension=line.tension_error if cable.bending is None else None,
        left_out=sag,
    )
    return answer(problem, used, rung, Model.TAUT, "straight line", begun)


def gradient_shape(
    problem: Problem,
    gravity: Vector,
    tolerance: float,
    used: tuple[str, ...],
    begun: float,
    clock: Clock | None = None,
    path: ModuleType = numpy_path,
) -> Shape:
    """The paper's moment-accepting cable, in a plane, with moderate slopes; by the tolerance or by the clock."""
    from .gradient_cable import NotCovered, lay

    grasps, cable = problem.grasps, problem.cable
    load = cable.mass_per_length * np.asarray(gravity)
    plain = _is_plain(problem) and cable.bending is not None and cable.stretch is None and cable.natural_curvature is None
    if not plain or cable.bending is None or not load.any() or Hold.GUIDE in grasps.hold:
        sentence = "the gradient cable hangs between clamps or hinges at its two ends, with weight and bending, and carries nothing else"
        return no_shape(problem, used, Outcome.UNSUPPORTED, sentence, "gradient", time.perf_counter() - begun)
    tangents = [tangent_of(q) if hold is Hold.CLAMP else None for q, hold in zip(grasps.quaternion, grasps.hold, strict=True)]
    ends = grasps.position
    for segments in SEGMENTS:
        mesh = even(stops(problem), grasps.s, segments)
        if clock is not None:
            clock.begin()
        try:
            laid = lay(ends[0], ends[1], cable.length, load, cable.bending, cable.micro_length or 0.0, tangents[0], tangents[1], mesh.s)
        except NotCovered as error:
            return no_shape(problem, used, Outcome.UNSUPPORTED, str(error), "gradient", time.perf_counter() - begun)
        sag = float(np.abs(laid.curvature).max()) * float(mesh.lengths.max()) ** 2 / 8
        if clock is not None:
            clock.level(segments)
        if sag <= tolerance if clock is None else not clock.fits(2 * segments):
            break
    aside = np.cross(grasps.position[1] - grasps.position[0], load)
    axis = aside / max(float(np.linalg.norm(aside)), 1e-300)
    wrenches = np.hstack([[laid.start_force, laid.end_force], np.outer([-laid.start_moment, laid.end_moment], -axis)])
    on_nodes = np.outer(_simpson(mesh.lengths), load)
    wrenches = balanced(problem, laid.nodes[[0, -1]], laid.nodes, on_nodes, wrenches, np.zeros((0, 3)), np.zeros(3))
    rung = Rung(
        mesh=mesh,
        nodes=laid.nodes,
        frames=_frames(laid.nodes, grasps.quaternion[0], path),
        tension=0.5 * (laid.tension[1:] + laid.tension[:-1]),
        curvature=np.abs(laid.curvature),
        wrenches=wrenches,
        contact_forces=np.zeros((0, 3)),
        contact_s=np.zeros(0),
        energy=_bending_energy(cable.bending, cable.micro_length or 0.0, laid.curvature, mesh)
        - float(np.vdot(load, 0.5 * mesh.lengths @ (laid.nodes[1:] + laid.nodes[:-1]))),
        error=laid.error + sag,
        error_tension=laid.tension_error,
        left_out={},
    )
    return answer(problem, used, rung, Model.GRADIENT, "closed form", begun)


def _simpson(lengths: np.ndarray) -> np.ndarray:
    """Share (n,) [m] of the arc length that every node stands for: Simpson's rule over pairs of equal segments (n-1,)."""
    pair = lengths[::2] + lengths[1::2]
    out = np.zeros(len(lengths) + 1)
    out[:-1:2], out[1::2] = pair / 6, 2 / 3 * pair
    out[2::2] += pair / 6
    return out


def _bending_energy(bending: float, micro_length: float, curvature: np.ndarray, mesh: Mesh) -> float:
    change = micro_length**2 * np.diff(curvature) ** 2 / mesh.lengths
    return float(0.5 * bending * (0.5 * (curvature[1:] ** 2 + curvature[:-1] ** 2) * mesh.lengths + change).sum())


def _frames(nodes: np.ndarray, first: np.ndarray, path: ModuleType) -> np.ndarray:
    """Frames (n-1, 4) from node to node, without twist from the first grasp on."""
    chords = np.diff(nodes, axis=0)
    frames: np.ndarray = path.frames_along(chords / np.linalg.norm(chords, axis=1, keepdims=True), np.array(first), 0)
    return frames
