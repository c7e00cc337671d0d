"""Several rods that touch or stick to each other, solved as one system: the Newton step of `newton`, with one border for all.

Each rod keeps its elimination. With H_i its Hessian, C_i the columns of its own rows and of the rows that it shares with others (crossings,
their curvature, knots), and B the compliance of all rows,

    S = sum_i C_i^T H_i^-1 C_i + B

is the one dense system over all rows. Which contacts push, of each rod with bodies and with itself and of the rods with each other, is
found within every step (`closing`), and by Sylvester's law the equilibrium is a minimum of the energy of all rods together if
sum_i negative(H_i) + positive(S) equals the number of rows and the negative directions that rows of curvature bring.

Where plain steps end at no stable equilibrium, steps with a shift that makes each a step downhill are tried.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any, Final

import numpy as np

from . import crossing, knots
from .border import SOFTNESS
from .crossing import Crossing, Met
from .equilibrium import DONE, EXACT, MISS_DONE, NEUTRAL, NO_MINIMUM, NOT_FINITE, SHIFT_LEAST, SHIFT_MOST, TURN_MAX, UNSTABLE, Settled
from .knots import Knots
from .newton import Step
from .numbering import Numbering
from .rod import Rod, State, View
from .strand_rows import Spread
from .system import System

Array = np.ndarray
PLAIN_STEPS: Final = 20
PATIENT_STEPS: Final = 200
PATIENT_TURN: Final = 0.1  # rad, of any segment in one step with a shift
NEAR: Final = 1e-3  # rad; such a step leaves an error of about its square, and softly held cables move far by a small turn
TURN_DONE: Final = 1e-6  # rad; a Newton step this long leaves an error of about its square


@dataclass(frozen=True)
class Group:
    """The rods that know of each other."""

    path: ModuleType
    systems: tuple[System, ...]
    crossing: Crossing
    knots: Knots

    @property
    def scale(self) -> float:
        """[N] Typical force."""
        return max(system.rod.force_scale for system in self.systems)

    @property
    def hard(self) -> float:
        """[m/N] Compliance of what touches or sticks."""
        return SOFTNESS / self.scale

    def tied(self, now: Together) -> Knots:
        """The knots under the forces of now."""
        return knots.ahead(self.knots, now.pull, now.axes)

    @property
    def neutral(self) -> float:
        """[N] Stiffness below which a direction is neutral, not unstable."""
        return max(NEUTRAL * system.rod.stiffest / system.rod.length**2 for system in self.systems)


@dataclass(frozen=True)
class Together:
    """Where all rods are, and the forces between them."""

    states: tuple[State, ...]
    views: tuple[View, ...]
    met: Met
    push: Array  # (k,) N
    pull: Array  # (b, 5) N

    @property
    def nodes(self) -> list[Array]:
        """Nodes (n, 3) [m] of every rod."""
        return [view.nodes for view in self.views]

    @property
    def axes(self) -> list[Array]:
        """Directors (n-1, 3, 3) of every rod."""
        return [view.axes for view in self.views]


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


def begin(group: Group, states: Sequence[State], met: Met, push: Array, pull: Array) -> Together:
    """Rods that have not moved yet."""
    rods = [system.rod for system in group.systems]
    seen = [group.path.look(rod, state, np.ascontiguousarray(rod.touch["normal"])) for rod, state in zip(rods, states, strict=True)]
    views = tuple(View(*view) for _, view in seen)
    met = crossing.meet(group.path, group.crossing, [view.nodes for view in views], met)
    return Together(tuple(State(*state) for state, _ in seen), views, met, push, pull)


def settle(group: Group, begun: Together) -> Outcome:
    """To a stable equilibrium of all."""
    plain = _newton(group, begun, PLAIN_STEPS, TURN_MAX, is_patient=False)
    return plain if plain.is_good else _newton(group, begun, PATIENT_STEPS, PATIENT_TURN, is_patient=True)


def compare(group: Group, begun: Together) -> Outcome:
    """Near to an equilibrium, for comparing meshes; `why` says whether there is one."""
    return _newton(group, begun, PLAIN_STEPS, TURN_MAX, is_patient=False, near=NEAR)


def _newton(group: Group, begun: Together, steps: int, turn_most: float, *, is_patient: bool, near: float = 0.0) -> Outcome:
    """Newton steps, each downhill if one is patient; until one is as short as `near` [rad], or to the end if that is zero."""
    now, shift = begun, group.neutral
    for iteration in range(1, steps + 1):
        rods, couples = _loaded(group, now)
        step = _step(group, now, rods, couples, shift)
        while is_patient and not step.is_stable and shift < SHIFT_MOST * group.scale:
            shift = max(4.0 * shift, SHIFT_LEAST * group.scale)
            step = _step(group, now, rods, couples, shift)
        longest = max(float(np.abs(turn).max()) for turn in step.turns)
        if not longest < 1e3:
            return Outcome(now, rods, couples, False, iteration, step.unbalanced, NOT_FINITE)
        share = min(1.0, turn_most / max(longest, 1e-300))
        now, let_go = _advanced(group, now, step, share)
        is_plain = shift <= group.neutral
        if longest <= near:
            return Outcome(now, *_loaded(group, now), step.is_stable, iteration, step.unbalanced, DONE)
        if longest < TURN_DONE and is_plain and not let_go and _is_held(group, now):
            why = DONE if step.is_stable else UNSTABLE
            return Outcome(now, *_loaded(group, now), step.is_stable, iteration, step.unbalanced, why)
        shift = shift / 4.0 if shift > SHIFT_LEAST * group.scale else group.neutral
    return Outcome(now, rods, couples, step.is_stable, steps, step.unbalanced, NO_MINIMUM)


def _loaded(group: Group, now: Together) -> tuple[tuple[Rod, ...], tuple[Array, ...]]:
    """The rods with the forces between them added to their loads, and the slopes of arms."""
    forces = [system.rod.loads.copy() for system in group.systems]
    couples = [np.zeros((len(system.rod.lengths), 3)) for system in group.systems]
    crossing.add_forces(group.path, group.crossing, now.met, now.push, forces)
    knots.add_forces(group.path, group.tied(now), now.pull, now.axes, forces, couples)
    return tuple(system.rod._replace(loads=load) for system, load in zip(group.systems, forces, strict=True)), tuple(couples)


@dataclass(frozen=True)
class _Joint:
    """One Newton step of all rods."""

    turns: list[Array]  # (n-1, 3) rad
    states: list[State]  # with new forces, and the frames of before
    push: Array
    pull: Array
    is_stable: bool
    unbalanced: float  # N


def _step(group: Group, now: Together, rods: Sequence[Rod], couples: Sequence[Array], shift: float) -> _Joint:
    path, hard, own_knots, ties = group.path, group.hard, group.tied(now), knots.ROWS * len(group.knots.cable)
    crossed, stiffness = crossing.strips(path, group.crossing, now.met, now.push, now.nodes, ties, group.scale)
    tied, turned = knots.strips(path, own_knots, now.axes, 0)
    bent, more_stiffness = knots.tilts(own_knots, now.pull, now.axes, ties + len(now.push) + len(stiffness), group.scale)
    stiffness = np.concatenate([stiffness, more_stiffness])
    shared = ties + len(now.push) + len(stiffness)
    blocks = [np.zeros((len(rod.lengths), 3, 3)) for rod in rods]
    knots.curve(own_knots, now.pull, now.axes, blocks)
    parts = []
    for i, rod in enumerate(rods):
        more = np.zeros((len(rod.lengths), 3, shared))
        for strip in (tied[i], crossed[i]):
            path.add_spread(now.views[i].axes, rod.lengths, rod.base, Spread(strip.row, strip.node, strip.coef), more)
        for segment, row, slope in turned[i] + bent[i]:
            more[segment, :, row] += slope
        parts.append(_part(path, rod, now.states[i], now.views[i], couples[i], blocks[i], more, shift))
    joint = Numbering([part.border for part in parts], ties, len(now.push), shared)
    for part, own in zip(parts, joint.own, strict=True):
        every = np.concatenate([own, joint.shared])
        joint.matrix[np.ix_(every, every)] += part.schur[:, :-1]
        joint.right[every] += part.schur[:, -1]
        joint.matrix[np.ix_(own, own)] += part.border.compliance
        joint.right[own] -= part.border.residual
    off = knots.misses(path, own_knots, now.nodes, now.axes) + hard * now.pull
    residual = np.concatenate([off.ravel(), now.met.gap + hard * now.push])
    joint.matrix[joint.shared, joint.shared] += np.concatenate([np.full(len(residual), hard), 1.0 / stiffness])
    joint.matrix[np.ix_(joint.shared[:ties], joint.shared[:ties])] += knots.compliance(own_knots, now.axes)
    joint.right[joint.shared[: len(residual)]] -= residual
    pushes = np.concatenate([*(now.states[i].push[part.border.contacts] for i, part in enumerate(parts)), now.push])
    change, closed, positive = path.close(joint.matrix, joint.right, joint.contacts.start, len(pushes), pushes, True)
    saddles = sum(part.border.saddles for part in parts) + int((stiffness > 0.0).sum())
    is_stable = sum(part.negative for part in parts) + positive == joint.contacts.start + closed.sum() + saddles
    turns, states, at = [], [], 0
    for i, (part, own) in enumerate(zip(parts, joint.own, strict=True)):
        answer = np.append(change[np.concatenate([own, joint.shared])], -1.0)
        turns.append((part.answers @ answer).reshape(-1, 3))
        states.append(_forced(now.states[i], part.border, change[own], closed[at : at + len(part.border.contacts)]))
        at += len(part.border.contacts)
    new_push = np.where(closed[at:], now.push + change[joint.shared[ties : ties + len(now.push)]], 0.0)
    new_pull = now.pull + change[joint.shared[:ties]].reshape(-1, knots.ROWS)
    return _Joint(turns, states, new_push, new_pull, bool(is_stable), max(part.unbalanced for part in parts))


@dataclass(frozen=True)
class _Part:
    """What one rod brings to a step."""

    border: Any  # a `Border`
    answers: Array  # (3 (n-1), columns + 1)
    schur: Array  # (columns, columns + 1)
    negative: int
    unbalanced: float


def _part(path: ModuleType, rod: Rod, state: State, view: View, couples: Array, blocks: Array, more: Array, shift: float) -> _Part:
    """One rod eliminated, with the columns `more` (n-1, 3, shared) of the rows that it shares."""
    carried, gradient, diagonal, upper, beyond = path.linear_system(rod, state, view)
    gradient -= couples
    diagonal += blocks
    path.fix_gauge(rod, diagonal, shift)
    border = path.border_rows(rod, state, view, EXACT, np.inf)
    matrix = path.border_columns(rod, view, border, carried, diagonal)
    columns = np.concatenate([matrix, more], axis=2)
    right = np.ascontiguousarray(np.concatenate([columns, gradient[:, :, None]], axis=2))
    negative = path.eliminate(diagonal, upper, beyond, right)
    size = 3 * len(gradient)
    answers = right.reshape(size, -1)
    schur = columns.reshape(size, -1).T @ answers
    return _Part(border, answers, schur, int(negative), float((np.abs(gradient) / rod.lengths[:, None]).max()))


def _forced(state: State, border: Any, change: Array, closed: Array) -> State:
    """The state with its new forces on the border."""
    force, push, touches = state.force.copy(), state.push.copy(), state.touches.copy()
    held = len(border.held)
    force[border.held] += change[:held]
    push[border.contacts] += change[held : held + len(border.contacts)]
    touches[border.contacts] = closed
    push[~touches] = 0.0
    return state._replace(force=force, push=push, touches=touches)


def _advanced(group: Group, now: Together, step: _Joint, share: float) -> tuple[Together, bool]:
    """All rods after a share of the turns of a step; whether a bond to a body that would pull was dropped."""
    states, views, let_go = [], [], False
    for i, system in enumerate(group.systems):
        new, view = step.states[i], now.views[i]
        own = Step(step.turns[i], new.force, new.push, new.touches, new.drag, new.sticks, step.is_stable, step.unbalanced, 0.0, 0.0)
        state, seen, dropped = group.path.advance(system.rod, now.states[i], view, own, share)
        states.append(State(*state))
        views.append(View(*seen))
        let_go |= bool(dropped)
    met = crossing.meet(group.path, group.crossing, [view.nodes for view in views], now.met)
    return Together(tuple(states), tuple(views), met, step.push, step.pull), let_go


def _is_held(group: Group, now: Together) -> bool:
    """Whether every held point, contact and knot is where its force would have it."""
    for system, state, view in zip(group.systems, now.states, now.views, strict=True):
        if not group.path.worst_miss(system.rod, state, view) < MISS_DONE * system.rod.length:
            return False
    least = MISS_DONE * min(system.rod.length for system in group.systems)
    balance = now.met.gap + group.hard * now.push
    miss = np.where(now.push > 0.0, np.abs(balance), -balance)
    apart = knots.misses(group.path, group.tied(now), now.nodes, now.axes)
    if not (knots.are_joined(group.knots, apart) and crossing.are_apart(now.met, least / MISS_DONE)):
        return False
    return bool(max(miss.max(initial=0.0), np.abs(apart + group.hard * now.pull).max(initial=0.0)) < least)
