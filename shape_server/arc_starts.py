"""Arcs to start from: sharp bends rounded off, or straight lines from body to body."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from .arcs import Arc, place_of, unit
from .slides import Bend, Hold, Slide

ROUNDS: Final = 20  # in which straight lines find their bodies


def rounded(stops: tuple[Hold | Slide, ...], bends: Sequence[Bend]) -> tuple[Hold | Arc, ...] | str:
    """Sharp bends rounded off; or why the cable is too short."""
    out: list[Hold | Arc] = []
    leaves: list[np.ndarray] = []
    own = iter(bends)
    for stop in stops:
        if isinstance(stop, Hold):
            out.append(stop)
            leaves.append(stop.place)
            continue
        d, bend = stop.direction, next(own)
        first, last = (unit(tangent - (tangent @ d) * d) for tangent in bend)
        turn = math.atan2(float(np.linalg.norm(np.cross(first, last))), float(first @ last))
        normals = [
            unit((first - last) - ((first - last) @ t) * t) if turn > 1e-6 else unit(stop.normal - (stop.normal @ d) * d)
            for t in (first, last)
        ]
        length = stop.distance * max(turn, 1e-3)
        out.append(Arc(stop, normals[0], stop.along, stop.s - 0.5 * length, length))
        leaves.append(stop.point + stop.along * d + stop.distance * normals[1])
    return _shared_out(out, leaves)


def started(stops: tuple[Hold | Slide, ...]) -> tuple[Hold | Arc, ...] | str:
    """Straight lines from body to body and arcs between them; or why the cable is too short."""
    enters = [_place_of(stop) for stop in stops]
    leaves = list(enters)
    for _ in range(ROUNDS):
        for k, stop in enumerate(stops):
            if isinstance(stop, Slide):
                enters[k], leaves[k] = _tangent(stop, leaves[k - 1], enters[k + 1]), _tangent(stop, enters[k + 1], leaves[k - 1])
                if float((leaves[k] - enters[k]) @ (enters[k] - leaves[k - 1])) <= 0.0:  # straight lines do not lie on it
                    enters[k] = leaves[k] = _place_of(stop)
    out: list[Hold | Arc] = []
    for stop, enter, leave in zip(stops, enters, leaves, strict=True):
        if isinstance(stop, Hold):
            out.append(stop)
            continue
        length = max(_arc_length(stop, enter, leave), 1e-3 * stop.distance)
        along = float((enter - stop.point) @ stop.direction)
        normal = enter - stop.point - along * stop.direction
        out.append(Arc(stop, unit(normal), along, stop.s - 0.5 * length, length))
    return _shared_out(out, leaves)


def _shared_out(stops: list[Hold | Arc], leaves: list[np.ndarray]) -> tuple[Hold | Arc, ...] | str:
    """The arcs where they are along the cable, or, where that leaves a piece too short, what the cable is longer shared out in proportion.

    Of several equilibria history decides: that is why an arc stays about where the cable touched.
    """
    out = list(stops)
    held = [k for k, stop in enumerate(stops) if isinstance(stop, Hold)]
    for first, last in pairwise(held):
        legs = [float(np.linalg.norm(place_of(stops[k + 1]) - leaves[k])) for k in range(first, last)]
        arcs = [stop.length for stop in stops[first + 1 : last] if isinstance(stop, Arc)]
        span, way = stops[last].s - stops[first].s, sum(legs) + sum(arcs)
        if way >= span:
            return f"the way round what it touches is {way:.6g} m, and its cable there {span:.6g} m"
        begins = [stop.s for stop in stops[first + 1 : last]]
        ends = [stops[first].s, *(s + arc for s, arc in zip(begins, arcs, strict=True))]
        if all(after - before > leg for before, after, leg in zip(ends, [*begins, stops[last].s], legs, strict=True)):
            continue
        s = stops[first].s
        for k, leg, arc in zip(range(first + 1, last), legs, arcs, strict=False):
            s += leg * (span - sum(arcs)) / sum(legs)
            out[k] = replace(stops[k], s=s)
            s += arc
    return tuple(out)


def _place_of(stop: Hold | Slide) -> np.ndarray:
    return stop.place if isinstance(stop, Hold) else stop.point + stop.distance * stop.normal


def _tangent(slide: Slide, away: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Where the straight line from a place touches the body, on the side of its normal and towards another place."""
    d = slide.direction
    arm, further = ((place - slide.point) - ((place - slide.point) @ d) * d for place in (away, other))
    size = float(np.linalg.norm(arm))
    if size <= slide.distance:
        normal = slide.normal - (slide.normal @ d) * d
    else:
        first = arm / size
        second = slide.normal - (slide.normal @ first) * first - (slide.normal @ d) * d
        if float(np.linalg.norm(second)) < 1e-9:
            second = further - (further @ first) * first
        second = second / max(float(np.linalg.norm(second)), 1e-300)
        cosine = slide.distance / size
        normal = cosine * first + math.sqrt(1.0 - cosine**2) * second
    low, high = float((away - slide.point) @ d), float((other - slide.point) @ d)
    lengths = math.sqrt(max(size**2 - slide.distance**2, 0.0)), float(np.linalg.norm(further)) + slide.distance
    along = low + (high - low) * lengths[0] / max(sum(lengths), 1e-300)
    touch: np.ndarray = slide.point + along * d + slide.distance * normal / np.linalg.norm(normal)
    return touch


def _arc_length(slide: Slide, enter: np.ndarray, leave: np.ndarray) -> float:
    d = slide.direction
    first, last = ((place - slide.point) - ((place - slide.point) @ d) * d for place in (enter, leave))
    cosine = float(first @ last) / slide.distance**2
    return math.hypot(slide.distance * math.acos(min(max(cosine, -1.0), 1.0)), float((leave - enter) @ d))
