"""Several rods that touch, rub on or stick to each other, solved as one system: from a start to an equilibrium of all.

The step of Newton's method is that of `joint`. Where plain steps end at no stable equilibrium, steps with a shift that makes each a step
downhill are tried.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from . import crossing, knots, strand_friction
from .equilibrium import DONE, FORCE_DONE, MISS_DONE, NO_MINIMUM, NOT_FINITE, SHIFT_LEAST, SHIFT_MOST, TURN_MAX, UNSTABLE, Settled
from .joint import Forces, Group, Joint, Together, joint_step, loaded
from .newton import Step
from .rod import Rod, State, View

Array = np.ndarray
PLAIN_STEPS: Final = 20
PATIENT_STEPS: Final = 200
PATIENT_TURN: Final = 0.1  # rad, of any segment in one step with a shift
NEAR: Final = 1e-3  # rad; such a step leaves an error of about its square, and softly held cables move far by a small turn
TURN_DONE: Final = 1e-6  # rad; a Newton step this long leaves an error of about its square


@dataclass(frozen=True)
class Outcome:
    """Where an iteration ended."""

    now: Together
    rods: tuple[Rod, ...]  # with the forces between them among their loads
    couples: tuple[Array, ...]  # (n-1, 3) N m, slopes of the arms of knots
    is_stable: bool
    iterations: int
    unbalanced: float  # N
    why: int  # index into `equilibrium.WHY`

    @property
    def is_good(self) -> bool:
        """Whether this is a stable equilibrium."""
        return self.why == DONE and self.is_stable

    def settled(self, rod: int) -> Settled:
        """What it is for one rod."""
        state, view = self.now.states[rod], self.now.views[rod]
        return Settled(state, view, self.is_good, self.is_stable, self.iterations, self.unbalanced, self.why)


def begin(group: Group, states: Sequence[State], begun: Forces) -> Together:
    """Rods that have not moved yet."""
    rods = [system.rod for system in group.systems]
    seen = [group.path.look(rod, state, np.ascontiguousarray(rod.touch["normal"])) for rod, state in zip(rods, states, strict=True)]
    views = tuple(View(*view) for _, view in seen)
    met = crossing.meet(group.path, group.crossing, [view.nodes for view in views], begun.met)
    return Together(met, begun.push, begun.pull, begun.drag, tuple(State(*state) for state, _ in seen), views)


def settle(group: Group, begun: Together) -> Outcome:
    """To a stable equilibrium of all."""
    plain = _newton(group, begun, PLAIN_STEPS, TURN_MAX, is_patient=False)
    may_be_patient = not any(
        len(system.rod.rub.rows) for system in group.systems
    )  # with rough bodies that takes minutes, and mostly in vain
    return _newton(group, begun, PATIENT_STEPS, PATIENT_TURN, is_patient=True) if may_be_patient and not plain.is_good else plain


def compare(group: Group, begun: Together) -> Outcome:
    """Near to an equilibrium, for comparing meshes; `why` says whether there is one."""
    return _newton(group, begun, PLAIN_STEPS, TURN_MAX, is_patient=False, near=NEAR)


def _newton(group: Group, begun: Together, steps: int, turn_most: float, *, is_patient: bool, near: float = 0.0) -> Outcome:
    """Newton steps, each downhill if one is patient; until one is as short as `near` [rad], or to the end if that is zero."""
    now, shift = begun, 0.0
    for iteration in range(1, steps + 1):
        rods, couples = loaded(group, now)
        step = joint_step(group, now, rods, couples, shift)
        while is_patient and not step.is_stable and shift < SHIFT_MOST * group.scale:
            shift = max(4.0 * shift, SHIFT_LEAST * group.scale)
            step = joint_step(group, now, rods, couples, shift)
        longest = max(float(np.abs(turn).max()) for turn in step.turns)
        if not longest < 1e3:
            return Outcome(now, rods, couples, False, iteration, step.unbalanced, NOT_FINITE)
        share = min(1.0, turn_most / max(longest, 1e-300))
        now, let_go = _advanced(group, now, step, share)
        is_plain = shift == 0.0
        if longest <= near:
            return Outcome(now, *loaded(group, now), step.is_stable, iteration, step.unbalanced, DONE)
        if longest < TURN_DONE and is_plain and not let_go and _is_held(group, now):
            why = DONE if step.is_stable else UNSTABLE
            return Outcome(now, *loaded(group, now), step.is_stable, iteration, step.unbalanced, why)
        shift = shift / 4.0 if shift > SHIFT_LEAST * group.scale else 0.0
    return Outcome(now, rods, couples, step.is_stable, steps, step.unbalanced, NO_MINIMUM)


def _advanced(group: Group, now: Together, step: Joint, share: float) -> tuple[Together, bool]:
    """All rods after a share of the turns of a step; whether a bond to a body that would pull was dropped."""
    states, views, let_go = [], [], False
    for i, system in enumerate(group.systems):
        new, view = step.states[i], now.views[i]
        own = Step(step.turns[i], new.force, new.push, new.touches, new.drag, new.sticks, step.is_stable, step.unbalanced, 0.0, 0.0, True)
        state, seen, dropped = group.path.advance(system.rod, now.states[i], view, own, share)
        states.append(State(*state))
        views.append(View(*seen))
        let_go |= bool(dropped)
    met = crossing.meet(group.path, group.crossing, [view.nodes for view in views], now.met)
    return Together(met, step.push, step.pull, step.drag, tuple(states), tuple(views)), let_go


def _is_held(group: Group, now: Together) -> bool:
    """Whether every held point, contact and knot is where its force would have it."""
    for system, state, view in zip(group.systems, now.states, now.views, strict=True):
        if not group.path.worst_miss(system.rod, state, view) < MISS_DONE * system.rod.length:
            return False
        if not group.path.keeps_laws(system.rod, state, view):
            return False
    least = MISS_DONE * min(system.rod.length for system in group.systems)
    balance = now.met.gap + group.hard * now.push
    miss = np.where(now.push > 0.0, np.abs(balance), -balance)
    apart = knots.misses(group.path, group.tied(now), now.nodes, now.axes)
    if not (knots.are_joined(group.knots, apart) and crossing.are_apart(now.met, least / MISS_DONE)):
        return False
    stray, wrong, _ = slipped(group, now)
    if not (stray < least and wrong < FORCE_DONE * group.scale):
        return False
    return bool(max(miss.max(initial=0.0), np.abs(apart + group.hard * now.pull).max(initial=0.0)) < least)


def slipped(group: Group, now: Together) -> tuple[float, float, Array]:
    """How far friction between the cables is from its law [m] and [N], and where it sticks (f,); see `strand_friction.strays`."""
    rubs, chosen = group.rubbing(now)
    ways, sticks = strand_friction.across(rubs, now.met), np.zeros(len(now.drag), dtype=bool)
    slip = strand_friction.slips(group.path, rubs, ways, now.nodes, now.axes)
    drag = np.einsum("fax,fx->fa", ways, now.drag[chosen])
    stray, wrong, sticks[chosen] = strand_friction.strays(rubs, slip, drag, now.push, group.hard)
    return stray, wrong, sticks
