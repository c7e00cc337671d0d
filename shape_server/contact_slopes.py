"""How contacts that push change with small motions of the cable beside them: slopes of gap, force, place and couple.

A contact depends on where the first node of its segment is, on the directors of that segment and of both neighbours, whose turns
make the bulge of `contact_geometry`, and on the length of the segment. A Newton step leaves the change of the bulge to the next
step; a derivative needs all of it. The slopes are central differences of that compiled geometry itself: with steps of 4e-5 of the
distance d between axis and feature, the curvature 1/d of the distance leaves an error of about 1e-9 of the slopes, as rounding does.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from .contact_geometry import contact_geometry
from .rod import Rod, State, View

Array = np.ndarray
STEP: Final = 4e-5  # of the distance between axis and feature
GAP, DIRECTION, PLACE, COUPLE = 0, slice(1, 4), 4, slice(5, 8)  # what is in the numbers of a contact
NUMBERS: Final = 8
NODE, TURNS, LENGTH = slice(0, 3), slice(3, 12), 12  # what they change with: turns of the segment before, of its own, of the one after


class ContactSlopes(NamedTuple):
    """Of every contact that pushes: gap [m], force over its size (3), place along the segment, couple about d1, d2, d3 over it [m]."""

    rows: Array  # (c,) int, which rows of `Touch` they are
    numbers: Array  # (c, 8)
    slopes: Array  # (c, 8, 13) per m of the first node, per rad of three segments about their own axes, per m of length


def contact_slopes(rod: Rod, state: State, view: View) -> ContactSlopes:
    """Numbers of all contacts that push, and their slopes."""
    rows = np.flatnonzero(state.push > 0.0)
    slopes = np.zeros((len(rows), NUMBERS, 13))
    if not len(rows):
        return ContactSlopes(rows, np.zeros((0, NUMBERS)), slopes)
    element = rod.touch["element"][rows]

    def numbers(nodes: Array, axes: Array, lengths: Array) -> Array:
        return _numbers(rod, state, rows, nodes, axes, lengths)

    step = STEP * max(float(rod.touch["distance"][rows].min()), 1e-6 * rod.length)
    turn = step / float(view.lengths[element].min())
    for k in range(3):
        shift = step * np.eye(3)[k]
        far, near = (numbers(view.nodes + sign * shift, view.axes, view.lengths) for sign in (1.0, -1.0))
        slopes[:, :, k] = (far - near) / (2.0 * step)
        # Three segments in a row are all that a contact sees: every third one is turned at a time.
        for color in range(3):
            far, near = (numbers(view.nodes, _turned(view.axes, color, k, sign * turn), view.lengths) for sign in (1.0, -1.0))
            for place in range(3):
                own = (element + place - 1) % 3 == color
                slopes[own, :, 3 + 3 * place + k] = (far - near)[own] / (2.0 * turn)
    far, near = (numbers(view.nodes, view.axes, view.lengths + sign * step) for sign in (1.0, -1.0))
    slopes[:, :, LENGTH] = (far - near) / (2.0 * step)
    return ContactSlopes(rows, numbers(view.nodes, view.axes, view.lengths), slopes)


def _numbers(rod: Rod, state: State, rows: Array, nodes: Array, axes: Array, lengths: Array) -> Array:
    touch, fraction = rod.touch[rows], state.fraction[rows]
    gap, normal, push, _, _, numbers = contact_geometry(
        nodes,
        axes,
        lengths,
        touch,
        fraction,
    )
    arm, across = numbers[:, 2], np.einsum("ckx,cx->ck", axes[touch["element"]], normal)
    return np.column_stack([gap, push, fraction, -arm * across[:, 1], arm * across[:, 0], np.zeros(len(rows))])


def _turned(axes: Array, color: int, about: int, angle: float) -> Array:
    """Directors (n-1, 3, 3) with every third segment turned about one of its own axes."""
    out, (first, second) = axes.copy(), ((about + 1) % 3, (about + 2) % 3)
    out[color::3, first] = np.cos(angle) * axes[color::3, first] + np.sin(angle) * axes[color::3, second]
    out[color::3, second] = np.cos(angle) * axes[color::3, second] - np.sin(angle) * axes[color::3, first]
    return out
