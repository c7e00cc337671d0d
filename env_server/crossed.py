"""Where the cables of a scene meet each other, as boundary conditions: the rows of all pairs that do not pass through each other.

Two cables of the kind `contact` are one-sided to each other, as strands of one cable are (`self_boundary`): every place within reach is
a row, the server decides which push, and no step may take one cable through another. With a coefficient they rub on each other, and so
does a cable on itself (`held`). Of two cables, or strands, of the kind `bond` what pushes once a step has settled is a knot from then
on: the surfaces stick together at that point for good (the paper's F_inf between cables). Cables of different kinds, and all others, pass
through each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import TYPE_CHECKING, Final

import numpy as np

from protocol.kinds import SelfInteraction, SelfTouch
from protocol.messages import CablePoints, CrossingReactions, Crossings, Shape
from protocol.scene import Cable

from .apart import Way, may_go
from .held import NOT_YET, Held, Knot, knot_at
from .self_boundary import NEAR, Meeting, all_have_rows, beside, handed_on, places_of, rubs
from .self_touch import SelfCandidates, search, search_two

if TYPE_CHECKING:
    from .hanging import Hanging

APART: Final = 0.5  # of a segment; a place as near to a knot, on both cables, is not knotted again
UP: Final = np.array([0.0, 0.0, 1.0])  # of a knot, whose normal says nothing
NOTHING: Final = CablePoints(cable=np.zeros((0, 2), dtype=np.int64), s=np.zeros((0, 2)), point=np.zeros((0, 3)), force=np.zeros((0, 3)))
NO_DRAGS: Final = np.zeros((0, 3))


@dataclass(frozen=True)
class Pair:
    """Two cables that may touch."""

    first: int
    second: int
    distance: float  # m, of their axes when they touch
    share: float  # of that, the radius of the first
    sticks: bool
    mu: float  # 0 without friction


@dataclass(frozen=True)
class Crossed:
    """What cables do to each other, and where they are near each other; a new value after every change."""

    pairs: tuple[Pair, ...]
    sticking: tuple[int, ...]  # cables that stick to themselves
    near: tuple[SelfCandidates, ...] = ()  # of every pair, once looked for
    knots: tuple[Knot, ...] = ()
    held: Held = NOT_YET  # by friction
    pushes: CablePoints = NOTHING  # all that acts: knots and friction too
    drags: np.ndarray = field(default_factory=lambda: NO_DRAGS)  # (c, 3) N, friction in these

    def looked(self, shapes: Sequence[Shape], room: float) -> Crossed:
        """With where the shapes are near each other; clearances are known up to `room` [m]."""
        near = []
        for pair in self.pairs:
            (first, second), reach = (shapes[pair.first], shapes[pair.second]), 0.5 * NEAR * pair.distance
            if pair.first == pair.second:
                found = search(first.nodes, first.s, 0.5 * pair.distance, reach, max(room, reach))
            else:
                found = search_two(first.nodes, second.nodes, pair.distance, reach, max(room, reach))
            near.append(beside(found, self._knotted(pair.first, pair.second, shapes)))
        return replace(self, near=tuple(near))

    def itself(self, index: int, own: Meeting, shape: Shape) -> Meeting:
        """Where a cable meets itself, but for its knots."""
        return own.beside(self._knotted(index, index, {index: shape}))

    def asked(self, shapes: Sequence[Shape]) -> Crossings | None:
        """The rows to ask the shape server about, by the shapes that were looked at; None if there are none."""
        count = sum(len(found.gap) for found in self.near)
        if count + len(self.knots) == 0:
            return None
        cable = [np.tile([pair.first, pair.second], (len(found.gap), 1)) for pair, found in zip(self.pairs, self.near, strict=True)]
        s = [_arc_lengths(found.place, shapes, pair) for pair, found in zip(self.pairs, self.near, strict=True)]
        force = [self._shared(pair, found, shapes) for pair, found in zip(self.pairs, self.near, strict=True)]
        distance = [np.full(len(found.gap), pair.distance) for pair, found in zip(self.pairs, self.near, strict=True)]
        rubbing = [self.held.rows((p.first, p.second), p.share, p.mu, own) for p, own in zip(self.pairs, s, strict=True)]
        more = len(self.knots)
        return Crossings(
            cable=np.vstack([*cable, *(np.array([knot.cable]) for knot in self.knots)]).astype(np.int64),
            s=np.vstack([*s, *(np.array([knot.s]) for knot in self.knots)]),
            kind=np.concatenate([np.full(count, int(SelfTouch.CONTACT)), np.full(more, int(SelfTouch.BOND))]),
            normal=np.vstack([*(found.normal for found in self.near), *([UP] * more)]),
            distance=np.concatenate([*distance, np.zeros(more)]),
            force=np.vstack([*force, *(knot.force for knot in self.knots)]),
            arm=np.vstack([*(rows.arm for rows in rubbing), *(knot.arm.reshape(1, 6) for knot in self.knots)]),
            mu=np.concatenate([*(rows.mu for rows in rubbing), np.zeros(more)]),
            held=np.vstack([*(rows.s for rows in rubbing), np.zeros((more, 2))]),
            drag=np.vstack([*(rows.drag for rows in rubbing), np.zeros((more, 3))]),
        )

    def after(self, asked: Crossings | None, reactions: CrossingReactions | None) -> Crossed:
        """With what the shape server's answer says of the rows that it was asked about."""
        if asked is None or reactions is None:
            return replace(self, pushes=NOTHING, drags=NO_DRAGS, held=self.held.hears(None, None))
        on = np.flatnonzero((reactions.force != 0.0).any(axis=1))
        pushes = CablePoints(cable=asked.cable[on], s=reactions.s[on], point=reactions.point[on], force=reactions.force[on])
        first = len(asked.kind) - len(self.knots)
        knots = tuple(replace(knot, force=reactions.force[first + k]) for k, knot in enumerate(self.knots))
        return replace(self, knots=knots, pushes=pushes, drags=reactions.drag[on], held=self.held.hears(asked, reactions))

    def is_settled(self, asked: Crossings | None, shapes: Sequence[Shape]) -> bool:
        """Whether no two cables are in each other but where the server was asked to keep them apart, on the side where they were."""
        for pair, found in zip(self.pairs, self.near, strict=True):
            cell, place, normal = np.zeros(0), np.zeros((0, 2)), np.zeros((0, 3))
            if asked is not None:
                own = (asked.cable == (pair.first, pair.second)).all(axis=1) & (asked.kind == SelfTouch.CONTACT)
                place, normal = _places(asked.s[own], shapes, pair), asked.normal[own]
                cell = np.round(place[:, 0])
            if not all_have_rows(found, cell, place, normal):
                return False
        return True

    def free_share(self, moved: Sequence[np.ndarray], ways: Sequence[Way | None]) -> float:
        """Share of the way, by `moved` (n-1,) [m] for every segment of each cable, that surely takes no cable through another.

        Infinite if all of the way does, as `ways` may tell.
        """
        share = np.inf
        for pair, found in zip(self.pairs, self.near, strict=True):
            first, second = moved[pair.first], moved[pair.second]
            own = (found.clearance - 0.5 * pair.distance) / np.maximum(first + second.max(), 1e-12)
            other = (found.other_clearance - 0.5 * pair.distance) / np.maximum(second + first.max(), 1e-12)
            here = min(float(own.min()), float(other.min()))
            is_own = pair.first == pair.second
            if here < 1.0 and may_go(ways[pair.first], ways[pair.second], 0.5 * pair.distance, is_own=is_own):
                continue
            share = min(share, here)
        return share

    def accepted(self, cables: Sequence[Hanging]) -> Crossed:
        """With every push between places that stick turned into a knot, where none is near, and held where it now rubs; once settled."""
        shapes, knots = [cable.shape for cable in cables], list(self.knots)
        radii = [cable.boundary.radius for cable in cables]
        held = self.held.after(shapes, {(p.first, p.second): p.share for p in self.pairs}) if any(p.mu for p in self.pairs) else NOT_YET
        acting = zip(self.pushes.cable.tolist(), self.pushes.s.tolist(), self.pushes.force, strict=True)
        pushes = [(tuple(pair), tuple(s), force) for pair, s, force in acting]
        pushes = [push for push in pushes if any(p.sticks and (p.first, p.second) == push[0] for p in self.pairs)]
        for index in self.sticking:
            own = shapes[index].self_reactions
            places = () if own is None else zip(own.s.tolist(), own.force, strict=True)
            pushes += [((index, index), tuple(s), force) for s, force in places if force.any()]
        for pair, s, force in pushes:
            size = [APART * float(np.diff(shapes[index].s).max()) for index in pair]
            if not any(k.cable == pair and all(abs(k.s[side] - s[side]) < size[side] for side in range(2)) for k in knots):
                knots.append(knot_at(pair, s, force, shapes, radii[pair[0]] / (radii[pair[0]] + radii[pair[1]])))
        return replace(self, knots=tuple(knots), held=held)

    def _knotted(self, first: int, second: int, shapes: Sequence[Shape] | Mapping[int, Shape]) -> np.ndarray:
        """Places (b, 2) [segments from the start] of the knots of two cables, or of one with itself."""
        knots = np.array([knot.s for knot in self.knots if knot.cable == (first, second)]).reshape(-1, 2)
        return np.column_stack([places_of(s, shapes[index].s) for s, index in zip(knots.T, (first, second), strict=True)])

    def _shared(self, pair: Pair, found: SelfCandidates, shapes: Sequence[Shape]) -> np.ndarray:
        """What pushed the pair in the last answer, on the rows of now."""
        own = (self.pushes.cable == (pair.first, pair.second)).all(axis=1)
        return handed_on(found, _places(self.pushes.s[own], shapes, pair), (self.pushes.force - self.drags)[own])


