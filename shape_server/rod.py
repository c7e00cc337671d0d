"""The rod as a system of equations: energy, gradient, Hessian and border rows at a state, and one Newton step.

Unknowns are the frames of the segments and, on the border, the forces at held points (grasps and bonds, three each) and
at one-sided contacts (one each). With H the Hessian of the elastic energy less the work of all forces, C the border
columns and B the compliance of every row, a Newton step solves

    [ H   -C ] [ theta   ]   [ -gradient           ]
    [ C^T  B ] [ d force ] = [ -residual of the row ]

through the Schur complement S = C^T H^-1 C + B. B is zero for an exact row, 1/k for a penalty, and an indefinite block
for the curvature of an edge (see `contact_geometry`). The state is a stable equilibrium if negative(H) + positive(S)
equals the number of rows plus the negative directions that the curvature blocks bring with them (Sylvester's law).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import ModuleType

import numpy as np

from .contact_geometry import contact_geometry
from .effects.contact import SOFTNESS, OneSided
from .mesh import Mesh


@dataclass(frozen=True)
class Held:
    """Points of the cable that are held in place: all grasps but the first, then the bonds."""

    element: np.ndarray  # (k,) int, segment
    fraction: np.ndarray  # (k,) place along it
    goal: np.ndarray  # (k, 3) m
    normal: np.ndarray  # (k, 3) unit for a bond, which is dropped when it pulls against it; zero for a grasp
    force: np.ndarray  # (k, 3) N, to start from


@dataclass(frozen=True)
class Rod:
    """One cable with bending and twist under its boundary conditions, on one mesh."""

    mesh: Mesh
    base: int  # node where positions start: the first held point
    origin: np.ndarray  # (3,) m, where that node is
    clamp_of_node: np.ndarray  # (n,) int, index into `clamp_frames`, -1 for none
    clamp_frames: np.ndarray  # (c, 4)
    law: np.ndarray  # (3,) N m^2
    loads: np.ndarray  # (n, 3) N
    weight: float  # N, size of the load as a whole; scales tolerances
    held: Held
    touch: OneSided | None
    path: ModuleType  # `kernels` or `numpy_path`

    @property
    def length(self) -> float:
        """[m] of the cable."""
        return float(self.mesh.s[-1])

    @property
    def force_scale(self) -> float:
        """[N] Typical force: the weight, or what bends the cable into an arch."""
        return self.weight + 10.0 * float(self.law.max()) / self.length**2


@dataclass(frozen=True)
class State:
    """Where the rod is, and the forces that hold it."""

    frames: np.ndarray  # (n-1, 4)
    force: np.ndarray  # (k, 3) N, at held points
    holds: np.ndarray  # (k,) bool, whether the point is held (a bond may have let go)
    push: np.ndarray  # (m,) N, at one-sided contacts
    touches: np.ndarray  # (m,) bool, whether the contact is taken as closed
    element: np.ndarray  # (m,) int, segment of each contact
    fraction: np.ndarray  # (m,) place along it


@dataclass(frozen=True)
class View:
    """What follows from a state without solving anything."""

    axes: np.ndarray  # (n-1, 3, 3)
    nodes: np.ndarray  # (n, 3) m
    miss: np.ndarray  # (k, 3) m, held point less its goal
    gap: np.ndarray  # (m,) m
    normal: np.ndarray  # (m, 3)
    slide: np.ndarray  # (m, 3)
    across: np.ndarray  # (m, 3)
    mu: np.ndarray  # (m,)
    reach: np.ndarray  # (m,) m


@dataclass(frozen=True)
class Step:
    """A Newton step and what its factorisation says."""

    turn: np.ndarray  # (n-1, 3) rad
    force: np.ndarray  # (k, 3) N, new forces at held points
    push: np.ndarray  # (m,) N, new forces at contacts
    is_stable: bool
    unbalanced: float  # N m, largest entry of the gradient before the step
    slope: float  # J, gradient . turn


_NO_ROWS = np.zeros(0)


def start_state(rod: Rod, frames: np.ndarray) -> State:
    """The state with the given frames and the forces that the request starts from."""
    touch = rod.touch
    push = touch.push.copy() if touch is not None else _NO_ROWS
    return State(
        frames=frames,
        force=rod.held.force.copy(),
        holds=np.ones(len(rod.held.element), dtype=bool),
        push=push,
        touches=push > 0.0,
        element=touch.element.copy() if touch is not None else np.zeros(0, dtype=np.int64),
        fraction=touch.fraction.copy() if touch is not None else _NO_ROWS,
    )


def look(rod: Rod, state: State) -> tuple[State, View]:
    """Positions, gaps and misses of a state; the contacts of the returned state have slid to where they are nearest."""
    axes = rod.path.directors(state.frames)
    nodes = rod.path.positions(axes[:, 2], rod.mesh.lengths, rod.base, rod.origin)
    held = rod.held
    at = nodes[held.element] + held.fraction[:, None] * (nodes[held.element + 1] - nodes[held.element])
    touch = rod.touch
    if touch is None:
        rows = _NO_ROWS.reshape(0, 3)
        return state, View(axes, nodes, at - held.goal, _NO_ROWS, rows, rows, rows, _NO_ROWS, _NO_ROWS)
    element, fraction = state.element.copy(), state.fraction.copy()
    gap, normal, slide, across, mu, reach = contact_geometry(
        nodes, axes, rod.mesh.lengths, element, fraction, touch.feature, touch.point, touch.normal, touch.direction, touch.distance
    )
    moved = replace(state, element=element, fraction=fraction)
    return moved, View(axes, nodes, at - held.goal, gap, normal, slide, across, mu, reach)


def node_forces(rod: Rod, state: State, view: View) -> np.ndarray:
    """Loads, forces at held points and contact forces, shared by the nodes: (n, 3) [N]. The first grasp is left out."""
    forces = rod.loads.copy()
    held = state.holds
    _share(forces, rod.held.element[held], rod.held.fraction[held], state.force[held])
    if rod.touch is not None:
        on = state.push != 0.0
        _share(forces, state.element[on], state.fraction[on], state.push[on, None] * view.normal[on])
    return forces


def energy(rod: Rod, state: State, view: View) -> float:
    """Elastic energy less the work of the loads [J]; forces on the border are left out."""
    elastic: float = rod.path.elastic_energy(state.frames, rod.mesh.lengths, rod.law, rod.clamp_of_node, rod.clamp_frames)
    return elastic - float(np.vdot(rod.loads, view.nodes))


def newton_step(rod: Rod, state: State, view: View, *, softness: tuple[float, float] | None = None, shift: float = 0.0) -> Step:
    """One Newton step from a state with the present sets of holds and touches.

    Args:
        rod: The system.
        state: Where it is; `force` and `push` are the forces now acting.
        view: Of that state.
        softness: [m/N] Compliance of held points and of contacts; the rows then already balance (augmented Lagrangian).
            None for exact rows.
        shift: [N] Added to the Hessian, times the length of each segment.
    """
    lengths = rod.mesh.lengths
    carried = rod.path.carried_forces(node_forces(rod, state, view), rod.base)
    gradient, diagonal, upper = rod.path.assemble(state.frames, view.axes, lengths, rod.law, rod.clamp_of_node, rod.clamp_frames, carried)
    _fix_gauge(rod, diagonal, shift)
    border = _border(rod, state, view, softness)
    right = np.empty((len(lengths), 3, border.count + 1))
    matrix = rod.path.columns(view.axes, lengths, rod.base, border.element, border.fraction, border.vector, border.is_turn)
    right[:, :, :-1] = matrix
    right[:, :, -1] = gradient
    solved, negative = rod.path.factor_and_solve(diagonal, upper, right)
    flat, answers = matrix.reshape(-1, border.count), solved.reshape(-1, border.count + 1)
    schur = flat.T @ answers
    small, rest = schur[:, :-1] + border.compliance, schur[:, -1]
    change, positive = _solve_border(small, rest - border.residual)
    turn = (answers[:, :-1] @ change - answers[:, -1]).reshape(-1, 3)
    force, push = state.force.copy(), state.push.copy()
    rows = 3 * int(state.holds.sum())
    force[state.holds] += change[:rows].reshape(-1, 3)
    push[state.touches] += change[rows : rows + int(state.touches.sum())]
    return Step(
        turn=turn,
        force=force,
        push=push,
        is_stable=negative + positive == border.expected,
        unbalanced=float(np.abs(gradient).max()),
        slope=float(np.vdot(gradient, turn)),
    )


@dataclass(frozen=True)
class _Border:
    count: int
    element: np.ndarray
    fraction: np.ndarray
    vector: np.ndarray
    is_turn: np.ndarray
    compliance: np.ndarray  # (count, count)
    residual: np.ndarray  # (count,)
    expected: int  # negative directions that a stable state has


def _border(rod: Rod, state: State, view: View, softness: tuple[float, float] | None) -> _Border:
    """Border columns of all holds, then all touches, then the curvature of the touched features."""
    held = np.flatnonzero(state.holds)
    on = np.flatnonzero(state.touches)
    hold_count, touch_count = 3 * len(held), len(on)
    element = [np.repeat(rod.held.element[held], 3), state.element[on]]
    fraction = [np.repeat(rod.held.fraction[held], 3), state.fraction[on]]
    vector = [np.tile(np.eye(3), (len(held), 1)), view.normal[on]]
    curved = [c for c in on.tolist() if view.slide[c].any() and state.push[c] > 1e-9 * rod.force_scale]
    pieces, turns, expected = _curvature_rows(state, view, curved)
    if pieces:
        element.append(np.array([state.element[c] for c, _ in pieces]))
        fraction.append(np.array([state.fraction[c] for c, _ in pieces]))
        vector.append(np.array([v for _, v in pieces]))
    count = hold_count + touch_count + len(pieces)
    is_turn = np.zeros(count, dtype=np.int64)
    compliance = np.zeros((count, count))
    residual = np.zeros(count)
    touched = np.arange(hold_count, hold_count + touch_count)
    if softness is None:
        hard = SOFTNESS / max(rod.weight, 1e-9 * rod.force_scale)
        compliance[touched, touched] = hard
        residual[:hold_count] = view.miss[held].ravel()
        residual[touched] = view.gap[on] + hard * state.push[on]
    else:
        compliance[np.arange(hold_count), np.arange(hold_count)] = softness[0]
        compliance[touched, touched] = softness[1]
    for first, block, turned in turns:
        at = hold_count + touch_count + first
        compliance[at : at + len(block), at : at + len(block)] = block
        if turned:
            is_turn[at + 1] = 1
    rows = (np.concatenate(element), np.concatenate(fraction), np.concatenate(vector))
    return _Border(count, *rows, is_turn, compliance, residual, hold_count + touch_count + expected)


def _curvature_rows(
    state: State, view: View, curved: list[int]
) -> tuple[list[tuple[int, np.ndarray]], list[tuple[int, np.ndarray, bool]], int]:
    """Columns (contact, vector), compliance blocks (first column, block, whether its second column is a turn), inertia."""
    pieces: list[tuple[int, np.ndarray]] = []
    blocks: list[tuple[int, np.ndarray, bool]] = []
    expected = 0
    for c in curved:
        bend = view.reach[c] / state.push[c]
        if view.mu[c] != 0.0:
            block = np.array([[-bend, view.mu[c] / state.push[c]], [view.mu[c] / state.push[c], 0.0]])
            blocks.append((len(pieces), block, True))
            pieces += [(c, view.slide[c]), (c, view.normal[c])]
            expected += 1
        else:
            blocks.append((len(pieces), np.array([[-bend]]), False))
            pieces.append((c, view.slide[c]))
        if view.across[c].any():
            blocks.append((len(pieces), np.array([[-bend]]), False))
            pieces.append((c, view.across[c]))
    return pieces, blocks, expected


def _solve_border(matrix: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, int]:
    """Solution of the border system and the number of positive eigenvalues of its matrix."""
    if len(right) == 0:
        return right, 0
    # Rows of force and of moment differ by orders of magnitude; scaling keeps the signs of the eigenvalues.
    scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(matrix)), 1e-9 * np.abs(matrix).max(axis=1)) + 1e-300)
    values, vectors = np.linalg.eigh(scale[:, None] * matrix * scale)
    floor = 1e-14 * np.abs(values).max()
    safe = np.where(np.abs(values) < floor, np.copysign(floor, values), values)
    return scale * (vectors @ ((vectors.T @ (scale * right)) / safe)), int((values > 0).sum())


def _fix_gauge(rod: Rod, diagonal: np.ndarray, shift: float) -> None:
    """Add the shift, and where no clamp holds the roll of the cable, hold that of one segment: it changes no shape."""
    if shift > 0.0:
        for k in range(3):
            diagonal[:, k, k] += shift * rod.mesh.lengths
    if len(rod.clamp_frames) == 0:
        segment = min(rod.base, len(rod.mesh.lengths) - 1)
        diagonal[segment, 2, 2] += rod.law[2] / rod.length


def _share(forces: np.ndarray, element: np.ndarray, fraction: np.ndarray, force: np.ndarray) -> None:
    np.add.at(forces, element, (1.0 - fraction)[:, None] * force)
    np.add.at(forces, element + 1, fraction[:, None] * force)
