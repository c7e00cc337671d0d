"""The small dense system over the border rows with friction: which contacts are open, stick or slide, compiled.

As in `closing`, held points and curvature are equations and are eliminated. Of the rest x, normal forces of contact rows and two forces f
along the surface for every contact that rubs, with A x - b the gaps and slips after the step, every contact is one of

    open     normal force 0, f = 0                     while the gap is positive
    sticks   gap 0, slip u + c f = 0                   while |f| <= F(0+, N)
    slides   gap 0, f + F(v, N) u / |u| = 0            while |u| > c F(0+, N)

The last is not linear. It is linearised, exactly, at the slip and normal force of the iterate before: F falls or rises with N, which
makes the system unsymmetric; across the sliding it gives way by |u| / F, along it with the slope of F. All offending
contacts change their state at once while their number falls, and the last of them alone where it does not.

Source: a semismooth Newton method after Alart and Curnier 1991, "A mixed formulation for frictional contact problems prone to Newton
like solution methods", Comput. Methods Appl. Mech. Eng. 92, 353-375, on the Schur complement; the law with compliance is the return
mapping of Giannakopoulos 1989.
"""

from __future__ import annotations

import numpy as np

from .border import SOFTNESS, laws_among
from .closing import PATIENCE
from .cones import interior, pressing, solved
from .drag import drag_limit, sticks_at_rest
from .held_by_friction import positive_and_held
from .jitted import kernel
from .symmetric import condense, part

ROUNDS_MAX = 40
LAW_DONE = 1e-9  # of the force, by which a sliding contact may miss its law
SLACK = 1e-9  # of the force at rest, within which a contact may as well stick


@kernel
def close_rubbing(rod, state, matrix, right, border, hard):  # type: ignore[no-untyped-def]
    """`close_with_friction` for the rows of one rod, as they are in its border."""
    rub_of, rub = laws_among(rod, border.contacts, border.rubs)
    push, drag = state.push[border.contacts], state.drag[border.rubs]
    return close_with_friction(matrix, right, len(border.held), push, drag, rub_of, rub, hard)


@kernel
def close_with_friction(matrix, right, held, push, drag, rub_of, rub, hard):  # type: ignore[no-untyped-def]
    """Change of the force of every row: held points, contacts, curvature, then two of every contact that rubs.

    Args:
        matrix: (count, count) S.
        right: (count,) r.
        held: How many rows of held points there are.
        push: (m,) [N] Forces now acting at the contacts.
        drag: (f, 2) [N] Friction now acting.
        rub_of: (m,) Which contact that rubs each contact belongs to, -1 for none.
        rub: Laws of the contacts that rub.
        hard: [m/N] Compliance of what sticks.

    Returns:
        change (count,) of the forces, is_closed (m,), sticks (f,), from `positive_and_held` what tells whether that is stable, and whether
        every contact keeps its law.
    """
    count, many, rubs = len(right), len(push), len(drag)
    rows, last = np.arange(count), count - 2 * rubs
    free = np.concatenate((rows[held : held + many], rows[last:]))
    fixed = np.concatenate((rows[:held], rows[held + many : last]))
    own, rest, solved, _ = condense(matrix, right, fixed, free)
    acting = np.concatenate((push, drag.reshape(-1)))
    force, sticks, is_solved = stick_slip(own, rest + own @ acting, rub_of, rub, hard, acting)
    closed = force[:many] > 0.0
    change = np.zeros(count)
    change[free] = force - acting
    change[fixed] = solved[:, len(free)] - np.ascontiguousarray(solved[:, : len(free)]) @ change[free]
    slip = (own @ force - (rest + own @ acting))[many:] - hard * force[many:]
    normal, growth = pressing(force, rub_of, rubs), np.zeros(rubs)
    for k in range(rubs):
        growth[k] = drag_limit(rub, k, _size(slip[2 * k], slip[2 * k + 1]) / rub.time_step, normal[k])[2] / rub.time_step
    positive, rubbing = positive_and_held(matrix, held, closed, sticks, force[many:], slip, growth, hard)
    return change, closed, sticks, positive, rubbing, is_solved


@kernel
def stick_slip(matrix, right, rub_of, rub, hard, start):  # type: ignore[no-untyped-def]
    """Forces (m + 2f,) that keep every contact's law, which contacts that rub stick (f,), and whether they do; if not, as near as it came.

    Where exchanges go round in circles, as they do with dozens of contacts beside each other, they begin again from what an interior point
    method finds (`cones`), if all friction is Coulomb's.

    Args:
        matrix: (m + 2f, m + 2f) Gaps and slips under unit forces.
        right: (m + 2f,) [m] What they are less of without any.
        rub_of: (m,) Which contact that rubs each contact row belongs to, -1 for none.
        rub: Laws of the contacts that rub.
        hard: [m/N] Compliance of what sticks.
        start: (m + 2f,) [N] Forces now.
    """
    force, sticks, is_done = _exchanged(matrix, right, rub_of, rub, hard, start)
    mu = rub.rows["coefficient"]
    if not is_done and (rub.rows["table"] < 0).all() and (rub.rows["speed"] == 0.0).all() and (mu > 0.0).all():
        begin, is_found = interior(matrix, right, rub_of, np.ascontiguousarray(mu), start, SOFTNESS / hard)
        if is_found:
            better, slips_not, is_done = _exchanged(matrix, right, rub_of, rub, hard, begin)
            if is_done:
                return better, slips_not, True
    return force, sticks, is_done