def crossed_of(cables: Sequence[Cable]) -> Crossed | None:
    """What there is to be looked for among the cables of a scene; None if all of them pass through each other."""
    kinds, both = [cable.self_interaction for cable in cables], (SelfInteraction.CONTACT, SelfInteraction.BOND)
    pairs = [Pair(i, i, cable.diameter, 0.5, False, cable.friction_coefficient or 0.0) for i, cable in enumerate(cables) if rubs(cable)]
    for (i, one), (j, other) in combinations(enumerate(cables), 2):
        if kinds[i] is kinds[j] and kinds[i] in both:
            both_radii = one.diameter + other.diameter
            mu = min(one.friction_coefficient or 0.0, other.friction_coefficient or 0.0)
            pairs.append(Pair(i, j, 0.5 * both_radii, one.diameter / both_radii, kinds[i] is SelfInteraction.BOND, mu))
    sticking = tuple(index for index, kind in enumerate(kinds) if kind is SelfInteraction.BOND)
    return Crossed(tuple(pairs), sticking) if pairs or sticking else None


def _arc_lengths(place: np.ndarray, shapes: Sequence[Shape], pair: Pair) -> np.ndarray:
    """Arc lengths (m, 2) [m] of places counted in segments."""
    sides = zip(place.T, (shapes[pair.first].s, shapes[pair.second].s), strict=True)
    return np.column_stack([np.interp(own, np.arange(len(s)), s) for own, s in sides])


def _places(arc_lengths: np.ndarray, shapes: Sequence[Shape], pair: Pair) -> np.ndarray:
    """Places (m, 2), counted in segments, of arc lengths [m]."""
    sides = zip(arc_lengths.T, (shapes[pair.first].s, shapes[pair.second].s), strict=True)
    return np.column_stack([places_of(own, s) for own, s in sides])
