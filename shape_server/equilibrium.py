"""From a start to a stable equilibrium: Newton with an active set, and an augmented Lagrangian where that is not enough.

`settled_from` is the warm path. It repeats Newton steps with exact rows, in each of which the contacts that push are found from the
linearised system (see `closing`); a bond that pulls is dropped. Where friction's laws have no answer in a step, it is tried with a shift of
the Hessian, which makes it shorter. It gives up when a step is not finite, does not become short, or the equilibrium is not stable.

`descend` is the robust path. Rows become penalties with multipliers (augmented Lagrangian; Nocedal and Wright 2006,
"Numerical Optimization", ch. 17), the Hessian is shifted until its inertia is that of a minimum, and each step is
shortened until the merit function falls (Armijo). It ends near a minimum of the energy, never at a saddle.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .border import SOFTNESS
from .chain import retract
from .drag import lawless
from .jitted import inlined, kernel
from .merit import search, soft_forces
from .newton import newton_step
from .rod import State, View, is_active, look, net_moment

TURN_DONE = 2e-4  # rad; a Newton step this long leaves an error of about its square
TURN_EXACT = 1e-9  # rad
TURN_MAX = 0.6  # rad, of any segment in one step
SHORTENS = 0.3  # from one Newton step to the next, when it converges
WARM_STEPS = 15
RUBBING_STEPS = 40
RELAX_STEPS = 400
NEAR = 0.05  # rad; a Newton step this long leaves an error of a few thousandths
NEAR_STEPS = 6
IDLE_AFTER = 6  # steps
IDLE_MOVE = 1e-5  # of the length, of any node in one step
IDLE_MISS = 1e-7  # of the length
NEUTRAL = 1e-4  # of EI over length squared; a stiffness below this is neutral, not unstable
GIVE_MAX = 1e-6  # of the length, that a contact may give way
MISS_DONE = 1e-8  # of the length, for held points
FORCE_DONE = 1e-4  # of the typical force and of the largest; what presses a column decides whether it is stable
COUPLE_DONE = 3e-10  # of weight times length, left by held points that miss and in a cable that nothing keeps from swinging
CONTACT_EASE = 0.1  # how much a miss of a contact counts; two rows at one bend share their force slowly
SHIFT_LEAST, SHIFT_MOST = 1e-3, 1e9  # of the typical force
SHIFT_RUBBING, SHIFTS = 10.0, 10.0  # of the typical force, most while settling; times, from one to the next
EXACT = (0.0, 0.0)  # no softness

# Why an iteration stopped.
DONE, GOING_ON, CLOSE, UNSTABLE, NOT_FINITE, NOT_SHORT, NO_MINIMUM, NO_DESCENT = range(8)
WHY = {
    DONE: "",
    GOING_ON: "it is still going on",
    CLOSE: "it is close to an equilibrium",
    UNSTABLE: "the equilibrium is not stable",
    NOT_FINITE: "a step of the iteration was not finite",
    NOT_SHORT: f"no convergence within {WARM_STEPS} steps, or {RUBBING_STEPS} with friction",
    NO_MINIMUM: f"no minimum found within {RELAX_STEPS} steps",
    NO_DESCENT: "no step lowers the energy",
}


class Settled(NamedTuple):
    """Where an iteration ended."""

    state: State
    seen: View
    is_converged: bool
    is_stable: bool
    iterations: int
    unbalanced: float  # N
    why: int  # index into `WHY`
    longest: float = np.inf  # rad, of the last step of Newton's method
    shift: float = 0.0  # N, of the Hessian, for the next step of Newton's method


class Descent(NamedTuple):
    """How far an augmented Lagrangian has come, so that it can go on from there."""

    settled: Settled
    force: np.ndarray  # (h,) N, multipliers of held points
    push: np.ndarray  # (m,) N, multipliers of contacts
    drag: np.ndarray  # (f, 2) N, multipliers of friction
    stiffness: float  # N/m, penalty of held points
    shift: float  # N, of the Hessian
    helped: int  # steps in a row that needed a shift and were short
    worst: float  # m, largest miss when the multipliers were last renewed


@inlined
def settled_from(rod, state, near):  # type: ignore[no-untyped-def]
    """Newton's method with exact rows from a state nearby.

    With `near` [rad] until a step is as short as that, for comparing meshes, where no more is needed; to the end if it is zero.
    """
    state, view = look(rod, state, np.ascontiguousarray(rod.touch["normal"]))
    return settle_on(rod, Settled(state, view, False, False, 0, np.inf, GOING_ON, np.inf, 0.0), near, RUBBING_STEPS)


@inlined
def settle_on(rod, found, near, steps):  # type: ignore[no-untyped-def]
    """Go on settling by so many steps at most; while `why` is `GOING_ON` there is more to do."""
    only_near = near > 0.0
    state, view, last = found.state, found.seen, found.longest
    is_stable, unbalanced, longest = False, np.inf, np.inf
    # A cable that only a floor and its friction keep from swinging about a hinge has no stiffness of its own: which contacts stick
    # is then asked of a system that says next to nothing.
    is_rubbing = len(rod.rub.rows) > 0
    least = 0.0 if only_near and not is_rubbing else NEUTRAL * rod.stiffest / rod.length**2
    shift, most = max(least, found.shift), RUBBING_STEPS if is_rubbing else NEAR_STEPS if only_near else WARM_STEPS
    until = min(most, found.iterations + steps)
    for iteration in range(found.iterations + 1, until + 1):
        step = newton_step(rod, state, view, EXACT, shift)
        is_stable, unbalanced = step.is_stable, step.unbalanced
        longest = _largest(step.turn)
        if not (step.is_solved or longest < NEAR) and shift < SHIFT_RUBBING * rod.force_scale:
            shift = max(SHIFTS * shift, SHIFT_LEAST * rod.force_scale)
            continue
        if not longest < 1e3:
            return Settled(state, view, False, False, iteration, unbalanced, NOT_FINITE, longest, 0.0)
        scale, is_plain = min(1.0, TURN_MAX / longest) if longest > 0 else 1.0, shift <= least
        shift = shift / SHIFTS if shift > SHIFT_LEAST * rod.force_scale else least
        before, change = view.nodes, _change(state.force, step.force)
        state, view, let_go = advance(rod, state, view, step, scale)
        if only_near and longest <= near and is_plain:
            return Settled(state, view, True, is_stable, iteration, unbalanced, DONE, longest, 0.0)
        if only_near or let_go or not is_plain:
            continue
        miss = worst_miss(rod, state, view)
        # Close to the answer a neutral direction may still look unstable: an unstable verdict is given at the answer itself.
        # Steps that hardly shorten go along a direction with next to no stiffness, where a short one is not near the end.
        shortens = iteration == 1 or longest < SHORTENS * last
        last = longest
        may_end = is_stable and shortens and longest < TURN_DONE
        turn_done = TURN_DONE if may_end and _is_near(rod, state, view, step.stiffness, longest, miss) else TURN_EXACT
        is_lawful = len(state.drag) == 0 or keeps_laws(rod, state, view)
        known = is_lawful and change < FORCE_DONE * rod.force_scale
        if scale == 1.0 and longest < turn_done and known and miss < MISS_DONE * rod.length:
            return Settled(state, view, True, is_stable, iteration, unbalanced, DONE if is_stable else UNSTABLE, longest, 0.0)
        # Where several edges meet, contacts may go on taking turns without moving the cable any more.
        is_idle = iteration >= IDLE_AFTER and _largest(view.nodes - before) < IDLE_MOVE * rod.length
        if is_idle and is_stable and is_lawful and miss < IDLE_MISS * rod.length:
            return Settled(state, view, True, True, iteration, unbalanced, DONE, longest, 0.0)
    return Settled(state, view, False, is_stable, until, unbalanced, GOING_ON if until < most else NOT_SHORT, last, shift)


@kernel
def _is_near(rod, state, view, stiffness, longest, miss):  # type: ignore[no-untyped-def]
    """Whether a step shorter than `TURN_DONE` leaves no more error than the square of that: of its own square times force over stiffness.

    Along a direction with next to no stiffness, as beside the load at which a column buckles, that is much more than its square. A cable
    without clamps swings about its hinges, so softly that its balance has to tell. And no held point may miss by what spoils the balance.
    """
    least = COUPLE_DONE * (rod.weight if rod.weight > 0.0 else rod.force_scale) * rod.length
    if len(view.gap) == 0:
        largest = np.abs(state.force).max() if len(state.force) > 0 else 0.0
        if longest**2 * rod.force_scale > TURN_DONE**2 * stiffness or miss * largest > least:
            return False
    if len(rod.clamp_frames) > 0:
        return True
    couple = net_moment(rod, state, view)
    return np.sqrt((couple * couple).sum()) <= least


@kernel
def _change(before, after):  # type: ignore[no-untyped-def]
    """Largest change of a force [N], less what is rounding of the largest."""
    return np.abs(after - before).max() - FORCE_DONE * np.abs(after).max() if len(after) > 0 else 0.0


@inlined
def descend(rod, descent, steps):  # type: ignore[no-untyped-def]
    """Descend towards a minimum of the energy by at most so many steps.

    Go on while `why` is `GOING_ON`; at `CLOSE` it is time to settle, and to go on from beside the place if that is a saddle.
    """
    state, view, iteration = descent.settled.state, descent.settled.seen, descent.settled.iterations
    force, push, drag, stiffness, shift = descent.force, descent.push, descent.drag, descent.stiffness, descent.shift
    helped, worst, unbalanced = descent.helped, descent.worst, descent.settled.unbalanced
    softest = begin_stiffness(rod.weight, rod.stiffest, rod.shortest)
    last = iteration + steps
    why = GOING_ON
    while why == GOING_ON and iteration < last:
        state = soft_forces(rod, state, view, force, push, drag, stiffness)
        step = newton_step(rod, state, view, (1.0 / stiffness, 0.1 / stiffness), shift)
        iteration += 1
        unbalanced = step.unbalanced
        longest = _largest(step.turn)
        accepted = step.is_stable and longest < np.inf
        if accepted:
            scale = min(1.0, TURN_MAX / longest) if longest > 0.0 else 1.0
            state, view, accepted = search(rod, state, view, step, scale, force, push, stiffness)
        if not accepted:
            shift = max(4.0 * shift, SHIFT_LEAST * rod.force_scale)
            why = NO_DESCENT if shift >= SHIFT_MOST * rod.force_scale else GOING_ON
        else:
            helped = helped + 1 if shift > 0.0 and longest < NEAR else 0
            shift = shift / 4.0 if shift > SHIFT_LEAST * rod.force_scale else 0.0
        if accepted and longest < NEAR:
            now = soft_forces(rod, state, view, force, push, drag, stiffness)
            force, push, drag = now.force, now.push, now.drag
            before, worst = worst, worst_miss(rod, state, view)
            if worst > 0.3 * before and helped == 0 and stiffness < 1e3 * softest:
                stiffness *= 3.0
            # A step that needed a shift may be on its way to a saddle: wait until it stalls there, then look what it is.
            is_near = longest < 0.02 if helped == 0 else (longest < 1e-3 or helped > 8)
            if is_near and worst < 3e-3 * rod.length:
                state = now
                why = CLOSE
        if why == GOING_ON and iteration >= RELAX_STEPS:
            why = NO_MINIMUM
    return Descent(
        Settled(state, view, False, False, iteration, unbalanced, why, np.inf, 0.0), force, push, drag, stiffness, shift, helped, worst
    )


@kernel
def begin_stiffness(weight, stiffest, shortest):  # type: ignore[no-untyped-def]
    """Penalty of held points to begin with [N/m]; that of contacts is ten times as large."""
    return 30.0 * (weight + 10.0 * stiffest / shortest**2) / shortest


@kernel
def kick(rod):  # type: ignore[no-untyped-def]
    """Small smooth turns (n-1, 3) [rad] without symmetry, the same every time: a way off a saddle."""
    turn, s = np.empty((len(rod.lengths), 3)), 0.0
    for j in range(len(rod.lengths)):
        middle = (s + 0.5 * rod.lengths[j]) / rod.length
        s += rod.lengths[j]
        turn[j, 0] = rod.kick * np.sin(2.0 * middle + 0.3)
        turn[j, 1] = rod.kick * np.sin(3.1 * middle + 1.0)
        turn[j, 2] = rod.kick * np.sin(4.3 * middle + 2.0)
    return turn


@kernel
def _largest(values):  # type: ignore[no-untyped-def]
    """Largest magnitude in an array (n, 3); not finite if one of them is not."""
    most = 0.0
    for i in range(values.shape[0]):
        for k in range(values.shape[1]):
            if not abs(values[i, k]) <= most:
                most = abs(values[i, k])
                if not most < np.inf:
                    return np.inf
    return most


@kernel
def advance(rod, state, view, step, scale):  # type: ignore[no-untyped-def]
    """Take a step, then drop the bonds that pull; whether there were any."""
    points, holds, let_go = rod.held.rows, state.holds.copy(), False
    for bond in range(len(holds)):
        along = 0.0
        for row in range(len(step.force) - rod.held.inclined):
            if points["bond"][row] == bond:
                for k in range(3):
                    along += step.force[row] * points["axis"][row, k] * rod.held.normal[bond, k]
        if holds[bond] and along < 0.0:
            holds[bond], let_go = False, True
    force = step.force.copy()
    for row in range(len(force)):
        if points["bond"][row] >= 0 and not holds[points["bond"][row]]:
            force[row] = 0.0
    frames = retract(state.frames, scale * step.turn)
    moved, seen = look(
        rod, State(frames, force, holds, step.push, step.touches, state.fraction, step.drag, step.sticks, state.ease), view.push
    )
    return moved, seen, let_go


@kernel
def keeps_laws(rod, state, view):  # type: ignore[no-untyped-def]
    """Whether every contact with friction sticks or slides by its law, as nearly as held points are held and forces known."""
    stray, wrong = lawless(rod, state, view, SOFTNESS / rod.force_scale)
    return stray < MISS_DONE * rod.length and wrong < FORCE_DONE * rod.force_scale


@kernel
def worst_miss(rod, state, view):  # type: ignore[no-untyped-def]
    """Largest distance of a held point from its goal, or of a contact from where its force would have it [m].

    Infinite where a contact gave way further than a force can be meant: a body that the cable cannot escape.
    """
    hard, worst, bond = SOFTNESS / rod.force_scale, 0.0, rod.held.rows["bond"]
    for row in range(len(view.miss)):
        if is_active(bond, state.holds, row):
            gives = hard * state.force[row] if bond[row] >= 0 else 0.0
            worst = max(worst, abs(view.miss[row] + gives))
    for row in range(len(view.gap)):
        if -view.gap[row] > GIVE_MAX * rod.length:
            return np.inf
        balance = view.gap[row] + hard * state.push[row]
        worst = max(worst, CONTACT_EASE * (abs(balance) if state.touches[row] else -balance))
    return worst
