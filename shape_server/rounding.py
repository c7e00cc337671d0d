"""What a sharp bend about a round body costs: a cable without bending passes at D in two straight pieces what it could lie round.

The shortest way from a to b round a circle of radius D about p is two tangents and an arc. In the plane square to the edge that the body
is about (or that of a, p and b, about a point), with g the angle from a over the cable's side to b as seen from p,

    l = sqrt(|a|^2 - D^2) + sqrt(|b|^2 - D^2) + D (g - acos(D / |a|) - acos(D / |b|)),

and with h the way along the edge, sqrt(l^2 + h^2) on the developed surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from protocol.kinds import Outcome
from protocol.messages import Problem

from .slides import Hold, Slide


@dataclass(frozen=True)
class Refusal:
    """Why there is no shape."""

    outcome: Outcome
    sentence: str


def too_short(stops: tuple[Hold | Slide, ...], problem: Problem) -> Refusal | None:
    """Why the pieces do not reach from held point to held point over what lies between; None if they do."""
    held = [index for index, stop in enumerate(stops) if isinstance(stop, Hold)]
    for first, last in pairwise(held):
        way = sum(float(np.linalg.norm(b.place - a.place)) for a, b in pairwise(stops[first : last + 1]))
        span = stops[last].s - stops[first].s
        if way <= span * (1 + 1e-12) or problem.cable.stretch is not None:
            continue
        least = _rounded(stops[first : last + 1], way)
        if least <= span:
            sentence = (
                f"between s = {stops[first].s:.4g} m and {stops[last].s:.4g} m the cable, {span:.6g} m, is long enough only if it lies "
                f"round what it touches ({least:.6g} m), not for the sharp bend of a cable without bending ({way:.6g} m); "
                "give it 'bending' and 'twist'"
            )
            return Refusal(Outcome.UNSUPPORTED, sentence)
        over = f", over {last - first - 1} contacts between them" if last - first > 1 else ""
        sentence = (
            f"the points held at s = {stops[first].s:.4g} m and {stops[last].s:.4g} m are {least:.6g} m apart{over}, "
            f"further than the {span:.6g} m of cable between them"
        )
        return Refusal(Outcome.UNREACHABLE, sentence)
    return None


def _rounded(stops: tuple[Hold | Slide, ...], way: float) -> float:
    """The way [m] over the contacts of one piece between held points, laid round each of them."""
    if len(stops) != 3 or not isinstance(stops[1], Slide):
        return way
    over = stops[1]
    return shortest(stops[0].place, stops[2].place, over.point, over.direction, over.normal, over.distance)


def shortest(start: np.ndarray, end: np.ndarray, point: np.ndarray, direction: np.ndarray, normal: np.ndarray, distance: float) -> float:
    """Length [m] of the shortest way round, or of the straight line if that passes.

    Args:
        start: (3,) [m].
        end: (3,) [m].
        point: (3,) [m] On the edge, or the point.
        direction: (3,) Unit along the edge; zero for a point.
        normal: (3,) Unit, to the side on which the cable passes.
        distance: [m] D.
    """
    a, b = (place - point - ((place - point) @ direction) * direction for place in (start, end))
    sizes, side = (float(np.linalg.norm(a)), float(np.linalg.norm(b))), normal - (normal @ direction) * direction
    angles = [
        float(np.arccos(np.clip(arm @ side / max(size * float(np.linalg.norm(side)), 1e-300), -1.0, 1.0)))
        for arm, size in zip((a, b), sizes, strict=True)
    ]
    chord, along = float(np.linalg.norm(b - a)), float((end - start) @ direction)
    if min(sizes) <= distance:
        return float(np.hypot(chord, along))
    arc = sum(angles) - sum(float(np.arccos(distance / size)) for size in sizes)
    across = chord if arc <= 0.0 else sum(float(np.sqrt(size**2 - distance**2)) for size in sizes) + distance * arc
    return float(np.hypot(across, along))
