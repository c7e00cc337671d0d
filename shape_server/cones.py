"""Contacts with Coulomb's friction by an interior point method: which push, stick and slide, where exchanges of these go round in circles.

With A x - b the gaps and slips, x the normal forces N and the forces f along the surface, every contact obeys

    s = gap,   N s = tau,        slip + g f = 0,   g z = tau,   z = (mu N)^2 - |f|^2,

with N, s, g, z > 0; for tau -> 0 this is the law: open or closed, and sticking (g = 0) or sliding with |f| = mu N (z = 0). Each step is
one of Newton's method, cut so that all stay positive, with a smaller tau. The normal force in the cone makes the system unsymmetric, and
nothing is proved for it; a matrix of one negative direction, as that of a cable which only its contacts hold up, did not hinder it either.
The answer is a start for `stick_slip`, which finishes it exactly: mostly within five of its rounds.

Source: Nocedal and Wright 2006, "Numerical Optimization", ch. 19, for such steps; the cones as in Acary, Cadoux, Lemarechal and Malick
2011, "A formulation of the linear discrete Coulomb friction problem via convex optimization", ZAMM 91, 155-175.
"""

from __future__ import annotations

import numpy as np

from .jitted import kernel

STEPS_MAX = 80
DONE = 1e-9  # of the typical force and the largest slip, what is left of every product
INSIDE = 0.1  # of the typical force and the largest slip, where the forces and gaps begin
KEPT = 0.05  # of the distance from a bound, what is left of it after a step
SHRINKS = 0.8  # of a step that leaves a cone
CUTS_MAX = 80
SPREAD = 1e-12  # of the largest entry of a row, by which contacts that say the same give way, so that they share the force


@kernel
def interior(matrix, right, rub_of, mu, start, scale):  # type: ignore[no-untyped-def]
    """Forces (m + 2f,) near those that keep every contact's law, zero where it is open and of mu N where it slides; and whether found.

    Args:
        matrix: (m + 2f, m + 2f) [m/N] Gaps and slips under unit forces.
        right: (m + 2f,) [m] What they are less of without any.
        rub_of: (m,) Which contact that rubs each row belongs to, -1 for none.
        mu: (f,) Coefficients of friction.
        start: (m + 2f,) [N] Forces now.
        scale: [N] Typical force.
    """
    many, rubs, force = len(rub_of), len(mu), start.copy()
    apart = matrix @ start - right
    size = max(np.abs(apart).max(), 1e-300)
    force[:many] = np.maximum(force[:many], INSIDE * scale)
    normal = pressing(force, rub_of, rubs)
    room = np.empty(rubs)
    for k in range(rubs):
        row = many + 2 * k
        share = min(1.0, 0.7 * mu[k] * normal[k] / max(np.hypot(force[row], force[row + 1]), 1e-300))
        force[row], force[row + 1] = share * force[row], share * force[row + 1]
        room[k] = (mu[k] * normal[k]) ** 2 - force[row] ** 2 - force[row + 1] ** 2
    gap, give = np.maximum((matrix @ force - right)[:many], INSIDE * size), np.full(rubs, size / scale)
    tau, is_found = 0.3 * scale * size, False
    for _ in range(STEPS_MAX):
        if max((force[:many] * gap).max(), (give * room).max()) < DONE * scale * size:
            is_found = True
            break
        step = _step(matrix, right, rub_of, mu, force, gap, give, room, tau)
        if not np.isfinite(step).all():
            break
        opens = matrix[:many] @ step - (gap - (matrix[:many] @ force - right[:many]))
        looser = (tau - give * (room + _widens(rub_of, mu, force, step))) / room
        share = min(_within(force[:many], step[:many]), _within(gap, opens), _within(give, looser))
        eased = _rooms(rub_of, mu, force + share * step)
        for _ in range(CUTS_MAX):
            if (eased > KEPT * room).all():
                break
            share *= SHRINKS
            eased = _rooms(rub_of, mu, force + share * step)
        force, gap, give, room = force + share * step, gap + share * opens, give + share * looser, eased
        mean = ((force[:many] * gap).sum() + (give * room).sum()) / (many + rubs)
        tau = mean * (0.1 if share > 0.7 else 0.4 if share > 0.2 else 0.9)
    return _decided(rub_of, mu, force, gap, give, room, scale, size), is_found


