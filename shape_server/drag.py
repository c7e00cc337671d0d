"""Force of friction against the sliding of a contact, F(v, N) with v the sliding speed and N the normal force, compiled.

All laws are one: the force is against the slip u, how far the material point of the cable went from its anchor on the body in the time
dt, with v = |u| / dt. Up to the force at rest F(0+, N) it sticks, which a compliance c (`border.SOFTNESS` per typical force) makes
unique where a stiff cable spreads one pull over many points that stick:

    f = -u / c        while |u| <= c F(0+, N),          f = -F(v, N) u / |u|        beyond.

| law | F(v, N) | force at rest |
| --- | --- | --- |
| regularized (F_R) | mu N v / sqrt(v^2 + v0^2) | none |
| signum (F_sigma) | mu N | mu N |
| defined (F_d) | from a table | that of the table at v = 0 |

What each kind of friction gives to these numbers stands in `contacts`. The force acts at the axis of the cable: what it does to roll the
cable about itself is left out, as in the bond.
"""

from __future__ import annotations

import numpy as np

from .jitted import kernel


@kernel
def drag_limit(rub, k, speed, normal):  # type: ignore[no-untyped-def]
    """Force F(v, N) [N] of contact k at a speed [m/s] and a normal force [N], and its slopes with N and with v [N s/m]."""
    table = rub.rows["table"][k]
    if table >= 0:
        return _from_table(rub.tables[table], speed, normal)
    mu, v0 = rub.rows["coefficient"][k], rub.rows["speed"][k]
    if v0 == 0.0:
        return mu * normal, mu, 0.0
    size = np.sqrt(speed * speed + v0 * v0)
    return mu * normal * speed / size, mu * speed / size, mu * normal * v0 * v0 / (size * size * size)


@kernel
def sticks_at_rest(rub, k):  # type: ignore[no-untyped-def]
    """Whether contact k bears a force without sliding."""
    return drag_limit(rub, k, 0.0, 1.0)[0] > 0.0


@kernel
def _from_table(table, speed, normal):  # type: ignore[no-untyped-def]
    """The same, linear between the points of a table (see `rod.Rub`); a normal force of zero has no friction."""
    all_speeds, all_normals, forces = table[1:, 0], table[0, 1:], table[1:, 1:]
    speeds, normals = np.isfinite(all_speeds).sum(), np.isfinite(all_normals).sum()
    i = 0
    while i + 2 < speeds and all_speeds[i + 1] <= speed:
        i += 1
    j = 0
    while j + 1 < normals and all_normals[j] < normal:
        j += 1
    low = 0.0 if j == 0 else all_normals[j - 1]
    width = all_normals[j] - low
    share = (normal - low) / width
    lower, upper = np.zeros(2), np.zeros(2)
    for end in range(2):
        at = min(i + end, speeds - 1)
        lower[end], upper[end] = 0.0 if j == 0 else forces[at, j - 1], forces[at, j]
    along, slope = 0.0, 0.0
    if speeds > 1:
        span = all_speeds[i + 1] - all_speeds[i]
        along = min((speed - all_speeds[i]) / span, 1.0)
        slope = 1.0 / span if along < 1.0 else 0.0
    first, last = lower[0] + share * (upper[0] - lower[0]), lower[1] + share * (upper[1] - lower[1])
    rise = (upper[0] - lower[0] + along * (upper[1] - lower[1] - upper[0] + lower[0])) / width
    return first + along * (last - first), rise, slope * (last - first)


@kernel
def normal_forces(rod, push):  # type: ignore[no-untyped-def]
    """Normal force (f,) [N] of every contact that rubs, from the forces (m,) of all rows; an edge has rows on several segments."""
    out, rub_of = np.zeros(len(rod.rub.rows)), rod.touch["rub"]
    for row in range(len(push)):
        if rub_of[row] >= 0:
            out[rub_of[row]] += push[row]
    return out


@kernel
def soft_drag(rod, view, push, multiplier, stiffness):  # type: ignore[no-untyped-def]
    """Forces (f, 2) [N], compliances (f,) [m/N] and whether each sticks, for a descent whose sticking points are springs.

    The law at the present speed and normal force, as a spring of secant stiffness from an offset: a majorant of the work of friction.

    Args:
        rod: The system.
        view: Of the state.
        push: (m,) [N] Normal forces of the rows.
        multiplier: (f, 2) [N] Of the augmented Lagrangian, for those that stick.
        stiffness: [N/m] Of their springs.
    """
    rub, normal = rod.rub, normal_forces(rod, push)
    drag, ease, sticks = np.zeros_like(multiplier), np.zeros(len(normal)), np.zeros(len(normal), dtype=np.bool_)
    for k in range(len(normal)):
        if not normal[k] > 0.0:
            continue
        u0, u1 = view.slip[k, 0], view.slip[k, 1]
        size = np.sqrt(u0 * u0 + u1 * u1)
        limit, _, slope = drag_limit(rub, k, size / rub.time_step, normal[k])
        if sticks_at_rest(rub, k):
            f0, f1 = multiplier[k, 0] - stiffness * u0, multiplier[k, 1] - stiffness * u1
            trial = np.sqrt(f0 * f0 + f1 * f1)
            sticks[k] = trial <= limit
            share = 1.0 if sticks[k] else limit / trial
            drag[k, 0], drag[k, 1], ease[k] = share * f0, share * f1, 1.0 / (stiffness * share) if share > 0.0 else 0.0
        else:
            secant = limit / size if size > 0.0 else slope / rub.time_step
            drag[k, 0], drag[k, 1], ease[k] = -secant * u0, -secant * u1, 1.0 / secant if secant > 0.0 else 0.0
    return drag, ease, sticks


@kernel
def soft_work(state, view, slip):  # type: ignore[no-untyped-def]
    """Work [J] of those springs at another slip (f, 2), beyond what it was at the state."""
    total = 0.0
    for k in range(len(state.ease)):
        if state.ease[k] > 0.0:
            for a in range(2):
                change = slip[k, a] - view.slip[k, a]
                total += change * (0.5 * change / state.ease[k] - state.drag[k, a])
    return total


@kernel
def lawless(rod, state, view, hard):  # type: ignore[no-untyped-def]
    """How far the contacts are from their laws: largest stray of one that sticks [m], largest wrong force of one that slides [N]."""
    rub, normal = rod.rub, normal_forces(rod, state.push)
    stray, wrong = 0.0, 0.0
    for k in range(len(normal)):
        if not normal[k] > 0.0:
            continue
        u0, u1 = view.slip[k, 0], view.slip[k, 1]
        if state.sticks[k]:
            stray = max(stray, abs(u0 + hard * state.drag[k, 0]), abs(u1 + hard * state.drag[k, 1]))
            continue
        size = np.sqrt(u0 * u0 + u1 * u1)
        limit = drag_limit(rub, k, size / rub.time_step, normal[k])[0]
        off0, off1 = state.drag[k, 0] + limit * u0 / max(size, 1e-300), state.drag[k, 1] + limit * u1 / max(size, 1e-300)
        wrong = max(wrong, np.sqrt(off0 * off0 + off1 * off1))
    return stray, wrong
