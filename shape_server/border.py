"""The border of the system: rows of held points, contacts and curved features, on the way to `closing`, compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .chain_terms import three
from .inclined import inclined_rows
from .jitted import inlined, kernel
from .rod import Rub, is_active
from .strand_rows import Spread, no_spread, strand_rows

SOFTNESS = 1e-7  # m by which a contact or bond gives way under the typical force


class Border(NamedTuple):
    """Rows in the order: held points, contacts, curvature, friction (two each)."""

    element: np.ndarray  # (count,) int
    fraction: np.ndarray  # (count,)
    vector: np.ndarray  # (count, 3)
    is_turn: np.ndarray  # (count,) bool
    compliance: np.ndarray  # (count, count) m/N
    residual: np.ndarray  # (count,) m
    held: np.ndarray  # (h,) int, which rows of held points are here
    contacts: np.ndarray  # (c,) int, which contacts have a row
    rubs: np.ndarray  # (r,) int, which contacts with friction have two rows
    saddles: int  # negative directions that the curvature rows bring with them
    spread: Spread  # rows of self-contacts and of their curvature, whose `vector` is zero
    inclined: Spread  # rows of inclination, whose `vector` is zero


@kernel
def border_rows(rod, state, view, soft, near):  # type: ignore[no-untyped-def]
    """All rows at a state.

    Contacts are those that may push: with exact rows, for which `soft` is (0, 0), all that push or have a gap of `near` [m] at most, with
    the friction of these. Otherwise they are those that touch, and `soft` [m/N] are the compliances of held points and contacts, whose
    forces already balance (augmented Lagrangian).
    """
    is_exact = soft[0] == 0.0
    points, touched, pushes = rod.held.rows, rod.touch["element"], view.push
    bond, places, axes, of_row = points["bond"], points["fraction"], points["axis"], points["element"]
    held = _active(bond, state.holds)
    contacts = np.flatnonzero(~is_far(state.push, state.touches, view.gap, near)) if is_exact else np.flatnonzero(state.touches)
    bent, rows, saddles = _bent(state.push, view.slide, view.across, view.numbers, 1e-9 * rod.force_scale)
    rubs = _rubbing(rod.touch["rub"], state.drag, contacts) if is_exact else np.flatnonzero(state.ease > 0.0)
    first, last = len(held), len(held) + len(contacts)
    spread, stiffness = no_spread()
    inclined = spread
    if len(rod.strands.distance) > 0:
        spread, stiffness = strand_rows(rod, state, view, contacts, first, last + rows)
    if rod.held.inclined > 0:
        inclined = inclined_rows(rod.held, held, len(rod.lengths))
    count = last + rows + len(stiffness) + 2 * len(rubs)
    element, fraction, vector = np.empty(count, dtype=np.int64), np.empty(count), np.empty((count, 3))
    is_turn, compliance, residual = np.zeros(count, dtype=np.bool_), np.zeros((count, count)), np.zeros(count)
    hard = SOFTNESS / rod.force_scale
    for k in range(first):
        row = held[k]
        element[k], fraction[k] = of_row[row], places[row]
        vector[k, 0], vector[k, 1], vector[k, 2] = three(axes, row) if row < len(points) - rod.held.inclined else (0.0, 0.0, 0.0)
        if not is_exact:
            compliance[k, k] = soft[0]
            continue
        residual[k] = view.miss[row]
        if bond[row] >= 0:
            compliance[k, k] = hard
            residual[k] += hard * state.force[row]
    for k in range(first, last):
        row = contacts[k - first]
        element[k], fraction[k] = touched[row], state.fraction[row]
        vector[k, 0], vector[k, 1], vector[k, 2] = three(pushes, row)
        compliance[k, k] = hard if is_exact else soft[1]
        residual[k] = view.gap[row] + hard * state.push[row] if is_exact else 0.0
    at = last
    for row in bent:
        begin = at
        at = _add_curvature(state, view, row, at, vector, is_turn, compliance)
        for k in range(begin, at):
            element[k], fraction[k] = touched[row], state.fraction[row]
    for k in range(len(stiffness)):
        element[at], fraction[at], vector[at], compliance[at, at] = 0, 0.0, 0.0, 1.0 / stiffness[k]
        at += 1
    if len(rubs) > 0:
        _add_rubs(rod, state, view, rubs, hard if is_exact else 0.0, at, element, fraction, vector, compliance, residual)
    saddles += (stiffness > 0.0).sum()
    return Border(element, fraction, vector, is_turn, compliance, residual, held, contacts, rubs, saddles, spread, inclined)


@kernel
def _active(bond, holds):  # type: ignore[no-untyped-def]
    """Which rows of held points hold (h,)."""
    out, count = np.empty(len(bond), dtype=np.int64), 0
    for row in range(len(bond)):
        if is_active(bond, holds, row):
            out[count] = row
            count += 1
    return out[:count]


@kernel
def is_far(push, touches, gap, near):  # type: ignore[no-untyped-def]
    """Which contacts (m,) are open by more than `near` [m]."""
    far = np.empty(len(push), dtype=np.bool_)
    for row in range(len(far)):
        far[row] = push[row] == 0.0 and not touches[row] and gap[row] > near
    return far


@kernel
def _rubbing(rub, drag, contacts):  # type: ignore[no-untyped-def]
    """Which contacts with friction have one of these rows (m,), or a force along the surface."""
    is_on = np.zeros(len(drag), dtype=np.bool_)
    for k in range(len(is_on)):
        is_on[k] = drag[k, 0] != 0.0 or drag[k, 1] != 0.0
    for row in contacts:
        if rub[row] >= 0:
            is_on[rub[row]] = True
    return np.flatnonzero(is_on)


@kernel
def laws_among(rod, contacts, rubs):  # type: ignore[no-untyped-def]
    """Which of some contacts that rub each of some rows belongs to (m,), -1 for none, and the laws of those (f,)."""
    place = np.full(len(rod.rub.rows), -1)
    place[rubs] = np.arange(len(rubs))
    rub_of = np.full(len(contacts), -1)
    for k in range(len(contacts)):
        rub = rod.touch["rub"][contacts[k]]
        rub_of[k] = -1 if rub < 0 else place[rub]
    return rub_of, Rub(rod.rub.rows[rubs], rod.rub.tables, rod.rub.time_step)


@inlined
def _add_rubs(rod, state, view, rubs, hard, at, element, fraction, vector, compliance, residual):  # type: ignore[no-untyped-def]
    """Two rows along the surface for every contact that rubs; exact ones with `hard` [m/N], others with their own ease."""
    own = rod.rub.rows
    for row in rubs:
        for axis in range(2):
            element[at], fraction[at], vector[at] = own["element"][row], own["fraction"][row], own["axes"][row, axis]
            compliance[at, at] = hard if hard > 0.0 else state.ease[row]
            residual[at] = view.slip[row, axis] + hard * state.drag[row, axis] if hard > 0.0 else 0.0
            at += 1


@kernel
def _bent(push, slide, across, numbers, least):  # type: ignore[no-untyped-def]
    """Contacts whose feature is curved and pushes, the rows they need, and the negative directions those bring."""
    chosen, count, rows, saddles = np.empty(len(push), dtype=np.int64), 0, 0, 0
    for c in range(len(push)):
        if push[c] > least and _is_any(slide, c):
            chosen[count] = c
            count += 1
            slides = numbers[c, 0] != 0.0
            rows += (2 if slides else 1) + (1 if _is_any(across, c) else 0)
            saddles += 1 if slides else 0
    return chosen[:count], rows, saddles


@kernel
def _is_any(vectors, row):  # type: ignore[no-untyped-def]
    """Whether a row of vectors (m, 3) is not zero."""
    return vectors[row, 0] != 0.0 or vectors[row, 1] != 0.0 or vectors[row, 2] != 0.0


@inlined
def _add_curvature(state, view, c, at, vector, is_turn, compliance):  # type: ignore[no-untyped-def]
    """Rows that carry the curvature of an edge or a vertex, see `contact_geometry`; returns the next free row.

    Their compliance is the inverse of minus the force times the second derivative of the gap. A sliding contact has a block over
    the rows (a, b_) = (m . dc, n . dt), which brings one negative direction: without a bulge it is [[-d, mu], [mu, 0]] / force.
    Any other row has -d / force.
    """
    mu, distance, curve, push = view.numbers[c, 0], view.numbers[c, 1], view.numbers[c, 3], state.push[c]
    vector[at, 0], vector[at, 1], vector[at, 2] = three(view.slide, c)
    if mu != 0.0:
        own, cross = curve / mu**2, 1.0 / mu + curve * distance / mu**3
        turn = distance / mu**2 + curve * distance**2 / mu**4
        scale = 1.0 / (push * (own * turn - cross**2))
        vector[at + 1, 0], vector[at + 1, 1], vector[at + 1, 2] = three(view.normal, c)
        is_turn[at + 1] = True
        compliance[at, at], compliance[at + 1, at + 1] = scale * turn, scale * own
        compliance[at, at + 1] = compliance[at + 1, at] = -scale * cross
        at += 2
    else:
        compliance[at, at] = -distance / push
        at += 1
    if _is_any(view.across, c):
        vector[at, 0], vector[at, 1], vector[at, 2] = three(view.across, c)
        compliance[at, at] = -distance / push
        at += 1
    return at
