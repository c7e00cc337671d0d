"""What the solver believes about a rod near a state, taken from one Newton step, and the Lagrangian it must agree with."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from protocol.messages import Problem
from protocol.scene import Vector
from shape_server import contact_geometry as geometry
from shape_server import effects, numpy_path
from shape_server.mesh import even, from_nodes
from shape_server.rod import Rod, State, View, energy, look, newton_step, start_state
from shape_server.system import make_rod

rod_module = sys.modules["shape_server.rod"]


@dataclass(frozen=True)
class Model:
    """Gradient, Hessian with the curvature of the contacts, and columns of the rows."""

    gradient: np.ndarray  # (3 (n-1),)
    hessian: np.ndarray  # (3 (n-1), 3 (n-1)), without the curvature of the contacts
    curvature: np.ndarray  # the same, of the contacts alone
    columns: np.ndarray  # (3 (n-1), rows), held points then contacts


def build(problem: Problem, gravity: Vector, segments: int = 12) -> Rod:
    """The system of a problem, on numpy."""
    used = effects.asked_for(problem, gravity)
    length, held = problem.cable.length, problem.grasps.s
    mesh = from_nodes(problem.start.s, length, held) if problem.start is not None else even(length, held, segments)
    return make_rod(problem, gravity, used, mesh, numpy_path)


def state_of(rod: Rod, frames: np.ndarray, *, force: np.ndarray | None = None, push: np.ndarray | None = None) -> State:
    """A state with the given forces; a contact with a force touches."""
    state = start_state(rod, frames)
    force = state.force if force is None else force
    push = state.push if push is None else push
    return replace(state, force=force, push=push, touches=push > 0.0)


def lagrangian(rod: Rod, state: State, turn: np.ndarray) -> float:
    """Energy less the work of all forces, [J], the forces held fixed, at the state turned by `turn` (n-1, 3).

    The turns at the nodes that make the bulge of a contact are those of the state, as `contact_geometry` has it.
    """
    moved, view = look(rod, replace(state, frames=numpy_path.retract(state.frames, turn)))
    gap = view.gap + bulges(rod, moved, view, view) - bulges(rod, moved, view, look(rod, state)[1])
    return energy(rod, moved, view) - float(np.vdot(state.force, view.miss)) - float(state.push @ gap)


def bulges(rod: Rod, state: State, view: View, bent: View) -> np.ndarray:
    """Bulge (m,) [m] under each contact where it now is, with the turns at the nodes as they are in `bent`."""
    out = np.zeros(len(view.gap))
    for row in np.flatnonzero(view.numbers[:, 0]).tolist():
        j = int(rod.touch.element[row])
        turns = (geometry._turn.py_func(bent.axes, j + end, bent.normal[row]) for end in (0, 1))
        out[row] = geometry._bulge.py_func(state.fraction[row], rod.mesh.lengths[j], *turns)[0]
    return out


def model(rod: Rod, state: State, monkeypatch: pytest.MonkeyPatch) -> Model:
    """The matrices of one step, read where they are handed to the elimination."""
    seen: dict[str, np.ndarray] = {}

    def factor_and_solve(diagonal: np.ndarray, upper: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, int]:
        seen.update(diagonal=diagonal.copy(), upper=upper.copy(), right=right.copy())
        return numpy_path.factor_and_solve(diagonal, upper, right)

    plain_border = rod_module._border

    def border(*arguments: object) -> object:
        found = plain_border(*arguments)
        seen["compliance"] = found.compliance
        return found

    spy = SimpleNamespace(**{name: getattr(numpy_path, name) for name in dir(numpy_path) if not name.startswith("__")})
    spy.factor_and_solve = factor_and_solve
    with monkeypatch.context() as patch:
        patch.setattr(rod_module, "_border", border)
        moved, view = look(rod, state)
        # Softness leaves out of the step which contacts push; the columns are the same.
        newton_step(replace(rod, path=spy), moved, view, softness=(1.0, 1.0))
    size = 3 * len(state.frames)
    hessian = np.zeros((size, size))
    for i, (own, next_one) in enumerate(zip(seen["diagonal"], seen["upper"], strict=True)):
        hessian[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = own
        if i + 1 < len(state.frames):
            hessian[3 * i : 3 * i + 3, 3 * i + 3 : 3 * i + 6] = next_one
            hessian[3 * i + 3 : 3 * i + 6, 3 * i : 3 * i + 3] = next_one.T
    right = seen["right"].reshape(size, -1)
    rows = 3 * int(state.holds.sum()) + int(state.touches.sum())
    extra, compliance = right[:, rows:-1], seen["compliance"][rows:, rows:]
    curvature = extra @ np.linalg.solve(compliance, extra.T) if extra.shape[1] else np.zeros_like(hessian)
    return Model(right[:, -1], hessian, curvature, right[:, :rows])


def slopes(rod: Rod, state: State, step: float = 1e-5) -> np.ndarray:
    """First derivatives (3 (n-1),) of the Lagrangian with the turn of every segment, by differences of fourth order."""
    out = np.empty(3 * len(state.frames))
    for i in range(len(out)):
        turn = np.zeros(len(out))
        turn[i] = step
        near, far = (lagrangian(rod, state, k * turn.reshape(-1, 3)) - lagrangian(rod, state, -k * turn.reshape(-1, 3)) for k in (1.0, 2.0))
        out[i] = (8 * near - far) / (12 * step)
    return out


def bend(rod: Rod, state: State, turn: np.ndarray, step: float = 5e-4) -> float:
    """Second derivative of the Lagrangian along `turn` (n-1, 3), by differences of fourth order."""
    near, far = (lagrangian(rod, state, k * step * turn) + lagrangian(rod, state, -k * step * turn) for k in (1.0, 2.0))
    return (16 * near - far - 30 * lagrangian(rod, state, 0.0 * turn)) / (12 * step**2)
