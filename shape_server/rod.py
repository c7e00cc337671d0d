"""The rod as a system of equations: what it is made of, where it is, and what follows from that; compiled.

Unknowns are the frames of the segments and, on the border, the forces at held points (grasps and bonds) and at one-sided
contacts (one each); see `newton`. All parts are named tuples of arrays, which numba compiles and numpy runs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .axial import pulled_lengths
from .bend_limit import limit_energy
from .chain import carried_forces, directors, positions
from .chain_terms import three
from .contact_geometry import FAR, contact_geometry
from .inclined import add_couples, incline
from .jitted import kernel
from .smoothing import smoothing_energy
from .strands import Strands, add_strand_forces, meet
from .vertices import elastic_energy


class Elastic(NamedTuple):
    """Stiffness and natural curvature about d1 and d2, and twist, of every segment and of every node between two; ties of nodes."""

    law: np.ndarray  # (n-1, 3) N m^2
    bent: np.ndarray  # (n-1, 3) 1/m
    node_law: np.ndarray  # (n, 3) N m^2, in series over half of each neighbour
    node_bent: np.ndarray  # (n, 3) 1/m
    smoothing: np.ndarray  # (n-1, 2) N m^3, see `smoothing`; empty without a micro-structure length
    limit: np.ndarray  # (2,) 1/m and N m^2, see `bend_limit`; empty without a least bend radius


HELD = np.dtype(
    [
        ("element", np.int64),  # segment
        ("fraction", float),  # place along it
        ("axis", float, 3),  # unit
        ("goal", float),  # m
        ("bond", np.int64),  # which bond the row belongs to, -1 for a grasp
    ]
)


class Held(NamedTuple):
    """Rows of points of the cable that are held: axis . r(s) = goal, for all grasps but the base, then the bonds.

    After these come the rows of inclination, axis . r' = goal with r' the derivative of the axis along segments (`strands.shares`).
    """

    rows: np.ndarray  # (h,) of `HELD`
    normal: np.ndarray  # (b, 3) unit, of every bond: dropped when its force pulls against it
    inclined: int  # how many rows, the last ones, are those of inclination


# Rows of one-sided contacts. Those of the cable with itself are the last, faces without a normal here; what they are stands in `Strands`.
TOUCH = np.dtype(
    [
        ("contact", np.int64),  # which contact of the request, for several rows may be one; a negative number of its own for a self-contact
        ("element", np.int64),  # segment where it was found
        ("feature", np.int64),
        ("rub", np.int64),  # row of `Rub`, -1 without friction
        ("point", float, 3),  # m
        ("normal", float, 3),  # unit
        ("direction", float, 3),  # unit
        ("extent", float, 2),  # m, of the edge from `point`
        ("distance", float),  # m
        ("is_straight", np.int64),  # 1 where the distance is that of the straight segment, without a bulge (`contact_geometry`)
    ]
)

RUB = np.dtype(
    [
        ("contact", np.int64),  # which contact of the request
        ("element", np.int64),  # segment of the material point that is held
        ("fraction", float),  # its place along it
        ("axes", float, (2, 3)),  # unit, square to the normal and to each other
        ("anchor", float, 3),  # m, where the point was held
        ("coefficient", float),  # mu
        ("speed", float),  # m/s, v0
        ("table", np.int64),  # which table, -1 for none
    ]
)


class Rub(NamedTuple):
    """Contacts with friction, one row for each contact of the request that rubs, and the numbers of their laws; see `drag`."""

    rows: np.ndarray  # (f,) of `RUB`
    tables: np.ndarray  # (t, 1 + k, 1 + q) N over speeds (m/s) in the first column and normal forces (N) in the first row; ends in NaN
    time_step: float  # s


NO_RUB = Rub(np.zeros(0, dtype=RUB), np.zeros((0, 1, 1)), 1.0)


def from_columns(dtype: np.dtype[np.void], columns: dict[str, np.ndarray]) -> np.ndarray:
    """Rows (k,) of a structured type, from an array (k, ...) for each of its fields.

    A field costs a compiled function nothing. An array of its own would be counted in and out at every call that it is handed to: with
    sixty of them a Newton step on ten segments took 24 us, see decision 0025.
    """
    out = np.empty(len(next(iter(columns.values()))), dtype=dtype)
    for name in dtype.names or ():
        out[name] = columns[name]
    return out


class Rod(NamedTuple):
    """One cable with bending and twist under its boundary conditions, on one mesh."""

    lengths: np.ndarray  # (n-1,) m, of the segments
    base: int  # node where positions start: the first held point
    origin: np.ndarray  # (3,) m, where that node is
    clamp_of_node: np.ndarray  # (n,) int, index into `clamp_frames`, -1 for none
    clamp_frames: np.ndarray  # (c, 4)
    elastic: Elastic
    loads: np.ndarray  # (n, 3) N
    give: np.ndarray  # (n-1,) m/N, length over EA; empty if the cable does not stretch
    held: Held
    touch: np.ndarray  # (m,) of `TOUCH`
    rub: Rub
    strands: Strands
    length: float  # m
    stiffest: float  # N m^2, largest stiffness against bending
    weight: float  # N, size of the load as a whole
    force_scale: float  # N, typical force: the weight, or what bends the cable into an arch
    shortest: float  # m, shortest piece between held points, at least a fifth of the cable
    kick: float  # rad, how far to go off a saddle


class State(NamedTuple):
    """Where the rod is, and the forces that hold it."""

    frames: np.ndarray  # (n-1, 4)
    force: np.ndarray  # (h,) N, of every row of held points
    holds: np.ndarray  # (b,) bool, whether each bond still holds
    push: np.ndarray  # (m,) N, at every contact
    touches: np.ndarray  # (m,) bool, contacts that push
    fraction: np.ndarray  # (m + 5k,) place of each contact along its segment, then both places and the normal of each self-contact
    drag: np.ndarray  # (f, 2) N, friction along the axes of `Rub`
    sticks: np.ndarray  # (f,) bool, contacts that touch and do not slide
    ease: np.ndarray  # (f,) m/N, how friction gives way in a descent; not used with exact rows


class View(NamedTuple):
    """What follows from a state without solving anything."""

    axes: np.ndarray  # (n-1, 3, 3) directors
    lengths: np.ndarray  # (n-1,) m, as they are pulled
    nodes: np.ndarray  # (n, 3) m
    miss: np.ndarray  # (h,) m, held point less its goal
    gap: np.ndarray  # (m,) m
    normal: np.ndarray  # (m, 3)
    push: np.ndarray  # (m, 3) direction of the force at each contact
    slide: np.ndarray  # (m, 3)
    across: np.ndarray  # (m, 3)
    numbers: np.ndarray  # (m, 4), see `contact_geometry`
    slip: np.ndarray  # (f, 2) m, material point less its anchor, along the axes of `Rub`


@kernel
def look(rod, state, push_direction):  # type: ignore[no-untyped-def]
    """Positions, gaps and misses of a state; the contacts of the returned state have slid to where they are nearest.

    `push_direction` (m, 3), that of the view before, matters only to a cable that stretches.
    """
    axes = directors(state.frames)
    lengths = rod.lengths
    if len(rod.give) > 0:
        lengths = pulled_lengths(lengths, rod.give, axes, carried_forces(_node_forces(rod, state, push_direction), rod.base))
    nodes = positions(axes[:, 2], lengths, rod.base, rod.origin)
    held, inclined = rod.held.rows, rod.held.inclined
    miss = np.empty(len(held))
    if inclined > 0:
        incline(nodes, rod.held, miss)
    for row in range(len(miss) - inclined):
        j, f = held["element"][row], held["fraction"][row]
        miss[row] = -held["goal"][row]
        for k in range(3):
            miss[row] += held["axis"][row, k] * (nodes[j, k] + f * (nodes[j + 1, k] - nodes[j, k]))
    touch, fraction = rod.touch, state.fraction.copy()
    gap, normal, push, slide, across, numbers = contact_geometry(
        nodes,
        axes,
        lengths,
        touch,
        fraction,
    )
    if len(rod.strands.distance) > 0:
        meet(nodes, rod.strands, fraction, gap, normal)
    force, touches = _handed_over(touch, gap, state.push, state.touches)
    moved = State(state.frames, state.force, state.holds, force, touches, fraction, state.drag, state.sticks, state.ease)
    return moved, View(axes, lengths, nodes, miss, gap, normal, push, slide, across, numbers, _slips(rod.rub.rows, nodes))


@kernel
def _slips(rub, nodes):  # type: ignore[no-untyped-def]
    """How far material points have gone along the surface since they were held, (f, 2) [m]."""
    out = np.zeros((len(rub), 2))
    for row in range(len(out)):
        j, f = rub["element"][row], rub["fraction"][row]
        for k in range(3):
            away = nodes[j, k] + f * (nodes[j + 1, k] - nodes[j, k]) - rub["anchor"][row, k]
            out[row, 0] += rub["axes"][row, 0, k] * away
            out[row, 1] += rub["axes"][row, 1, k] * away
    return out


@kernel
def is_active(bond, holds, row):  # type: ignore[no-untyped-def]
    """Whether a row of a held point holds: always that of a grasp, that of a bond until it pulls."""
    return bond[row] < 0 or holds[bond[row]]


@kernel
def _handed_over(touch, gap, push, touches):  # type: ignore[no-untyped-def]
    """Forces (m,) and touches (m,) after rows that another one has taken over from gave it what they carried."""
    push, touches = push.copy(), touches.copy()
    for row in range(len(gap)):
        if gap[row] != FAR or not push[row] > 0.0:
            continue
        heir = -1
        for other in range(len(gap)):
            if touch["contact"][other] == touch["contact"][row] and gap[other] < FAR and (heir < 0 or abs(gap[other]) < abs(gap[heir])):
                heir = other
        if heir >= 0:
            push[heir] += push[row]
            touches[heir] = True
        push[row], touches[row] = 0.0, False
    return push, touches


@kernel
def node_forces(rod, state, view):  # type: ignore[no-untyped-def]
    """Loads, forces at held points and contact forces, shared by the nodes: (n, 3) [N]. The base is left out."""
    forces = _node_forces(rod, state, view.push)
    if len(rod.strands.distance) > 0:
        add_strand_forces(forces, rod.strands, state.push, state.fraction, view.normal)
    return forces


@kernel
def _node_forces(rod, state, push_direction):  # type: ignore[no-untyped-def]
    forces = rod.loads.copy()
    if rod.held.inclined > 0:
        add_couples(forces, rod.held, state.force, state.holds)
    held, axes, holds, touch, rub = rod.held.rows, rod.held.rows["axis"], state.holds, rod.touch, rod.rub.rows
    for row in range(len(state.force) - rod.held.inclined):
        if is_active(held["bond"], holds, row):
            _share(forces, held["element"][row], held["fraction"][row], state.force[row], three(axes, row))
    for row in range(len(state.push)):
        if state.push[row] != 0.0:
            _share(forces, touch["element"][row], state.fraction[row], state.push[row], three(push_direction, row))
    for row in range(len(state.drag)):
        for axis in range(2):
            along = rub["axes"][row, axis]
            _share(forces, rub["element"][row], rub["fraction"][row], state.drag[row, axis], (along[0], along[1], along[2]))
    return forces


@kernel
def _share(forces, element, fraction, size, direction):  # type: ignore[no-untyped-def]
    for k in range(3):
        forces[element, k] += (1.0 - fraction) * size * direction[k]
        forces[element + 1, k] += fraction * size * direction[k]


@kernel
def net_moment(rod, state, view):  # type: ignore[no-untyped-def]
    """Moment (3,) [N m] of loads, held points and contacts about the base; what clamps do not take, an equilibrium leaves zero."""
    forces, total = node_forces(rod, state, view), np.zeros(3)
    for i in range(len(forces)):
        _add_cross(total, 1.0, view.nodes[i] - rod.origin, forces[i])
    for row in range(len(state.push)):
        _add_cross(total, state.push[row] * view.numbers[row, 2], view.axes[rod.touch["element"][row], 2], view.normal[row])
    return total


@kernel
def _add_cross(out, size, a, b):  # type: ignore[no-untyped-def]
    out[0] += size * (a[1] * b[2] - a[2] * b[1])
    out[1] += size * (a[2] * b[0] - a[0] * b[2])
    out[2] += size * (a[0] * b[1] - a[1] * b[0])


@kernel
def energy(rod, state, view):  # type: ignore[no-untyped-def]
    """Energy of bending and twist less the work of the loads [J]; forces on the border are left out."""
    total = elastic_energy(state.frames, rod.lengths, rod.elastic, rod.clamp_of_node, rod.clamp_frames)
    if len(rod.elastic.smoothing) > 0:
        total += smoothing_energy(state.frames, rod.lengths, rod.elastic, rod.clamp_of_node, rod.clamp_frames)
    if len(rod.elastic.limit) > 0:
        total += limit_energy(state.frames, rod.lengths, rod.elastic, rod.clamp_of_node, rod.clamp_frames)
    for node in range(len(rod.loads)):
        for k in range(3):
            total -= rod.loads[node, k] * view.nodes[node, k]
    return total