@kernel
def _exchanged(matrix, right, rub_of, rub, hard, start):  # type: ignore[no-untyped-def]
    """The same by exchanges alone, and whether they ended."""
    many, rubs = len(rub_of), len(rub.rows)
    force, closed, turned = start.copy(), start[:many] > 0.0, np.zeros(rubs, dtype=np.bool_)
    normal = pressing(force, rub_of, rubs)
    at, sticks = _guess(matrix @ start - right, force, rub, hard, normal, many)
    fewest, patience, tolerance = many + rubs + 1, PATIENCE, 1e-12 * np.abs(right).max()
    has_ended = False
    for _ in range(ROUNDS_MAX):
        force = _solved(matrix, right, rub_of, rub, at, hard, closed, sticks, normal)
        if not np.isfinite(force).all():
            break
        gap = matrix @ force - right
        normal = pressing(force, rub_of, rubs)
        wrong = np.zeros(many + rubs, dtype=np.bool_)
        wrong[:many] = (closed & (force[:many] < 0.0)) | (~closed & (gap[:many] < -tolerance))
        is_done = _judge(force, gap, rub_of, rub, at, hard, sticks, turned, _touching(closed, rub_of, rubs), normal, wrong)
        if wrong[many:].any():  # what sticks against a pull brings absurd normal forces, which are not to open contacts
            wrong[:many] = False
        offending = np.flatnonzero(wrong)
        has_ended = len(offending) == 0 and is_done
        if has_ended:
            break
        if len(offending) < fewest:
            fewest, patience = len(offending), PATIENCE
        elif patience > 0:
            patience -= 1
        else:
            offending = offending[-1:]
        for other in offending:
            if other < many:
                closed[other] = not closed[other]
            else:
                _exchange(other - many, force[many + 2 * (other - many) :], rub, at, hard, sticks, normal)
    for row in range(many):
        if not (closed[row] and force[row] > 0.0):
            force[row] = 0.0
    normal = pressing(force, rub_of, rubs)
    for k in range(rubs):
        if not normal[k] > 0.0:
            sticks[k], force[many + 2 * k], force[many + 2 * k + 1] = False, 0.0, 0.0
    return force, sticks, has_ended


@kernel
def _size(a, b):  # type: ignore[no-untyped-def]
    return np.sqrt(a * a + b * b)


@kernel
def _guess(gap, force, rub, hard, normal, many):  # type: ignore[no-untyped-def]
    """Slips (f, 2) at which the laws are linearised first, and what sticks at first (f,): from the forces now acting.

    A contact goes on as its force says. How far its point is from its anchor says little here, for held points have moved and the cable
    has not followed yet; only without a force the slip counts that the forces now acting would bring.
    """
    at, sticks = np.empty((len(normal), 2)), np.empty(len(normal), dtype=np.bool_)
    for k in range(len(normal)):
        row = many + 2 * k
        f0, f1 = force[row], force[row + 1]
        size, rest = _size(f0, f1), drag_limit(rub, k, 0.0, normal[k])[0]
        sticks[k] = sticks_at_rest(rub, k) and size <= (1.0 - SLACK) * rest
        at[k, 0], at[k, 1] = gap[row] - hard * f0, gap[row + 1] - hard * f1
        if rest > 0.0 and size > 0.0:
            at[k, 0], at[k, 1] = -hard * rest * f0 / size, -hard * rest * f1 / size
    return at, sticks


@kernel
def _touching(closed, rub_of, rubs):  # type: ignore[no-untyped-def]
    """Contacts that rub (f,) with a row that is closed."""
    out = np.zeros(rubs, dtype=np.bool_)
    for row in range(len(closed)):
        if closed[row] and rub_of[row] >= 0:
            out[rub_of[row]] = True
    return out


