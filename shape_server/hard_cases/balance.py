"""Whether a shape is in balance, counted without the solver: by differences of an energy written a second time.

Energy and work are those of a chain of rigid segments of lengths l_j with one frame each. The energy between two frames is
1/2 cell (strain . stiffness strain) with strain = 4 tan(angle / 4) / cell about the axis of the turn, over the half cell beside a clamp
2 tan(angle / 2) / cell. The slope of energy less work with the turn of every segment must vanish.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from protocol.hard_case import Check
from protocol.kinds import Hold
from protocol.messages import Problem, Shape
from protocol.scene import Vector

STEP: Final = 1e-5  # rad, of the differences


def unbalanced_moment(problem: Problem, shape: Shape, gravity: Vector) -> float:
    """Largest slope [N m] of energy less work with the turn of any segment; zero at an equilibrium of a uniform round rod.

    All forces are those of the shape: weight, grasp forces and contact forces at their arc lengths.
    """
    lengths, rotations = np.diff(shape.s), Rotation.from_quat(shape.frames)
    tangents = rotations.apply([0.0, 0.0, 1.0])
    later = _forces_after(problem, shape, gravity)
    if problem.cable.stretch is not None:
        lengths = lengths * (1 + shape.tension / problem.cable.stretch)
    worst = 0.0
    for axis in STEP * np.eye(3):
        sides = []
        for sign in (1.0, -1.0):
            turned = rotations * Rotation.from_rotvec(sign * axis)
            work = lengths * np.einsum("ij,ij->i", later, turned.apply([0.0, 0.0, 1.0]) - tangents)
            sides.append(_energies(problem, shape, rotations, turned) - work)
        worst = max(worst, float(np.abs(sides[0] - sides[1]).max()) / (2 * STEP))
    return worst


def _forces_after(problem: Problem, shape: Shape, gravity: Vector) -> np.ndarray:
    """(n-1, 3) [N] Sum of all forces beyond each segment, and of the shares on it."""
    s, lengths = shape.s, np.diff(shape.s)
    weight = np.zeros(len(s))
    weight[:-1] += 0.5 * lengths
    weight[1:] += 0.5 * lengths
    loads = np.outer(weight * problem.cable.mass_per_length, gravity)
    rows = [*zip(problem.grasps.s, shape.grasp_wrenches[:, :3], strict=True), *zip(shape.contact_s, shape.contact_forces, strict=True)]
    if problem.loads is not None:
        rows += zip(problem.loads.s, problem.loads.force, strict=True)
    for at, force in rows:
        j = int(np.clip(np.searchsorted(s, at - 1e-12, side="right") - 1, 0, len(lengths) - 1))
        share = (at - s[j]) / lengths[j]
        loads[j] += (1 - share) * force
        loads[j + 1] += share * force
    return np.asarray(np.cumsum(loads[::-1], axis=0)[::-1][1:])


def _energies(problem: Problem, shape: Shape, rotations: Rotation, turned: Rotation) -> np.ndarray:
    """(n-1,) [J] Elastic energy of the cells at both ends of each segment, with that segment alone turned."""
    held, s, lengths = problem.grasps, shape.s, np.diff(shape.s)
    law = np.array([problem.cable.bending, problem.cable.bending, problem.cable.twist], dtype=float)
    clamps = {int(np.argmin(np.abs(s - at))): k for k, at in enumerate(held.s) if held.hold[k] is not Hold.HINGE}
    inner = np.array([i for i in range(1, len(lengths)) if i not in clamps], dtype=int)
    cells = 0.5 * (lengths[inner - 1] + lengths[inner])
    total = np.zeros(len(lengths))
    total[inner] += _energy(law, rotations[inner - 1], turned[inner], cells, 4)
    total[inner - 1] += _energy(law, turned[inner - 1], rotations[inner], cells, 4)
    for node, k in clamps.items():
        clamp = Rotation.from_quat(held.quaternion[k : k + 1])
        if node > 0:
            total[node - 1 : node] += _energy(law, turned[node - 1 : node], clamp, 0.5 * lengths[node - 1 : node], 2)
        if node < len(lengths):
            total[node : node + 1] += _energy(law, clamp, turned[node : node + 1], 0.5 * lengths[node : node + 1], 2)
    return total


def _energy(law: np.ndarray, before: Rotation, after: Rotation, cell: np.ndarray, share: int) -> np.ndarray:
    turn = (before.inv() * after).as_rotvec()
    angle = np.maximum(np.linalg.norm(turn, axis=-1, keepdims=True), 1e-300)
    strain = share * np.tan(angle / share) * turn / angle / cell[:, None]
    return np.asarray((0.5 * cell[:, None] * law * strain**2).sum(axis=1))


def largest_moment(problem: Problem, shape: Shape) -> float:
    """[N m] Scale for `unbalanced_moment`: the largest bending moment plus the largest force times a segment."""
    bending = problem.cable.bending or 0.0
    force = max(float(np.abs(shape.tension).max()), float(np.linalg.norm(shape.grasp_wrenches[:, :3], axis=1).max()))
    return bending * float(shape.curvature.max()) + force * float(np.diff(shape.s).max())


def balance(problem: Problem, shape: Shape, gravity: Vector, *, within: float = 1e-3) -> Iterable[Check]:
    """Balance of every segment, as a part of the largest moment, and of the whole, as a part of the largest force; ends where held."""
    if problem.cable.bending is not None:
        scale = max(largest_moment(problem, shape), 1e-300)
        yield Check("moment on a segment", unbalanced_moment(problem, shape, gravity) / scale, within, "of the largest")
    cable = problem.cable
    loads = problem.loads.force.sum(axis=0) if problem.loads is not None else np.zeros(3)
    weight = cable.mass_per_length * cable.length * np.array(gravity)
    total = shape.grasp_wrenches[:, :3].sum(axis=0) + shape.contact_forces.sum(axis=0) + weight + loads
    largest = max(float(np.linalg.norm(shape.grasp_wrenches[:, :3], axis=1).max()), float(np.linalg.norm(weight)), 1e-9)
    yield Check("sum of the forces", float(np.linalg.norm(total)) / largest, 1e-8, "of the largest")
    fixed = [k for k, hold in enumerate(problem.grasps.hold) if hold is not Hold.GUIDE]
    held = np.stack([np.interp(problem.grasps.s[fixed], shape.s, row) for row in shape.nodes.T], axis=-1)
    off = float(np.linalg.norm(held - problem.grasps.position[fixed], axis=1).max())
    yield Check("distance from a grasp", off / cable.length, 1e-6, "of the length")
