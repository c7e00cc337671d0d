"""Newton steps of many cables at once, one in each lane of the processor's vector registers; compiled.

The formulas are those of `chain_terms`, for what most sweeps are about: cables without stretch and contacts, clamped at
both ends, on as many segments each. Every quantity is a row of `LANES` numbers, one of every cable, and every inner loop runs over such
a row, without a branch, so that LLVM turns it into vector instructions. It does only if

* a division cannot raise (`error_model="numpy"`),
* rows are told apart by arrays of one axis, `here`, `before` and `after`, and by constant offsets in them,
* a row has sixteen numbers or more: for less it does not look whether arrays overlap.

The frames of both clamps stand in line with those of the segments, so that every node is a vertex between two rows of frames. Each vertex
is assembled and the segment before it eliminated at once; nothing but the factors is kept. At 40 segments a motion takes 3.6 us per cable
where `clamped` takes 13 us (AVX-512).
"""

from __future__ import annotations

import numpy as np

from .chain_terms import closed, eliminated, larger, substituted, turn_of, turned, vertex_terms
from .jitted import kernel
from .lane_rows import LANES, add, column, four, place_nodes, put, three
from .vertices import CLAMP, INNER

# Where the rows of every segment and clamp begin.
FRAME = 0  # (4)
CELL, LAW, BENT = 4 * LANES, 5 * LANES, 8 * LANES  # (1) m, (3) N m^2, (3) 1/m, of the vertex between this frame and the next
LENGTH, WEIGHT = 11 * LANES, 12 * LANES  # (1) m, (3) N, weight of all nodes beyond
INVERSE, CARRY = 15 * LANES, 21 * LANES  # (6) and (9), as in `elimination`
RIGHT = 30 * LANES  # (4, 3) right-hand sides: three of the border, and the gradient
COLUMN = 42 * LANES  # (3, 2) of the border, about d1 and d2
COUPLE = 48 * LANES  # (9) between this frame and the next
CURVE, SLOPE = 57 * LANES, 63 * LANES  # (6) and (3), of the vertex, about the frame after it
CURVE_BEFORE, SLOPE_BEFORE = 66 * LANES, 72 * LANES  # (6) and (3), about the frame before it
WIDTH = 75 * LANES
# Where the rows of the cables as a whole begin.
SCHUR, MISS, FORCE, CHORD = 0, 9 * LANES, 12 * LANES, 15 * LANES  # (3, 3), (3) m, (3) N, (3) m
INERTIA = 18 * LANES  # (1) negative eigenvalues of H and positive ones of S
LONGEST, MOVES = 19 * LANES, 20 * LANES  # (1) rad, of the step; (1) one, or zero when done
SUMS = 21 * LANES


@kernel
def follow_lanes(vertex, lengths, weight, origin, chord, frames, force, short, steps):  # type: ignore[no-untyped-def]
    """Newton steps of blocks of `LANES` cables until one is shorter than `short` [rad]; frames and forces are changed in place.

    In the last axis of every array each number stands in line with that of the other cables of its block.

    Args:
        vertex: (blocks, n, 7 LANES) Length [m], stiffness (3) [N m^2] and natural curvature (3) [1/m] of every node's cell.
        lengths: (blocks, n-1, LANES) [m].
        weight: (blocks, n-1, 3 LANES) [N] Load of all nodes beyond a segment.
        origin: (blocks, 3 LANES) [m] First clamp.
        chord: (blocks, 3 LANES) [m] From the first clamp to the last.
        frames: (blocks, n+1, 4 LANES) Of the first clamp, every segment, the last clamp.
        force: (blocks, 3 LANES) [N] Of the last clamp.
        short: [rad] A step shorter than this is the last one.
        steps: How many at most.

    Returns:
        Nodes (cables, n, 3) [m], and (cables,) 1 at a stable equilibrium, 0 at another, -1 if no step became short.
    """
    blocks, count = lengths.shape[0], lengths.shape[1]
    nodes, verdict = np.empty((blocks * LANES, count + 1, 3)), np.full(blocks * LANES, -1)
    work, sums = np.zeros((count + 2, WIDTH)), np.empty(SUMS)
    for k in range(blocks):
        sums[FORCE:CHORD], sums[CHORD:INERTIA], sums[MOVES:] = force[k], chord[k], 1.0
        work[:, :CELL] = frames[k]
        work[:-1, CELL:LENGTH] = vertex[k]
        work[1:-1, LENGTH:WEIGHT], work[1:-1, WEIGHT:INVERSE] = lengths[k], weight[k]
        left = steps
        while left > 0:
            _step(work, sums)
            left = left - 1 if _judge(sums, verdict[k * LANES : (k + 1) * LANES], short) else 0
        frames[k], force[k] = work[:, :CELL], sums[FORCE:CHORD]
        place_nodes(origin[k], lengths[k], frames[k], nodes[k * LANES : (k + 1) * LANES])
    return nodes, verdict


