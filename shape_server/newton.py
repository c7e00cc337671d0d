"""One Newton step of the rod: gradient, Hessian, border and their solution, compiled.

With H the Hessian of the elastic energy less the work of all forces, C the border columns and B the compliance of every
row, a Newton step solves

    [ H   -C ] [ theta   ]   [ -gradient           ]
    [ C^T  B ] [ d force ] = [ -residual of the row ]

through the Schur complement S = C^T H^-1 C + B. B is zero for an exact row, 1/k for a penalty, and an indefinite block
for the curvature of an edge (see `contact_geometry`). The state is a stable equilibrium if negative(H) + positive(S)
equals the number of rows plus the negative directions that the curvature blocks bring with them (Sylvester's law).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .assembly import assemble
from .axial import add_give
from .bend_limit import add_limit
from .border import SOFTNESS, border_rows, is_far
from .chain import carried_forces
from .chain_terms import three
from .closing import close
from .elimination import columns, work_of
from .jitted import inlined, kernel
from .rod import is_active, node_forces
from .schur import complement, turns
from .smoothing import add_smoothing
from .stick_slip import close_rubbing
from .strand_rows import add_spread

AHEAD = 2.0  # times how far held points and contacts are off: a contact open by more is not expected to close in this step
NOT_ROUND = 1e-5  # of the stiffness that holds the roll of a round cable


class Step(NamedTuple):
    """A Newton step and what its factorisation says."""

    turn: np.ndarray  # (n-1, 3) rad
    force: np.ndarray  # (h,) N, new forces of the rows of held points
    push: np.ndarray  # (m,) N, new forces at contacts
    touches: np.ndarray  # (m,) bool, contacts that push
    drag: np.ndarray  # (f, 2) N, new forces of friction
    sticks: np.ndarray  # (f,) bool, contacts that touch and do not slide
    is_stable: bool
    unbalanced: float  # N, largest unbalanced couple of a segment before the step, over its length
    slope: float  # J, gradient . turn
    stiffness: float  # N, turn . H turn over the sum of h |turn|^2: against this very turn
    is_solved: bool  # whether friction's laws are kept in it


@kernel
def linear_system(rod, state, view):  # type: ignore[no-untyped-def]
    """Carried forces, then gradient and blocks, the couples of the contacts added to the gradient.

    The blocks are the diagonal, those of neighbours, and those of the next but one, which are empty without a micro-structure length.
    """
    carried = carried_forces(node_forces(rod, state, view), rod.base)
    gradient, diagonal, upper = assemble(
        state.frames, view.axes, rod.lengths, view.lengths, rod.elastic, rod.clamp_of_node, rod.clamp_frames, carried
    )
    touched, axes, normal, numbers = rod.touch["element"], view.axes, view.normal, view.numbers
    for row in range(len(state.push)):
        segment = touched[row]
        couple = _couple(axes, segment, normal, row, numbers[row, 2])
        for k in range(2):
            gradient[segment, k] -= state.push[row] * couple[k]
    if len(rod.elastic.limit) > 0:
        add_limit(state.frames, rod.lengths, rod.elastic, rod.clamp_of_node, rod.clamp_frames, gradient, diagonal, upper)
    beyond = np.empty((0, 3, 3))
    if len(rod.elastic.smoothing) > 0:
        beyond = add_smoothing(state.frames, rod.lengths, rod.elastic, rod.clamp_of_node, rod.clamp_frames, gradient, diagonal, upper)
    return carried, gradient, diagonal, upper, beyond


@kernel
def _couple(axes, segment, normal, row, arm):  # type: ignore[no-untyped-def]
    """Change of the gap of a contact with the rotation of its segment about d1 and d2 [m].

    A force on an edge or a vertex acts at the feature, not at the axis.
    """
    x, y, z = three(normal, row)
    first = x * axes[segment, 0, 0] + y * axes[segment, 0, 1] + z * axes[segment, 0, 2]
    second = x * axes[segment, 1, 0] + y * axes[segment, 1, 1] + z * axes[segment, 1, 2]
    return -arm * second, arm * first


@kernel
def unbalanced(rod, state, view):  # type: ignore[no-untyped-def]
    """Largest unbalanced couple of a segment over its length [N]."""
    return _largest_couple(linear_system(rod, state, view)[1], rod.lengths)


@kernel
def _largest_couple(gradient, lengths):  # type: ignore[no-untyped-def]
    most = 0.0
    for j in range(len(lengths)):
        for k in range(3):
            most = max(most, abs(gradient[j, k]) / lengths[j])
    return most


@kernel
def newton_step(rod, state, view, soft, shift):  # type: ignore[no-untyped-def]
    """One Newton step from a state.

    With exact rows, which contacts push is part of the step: of the linearised system it is the one solution in which every
    contact is open or pushes. Otherwise the present set of touches stays.

    Args:
        rod: The system.
        state: Where it is; `force` and `push` are the forces now acting.
        view: Of that state.
        soft: [m/N] Compliances of held points and of contacts, whose rows then already balance (augmented Lagrangian); zeros for
            exact rows.
        shift: [N] Added to the Hessian, times the length of each segment.
    """
    near = np.inf
    if soft[0] == 0.0 and len(state.push) > 0 and len(rod.strands.distance) + len(rod.give) == 0:
        near = AHEAD * farthest_off(rod, state, view)
    while True:
        # Called at one place alone, where it is inlined.
        step = step_with(rod, state, view, soft, shift, near)
        if near == np.inf or not _closes_more(rod, state, view, step, near):
            return step
        near = np.inf


@kernel
def farthest_off(rod, state, view):  # type: ignore[no-untyped-def]
    """Largest distance [m] of a held point from its goal, or of a contact that pushes or is passed from its plane."""
    most, bond = 0.0, rod.held.rows["bond"]
    for row in range(len(view.miss)):
        if is_active(bond, state.holds, row):
            most = max(most, abs(view.miss[row]))
    for row in range(len(view.gap)):
        most = max(most, abs(view.gap[row]) if state.push[row] > 0.0 else -view.gap[row])
    return most


@kernel
def _closes_more(rod, state, view, step, near):  # type: ignore[no-untyped-def]
    """Whether a step closes a contact that was left out of it because it was open by more than `near` [m]."""
    left = np.flatnonzero(is_far(state.push, state.touches, view.gap, near))
    if len(left) == 0:
        return False
    moved = _moved(view.axes, view.lengths, rod.base, step.turn)
    for row in left:
        gap, segment, share = view.gap[row], rod.touch["element"][row], state.fraction[row]
        couple = _couple(view.axes, segment, view.normal, row, view.numbers[row, 2])
        gap += couple[0] * step.turn[segment, 0] + couple[1] * step.turn[segment, 1]
        for k in range(3):
            gap += view.push[row, k] * ((1.0 - share) * moved[segment, k] + share * moved[segment + 1, k])
        if gap < 0.0:
            return True
    return False


@kernel
def _moved(axes, lengths, base, turn):  # type: ignore[no-untyped-def]
    """Displacements (n, 3) [m] of the nodes by small turns (n-1, 3) [rad] of the segments about their own axes."""
    moved = np.zeros((len(turn) + 1, 3))
    for j in range(base, len(turn)):
        for k in range(3):
            moved[j + 1, k] = moved[j, k] + lengths[j] * (turn[j, 1] * axes[j, 0, k] - turn[j, 0] * axes[j, 1, k])
    for j in range(base - 1, -1, -1):
        for k in range(3):
            moved[j, k] = moved[j + 1, k] - lengths[j] * (turn[j, 1] * axes[j, 0, k] - turn[j, 0] * axes[j, 1, k])
    return moved


@inlined
def step_with(rod, state, view, soft, shift, near):  # type: ignore[no-untyped-def]
    """The step, without the contacts that are open by more than `near` [m]."""
    carried, gradient, diagonal, upper, beyond = linear_system(rod, state, view)
    fix_gauge(rod, diagonal, shift)
    is_exact = soft[0] == 0.0
    border = border_rows(rod, state, view, soft, near)
    matrix = border_columns(rod, view, border, carried, diagonal)
    held, contacts = border.held, border.contacts
    last = _last_segments(border.element, border.vector, border.is_turn, rod.base, len(gradient))
    schur = complement(diagonal, upper, beyond, matrix, gradient, last, border.is_turn, border.compliance)
    rows, right = schur.matrix, schur.right - border.residual[schur.kept]
    force, push, touches, drag, sticks = state.force.copy(), state.push.copy(), state.touches.copy(), state.drag.copy(), state.sticks
    if is_exact and len(border.rubs) > 0:
        hard = SOFTNESS / rod.force_scale
        change, closed, slips_not, positive, rubbing, is_solved = close_rubbing(rod, state, rows, right, border, hard)
        sticks = np.zeros(len(state.sticks), dtype=np.bool_)
        sticks[border.rubs] = slips_not
    else:
        change, closed, positive = close(rows, right, len(held), len(contacts), state.push[contacts], is_exact)
        rubbing, is_solved = 2 * len(border.rubs), True
    for k in range(len(border.rubs)):
        for axis in range(2):
            drag[border.rubs[k], axis] += change[len(change) - 2 * (len(border.rubs) - k) + axis]
    turn = turns(schur, change)
    force[held] += change[: len(held)]
    push[contacts] += change[len(held) : len(held) + len(contacts)]
    touches[contacts] = closed
    push[~touches] = 0.0
    is_stable = schur.negative + positive == len(held) + closed.sum() + border.saddles + rubbing
    slope, size, bent = 0.0, 0.0, work_of(diagonal, upper, beyond, turn)
    for j in range(len(turn)):
        slope += gradient[j, 0] * turn[j, 0] + gradient[j, 1] * turn[j, 1] + gradient[j, 2] * turn[j, 2]
        size += rod.lengths[j] * (turn[j, 0] * turn[j, 0] + turn[j, 1] * turn[j, 1] + turn[j, 2] * turn[j, 2])
    stiffness = bent / size if size > 0.0 else np.inf
    couple = _largest_couple(gradient, rod.lengths)
    return Step(turn, force, push, touches, drag, sticks, is_stable, couple, slope, stiffness, is_solved)


@kernel
def _last_segments(element, vector, is_turn, base, count):  # type: ignore[no-untyped-def]
    """The last segment (m,) at which each column may not be zero; rows without a vector of their own are spread over nodes."""
    last = np.empty(len(element), dtype=np.int64)
    for row in range(len(last)):
        last[row] = element[row] if is_turn[row] or element[row] >= base else base - 1
        if vector[row, 0] == 0.0 and vector[row, 1] == 0.0 and vector[row, 2] == 0.0:
            last[row] = count - 1
    return last


@kernel
def border_columns(rod, view, border, carried, diagonal):  # type: ignore[no-untyped-def]
    """Columns (n-1, 3, count) of all rows; what stretch adds goes to `diagonal` and to the compliance of the border too."""
    matrix = columns(view.axes, view.lengths, rod.base, border.element, border.fraction, border.vector, border.is_turn)
    touched, axes, normal, numbers = rod.touch["element"], view.axes, view.normal, view.numbers
    for k in range(len(border.contacts)):
        row = border.contacts[k]
        segment = touched[row]
        couple = _couple(axes, segment, normal, row, numbers[row, 2])
        for axis in range(2):
            matrix[segment, axis, len(border.held) + k] += couple[axis]
    if len(border.spread.row) > 0:
        add_spread(view.axes, view.lengths, rod.base, border.spread, matrix)
    if len(border.inclined.row) > 0:
        add_spread(view.axes, view.lengths, rod.base, border.inclined, matrix)
    if len(rod.give) > 0:
        add_give(
            rod.give,
            view.axes,
            carried,
            diagonal,
            rod.base,
            border.element,
            border.fraction,
            border.vector,
            border.is_turn,
            matrix,
            border.compliance,
        )
    return matrix


@kernel
def fix_gauge(rod, diagonal, shift):  # type: ignore[no-untyped-def]
    """Add the shift, and where no clamp holds the roll of the cable, hold that of one segment: if round and straight, it keeps its shape.

    Of any other it does, which then has a stiffness of its own: it is held so weakly that no step is held back.
    """
    if shift > 0.0:
        for j in range(len(diagonal)):
            for k in range(3):
                diagonal[j, k, k] += shift * rod.lengths[j]
    if len(rod.clamp_frames) == 0:
        segment = min(rod.base, len(rod.lengths) - 1)
        share = 1.0 if _is_round(rod.elastic) else NOT_ROUND
        diagonal[segment, 2, 2] += share * rod.elastic.law[segment, 2] / rod.length


@kernel
def _is_round(elastic):  # type: ignore[no-untyped-def]
    """Whether no direction of any section differs from the others."""
    for j in range(len(elastic.law)):
        if elastic.law[j, 0] != elastic.law[j, 1] or elastic.bent[j, 0] != 0.0 or elastic.bent[j, 1] != 0.0:
            return False
    return True