@kernel
def _judge(force, gap, rub_of, rub, at, hard, sticks, turned, touching, normal, wrong):  # type: ignore[no-untyped-def]
    """Mark in `wrong` the contacts that neither stick nor slide as they should, move `at` on; whether all that slide keep their law.

    What slides the other way than was thought does so from now on, and only if it turns once more it is to stick. What sticks and pulls
    by more than friction needs is left to open; let to slide, it would go on pulling.
    """
    many, is_done = len(rub_of), True
    for k in range(len(sticks)):
        if not touching[k]:
            continue
        row = many + 2 * k
        f0, f1 = force[row], force[row + 1]
        rest = drag_limit(rub, k, 0.0, normal[k])[0]
        if sticks[k]:
            pulls = _pull(force, rub_of, k)
            is_to_open = pulls > 0.0 and rest == 0.0 and _size(f0, f1) <= drag_limit(rub, k, 0.0, pulls)[0]
            wrong[many + k] = _size(f0, f1) > (1.0 + SLACK) * rest and not is_to_open
            continue
        u0, u1 = gap[row] - hard * f0, gap[row + 1] - hard * f1
        size = _size(u0, u1)
        is_reversed = u0 * at[k, 0] + u1 * at[k, 1] < 0.0
        if rest > 0.0 and ((is_reversed and turned[k]) or size < (1.0 - SLACK) * hard * rest):
            wrong[many + k] = True
            continue
        turned[k] |= is_reversed
        limit = drag_limit(rub, k, size / rub.time_step, normal[k])[0]
        share = limit / max(size, 1e-300)
        is_done &= _size(f0 + share * u0, f1 + share * u1) <= LAW_DONE * (limit + _size(f0, f1))
        # A law that rises steeply from zero is approached from there, where it is steepest: without going back and forth.
        at[k, 0], at[k, 1] = (0.0, 0.0) if is_reversed and rest == 0.0 else (u0, u1)
    return is_done


@kernel
def _pull(force, rub_of, k):  # type: ignore[no-untyped-def]
    """How strongly all rows of a contact that rubs pull [N]; not positive if they push."""
    total = 0.0
    for row in range(len(rub_of)):
        if rub_of[row] == k:
            total -= force[row]
    return total


@kernel
def _exchange(k, force, rub, at, hard, sticks, normal):  # type: ignore[no-untyped-def]
    """Let a contact slide that stuck, beginning where its spring would give way; or stick that slid."""
    sticks[k] = not sticks[k]
    if not sticks[k]:
        rest, size = drag_limit(rub, k, 0.0, normal[k])[0], max(_size(force[0], force[1]), 1e-300)
        at[k, 0], at[k, 1] = -hard * rest * force[0] / size, -hard * rest * force[1] / size


@kernel
def _solved(matrix, right, rub_of, rub, at, hard, closed, sticks, normal):  # type: ignore[no-untyped-def]
    """Forces (m + 2f,) of the linearised system with the states given."""
    many, total = len(rub_of), len(right)
    is_on = np.zeros(total, dtype=np.bool_)
    is_on[:many] = closed
    for row in range(many):
        if closed[row] and rub_of[row] >= 0:
            is_on[many + 2 * rub_of[row]], is_on[many + 2 * rub_of[row] + 1] = True, True
    on = np.flatnonzero(is_on)
    out = np.zeros(total)
    if len(on) == 0:
        return out
    own, rest = part(matrix, on, on), right[on]
    for place in range(len(on)):
        k = (on[place] - many) // 2
        if on[place] >= many and (on[place] - many) % 2 == 0 and not sticks[k]:
            _slide(own, rest, place, k, rub_of, on, rub, at, hard, normal)
    for i in range(len(on)):
        scale = 1.0 / max(np.abs(own[i]).max(), 1e-300)
        own[i] *= scale
        rest[i] *= scale
    if np.isfinite(own).all() and np.isfinite(rest).all():
        out[on] = solved(own, rest)
    else:
        out[on] = np.nan
    return out


@kernel
def _slide(own, rest, place, k, rub_of, on, rub, at, hard, normal):  # type: ignore[no-untyped-def]
    """Put the law of a contact that slides, linearised at the slip `at` and the normal force, in the place of the rows of its slip."""
    u0, u1 = at[k, 0], at[k, 1]
    size = _size(u0, u1)
    limit, with_normal, with_speed = drag_limit(rub, k, size / rub.time_step, normal[k])
    along = max(with_speed, 0.0) / rub.time_step  # a law that falls with the speed would be a spring that pushes on
    across = limit / size if size > 0.0 else along
    d0, d1 = (u0 / size, u1 / size) if size > 0.0 else (0.0, 0.0)
    g00, g01, g11 = across + (along - across) * d0 * d0, (along - across) * d0 * d1, across + (along - across) * d1 * d1
    first, second = own[place].copy(), own[place + 1].copy()
    first[place] -= hard
    second[place + 1] -= hard
    b0, b1 = rest[place] + u0, rest[place + 1] + u1
    own[place], own[place + 1] = g00 * first + g01 * second, g01 * first + g11 * second
    own[place, place] += 1.0
    own[place + 1, place + 1] += 1.0
    for j in range(len(on)):
        if on[j] < len(rub_of) and rub_of[on[j]] == k:
            own[place, j] += with_normal * d0
            own[place + 1, j] += with_normal * d1
    given = with_normal * normal[k] - limit
    rest[place], rest[place + 1] = given * d0 + g00 * b0 + g01 * b1, given * d1 + g01 * b0 + g11 * b1
