"""Where strands and cables were held together by friction: what the friction of the next step starts from.

The shape server has no memory, so this is the history of friction between cables, as `anchors` is that of friction on bodies. After a step
has settled, of every two places that push each other and rub a point of each is held: the same two as before if they stick, so that they
never creep, and those that touch now if they slide. Places that did not touch before are held where they were at the end of the last step:
what they went until they touched counts as sliding, one step at most.

At the very first shape nothing has slid yet, so it is found without friction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from protocol.kinds import SelfTouch
from protocol.messages import CrossingReactions, Crossings, Shape

from .anchors import each_its_own
from .polyline import smooth_at

NEAR: Final = 0.45  # of a segment of each cable; held points this near to two places are theirs


@dataclass(frozen=True)
class Knot:
    """Two places that stick, of two cables or of one."""

    cable: tuple[int, int]
    s: tuple[float, float]  # m
    arm: np.ndarray  # (2, 3) m, from each axis to the common point, in the frame of its segment
    force: np.ndarray  # (3,) N, on the first


@dataclass(frozen=True)
class Rows:
    """Friction of some rows, as `Crossings` has it."""

    mu: np.ndarray  # (k,)
    s: np.ndarray  # (k, 2) m
    arm: np.ndarray  # (k, 6) m
    drag: np.ndarray  # (k, 3) N


@dataclass(frozen=True)
class Held:
    """Points that friction holds together, and where all cables were when they were held; a new value after every change."""

    points: tuple[Knot, ...] = ()
    past: tuple[Shape, ...] = ()  # empty before the first step has settled
    asked: Crossings | None = None  # what was asked last, and
    told: CrossingReactions | None = None  # what was told of it

    def rows(self, cable: tuple[int, int], share: float, mu: float, s: np.ndarray) -> Rows:
        """Friction of two cables at places of theirs.

        Args:
            cable: Their numbers, twice the same for the strands of one.
            share: Of both radii that of the first.
            mu: Coefficient of friction.
            s: (k, 2) [m] Arc lengths.
        """
        count = len(s)
        out = Rows(np.zeros(count), np.zeros((count, 2)), np.zeros((count, 6)), np.zeros((count, 3)))
        if not mu or not self.past:
            return out
        known = [point for point in self.points if point.cable == cable]
        own = _nearest(np.array([point.s for point in known]).reshape(-1, 2), s, [_spacing(self.past[index]) for index in cable])
        for row, (place, which) in enumerate(zip(s.tolist(), own.tolist(), strict=True)):
            knot = known[which] if which >= 0 else knot_at(cable, (place[0], place[1]), np.zeros(3), self.past, share)
            out.s[row], out.arm[row], out.drag[row] = knot.s, knot.arm.ravel(), knot.force
        out.mu[:] = mu
        return out

    def hears(self, asked: Crossings | None, told: CrossingReactions | None) -> Held:
        """With the last answer."""
        return replace(self, asked=asked, told=told)

    def after(self, shapes: Sequence[Shape], share: Mapping[tuple[int, int], float]) -> Held:
        """As they are held once a step has settled in these shapes; `share` of every pair as in `rows`."""
        points = []
        if self.asked is not None and self.told is not None:
            asked, told = self.asked, self.told
            for row in np.flatnonzero((asked.kind == SelfTouch.CONTACT) & (asked.mu > 0.0) & told.force.any(axis=1)).tolist():
                first, second = asked.cable[row].tolist()
                if told.is_sticking[row]:
                    places, arm = asked.held[row].tolist(), asked.arm[row].reshape(2, 3)
                    points.append(Knot((first, second), (places[0], places[1]), arm, told.drag[row]))
                else:
                    places = told.s[row].tolist()
                    own = share[first, second]
                    points.append(knot_at((first, second), (places[0], places[1]), told.drag[row], shapes, own, told.lag[row]))
        return Held(tuple(points), tuple(shapes))


NOT_YET: Final = Held()


def knot_at(
    cable: tuple[int, int], s: tuple[float, float], force: np.ndarray, shapes: Sequence[Shape], share: float, lag: np.ndarray | None = None
) -> Knot:
    """Two places that push each other, held together at the point between their surfaces.

    Args:
        cable: Their numbers.
        s: [m] Arc lengths.
        force: (3,) [N] On the first.
        shapes: Of all cables.
        share: Of both radii that of the first.
        lag: (3,) [m] From the point of the second to that of the first, if they are not one.
    """
    axes = [smooth_at(shapes[index], np.array([own]))[0] for index, own in zip(cable, s, strict=True)]
    point, arms = axes[0] + share * (axes[1] - axes[0]), []
    for index, own, axis, sign in zip(cable, s, axes, (0.5, -0.5), strict=True):
        shape = shapes[index]
        middles = 0.5 * (shape.s[1:] + shape.s[:-1])
        first = min(max(int(np.searchsorted(middles, own)) - 1, 0), len(middles) - 2)
        last = float(np.clip((own - middles[first]) / (middles[first + 1] - middles[first]), 0.0, 1.0))
        before, after = Rotation.from_quat(shape.frames[first : first + 2]).as_matrix()
        away = point - axis if lag is None else point - axis + sign * lag
        arms.append(np.linalg.solve((1.0 - last) * before + last * after, away))
    return Knot(cable, s, np.array(arms), force)


def _spacing(shape: Shape) -> float:
    """Longest segment [m]."""
    return float(np.diff(shape.s).max())


def _nearest(held: np.ndarray, s: np.ndarray, spacing: Sequence[float]) -> np.ndarray:
    """Which held points (a, 2) [m] are those of every place (k, 2) [m], -1 for none."""
    if not len(held) or not len(s):
        return np.full(len(s), -1, dtype=np.int64)
    return each_its_own((np.abs(s[:, None] - held[None]) / np.array(spacing)).max(axis=2), NEAR)
