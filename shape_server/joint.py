"""The Newton step of several rods that touch, rub on or stick to each other: that of `newton`, with one border for all.

Each rod keeps its elimination. With H_i its Hessian, C_i the columns of its own rows and of the rows that it shares with others (crossings,
their curvature, knots, friction), and B the compliance of all rows,

    S = sum_i C_i^T H_i^-1 C_i + B

is the one dense system over all rows. Which contacts push, and which of those that rub stick, of each rod with bodies and with itself and
of the rods with each other, is found within every step (`closing`, `stick_slip`), and by Sylvester's law the equilibrium is a minimum of
the energy of all rods together if sum_i negative(H_i) + positive(S) equals the number of rows and the negative directions that rows of
curvature bring.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any, Final

import numpy as np

from . import crossing, knots, strand_friction
from .border import SOFTNESS
from .crossing import Crossing, Met
from .equilibrium import EXACT, NEUTRAL
from .knots import Knots
from .newton import AHEAD
from .numbering import Numbering
from .rod import Rod, State, View
from .strand_friction import Rubs
from .strand_rows import Spread
from .system import System

Array = np.ndarray
NEAR: Final = 1e-3  # of the length; contacts open by more, and by `newton.AHEAD` times what anything is off, are left out of a step


@dataclass(frozen=True)
class Group:
    """The rods that know of each other."""

    path: ModuleType
    systems: tuple[System, ...]
    crossing: Crossing
    knots: Knots
    rubs: Rubs

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

    def rubbing(self, now: Together) -> tuple[Rubs, Array]:
        """What is pressed and rubs, under the forces of now, and its numbers."""
        chosen = self.rubs.pressed(now.met, now.push)
        return self.rubs.those(chosen).ahead(now.drag[chosen], now.axes), chosen


@dataclass(frozen=True)
class Forces:
    """Where rods meet each other, and the forces between them."""

    met: Met
    push: Array  # (k,) N
    pull: Array  # (b, 5) N
    drag: Array  # (f, 3) N


@dataclass(frozen=True)
class Together(Forces):
    """Where all rods are, and what they do to each other."""

    states: tuple[State, ...]
    views: tuple[View, ...]

    @property
    def nodes(self) -> list[Array]:
        """Nodes (n, 3) [m] of every rod."""
        return [view.nodes for view in self.views]

    @property
    def axes(self) -> list[Array]:
        """Directors (n-1, 3, 3) of every rod."""
        return [view.axes for view in self.views]


def loaded(group: Group, now: Together) -> tuple[tuple[Rod, ...], tuple[Array, ...]]:
    """The rods with the forces between them added to their loads, and the slopes of arms."""
    forces = [system.rod.loads.copy() for system in group.systems]
    couples = [np.zeros((len(system.rod.lengths), 3)) for system in group.systems]
    crossing.add_forces(group.path, group.crossing, now.met, now.push, forces)
    knots.add_forces(group.path, group.tied(now), now.pull, now.axes, forces, couples)
    rubs, chosen = group.rubbing(now)
    strand_friction.add_forces(group.path, rubs, now.drag[chosen], now.axes, forces, couples)
    return tuple(system.rod._replace(loads=load) for system, load in zip(group.systems, forces, strict=True)), tuple(couples)


@dataclass(frozen=True)
class Joint:
    """One Newton step of all rods."""

    turns: list[Array]  # (n-1, 3) rad
    states: list[State]  # with new forces, and the frames of before
    push: Array
    pull: Array
    drag: Array  # (f, 3) N; (f, 2) along the directions of the step until these are put together
    is_stable: bool
    unbalanced: float  # N


def joint_step(group: Group, now: Together, rods: Sequence[Rod], couples: Sequence[Array], shift: float) -> Joint:
    """The step from now, with `shift` [N] on the Hessian of every rod; `rods` and `couples` as `loaded` gives them."""
    path, own_knots, ties = group.path, group.tied(now), knots.ROWS * len(group.knots.cable)
    rubs, chosen = group.rubbing(now)
    ways = strand_friction.across(rubs, now.met)
    crossed, stiffness = crossing.strips(path, group.crossing, now.met, now.push, now.nodes, ties, group.scale)
    tied, turned = knots.strips(path, own_knots, now.axes, 0)
    bent, more_stiffness = knots.tilts(own_knots, now.pull, now.axes, ties + len(now.push) + len(stiffness), group.scale)
    stiffness = np.concatenate([stiffness, more_stiffness])
    blocks = [np.zeros((len(rod.lengths), 3, 3)) for rod in rods]
    knots.curve(own_knots, now.pull, now.axes, blocks)
    strand_friction.curve(rubs, now.drag[chosen], now.axes, blocks)
    parts = []
    for i, (rod, slips) in enumerate(zip(rods, strand_friction.columns(path, rubs, ways, now.axes, rods), strict=True)):
        more = np.zeros((len(rod.lengths), 3, ties + len(now.push) + len(stiffness)))
        for strip in (tied[i], crossed[i]):
            path.add_spread(now.views[i].axes, rod.lengths, rod.base, Spread(strip.row, strip.node, strip.coef), more)
        for segment, row, slope in turned[i] + bent[i]:
            more[segment, :, row] += slope
        more = np.concatenate([more, slips], axis=2)
        least = NEUTRAL * rod.stiffest / rod.length**2  # below it a direction is neutral, not unstable
        parts.append(_part(path, rod, now.states[i], now.views[i], couples[i], blocks[i], more, max(shift, least)))
    joint = Numbering([part.border for part in parts], ties, len(now.push), len(stiffness), len(rubs.row))
    for part, own in zip(parts, joint.own, strict=True):
        every = np.concatenate([own, joint.shared])
        joint.matrix[np.ix_(every, every)] += part.schur[:, :-1]
        joint.right[every] += part.schur[:, -1]
        joint.matrix[np.ix_(own, own)] += part.border.compliance
        joint.right[own] -= part.border.residual
    drag = np.einsum("fax,fx->fa", ways, now.drag[chosen])
    _share(group, now, own_knots, rubs, ways, drag, stiffness, joint)
    found = _closed(group, now, rods, parts, joint, rubs, drag, int((stiffness > 0.0).sum()))
    new_drag = np.zeros_like(now.drag)
    new_drag[chosen] = np.einsum("fax,fa->fx", ways, found.drag)
    return replace(found, drag=new_drag)


def _share(group: Group, now: Together, own_knots: Knots, rubs: Rubs, ways: Array, drag: Array, stiffness: Array, joint: Numbering) -> None:
    """Add compliance and residual of the shared rows: knots, places where cables touch, their curvature, friction between them."""
    path, hard, shared = group.path, group.hard, joint.shared
    ties, slipping = now.pull.size, 2 * len(rubs.row)
    off = knots.misses(path, own_knots, now.nodes, now.axes) + hard * now.pull
    slip = strand_friction.slips(path, rubs, ways, now.nodes, now.axes) + hard * drag
    residual = np.concatenate([off.ravel(), now.met.gap + hard * now.push])
    gives = np.concatenate([np.full(len(residual), hard), 1.0 / stiffness, np.full(slipping, hard)])
    joint.matrix[shared, shared] += gives
    joint.matrix[np.ix_(shared[:ties], shared[:ties])] += knots.compliance(own_knots, now.axes)
    joint.right[shared[: len(residual)]] -= residual
    last = shared[len(shared) - slipping :]
    joint.matrix[np.ix_(last, last)] += strand_friction.compliance(rubs, ways, now.axes)
    joint.right[last] -= slip.ravel()


def _closed(
    group: Group, now: Together, rods: Sequence[Rod], parts: Sequence[_Part], joint: Numbering, rubs: Rubs, drag: Array, saddles: int
) -> Joint:
    """The joint system solved, and what of its solution belongs to each rod; friction (f, 2) [N] as that of now, `drag`, is given."""
    ties, first, borders = now.pull.size, joint.contacts.start, [part.border for part in parts]
    pushes = np.concatenate([*(state.push[border.contacts] for state, border in zip(now.states, borders, strict=True)), now.push])
    drags = np.concatenate([*(state.drag[border.rubs] for state, border in zip(now.states, borders, strict=True)), drag])
    if len(drags):
        bodies = [rod.rub._replace(rows=rod.rub.rows[border.rubs]) for rod, border in zip(rods, borders, strict=True)]
        law, rub_of = strand_friction.laws(rubs, bodies), _rub_of(rubs, rods, borders, len(now.push))
        found = group.path.close_with_friction(joint.matrix, joint.right, first, pushes, drags, rub_of, law, group.hard)
        change, closed, sticks, positive, rubbing, _ = found
    else:
        change, closed, positive = group.path.close(joint.matrix, joint.right, first, len(pushes), pushes, True)
        sticks, rubbing = np.zeros(0, dtype=bool), 0
    saddles += sum(border.saddles for border in borders)
    is_stable = sum(part.negative for part in parts) + positive == first + closed.sum() + saddles + rubbing
    turns, states, at, slid = [], [], 0, 0
    for state, part, own in zip(now.states, parts, joint.own, strict=True):
        turns.append((part.answers @ np.append(change[np.concatenate([own, joint.shared])], -1.0)).reshape(-1, 3))
        touches, rubbed = len(part.border.contacts), len(part.border.rubs)
        states.append(_forced(state, part.border, change[own], closed[at : at + touches], sticks[slid : slid + rubbed]))
        at, slid = at + touches, slid + rubbed
    shared = change[joint.shared]
    new_push = np.where(closed[at:], now.push + shared[ties : ties + len(now.push)], 0.0)
    new_drag = drag + shared[len(shared) - drag.size :].reshape(-1, 2)
    new_pull = now.pull + shared[:ties].reshape(-1, knots.ROWS)
    return Joint(turns, states, new_push, new_pull, new_drag, bool(is_stable), max(part.unbalanced for part in parts))


def _rub_of(rubs: Rubs, rods: Sequence[Rod], borders: Sequence[Any], crossings: int) -> Array:
    """Which contact that rubs, of all of them in order, each contact row belongs to; -1 for none."""
    out, at = [], 0
    for rod, border in zip(rods, borders, strict=True):
        place = np.full(len(rod.rub.rows) + 1, -1)  # the last one is that of a contact without friction
        place[border.rubs] = at + np.arange(len(border.rubs))
        out.append(place[rod.touch["rub"][border.contacts]])
        at += len(border.rubs)
    between = np.full(crossings, -1)
    between[rubs.row] = at + np.arange(len(rubs.row))
    return np.concatenate([*out, between])


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
    # What is left out and closes all the same is in the next step.
    near = AHEAD * path.farthest_off(rod, state, view) + NEAR * rod.length
    border = path.border_rows(rod, state, view, EXACT, near)
    matrix = path.border_columns(rod, view, border, carried, diagonal)
    columns = np.concatenate([matrix, more], axis=2)
    right = np.ascontiguousarray(np.concatenate([columns, gradient[:, :, None]], axis=2))
    negative = path.eliminate(diagonal, upper, beyond, right)
    size = 3 * len(gradient)
    answers = right.reshape(size, -1)
    schur = columns.reshape(size, -1).T @ answers
    return _Part(border, answers, schur, int(negative), float((np.abs(gradient) / rod.lengths[:, None]).max()))


def _forced(state: State, border: Any, change: Array, closed: Array, sticks: Array) -> State:
    """The state with its new forces on the border."""
    force, push, touches, drag = state.force.copy(), state.push.copy(), state.touches.copy(), state.drag.copy()
    held = len(border.held)
    force[border.held] += change[:held]
    push[border.contacts] += change[held : held + len(border.contacts)]
    touches[border.contacts] = closed
    push[~touches] = 0.0
    drag[border.rubs] += change[len(change) - 2 * len(border.rubs) :].reshape(-1, 2)
    holds = np.zeros(len(drag), dtype=bool)
    holds[border.rubs] = sticks
    return state._replace(force=force, push=push, touches=touches, drag=drag, sticks=holds)
