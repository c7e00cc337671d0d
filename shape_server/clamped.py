"""Newton steps of one cable clamped at both ends, without stretch and contacts: the inner loop of a planner, in one compiled call.

Each vertex is assembled and the segment before it eliminated at once (`chain_terms`); nothing but the factors is kept. A step takes a
fraction of what the general code of `newton` takes, which assembles, then eliminates, for any border; and few, plain arrays pass from
Python, which otherwise takes longer than a step of twenty segments.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .chain import blend_frames, combined_nodes
from .chain_terms import closed, eliminated, larger, substituted, turn_of, turned, vertex_terms
from .jitted import kernel
from .vertices import CLAMP, INNER

INVERSE, CARRY, RIGHT, COLUMN, WIDTH = 0, 6, 15, 27, 33  # where the numbers of a segment begin, and their count
NONE = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
NOTHING = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class Chain(NamedTuple):
    """A cable on one mesh, without the poses of its clamps."""

    vertex: np.ndarray  # (n, 7) length [m], stiffness (3) [N m^2] and natural curvature (3) [1/m] of every node's cell
    lengths: np.ndarray  # (n-1,) m
    weight: np.ndarray  # (n-1, 3) N, load of all nodes beyond a segment


@kernel
def follow_clamped(chain, frames, force, position, quaternion, short, steps):  # type: ignore[no-untyped-def]
    """Newton steps until one is shorter than `short` [rad]; frames and force are then changed in place, else left alone.

    Args:
        chain: See `Chain`.
        frames: (n+1, 4) Of the first clamp, every segment, the last clamp.
        force: (3,) [N] Of the last clamp on the cable.
        position: (2, 3) [m] Where the clamps are now.
        quaternion: (2, 4) How they are turned now.
        short: [rad] A step shorter than this is the last one.
        steps: How many at most.

    Returns:
        Nodes (n, 3) [m], and 1 at a stable equilibrium, 0 at another, -1 if no step became short.
    """
    now = frames.copy()
    _hold(now, quaternion)
    pull, verdict = _settle(chain, now, (force[0], force[1], force[2]), position, short, steps)
    if verdict >= 0:
        frames[:] = now
        force[0], force[1], force[2] = pull
    return _nodes(chain.lengths, now, position), verdict


@kernel
def follow_clamped_nested(chain, finer, blend, frames, force, position, quaternion, short, steps):  # type: ignore[no-untyped-def]
    """The same on a mesh and, by one more step, on the one with every segment halved; nodes of fourth order.

    `blend` are the `cubic_weights` of the frames of the finer mesh in those of the coarser one and its clamps.

    Returns:
        Nodes (n, 3) [m] of the coarser mesh, the verdict of `follow_clamped`, and the largest distance of the two meshes' nodes [m].
    """
    nodes, verdict = follow_clamped(chain, frames, force, position, quaternion, short, steps)
    if verdict < 0:
        return nodes, verdict, np.inf
    fine = np.empty((2 * len(frames) - 2, 4))
    _hold(fine, quaternion)
    fine[1:-1] = blend_frames(frames, *blend)
    # One step from a shape that is off by c h^2 leaves an error of its square: of fourth order.
    _, more = _settle(finer, fine, (force[0], force[1], force[2]), position, 1.0, 1)
    if more < 0:
        return nodes, more, np.inf
    out, apart = combined_nodes(nodes, _nodes(finer.lengths, fine, position))
    return out, verdict, apart


@kernel
def _hold(frames, quaternion):  # type: ignore[no-untyped-def]
    for k in range(4):
        frames[0, k], frames[-1, k] = quaternion[0, k], quaternion[1, k]


@kernel
def _settle(chain, frames, force, position, short, steps):  # type: ignore[no-untyped-def]
    """Newton steps, in place: the force and the verdict."""
    chord = position[1, 0] - position[0, 0], position[1, 1] - position[0, 1], position[1, 2] - position[0, 2]
    work = np.empty((len(chain.lengths) + 1, WIDTH))
    work[-1] = 0.0
    for _ in range(steps):
        force, longest, inertia = _step(chain, frames, force, chord, work)
        if not longest < 1.0:
            break
        if longest < short:
            return force, 1 if inertia == 3.0 else 0
    return force, -1


@kernel
def _step(chain, frames, force, chord, work):  # type: ignore[no-untyped-def]
    """One Newton step: the new force, the longest turn [rad], and the negative eigenvalues of H and positive ones of S."""
    count, vertex = len(chain.lengths), chain.vertex
    miss, inertia = (-chord[0], -chord[1], -chord[2]), 0.0
    kind, here = CLAMP, _four(frames, 0)
    slopes, _, curve, couple = vertex_terms(here, _four(frames, 1), vertex[0, 0], _three(vertex[0], 1), _three(vertex[0], 4), kind)
    slope, columns, carried, right = slopes[1], NONE, NONE, NOTHING
    for j in range(count):
        here, row = _four(frames, j + 1), vertex[j + 1]
        kind = INNER if j + 1 < count else CLAMP
        slopes, before, after, couple = vertex_terms(here, _four(frames, j + 2), row[0], _three(row, 1), _three(row, 4), kind)
        load = chain.weight[j]
        pull = load[0] + force[0], load[1] + force[1], load[2] + force[2]
        own = before, slopes[0], couple
        inverse, carry, right, border, along, negative = eliminated(
            here, chain.lengths[j], pull, (columns, carried, curve, slope, right), own
        )
        inertia += negative
        miss = miss[0] + along[0], miss[1] + along[1], miss[2] + along[2]
        _keep(work[j], inverse, carry, right, border)
        columns, carried, curve, slope = _columns(couple), _columns(carry), after, slopes[1]
    first, second, third, x = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), NOTHING
    for j in range(count - 1, -1, -1):
        row = work[j]
        inverse, carry = (
            (_three(row, INVERSE), _three(row, INVERSE + 3)),
            (_three(row, CARRY), _three(row, CARRY + 3), _three(row, CARRY + 6)),
        )
        x, one, two, three = substituted(inverse, carry, _right(row), (_three(row, COLUMN), _three(row, COLUMN + 3)), x)
        first, second, third = _sum(first, one), _sum(second, two), _sum(third, three)
        for k in range(4):
            row[RIGHT + 3 * k], row[RIGHT + 3 * k + 1], row[RIGHT + 3 * k + 2] = x[k]
    change, positive = closed(first, second, third, miss)
    longest = 0.0
    for j in range(count):
        turn = turn_of(_right(work[j]), change)
        longest = larger(larger(longest, abs(turn[0])), larger(abs(turn[1]), abs(turn[2])))
        frames[j + 1, 0], frames[j + 1, 1], frames[j + 1, 2], frames[j + 1, 3] = turned(
            _four(frames, j + 1), (0.5 * turn[0], 0.5 * turn[1], 0.5 * turn[2])
        )
    return _sum(force, change), longest, inertia + positive


@kernel
def _nodes(lengths, frames, position):  # type: ignore[no-untyped-def]
    """Nodes (n, 3) [m] along the frames of clamps and segments."""
    nodes = np.empty((len(lengths) + 1, 3))
    nodes[0, 0], nodes[0, 1], nodes[0, 2] = position[0, 0], position[0, 1], position[0, 2]
    for j in range(len(lengths)):
        x, y, z, w = _four(frames, j + 1)
        h = lengths[j]
        nodes[j + 1, 0] = nodes[j, 0] + h * 2.0 * (x * z + w * y)
        nodes[j + 1, 1] = nodes[j, 1] + h * 2.0 * (y * z - w * x)
        nodes[j + 1, 2] = nodes[j, 2] + h * (1.0 - 2.0 * (x * x + y * y))
    return nodes


@kernel
def _keep(row, inverse, carry, right, border):  # type: ignore[no-untyped-def]
    row[0], row[1], row[2] = inverse[0]
    row[3], row[4], row[5] = inverse[1]
    row[6], row[7], row[8] = carry[0]
    row[9], row[10], row[11] = carry[1]
    row[12], row[13], row[14] = carry[2]
    row[15], row[16], row[17] = right[0]
    row[18], row[19], row[20] = right[1]
    row[21], row[22], row[23] = right[2]
    row[24], row[25], row[26] = right[3]
    row[27], row[28], row[29] = border[0]
    row[30], row[31], row[32] = border[1]


@kernel
def _right(row):  # type: ignore[no-untyped-def]
    return _three(row, RIGHT), _three(row, RIGHT + 3), _three(row, RIGHT + 6), _three(row, RIGHT + 9)


@kernel
def _three(row, at):  # type: ignore[no-untyped-def]
    return row[at], row[at + 1], row[at + 2]


@kernel
def _four(frames, i):  # type: ignore[no-untyped-def]
    return frames[i, 0], frames[i, 1], frames[i, 2], frames[i, 3]


@kernel
def _columns(rows):  # type: ignore[no-untyped-def]
    return (rows[0][0], rows[1][0], rows[2][0]), (rows[0][1], rows[1][1], rows[2][1]), (rows[0][2], rows[1][2], rows[2][2])


@kernel
def _sum(a, b):  # type: ignore[no-untyped-def]
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]
