"""A few Newton steps after small motions of the grasps, and the nested combination of two meshes, in one compiled call."""

from __future__ import annotations

import numpy as np

from .chain import combined_nodes, directors, interpolate_frames, retract
from .contact_geometry import FACE
from .equilibrium import EXACT
from .iteration import settle
from .jitted import inlined, kernel
from .newton import newton_step
from .rod import State, look

SHORT = 1e-3  # rad; a Newton step this long leaves an error of about its square
STEPS = 6


@kernel
def hold_at(rod, held, position, quaternion):  # type: ignore[no-untyped-def]
    """Move the grasps of a rod to new poses, in place.

    `held` says which grasp each row belongs to, which director of its frame the row is along (-1 for an axis of the world), and which
    grasp each clamp and the base is.
    """
    rows, along, clamps, base = held
    own = rod.held.rows
    for k in range(3):
        rod.origin[k] = position[base, k]
    for clamp in range(len(clamps)):
        for k in range(4):
            rod.clamp_frames[clamp, k] = quaternion[clamps[clamp], k]
    for row in range(len(rows)):
        if along[row] >= 0:
            own["axis"][row] = directors(quaternion[rows[row] : rows[row] + 1])[0, along[row]]
        own["goal"][row] = 0.0
        for k in range(3):
            own["goal"][row] += own["axis"][row, k] * position[rows[row], k]


@kernel
def follow(rod, held, state, position, quaternion):  # type: ignore[no-untyped-def]
    """Move the grasps, and the state after them, in place; without contacts.

    Returns:
        Nodes (n, 3) [m], and 1 at a stable equilibrium, 0 at another, -1 if no step became short: the state is then as it was.
    """
    return _follow(rod, held, state, position, quaternion)


# A function that calls others is compiled with all of them once more: those between a kernel and the Newton step are part of the kernel.
@inlined
def _follow(rod, held, state, position, quaternion):  # type: ignore[no-untyped-def]
    hold_at(rod, held, position, quaternion)
    after, nodes, verdict = _settled(rod, state, SHORT, STEPS)
    if verdict >= 0:
        state.frames[:] = after.frames
        state.force[:] = after.force
    return nodes, verdict


@inlined
def _settled(rod, state, short, steps):  # type: ignore[no-untyped-def]
    """Newton steps until one is shorter than `short` [rad]: state, nodes, verdict."""
    state, view = look(rod, state, np.ascontiguousarray(rod.touch["normal"]))
    for _ in range(steps):
        step = newton_step(rod, state, view, EXACT, 0.0)
        longest = np.abs(step.turn).max()
        if not longest < 1.0:
            break
        state = State(
            retract(state.frames, step.turn),
            step.force,
            state.holds,
            step.push,
            step.touches,
            state.fraction,
            step.drag,
            step.sticks,
            state.ease,
        )
        state, view = look(rod, state, view.push)
        if longest < short:
            return state, view.nodes, 1 if step.is_stable else 0
    return state, view.nodes, -1


@kernel
def follow_touching(rod, held, state, position, quaternion, segments):  # type: ignore[no-untyped-def]
    """Move the grasps, and settle from a state, which stays as it is, with contacts that were on `segments` (m,).

    Returns:
        Nodes (n, 3) [m]; the verdict of `follow`; whether an edge or a vertex does not push any more, and whether one is touched from
        another segment; and of the state after it what has changed, all of it but friction. Every array handed over costs 0.3 us, and
        0.2 us more in a named tuple.
    """
    hold_at(rod, held, position, quaternion)
    found = settle(rod, state, 0.0)
    force, moment, pushed = np.zeros(len(segments)), np.zeros(len(segments)), np.zeros(len(segments), dtype=np.bool_)
    s = np.append(0.0, np.cumsum(rod.lengths))
    contacts, touched, features, before, after = rod.touch["contact"], rod.touch["element"], rod.touch["feature"], state.push, found.state
    for row in range(len(before)):
        contact, segment, push = contacts[row], touched[row], after.push[row]
        if features[row] != FACE:
            pushed[contact] |= before[row] > 0.0
            force[contact] += push
            moment[contact] += push * (s[segment] + after.fraction[row] * rod.lengths[segment])
    is_lost, has_slid, last = False, False, len(rod.lengths) - 1
    for contact in range(len(segments)):
        if force[contact] > 0.0:
            place, segment = moment[contact] / force[contact], segments[contact]
            has_slid |= not (s[segment] <= place < s[segment + 1] or (segment == last and place >= s[last]))
        else:
            is_lost |= pushed[contact]
    verdict = (1 if found.is_stable else 0) if found.is_converged else -1
    changed = after.frames, after.force, after.holds, after.push, after.touches, after.fraction
    return found.seen.nodes, verdict, is_lost, has_slid, changed


@kernel
def follow_nested(rod, finer, held, state, between, position, quaternion):  # type: ignore[no-untyped-def]
    """The same on a mesh and, by one more step, on the one with every segment halved; nodes of fourth order.

    Args:
        rod: On the coarser mesh.
        finer: The same rod on the finer mesh.
        held: See `hold_at`.
        state: Of the coarser mesh.
        between: Arc lengths [m] of the frames known, clamps at the ends among them (k,), and of the middles of the finer mesh (m,).
        position: (g, 3) [m].
        quaternion: (g, 4).

    Returns:
        Nodes (n, 3) [m] of the coarser mesh, the verdict of `follow`, and the largest distance of the two meshes' nodes [m].
    """
    nodes, verdict = _follow(rod, held, state, position, quaternion)
    if verdict < 0:
        return nodes, verdict, np.inf
    hold_at(finer, held, position, quaternion)
    there, here = between
    count, first = len(state.frames), 1 if rod.clamp_of_node[0] >= 0 else 0
    frames = np.empty((len(there), 4))
    if first:
        frames[0] = rod.clamp_frames[rod.clamp_of_node[0]]
    frames[first : first + count] = state.frames
    if len(there) > first + count:
        frames[first + count] = rod.clamp_frames[rod.clamp_of_node[count]]
    begun = State(interpolate_frames(there, frames, here), *state[1:])
    # One step from a shape that is off by c h^2 leaves an error of its square: of fourth order.
    _, fine, more = _settled(finer, begun, 1.0, 1)
    if more < 0:
        return nodes, more, np.inf
    out, apart = combined_nodes(nodes, fine)
    return out, verdict, apart
