"""What the sections of a settled rod carry: tension, curvature, twist, and the moments at its clamps, compiled."""

from __future__ import annotations

import numpy as np

from .bend_limit import place, secant
from .chain import carried_forces
from .jitted import kernel
from .rod import node_forces
from .smoothing import tied
from .vertices import CLAMP, INNER, relative, strain_scale


@kernel
def section_forces(rod, state, view):  # type: ignore[no-untyped-def]
    """Tension (n-1,) [N], curvature (n,) [1/m], total twist [rad], and moments (c, 3) [N m] on the cable at all clamps.

    Tension is that at the middle of every segment; of a clamp inside the cable the curvature is the larger of its two sides.
    """
    count, limit = len(rod.lengths), rod.elastic.limit[0] if len(rod.elastic.limit) > 0 else np.inf
    carried = carried_forces(node_forces(rod, state, view), rod.base)
    tension, curvature = np.empty(count), np.zeros(count + 1)
    moments, rho, world = np.zeros((len(rod.clamp_frames), 3)), np.empty(4), np.empty(3)
    for j in range(count):
        d3 = view.axes[j, 2]
        tension[j] = carried[j, 0] * d3[0] + carried[j, 1] * d3[1] + carried[j, 2] * d3[2]
    for i in range(count + 1):
        clamp = rod.clamp_of_node[i]
        if clamp < 0 and 0 < i < count:
            relative(state.frames[i - 1], state.frames[i], rho)
            curvature[i] = _bend(rho, 0.5 * (rod.lengths[i - 1] + rod.lengths[i]), INNER)
        elif clamp < 0:  # an end without a moment keeps the curvature that it has by nature
            bent = rod.elastic.bent[min(i, count - 1)]
            curvature[i] = np.sqrt(bent[0] * bent[0] + bent[1] * bent[1])
        for side in range(2):
            segment = i - 1 + side
            if clamp < 0 or segment < 0 or segment >= count:
                continue
            first = state.frames[segment] if side == 0 else rod.clamp_frames[clamp]
            second = rod.clamp_frames[clamp] if side == 0 else state.frames[segment]
            relative(first, second, rho)
            cell = 0.5 * rod.lengths[segment]
            law, bent = rod.elastic.law[segment], rod.elastic.bent[segment]
            clamp_moment(rho, cell, law, bent, second, world)
            own, bend = _bend(rho, cell, CLAMP), _held_bend(world, rod.clamp_frames[clamp], law, bent)
            is_law = len(rod.elastic.smoothing) == 0 and max(own, bend) < limit  # else more than this moment bends it
            curvature[i] = max(curvature[i], bend if is_law else own)
            for k in range(3):
                moments[clamp, k] += world[k] if side == 0 else -world[k]
    if len(rod.elastic.smoothing) > 0:
        _add_smoothing(rod, state, curvature, moments)
    if len(rod.elastic.limit) > 0:
        _add_limit(rod, state, moments)
    return tension, curvature, twist_of(state.frames, rod.clamp_of_node, rod.clamp_frames), moments


@kernel
def _add_smoothing(rod, state, curvature, moments):  # type: ignore[no-untyped-def]
    """Add what the ties of `smoothing` do: to the moments of clamps, and the curvature that they leave at ends without one."""
    strain, ties = tied(state.frames, rod.lengths, rod.elastic, rod.clamp_of_node, rod.clamp_frames)
    law, mean, rho, world = np.zeros(3), np.zeros(3), np.empty(4), np.empty(3)
    for segment in range(len(rod.lengths)):
        for side in range(2):
            node, bent = segment + side, rod.elastic.bent[segment]
            clamp, cell = rod.clamp_of_node[node], 0.5 * rod.lengths[segment]
            if clamp < 0 and (node == 0 or node == len(rod.lengths)):
                size = 0.0
                for k in range(2):
                    size += (bent[k] + ties[segment, k] / (cell * rod.elastic.law[segment, k]) * strain[segment, 1 - side, k]) ** 2
                curvature[node] = np.sqrt(size)
            if clamp < 0:
                continue
            for k in range(2):
                law[k], mean[k] = ties[segment, k] / cell, bent[k] + strain[segment, 1 - side, k]
            first = state.frames[segment] if side == 1 else rod.clamp_frames[clamp]
            second = rod.clamp_frames[clamp] if side == 1 else state.frames[segment]
            relative(first, second, rho)
            clamp_moment(rho, cell, law, mean, second, world)
            for k in range(3):
                moments[clamp, k] += world[k] if side == 1 else -world[k]


