"""Problems for the solver under test, and an independent check of what it answers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from protocol.kinds import FRICTION_CODES, Feature, Friction, Hold, Outcome
from protocol.messages import Contacts, Grasps, Problem, Shape, Start
from protocol.scene import Cable, Vector
from shape_server import kernels

GRAVITY: Vector = (0.0, 0.0, -9.81)
WEIGHTLESS: Vector = (0.0, 0.0, 0.0)
RADIUS = 0.0045  # m, distance between axis and feature in the contacts made here
KERNELS = kernels


def cable(*, length: float = 1.0, bending: float | None = 1e-2, twist: float | None = None, mass: float = 0.1) -> Cable:
    """A cable whose twist stiffness is 0.8 of its bending stiffness unless given."""
    if twist is None and bending is not None:
        twist = 0.8 * bending
    return Cable(name="cable", length=length, diameter=2 * RADIUS, mass_per_length=mass, bending=bending, twist=twist)


def frame(tangent: object, first: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> np.ndarray:
    """(4,) Quaternion with d3 along `tangent` and d1 as near to `first` as can be."""
    d3 = np.asarray(tangent, dtype=float) / np.linalg.norm(np.asarray(tangent, dtype=float))
    for guess in (first, (1.0, 0.0, 0.0)):
        d1 = np.asarray(guess) - (np.asarray(guess) @ d3) * d3
        if np.linalg.norm(d1) > 1e-6:
            break
    d1 /= np.linalg.norm(d1)
    return Rotation.from_matrix(np.column_stack([d1, np.cross(d3, d1), d3])).as_quat()


ALONG_X = frame((1.0, 0.0, 0.0))


def grasps(*held: tuple[float, object, np.ndarray], hold: Hold = Hold.CLAMP) -> Grasps:
    """Grasps from (arc length [m], position [m], frame), all of one kind; guides after a first clamp."""
    return Grasps(
        s=np.array([row[0] for row in held], dtype=float),
        position=np.array([row[1] for row in held], dtype=float).reshape(-1, 3),
        quaternion=np.array([row[2] for row in held], dtype=float).reshape(-1, 4),
        hold=tuple(Hold.CLAMP if hold is Hold.GUIDE and k == 0 else hold for k in range(len(held))),
    )


def span(chord: float = 0.6, length: float = 1.0, *, hold: Hold = Hold.CLAMP) -> Grasps:
    """Both ends held at the same height, tangents along x."""
    return grasps((0.0, (0.0, 0.0, 0.0), ALONG_X), (length, (chord, 0.0, 0.0), ALONG_X), hold=hold)


@dataclass(frozen=True)
class Row:
    """One row of `Contacts`."""

    s: float
    point: object
    normal: object = (0.0, 0.0, 1.0)
    direction: object = (0.0, 0.0, 0.0)
    feature: Feature = Feature.FACE
    extent: tuple[float, float] = (-1.0, 1.0)  # m, of an edge on both sides of `point`
    distance: float = RADIUS
    friction: Friction = Friction.NONE
    force: object = (0.0, 0.0, 0.0)


def contacts(*rows: Row) -> Contacts:
    """The rows as a message."""
    return Contacts(
        s=np.array([row.s for row in rows], dtype=float),
        body=np.zeros(len(rows), dtype=np.int64),
        feature=np.array([int(row.feature) for row in rows], dtype=np.int64),
        point=np.array([row.point for row in rows], dtype=float).reshape(-1, 3),
        normal=np.array([row.normal for row in rows], dtype=float).reshape(-1, 3),
        direction=np.array([row.direction for row in rows], dtype=float).reshape(-1, 3),
        extent=np.array([row.extent if row.feature is Feature.EDGE else (0.0, 0.0) for row in rows], dtype=float).reshape(-1, 2),
        distance=np.array([row.distance for row in rows], dtype=float),
        friction=np.array([FRICTION_CODES.index(row.friction) for row in rows], dtype=np.int64),
        force=np.array([row.force for row in rows], dtype=float).reshape(-1, 3),
    )


def start_from(shape: Shape) -> Start:
    """The start that repeats a shape."""
    return Start(s=shape.s, frames=shape.frames, grasp_forces=np.ascontiguousarray(shape.grasp_wrenches[:, :3]))


def random_spans(count: int, bending: float, seed: int) -> list[Problem]:
    """Cables of one metre between random clamps at 0.2 to 0.95 m from each other, all directions alike."""
    rng = np.random.default_rng(seed)
    problems = []
    for _ in range(count):
        direction = rng.normal(size=3)
        end = rng.uniform(0.2, 0.95) * direction / np.linalg.norm(direction)
        first, last = Rotation.random(2, random_state=rng).as_quat()
        problems.append(Problem(cable=cable(bending=bending), grasps=grasps((0.0, (0.0, 0.0, 0.0), first), (1.0, end, last))))
    return problems


def is_honest(shape: Shape) -> bool:
    """A shape that is finite and stable, or none with a sentence."""
    if shape.outcome is Outcome.CONVERGED:
        values = (shape.nodes, shape.frames, shape.tension, shape.curvature, shape.grasp_wrenches, shape.contact_forces)
        return shape.is_stable and len(shape.s) > 1 and all(np.isfinite(value).all() for value in values)
    return len(shape.s) == 0 and len(shape.sentence) > 20


def bending_and_twist_energy(problem: Problem, s: np.ndarray, frames: np.ndarray) -> float:
    """Elastic energy [J] of the frames, from rotation angles: kappa = 4 tan(angle / 4) / cell about the axis of the turn.

    Over the half cell beside a clamp 2 tan(angle / 2) / cell.

    Written without the program under test; only the choice of cells and of these measures is the same.
    """
    cable, held = problem.cable, problem.grasps
    lengths, rotations = np.diff(s), Rotation.from_quat(frames)
    law = np.array([cable.bending, cable.bending, cable.twist or 0.0])

    def energy(before: Rotation, after: Rotation, cell: np.ndarray, share: int = 4) -> float:
        turn = (before.inv() * after).as_rotvec()
        angle = np.maximum(np.linalg.norm(turn, axis=-1, keepdims=True), 1e-300)
        strain = share * np.tan(angle / share) * turn / angle / np.reshape(cell, (-1, 1))
        return float((0.5 * np.ravel(cell)[:, None] * law * strain**2).sum())

    clamps = {int(np.argmin(np.abs(s - at))): k for k, at in enumerate(held.s) if held.hold[k] is Hold.CLAMP}
    inner = np.array([i for i in range(1, len(lengths)) if i not in clamps], dtype=int)
    total = energy(rotations[inner - 1], rotations[inner], 0.5 * (lengths[inner - 1] + lengths[inner])) if len(inner) else 0.0
    for node, k in clamps.items():
        clamp = Rotation.from_quat(held.quaternion[k : k + 1])
        if node > 0:
            total += energy(rotations[node - 1 : node], clamp, 0.5 * lengths[node - 1 : node], 2)
        if node < len(lengths):
            total += energy(clamp, rotations[node : node + 1], 0.5 * lengths[node : node + 1], 2)
    return total


def places(s: np.ndarray, frames: np.ndarray, node: int, origin: np.ndarray) -> np.ndarray:
    """Nodes (n, 3) [m] from the tangents, with one of them given."""
    tangents = Rotation.from_quat(frames).apply([0.0, 0.0, 1.0])
    nodes = np.vstack([np.zeros(3), np.cumsum(np.diff(s)[:, None] * tangents, axis=0)])
    return nodes - nodes[node] + origin


def unbalanced_moment(problem: Problem, shape: Shape, gravity: Vector) -> float:
    """Largest slope [N m] of energy less work with the turn of any segment, by differences; zero at an equilibrium.

    All forces are those of the shape: weight, grasp forces and contact forces at their arc lengths. Of a fine mesh, forty
    segments are looked at.
    """
    s, lengths = shape.s, np.diff(shape.s)
    node = int(np.argmin(np.abs(s - problem.grasps.s[0])))
    weight = np.zeros(len(s))
    weight[:-1] += 0.5 * lengths
    weight[1:] += 0.5 * lengths
    loads = np.outer(weight * problem.cable.mass_per_length, gravity)
    for at, force in zip([*problem.grasps.s[1:], *shape.contact_s], [*shape.grasp_wrenches[1:, :3], *shape.contact_forces], strict=True):
        j = min(int(np.searchsorted(s, at - 1e-12, side="right")) - 1, len(lengths) - 1) if at > 0 else 0
        share = (at - s[j]) / lengths[j]
        loads[j] += (1 - share) * force
        loads[j + 1] += share * force

    def potential(frames: np.ndarray) -> float:
        return bending_and_twist_energy(problem, s, frames) - float(np.vdot(loads, places(s, frames, node, problem.grasps.position[0])))

    worst, step = 0.0, 1e-5
    some = np.unique(np.linspace(0, len(lengths) - 1, 40).astype(int))
    for j in some:
        for k in range(3):
            sides = []
            for sign in (1.0, -1.0):
                turn = np.zeros(3)
                turn[k] = sign * step
                frames = shape.frames.copy()
                frames[j] = (Rotation.from_quat(frames[j]) * Rotation.from_rotvec(turn)).as_quat()
                sides.append(potential(frames))
            worst = max(worst, abs(sides[0] - sides[1]) / (2 * step))
    return worst


def largest_moment(problem: Problem, shape: Shape) -> float:
    """[N m] Scale for `unbalanced_moment`: the largest bending moment plus the largest force times a segment."""
    bending = problem.cable.bending or 0.0
    force = max(float(np.abs(shape.tension).max()), float(np.linalg.norm(shape.grasp_wrenches[:, :3], axis=1).max()))
    return bending * float(shape.curvature.max()) + force * float(np.diff(shape.s).max())
