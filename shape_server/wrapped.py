"""A cable without bending that lies round thick bodies without friction: catenaries, and between them arcs that a body pushes all along.

Where the cable lifts off an arc (`arcs`) nothing jumps: it goes on along its tangent, with the same force. Four numbers say an arc: the
place on the surface where it begins (two), the arc length of the cable there, and how long it is. Four equations fit them: the piece
before ends along the surface, and the force that ends the arc is the one that the next piece begins with. They are solved by Newton's
method with differences, from sharp bends or straight lines, and where that fails for a shorter cable first, which is lengthened.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from .arc_starts import rounded, started
from .arcs import Arc, Laid, lie, place_of
from .catenary import Piece, hang
from .slides import Bend, Hold, Slide

NEWTON_MAX: Final = 40
BALANCED: Final = 1e-10  # of the weight
DIFFERENCE: Final = 1e-7  # of the length
FARTHEST: Final = 0.1  # of the length, that one step may move an arc
LEAST_SHARE: Final = 1e-3  # of what the cable is longer than the way round
STUCK: Final = 0.99  # from one step to the next, when it does not converge
LEAST_GROWTH: Final = 1.02
TIGHT: Final = 0.5  # of the slack beside an arc that one step may take away


@dataclass(frozen=True, eq=False)
class Wrapped:
    """Held points and arcs in order, with the catenaries between them."""

    stops: tuple[Hold | Arc, ...]
    pieces: tuple[Piece, ...]
    arcs: tuple[Laid, ...]
    missing: np.ndarray  # (4 k,) what the equations lack: angles [rad], and the logarithm of the ratio of two tensions
    unbalanced: float  # of the weight, largest part of a force that is not met


def wrap(stops: tuple[Hold | Slide, ...], load: np.ndarray, bends: Sequence[Bend] | None = None) -> Wrapped | str:
    """The shape over contacts that all push; or why there is none.

    Args:
        stops: Held points and contacts, in order.
        load: (3,) [N/m] Weight.
        bends: Of a cable that bends sharply at every contact, to start from; without them it starts from straight lines.
    """
    begun = started(stops) if bends is None else rounded(stops, bends)
    if isinstance(begun, str):
        return begun
    found = _balance(begun, load)
    ways, share = _spans(found, 0.0), 1.0
    spans = [b - a for a, b in pairwise(stop.s for stop in stops if isinstance(stop, Hold))]

    def lengths(share: float) -> list[float]:
        return [way + share * (span - way) for way, span in zip(ways, spans, strict=True)]

    first, found = found, _settled(begun, load)
    while not _is_settled(found) and share > LEAST_SHARE:  # with less to spare it is nearer to the straight lines that it starts from
        share *= 0.25
        found = _settled(_with_lengths(first, lengths(share)), load)
    growth = 2.0
    while _is_settled(found) and share < 1.0 and growth > LEAST_GROWTH:
        tried = _settled(_with_lengths(found, lengths(min(growth * share, 1.0))), load)
        if _is_settled(tried):
            found, share = tried, min(growth * share, 1.0)
        else:
            growth = math.sqrt(growth)
    return found if _is_settled(found) and share == 1.0 else "the arcs in which it lies round what it touches do not settle"


def _is_settled(found: Wrapped) -> bool:
    return found.unbalanced < BALANCED


def _settled(stops: tuple[Hold | Arc, ...], load: np.ndarray) -> Wrapped:
    """As near to balance as Newton's method comes."""
    found = _balance(stops, load)
    count, length = len(found.arcs), stops[-1].s - stops[0].s
    for _ in range(NEWTON_MAX):
        if _is_settled(found):
            break
        size = DIFFERENCE * length
        columns = []
        for column in range(4 * count):
            step = np.zeros(4 * count)
            step[column] = size
            columns.append(
                (_balance(_moved(found.stops, step), load).missing - _balance(_moved(found.stops, -step), load).missing) / (2 * size)
            )
        step = -np.linalg.lstsq(np.column_stack(columns), found.missing, rcond=1e-12)[0]
        step *= min(1.0, FARTHEST * length / max(float(np.abs(step).max()), 1e-300))
        better = _better(found, step, load)
        stuck = better is None or np.linalg.norm(better.missing) > STUCK * np.linalg.norm(found.missing)
        found = better or found
        if stuck:
            break
    return found


def _spans(found: Wrapped, share: float) -> list[float]:
    """Lengths [m] between held points: of chords and arcs, and a share of what the cable is longer."""
    out: list[float] = []
    for before, arc, chord, more in _legs(found):
        if isinstance(before, Hold):
            out.append(0.0)
        out[-1] += arc + chord + share * more
    return out


