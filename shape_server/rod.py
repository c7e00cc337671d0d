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
from typing import TYPE_CHECKING, Final

import numpy as np

from .border import Border, curvature_rows
from .couples import add_couples, couples_of
from .mesh import Mesh

if TYPE_CHECKING:
    from .effects.contact import OneSided

SOFTNESS: Final = 1e-7  # m by which a contact or bond gives way under the typical force


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
    fraction: np.ndarray  # (m,) place of each contact along its segment


@dataclass(frozen=True)
class View:
    """What follows from a state without solving anything."""

    axes: np.ndarray  # (n-1, 3, 3)
    nodes: np.ndarray  # (n, 3) m
    miss: np.ndarray  # (k, 3) m, held point less its goal
    gap: np.ndarray  # (m,) m
    normal: np.ndarray  # (m, 3)
    push: np.ndarray  # (m, 3) direction of the force at each contact
    slide: np.ndarray  # (m, 3)
    across: np.ndarray  # (m, 3)
    numbers: np.ndarray  # (m, 4), see `contact_geometry`


@dataclass(frozen=True)
class Step:
    """A Newton step and what its factorisation says."""

    turn: np.ndarray  # (n-1, 3) rad
    force: np.ndarray  # (k, 3) N, new forces at held points
    push: np.ndarray  # (m,) N, new forces at contacts
    touches: np.ndarray  # (m,) bool, contacts that push
    is_stable: bool
    unbalanced: float  # N, largest unbalanced couple of a segment before the step, over its length
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
        return state, View(axes, nodes, at - held.goal, _NO_ROWS, rows, rows, rows, rows, np.zeros((0, 4)))
    fraction = state.fraction.copy()
    seen = rod.path.contact_geometry(nodes, axes, rod.mesh.lengths, *touch.places(fraction))
    push, touches = touch.handed_over(seen[0], state.push, state.touches)
    moved = replace(state, fraction=fraction, push=push, touches=touches)
    return moved, View(axes, nodes, at - held.goal, *seen)


def node_forces(rod: Rod, state: State, view: View) -> np.ndarray:
    """Loads, forces at held points and contact forces, shared by the nodes: (n, 3) [N]. The first grasp is left out."""
    forces = rod.loads.copy()
    held = state.holds
    _share(forces, rod.held.element[held], rod.held.fraction[held], state.force[held])
    if rod.touch is not None:
        on = state.push != 0.0
        _share(forces, rod.touch.element[on], state.fraction[on], state.push[on, None] * view.push[on])
    return forces


def energy(rod: Rod, state: State, view: View) -> float:
    """Elastic energy less the work of the loads [J]; forces on the border are left out."""
    elastic: float = rod.path.elastic_energy(state.frames, rod.mesh.lengths, rod.law, rod.clamp_of_node, rod.clamp_frames)
    return elastic - float(np.vdot(rod.loads, view.nodes))


def unbalanced(rod: Rod, state: State, view: View) -> float:
    """Largest unbalanced couple of a segment over its length [N]."""
    carried = rod.path.carried_forces(node_forces(rod, state, view), rod.base)
    gradient = rod.path.assemble(state.frames, view.axes, rod.mesh.lengths, rod.law, rod.clamp_of_node, rod.clamp_frames, carried)[0]
    add_couples(gradient, couples_of(rod.touch, view), -state.push)
    return float((np.abs(gradient).max(axis=1) / rod.mesh.lengths).max())


def hardness_of(rod: Rod) -> float:
    """Compliance of an exact contact [m/N]."""
    return SOFTNESS / rod.force_scale