@kernel
def _judge(sums, verdict, short):  # type: ignore[no-untyped-def]
    """Stop the cables whose step was short, or too long to go on; whether others are left."""
    left = False
    for lane in range(LANES):
        if sums[MOVES + lane] > 0.0 and not sums[LONGEST + lane] < 1.0:
            sums[MOVES + lane] = 0.0
        elif sums[MOVES + lane] > 0.0 and sums[LONGEST + lane] < short:
            sums[MOVES + lane], verdict[lane] = 0.0, 1 if sums[INERTIA + lane] == 3.0 else 0
        left = left or sums[MOVES + lane] > 0.0
    return left


@kernel
def _step(work, sums):  # type: ignore[no-untyped-def]
    """One Newton step of every cable that still moves."""
    last = len(work) - 1
    sums[SCHUR:MISS] = 0.0
    sums[MISS:FORCE] = -sums[CHORD:INERTIA]
    sums[INERTIA:MOVES] = 0.0
    _vertex(work[0], work[1], CLAMP)
    for i in range(1, last):
        _vertex(work[i], work[i + 1], INNER if i + 1 < last else CLAMP)
        _eliminate(work[i - 1], work[i], sums)
    for i in range(last - 1, 0, -1):
        _substitute(work[i], work[i + 1], sums)
    _close(sums)
    for i in range(1, last):
        _turn(work[i], sums)


@kernel
def _vertex(here, after, kind):  # type: ignore[no-untyped-def]
    """Gradient and Hessian of the vertex between two frames, see `vertices`."""
    for lane in range(LANES):
        cell, law, bent = here[CELL + lane], three(here, LAW, lane), three(here, BENT, lane)
        slopes, before, curve, couple = vertex_terms(four(here, FRAME, lane), four(after, FRAME, lane), cell, law, bent, kind)
        put(here, SLOPE_BEFORE, slopes[0], lane)
        put(here, SLOPE, slopes[1], lane)
        put(here, CURVE_BEFORE, before[0], lane)
        put(here, CURVE_BEFORE + 3 * LANES, before[1], lane)
        put(here, CURVE, curve[0], lane)
        put(here, CURVE + 3 * LANES, curve[1], lane)
        put(here, COUPLE, couple[0], lane)
        put(here, COUPLE + 3 * LANES, couple[1], lane)
        put(here, COUPLE + 6 * LANES, couple[2], lane)