@kernel
def _step(matrix, right, rub_of, mu, force, gap, give, room, tau):  # type: ignore[no-untyped-def]
    """Change (m + 2f,) [N] of the forces in a step of Newton's method, gaps, gives and rooms eliminated."""
    many, rubs, total = len(rub_of), len(mu), len(force)
    slip, normal = matrix @ force - right, pressing(force, rub_of, rubs)
    whole, rest = matrix.copy(), np.empty(total)
    for i in range(many):
        for j in range(total):
            whole[i, j] *= force[i]
        whole[i, i] += gap[i]
        rest[i] = tau - force[i] * slip[i]
    for k in range(rubs):
        row, pull = many + 2 * k, 2.0 * give[k] / room[k]
        for a in range(2):
            for b in range(2):
                whole[row + a, row + b] += pull * force[row + a] * force[row + b]
            whole[row + a, row + a] += give[k]
            rest[row + a] = -slip[row + a] - tau / room[k] * force[row + a]
    for i in range(many):
        k = rub_of[i]
        if k >= 0:
            for a in range(2):
                whole[many + 2 * k + a, i] -= 2.0 * give[k] / room[k] * mu[k] ** 2 * normal[k] * force[many + 2 * k + a]
    for i in range(total):
        scale = 1.0 / max(np.abs(whole[i]).max(), 1e-300)
        whole[i] *= scale
        rest[i] *= scale
    if not (np.isfinite(whole).all() and np.isfinite(rest).all()):
        return np.full(total, np.nan)
    return solved(whole, rest)


@kernel
def solved(whole, rest):  # type: ignore[no-untyped-def]
    """The solution of rows; where some say the same, as three contacts on one straight segment, one with forces that are shared."""
    try:
        return np.linalg.solve(whole, rest)
    except Exception:  # the only kind that numba catches; here it is that the matrix has no inverse
        return np.linalg.solve(whole + SPREAD * np.eye(len(rest)), rest)


@kernel
def pressing(force, rub_of, rubs):  # type: ignore[no-untyped-def]
    """Normal force (f,) [N] of every contact that rubs; rows that pull do not count."""
    out = np.zeros(rubs)
    for row in range(len(rub_of)):
        if rub_of[row] >= 0:
            out[rub_of[row]] += max(force[row], 0.0)
    return out


@kernel
def _rooms(rub_of, mu, force):  # type: ignore[no-untyped-def]
    """The z (f,) [N^2] of the module's docstring."""
    many, normal = len(rub_of), pressing(force, rub_of, len(mu))
    out = np.empty(len(mu))
    for k in range(len(mu)):
        f0, f1 = force[many + 2 * k], force[many + 2 * k + 1]
        out[k] = mu[k] ** 2 * normal[k] ** 2 - f0 * f0 - f1 * f1
    return out


@kernel
def _widens(rub_of, mu, force, step):  # type: ignore[no-untyped-def]
    """Change (f,) [N^2] of z with a small step of the forces."""
    many, rubs = len(rub_of), len(mu)
    normal, more, out = pressing(force, rub_of, rubs), np.zeros(rubs), np.empty(rubs)
    for row in range(many):
        if rub_of[row] >= 0:
            more[rub_of[row]] += step[row]
    for k in range(rubs):
        row = many + 2 * k
        out[k] = 2.0 * (mu[k] ** 2 * normal[k] * more[k] - force[row] * step[row] - force[row + 1] * step[row + 1])
    return out


@kernel
def _within(values, changes):  # type: ignore[no-untyped-def]
    """Share of the changes, one at most, that leaves every value positive."""
    share = 1.0
    for k in range(len(values)):
        if changes[k] < 0.0:
            share = min(share, (1.0 - KEPT) * values[k] / -changes[k])
    return share


@kernel
def _decided(rub_of, mu, force, gap, give, room, scale, size):  # type: ignore[no-untyped-def]
    """The forces, zero where the gap is the larger, on the cone where what gives is."""
    many, rubs, out = len(rub_of), len(mu), force.copy()
    for i in range(many):
        if force[i] * size < gap[i] * scale:
            out[i] = 0.0
    before, normal = pressing(force, rub_of, rubs), pressing(out, rub_of, rubs)
    for k in range(rubs):
        row = many + 2 * k
        length = np.hypot(force[row], force[row + 1])
        slides = room[k] / (mu[k] * before[k]) ** 2 < give[k] * scale / size
        share = mu[k] * normal[k] / max(length, 1e-300) if slides else 1.0 if normal[k] > 0.0 else 0.0
        out[row], out[row + 1] = share * force[row], share * force[row + 1]
    return out