def newton_step(rod: Rod, state: State, view: View, *, softness: tuple[float, float] | None = None, shift: float = 0.0) -> Step:
    """One Newton step from a state.

    With exact rows, which contacts push is part of the step: of the linearised system it is the one solution in which every
    contact is open or pushes. Otherwise the present set of touches stays.

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
    couples = couples_of(rod.touch, view)
    add_couples(gradient, couples, -state.push)
    border = _border(rod, state, view, softness)
    right = np.empty((len(lengths), 3, border.count + 1))
    matrix = rod.path.columns(view.axes, lengths, rod.base, border.element, border.fraction, border.vector, border.is_turn)
    if len(couples.row):
        place = np.full(len(state.push), -1)
        place[border.contacts] = np.arange(border.first_contact, border.first_contact + len(border.contacts))
        has_row = place[couples.row] >= 0
        matrix[couples.element[has_row], :2, place[couples.row][has_row]] += couples.arm[has_row]
    right[:, :, :-1] = matrix
    right[:, :, -1] = gradient
    solved, negative = rod.path.factor_and_solve(diagonal, upper, right)
    size = 3 * len(lengths)
    flat, answers = matrix.reshape(size, border.count), solved.reshape(size, border.count + 1)
    schur = flat.T @ answers
    rows = border.contacts
    change, closed, positive = rod.path.close(
        schur[:, :-1] + border.compliance,
        schur[:, -1] - border.residual,
        border.first_contact,
        len(rows),
        state.push[rows],
        border.is_exact,
    )
    turn = (answers[:, :-1] @ change - answers[:, -1]).reshape(-1, 3)
    force, push, touches = state.force.copy(), state.push.copy(), state.touches.copy()
    force[state.holds] += change[: border.first_contact].reshape(-1, 3)
    push[rows] += change[border.first_contact : border.first_contact + len(rows)]
    touches[rows] = closed
    push[~touches] = 0.0
    return Step(
        turn=turn,
        force=force,
        push=push,
        touches=touches,
        is_stable=negative + positive == border.first_contact + int(closed.sum()) + border.saddles,
        unbalanced=float((np.abs(gradient).max(axis=1) / lengths).max()),
        slope=float(np.vdot(gradient, turn)),
    )


def _border(rod: Rod, state: State, view: View, softness: tuple[float, float] | None) -> Border:
    """Rows of all holds, then contacts, then the curvature of the touched features.

    Contacts are those that may push: all of them with exact rows, those that touch otherwise.
    """
    held = np.flatnonzero(state.holds)
    rows = np.flatnonzero(state.touches) if softness is not None else np.arange(len(state.touches))
    curved = [c for c in np.flatnonzero(state.push > 1e-9 * rod.force_scale).tolist() if view.slide[c].any()]
    curvature = curvature_rows(view.slide, view.across, view.normal, view.numbers, state.push, curved)
    hold_count, touch_count = 3 * len(held), len(rows)
    count = hold_count + touch_count + len(curvature.contact)
    compliance, residual = np.zeros((count, count)), np.zeros(count)
    touched = np.arange(hold_count, hold_count + touch_count)
    if softness is None:
        hard = hardness_of(rod)
        bonded = np.flatnonzero(np.repeat(rod.held.normal[held].any(axis=1), 3))
        compliance[bonded, bonded] = hard
        compliance[touched, touched] = hard
        residual[:hold_count] = view.miss[held].ravel()
        residual[bonded] += hard * state.force[held].ravel()[bonded]
        residual[touched] = view.gap[rows] + hard * state.push[rows]
    else:
        compliance[np.arange(hold_count), np.arange(hold_count)] = softness[0]
        compliance[touched, touched] = softness[1]
    compliance[hold_count + touch_count :, hold_count + touch_count :] = curvature.compliance
    bent = np.array(curvature.contact, dtype=np.int64)
    element = rod.touch.element if rod.touch is not None else np.zeros(0, dtype=np.int64)
    return Border(
        count=count,
        element=np.concatenate([np.repeat(rod.held.element[held], 3), element[rows], element[bent]]),
        fraction=np.concatenate([np.repeat(rod.held.fraction[held], 3), state.fraction[rows], state.fraction[bent]]),
        vector=np.concatenate([np.tile(np.eye(3), (len(held), 1)), view.push[rows], curvature.vector]),
        is_turn=np.concatenate([np.zeros(hold_count + touch_count, dtype=np.int64), curvature.is_turn]),
        compliance=compliance,
        residual=residual,
        contacts=rows,
        first_contact=hold_count,
        saddles=curvature.saddles,
        is_exact=softness is None,
    )


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