def _with_lengths(found: Wrapped, lengths: list[float]) -> tuple[Hold | Arc, ...]:
    """With other lengths [m] between held points: what the pieces are longer than their chords is scaled."""
    ways, spare = _spans(found, 0.0), _spans(found, 1.0)
    out: list[Hold | Arc] = [found.stops[0]]
    s, span = found.stops[0].s, -1
    for (before, arc, chord, more), after in zip(_legs(found), found.stops[1:], strict=True):
        span += isinstance(before, Hold)
        s += arc + chord + (lengths[span] - ways[span]) / max(spare[span] - ways[span], 1e-300) * more
        out.append(replace(after, s=s))
    return tuple(out)


def _legs(found: Wrapped) -> Iterator[tuple[Hold | Arc, float, float, float]]:
    """Every stop but the last, its arc, the chord of the piece after it, and what that is longer [m]."""
    for (before, after), piece in zip(pairwise(found.stops), found.pieces, strict=True):
        arc = before.length if isinstance(before, Arc) else 0.0
        chord = float(np.linalg.norm(piece.nodes[-1] - piece.nodes[0]))
        yield before, arc, chord, max(after.s - before.s - arc - chord, 0.0)


def _better(found: Wrapped, step: np.ndarray, load: np.ndarray) -> Wrapped | None:
    """The step, or as much of it as leaves every piece long enough and the equations more nearly met."""
    share, before = 1.0, float(np.linalg.norm(found.missing))
    for _ in range(40):
        stops = _moved(found.stops, share * step)
        if _is_long_enough(stops):
            tried = _balance(stops, load)
            if _is_long_enough(stops, tried) and float(np.linalg.norm(tried.missing)) < before:
                return tried
        share *= TIGHT
    return None


def _is_long_enough(stops: tuple[Hold | Arc, ...], laid: Wrapped | None = None) -> bool:
    """Whether every arc and every piece has a length that reaches."""
    arcs = iter(laid.arcs if laid is not None else ())
    left: np.ndarray | None = None
    for before, after in pairwise(stops):
        if isinstance(before, Arc):
            if before.length <= 0.0:
                return False
            left = next(arcs).nodes[-1] if laid is not None else None
        place = before.place if isinstance(before, Hold) else left
        span = after.s - (before.s + before.length if isinstance(before, Arc) else before.s)
        end = after.place if isinstance(after, Hold) else after.begin
        if span <= 0.0 or (place is not None and float(np.linalg.norm(end - place)) >= span):
            return False
    return True


def _moved(stops: tuple[Hold | Arc, ...], step: np.ndarray) -> tuple[Hold | Arc, ...]:
    out: list[Hold | Arc] = []
    arc = 0
    for stop in stops:
        if isinstance(stop, Arc):
            out.append(stop.moved(step[4 * arc : 4 * arc + 4]))
            arc += 1
        else:
            out.append(stop)
    return tuple(out)


def _balance(stops: tuple[Hold | Arc, ...], load: np.ndarray) -> Wrapped:
    """Pieces and arcs as the numbers have them, and what the equations lack."""
    weight = float(np.linalg.norm(load)) * (stops[-1].s - stops[0].s)
    pieces: list[Piece] = []
    arcs: list[Laid] = []
    missing: list[float] = []
    unbalanced = 0.0
    place, s = place_of(stops[0]), stops[0].s
    ended: Laid | None = None
    for stop in stops[1:]:
        end = place_of(stop)
        span = max(stop.s - s, 1e-9 * weight / float(np.linalg.norm(load)))
        piece = hang(place, end, max(span, float(np.linalg.norm(end - place))), load, np.array([0.0, span]))
        pieces.append(piece)
        if ended is not None:
            missing += _apart(ended.force[-1], -piece.start_force, ended.normal[-1])
            unbalanced = max(unbalanced, float(np.abs(ended.force[-1] + piece.start_force).max()) / weight)
        ended = None
        if isinstance(stop, Arc):
            inward = float(piece.end_force @ stop.normal)
            missing.append(inward / max(float(np.linalg.norm(piece.end_force)), 1e-300))
            unbalanced = max(unbalanced, abs(inward) / weight)
            ended = lie(stop, piece.end_force, load)
            arcs.append(ended)
            place, s = ended.nodes[-1], stop.s + stop.length
        else:
            place, s = end, stop.s
    return Wrapped(stops, tuple(pieces), tuple(arcs), np.array(missing), unbalanced)


def _apart(one: np.ndarray, other: np.ndarray, normal: np.ndarray) -> list[float]:
    """By how much two forces (3,) [N], the first square to a normal, differ: the logarithm of their ratio, and two angles [rad].

    A taut piece's tension goes up without bound as its slack goes down, by its logarithm evenly enough for Newton's method.
    """
    sizes = [max(float(np.linalg.norm(force)), 1e-300) for force in (one, other)]
    tangent = one / sizes[0]
    ahead, up, aside = (float(other @ axis) for axis in (tangent, normal, np.cross(tangent, normal)))
    return [math.log(sizes[0] / sizes[1]), math.atan2(up, ahead), math.atan2(aside, ahead)]
