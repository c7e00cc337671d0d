"""Where one cable meets itself, as boundary conditions: which places are handed to the shape server, and when they have settled.

Every place within reach is a one-sided row; the server decides which push. The side on which one strand lies of the other is the one
in the last shape that settled, and no step may take two strands through each other (`free_share`), so that it never flips.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from protocol.kinds import SelfInteraction, SelfTouch
from protocol.messages import SelfContacts, SelfReactions, Shape
from protocol.scene import Cable

from .self_touch import SelfCandidates, search

DEPTH_OK: Final = 2e-6  # m; deeper, and the boundary conditions are evaluated again
NEAR: Final = 6.0  # radii, gap within which places are handed to the shape server
SAME_PLACE: Final = 1.6  # segments; a push as near to a row at both places says the same
AT_KNOT: Final = 1.5  # segments; a place as near to a knot, on both strands, is that of the knot
SAME_SIDE: Final = -0.5  # cosine; a normal may turn by up to 120 degrees in one step
NO_REACTIONS: Final = SelfReactions(s=np.zeros((0, 2)), force=np.zeros((0, 3)), gap=np.zeros(0))


@dataclass(frozen=True)
class Meeting:
    """Where a cable is near itself in one shape, and what it did to itself there."""

    radius: float  # m
    candidates: SelfCandidates
    reactions: SelfReactions

    def beside(self, knots: np.ndarray) -> Meeting:
        """Without the places at knots (b, 2) [segments from the start]."""
        return replace(self, candidates=beside(self.candidates, knots))

    def contacts(self, s: np.ndarray) -> SelfContacts | None:
        """The rows to ask the shape server about; None if no two places are within reach.

        Args:
            s: (n,) [m] Arc length of the nodes that the candidates refer to.
        """
        found = self.candidates
        if not len(found.gap):
            return None
        return SelfContacts(
            s=np.interp(found.place, np.arange(len(s)), s),
            kind=np.full(len(found.gap), int(SelfTouch.CONTACT)),
            normal=np.array(found.normal),
            distance=np.full(len(found.gap), 2.0 * self.radius),
            force=handed_on(found, places_of(self.reactions.s, s), self.reactions.force),
        )

    def is_settled(self, asked: SelfContacts | None, shape: Shape) -> bool:
        """Whether every place where strands are in each other had a row of its cell, and none is on the other side of it.

        The server's axis is smooth, and runs by up to kappa h^2 / 8 inside the polygon that is searched here, on both strands: with a row
        they may seem to be in each other by that.
        """
        if asked is None:
            return bool((self.candidates.gap >= -DEPTH_OK).all())
        cell, rows = np.round(places_of(asked.s[:, 0], shape.s)), places_of(self.reactions.s, shape.s)
        return all_have_rows(self.candidates, cell, rows, asked.normal)

    def free_share(self, moved: np.ndarray) -> float:
        """Share of the way, by `moved` (n-1,) [m] for every segment, that surely takes no two strands through each other."""
        return float(((self.candidates.clearance - self.radius) / np.maximum(moved + moved.max(), 1e-12)).min())


def meet(cable: Cable, shape: Shape, room: float) -> Meeting | None:
    """Where a cable is near itself; None for a cable that does not care, or that rubs on itself (`crossed`).

    Args:
        cable: Which one.
        shape: With what it did to itself.
        room: [m] Gap up to which it may move without a look; places within `NEAR` radii are handed to the shape server.
    """
    if cable.self_interaction not in (SelfInteraction.CONTACT, SelfInteraction.BOND) or rubs(cable):
        return None
    radius = 0.5 * cable.diameter
    reactions = shape.self_reactions if shape.self_reactions is not None else NO_REACTIONS
    return Meeting(radius, search(shape.nodes, shape.s, radius, NEAR * radius, max(room, NEAR * radius)), reactions)


def rubs(cable: Cable) -> bool:
    """Whether its strands rub on each other."""
    return cable.self_interaction is SelfInteraction.CONTACT and bool(cable.friction_coefficient)


def beside(found: SelfCandidates, knots: np.ndarray) -> SelfCandidates:
    """The places that are not those of knots (b, 2) [segments from the start], which hold the surfaces together and apart."""
    if not len(knots):
        return found
    free = np.abs(found.place[:, None] - knots[None]).max(axis=2).min(axis=1) > AT_KNOT
    return replace(found, place=found.place[free], normal=found.normal[free], gap=found.gap[free])


def handed_on(found: SelfCandidates, places: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Forces (m, 3) [N] of places to start from: those (p, 3) [N] that acted at `places` (p, 2), each for the nearest place of now."""
    out = np.zeros((len(found.gap), 3))
    for row in np.flatnonzero((forces != 0.0).any(axis=1)).tolist() if len(out) else ():
        away = np.abs(found.place - places[row]).max(axis=1)
        nearest = int(np.argmin(np.where(found.normal @ forces[row] > 0.0, away, np.inf)))
        if away[nearest] < SAME_PLACE:
            out[nearest] += np.linalg.norm(forces[row]) * found.normal[nearest]
    return out


def all_have_rows(found: SelfCandidates, cell: np.ndarray, rows: np.ndarray, normal: np.ndarray) -> bool:
    """Whether every place where strands are in each other had a row of its cell, and none is on the other side of it.

    Args:
        found: Places.
        cell: (k,) Of the rows.
        rows: (k, 2) Where their places have slid to.
        normal: (k, 3) With which they were asked about.
    """
    for place in np.flatnonzero(found.gap < -DEPTH_OK).tolist():
        same = (cell == np.round(found.place[place, 0])) & (np.abs(rows[:, 1] - found.place[place, 1]) < SAME_PLACE)
        if not same.any() or (normal[same] @ found.normal[place]).max() < SAME_SIDE:
            return False
    return True


def places_of(arc_lengths: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Places [segments from the start] of arc lengths [m]."""
    return np.asarray(np.interp(arc_lengths, s, np.arange(len(s))))
