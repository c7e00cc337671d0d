"""From a problem to its system of equations: the sum of what the effects in use add."""

from __future__ import annotations

from types import ModuleType

import numpy as np

from protocol.kinds import FRICTION_CODES, Friction, Hold
from protocol.messages import Problem
from protocol.scene import Vector

from . import effects
from .mesh import Mesh
from .rod import Held, Rod


def make_rod(problem: Problem, gravity: Vector, used: tuple[str, ...], mesh: Mesh, path: ModuleType) -> Rod:
    """The system of equations of a problem on a mesh: the sum of what the effects in use add."""
    grasps, cable = problem.grasps, problem.cable
    loads, law = np.zeros((len(mesh.s), 3)), np.zeros(3)
    for name in used:
        effect = effects.load(name)
        if hasattr(effect, "node_loads"):
            loads += effect.node_loads(mesh.lengths, cable, gravity)
        if hasattr(effect, "stiffness"):
            law += effect.stiffness(cable)
    clamps = [k for k, hold in enumerate(grasps.hold) if hold is Hold.CLAMP]
    clamp_of_node = np.full(len(mesh.s), -1, dtype=np.int64)
    clamp_of_node[mesh.grasp_nodes[clamps]] = np.arange(len(clamps))
    element, fraction = mesh.locate(grasps.s[1:])
    forces = problem.start.grasp_forces[1:] if problem.start is not None else np.zeros((len(element), 3))
    held = Held(element, fraction, grasps.position[1:], np.zeros((len(element), 3)), forces)
    touch = None
    if problem.contacts is not None:
        codes = problem.contacts.friction
        if "bond" in used:
            bonds = effects.load("bond").rows(problem.contacts, np.flatnonzero(codes == FRICTION_CODES.index(Friction.BOND)), mesh)
            held = Held(
                *(
                    np.concatenate(pair)
                    for pair in zip(_fields(held), (bonds.element, bonds.fraction, bonds.anchor, bonds.normal, bonds.force), strict=True)
                )
            )
        if "contact" in used:
            touch = effects.load("contact").rows(problem.contacts, np.flatnonzero(codes == FRICTION_CODES.index(Friction.NONE)), mesh)
    return Rod(
        mesh=mesh,
        base=int(mesh.grasp_nodes[0]),
        origin=grasps.position[0],
        clamp_of_node=clamp_of_node,
        clamp_frames=np.ascontiguousarray(grasps.quaternion[clamps]),
        law=law,
        loads=loads,
        weight=float(np.linalg.norm(loads.sum(axis=0))),
        held=held,
        touch=touch,
        path=path,
    )


def _fields(held: Held) -> tuple[np.ndarray, ...]:
    return (held.element, held.fraction, held.goal, held.normal, held.force)
