"""A cable without bending over points and edges: catenaries between held points and the places where it slides over a body.

Without friction the tension is the same on both sides of a contact, and the push bisects its angle:

    T_before = T_after = T,   F = T (t_before - t_after)   [N],   |F| = 2 T sin(theta / 2)

with t the tangents and theta the turn of the cable. Moving ds of material through the contact changes the energy of both pieces by
(T_after - T_before) ds, and moving the contact by du along its edge e changes it by F.e du: the equilibrium is a minimum of the energy
over these numbers, found by Newton's method downhill from where the contacts were. A cable may have several: one piece that takes all
the slack while the other is almost straight is another minimum than two that share it, and which of them is found is a matter of history
(Fig. 5 of the paper).

The cable bends sharply at a contact, D / cos(theta / 2) away from the point, so that both pieces pass it at D, the distance asked
for. Rounding the bend off would save D (2 tan(theta / 2) - theta) of length; that is the error reported for it. Faces without
friction carry a cable along a whole length, and are not built here. Contacts are one-sided: one that would pull is let go, one
that is passed through is taken up, the worst first.

Source: Irvine 1981, "Cable structures", ch. 1, for the pieces; the energies by differentiation, checked by differences in the tests.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from protocol.messages import Problem

from .catenary import Piece, hang, hang_elastic
from .rounding import Refusal, too_short
from .slides import Bend, Hold, Slide

ROUNDS_MAX: Final = 40
STEPS_MAX: Final = 60
BALANCED: Final = 1e-12  # of the weight; tensions that differ by less are the same
CAREFUL: Final = 0.4  # of the slack beside a contact that one step may take away
FARTHEST: Final = 0.1  # of the length, that one step may slide
NUDGE: Final = 1e-4  # of a piece, by which a contact that rests on a ridge of the energy is moved off it
PASSED: Final = 1e-9  # m by which a cable may be too near


@dataclass(frozen=True)
class Draped:
    """Pieces between held points and contacts, in order."""

    stops: tuple[Hold | Slide, ...]
    pieces: tuple[Piece, ...]

    def push(self, stop: int) -> np.ndarray:
        """Force (3,) [N] on the cable at a stop that is not the first or the last."""
        force: np.ndarray = self.pieces[stop - 1].end_force + self.pieces[stop].start_force
        return force

    @property
    def bends(self) -> list[Bend]:
        """At every contact, in order."""
        out = []
        for index, stop in enumerate(self.stops):
            if isinstance(stop, Slide):
                forces = self.pieces[index - 1].end_force, -self.pieces[index].start_force
                out.append(Bend(*(force / max(float(np.linalg.norm(force)), 1e-300) for force in forces)))
        return out

    @property
    def wound(self) -> float:
        """By how much longer a cable bends sharply about round bodies than it would lie round them [m]."""
        wound = 0.0
        for index, stop in enumerate(self.stops[1:-1], start=1):
            if isinstance(stop, Slide):
                tension = 0.5 * (self.pieces[index - 1].tension[-1] + self.pieces[index].tension[0])
                half = math.asin(min(0.5 * float(np.linalg.norm(self.push(index))) / max(tension, 1e-300), 1.0))
                wound += stop.distance * 2.0 * (math.tan(min(half, 1.5)) - half)
        return float(wound)

    def outward(self, stop: int) -> float:
        """What a contact pushes with [N], away from what it is about; negative where it pulls.

        The cable may have slid so far that its push has turned by more than a right angle, and still pass on the same hand.
        """
        slide, push = self.stops[stop], self.push(stop)
        assert isinstance(slide, Slide)
        before, after = self.pieces[stop - 1].end_force, -self.pieces[stop].start_force
        along = before / max(float(np.linalg.norm(before)), 1e-300) + after / max(float(np.linalg.norm(after)), 1e-300)
        own = slide.hand @ np.cross(along, push)
        size = float(np.linalg.norm(slide.hand) * np.linalg.norm(along))
        return float(own) / size if size > 1e-9 else float(push @ slide.normal)


def drape(holds: list[Hold], slides: list[Slide], problem: Problem, load: np.ndarray) -> Draped | Refusal:
    """The equilibrium over contacts that all push; or why there is none."""
    slides = [_between(slide, holds) for slide in slides]
    for _ in range(ROUNDS_MAX):
        refusal = too_short(in_order(holds, slides), problem)
        if refusal is not None:
            return refusal
        slides, draped = _balanced(holds, slides, problem, load)
        moved = 0.0
        for index, slide in enumerate(slides):
            bent = _bent(slide, draped)
            moved = max(moved, float(np.linalg.norm(bent.offset - slide.offset)))
            slides[index] = bent
        if moved < 1e-13 * problem.cable.length:
            break
    return draped


def gap(slide: Slide, nodes: np.ndarray, s: np.ndarray, reach: float) -> tuple[float, float]:
    """Least gap [m] of the polyline (n, 3) within `reach` [m] of arc length of where a contact was found, and its arc length."""
    best, where = np.inf, slide.s
    for segment in np.flatnonzero((s[1:] > slide.s - reach) & (s[:-1] < slide.s + reach)):
        start, chord = nodes[segment] - slide.point, nodes[segment + 1] - nodes[segment]
        start, across = (v - (v @ slide.direction) * slide.direction for v in (start, chord))
        share = min(max(-float(start @ across) / max(float(across @ across), 1e-300), 0.0), 1.0)
        away = start + share * across
        size = float(np.linalg.norm(away))
        signed = size if away @ slide.normal >= -0.5 * size else -size
        if signed - slide.distance < best:
            best, where = signed - slide.distance, float(s[segment] + share * (s[segment + 1] - s[segment]))
    return best, where


def _between(slide: Slide, holds: list[Hold]) -> Slide:
    """A contact kept a little off the held points beside it."""
    below = max((hold.s for hold in holds if hold.s <= slide.s), default=holds[0].s)
    above = min((hold.s for hold in holds if hold.s > below), default=holds[-1].s)
    margin = 1e-3 * (above - below)
    return replace(slide, s=min(max(slide.s, below + margin), above - margin))


def in_order(holds: list[Hold], slides: list[Slide]) -> tuple[Hold | Slide, ...]:
    """What holds the cable and what it slides over, along the cable."""
    return tuple(sorted([*holds, *slides], key=lambda stop: stop.s))


def _pieces(stops: tuple[Hold | Slide, ...], problem: Problem, load: np.ndarray) -> Draped:
    pieces, stretch = [], problem.cable.stretch
    for before, after in pairwise(stops):
        span = after.s - before.s
        ends = (before.place, after.place, span, load)
        own = np.array([0.0, span])
        pieces.append(hang(*ends, own) if stretch is None else hang_elastic(*ends, stretch, own))
    return Draped(stops, tuple(pieces))


def _balanced(holds: list[Hold], slides: list[Slide], problem: Problem, load: np.ndarray) -> tuple[list[Slide], Draped]:
    """Slide the contacts downhill until the tensions on both sides of each are the same."""
    weight = float(np.linalg.norm(load)) * problem.cable.length
    slides = _with_slack(holds, slides)
    slope, draped = _slope(holds, slides, problem, load)
    for step_count in range(STEPS_MAX):
        is_still = float(np.abs(slope).max(initial=0.0)) < BALANCED * weight
        curvature = _curvature(holds, slides, problem, load)
        values, vectors = np.linalg.eigh(curvature)
        if is_still and (not len(values) or values[0] > 0.0 or step_count == STEPS_MAX - 1):
            break
        size = np.maximum(np.abs(values), 1e-9 * np.abs(values).max())
        step = -vectors @ ((vectors.T @ slope) / size)
        if is_still:  # on a ridge: the fall on its two sides may differ, so always to the same one
            step = NUDGE * (problem.cable.length / len(values)) * vectors[:, 0] * (1.0 if vectors[0, 0] >= 0.0 else -1.0)
        step *= min(1.0, _room(holds, slides, step), FARTHEST * problem.cable.length / max(float(np.abs(step).max()), 1e-300))
        for _ in range(30):
            tried = _stepped(slides, step)
            new_slope, new = _slope(holds, tried, problem, load)
            # Still downhill, or less steep beyond the bottom than before it.
            if is_still or float(new_slope @ step) <= -0.9 * float(slope @ step):
                break
            step *= 0.5
        else:
            break
        slides, slope, draped = tried, new_slope, new
    return slides, draped


def _slope(holds: list[Hold], slides: list[Slide], problem: Problem, load: np.ndarray) -> tuple[np.ndarray, Draped]:
    """Derivative of the energy [N] by every contact's place along the cable, then along its edge."""
    draped = _pieces(in_order(holds, slides), problem, load)
    out = np.zeros(2 * len(slides))
    for index, slide in enumerate(slides):
        stop = draped.stops.index(slide)
        out[index] = draped.pieces[stop].tension[0] - draped.pieces[stop - 1].tension[-1]
        is_free = slide.extent[0] < slide.along < slide.extent[1]
        out[len(slides) + index] = draped.push(stop) @ slide.direction if is_free else 0.0
    return out, draped