@kernel
def _eliminate(before, here, sums):  # type: ignore[no-untyped-def]
    """Every segment, less what the one before it leaves there; its inverse and what it carries."""
    for lane in range(LANES):
        load = three(here, WEIGHT, lane)
        pull = load[0] + sums[FORCE + lane], load[1] + sums[FORCE + LANES + lane], load[2] + sums[FORCE + 2 * LANES + lane]
        couple = column(before, COUPLE, lane), column(before, COUPLE + LANES, lane), column(before, COUPLE + 2 * LANES, lane)
        carried = column(before, CARRY, lane), column(before, CARRY + LANES, lane), column(before, CARRY + 2 * LANES, lane)
        curve = three(before, CURVE, lane), three(before, CURVE + 3 * LANES, lane)
        last = couple, carried, curve, three(before, SLOPE, lane), _right_hand_sides(before, lane)
        own_curve = three(here, CURVE_BEFORE, lane), three(here, CURVE_BEFORE + 3 * LANES, lane)
        own_couple = three(here, COUPLE, lane), three(here, COUPLE + 3 * LANES, lane), three(here, COUPLE + 6 * LANES, lane)
        own = own_curve, three(here, SLOPE_BEFORE, lane), own_couple
        inverse, carry, right, border, along, negative = eliminated(four(here, FRAME, lane), here[LENGTH + lane], pull, last, own)
        put(here, INVERSE, inverse[0], lane)
        put(here, INVERSE + 3 * LANES, inverse[1], lane)
        put(here, CARRY, carry[0], lane)
        put(here, CARRY + 3 * LANES, carry[1], lane)
        put(here, CARRY + 6 * LANES, carry[2], lane)
        put(here, RIGHT, right[0], lane)
        put(here, RIGHT + 3 * LANES, right[1], lane)
        put(here, RIGHT + 6 * LANES, right[2], lane)
        put(here, RIGHT + 9 * LANES, right[3], lane)
        put(here, COLUMN, border[0], lane)
        put(here, COLUMN + 3 * LANES, border[1], lane)
        add(sums, MISS, along, lane)
        sums[INERTIA + lane] += negative


@kernel
def _substitute(here, after, sums):  # type: ignore[no-untyped-def]
    """Solution of every segment from that of the next, and its share of the Schur complement C^T H^-1 (C, gradient)."""
    for lane in range(LANES):
        inverse = three(here, INVERSE, lane), three(here, INVERSE + 3 * LANES, lane)
        carry = three(here, CARRY, lane), three(here, CARRY + 3 * LANES, lane), three(here, CARRY + 6 * LANES, lane)
        border = three(here, COLUMN, lane), three(here, COLUMN + 3 * LANES, lane)
        beyond = _right_hand_sides(after, lane)
        x, first, second, third = substituted(inverse, carry, _right_hand_sides(here, lane), border, beyond)
        put(here, RIGHT, x[0], lane)
        put(here, RIGHT + 3 * LANES, x[1], lane)
        put(here, RIGHT + 6 * LANES, x[2], lane)
        put(here, RIGHT + 9 * LANES, x[3], lane)
        add(sums, SCHUR, first, lane)
        add(sums, SCHUR + 3 * LANES, second, lane)
        add(sums, SCHUR + 6 * LANES, third, lane)


@kernel
def _close(sums):  # type: ignore[no-untyped-def]
    """Change of the force of the last clamp, which takes the place of the miss; its inertia joins that of the segments."""
    for lane in range(LANES):
        first, second, third = three(sums, SCHUR, lane), three(sums, SCHUR + 3 * LANES, lane), three(sums, SCHUR + 6 * LANES, lane)
        change, positive = closed(first, second, third, three(sums, MISS, lane))
        moves = sums[MOVES + lane]
        put(sums, MISS, change, lane)
        add(sums, FORCE, (moves * change[0], moves * change[1], moves * change[2]), lane)
        sums[INERTIA + lane] += positive


@kernel
def _turn(here, sums):  # type: ignore[no-untyped-def]
    """Turn a frame by its part of the step."""
    for lane in range(LANES):
        turn, moves = turn_of(_right_hand_sides(here, lane), three(sums, MISS, lane)), 0.5 * sums[MOVES + lane]
        sums[LONGEST + lane] = larger(larger(sums[LONGEST + lane], abs(turn[0])), larger(abs(turn[1]), abs(turn[2])))
        x, y, z, w = turned(four(here, FRAME, lane), (moves * turn[0], moves * turn[1], moves * turn[2]))
        put(here, FRAME, (x, y, z), lane)
        here[FRAME + 3 * LANES + lane] = w


@kernel
def _right_hand_sides(rows, lane):  # type: ignore[no-untyped-def]
    return (
        three(rows, RIGHT, lane),
        three(rows, RIGHT + 3 * LANES, lane),
        three(rows, RIGHT + 6 * LANES, lane),
        three(rows, RIGHT + 9 * LANES, lane),
    )