@kernel
def _add_limit(rod, state, moments):  # type: ignore[no-untyped-def]
    """Add what the least bend radius does to the moments of clamps."""
    law, none, rho, world = np.zeros(3), np.zeros(3), np.empty(4), np.empty(3)
    for segment in range(len(rod.lengths)):
        for side in range(2):
            clamp = rod.clamp_of_node[segment + side]
            if clamp < 0:
                continue
            first, second, cell, kind = place(state.frames, rod.lengths, rod.clamp_of_node, rod.clamp_frames, segment, side)
            law[0] = law[1] = secant(first, second, cell, kind, rod.elastic.limit, rho)
            clamp_moment(rho, cell, law, none, second, world)
            for k in range(3):
                moments[clamp, k] += world[k] if side == 1 else -world[k]


@kernel
def twist_of(frames, clamp_of_node, clamp_frames):  # type: ignore[no-untyped-def]
    """Twist [rad] of the section about the tangent, from the first node to the last."""
    count, twist, rho = len(frames), 0.0, np.empty(4)
    for i in range(count + 1):
        clamp = clamp_of_node[i]
        if clamp < 0 and 0 < i < count:
            relative(frames[i - 1], frames[i], rho)
            twist += 4.0 * np.arctan(rho[2] / (1.0 + rho[3]))
        if clamp >= 0 and i > 0:
            relative(frames[i - 1], clamp_frames[clamp], rho)
            twist += 4.0 * np.arctan(rho[2] / (1.0 + rho[3]))
        if clamp >= 0 and i < count:
            relative(clamp_frames[clamp], frames[i], rho)
            twist += 4.0 * np.arctan(rho[2] / (1.0 + rho[3]))
    return twist


@kernel
def _bend(rho, cell, kind):  # type: ignore[no-untyped-def]
    return strain_scale(rho[3], cell, kind) * np.sqrt(rho[0] * rho[0] + rho[1] * rho[1])


@kernel
def _held_bend(moment, frame, law, bent):  # type: ignore[no-untyped-def]
    """Curvature [1/m] at a clamp by the moment there: the cell's own is that of its middle, whose axes precess from those of the clamp."""
    x, y, z, w = frame[0], frame[1], frame[2], frame[3]
    u, v, t = moment[0], moment[1], moment[2]
    first = (1.0 - 2.0 * (y * y + z * z)) * u + 2.0 * (x * y + w * z) * v + 2.0 * (x * z - w * y) * t
    second = 2.0 * (x * y - w * z) * u + (1.0 - 2.0 * (x * x + z * z)) * v + 2.0 * (y * z + w * x) * t
    return np.hypot(first / law[0] + bent[0], second / law[1] + bent[1])


@kernel
def clamp_moment(rho, cell, law, bent, frame, out):  # type: ignore[no-untyped-def]
    """Moment (3,) [N m], world frame, that the part after a clamp's vertex exerts on the part before it.

    The gradient of the vertex energy with respect to a turn of the later frame, 2 B^T M with B as in `vertices`, turned to the world.
    """
    scale = strain_scale(rho[3], cell, CLAMP)
    s0, s1, s2 = 0.5 * cell * scale * rho[0], 0.5 * cell * scale * rho[1], 0.5 * cell * scale * rho[2]
    m0, m1, m2 = law[0] * (scale * rho[0] - bent[0]), law[1] * (scale * rho[1] - bent[1]), law[2] * (scale * rho[2] - bent[2])
    x, y, z, w = frame[0], frame[1], frame[2], frame[3]
    along = s0 * m0 + s1 * m1 + s2 * m2
    u = m0 - (s1 * m2 - s2 * m1) + along * s0
    v = m1 - (s2 * m0 - s0 * m2) + along * s1
    t = m2 - (s0 * m1 - s1 * m0) + along * s2
    a, b, c = y * t - z * v + w * u, z * u - x * t + w * v, x * v - y * u + w * t
    out[0], out[1], out[2] = u + 2.0 * (y * c - z * b), v + 2.0 * (z * a - x * c), t + 2.0 * (x * b - y * a)