def _curvature(holds: list[Hold], slides: list[Slide], problem: Problem, load: np.ndarray) -> np.ndarray:
    """Second derivatives of the energy [N/m], by central differences; one for a contact that has no edge to slide along."""
    count = 2 * len(slides)
    out = np.zeros((count, count))
    for column in range(count):
        step = np.zeros(count)
        step[column] = 1e-6 * problem.cable.length * min(1.0, _room(holds, slides, np.eye(count)[column]))
        step[column] = max(step[column], 1e-12 * problem.cable.length)
        high, low = (_slope(holds, _stepped(slides, sign * step), problem, load)[0] for sign in (1.0, -1.0))
        out[:, column] = (high - low) / (2.0 * step[column])
    for index, slide in enumerate(slides):
        if not slide.direction.any() or not slide.extent[0] < slide.along < slide.extent[1]:
            out[len(slides) + index, len(slides) + index] = 1.0
    return 0.5 * (out + out.T)


def _stepped(slides: list[Slide], step: np.ndarray) -> list[Slide]:
    moved = []
    for index, slide in enumerate(slides):
        along = slide.along
        if slide.direction.any():
            along = min(max(slide.along + step[len(slides) + index], slide.extent[0]), slide.extent[1])
        moved.append(replace(slide, s=slide.s + step[index], along=float(along)))
    return moved


