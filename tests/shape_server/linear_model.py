"""What the solver believes about a rod near a state, taken from one Newton step, and the Lagrangian it must agree with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from protocol.messages import Problem
from protocol.scene import Vector
from shape_server import contact_geometry as geometry
from shape_server import effects, numpy_path, system
from shape_server.mesh import even, from_nodes, stops
from shape_server.rod import State, View
from shape_server.system import System


@dataclass(frozen=True)
class Model:
    """Gradient, Hessian with the curvature of the contacts, and columns and compliance of the rows."""

    gradient: np.ndarray  # (3 (n-1),)
    hessian: np.ndarray  # (3 (n-1), 3 (n-1)), without the curvature of the contacts
    curvature: np.ndarray  # the same, of the contacts alone
    columns: np.ndarray  # (3 (n-1), rows), held points then contacts
    compliance: np.ndarray  # (rows, rows), beyond a softness of one


def build(problem: Problem, gravity: Vector, segments: int = 12) -> System:
    """The system of a problem."""
    used = effects.asked_for(problem, gravity)
    length, held = problem.cable.length, problem.grasps.s
    mesh = from_nodes(problem.start.s, length, held) if problem.start is not None else even(stops(problem), held, segments)
    return system.build(problem, gravity, used, mesh)


def state_of(system: System, frames: np.ndarray, *, force: np.ndarray | None = None, push: np.ndarray | None = None) -> State:
    """A state with the given forces; a contact with a force touches."""
    state = system.start(frames)
    force = state.force if force is None else force
    push = state.push if push is None else push
    return state._replace(force=force, push=push, touches=push > 0.0)


def look(system: System, state: State) -> tuple[State, View]:
    """The state with its contacts where they are nearest, and what follows from it."""
    return numpy_path.look(system.rod, state, np.ascontiguousarray(system.rod.touch["normal"]))


def lagrangian(system: System, state: State, turn: np.ndarray) -> float:
    """Energy less the work of all forces, [J], the forces held fixed, at the state turned by `turn` (n-1, 3).

    The turns at the nodes that make the bulge of a contact are those of the state, as `contact_geometry` has it. What stretch stores
    is taken from the lengths: half of the work that the tension does on them, which is against the force.
    """
    moved, view = look(system, state._replace(frames=numpy_path.retract(state.frames, turn)))
    gap = view.gap + bulges(system, moved, view, view) - bulges(system, moved, view, look(system, state)[1])
    stored = 0.0
    if len(system.rod.give):
        stored = float((0.5 * (view.lengths - system.rod.lengths) ** 2 / system.rod.give).sum())
    return numpy_path.energy(system.rod, moved, view) + stored - float(state.force @ view.miss) - float(state.push @ gap)


def bulges(system: System, state: State, view: View, bent: View) -> np.ndarray:
    """Bulge (m,) [m] under each contact where it now is, with the turns at the nodes as they are in `bent`."""
    out = np.zeros(len(view.gap))
    for row in np.flatnonzero(view.numbers[:, 0]).tolist():
        j = int(system.rod.touch["element"][row])
        turns = (geometry._turn.py_func(bent.axes, j + end, bent.normal[row]) for end in (0, 1))
        out[row] = geometry._bulge.py_func(state.fraction[row], system.mesh.lengths[j], *turns)[0]
    return out


def model(system: System, state: State) -> Model:
    """The matrices of one step, as they are handed to the elimination."""
    rod = system.rod
    moved, view = look(system, state)
    carried, gradient, diagonal, upper, beyond = numpy_path.linear_system(rod, moved, view)
    border = numpy_path.border_rows(rod, moved, view, (1.0, 1.0), np.inf)
    columns = numpy_path.border_columns(rod, view, border, carried, diagonal).reshape(gradient.size, -1)
    hessian = np.zeros((gradient.size, gradient.size))
    for i in range(len(gradient)):
        hessian[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = diagonal[i]
        if i + 1 < len(gradient):
            hessian[3 * i : 3 * i + 3, 3 * i + 3 : 3 * i + 6] = upper[i]
            hessian[3 * i + 3 : 3 * i + 6, 3 * i : 3 * i + 3] = upper[i].T
        if i + 2 < len(gradient) and len(beyond):
            hessian[3 * i : 3 * i + 3, 3 * i + 6 : 3 * i + 9] = beyond[i]
            hessian[3 * i + 6 : 3 * i + 9, 3 * i : 3 * i + 3] = beyond[i].T
    rows = len(border.held) + len(border.contacts)
    extra, compliance = columns[:, rows:], border.compliance[rows:, rows:]
    curvature = extra @ np.linalg.solve(compliance, extra.T) if extra.shape[1] else np.zeros_like(hessian)
    return Model(gradient.ravel(), hessian, curvature, columns[:, :rows], border.compliance[:rows, :rows] - np.eye(rows))


def slopes(system: System, state: State, step: float = 1e-5) -> np.ndarray:
    """First derivatives (3 (n-1),) of the Lagrangian with the turn of every segment, by differences of fourth order."""
    out = np.empty(3 * len(state.frames))
    for i in range(len(out)):
        turn = np.zeros(len(out))
        turn[i] = step
        near, far = (
            lagrangian(system, state, k * turn.reshape(-1, 3)) - lagrangian(system, state, -k * turn.reshape(-1, 3)) for k in (1.0, 2.0)
        )
        out[i] = (8 * near - far) / (12 * step)
    return out


def bend(system: System, state: State, turn: np.ndarray, step: float = 5e-4) -> float:
    """Second derivative of the Lagrangian along `turn` (n-1, 3), by differences of fourth order."""
    near, far = (lagrangian(system, state, k * step * turn) + lagrangian(system, state, -k * step * turn) for k in (1.0, 2.0))
    return (16 * near - far - 30 * lagrangian(system, state, 0.0 * turn)) / (12 * step**2)