def _room(holds: list[Hold], slides: list[Slide], step: np.ndarray) -> float:
    """Share of a step that leaves every piece longer than the distance of its ends."""
    stops, after = in_order(holds, slides), _stepped(slides, step)
    share = np.inf
    moved = [after[slides.index(stop)] if isinstance(stop, Slide) else stop for stop in stops]
    for (a, b), (a2, b2) in zip(pairwise(stops), pairwise(moved), strict=True):
        slack = (b.s - a.s) - float(np.linalg.norm(b.place - a.place))
        lost = slack - (b2.s - a2.s) + float(np.linalg.norm(b2.place - a2.place))
        if lost > 0.0:
            share = min(share, CAREFUL * max(slack, 0.0) / lost)
    return float(share)


def _with_slack(holds: list[Hold], slides: list[Slide]) -> list[Slide]:
    """Contacts moved along the cable where a piece beside them would be longer than its cable."""
    slides = list(slides)
    for _ in range(4 * len(slides)):
        stops = in_order(holds, slides)
        slack = [b.s - a.s - float(np.linalg.norm(b.place - a.place)) for a, b in pairwise(stops)]
        worst = int(np.argmin(slack)) if slack else 0
        if not slack or slack[worst] > 0.0:
            break
        sides = [
            (slack[other], stop, sign)
            for other, stop, sign in ((worst - 1, worst, -1.0), (worst + 1, worst + 1, 1.0))
            if 0 <= other < len(slack) and isinstance(stops[stop], Slide)
        ]
        if not sides:
            break
        spare, stop, sign = max(sides, key=lambda side: side[0])
        own = stops[stop]
        assert isinstance(own, Slide)
        slides[slides.index(own)] = replace(own, s=own.s + sign * (1e-3 * max(spare + slack[worst], 0.0) - slack[worst]))
    return slides


def _bent(slide: Slide, draped: Draped) -> Slide:
    """The contact with the bend where both pieces pass it at its distance."""
    stop = next(index for index, other in enumerate(draped.stops) if isinstance(other, Slide) and other.rows is slide.rows)
    tangents = []
    for force in (draped.pieces[stop - 1].end_force, -draped.pieces[stop].start_force):
        across = force - (force @ slide.direction) * slide.direction
        tangents.append(across / max(float(np.linalg.norm(across)), 1e-300))
    push = tangents[0] - tangents[1]
    size = float(np.linalg.norm(push))  # 2 sin(theta / 2)
    if size < 1e-9:
        return replace(slide, offset=slide.distance * slide.normal)
    cosine = max(float(np.sqrt(max(1.0 - 0.25 * size * size, 0.0))), 0.1)
    return replace(slide, offset=slide.distance / cosine * push / size)
